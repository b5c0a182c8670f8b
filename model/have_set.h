// HaveSet: the records that an agent covers, as a version vector whose entries are interval sets. Sync is anti-entropy:
// only the difference of two have-sets decides which records are sent. A have-set also serves as the acknowledgment.
//
// Per stream, a have-set contains the seqs held (row present) and the seqs dropped (superseded or pruned permanently).
// A record is covered if it is held or dropped. The size grows with the number of gaps, not with the number of records.
// Value types; not thread-safe.
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
    // Valid seqs are 1 to 2^64 - 2.
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
  std::uint64_t Max() const;  // Returns 0 for an empty set.

  // Returns the seqs of this set that are not in `other`.
  IntervalSet Minus(const IntervalSet& other) const;
  // Returns the seqs that are in both sets.
  IntervalSet Intersection(const IntervalSet& other) const { return Minus(Minus(other)); }
  // Returns the intervals of this set that share a seq with `other`. The intervals are not cut to the shared seqs.
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
  // Adds the seqs of `other`. A seq that is dropped in this object or in `other` is dropped in the result.
  void Merge(const StreamHave& other);
  std::size_t IntervalCount() const { return held.intervals().size() + dropped.intervals().size(); }
  bool operator==(const StreamHave&) const = default;
};

// Limits of a have-set from a peer. A have-set that exceeds a limit is rejected, not truncated.
inline constexpr int kHaveStreamsMax = 65536;
inline constexpr int kHaveIntervalsPerStreamMax = 65536;
inline constexpr std::size_t kHaveIntervalsMax = 262'144;  // Sum over all streams.

class HaveSet {
 public:
  StreamHave& operator[](const StreamKey& key) { return streams_[key]; }
  const StreamHave& Get(const StreamKey& key) const;  // Returns an empty StreamHave if there is none.

  // Merges `other` stream by stream (StreamHave::Merge).
  void Merge(const HaveSet& other);
  // Fails with kInvalid if the result of Merge(other) would exceed the limits of a have-set.
  Result<void> CheckJoins(const HaveSet& other) const;
  // Returns, for each stream of `other`, the intervals of this have-set that share a seq with an interval of `other`
  // (held or dropped). The intervals are not cut to the shared seqs.
  HaveSet Around(const HaveSet& other) const;

  const std::map<StreamKey, StreamHave>& streams() const { return streams_; }
  std::size_t IntervalCount() const;
  bool operator==(const HaveSet&) const = default;

 private:
  std::map<StreamKey, StreamHave> streams_;
};

proto::HaveSet ToProto(const HaveSet& have);

// Validates and converts a have-set from a message. Fails with kInvalid and the field if an agent id is invalid, a
// limit is exceeded, or a seq is both held and dropped. Also fails if intervals are not sorted, disjoint, non-adjacent
// and within 1 to 2^64 - 2.
Result<HaveSet> FromProto(const proto::HaveSet& have);

}  // namespace moondb
