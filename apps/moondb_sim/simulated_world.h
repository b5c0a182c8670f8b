// SimulatedWorld: state that the parts of a simulated mission (robots, faults, checks) share: the team and its disks,
// one schedule, one random stream, the invariants, and the report.
//
// Single-threaded. An additional draw from `rng` changes the rest of a run.
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

  static std::string Prefix(AgentId agent);  // Path prefix of the agent's files on `disk`.
  static std::string PathOf(AgentId agent);  // Path of the agent's database.

  void At(MonotonicTime time, Action action);
  void In(Duration delay, Action action);
  void AdvanceTo(MonotonicTime time);  // Does nothing if `time` is in the past.
  double NowS() const;                 // Simulated seconds since `start`.
  std::int64_t ClockOf(AgentId agent) { return team.utc_now_ns() + clock_offset[agent].count(); }

  double Draw();  // Returns a uniform random number in [0, 1).
  Duration DrawDuration(Duration limit);
  AgentId DrawAgent();
  AgentId DrawOther(AgentId agent);

  // Adds a violation of invariant `rule` to the report. The report keeps the first ten violations, and the last
  // messages before the first violation.
  void Violate(const std::string& rule, std::string text);
  bool HasEnough() const;  // Returns whether there are enough violations to end the run early.
  void AddEvent(const Address& actor, const proto::Message& message);

  // Returns the agent's present team file.
  const proto::TeamConfig& ConfigOf(AgentId agent) const {
    return keeps_all_notes.contains(agent) ? config_with_all_notes : config;
  }
  // Returns whether the agent must accept records other than maps, because a prune has just freed much of its full
  // disk.
  bool MustStore(AgentId agent) const;
  // Returns whether the agent's disk is full or failing, or was within the last minute. The agent may then refuse to
  // store records.
  bool HadDiskTrouble(AgentId agent) const;
  std::set<AgentId> Leaders() const;  // Returns the running agents that act as leader.
  // Sends `question` to the actor, and runs the team until it is idle. Returns the actor's last answer; an empty
  // message if there is none.
  proto::Message RequestActor(AgentId agent, const char* actor, proto::Message question);
  std::optional<HaveSet> HaveOf(AgentId agent);
  Records ReadAll(AgentId agent);  // Returns all shared records that the agent holds.

  const SimOptions options;
  const proto::TeamConfig config;                 // Initial team file.
  const proto::TeamConfig config_with_all_notes;  // Team file that keeps all notes.
  const AgentId base;                             // The base station, which is the last agent.
  const AgentId byzantine;                        // The Byzantine rover; 0 if none.
  SimReport report;
  std::mt19937_64 rng;
  std::multimap<MonotonicTime, Action> schedule;
  std::map<AgentId, proto::RoleAssignment> roles;  // Roles on which each running agent acts.
  std::map<AgentId, proto::Term> durable_term;     // Term on each agent's disk, according to its RoleActor.
  std::map<AgentId, Duration> clock_offset;
  std::map<AgentId, MonotonicTime> disk_trouble_until;
  struct FreedOnFullDisk {
    double content_bytes = 0;
    std::optional<MonotonicTime> since;  // When enough bytes were freed to store records again; empty before.
  };
  std::map<AgentId, FreedOnFullDisk> freed_on_full_disk;  // Bytes that the prune of each full disk has freed.
  std::set<AgentId> keeps_all_notes;                      // Agents whose team file keeps all notes.
  bool is_quiet = false;                                  // Faults and inserts have ended.
  bool is_asking = false;  // True during RequestActor, when no fault makes an actor fail.
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

  std::deque<Event> events_;  // The latest handled messages.
};

}  // namespace moondb::simulation
