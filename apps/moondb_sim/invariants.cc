#include "apps/moondb_sim/invariants.h"

#include <algorithm>
#include <iterator>

#include "actors/storage/peer_authority.h"
#include "apps/moondb_sim/prune_checker.h"
#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

// Returns a sort key for the order in which an origin made its records of one type.
std::pair<std::uint64_t, std::uint64_t> PlaceInSeries(const RecordKey& key) { return {key.stream.epoch, key.seq}; }

bool IsSameSeries(const StreamKey& a, const StreamKey& b) { return a.origin == b.origin && a.type == b.type; }

// LastStates returns the key of the last state of each origin and type; its seq is 0 if there is none. `seqs` returns
// the seqs of a stream to consider, such as the held seqs (HeldOf).
using LastOfSeries = std::map<std::pair<AgentId, DataType>, RecordKey>;
template <typename SeqsOf>
LastOfSeries LastStates(const HaveSet& have, const SeqsOf& seqs) {
  LastOfSeries last;
  for (const auto& [key, stream] : have.streams()) {
    if (!IsState(key.type)) continue;
    const RecordKey candidate{key, seqs(stream).Max()};
    RecordKey& known = last[{key.origin, key.type}];
    if (candidate.seq > 0 && PlaceInSeries(candidate) > PlaceInSeries(known)) known = candidate;
  }
  return last;
}

std::string NameOf(AgentId agent) { return "agent " + std::to_string(agent); }

// Returns a description of the records `seqs` of one stream, such as "1.0000000000000005.30.2 and 3 more of that
// stream".
std::string Some(const StreamKey& stream, const IntervalSet& seqs) {
  return ToString(RecordKey{stream, seqs.intervals().front().first}) + " and " + std::to_string(seqs.Count() - 1) +
         " more of that stream";
}

bool IsPoseOf(AgentId agent, const std::string& content) {
  proto::Record record;
  return record.ParseFromString(content) && record.optimized_pose().node().agent_id() == agent;
}

std::string ToString(const Invariants::PoseVersion& version) {
  const auto& [term, run] = version;
  return "run " + std::to_string(run) + " of term " + std::to_string(std::get<0>(term)) + " by agent " +
         std::to_string(std::get<1>(term));
}

template <typename IsWanted>
HaveSet Filtered(const HaveSet& have, const IsWanted& is_wanted) {
  HaveSet left;
  for (const auto& [stream, seqs] : have.streams()) {
    if (is_wanted(stream)) left[stream] = seqs;
  }
  return left;
}

// Agents with different policies hold different notes, so CheckNotes checks notes separately.
HaveSet WithoutNotes(const HaveSet& have) {
  return Filtered(have, [](const StreamKey& stream) { return stream.type != kNote; });
}

Records WithoutPrunedOrNotes(const Records& records, const HaveSet& have) {
  const HaveSet pruned = PrunedOf(have);
  Records left;
  for (const auto& [key, content] : records) {
    if (key.stream.type != kNote && !pruned.Get(key.stream).dropped.Contains(key.seq))
      left.emplace_hint(left.end(), key, content);
  }
  return left;
}

IntervalSet HeldOf(const StreamHave& stream) { return stream.held; }
IntervalSet HadOf(const StreamHave& stream) { return stream.Covered(); }

// Returns the content without the signature and the term that storage adds to a quarantine.
std::string WithoutSignature(const RecordKey& key, const std::string& content) {
  proto::Record record;
  if (key.stream.type != proto::MAP_QUARANTINE || !record.ParseFromString(content)) return content;
  record.mutable_map_quarantine()->clear_signature();
  record.mutable_map_quarantine()->clear_term();
  return record.SerializeAsString();
}

}  // namespace

HaveSet Invariants::WithoutLiars(const HaveSet& have) const {
  return Filtered(have, [this](const StreamKey& stream) { return stream.origin != liar_; });
}

void Invariants::ObserveRecord(const RecordKey& key, const std::string& stored, AgentId where) {
  if (liar_ != 0 && (where == liar_ || key.stream.origin == liar_)) return;
  const std::string content = WithoutSignature(key, stored);
  const std::uint64_t hash = ContentHash(content);
  const auto [known, is_new] = content_of_.emplace(key, hash);
  if (known->second != hash) {
    report_("one_content", NameOf(where) + " has another content of " + ToString(key));
  }
  if (!is_new) return;
  states_.OnContent(key, hash);
  CheckAsInserted(key);
  proto::Record record;
  if (!record.ParseFromString(content)) return;
  NamePose(key, record);
  NameEnds(key, record);
}

