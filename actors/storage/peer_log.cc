#include "actors/storage/peer_log.h"

#include <algorithm>
#include <set>
#include <utility>

namespace moondb {

namespace {

Query& operator<<(Query& query, const StreamKey& stream) {
  return query << stream.origin << stream.epoch << stream.type;
}

// Replaces the intervals of one stream in the table peer_have.
Result<void> WriteStream(Database& database, AgentId peer, const StreamKey& stream, const IntervalSet& old_set,
                         const IntervalSet& new_set) {
  if (old_set == new_set) return {};
  std::map<std::uint64_t, std::uint64_t> olds;
  for (const IntervalSet::Interval& interval : old_set.intervals()) olds[interval.first] = interval.last;
  for (const IntervalSet::Interval& interval : new_set.intervals()) {
    const auto old = olds.find(interval.first);
    const bool is_same = old != olds.end() && old->second == interval.last;
    if (old != olds.end()) olds.erase(old);
    if (is_same) continue;
    Query query = database.Prepare("INSERT OR REPLACE INTO peer_have VALUES(?, ?, ?, ?, ?, ?)");
    query << peer << stream << interval.first << interval.last;
    if (const Result<void> done = query.Run(); !done) return done;
  }
  for (const auto& [first, last] : olds) {
    Query query = database.Prepare(
        "DELETE FROM peer_have WHERE peer = ? AND origin = ? AND epoch = ? AND data_type = ? AND first = ?");
    query << peer << stream << first;
    if (const Result<void> done = query.Run(); !done) return done;
  }
  return {};
}

Result<void> WriteHandedOver(Database& database, const proto::PeerHave& note) {
  if (note.is_session_closed()) {
    Query query = database.Prepare("DELETE FROM handed_over WHERE peer = ?");
    query << note.peer();
    return query.Run();
  }
  for (const proto::RecordKey& key : note.handed_over()) {
    Query query = database.Prepare("INSERT OR IGNORE INTO handed_over VALUES(?, ?, ?, ?, ?)");
    query << note.peer() << FromProto(key).stream << key.seq();
    if (const Result<void> done = query.Run(); !done) return done;
  }
  return {};
}

}  // namespace

// Reads the table peer_have into `covered_`. Returns false if the table is damaged.
Result<bool> PeerLog::ReadAll(Database& database) {
  Query query = database.Prepare("SELECT peer, origin, epoch, data_type, first, last FROM peer_have");
  while (true) {
    const Result<bool> row = query.Step();
    if (!row) return row;
    if (!*row) return true;
    const StreamKey stream{static_cast<AgentId>(query.Integer(1)), query.Unsigned(2),
                           static_cast<DataType>(query.Integer(3))};
    const IntervalSet::Interval interval{query.Unsigned(4), query.Unsigned(5)};
    if (!interval.IsValid()) return false;
    covered_[static_cast<AgentId>(query.Integer(0))][stream].Add(interval);
  }
}

Result<void> PeerLog::Load(Database& database) {
  // Delete the entries of an earlier process. A failure is ignored, because these entries are only for display.
  const Result<std::int64_t> is_any = database.Number("SELECT EXISTS(SELECT 1 FROM handed_over)");
  if (!is_any) return tl::unexpected(is_any.error());
  if (*is_any != 0) (void)database.Execute("DELETE FROM handed_over");
  covered_.clear();
  numbers_.clear();
  const Result<bool> is_sound = ReadAll(database);
  if (!is_sound) return tl::unexpected(is_sound.error());
  if (*is_sound) return {};
  covered_.clear();  // Later sessions report their peers' records again.
  return database.Execute("DELETE FROM peer_have");
}

const PeerLog::Covered& PeerLog::KnownOf(AgentId peer) const {
  static const Covered kNothing;
  const auto known = covered_.find(peer);
  return known == covered_.end() ? kNothing : known->second;
}

bool PeerLog::Follows(const proto::PeerHave& note) const {
  const auto last = numbers_.find({note.peer(), note.kind()});
  return last != numbers_.end() && last->second + 1 == note.number();
}

PeerLog::Covered PeerLog::ChangedBy(const proto::PeerHave& note, const HaveSet& acknowledged) const {
  const Covered& known = KnownOf(note.peer());
  Covered changed;
  for (const auto& [stream, have] : acknowledged.streams()) {
    const auto before = known.find(stream);
    if (note.is_difference() && before != known.end()) changed[stream] = before->second;
    changed[stream].Add(have.Covered());
  }
  if (note.is_difference()) return changed;
  const std::set<AgentId> origins(note.origin_agents().begin(), note.origin_agents().end());
  for (const auto& [stream, covered] : known) {
    if (origins.empty() || origins.contains(stream.origin)) changed.try_emplace(stream);
  }
  return changed;
}

void PeerLog::Apply(AgentId peer, Covered changed) {
  Covered& known = covered_[peer];
  for (auto& [stream, covered] : changed) {
    if (covered.is_empty()) {
      known.erase(stream);
    } else {
      known[stream] = std::move(covered);
    }
  }
}

Result<bool> PeerLog::Store(Database& database, const proto::PeerHave& note) {
  const bool is_usable = !note.is_difference() || Follows(note);
  Covered changed;
  if (note.has_acknowledged() && is_usable) {
    const Result<HaveSet> acknowledged = FromProto(note.acknowledged());
    if (!acknowledged) return tl::unexpected(acknowledged.error());
    changed = ChangedBy(note, *acknowledged);
  }
  Result<Transaction> transaction = Transaction::Begin(database, Database::Durability::kNormal);
  if (!transaction) return tl::unexpected(transaction.error());
  const Covered& known = KnownOf(note.peer());
  const IntervalSet nothing;
  for (const auto& [stream, covered] : changed) {
    const auto before = known.find(stream);
    const Result<void> done =
        WriteStream(database, note.peer(), stream, before == known.end() ? nothing : before->second, covered);
    if (!done) return tl::unexpected(done.error());
  }
  if (const Result<void> done = WriteHandedOver(database, note); !done) return tl::unexpected(done.error());
  if (const Result<void> done = transaction->Commit(); !done) return tl::unexpected(done.error());
  Apply(note.peer(), std::move(changed));
  if (note.has_acknowledged() && is_usable) numbers_[{note.peer(), note.kind()}] = note.number();
  return is_usable;
}

bool PeerLog::IsCoveredByAny(const RecordKey& key) const {
  return std::any_of(covered_.begin(), covered_.end(), [&key](const auto& peer) {
    const auto stream = peer.second.find(key.stream);
    return stream != peer.second.end() && stream->second.Contains(key.seq);
  });
}

}  // namespace moondb
