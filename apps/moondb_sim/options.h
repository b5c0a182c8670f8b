// What one run of the simulator does, and what may go wrong in it.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "actors/sharing/sharing_session.h"
#include "model/error.h"
#include "runtime/actor.h"

namespace moondb::simulation {

struct FaultKind {
  std::string name;
  double per_hour;  // By default, in the whole team.
  std::string what;
};

// All that can go wrong, in the order in which `--list` shows them.
const std::vector<FaultKind>& FaultKinds();

// Which of the standard actors (apps/moondb_agent/standard_actors.h) the agents have.
enum class SimulatedActors {
  kAll,      // Every one, asked by clients through the gateway.
  kSharing,  // Storage, roles, leases and sharing, asked by the robots and the operator directly.
};

// Which seeds have a Byzantine agent (byzantine_agent.h): one rover more.
enum class ByzantineSeeds {
  kNone,
  kSome,  // One in four: half of those whose agents have signing keys.
  kAll,   // Those without keys too, which lies break.
};

struct SimOptions {
  std::uint64_t seed = 1;
  SimulatedActors actors = SimulatedActors::kAll;
  double hours = 2;                               // Of simulated time: five parts in six with faults, the rest quiet.
  int rovers = 3;                                 // Honest ones, beside the base station, the last agent.
  std::map<std::string, double> faults_per_hour;  // Others: their default.
  bool is_faultless = false;
  ByzantineSeeds byzantine = ByzantineSeeds::kSome;
  std::set<std::string> attacks;  // Names of the Byzantine agent's; empty: all that there are.
  bool measures_refill = false;   // At the end: how long a survivor with an empty disk takes to hold all again.

  // For tests that break a rule on purpose.
  std::function<std::unique_ptr<Actor>(AgentId agent, const std::string& name, std::unique_ptr<Actor> actor)> wrap;
  SharingSession::Options session;
  bool is_store_checked = true;  // As a process starts.
  bool is_paced = true;          // To the radio's budget.

  // Of each agent, to which the rules hold them. Small: only who fills an empty disk needs all of it.
  double BudgetKbps() const;

  // The rover that lies; 0: none does. Neither leads nor survives in the team file.
  AgentId Byzantine() const;
  int RoverCount() const { return Byzantine() == 0 ? rovers : rovers + 1; }

  double FaultsPerHour(const FaultKind& kind) const;
  // Returns whether robots insert notes. An agent keeps the latest notes until its team file changes.
  bool ChangesPolicy() const;

  bool has_all_actors() const { return actors == SimulatedActors::kAll; }
};

// NAME,NAME...; kInvalid with the names that there are.
Result<void> SetAttacks(const std::string& text, SimOptions& options);

// NAME=RATE, RATE an hour; kInvalid with the names that there are.
Result<void> SetFault(const std::string& text, SimOptions& options);

}  // namespace moondb::simulation