void Invariants::NamePose(const RecordKey& key, const proto::Record& record) {
  if (!record.has_optimized_pose()) return;
  const proto::OptimizedPose& pose = record.optimized_pose();
  pose_names_[key] = {{pose.node().agent_id(), pose.node().index()}, {OrderOf(pose.term()), pose.run()}};
}

void Invariants::NameEnds(const RecordKey& key, const proto::Record& record) {
  const auto add = [&](const proto::NodeKey& from, const proto::NodeKey& to) {
    ends_[key] = {{from.agent_id(), from.index()}, {to.agent_id(), to.index()}};
  };
  if (record.has_edge_verdict()) add(record.edge_verdict().from(), record.edge_verdict().to());
  if (record.has_map_match()) add(record.map_match().from(), record.map_match().to());
}

void Invariants::CheckAsInserted(const RecordKey& key) const {
  const auto content = content_of_.find(key);
  const auto inserted = inserted_as_.find(key);
  if (content == content_of_.end() || inserted == inserted_as_.end()) return;
  if (inserted->second.contains(content->second)) return;
  report_("one_content", ToString(key) + " is not what its robot inserted");
}

void Invariants::ObserveRoles(AgentId agent, const proto::RoleAssignment& roles, bool is_durable) {
  for (const auto* acted_on : {&roles_of_, &unstored_roles_of_}) {
    const auto known = acted_on->find(agent);
    if (known == acted_on->end() || !IsNewer(known->second.term(), roles.term())) continue;
    report_("term_goes_up", NameOf(agent) + " went from term " + std::to_string(known->second.term().number()) +
                                " to " + std::to_string(roles.term().number()));
  }
  (is_durable ? roles_of_ : unstored_roles_of_)[agent] = roles;
  // An agent leaves its own role out of the assignment while it cannot store the role. A leader does the same until it
  // has a term of its own.
  const bool is_whole = roles.leader() != 0 && (is_durable || roles.survivor() != 0);
  const std::string term = roles.term().SerializeAsString();
  if (is_whole) {
    assignment_of_.emplace(term, std::pair(roles.leader(), roles.survivor()));
    had_role_.insert({roles.leader(), roles.survivor()});
  }
  const auto assignment = assignment_of_.find(term);
  if (assignment == assignment_of_.end()) return;
  const auto [leader, survivor] = assignment->second;
  const bool is_same = (roles.leader() == leader || (roles.leader() == 0 && leader == agent)) &&
                       (roles.survivor() == survivor || (roles.survivor() == 0 && survivor == agent));
  if (is_same) return;
  report_("one_assignment", "term " + roles.term().ShortDebugString() + " is " + std::to_string(leader) + "/" +
                                std::to_string(survivor) + " and, at agent " + std::to_string(agent) + ", " +
                                std::to_string(roles.leader()) + "/" + std::to_string(roles.survivor()));
}

void Invariants::ObserveInserted(AgentId agent, const RecordKey& key, const proto::Record& record) {
  if (agent == liar_) return;
  inserted_[key.stream].held.Add(key.seq);
  held_[agent][key.stream].held.Add(key.seq);
  inserted_as_[key] = StatementHashes(record);
  CheckAsInserted(key);
  states_.OnContent(key, *inserted_as_[key].begin());
  states_.OnHeld(agent, key);
  NamePose(key, record);
  NameEnds(key, record);
  const auto name = pose_names_.find(key);
  if (name == pose_names_.end()) return;
  CheckLeads(agent, record.optimized_pose());
  const std::string pose = record.optimized_pose().map_from_node().SerializeAsString();
  if (pose_of_.emplace(std::pair(name->second.node, name->second.version), pose).first->second != pose) {
    report_("one_pose_a_run", NameOf(agent) + " gives a second " + record.optimized_pose().node().ShortDebugString() +
                                  " of one term and run");
  }
}

void Invariants::CheckLeads(AgentId agent, const proto::OptimizedPose& pose) const {
  const auto assignment = assignment_of_.find(pose.term().SerializeAsString());
  if (assignment == assignment_of_.end() || assignment->second.first == agent) return;
  report_("leader_solves", NameOf(agent) + " optimizes in term " + std::to_string(pose.term().number()) +
                               ", in which agent " + std::to_string(assignment->second.first) + " leads");
}

void Invariants::ObserveHave(AgentId agent, const HaveSet& have) {
  if (agent != liar_) held_[agent].Merge(WithoutLiars(have));
}

// --- Lost and damaged disks ---

