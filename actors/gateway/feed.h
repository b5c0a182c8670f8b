// Feed: a read request with wait_s that has found no record yet.
//
// GatewayActor repeats the read when StorageActor publishes that a record of a requested type was stored. The repeated
// read skips rows that earlier reads have searched.
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

  // Returns the read request to send to storage, and clears is_stale().
  const proto::ReadRequest& Ask(std::uint64_t last_row_id);
  // Handles an empty page from storage. If the page is complete, the next read skips all rows up to the `last_row_id`
  // that was given to Ask.
  void OnEmptyPage(bool is_complete);

 private:
  proto::ReadRequest request_;
  bool is_stale_ = false;
  std::uint64_t known_row_id_;  // The `last_row_id` given to the last Ask; initially the constructor's `last_row_id`.
};

}  // namespace moondb
