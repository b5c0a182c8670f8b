#include "apps/moonctl/lab_team.h"

#include <algorithm>

#include "model/data_types.h"

namespace moondb {
namespace {

constexpr double kLabBudget_kbps = 5000;
constexpr double kLabSyncPeriod_s = 2;
constexpr double kLabLeaderTimeout_s = 15;

std::string AddressOf(const std::string& host, int port) { return "tcp://" + host + ":" + std::to_string(port); }

Result<void> SetAddress(const std::string& given, int default_port, proto::TeamConfig& team) {
  const std::size_t equals = given.find('=');
  const std::string name = given.substr(0, equals);
  const auto agent = std::ranges::find(*team.mutable_agents(), name, &proto::AgentConfig::name);
  if (equals == std::string::npos || equals + 1 == given.size()) {
    return Fail(ErrorCode::kInvalid, "expected NAME=HOST or NAME=HOST:PORT, got '" + given + "'", "--address");
  }
  if (agent == team.mutable_agents()->end()) {
    return Fail(ErrorCode::kInvalid,
                "'" + name + "' is not an agent of this team; its agents are " + team.agents(0).name() + " to " +
                    team.agents().rbegin()->name(),
                "--address");
  }
  const std::string host = given.substr(equals + 1);
  const bool has_port = host.rfind(':') != std::string::npos && host.back() != ']';
  agent->set_address(has_port ? "tcp://" + host : AddressOf(host, default_port));
  return {};
}

void SetPolicies(const LabOptions& options, proto::TeamConfig& team) {
  auto& rovers = *team.mutable_rovers();
  for (const DataTypeRow& row : DataTypeRows()) {
    if (row.rank == ShareRank::kStates) rovers[DataTypeName(row.type)] = proto::POLICY_LATEST;
  }
  rovers["pose_graph_node"] = proto::POLICY_ALL;
  rovers["optimized_pose"] = proto::POLICY_LATEST;
  rovers["local_traversability_map"] = proto::POLICY_ALL;
  if (options.robot_count <= kLabGraphRobotsMax) {
    rovers["pose_graph_edge"] = proto::POLICY_ALL;
    rovers["pose_prior"] = proto::POLICY_ALL;
  }
  if (!options.base.empty()) (*team.mutable_ground())["local_traversability_map"] = proto::POLICY_ALL;
}

}  // namespace

Result<proto::TeamConfig> MakeLabTeam(const LabOptions& options) {
  proto::TeamConfig team;
  team.set_team(options.team);
  const int agent_count = options.robot_count + (options.base.empty() ? 0 : 1);
  for (int i = 0; i < agent_count; ++i) {
    proto::AgentConfig& agent = *team.add_agents();
    const bool is_base = i == options.robot_count;
    agent.set_id(static_cast<std::uint32_t>(i + 1));
    agent.set_name(is_base ? options.base : "rover" + std::to_string(i + 1));
    agent.set_address(AddressOf("127.0.0.1", options.first_port + i));
    if (!is_base) continue;
    agent.set_kind(proto::AGENT_KIND_BASE_STATION);
    for (int axis = 0; axis < 3; ++axis) agent.add_position_m(0);
  }
  for (const std::string& address : options.addresses) {
    if (auto set = SetAddress(address, options.first_port, team); !set) return tl::unexpected(set.error());
  }
  team.mutable_roles()->set_leader("rover1");
  if (options.robot_count > 1) team.mutable_roles()->set_survivor("rover2");
  // If two agents lose each other, automatic failover would make both lead.
  if (agent_count > 2) team.mutable_roles()->set_failover(proto::FAILOVER_AUTOMATIC);
  team.mutable_roles()->set_leader_timeout_s(kLabLeaderTimeout_s);
  team.mutable_radio()->set_budget_kbps(kLabBudget_kbps);
  team.mutable_radio()->set_sync_period_s(kLabSyncPeriod_s);
  team.mutable_radio()->set_quiet_while_driving(false);
  SetPolicies(options, team);
  return team;
}

}  // namespace moondb