void Invariants::ForgetDisk(AgentId agent) {
  held_.erase(agent);
  poses_of_.erase(agent);
  states_.OnDiskReplaced(agent);
  ForgetWhatIsLost();
}

void Invariants::ForgetRecord(AgentId agent, const RecordKey& key) {
  poses_of_.erase(agent);
  states_.ForgetDisk(agent);
  HaveSet left;
  for (const auto& [stream, have] : held_[agent].streams()) {
    left[stream] = have;
    if (!IsSameSeries(stream, key.stream)) continue;
    for (const IntervalSet::Interval& interval : have.held.intervals()) {
      for (std::uint64_t seq = interval.first; seq <= interval.last; ++seq) {
        if (Replaces(key, {stream, seq})) left[stream].held.Remove(seq);
      }
    }
  }
  held_[agent] = std::move(left);
  ForgetDropped(agent, key.stream.origin, key.stream.type);
}

void Invariants::ForgetDropped(AgentId agent, AgentId origin, DataType type) {
  HaveSet left;
  for (const auto& [stream, have] : held_[agent].streams()) {
    left[stream] = have;
    if (stream.origin == origin && stream.type == type) left[stream].dropped = IntervalSet();
  }
  held_[agent] = std::move(left);
  ForgetWhatIsLost();
}

// Keeps in `inserted_` only the records that some agent certainly covers (`held_`) and that other agents accept from
// this agent (CanBring).
void Invariants::ForgetWhatIsLost() {
  HaveSet kept;
  for (const auto& [key, stream] : inserted_.streams()) {
    IntervalSet somewhere;
    for (const auto& [agent, held] : held_) {
      if (CanBring(agent, key)) somewhere.Add(held.Get(key).Covered());
    }
    const IntervalSet left = stream.held.Intersection(somewhere);
    if (!left.is_empty()) kept[key].held = left;
  }
  inserted_ = std::move(kept);
}

// Returns whether other agents accept records of `stream` from `agent`.
bool Invariants::CanBring(AgentId agent, const StreamKey& stream) const {
  return !has_keys_ || agent == stream.origin || agent == base_ || had_role_.contains(agent) ||
         PeerAuthority::IsSignedType(stream.type);
}

bool Invariants::Replaces(const RecordKey& newer, const RecordKey& older) const {
  if (newer == older) return true;
  if (!IsSameSeries(newer.stream, older.stream) || PlaceInSeries(older) > PlaceInSeries(newer)) return false;
  if (IsState(newer.stream.type) || newer.stream.type == kNote) return true;
  if (newer.stream.type == proto::EDGE_VERDICT || newer.stream.type == proto::MAP_MATCH) {
    const auto ends = ends_.find(newer);
    const auto other = ends_.find(older);
    return ends != ends_.end() && other != ends_.end() && ends->second == other->second;
  }
  const auto a = pose_names_.find(newer);
  const auto b = pose_names_.find(older);
  return a != pose_names_.end() && b != pose_names_.end() && a->second.node == b->second.node;
}

bool Invariants::IsReplacedIn(const HaveSet& have, const RecordKey& key) const {
  if (!MayBeSuperseded(key.stream.type)) return false;
  for (const auto& [stream, seqs] : have.streams()) {
    if (!IsSameSeries(stream, key.stream)) continue;
    for (const IntervalSet::Interval& interval : seqs.held.intervals()) {
      for (std::uint64_t seq = interval.last; seq >= interval.first; --seq) {
        if (Replaces({stream, seq}, key)) return true;
      }
    }
  }
  return false;
}

// --- Checks ---

void Invariants::CheckHave(AgentId agent, const HaveSet& whole) {
  if (agent == liar_) return;
  const HaveSet have = WithoutLiars(whole);
  CheckHeld(agent, have);
  CheckStates(agent, have);
  CheckPoses(agent, have);
  ObserveStatesHeld(agent, have);
}

void Invariants::ObserveStatesHeld(AgentId agent, const HaveSet& have) {
  for (const auto& [stream, seqs] : have.streams()) {
    if (!IsState(stream.type)) continue;
    for (const IntervalSet::Interval& interval : seqs.held.intervals()) {
      for (std::uint64_t seq = interval.first; seq <= interval.last; ++seq) states_.OnHeld(agent, {stream, seq});
    }
  }
}

