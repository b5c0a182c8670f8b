#include "apps/moondb_sim/simulated_config.h"

#include "apps/moondb_sim/state_checker.h"

namespace moondb::simulation {
namespace {

// One seed in three has a survivor that takes the lead without an operator.
constexpr std::uint64_t kFailoverEvery = 3;
constexpr double kLeaderTimeout_s = 120;

constexpr std::uint64_t kStatesEvery = 2;  // In one seed of two, agents send states periodically.
constexpr double kStatesPeriod_s = 300;

constexpr std::uint64_t kKeepsAllEvery = 2;  // In one seed of two, superseded states are removed only for lack of room.
constexpr double kHistory_mb = 0.02;

// In one seed of four, agents use the compact codec; in other seeds, zstd. The compact codec takes half of a run's
// computing time.
constexpr std::uint64_t kCompactEvery = 4;

// In one seed of four, records flow without orders.
constexpr std::uint64_t kFlowEvery = 4;
constexpr std::uint64_t kFlowSeed = 2;
constexpr double kFlowPeriods_s[] = {1, 60};

// In one seed of two, each rover gets the records that the merged map needs. These seeds have all codecs, with and
// without keys.
constexpr std::uint64_t kRoversEvery = 16;
constexpr std::uint64_t kRoversSeeds = 8;

// In one seed of two, the team has signing keys.
constexpr std::uint64_t kKeysEvery = 2;

// Adds a custom type. `policy` applies to sharing in the team and to the ground station.
void AddCustomType(proto::TeamConfig& team, DataType id, const std::string& name, proto::Policy policy,
                   std::uint32_t priority, std::uint32_t bytes_max) {
  proto::CustomType& type = *team.add_custom_types();
  type.set_id(id);
  type.set_name(name);
  type.set_share(policy);
  type.set_ground(policy);
  type.set_priority(priority);
  type.set_bytes_max(bytes_max);
}

// Adds the settings that only SimulatedActors::kAll needs: team id, poses of the agents, further shared types, merged
// map, and automatic solving.
void AddAllActors(proto::TeamConfig& team) {
  team.set_team_id("0123456789abcdef0123456789abcdef");
  for (proto::AgentConfig& agent : *team.mutable_agents()) {
    const bool is_base = agent.kind() == proto::AGENT_KIND_BASE_STATION;
    const Pose pose = StartOf(static_cast<AgentId>(agent.id()), is_base);
    for (int i = 0; i < 3 && is_base; ++i) agent.add_position_m(pose.position_m[i]);
    if (is_base) continue;
    agent.mutable_start()->set_x(pose.position_m.x());
    agent.mutable_start()->set_y(pose.position_m.y());
    agent.mutable_start()->set_yaw(pose.Yaw());
    agent.mutable_start()->set_sigma_m(0.05);
    agent.mutable_start()->set_sigma_rad(0.01);
  }
  (*team.mutable_share())["pose_graph_edge"] = proto::POLICY_ALL;
  (*team.mutable_share())["edge_verdict"] = proto::POLICY_LATEST;
  (*team.mutable_share())["map_match"] = proto::POLICY_LATEST;
  (*team.mutable_ground())["agent_event"] = proto::POLICY_ALL;
  AddCustomType(team, kSample, "sample", proto::POLICY_ALL, /*priority=*/6, kSampleBytesMax);
  team.mutable_map()->set_resolution_m(0.2);
  team.mutable_map()->add_footprint_m(0.8);
  team.mutable_map()->add_footprint_m(0.6);
  team.mutable_pose_graph()->set_solve_by_itself(true);
}

}  // namespace

proto::TeamConfig MakeTeamConfig(const SimOptions& options) {
  proto::TeamConfig team;
  team.set_team("simulated");
  for (int id = 1; id <= options.RoverCount() + 1; ++id) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(static_cast<std::uint32_t>(id));
    const bool is_base = id == options.RoverCount() + 1;
    agent.set_name(is_base ? "base" : "rover" + std::to_string(id));
    agent.set_kind(is_base ? proto::AGENT_KIND_BASE_STATION : proto::AGENT_KIND_ROVER);
  }
  team.mutable_roles()->set_leader("rover1");
  team.mutable_roles()->set_survivor("rover2");
  if (options.seed % kFailoverEvery == 0) team.mutable_roles()->set_failover(proto::FAILOVER_AUTOMATIC);
  team.mutable_roles()->set_leader_timeout_s(kLeaderTimeout_s);
  team.mutable_radio()->set_quiet_while_driving(true);
  if (options.is_paced) team.mutable_radio()->set_budget_kbps(options.BudgetKbps());
  team.mutable_radio()->set_codec(options.seed % kCompactEvery == 1 ? proto::CODEC_COMPACT : proto::CODEC_ZSTD);
  if (options.seed % kStatesEvery == 0) team.mutable_radio()->set_states_period_s(kStatesPeriod_s);
  if (options.has_flow && options.seed % kFlowEvery == kFlowSeed) {
    team.mutable_radio()->set_sync_period_s(kFlowPeriods_s[options.seed / kFlowEvery % std::size(kFlowPeriods_s)]);
  }
  auto& share = *team.mutable_share();
  share["power"] = proto::POLICY_LATEST;
  share["pose_graph_node"] = proto::POLICY_ALL;
  share["optimized_pose"] = proto::POLICY_LATEST;
  share["local_traversability_map"] = proto::POLICY_ALL;
  share["map_quarantine"] = proto::POLICY_ALL;
  share["agent_event"] = proto::POLICY_ALL;  // Storage logs a lost disk.
  AddCustomType(team, kBeacon, "beacon", proto::POLICY_LATEST, /*priority=*/5, /*bytes_max=*/64);
  if (options.ChangesPolicy()) {
    AddCustomType(team, kNote, "note", proto::POLICY_LATEST, /*priority=*/5, /*bytes_max=*/64);
    // Notes test only sharing, so the ground station gets none.
    team.mutable_custom_types()->rbegin()->set_ground(proto::POLICY_NONE);
  }
  // The history has room for only some minutes of states, so agents keep removing the oldest states.
  team.mutable_retention()->set_history_mb_max(kHistory_mb);
  (*team.mutable_keep())["power"] = options.seed % kKeepsAllEvery == 0 ? "all" : "30m";
  (*team.mutable_keep())["optimized_pose"] = "1h";
  (*team.mutable_ground())["power"] = proto::POLICY_LATEST;
  (*team.mutable_ground())["pose_graph_node"] = proto::POLICY_ALL;
  (*team.mutable_ground())["local_traversability_map"] = proto::POLICY_ALL;
  (*team.mutable_ground())["map_quarantine"] = proto::POLICY_ALL;
  if (options.seed % kRoversEvery < kRoversSeeds) {
    (*team.mutable_rovers())["pose_graph_node"] = proto::POLICY_ALL;
    (*team.mutable_rovers())["optimized_pose"] = proto::POLICY_LATEST;
    (*team.mutable_rovers())["local_traversability_map"] = proto::POLICY_ALL;
  }
  if (options.has_all_actors()) AddAllActors(team);
  if (options.seed % kKeysEvery == 0) {
    team.mutable_share()->insert({"role_assignment", proto::POLICY_ALL});
    team.mutable_ground()->insert({"role_assignment", proto::POLICY_ALL});
    for (proto::AgentConfig& agent : *team.mutable_agents())
      agent.set_signing_key(SigningKeyOf(agent.id()).public_key());
  }
  return team;
}

proto::TeamConfig KeepAllNotes(proto::TeamConfig team) {
  for (proto::CustomType& type : *team.mutable_custom_types()) {
    if (type.id() == kNote) type.set_share(proto::POLICY_ALL);
  }
  return team;
}

SigningKey SigningKeyOf(AgentId agent) {
  SigningKey::Seed seed{};
  seed[0] = static_cast<std::uint8_t>(agent);
  return SigningKey::FromSeed(seed);
}

Pose StartOf(AgentId agent, bool is_base_station) {
  if (is_base_station) return Pose::FromPlanar(0, 0, 0);
  return Pose::FromPlanar(10.0 * agent, 3, 0.5 * agent);
}

}  // namespace moondb::simulation
