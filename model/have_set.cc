#include "model/have_set.h"

#include <algorithm>
#include <string>

#include "model/check.h"
#include "proto/have.pb.h"

namespace moondb {

void IntervalSet::Add(Interval interval) {
  Check(interval.IsValid(), "an interval of seqs has first <= last, from 1");
  // The first interval that overlaps or touches the new one.
  auto begin = std::lower_bound(intervals_.begin(), intervals_.end(), interval.first,
                                [](const Interval& i, std::uint64_t first) { return i.last + 1 < first; });
  auto end = begin;
  while (end != intervals_.end() && end->first <= interval.last + 1) {
    interval.first = std::min(interval.first, end->first);
    interval.last = std::max(interval.last, end->last);
    ++end;
  }
  if (begin == end) {
    intervals_.insert(begin, interval);
  } else {
    *begin = interval;
    intervals_.erase(begin + 1, end);
  }
}

void IntervalSet::Add(const IntervalSet& other) {
  for (const Interval& interval : other.intervals_) Add(interval);
}

void IntervalSet::Remove(std::uint64_t seq) {
  auto it = std::lower_bound(intervals_.begin(), intervals_.end(), seq,
                             [](const Interval& i, std::uint64_t s) { return i.last < s; });
  if (it == intervals_.end() || it->first > seq) return;
  const Interval old = *it;
  if (old.first == old.last) {
    intervals_.erase(it);
  } else if (seq == old.first) {
    it->first = seq + 1;
  } else if (seq == old.last) {
    it->last = seq - 1;
  } else {
    it->last = seq - 1;
    intervals_.insert(it + 1, Interval{seq + 1, old.last});
  }
}

bool IntervalSet::Contains(std::uint64_t seq) const {
  const auto it = std::lower_bound(intervals_.begin(), intervals_.end(), seq,
                                   [](const Interval& i, std::uint64_t s) { return i.last < s; });
  return it != intervals_.end() && it->first <= seq;
}

std::uint64_t IntervalSet::Count() const {
  std::uint64_t count = 0;
  for (const Interval& interval : intervals_) count += interval.last - interval.first + 1;
  return count;
}

std::uint64_t IntervalSet::Max() const { return intervals_.empty() ? 0 : intervals_.back().last; }

IntervalSet IntervalSet::Minus(const IntervalSet& other) const {
  IntervalSet result;
  auto hole = other.intervals_.begin();
  for (Interval rest : intervals_) {
    while (hole != other.intervals_.end() && hole->last < rest.first) ++hole;
    bool is_used_up = false;
    for (auto h = hole; h != other.intervals_.end() && h->first <= rest.last; ++h) {
      if (h->first > rest.first) result.intervals_.push_back({rest.first, h->first - 1});
      if (h->last >= rest.last) {
        is_used_up = true;
        break;
      }
      rest.first = h->last + 1;
    }
    if (!is_used_up) result.intervals_.push_back(rest);
  }
  return result;
}

IntervalSet IntervalSet::Around(const IntervalSet& other) const {
  IntervalSet result;
  auto it = intervals_.begin();
  for (const Interval& named : other.intervals_) {
    it = std::lower_bound(it, intervals_.end(), named.first,
                          [](const Interval& i, std::uint64_t first) { return i.last < first; });
    for (; it != intervals_.end() && it->first <= named.last; ++it) result.intervals_.push_back(*it);
  }
  return result;
}

IntervalSet StreamHave::Covered() const {
  IntervalSet covered = held;
  covered.Add(dropped);
  return covered;
}

void StreamHave::Merge(const StreamHave& other) {
  dropped.Add(other.dropped);
  held.Add(other.held);
  held = held.Minus(dropped);
}

const StreamHave& HaveSet::Get(const StreamKey& key) const {
  static const StreamHave kNothing;
  const auto it = streams_.find(key);
  return it == streams_.end() ? kNothing : it->second;
}

void HaveSet::Merge(const HaveSet& other) {
  for (const auto& [key, theirs] : other.streams_) streams_[key].Merge(theirs);
}

Result<void> HaveSet::CheckJoins(const HaveSet& other) const {
  std::size_t stream_count = streams_.size();
  std::size_t interval_count = IntervalCount();
  for (const auto& [key, theirs] : other.streams_) {
    StreamHave joined = Get(key);
    stream_count += streams_.contains(key) ? 0 : 1;
    interval_count -= joined.IntervalCount();
    joined.Merge(theirs);
    interval_count += joined.IntervalCount();
    const std::size_t most = std::max(joined.held.intervals().size(), joined.dropped.intervals().size());
    if (most > kHaveIntervalsPerStreamMax) return Fail(ErrorCode::kInvalid, "has too many intervals", "have");
  }
  const bool fits = stream_count <= kHaveStreamsMax && interval_count <= kHaveIntervalsMax;
  if (!fits) return Fail(ErrorCode::kInvalid, "has grown too large", "have");
  return {};
}

HaveSet HaveSet::Around(const HaveSet& other) const {
  HaveSet result;
  for (const auto& [key, named] : other.streams_) {
    const StreamHave& ours = Get(key);
    result[key] = {ours.held.Around(named.Covered()), ours.dropped.Around(named.Covered())};
  }
  return result;
}

std::size_t HaveSet::IntervalCount() const {
  std::size_t count = 0;
  for (const auto& [key, stream] : streams_) count += stream.IntervalCount();
  return count;
}

namespace {

void ToProto(const IntervalSet& set, google::protobuf::RepeatedPtrField<proto::Interval>& out) {
  for (const IntervalSet::Interval& interval : set.intervals()) {
    proto::Interval& added = *out.Add();
    added.set_first(interval.first);
    added.set_last(interval.last);
  }
}

Result<IntervalSet> FromProto(const google::protobuf::RepeatedPtrField<proto::Interval>& intervals,
                              const std::string& field) {
  if (intervals.size() > kHaveIntervalsPerStreamMax) return Fail(ErrorCode::kInvalid, "has too many intervals", field);
  IntervalSet set;
  std::uint64_t previous_last = 0;
  for (const proto::Interval& interval : intervals) {
    const IntervalSet::Interval added{interval.first(), interval.last()};
    const bool is_apart = set.is_empty() || added.first > previous_last + 1;  // There is a gap of at least one seq.
    if (!added.IsValid() || !is_apart) {
      return Fail(ErrorCode::kInvalid, "intervals are reversed, overlapping, touching or out of order", field);
    }
    set.Add(added);
    previous_last = added.last;
  }
  return set;
}

}  // namespace

proto::HaveSet ToProto(const HaveSet& have) {
  proto::HaveSet result;
  for (const auto& [key, stream] : have.streams()) {
    proto::StreamHave& added = *result.add_streams();
    added.set_origin_agent(key.origin);
    added.set_epoch(key.epoch);
    added.set_data_type(key.type);
    ToProto(stream.held, *added.mutable_held());
    ToProto(stream.dropped, *added.mutable_dropped());
  }
  return result;
}

Result<HaveSet> FromProto(const proto::HaveSet& have) {
  if (have.streams_size() > kHaveStreamsMax) return Fail(ErrorCode::kInvalid, "has too many streams", "streams");
  HaveSet result;
  std::size_t interval_count = 0;
  for (int i = 0; i < have.streams_size(); ++i) {
    const proto::StreamHave& stream = have.streams(i);
    const std::string field = "streams[" + std::to_string(i) + "]";
    interval_count += static_cast<std::size_t>(stream.held_size()) + static_cast<std::size_t>(stream.dropped_size());
    if (interval_count > kHaveIntervalsMax) return Fail(ErrorCode::kInvalid, "has too many intervals", "streams");
    if (stream.origin_agent() < 1 || stream.origin_agent() > kAgentIdMax) {
      return Fail(ErrorCode::kInvalid, "is not an agent id", field + ".origin_agent");
    }
    const StreamKey key{stream.origin_agent(), stream.epoch(), stream.data_type()};
    if (result.streams().count(key)) return Fail(ErrorCode::kInvalid, "occurs twice", field);
    Result<IntervalSet> held = FromProto(stream.held(), field + ".held");
    if (!held) return tl::unexpected(held.error());
    Result<IntervalSet> dropped = FromProto(stream.dropped(), field + ".dropped");
    if (!dropped) return tl::unexpected(dropped.error());
    if (held->Minus(*dropped) != *held) return Fail(ErrorCode::kInvalid, "is both held and dropped", field);
    result[key] = StreamHave{*std::move(held), *std::move(dropped)};
  }
  return result;
}

}  // namespace moondb