void Invariants::CheckHeld(AgentId agent, const HaveSet& have) const {
  const auto held = held_.find(agent);
  if (held == held_.end()) return;
  for (const auto& [key, stream] : held->second.streams()) {
    const IntervalSet lacking = stream.Covered().Minus(have.Get(key).Covered());
    if (lacking.is_empty()) continue;
    report_("acknowledged_held", NameOf(agent) + " said that it had " +
                                     ToString(RecordKey{key, lacking.intervals().front().first}) + " and lacks " +
                                     std::to_string(lacking.Count()) + " of that stream");
    return;
  }
}

void Invariants::CheckStates(AgentId agent, const HaveSet& have) const {
  const LastOfSeries held = LastStates(have, HeldOf);
  for (const auto& [series, key] : LastStates(have, HadOf)) {
    if (key.seq == 0 || held.at(series) == key) continue;
    report_("newest_state", NameOf(agent) + " dropped state " + ToString(key) + " and holds none that is newer");
  }
}

void Invariants::CheckPoses(AgentId agent, const HaveSet& have) {
  HaveSet held;
  for (const auto& [key, stream] : have.streams()) {
    if (key.type == proto::OPTIMIZED_POSE) held[key].held = stream.held;
  }
  Poses& known = poses_of_[agent];
  if (held == known.held) return;
  std::map<Node, PoseVersion> newest;
  for (const auto& [stream, seqs] : held.streams()) {
    for (const IntervalSet::Interval& interval : seqs.held.intervals()) {
      for (std::uint64_t seq = interval.first; seq <= interval.last; ++seq) {
        const auto name = pose_names_.find({stream, seq});
        if (name == pose_names_.end()) return;  // The insert of this pose is not confirmed yet.
        PoseVersion& version = newest[name->second.node];
        version = std::max(version, name->second.version);
      }
    }
  }
  for (const auto& [node, before] : known.newest) {
    const auto now = newest.find(node);
    if (now != newest.end() && now->second >= before) continue;
    report_("pose_goes_up", NameOf(agent) + " held " + ToString(before) + " of node " + std::to_string(node.first) +
                                "/" + std::to_string(node.second) + ", and now " +
                                (now == newest.end() ? "none" : ToString(now->second)));
    break;
  }
  known = {std::move(held), std::move(newest)};
}

// --- Quiescent team ---

void Invariants::CheckQuiescent(QuiescentTeam team) {
  team.have.erase(liar_);
  team.records.erase(liar_);
  for (auto& [agent, have] : team.have) have = WithoutLiars(have);
  for (auto& [agent, records] : team.records) {
    std::erase_if(records, [this](const auto& record) { return record.first.stream.origin == liar_; });
  }
  const HaveSet& leaders = team.have.at(team.leader);
  for (const auto& [agent, have] : team.have) CheckHave(agent, have);
  for (const auto& [agent, have] : team.have) CheckRows(agent, have, team.records.at(agent));
  const QuiescentTeam settled = WithoutLate(team);
  CheckLost(settled);
  CheckLeadersStates(team.leader, leaders);
  for (const auto& [agent, records] : team.records) {
    const auto wrong = states_.WhyOld(agent, agent == team.leader ? 0 : agent, records);
    if (wrong) report_("newest_state", *wrong);
  }
  CheckNotes(settled);
  CheckSurvivor(settled);
  for (const auto& [agent, have] : team.have) {
    CheckHome(agent, leaders, have);
    CheckBroughtOut(agent, settled);
  }
}

QuiescentTeam Invariants::WithoutLate(QuiescentTeam team) const {
  for (auto& [agent, have] : team.have) {
    HaveSet settled;
    for (const auto& [stream, seqs] : have.streams()) {
      const StreamHave left{seqs.held.Minus(late_.Get(stream).held), seqs.dropped};
      if (!left.Covered().is_empty()) settled[stream] = left;
    }
    have = std::move(settled);
  }
  for (auto& [agent, records] : team.records) {
    std::erase_if(
        records, [this](const auto& record) { return late_.Get(record.first.stream).held.Contains(record.first.seq); });
  }
  return team;
}

void Invariants::CheckRows(AgentId agent, const HaveSet& have, const Records& records) const {
  HaveSet rows;
  for (const auto& [key, content] : records) rows[key.stream].held.Add(key.seq);
  for (const auto& [key, stream] : have.streams()) {
    const IntervalSet& held = rows.Get(key).held;
    if (stream.held == held) continue;
    report_("acknowledged_held", NameOf(agent) + " has " + std::to_string(held.Count()) + " rows of the stream of " +
                                     ToString(RecordKey{key, 1}) + " and says that it holds " +
                                     std::to_string(stream.held.Count()));
  }
}

