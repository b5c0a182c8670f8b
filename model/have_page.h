// HavePageWriter: cuts a have-set into pages, each small enough for one message, whatever streams and gaps there are.
//
// A page speaks of all records from one key up to another, in the order of streams and of seqs within a stream: what it
// does not name there, the agent never had. A stream is cut between two pages only where it fits into no page alone.
// Each page is true by itself for the moment at which it was made, as the streams of an acknowledgment are, so that
// pages of several moments join to one have-set and nothing is kept between them.
#pragma once

#include <cstddef>
#include <optional>

#include "model/have_set.h"
#include "model/record_key.h"
#include "proto/have.pb.h"

namespace moondb {

// Of a page that crosses the radio, without what is around it in its message: 0.2 s of 1 Mbps. With that it fits into
// the credit with which a link begins and into what an outbox reserves for control messages, 32 KiB each.
inline constexpr std::size_t kHavePageBytesMax = 24 * 1024;
// At most, of a stream without its intervals and of an interval.
inline constexpr std::size_t kHaveStreamBytesMax = 32;
inline constexpr std::size_t kHaveIntervalBytesMax = 24;
// The largest have-set takes no more pages, since two that follow each other are more than one page together.
inline constexpr int kHavePagesMax = 1024;
static_assert(2 * (kHaveStreamsMax * kHaveStreamBytesMax + kHaveIntervalsMax * kHaveIntervalBytesMax) <
              kHavePagesMax * kHavePageBytesMax);

class HavePageWriter {
 public:
  // Of records from `from` on; a default key: from the first on. Of at most `bytes_max`, but with one interval at
  // least; 0: not limited.
  HavePageWriter(const RecordKey& from, std::size_t bytes_max);

  // Streams are added in the order of their keys, the first one not before `from`; one of which nothing was had is left
  // out. False: the page is full, and next()
  // says with which record the next page begins.
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
