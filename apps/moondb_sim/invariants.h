// Invariants: conditions that a simulated team must meet, and the state that their checks need. A class in parentheses
// checks the invariant before it. The team is quiescent when faults have ended and sharing is complete.
//
// - one_content: No record key ever has two contents.
// - one_assignment: A term has at most one assignment of roles.
// - term_goes_up: No agent acts on a lower term than before, even after a restart of its process.
// - acknowledged_held: After a crash, an agent covers all records that it reported as covered or that its disk held,
//   except damaged records.
// - leader_solves: The origin of an optimized pose leads in the term of the pose.
// - one_pose_a_run: A node has at most one optimized pose per term and run.
// - pose_goes_up: No agent's newest optimized pose of a node has an older term and run than before.
// - newest_state: No agent drops a state before it holds a newer one. When the team is quiescent, the leader and the
//   origin hold the origin's newest state of each type and key. The newest state is the last state that the robot gave
//   to its agent and that reached a disk that was not lost since (StateChecker).
// - nothing_lost: When the team is quiescent, leader and survivor cover every record that was stored anywhere.
//   Exceptions: all disks with the record were lost, or all agents that held the record pruned it.
// - survivor_is_leader: When the team is quiescent, the survivor holds the same records as the leader, except
//   records that one of them pruned.
// - done_is_true: When an agent answers that a sharing order is complete, each destination holds the records that the
//   sender held when the order was given, or newer records of the same keys (DoneChecker).
// - stores_after_prune: After a prune freed much of a full disk, the agent stores records other than maps again.
// - notes_kept: When the team is quiescent, leader and survivor hold all notes that were inserted while their agent
//   kept all notes. Notes that were lost with all disks that held them are exempt.
// - pruned_is_covered: An agent prunes only records that leader and survivor have just reported as covered
//   (PruneChecker).
// - home_again: When the team is quiescent, an agent covers all records of its own that the leader holds.
// - brought_out: When the team is quiescent, rovers hold the leader's optimized poses of their nodes, and the base
//   station holds the records that the policy `ground` requests.
// - steps_down: An agent that cannot store a newer assignment is neither leader nor survivor.
// - history_is_own: When the team is quiescent, the records in an agent's history are undamaged records of its own
//   robot that its have-set no longer lists as held. The history is within its size limit.
// - one_leader: When the team is quiescent, all agents run and know the same assignment of roles.
// - comes_to_rest: When the team is quiescent, no session is open, and only periodic messages are sent.
// - unacked_bounded: A session has no more bytes in flight than its limit, and no batch exceeds the limit of a batch.
// - end_is_last: A session sends its last batch only after all earlier batches are acknowledged.
// - mailbox_bounded: No mailbox holds more than 48 messages plus 4 per agent, and no mailbox drops a message.
// - nothing_refused: No agent refuses another agent's message or fails to decode it, unless the receiver lost the
//   session.
// - quiet_window: An agent sends no Hello and no Batch while it sleeps, or while it believes that the receiver sleeps.
//   While one of the two agents drives or is paused, the sender sends only batches of states (LeaseChecker).
// - failover_has_cause: An agent that takes the lead without an operator is the survivor, and has had no connection to
//   the leader for leader_timeout_s (FailoverChecker).
// - failover_happens: A survivor that has had no connection to its leader for leader_timeout_s takes the lead
//   (FailoverChecker).
// - starts: No actor fails, at its start or later, unless a fault was injected.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "apps/moondb_sim/state_checker.h"
#include "model/have_set.h"
#include "model/record_key.h"
#include "model/term.h"
#include "proto/message.pb.h"
#include "proto/types.pb.h"
#include "runtime/actor.h"

namespace moondb::simulation {

struct Violation {
  std::string rule;
  double time_s = 0;
  std::uint64_t step = 0;  // Messages handled in the run before the violation.
  std::string text;
};

struct QuiescentTeam {
  AgentId leader = 0;
  AgentId survivor = 0;
  AgentId base = 0;
  std::map<AgentId, HaveSet> have;
  std::map<AgentId, Records> records;                           // Records in each agent's store.
  std::set<DataType> not_for_ground = {proto::OPTIMIZED_POSE};  // Types that are not sent to the base station.
  std::set<AgentId> never_had_role = {};  // Agents that pass on no records of others in a team with keys.
  std::set<DataType> for_rovers = {};     // Types of which the leader sends all agents' records to each rover.
};

class Invariants {
 public:
  using PoseVersion = std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>;  // Term and run of a pose.

  using Report = std::function<void(const std::string& rule, std::string text)>;
  struct Team {
    AgentId liar = 0;  // The Byzantine agent, whose statements and records prove nothing; 0 if none.
    AgentId base = 0;  // The base station; 0 if none.
    // If true, agents accept a third agent's records only from trusted peers (actors/storage/peer_authority.h).
    bool has_keys = false;
  };
  explicit Invariants(Report report) : Invariants(std::move(report), Team()) {}
  Invariants(Report report, const Team& team)
      : report_(std::move(report)), liar_(team.liar), base_(team.base), has_keys_(team.has_keys) {}

