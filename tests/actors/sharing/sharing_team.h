// A team of rovers and a base station for tests of the sharing actors. This header does not include the actors'
// headers, so a change in them does not recompile every test.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "actors/sharing/codec.h"
#include "runtime/simulation/simulated_team.h"
#include "runtime/team/team_config.h"
#include "tests/actors/sharing/memory_store.h"

namespace moondb::proto {
class ShareStatus;
}  // namespace moondb::proto

namespace moondb {

// Returns a team of rovers 1 to `rover_count` ("rover1", ...) and a base station ("base", the next agent). Agent 1
// leads, and agent 2 is the designated survivor. The base station receives nodes, maps and map quarantines.
proto::TeamConfig TestTeam(int rover_count);

// Adds a SyncActor and a ReplicaActor to an agent.
void SpawnSharing(simulation::SimulatedTeam& team, AgentId agent, const proto::TeamConfig& config,
                  const PaperSql& paper_sql = {});

// Adds an agent with a SyncActor, a ReplicaActor and a storage in memory. Returns the agent's store.
std::shared_ptr<MemoryStore> AddMemoryAgent(simulation::SimulatedTeam& team, AgentId agent,
                                            const proto::TeamConfig& config);

proto::Message ShareOrder(proto::SharingKind kind, AgentId destination = 0);

// Sends `order` to an agent as its operator does, runs the team until it is idle, and returns the answer.
proto::ShareReply Share(simulation::SimulatedTeam& team, AgentId agent, const proto::Message& order);

// Returns the status of the sharing actor named `actor`. Include proto/share_status.pb.h to read its fields.
proto::ShareStatus ShareStatusOf(simulation::SimulatedTeam& team, AgentId agent, const char* actor);

void NotifyRoles(simulation::SimulatedTeam& team, const proto::TeamConfig& config, AgentId agent,
                 const proto::RoleAssignment& roles);

proto::RoleAssignment Roles(AgentId leader, AgentId survivor, std::uint64_t number);

}  // namespace moondb
