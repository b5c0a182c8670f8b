// The team of `moonctl config init --lab`: robots on Wi-Fi that share everything by themselves. Thread-safe.
#pragma once

#include <string>
#include <vector>

#include "model/error.h"
#include "proto/team.pb.h"

namespace moondb {

// Up to this many robots, each one gets the edges and priors of all, so that it can take the lead with the whole graph.
inline constexpr int kLabGraphRobotsMax = 4;

struct LabOptions {
  std::string team;
  int robot_count = 2;
  std::vector<std::string> addresses;  // "rover1=10.0.0.11" or "rover1=10.0.0.11:7400".
  std::string base;                    // Name of the base station; empty: none.
  int first_port = 7400;
};

// Returns the team without keys. A robot without an address gets a port of this machine: first_port, first_port + 1 and
// so on. Fails with kInvalid and the field "--address" for an address that has not this form or names no agent.
Result<proto::TeamConfig> MakeLabTeam(const LabOptions& options);

}  // namespace moondb
