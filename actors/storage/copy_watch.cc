#include "actors/storage/copy_watch.h"

#include <algorithm>
#include <utility>

#include "actors/storage/record_store.h"
#include "actors/storage/record_tables.h"
#include "proto/status.pb.h"

namespace moondb {

namespace {

constexpr std::size_t kTimesMax = 1024;
constexpr int kAgeParts = 32;  // Times as old as A lie at most A / kAgeParts apart.

IntervalSet CoveredBy(const PeerLog::Covered& covered, const StreamKey& stream) {
  const auto found = covered.find(stream);
  return found == covered.end() ? IntervalSet() : found->second;
}

// Returns the row id of the record that was stored first among the first ones of each interval; 0 if there is none.
Result<std::uint64_t> FindOldestRow(Database& database, const HaveSet& records) {
  std::uint64_t oldest = 0;
  for (const auto& [stream, have] : records.streams()) {
    const RecordTable* table = FindRecordTable(stream.type);
    if (table == nullptr || have.held.is_empty()) continue;
    const auto row = table->Find(database, {stream, have.held.intervals().front().first});
    if (!row) return tl::unexpected(row.error());
    if (*row && (oldest == 0 || (*row)->row_id < oldest)) oldest = (*row)->row_id;
  }
  return oldest;
}

}  // namespace

CopyWatch::CopyWatch(AgentId self, const proto::TeamConfig& team)
    : self_(self), is_limited_(team.retention().keep_days() > 0 || team.retention().store_mb_max() > 0) {
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.kind() == proto::AGENT_KIND_BASE_STATION) base_stations_.insert(agent.id());
    if (agent.id() != self && !agent.left()) peers_.insert(agent.id());
  }
}

void CopyWatch::ObserveRoles(const proto::RoleAssignment& roles) {
  leader_ = roles.leader();
  survivor_ = roles.survivor();
}

void CopyWatch::ObserveTime(Time now, std::uint64_t next_row_id) {
  if (times_.size() > 1 && times_.back().second == next_row_id) times_.pop_back();  // Nothing was stored since then.
  times_.emplace_back(now, next_row_id);
  if (times_.size() <= kTimesMax) return;
  std::deque<std::pair<Time, std::uint64_t>> kept{times_.front()};
  for (std::size_t i = 1; i + 1 < times_.size(); ++i) {
    const bool is_needed = (times_[i + 1].first - kept.back().first) * kAgeParts > now - times_[i].first;
    if (is_needed) kept.push_back(times_[i]);
  }
  kept.push_back(times_.back());
  times_ = std::move(kept);
}

bool CopyWatch::HoldsForOthers(AgentId peer) const {
  return !is_limited_ || peer == leader_ || peer == survivor_ || base_stations_.contains(peer);
}

bool CopyWatch::IsCounted(AgentId origin) const {
  return origin == self_ || (self_ == leader_ && !HoldsForOthers(origin));
}

HaveSet CopyWatch::FindOneCopy(const HaveSet& have, const PeerLog& log) const {
  HaveSet one_copy;
  for (const auto& [stream, state] : have.streams()) {
    if (!IsCounted(stream.origin)) continue;
    IntervalSet alone = state.held;
    for (const AgentId peer : peers_) {
      if (HoldsForOthers(peer)) alone = alone.Minus(CoveredBy(log.KnownOf(peer), stream));
    }
    if (!alone.is_empty()) one_copy[stream].held = std::move(alone);
  }
  return one_copy;
}

Result<void> CopyWatch::Describe(RecordStore& store, Time now, proto::StorageStatus& status) const {
  const HaveSet& have = store.have();
  const PeerLog& log = store.peer_log();
  for (const AgentId peer : peers_) {
    proto::PeerBacklog& backlog = *status.add_backlogs();
    backlog.set_agent_id(peer);
    for (const auto& [stream, state] : have.streams()) {
      const auto count = static_cast<double>(state.held.Minus(CoveredBy(log.KnownOf(peer), stream)).Count());
      backlog.set_all_count(backlog.all_count() + count);
      if (stream.origin == self_) backlog.set_own_count(backlog.own_count() + count);
    }
  }
  const HaveSet one_copy = FindOneCopy(have, log);
  proto::OneCopy& shown = *status.mutable_one_copy();
  for (const auto& [stream, state] : one_copy.streams()) {
    shown.set_count(shown.count() + static_cast<double>(state.held.Count()));
  }
  const Result<std::uint64_t> oldest = FindOldestRow(store.database(), one_copy);
  if (!oldest) return tl::unexpected(oldest.error());
  if (*oldest == 0 || times_.empty()) return {};
  auto time = std::find_if(times_.begin(), times_.end(), [&oldest](const auto& at) { return at.second > *oldest; });
  // A record from before the first call has at least the age of this call.
  if (time != times_.begin()) --time;
  shown.set_age_s(std::chrono::duration<double>(now - time->first).count());
  return {};
}

}  // namespace moondb
