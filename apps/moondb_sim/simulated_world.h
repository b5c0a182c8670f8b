// SimulatedWorld: what the parts of a simulated mission share: the team and its disks, one schedule, one source of
// chance, the rules, and the report of what was seen. Robots, faults and checks are made upon it.
//
// One thread. Whoever draws a number changes all later ones: equal options give equal runs, and no others.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <string>

#include "apps/moondb_sim/invariants.h"
#include "apps/moondb_sim/options.h"
#include "apps/moondb_sim/rare_states.h"
#include "apps/moondb_sim/sim_report.h"
#include "apps/moondb_sim/simulated_disk.h"
#include "model/have_set.h"
#include "proto/message.pb.h"
#include "proto/team.pb.h"
#include "runtime/simulation/simulated_team.h"

namespace moondb::simulation {

class SimulatedWorld {
 public:
  using Action = std::function<void()>;

  explicit SimulatedWorld(const SimOptions& sim_options);

  static std::string Prefix(AgentId agent);  // Of its files on `disk`.
  static std::string PathOf(AgentId agent);  // Its database.

  void At(MonotonicTime time, Action action);
  void In(Duration delay, Action action);
  void AdvanceTo(MonotonicTime time);  // Nothing if it has passed.
  double NowS() const;                 // Since the start.
  std::int64_t ClockOf(AgentId agent) { return team.utc_now_ns() + clock_offset[agent].count(); }

  double Draw();  // From 0 to below 1.
  Duration DrawDuration(Duration limit);
  AgentId DrawAgent();
  AgentId DrawOther(AgentId agent);

  // A rule is broken. The first few are kept, and the last events before the first.
  void Violate(const std::string& rule, std::string text);
  bool HasEnough() const;  // Violations, to end the run.
  void NoteEvent(const Address& actor, const proto::Message& message);

  // Returns the agent's present team file.
  const proto::TeamConfig& ConfigOf(AgentId agent) const {
    return keeps_all_notes.contains(agent) ? config_with_all_notes : config;
  }
  // Returns whether the agent must take records that are no maps: it has just pruned much on a full disk.
  bool MustStore(AgentId agent) const;
  // Its disk was full or failed a minute ago or later: it may refuse what it is to store.
  bool HadDiskTrouble(AgentId agent) const;
  std::set<AgentId> Leaders() const;  // Those running that lead as far as they know.
  // Its last answer, which it gives at once; empty if it gives none.
  proto::Message AskActor(AgentId agent, const char* actor, proto::Message question);
  std::optional<HaveSet> HaveOf(AgentId agent);
  Records ReadAll(AgentId agent);  // Whatever it shares.

  const SimOptions options;
  const proto::TeamConfig config;                 // At the start.
  const proto::TeamConfig config_with_all_notes;  // With another policy for notes.
  const AgentId base;                             // The base station, and the last agent.
  const AgentId byzantine;                        // The rover that lies; 0: none does.
  SimReport report;
  std::mt19937_64 rng;
  std::multimap<MonotonicTime, Action> schedule;
  std::map<AgentId, proto::RoleAssignment> roles;  // What each running agent acts on.
  std::map<AgentId, proto::Term> durable_term;     // On each agent's disk, as its RoleActor knows.
  std::map<AgentId, Duration> clock_offset;
  std::map<AgentId, MonotonicTime> disk_trouble_until;
  struct FreedOnFullDisk {
    double content_bytes = 0;
    std::optional<MonotonicTime> since;  // When there were enough of them.
  };
  std::map<AgentId, FreedOnFullDisk> freed_on_full_disk;  // By a prune that goes on or is done.
  std::set<AgentId> keeps_all_notes;                      // Agents whose team file has changed.
  bool is_quiet = false;                                  // No more faults, nor inserts.
  bool is_asking = false;                                 // The checks ask, and no actor fails at their questions.
  SimulatedDisk disk;
  Invariants invariants;
  RareStates rare_states;
  SimulatedTeam team;
  const MonotonicTime start = team.now();

 private:
  struct Event {
    double time_s;
    std::string actor;
    AgentId agent;
    int body;
    AgentId from;
  };

  std::deque<Event> events_;  // The last ones.
};

}  // namespace moondb::simulation
