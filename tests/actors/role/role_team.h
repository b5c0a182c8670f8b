// A simulated team of RoleActors, for tests. The storage of each agent is a FakeStorageActor.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "actors/role/role_actor.h"
#include "model/control_message.h"
#include "runtime/simulation/simulated_team.h"
#include "runtime/team/team_config.h"

namespace moondb {

// The role assignments that FakeStorageActor has stored. They survive a restart of the actor and of its agent.
struct Disk {
  std::vector<proto::RoleAssignment> roles;
  bool is_failing = false;
  bool is_silent = false;
  // If true, FakeStorageActor fills PgoActor's mailbox with control messages after each reply.
  bool is_flooding = false;
};

class FakeStorageActor final : public Actor {
 public:
  explicit FakeStorageActor(std::shared_ptr<Disk> disk) : disk_(std::move(disk)) {}

  void OnMessage(Context& context, const proto::Message& message) override {
    if (disk_->is_silent) return;
    proto::Message reply;
    if (message.has_load_roles_request()) {
      *reply.mutable_load_roles_reply()->mutable_history() = {disk_->roles.begin(), disk_->roles.end()};
    } else if (message.has_save_roles_request()) {
      reply.mutable_save_roles_reply();
      if (disk_->is_failing) {
        reply.mutable_save_roles_reply()->mutable_error()->set_code(proto::ERROR_CODE_FULL);
      } else {
        disk_->roles.push_back(message.save_roles_request().roles());
      }
    }
    (void)context.Reply(std::move(reply));
    if (!disk_->is_flooding) return;
    proto::Message control;
    control.mutable_peer_event();
    for (std::size_t i = 0; i < kControlMessagesMax; ++i) {
      (void)context.Send({context.self().agent, actor_name::kPgo}, proto::Message(control));
    }
  }

 private:
  std::shared_ptr<Disk> disk_;
};

// Each agent runs a FakeStorageActor and a RoleActor. In the team file, rover 1 is the leader, rover 2 the survivor,
// rover 3 has no role, and agent 4 is the base station. Tests may change config_ before they call Start.
class RoleTeam {
 public:
  explicit RoleTeam(std::uint64_t seed) : team_(seed) {
    config_.set_team("test");
    for (AgentId agent = 1; agent <= 4; ++agent) {
      proto::AgentConfig& added = *config_.add_agents();
      added.set_id(agent);
      added.set_name("agent" + std::to_string(agent));
      added.set_kind(agent == 4 ? proto::AGENT_KIND_BASE_STATION : proto::AGENT_KIND_ROVER);
    }
    config_.mutable_roles()->set_leader("agent1");
    config_.mutable_roles()->set_survivor("agent2");
  }

  void Start() {
    for (const AgentId agent : Agents()) {
      team_.AddAgent(agent);
      team_.Watch({agent, actor_name::kSync}, Topic::kRoles);
      disks_[agent] = std::make_shared<Disk>();
    }
    for (const AgentId agent : Agents()) {
      team_.Spawn(agent, actor_name::kStorage,
                  [disk = disks_[agent]] { return std::make_unique<FakeStorageActor>(disk); });
      RoleActor::Options options;
      options.self = agent;
      options.team = config_;
      team_.Spawn(agent, actor_name::kRole, [options] { return std::make_unique<RoleActor>(options); });
    }
  }

  std::vector<AgentId> Agents() const {
    std::vector<AgentId> agents;
    for (const proto::AgentConfig& agent : config_.agents()) agents.push_back(agent.id());
    return agents;
  }

  void StartAndSettle() {
    Start();
    team_.AdvanceTime(std::chrono::seconds(10));
  }

  void Set(AgentId at, const proto::RoleSetRequest& request) {
    proto::Message message;
    message.set_request_id(42);
    *message.mutable_role_set_request() = request;
    (void)team_.Post({at, actor_name::kGateway}, {at, actor_name::kRole}, message);
    team_.RunUntilIdle();
  }

  void Swap(AgentId at) {
    proto::RoleSetRequest request;
    request.set_is_swap(true);
    Set(at, request);
  }

  // Returns the last message that RoleActor sent to the gateway of agent `at`.
  proto::Message Answer(AgentId at) {
    proto::Message answer;
    for (const proto::Message& message : team_.TakeMessages({at, actor_name::kGateway})) answer = message;
    return answer;
  }

  // Returns the error in the last answer. The test fails if the answer has no error.
  Error Refusal(AgentId at) {
    const Result<void> answered = CheckControlReply(Answer(at));
    EXPECT_FALSE(answered);
    return answered ? Error() : answered.error();
  }

  proto::RoleShowReply Show(AgentId at) {
    proto::Message message;
    message.mutable_role_show_request()->set_with_history(true);
    (void)team_.Post({at, actor_name::kGateway}, {at, actor_name::kRole}, message);
    team_.RunUntilIdle();
    return Answer(at).role_show_reply();
  }

  bool AllAgree() {
    const proto::RoleAssignment roles = Show(1).roles();
    for (AgentId agent = 2; agent <= 4; ++agent) {
      if (Show(agent).roles().SerializeAsString() != roles.SerializeAsString()) return false;
    }
    return true;
  }

  proto::TeamConfig config_;
  std::map<AgentId, std::shared_ptr<Disk>> disks_;
  simulation::SimulatedTeam team_;
};

}  // namespace moondb