  // Call when agent `where` holds the record in its store, or receives the record in order to store it.
  void ObserveRecord(const RecordKey& key, const std::string& content, AgentId where);
  // Call when `agent` acts on `roles`. `is_durable` is false if the roles are not on the agent's disk. Such roles count
  // only until ForgetUnstoredRoles.
  void ObserveRoles(AgentId agent, const proto::RoleAssignment& roles, bool is_durable = true);
  void ForgetUnstoredRoles(AgentId agent) { unstored_roles_of_.erase(agent); }
  // Call for each record that the robot of `agent` gives to its agent, in the order in which the robot gives them.
  void ObserveGiven(AgentId agent, const proto::Record& record) {
    if (agent != liar_) states_.OnGiven(agent, record);
  }
  // Call when the agent confirms that it stored `record` under `key`. The stored content may differ in the flags that
  // storage sets (StatementHashes).
  void ObserveInserted(AgentId agent, const RecordKey& key, const proto::Record& record);
  // Call when an agent whose policy keeps all notes confirms that it stored this note.
  void ObserveKept(const RecordKey& key) { kept_notes_[key.stream].held.Add(key.seq); }
  // Exempts a record that was inserted shortly before the end of the run: the last sharing orders need not include it.
  void ExcuseLate(const RecordKey& key) { late_[key.stream].held.Add(key.seq); }
  // Call when `agent` reports `have` to another agent, or when `have` was read from the agent's disk while it is down.
  void ObserveHave(AgentId agent, const HaveSet& have);

  // Call when the agent's disk was replaced. Forgets the records that the old disk held.
  void ForgetDisk(AgentId agent);
  void ForgetRoles(AgentId agent) { roles_of_.erase(agent); }
  // Call when the record's row at `agent` was damaged. The agent may then lack the record and the older records that
  // the record superseded.
  void ForgetRecord(AgentId agent, const RecordKey& key);
  // Call when `agent` may no longer know which records of `origin` and `type` it dropped.
  void ForgetDropped(AgentId agent, AgentId origin, DataType type);

  // Returns whether any agent ever acted on roles that name `agent` as leader or survivor. Peers that do not know these
  // roles yet may refuse other agents' records from `agent`.
  bool HasHadRole(AgentId agent) const { return had_role_.contains(agent); }

  // Returns whether `have` holds the record of `key`, or a record that supersedes it. Returns false for types whose
  // records are never superseded.
  bool IsReplacedIn(const HaveSet& have, const RecordKey& key) const;

  // Checks `have`, which must be the complete have-set of `agent`.
  void CheckHave(AgentId agent, const HaveSet& have);
  // Checks the states in a have-set of `agent`. Requires: for each origin in `have`, all streams of this origin are in
  // `have`.
  void CheckStates(AgentId agent, const HaveSet& have) const;
  void CheckQuiescent(QuiescentTeam team);

 private:
  using Node = std::pair<AgentId, std::uint64_t>;
  struct PoseName {
    Node node;
    PoseVersion version;
  };

  HaveSet WithoutLiars(const HaveSet& have) const;
  QuiescentTeam WithoutLate(QuiescentTeam team) const;
  void NamePose(const RecordKey& key, const proto::Record& record);
  void NameEnds(const RecordKey& key, const proto::Record& record);
  void CheckLeads(AgentId agent, const proto::OptimizedPose& pose) const;
  void CheckAsInserted(const RecordKey& key) const;
  void ForgetWhatIsLost();
  bool CanBring(AgentId agent, const StreamKey& stream) const;
  // Returns whether `newer` is the same record as `older`, or supersedes it.
  bool Replaces(const RecordKey& newer, const RecordKey& older) const;
  void CheckHeld(AgentId agent, const HaveSet& have) const;
  void ObserveStatesHeld(AgentId agent, const HaveSet& have);
  void CheckPoses(AgentId agent, const HaveSet& have);
  void CheckLeadersStates(AgentId leader, const HaveSet& have) const;
  void CheckRows(AgentId agent, const HaveSet& have, const Records& records) const;
  void CheckLost(const QuiescentTeam& team) const;
  void CheckNotes(const QuiescentTeam& team) const;
  void CheckSurvivor(const QuiescentTeam& team) const;
  void CheckHome(AgentId agent, const HaveSet& leaders, const HaveSet& own) const;
  void CheckBroughtOut(AgentId agent, const QuiescentTeam& team) const;

  const Report report_;
  const AgentId liar_;
  const AgentId base_;
  const bool has_keys_;
  std::map<RecordKey, std::uint64_t> content_of_;                     // Hash of each record's content.
  std::map<RecordKey, std::set<std::uint64_t>> inserted_as_;          // Hashes that the stored content may have.
  std::map<std::string, std::pair<AgentId, AgentId>> assignment_of_;  // Leader and survivor, by serialized term.
  std::set<AgentId> had_role_;                                        // Agents with a role in `assignment_of_`.
  std::map<AgentId, proto::RoleAssignment> roles_of_;                 // Durable roles of each agent.
  std::map<AgentId, proto::RoleAssignment> unstored_roles_of_;
  StateChecker states_;
  HaveSet late_;
  HaveSet kept_notes_;
  HaveSet inserted_;                 // Confirmed records, without the lost records (ForgetWhatIsLost).
  std::map<AgentId, HaveSet> held_;  // By agent: records that it certainly holds or has dropped.
  std::map<std::pair<Node, PoseVersion>, std::string> pose_of_;
  std::map<RecordKey, PoseName> pose_names_;
  std::map<RecordKey, std::pair<Node, Node>> ends_;  // The two nodes that each verdict or map match names.
  struct Poses {
    HaveSet held;  // Optimized poses held at the last check.
    std::map<Node, PoseVersion> newest;
  };
  std::map<AgentId, Poses> poses_of_;
};

}  // namespace moondb::simulation
