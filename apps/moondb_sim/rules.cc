#include "apps/moondb_sim/rules.h"

#include <utility>

#include "model/term.h"

namespace moondb::simulation {

void Rules::SeeRecord(const RecordKey& key, std::uint64_t content_hash, AgentId where) {
  const auto known = content_of_.emplace(key, content_hash).first;
  if (known->second != content_hash) {
    report_("one_content", "agent " + std::to_string(where) + " has another content of " + ToString(key));
  }
}

void Rules::SeeRoles(AgentId agent, const proto::RoleAssignment& roles) {
  const auto known = roles_of_.find(agent);
  if (known != roles_of_.end() && IsNewer(known->second.term(), roles.term())) {
    report_("term_goes_up", "agent " + std::to_string(agent) + " went from term " +
                                std::to_string(known->second.term().number()) + " to " +
                                std::to_string(roles.term().number()));
  }
  roles_of_[agent] = roles;
  const std::string who = std::to_string(roles.leader()) + "/" + std::to_string(roles.survivor());
  const auto assignment = assignment_of_.emplace(roles.term().SerializeAsString(), who).first;
  if (assignment->second != who) {
    report_("one_assignment", "term " + roles.term().ShortDebugString() + " is " + assignment->second +
                                  " and, at agent " + std::to_string(agent) + ", " + who);
  }
}

void Rules::SeeInserted(AgentId agent, const RecordKey& key, const proto::Record& record) {
  inserted_[key.stream].held.Add(key.seq);
  held_[agent][key.stream].held.Add(key.seq);
  if (!record.has_optimized_pose()) return;
  proto::OptimizedPose version = record.optimized_pose();
  version.clear_map_from_node();
  const std::string pose = record.optimized_pose().map_from_node().SerializeAsString();
  if (pose_of_.emplace(version.SerializeAsString(), pose).first->second != pose) {
    report_("one_pose_a_run", "agent " + std::to_string(agent) + " gives " + version.ShortDebugString() + " twice");
  }
}

void Rules::SeeHave(AgentId agent, const HaveSet& have) { held_[agent].Merge(have); }

void Rules::ForgetDisk(AgentId agent) {
  held_.erase(agent);
  // Nobody else has it for certain: it may be lost.
  HaveSet kept;
  for (const auto& [key, stream] : inserted_.streams()) {
    IntervalSet elsewhere;
    for (const auto& [other, held] : held_) elsewhere.Add(held.Get(key).Had());
    const IntervalSet lost = stream.held.Minus(elsewhere);
    const IntervalSet left = stream.held.Minus(lost);
    if (!left.is_empty()) kept[key].held = left;
  }
  inserted_ = std::move(kept);
}

void Rules::CheckHeld(AgentId agent, const HaveSet& have) const {
  const auto held = held_.find(agent);
  if (held == held_.end()) return;
  for (const auto& [key, stream] : held->second.streams()) {
    const IntervalSet lacking = stream.Had().Minus(have.Get(key).Had());
    if (lacking.is_empty()) continue;
    report_("acknowledged_held", "agent " + std::to_string(agent) + " said that it had " +
                                     ToString(RecordKey{key, lacking.intervals().front().first}) + " and lacks " +
                                     std::to_string(lacking.Count()) + " of that stream");
    return;
  }
}

// Of what is kept of each origin's states, the last in the origin's own order must be among the leader's rows.
void Rules::CheckStates(AgentId leader, const HaveSet& have, const std::map<RecordKey, std::string>& records) const {
  std::map<AgentId, RecordKey> newest;
  for (const auto& [key, stream] : have.streams()) {
    if (key.type != proto::POWER || stream.Had().is_empty()) continue;
    const RecordKey last{key, stream.Had().Max()};
    RecordKey& known = newest[key.origin];
    if (std::pair(last.stream.epoch, last.seq) > std::pair(known.stream.epoch, known.seq)) known = last;
  }
  for (const auto& [origin, key] : newest) {
    if (records.contains(key)) continue;
    report_("newest_state", "the leader, agent " + std::to_string(leader) + ", dropped the newest state " +
                                ToString(key) + " of agent " + std::to_string(origin));
  }
}

}  // namespace moondb::simulation
