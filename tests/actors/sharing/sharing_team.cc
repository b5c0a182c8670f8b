#include "tests/actors/sharing/sharing_team.h"

#include "actors/sharing/replica_actor.h"
#include "actors/sharing/sync_actor.h"
#include "model/control_message.h"
#include "proto/control.pb.h"

namespace moondb {

proto::TeamConfig TestTeam(int rover_count) {
  proto::TeamConfig team;
  team.set_team("test");
  for (int id = 1; id <= rover_count + 1; ++id) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(static_cast<std::uint32_t>(id));
    const bool is_base = id == rover_count + 1;
    agent.set_name(is_base ? "base" : "rover" + std::to_string(id));
    agent.set_kind(is_base ? proto::AGENT_KIND_BASE_STATION : proto::AGENT_KIND_ROVER);
  }
  team.mutable_roles()->set_leader("rover1");
  team.mutable_roles()->set_survivor("rover2");
  auto& share = *team.mutable_share();
  share["power"] = proto::POLICY_LATEST;
  share["pose_graph_node"] = proto::POLICY_ALL;
  share["pose_graph_edge"] = proto::POLICY_ALL;
  share["optimized_pose"] = proto::POLICY_LATEST;
  share["edge_verdict"] = proto::POLICY_LATEST;
  share["map_match"] = proto::POLICY_LATEST;
  share["local_traversability_map"] = proto::POLICY_ALL;
  share["map_quarantine"] = proto::POLICY_ALL;
  share["agent_event"] = proto::POLICY_ALL;
  (*team.mutable_ground())["pose_graph_node"] = proto::POLICY_ALL;
  (*team.mutable_ground())["local_traversability_map"] = proto::POLICY_ALL;
  (*team.mutable_ground())["map_quarantine"] = proto::POLICY_ALL;
  return team;
}

void SpawnSharing(simulation::SimulatedTeam& team, AgentId agent, const proto::TeamConfig& config,
                  const PaperSql& paper_sql) {
  SharingActor::Options options;
  options.self = agent;
  options.team = config;
  options.config_hash = 1;
  options.session.paper_sql = paper_sql;
  team.Spawn(agent, actor_name::kSync, [options] { return std::make_unique<SyncActor>(options); });
  team.Spawn(agent, actor_name::kReplica, [options] { return std::make_unique<ReplicaActor>(options); });
  NotifyRoles(team, config, agent, InitialRoles(config));
}

std::shared_ptr<MemoryStore> AddMemoryAgent(simulation::SimulatedTeam& team, AgentId agent,
                                            const proto::TeamConfig& config) {
  const auto store = std::make_shared<MemoryStore>();
  team.AddAgent(agent);
  team.Spawn(agent, actor_name::kStorage, [store] { return std::make_unique<MemoryStorageActor>(store); });
  SpawnSharing(team, agent, config);
  return store;
}

proto::Message ShareOrder(proto::SharingKind kind, AgentId destination) {
  proto::Message message;
  message.mutable_share_request()->set_kind(kind);
  message.mutable_share_request()->set_destination(destination);
  return message;
}

proto::ShareReply Share(simulation::SimulatedTeam& team, AgentId agent, const proto::Message& order) {
  const bool is_sync = order.share_request().kind() == proto::SHARING_KIND_SYNC;
  (void)team.Post({agent, "operator"}, {agent, is_sync ? actor_name::kSync : actor_name::kReplica}, order);
  team.RunUntilIdle();
  proto::ShareReply reply;
  for (const proto::Message& message : team.TakeMessages({agent, "operator"})) {
    if (message.has_share_reply()) reply = message.share_reply();
  }
  return reply;
}

void NotifyRoles(simulation::SimulatedTeam& team, const proto::TeamConfig& config, AgentId agent,
                 const proto::RoleAssignment& roles) {
  proto::Message message;
  *message.mutable_roles_changed()->mutable_roles() = roles;
  message.mutable_roles_changed()->set_own_role(RoleOf(config, roles, agent));
  (void)team.Post({agent, actor_name::kRole}, {agent, actor_name::kSync}, message);
  (void)team.Post({agent, actor_name::kRole}, {agent, actor_name::kReplica}, message);
}

proto::RoleAssignment Roles(AgentId leader, AgentId survivor, std::uint64_t number) {
  proto::RoleAssignment roles;
  roles.set_leader(leader);
  roles.set_survivor(survivor);
  roles.mutable_term()->set_number(number);
  roles.mutable_term()->set_issuer(leader);
  roles.mutable_term()->set_issuer_epoch(1);
  return roles;
}

proto::ShareStatus ShareStatusOf(simulation::SimulatedTeam& team, AgentId agent, const char* actor) {
  proto::ControlRequest question;
  question.mutable_share_status();
  (void)team.Post({agent, "status"}, {agent, actor}, MessageOf(question));
  team.RunUntilIdle();
  proto::ShareStatus status;
  for (const proto::Message& message : team.TakeMessages({agent, "status"})) {
    if (const auto reply = ControlReplyOf(message)) status = reply->share_status();
  }
  return status;
}

}  // namespace moondb
