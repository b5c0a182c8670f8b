// RoleTable: what @leader, @survivor and @base stand for on one agent at this moment.
//
// Any thread. Leader and survivor change together: a reader never sees one of each assignment.
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

  // The agent that an alias stands for, 0 for nobody; any other agent is returned as it is.
  AgentId Resolve(AgentId agent) const;

 private:
  std::atomic<std::uint64_t> leader_and_survivor_ = 0;  // Leader in the upper half.
  std::atomic<AgentId> base_station_;
};

}  // namespace moondb
