// Fragmentation: splits a batch that is too large for one radio message into fragments, and resumes after a lost link.
//
// A batch of one large record is coded once and cut into fragments. Each fragment is a batch of the session with its
// own number, counts against the credit, and is acknowledged. A fragment identifies the whole coded batch by hash and
// size. The receiver accepts fragments only in order and keeps them in memory. The Have message of the receiver names
// the hash of the whole and how many of its bytes it holds. When the last fragment arrives, the receiver decodes the
// whole.
//
// The receiver holds at most one whole per sender, of at most kWholeBytesMax, and at most `bytes_max` for all senders.
// If there is no room, it discards the unfinished whole that was begun first. The sender of that whole has to start
// again.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "actors/sharing/codec.h"
#include "model/error.h"
#include "model/ids.h"
#include "model/record_check.h"
#include "proto/sharing.pb.h"

namespace moondb {

// Bytes of the largest record, plus the overhead of its coding.
inline constexpr std::size_t kWholeBytesMax = kRecordContentBytesMax + 64 * 1024;

// How many bytes of a fragmented batch a receiver holds, counted from the first byte. `hash` 0: it holds no part of a
// batch.
struct PartOfWhole {
  std::uint64_t hash = 0;
  std::size_t bytes = 0;
};

class FragmentCutter {
 public:
  // Starts behind the bytes that the receiver already holds (`covered`), if these belong to `whole`.
  FragmentCutter(CodedBatch whole, std::uint32_t record_count, const PartOfWhole& covered);

  // Returns the next batch, with codec, coded, record_count and fragment filled in. It has at most `bytes_max` bytes of
  // the whole. Requires: `bytes_max` is not 0.
  proto::Batch Next(std::size_t bytes_max);
  bool is_done() const { return next_ == whole_.bytes.size(); }

 private:
  CodedBatch whole_;
  std::uint32_t record_count_;
  std::uint64_t hash_;
  std::size_t next_ = 0;
};

class FragmentCollector {
 public:
  explicit FragmentCollector(std::size_t bytes_max, std::size_t whole_bytes_max = kWholeBytesMax)
      : bytes_max_(bytes_max), whole_bytes_max_(std::min(bytes_max, whole_bytes_max)) {}

  // Adds a fragment. Returns the bytes of the whole if the fragment was the last one, else nullopt. Ignores a duplicate
  // fragment. kNotFound if earlier fragments are missing here; the sender has to start again. kCorrupt if the fragment
  // is malformed, or the whole does not match its hash.
  Result<std::optional<std::string>> Take(AgentId sender, const proto::Batch& batch);

  PartOfWhole PartFrom(AgentId sender) const;

 private:
  struct Part {
    AgentId sender = 0;
    std::uint64_t hash = 0;
    std::uint64_t size = 0;
    std::string bytes;
    // Bytes of the buffer that this whole or an earlier one has written. Only these bytes take memory.
    std::size_t written_bytes = 0;
  };

  Part* Find(AgentId sender);
  void Forget(AgentId sender);

  std::size_t bytes_max_;
  std::size_t whole_bytes_max_;
  std::deque<Part> parts_;  // Unfinished wholes, in the order in which they were begun.
};

}  // namespace moondb
