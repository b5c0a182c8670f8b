#include "model/have_page.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "proto/have.pb.h"

namespace moondb {
namespace {

// Bytes that precede an encoded stream (at most) and an encoded interval (exactly): a tag and a length.
constexpr std::size_t kElementHeadBytes = 6;
constexpr std::size_t kIntervalHeadBytes = 2;

// Iterates over the held and dropped intervals of a stream in the order of their seqs, starting at a given seq.
class IntervalWalk {
 public:
  IntervalWalk(const StreamHave& have, std::uint64_t first_seq)
      : first_seq_(first_seq), held_(have.held, first_seq), dropped_(have.dropped, first_seq) {}

  bool has_more() const { return held_.has_more() || dropped_.has_more(); }
  bool is_held() const { return !dropped_.has_more() || (held_.has_more() && held_.at->first < dropped_.at->first); }
  // Returns the part of the current interval that begins at first_seq_ or later. The interval itself may begin before
  // first_seq_, if a new record has closed the gap before first_seq_ since the previous page was made.
  IntervalSet::Interval interval() const {
    const IntervalSet::Interval& whole = is_held() ? *held_.at : *dropped_.at;
    return {std::max(whole.first, first_seq_), whole.last};
  }
  void Next() { ++(is_held() ? held_.at : dropped_.at); }

 private:
  struct Side {
    using Iterator = std::vector<IntervalSet::Interval>::const_iterator;
    Side(const IntervalSet& set, std::uint64_t first_seq)
        : at(std::lower_bound(set.intervals().begin(), set.intervals().end(), first_seq,
                              [](const IntervalSet::Interval& i, std::uint64_t seq) { return i.last < seq; })),
          end(set.intervals().end()) {}
    bool has_more() const { return at != end; }

    Iterator at;
    Iterator end;
  };

  std::uint64_t first_seq_;
  Side held_;
  Side dropped_;
};

}  // namespace

HavePageWriter::HavePageWriter(const RecordKey& from, std::size_t bytes_max)
    : from_(from), bytes_max_(bytes_max == 0 ? SIZE_MAX : bytes_max) {}

bool HavePageWriter::Add(const StreamKey& key, const StreamHave& have) {
  const std::uint64_t first_seq = key == from_.stream ? from_.seq : 0;
  const bool is_first_stream = page_.streams().empty();
  proto::StreamHave part;
  part.set_origin_agent(key.origin);
  part.set_epoch(key.epoch);
  part.set_data_type(key.type);
  std::size_t bytes = bytes_ + part.ByteSizeLong() + kElementHeadBytes;
  IntervalWalk walk(have, first_seq);
  if (!walk.has_more()) return true;
  for (; walk.has_more(); walk.Next()) {
    proto::Interval interval;
    interval.set_first(walk.interval().first);
    interval.set_last(walk.interval().last);
    bytes += interval.ByteSizeLong() + kIntervalHeadBytes;
    const bool is_first = part.held().empty() && part.dropped().empty();
    if (bytes > bytes_max_ && !(is_first_stream && is_first)) {
      next_ = RecordKey{key, is_first_stream ? interval.first() : std::max<std::uint64_t>(first_seq, 1)};
      if (is_first_stream) *page_.add_streams() = std::move(part);
      return false;
    }
    *(walk.is_held() ? part.add_held() : part.add_dropped()) = interval;
  }
  bytes_ = bytes;
  *page_.add_streams() = std::move(part);
  return true;
}

}  // namespace moondb
