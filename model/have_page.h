// HavePageWriter: splits a have-set into pages that each fit into one message.
//
// A page describes all records in a range of keys, ordered by stream and then by seq. If the page does not list a
// record in that range, the agent neither holds nor has dropped the record. A stream is split across pages only if it
// does not fit into one page. Pages made at different times can be merged into one have-set, so the writer keeps no
// state between pages.
#pragma once

#include <cstddef>
#include <optional>

#include "model/have_set.h"
#include "model/record_key.h"
#include "proto/have.pb.h"

namespace moondb {

// Size limit in bytes of a page that is sent over the radio, which takes 0.2 s at 1 Mbps. The message with the page
// fits into a link's initial credit (32 KiB) and into an outbox's reserve for control messages (32 KiB).
inline constexpr std::size_t kHavePageBytesMax = 24 * 1024;
// Upper limits of encoded sizes in bytes: a stream without its intervals, and one interval.
inline constexpr std::size_t kHaveStreamBytesMax = 32;
inline constexpr std::size_t kHaveIntervalBytesMax = 24;
// Maximum number of pages of a have-set. Two successive pages together always have more than kHavePageBytesMax bytes.
inline constexpr int kHavePagesMax = 1024;
static_assert(2 * (kHaveStreamsMax * kHaveStreamBytesMax + kHaveIntervalsMax * kHaveIntervalBytesMax) <
              kHavePagesMax * kHavePageBytesMax);

class HavePageWriter {
 public:
  // Starts a page at the record `from`; a default key means the first record. The page has at most `bytes_max` bytes
  // (0: no limit), but always has room for one interval.
  HavePageWriter(const RecordKey& from, std::size_t bytes_max);

  // Adds a stream; an empty stream is left out. Returns false if the page is full; next() is then the first record of
  // the next page. Requires: streams are added in the order of their keys, and the first stream is not before `from`.
  bool Add(const StreamKey& key, const StreamHave& have);

  const std::optional<RecordKey>& next() const { return next_; }
  proto::HaveSet& page() { return page_; }

 private:
  RecordKey from_;
  std::size_t bytes_max_;
  std::size_t bytes_ = 0;
  std::optional<RecordKey> next_;
  proto::HaveSet page_;
};

}  // namespace moondb
