#include "apps/moondb_sim/options.h"

#include <algorithm>
#include <optional>

#include "apps/moondb_sim/byzantine_agent.h"
#include "model/text.h"

namespace moondb::simulation {

namespace {

constexpr std::uint64_t kPrunedEvery = 3;
constexpr std::uint64_t kPolicyChangedEvery = 7;
// One seed in four has a Byzantine agent. These seeds are even, so their teams have signing keys.
constexpr std::uint64_t kByzantineEvery = 4;

}  // namespace

const std::vector<FaultKind>& FaultKinds() {
  static const std::vector<FaultKind> kinds = {
      {"weather", 6, "loss up to 30 %, repeats, latency and order of the radio change"},
      {"late_copy", 2, "for some minutes messages come a second time, up to ten minutes later"},
      {"cut", 12, "the link of two agents is down for a while; every other time the ends are not notified"},
      {"one_way", 4, "one agent is not heard by another for a while"},
      {"partition", 2, "the team is in two parts for a while"},
      {"kill", 6, "an agent loses power: what its disk had not synced is lost"},
      {"kill_in_write", 4, "an agent loses power in the middle of a write"},
      {"fail", 12, "an actor fails at a message"},
      {"wipe", 0.5, "an agent comes back with an empty disk"},
      {"old_disk", 0.5, "an agent comes back with an older copy of its disk"},
      {"backup", 0.25, "an agent comes back with an older backup of its store, as `moonctl db backup` makes it"},
      {"damage", 0.5, "an agent comes back with a disk that is damaged in many places"},
      {"damage_record", 1, "an agent comes back with one byte of one record changed"},
      {"damage_interval", 1, "an agent comes back with one interval of its have-set changed"},
      {"clock", 1, "an agent's clock jumps, to 1970 or by hours"},
      {"swap", 4, "the operator swaps leader and survivor"},
      {"reassign", 2, "the operator names another leader and survivor, of an agent that may be cut off"},
      {"long_kill", 1, "an agent, every other time a leader, is without power for 5 to 15 minutes"},
      {"drive", 6, "a rover's software says that it drives, for 10 to 120 seconds"},
      {"sleep", 1.5, "it says that it sleeps, for 1 to 20 minutes; every other time it is without power meanwhile"},
      {"pause", 2, "an operator pauses the sharing of an agent, for 10 seconds to 10 minutes"},
      {"prune", 4,
       "the operator prunes an agent, every other time its part of the pose graph's nodes too; in one seed "
       "of three"},
      {"full_prune", 1,
       "a rover learns many maps, its disk is full five minutes later, and the operator prunes it; with sharing "
       "alone, in even seeds with `prune`"},
      {"policy", 3,
       "an agent starts again with a team file that keeps all notes instead of the latest ones; in one seed of seven"},
      {"full", 1.5, "an agent's disk is full for 1 to 10 minutes, every third time from a start on"},
      {"failing", 1.5, "an agent's disk fails: each write is an I/O error, perhaps in the middle"},
  };
  return kinds;
}

double SimOptions::BudgetKbps() const {
  if (measures_refill) return 1000;
  return 4.0 * (RoverCount() + 1);
}

AgentId SimOptions::Byzantine() const {
  if (byzantine == ByzantineSeeds::kNone) return 0;
  if (byzantine == ByzantineSeeds::kSome && seed % kByzantineEvery != 0) return 0;
  constexpr std::uint64_t kFirst = 3;  // The first rover that is neither leader nor survivor in the team file.
  return static_cast<AgentId>(kFirst + seed / kByzantineEvery % (static_cast<std::uint64_t>(rovers) - 1));
}

double SimOptions::FaultsPerHour(const FaultKind& kind) const {
  const auto set = faults_per_hour.find(kind.name);
  if (set != faults_per_hour.end()) return set->second;
  if (is_faultless) return 0;
  const bool changes_policy = seed % kPolicyChangedEvery == 0;
  if (kind.name == "policy") return changes_policy ? kind.per_hour : 0;
  // The maps that `full_prune` inserts are too costly for the solver, the merger, and the compact codec that some odd
  // seeds use. Most seeds run without prunes, because the invariants cannot distinguish a lost record from a pruned
  // one. Seeds with notes run without prunes, because a pruned note would look lost.
  if (kind.name == "full_prune" && (has_all_actors() || seed % 2 != 0)) return 0;
  const bool is_prune = kind.name == "prune" || kind.name == "full_prune";
  if (is_prune && (seed % kPrunedEvery != 0 || changes_policy)) return 0;
  return kind.per_hour;
}

bool SimOptions::ChangesPolicy() const {
  const auto& kinds = FaultKinds();
  const auto policy = std::find_if(kinds.begin(), kinds.end(), [](const auto& kind) { return kind.name == "policy"; });
  return policy != kinds.end() && FaultsPerHour(*policy) > 0;
}

Result<void> SetAttacks(const std::string& text, SimOptions& options) {
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string name = text.substr(begin, end - begin);
    std::string names;
    for (const AttackKind& kind : AttackKinds()) names += (names.empty() ? "" : ", ") + kind.name;
    const auto is_it = [&](const AttackKind& kind) { return kind.name == name; };
    if (std::none_of(AttackKinds().begin(), AttackKinds().end(), is_it)) {
      return Fail(ErrorCode::kInvalid, "there is no attack '" + name + "'; there are " + names, "attacks");
    }
    options.attacks.insert(name);
    begin = end + 1;
  }
  return {};
}

Result<void> SetFault(const std::string& text, SimOptions& options) {
  const std::size_t equals = text.find('=');
  const std::string name = text.substr(0, equals);
  std::string names;
  for (const FaultKind& kind : FaultKinds()) names += (names.empty() ? "" : ", ") + kind.name;
  const auto is_it = [&](const FaultKind& kind) { return kind.name == name; };
  if (std::none_of(FaultKinds().begin(), FaultKinds().end(), is_it)) {
    return Fail(ErrorCode::kInvalid, "there is no fault '" + name + "'; there are " + names, "fault");
  }
  const std::optional<double> rate = equals == std::string::npos ? std::nullopt : ParseDouble(text.substr(equals + 1));
  if (!rate || !(*rate >= 0) || *rate > 3600) {
    return Fail(ErrorCode::kInvalid, "'" + text + "' is not NAME=RATE with a rate from 0 to 3600 an hour", "fault");
  }
  options.faults_per_hour[name] = *rate;
  return {};
}

}  // namespace moondb::simulation
