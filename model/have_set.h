// HaveSet: which records an agent had. The one thing that decides what a peer is sent, and the acknowledgment itself.
//
// Per stream a set of seqs that are held (row present) and a set that is dropped (superseded or pruned, for ever).
// Both count as had. Sizes grow with the number of gaps, not of records. Plain values, not thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "model/error.h"
#include "model/record_key.h"

namespace moondb::proto {
class HaveSet;
}  // namespace moondb::proto

namespace moondb {

// A set of seqs (1 and up) as sorted, disjoint, non-adjacent closed intervals.
class IntervalSet {
 public:
  struct Interval {
    std::uint64_t first = 0;
    std::uint64_t last = 0;
    // Seqs begin at 1 and end one below 2^64.
    bool IsValid() const { return first >= 1 && first <= last && last < UINT64_MAX; }
    bool operator==(const Interval&) const = default;
  };

  void Add(std::uint64_t seq) { Add(Interval{seq, seq}); }
  void Add(Interval interval);
  void Add(const IntervalSet& other);
  void Remove(std::uint64_t seq);

  bool Contains(std::uint64_t seq) const;
  bool is_empty() const { return intervals_.empty(); }
  std::uint64_t Count() const;
  std::uint64_t Max() const;  // 0 when empty.

  // What is in this set and not in `other`.
  IntervalSet Minus(const IntervalSet& other) const;
  // The intervals that have a seq in common with `other`.
  IntervalSet Around(const IntervalSet& other) const;

  const std::vector<Interval>& intervals() const { return intervals_; }
  bool operator==(const IntervalSet&) const = default;

 private:
  std::vector<Interval> intervals_;
};

struct StreamHave {
  IntervalSet held;
  IntervalSet dropped;

  IntervalSet Covered() const;
  // Union. A seq dropped on either side ends up dropped.
  void Merge(const StreamHave& other);
  std::size_t IntervalCount() const { return held.intervals().size() + dropped.intervals().size(); }
  bool operator==(const StreamHave&) const = default;
};

// Limits for what a peer may send (each is an error at the door, not a truncation).
inline constexpr int kHaveStreamsMax = 65536;
inline constexpr int kHaveIntervalsPerStreamMax = 65536;
inline constexpr std::size_t kHaveIntervalsMax = 262'144;  // Of all streams.

class HaveSet {
 public:
  StreamHave& operator[](const StreamKey& key) { return streams_[key]; }
  const StreamHave& Get(const StreamKey& key) const;  // An empty one where there is none.

  // Union, stream by stream. A seq dropped on either side ends up dropped.
  void Merge(const HaveSet& other);
  // kInvalid where the union would be larger than a have-set may be.
  Result<void> CheckJoins(const HaveSet& other) const;
  // Of the streams of `other`, the intervals that have a seq in common with what `other` had.
  HaveSet Around(const HaveSet& other) const;

  const std::map<StreamKey, StreamHave>& streams() const { return streams_; }
  std::size_t IntervalCount() const;
  bool operator==(const HaveSet&) const = default;

 private:
  std::map<StreamKey, StreamHave> streams_;
};

proto::HaveSet ToProto(const HaveSet& have);

// Checks everything: agent ids, limits, intervals sorted, disjoint, not adjacent and from 1, held and dropped disjoint.
// kInvalid with the field named otherwise.
Result<HaveSet> FromProto(const proto::HaveSet& have);

}  // namespace moondb
