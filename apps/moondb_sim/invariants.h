// Invariants: conditions that a simulated team must meet, and the state that their checks need. Classes in parentheses
// check the invariant before them. The team is quiescent when faults have ended and sharing is complete.
//
// - one_content: No record key ever has two contents.
// - one_assignment: A term has at most one assignment of roles.
// - term_goes_up: No agent acts on a lower term than before, even after a restart of its process.
// - acknowledged_held: Records that an agent reported as covered, or that its disk held, are there after a crash,
//   unless they were damaged.
// - leader_solves: The origin of an optimized pose leads in the term of the pose.
// - one_pose_a_run: A node has at most one optimized pose per term and run.
// - pose_goes_up: No agent's newest optimized pose of a node has an older term and run than before.
// - newest_state: No agent drops a state before it holds a newer one. When the team is quiescent, the leader and the
//   agent itself hold the newest state of each type and key. The newest is the last that the robot gave, among those
//   that reached a disk which was not lost since (StateChecker).
// - nothing_lost: When the team is quiescent, leader and survivor cover every record that was stored anywhere.
//   Exceptions: all disks with the record were lost, or the record was pruned wherever it was.
// - survivor_is_leader: When the team is quiescent, the survivor holds what the leader holds, except what either of
//   them pruned.
// - done_is_true: When an agent answers that a sharing order is complete, each destination holds the records that the
//   sender held when the order was given, or newer records of the same keys (DoneChecker).
// - stores_after_prune: An agent that pruned much on a full disk again stores records other than maps.
// - notes_kept: When the team is quiescent, leader and survivor hold all notes that were inserted while their agent
//   kept all notes. Notes whose every disk was lost are exempt.
// - pruned_is_covered: An agent prunes only records that leader and survivor have just reported as covered
//   (PruneChecker).
// - home_again: When the team is quiescent, an agent covers all records of its own that the leader holds.
// - brought_out: When the team is quiescent, rovers have the leader's optimized poses of their nodes, and the base
//   station has the records that the policy `ground` requests.
// - steps_down: An agent that cannot store a newer assignment is neither leader nor survivor.
// - history_is_own: When the team is quiescent, the records in an agent's history are its own robot's, undamaged, and
//   no longer held. The history is within its size limit.
// - one_leader: When the team is quiescent, all agents run, know their roles, and have the same roles.
// - comes_to_rest: When the team is quiescent, no session is open, and only periodic messages are sent.
// - unacked_bounded: A session has no more bytes in flight than its limit, and no batch exceeds the limit of a batch.
// - end_is_last: A session sends its last batch when all earlier batches are acknowledged.
// - mailbox_bounded: No mailbox holds more than 48 messages plus 4 per agent, and none drops any.
// - nothing_refused: No agent refuses another agent's message or fails to decode it, except for a session that it lost.
// - quiet_window: An agent sends no Hello and no Batch while it sleeps, or to an agent that it knows to sleep. While
//   either of them drives or is paused, it sends only batches of states (LeaseChecker).
// - failover_has_cause: An agent that takes the lead by itself is the survivor, and has missed the leader for
//   leader_timeout_s (FailoverChecker).
// - failover_happens: A survivor that has missed its leader for leader_timeout_s takes the lead (FailoverChecker).
// - starts: No actor fails by itself, at its start or later.
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
  std::uint64_t step = 0;  // Messages handled so far.
  std::string text;
};

struct QuiescentTeam {
  AgentId leader = 0;
  AgentId survivor = 0;
  AgentId base = 0;
  std::map<AgentId, HaveSet> have;
  std::map<AgentId, Records> records;                           // Records read from each agent's store.
  std::set<DataType> not_for_ground = {proto::OPTIMIZED_POSE};  // Types that are not sent to the base station.
};

class Invariants {
 public:
  using PoseVersion = std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>;  // Term and run.

  using Report = std::function<void(const std::string& rule, std::string text)>;
  struct Team {
    AgentId liar = 0;  // Byzantine agent, whose statements and records prove nothing; 0 if none.
    AgentId base = 0;  // Base station; 0 if none.
    // Agents accept other agents' records only from trusted peers (actors/storage/peer_authority.h).
    bool has_keys = false;
  };
  explicit Invariants(Report report) : Invariants(std::move(report), Team()) {}
  Invariants(Report report, const Team& team)
      : report_(std::move(report)), liar_(team.liar), base_(team.base), has_keys_(team.has_keys) {}

