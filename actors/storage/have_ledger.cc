#include "actors/storage/have_ledger.h"

#include <algorithm>
#include <iterator>
#include <string>

#include "model/record_hash.h"

namespace moondb {

namespace {

std::uint64_t HashOf(const StreamKey& stream, bool is_dropped, const IntervalSet::Interval& interval) {
  return HashRecord({stream, interval.first}, (is_dropped ? "dropped " : "held ") + std::to_string(interval.last));
}

Result<void> WriteIntervals(Database& database, const StreamKey& stream, bool is_dropped, const IntervalSet& old_set,
                            const IntervalSet& new_set) {
  // Within each set, intervals are disjoint and sorted by `first`. They are thus also sorted by (`first`, `last`), and
  // std::set_difference with this order finds all changed intervals.
  const auto less = [](const IntervalSet::Interval& a, const IntervalSet::Interval& b) {
    return a.first != b.first ? a.first < b.first : a.last < b.last;
  };
  const auto& olds = old_set.intervals();
  const auto& news = new_set.intervals();
  std::vector<IntervalSet::Interval> gone;
  std::vector<IntervalSet::Interval> come;
  std::set_difference(olds.begin(), olds.end(), news.begin(), news.end(), std::back_inserter(gone), less);
  std::set_difference(news.begin(), news.end(), olds.begin(), olds.end(), std::back_inserter(come), less);
  for (const IntervalSet::Interval& interval : gone) {
    Query query = database.Prepare(
        "DELETE FROM have_interval WHERE origin = ? AND epoch = ? AND data_type = ? AND is_dropped = ? AND first = ?");
    query << stream.origin << stream.epoch << stream.type << is_dropped << interval.first;
    if (const Result<void> done = query.Run(); !done) return done;
  }
  for (const IntervalSet::Interval& interval : come) {
    Query query = database.Prepare(
        "INSERT INTO have_interval(origin, epoch, data_type, is_dropped, first, last, hash)"
        " VALUES(?, ?, ?, ?, ?, ?, ?)");
    query << stream.origin << stream.epoch << stream.type << is_dropped << interval.first << interval.last
          << HashOf(stream, is_dropped, interval);
    if (const Result<void> done = query.Run(); !done) return done;
  }
  return {};
}

}  // namespace

Result<void> HaveLedger::Load(Database& database) {
  is_sound_ = true;
  HaveSet have;
  Query query = database.Prepare("SELECT origin, epoch, data_type, is_dropped, first, last, hash FROM have_interval");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return tl::unexpected(row.error());
    if (!*row) break;
    const StreamKey key{static_cast<AgentId>(query.Integer(0)), query.Unsigned(1),
                        static_cast<DataType>(query.Integer(2))};
    const bool is_dropped = query.Integer(3) != 0;
    const IntervalSet::Interval interval{query.Unsigned(4), query.Unsigned(5)};
    if (query.Unsigned(6) == HashOf(key, is_dropped, interval) && interval.IsValid()) {
      (is_dropped ? have[key].dropped : have[key].held).Add(interval);
    } else {
      is_sound_ = false;
    }
  }
  have_ = std::move(have);
  Forget();
  CountStreams();
  return {};
}

void HaveLedger::CountStreams() {
  stream_counts_.clear();
  for (const auto& [stream, state] : have_.streams()) ++stream_counts_[stream.origin];
}

std::size_t HaveLedger::StreamsOf(AgentId origin) const {
  const auto kept = stream_counts_.find(origin);
  const auto drafted = new_in_draft_.find(origin);
  return (kept == stream_counts_.end() ? 0 : kept->second) + (drafted == new_in_draft_.end() ? 0 : drafted->second);
}

void HaveLedger::Forget() {
  draft_.clear();
  new_in_draft_.clear();
}

Result<void> HaveLedger::Replace(Database& database, const HaveSet& have) {
  if (const Result<void> done = database.Execute("DELETE FROM have_interval"); !done) return done;
  have_ = HaveSet();
  stream_counts_.clear();
  new_in_draft_.clear();
  draft_ = have.streams();
  for (const auto& [stream, state] : draft_) ++new_in_draft_[stream.origin];
  return Write(database);
}

const StreamHave& HaveLedger::Get(const StreamKey& stream) const {
  const auto drafted = draft_.find(stream);
  return drafted == draft_.end() ? have_.Get(stream) : drafted->second;
}

RecordKey HaveLedger::NewestHeld(AgentId origin, DataType type) const {
  RecordKey newest{{origin, 0, type}, 0};
  const auto look = [&](const std::map<StreamKey, StreamHave>& streams, const auto& is_outdated) {
    for (auto it = streams.lower_bound({origin, 0, 0}); it != streams.end() && it->first.origin == origin; ++it) {
      const auto& [stream, have] = *it;
      if (stream.type != type || have.held.is_empty() || is_outdated(stream)) continue;
      if (newest.seq == 0 || stream.epoch >= newest.stream.epoch) newest = {stream, have.held.Max()};
    }
  };
  look(have_.streams(), [this](const StreamKey& stream) { return draft_.contains(stream); });
  look(draft_, [](const StreamKey&) { return false; });
  return newest;
}

StreamHave& HaveLedger::Edit(const StreamKey& stream) {
  const auto [entry, is_new] = draft_.try_emplace(stream, have_.Get(stream));
  if (is_new && !have_.streams().contains(stream)) ++new_in_draft_[stream.origin];
  return entry->second;
}

void HaveLedger::AddHeld(const StreamKey& stream, std::uint64_t seq) { Edit(stream).held.Add(seq); }

void HaveLedger::AddDropped(const StreamKey& stream, IntervalSet::Interval interval) {
  StreamHave& edited = Edit(stream);
  edited.dropped.Add(interval);
  if (interval.first == interval.last) {
    edited.held.Remove(interval.first);
  } else {
    edited.held = edited.held.Minus(edited.dropped);
  }
}

Result<void> HaveLedger::Write(Database& database) const {
  for (const auto& [key, stream] : draft_) {
    const StreamHave& old = have_.Get(key);
    if (const Result<void> done = WriteIntervals(database, key, false, old.held, stream.held); !done) return done;
    if (const Result<void> done = WriteIntervals(database, key, true, old.dropped, stream.dropped); !done) return done;
  }
  return {};
}

void HaveLedger::Keep() {
  for (auto& [key, stream] : draft_) have_[key] = std::move(stream);
  for (const auto& [origin, count] : new_in_draft_) stream_counts_[origin] += count;
  Forget();
}

}  // namespace moondb
