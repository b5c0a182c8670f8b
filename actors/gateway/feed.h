// Feed: a read request with wait_s that found no record, and waits until a record of the requested types is stored.
//
// GatewayActor repeats the read when StorageActor publishes that such a record was stored. The repeated read skips rows
// that earlier reads have searched. A value owned by GatewayActor.
#pragma once

#include "proto/storage.pb.h"

namespace moondb {

class Feed {
 public:
  // `last_row_id`: the largest row id known to be stored.
  Feed(proto::ReadRequest request, std::uint64_t last_row_id)
      : request_(std::move(request)), known_row_id_(last_row_id) {}

  bool Wants(const proto::RecordsStored& stored) const;
  // Remembers that a matching record was stored during the read in progress, so the read must be repeated.
  void SetStale() { is_stale_ = true; }
  bool is_stale() const { return is_stale_; }

  // Returns the read to send to storage, and clears is_stale.
  const proto::ReadRequest& Ask(std::uint64_t last_row_id);
  // Handles an empty page from storage. If the page is complete, the next read skips all rows known when the read was
  // sent.
  void OnEmptyPage(bool is_complete);

 private:
  proto::ReadRequest request_;
  bool is_stale_ = false;
  std::uint64_t known_row_id_;  // The largest row id known to be stored when the read was sent.
};

}  // namespace moondb