  // `where` has the record in its store, or receives it for its store.
  void SeeRecord(const RecordKey& key, const std::string& content, AgentId where);
  // `agent` acts on `roles`. Roles that are not durable count only until its RoleActor ends.
  void SeeRoles(AgentId agent, const proto::RoleAssignment& roles, bool is_durable = true);
  void ForgetUnstoredRoles(AgentId agent) { unstored_roles_of_.erase(agent); }
  // The robot of `agent` gives it `record`. Requires: calls follow the order in which the robot gives records.
  void SeeGiven(AgentId agent, const proto::Record& record) {
    if (agent != liar_) states_.OnGiven(agent, record);
  }
  // The agent confirmed that it stored `record` under `key`. The stored content may differ in the flags that storage
  // sets (StatementHashes).
  void SeeInserted(AgentId agent, const RecordKey& key, const proto::Record& record);
  // The agent confirmed that it stored this note, and its policy keeps all notes.
  void SeeKept(const RecordKey& key) { kept_notes_[key.stream].held.Add(key.seq); }
  // Exempts an event that was inserted shortly before the end. The operator's last orders need not share it.
  void ExcuseLate(const RecordKey& key) { late_[key.stream].held.Add(key.seq); }
  // `agent` reported this have-set to another agent, or its disk holds it while the agent does not run.
  void SeeHave(AgentId agent, const HaveSet& have);

  // The agent's disk was replaced. Forgets what the old disk held.
  void ForgetDisk(AgentId agent);
  void ForgetRoles(AgentId agent) { roles_of_.erase(agent); }
  // The record's row was damaged. The agent may lack the record, and lacks older records that the record superseded.
  void ForgetRecord(AgentId agent, const RecordKey& key);
  // The agent may no longer know which records of that origin and type it dropped.
  void ForgetDropped(AgentId agent, AgentId origin, DataType type);

  // Returns whether some agent acted on roles that name `agent`. A receiver that lacks these roles still refuses other
  // agents' records from `agent`, and accepts them later.
  bool HasHadRole(AgentId agent) const { return had_role_.contains(agent); }

  // Returns whether a record in `have` supersedes the record of `key`.
  bool IsReplacedIn(const HaveSet& have, const RecordKey& key) const;

  // Checks the complete have-set of `agent`.
  void CheckHave(AgentId agent, const HaveSet& have);
  // Checks the states in a have-set of `agent`, which must be complete at least for some origins.
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
  void NameVerdict(const RecordKey& key, const proto::Record& record);
  void CheckLeads(AgentId agent, const proto::OptimizedPose& pose) const;
  void CheckAsInserted(const RecordKey& key) const;
  void ForgetWhatIsLost();
  bool CanBring(AgentId agent, const StreamKey& stream) const;
  // Returns whether `newer` is the same record as `older`, or supersedes it.
  bool Replaces(const RecordKey& newer, const RecordKey& older) const;
  void CheckHeld(AgentId agent, const HaveSet& have) const;
  void SeeStatesHeld(AgentId agent, const HaveSet& have);
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
  std::map<RecordKey, std::uint64_t> content_of_;             // Hashes of the contents.
  std::map<RecordKey, std::set<std::uint64_t>> inserted_as_;  // Hashes of the contents that storage may have made.
  std::map<std::string, std::pair<AgentId, AgentId>> assignment_of_;  // Leader and survivor, by term.
  std::set<AgentId> had_role_;                                        // Agents with a role in `assignment_of_`.
  std::map<AgentId, proto::RoleAssignment> roles_of_;                 // Durable roles.
  std::map<AgentId, proto::RoleAssignment> unstored_roles_of_;
  StateChecker states_;
  HaveSet late_;
  HaveSet kept_notes_;
  HaveSet inserted_;                 // Confirmed records, except those whose every disk was lost.
  std::map<AgentId, HaveSet> held_;  // Records that each agent certainly covers.
  std::map<std::pair<Node, PoseVersion>, std::string> pose_of_;
  std::map<RecordKey, PoseName> pose_names_;
  std::map<RecordKey, std::pair<Node, Node>> verdict_names_;  // Both nodes of the range that a verdict judges.
  struct Poses {
    HaveSet held;  // Optimized poses at the last check.
    std::map<Node, PoseVersion> newest;
  };
  std::map<AgentId, Poses> poses_of_;
};

}  // namespace moondb::simulation
