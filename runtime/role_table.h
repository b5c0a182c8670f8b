// RoleTable: the agents to which @leader, @survivor and @base currently resolve on one agent.
//
// Thread-safe. Leader and survivor change atomically: a reader never sees values of two assignments.
#pragma once

#include <atomic>
#include <cstdint>

#include "proto/term.pb.h"
#include "runtime/address.h"

namespace moondb {

class RoleTable {
 public:
  explicit RoleTable(AgentId base_station = 0) : base_station_(base_station) {}

  void SetRoles(const proto::RoleAssignment& roles);
  void SetBaseStation(AgentId agent) { base_station_ = agent; }

  // Returns the agent to which an alias resolves, or 0 if no agent has that role at present. An id that is not an alias
  // is returned unchanged.
  AgentId Resolve(AgentId agent) const;

 private:
  std::atomic<std::uint64_t> leader_and_survivor_ = 0;  // The leader is in the upper 32 bits.
  std::atomic<AgentId> base_station_;
};

}  // namespace moondb
