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

// Rovers 1 to `rover_count` ("rover1"...), followed by a base station ("base"). Agent 1 leads, and agent 2 is the
// designated survivor. Everything is shared, and the base station receives nodes and maps.
proto::TeamConfig TestTeam(int rover_count);

// Adds the two sharing actors to an agent.
void SpawnSharing(simulation::SimulatedTeam& team, AgentId agent, const proto::TeamConfig& config,
                  const PaperSql& paper_sql = {});

// Adds an agent with the two sharing actors. Returns the store that holds its records.
std::shared_ptr<MemoryStore> AddMemoryAgent(simulation::SimulatedTeam& team, AgentId agent,
                                            const proto::TeamConfig& config);

proto::Message ShareOrder(proto::SharingKind kind, AgentId destination = 0);

// Sends an order to an agent as its operator does, runs the team until it is idle, and returns the answer.
proto::ShareReply Share(simulation::SimulatedTeam& team, AgentId agent, const proto::Message& order);

// Returns the status of a sharing actor. Include proto/share_status.pb.h to read its fields.
proto::ShareStatus ShareStatusOf(simulation::SimulatedTeam& team, AgentId agent, const char* actor);

void NotifyRoles(simulation::SimulatedTeam& team, const proto::TeamConfig& config, AgentId agent,
                 const proto::RoleAssignment& roles);

proto::RoleAssignment Roles(AgentId leader, AgentId survivor, std::uint64_t number);

}  // namespace moondb