void Invariants::CheckLost(const QuiescentTeam& team) const {
  for (const auto& [key, stream] : inserted_.streams()) {
    // Skip notes: a leader that keeps all notes never receives the notes that other agents superseded earlier.
    if (key.type == kNote) continue;
    IntervalSet pruned;
    IntervalSet held;
    for (const auto& [agent, have] : team.have) {
      pruned.Add(PrunedOf(have).Get(key).dropped);
      held.Add(have.Get(key).held);
    }
    const IntervalSet gone = pruned.Minus(held);
    const IntervalSet due = stream.held.Minus(late_.Get(key).held);
    const IntervalSet lacking = due.Minus(gone).Minus(team.have.at(team.leader).Get(key).Covered());
    if (lacking.is_empty()) continue;
    report_("nothing_lost", "the leader, " + NameOf(team.leader) + ", lacks " + Some(key, lacking));
  }
}

void Invariants::CheckLeadersStates(AgentId leader, const HaveSet& have) const {
  LastOfSeries leaders = LastStates(have, HeldOf);
  for (const auto& [agent, held] : held_) {
    for (const auto& [series, key] : LastStates(held, HeldOf)) {
      if (PlaceInSeries(leaders[series]) >= PlaceInSeries(key)) continue;
      report_("newest_state", "the leader, agent " + std::to_string(leader) + ", lacks the state " + ToString(key) +
                                  ", which agent " + std::to_string(agent) + " has");
    }
  }
}

void Invariants::CheckNotes(const QuiescentTeam& team) const {
  for (const auto& [stream, kept] : kept_notes_.streams()) {
    for (const AgentId agent : {team.leader, team.survivor}) {
      const IntervalSet lacking = inserted_.Get(stream).held.Minus(team.have.at(agent).Get(stream).held);
      const IntervalSet due = kept.held.Intersection(lacking);
      if (!due.is_empty()) report_("notes_kept", NameOf(agent) + " does not hold " + Some(stream, due));
    }
  }
}

void Invariants::CheckSurvivor(const QuiescentTeam& team) const {
  const HaveSet leader_has = WithoutNotes(team.have.at(team.leader));
  const HaveSet survivor_has = WithoutNotes(team.have.at(team.survivor));
  const Records leaders = WithoutPrunedOrNotes(team.records.at(team.leader), survivor_has);
  const Records survivors = WithoutPrunedOrNotes(team.records.at(team.survivor), leader_has);
  const bool is_any_pruned = !PrunedOf(leader_has).streams().empty() || !PrunedOf(survivor_has).streams().empty();
  if (leaders == survivors && (is_any_pruned || leader_has == survivor_has)) return;
  const auto [here, there] = std::mismatch(leaders.begin(), leaders.end(), survivors.begin(), survivors.end());
  std::string first = "their have-sets differ";
  if (there != survivors.end()) first = "the survivor has " + ToString(there->first);
  if (here != leaders.end()) first = "the leader has " + ToString(here->first);
  report_("survivor_is_leader", "leader " + std::to_string(team.leader) + " holds " + std::to_string(leaders.size()) +
                                    " records, survivor " + std::to_string(team.survivor) + " " +
                                    std::to_string(survivors.size()) + "; the first difference: " + first);
}

void Invariants::CheckHome(AgentId agent, const HaveSet& leaders, const HaveSet& own) const {
  for (const auto& [key, stream] : leaders.streams()) {
    if (key.origin != agent) continue;
    const IntervalSet lacking = stream.held.Minus(own.Get(key).Covered());
    if (lacking.is_empty()) continue;
    report_("home_again", NameOf(agent) + " lacks its own " + Some(key, lacking) + ", which the leader has");
  }
}

void Invariants::CheckBroughtOut(AgentId agent, const QuiescentTeam& team) const {
  if (agent == team.leader) return;
  for (const auto& [key, content] : team.records.at(team.leader)) {
    const bool is_pose = key.stream.type == proto::OPTIMIZED_POSE;
    const bool is_for_all = key.stream.type == proto::MAP_QUARANTINE;
    const bool is_for_ground = !team.not_for_ground.contains(key.stream.type);
    const bool is_for_rover = team.for_rovers.contains(key.stream.type) ||
                              (is_pose && key.stream.origin == team.leader && IsPoseOf(agent, content));
    const bool is_due = is_for_all || (agent == team.base ? is_for_ground : is_for_rover);
    if (!is_due || team.have.at(agent).Get(key.stream).Covered().Contains(key.seq)) continue;
    return report_("brought_out", NameOf(agent) + " lacks " + ToString(key) + " of the leader's");
  }
}

}  // namespace moondb::simulation
