// Feed: a read with wait_s that found nothing, and waits for something of its types to be stored.
//
// It is asked anew when StorageActor publishes that such records were stored, and then reads what came since alone.
// Plain value of GatewayActor's.
#pragma once

#include "proto/storage.pb.h"

namespace moondb {

class Feed {
 public:
  // `last_row_id` is that of the rows there are, as far as known.
  Feed(proto::ReadRequest request, std::uint64_t last_row_id)
      : request_(std::move(request)), known_row_id_(last_row_id) {}

  bool Wants(const proto::RecordsStored& stored) const;
  // Something that it wants was stored while it was being asked.
  void SetStale() { is_stale_ = true; }
  bool is_stale() const { return is_stale_; }

  // The question to storage; it is not stale any more.
  const proto::ReadRequest& Ask(std::uint64_t last_row_id);
  // Storage's answer was empty.
  void OnEmptyPage(bool is_complete);

 private:
  proto::ReadRequest request_;
  bool is_stale_ = false;
  std::uint64_t known_row_id_;  // The last of the rows that there were when it was asked.
};

}  // namespace moondb
