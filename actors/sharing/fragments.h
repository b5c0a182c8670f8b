// Fragments: splits a batch that is too large for one radio message into fragments, and resumes after a lost
// connection.
//
// A batch of one large record is coded once and cut into fragments. Each fragment is sent as a batch with its own
// number, counts against the credit, and is acknowledged. A fragment identifies the whole coded batch by hash and size.
// The receiver accepts fragments only in order, keeps them in memory, and decodes the whole when the last fragment has
// arrived. The receiver's answer to a Hello reports the hash of the whole and how many of its bytes have arrived, so
// the sender can continue there.
//
// The receiver holds at most one whole per sender, of at most kWholeBytesMax, and at most `bytes_max` for all senders.
// If there is no room, it discards the unfinished whole that was begun first, and the sender of that whole has to start
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

// The part of a fragmented batch that a receiver holds: the first `bytes` bytes of the whole with this hash. `hash` 0:
// the receiver holds no part.
struct PartOfWhole {
  std::uint64_t hash = 0;
  std::size_t bytes = 0;
};

class FragmentCutter {
 public:
  // `covered`: the part that the receiver already holds. If it belongs to `whole`, cutting starts after this part;
  // otherwise at the first byte.
  FragmentCutter(CodedBatch whole, std::uint32_t record_count, const PartOfWhole& covered);

  // Returns the next fragment as a batch, with codec, coded, record_count and fragment filled in. The fragment has at
  // most `bytes_max` bytes. Requires: `bytes_max` is not 0.
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
  // fragment. Returns kNotFound if earlier fragments are missing, so the sender has to start again. Returns kCorrupt if
  // the fragment is malformed, or if the whole does not match its hash.
  Result<std::optional<std::string>> Take(AgentId sender, const proto::Batch& batch);

  PartOfWhole PartFrom(AgentId sender) const;

 private:
  struct Part {
    AgentId sender = 0;
    std::uint64_t hash = 0;
    std::uint64_t size = 0;
    std::string bytes;
    // Number of bytes of the buffer of `bytes` that were ever written, for this batch or for an earlier batch of the
    // same sender. Only these bytes take memory.
    std::size_t written_bytes = 0;
  };

  Part* Find(AgentId sender);
  void Forget(AgentId sender);

  std::size_t bytes_max_;
  std::size_t whole_bytes_max_;
  std::deque<Part> parts_;  // Unfinished batches, in the order in which their first fragments arrived.
};

}  // namespace moondb
