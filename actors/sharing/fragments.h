// Pieces: how one batch that is too large for a message of the radio travels, and goes on after a cut where it ended.
//
// A batch of one large record is coded once and cut into pieces, which are batches of the session like others: each has
// its number, counts against the credit and is acknowledged. A piece names the whole by its hash and size. The receiver
// keeps pieces in their order only, in memory, and says in its Have of which whole it has how much; it reads the whole
// when the last one is there. One whole of at most kWholeBytesMax per sender, so that one sender alone takes no more,
// and all together at most `bytes_max`: when there is no room, what was begun first gives way, and its sender begins
// anew.
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

// The largest record, and what its coding adds.
inline constexpr std::size_t kWholeBytesMax = kRecordContentBytesMax + 64 * 1024;

// What a receiver has of a whole; hash 0: nothing.
struct PartOfWhole {
  std::uint64_t hash = 0;
  std::size_t bytes = 0;
};

class FragmentCutter {
 public:
  // Goes on behind `had` where that is a part of this.
  FragmentCutter(CodedBatch whole, std::uint32_t record_count, const PartOfWhole& covered);

  // codec, coded, record_count and piece of the next batch, at most `bytes_max` (not 0) of the whole.
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

  // The whole's bytes, once this was its last piece. A piece that came before changes nothing. kNotFound: what comes
  // before it is not here, the sender has to begin anew. kCorrupt: it cannot be a piece, or the whole is not what its
  // hash says.
  Result<std::optional<std::string>> Take(AgentId sender, const proto::Batch& batch);

  PartOfWhole PartFrom(AgentId sender) const;

 private:
  struct Part {
    AgentId sender = 0;
    std::uint64_t hash = 0;
    std::uint64_t size = 0;
    std::string bytes;
    std::size_t written_bytes = 0;  // Of the buffer, by this whole or one before it.
  };

  Part* Find(AgentId sender);
  void Forget(AgentId sender);

  std::size_t bytes_max_;
  std::size_t whole_bytes_max_;
  std::deque<Part> parts_;  // Oldest first.
};

}  // namespace moondb
