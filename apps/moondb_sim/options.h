// Options of one run of the simulator, and the faults that it may inject.
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
  double per_hour;  // Default rate for the whole team.
  std::string what;
};

// All faults, in the order in which `--list` prints them.
const std::vector<FaultKind>& FaultKinds();

// Selects which standard actors (apps/moondb_agent/standard_actors.h) each agent has.
enum class SimulatedActors {
  kAll,      // All standard actors; clients send requests through the gateway.
  kSharing,  // Actors for storage, roles, leases and sharing. Robots and the operator send requests to these actors.
};

// Selects the seeds that have a Byzantine agent (byzantine_agent.h) as an additional rover.
enum class ByzantineSeeds {
  kNone,
  kSome,  // One seed in four: half of the seeds with signing keys.
  // Every seed. In seeds without signing keys, attacks violate invariants.
  kAll,
};

struct SimOptions {
  std::uint64_t seed = 1;
  SimulatedActors actors = SimulatedActors::kAll;
  double hours = 2;  // Simulated time. The last sixth has no faults.
  int rovers = 3;    // Number of honest rovers. The base station comes after them as the last agent.
  std::map<std::string, double> faults_per_hour;  // Rates by fault name. Other faults have default rates.
  bool is_faultless = false;
  ByzantineSeeds byzantine = ByzantineSeeds::kSome;
  std::set<std::string> attacks;  // Names of the attacks to use; empty means all.
  bool measures_refill = false;   // At the end, measure how long an empty survivor takes to hold all records again.

  // Hooks and limits for tests that violate an invariant on purpose.
  std::function<std::unique_ptr<Actor>(AgentId agent, const std::string& name, std::unique_ptr<Actor> actor)> wrap;
  SharingSession::Options session;
  bool is_store_checked = true;  // Check the store before each process start.
  bool is_paced = true;          // Limit the sessions to the radio budget.
  bool has_flow = true;          // Draws seeds in which records flow without orders.

  // Returns the radio budget of each agent in kbit/s. Unless `measures_refill` is true, the budget is so small that the
  // refill of an empty disk uses all of it. All other traffic needs less.
  double BudgetKbps() const;

  // Returns the id of the Byzantine rover; 0 if none. The team file gives this rover no role.
  AgentId Byzantine() const;
  int RoverCount() const { return Byzantine() == 0 ? rovers : rovers + 1; }

  double FaultsPerHour(const FaultKind& kind) const;
  // Returns whether rovers insert notes (kNote) and the fault `policy` replaces team files. An agent keeps only the
  // newest note of each latest key until its team file is replaced, and all notes afterwards.
  bool ChangesPolicy() const;

  bool has_all_actors() const { return actors == SimulatedActors::kAll; }
};

// Adds the attacks in `text`, which has the form NAME,NAME,... Fails with kInvalid if a name is unknown; the error
// lists the valid names.
Result<void> SetAttacks(const std::string& text, SimOptions& options);

// Sets the rate per hour of one fault from `text`, which has the form NAME=RATE. Fails with kInvalid if `text` is
// malformed or the name is unknown. For an unknown name, the error lists the valid names.
Result<void> SetFault(const std::string& text, SimOptions& options);

}  // namespace moondb::simulation
