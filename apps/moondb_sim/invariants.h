// Rules: what must hold of a simulated team at every step, and what the checks of them need to remember.
//
//   one_content        no record's key ever has two contents
//   one_assignment     a term has at most one assignment of roles
//   term_goes_up       no agent acts on a lower term than before, whatever happened to its process
//   acknowledged_held  what an agent said it had, or its disk held, is there after a crash (until it was damaged)
//   leader_solves      optimized poses are of a term in which their origin leads
//   one_pose_a_run     a node has at most one optimized pose of a term and run
//   pose_goes_up       no agent's newest optimized pose of a node is of an older term and run than before
//   newest_state       no agent drops a state before it holds a newer one; at rest the leader and the agent itself hold
//                      the state of each type and key that its robot gave last, of those that an acknowledging disk
//                      which was not lost since had (StateChecker)
//   nothing_lost       at rest leader and survivor had all that was stored anywhere, unless all disks with it were
//   lost, or
//                      it was pruned wherever it was
//   survivor_is_leader at rest the survivor holds what the leader holds, but for what either of them pruned
//   done_is_true       when an agent answers that an order to share is complete, each destination holds what the sender
//                      held when the order was given, or newer records of the same keys (DoneChecker)
//   stores_after_prune an agent that pruned much on a full disk stores records that are no maps again
//   notes_kept         at rest leader and survivor hold all notes that were inserted while their agent kept all
//                      of them, unless all disks with one were lost
//   pruned_is_covered      an agent prunes only what leader and survivor have just told it they had (PruneChecker)
//   home_again         at rest an agent holds what the team holds of it
//   brought_out        at rest rovers have their nodes' poses of the leader, the base station what `ground` asks for
//   steps_down         an agent that cannot store a newer assignment neither leads nor survives
//   history_is_own     at rest an agent's history is of its own robot, sound, within its limit, and not held
//   one_leader         at rest all agents run, know their roles, and have the same
//   comes_to_rest      at rest no session is open, and no byte goes on for ever
//   unacked_bounded    a session has no more bytes under way than its limit, nor in one message
//   end_is_last        a session tells its end when all before it is acknowledged
//   mailbox_bounded    no mailbox holds more than 64 messages, none drops any
//   nothing_refused    no agent refused or could not decode what another sent, but for a session that it lost
//   quiet_window       an agent that sleeps, or has heard that the other does, sends it no Hello and no Batch; while
//                      either drives or is paused, no Batch but of states (LeaseChecker)
//   failover_has_cause who takes the lead by itself is the survivor, and has missed the leader for leader_timeout_s
//                      (FailoverChecker)
//   failover_happens   a survivor that has missed its leader for so long takes the lead
//   starts             no actor fails by itself, at its start or later
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
  std::uint64_t step = 0;  // Messages handled by then.
  std::string text;
};

struct QuiescentTeam {
  AgentId leader = 0;
  AgentId survivor = 0;
  AgentId base = 0;
  std::map<AgentId, HaveSet> have;
  std::map<AgentId, Records> records;                           // As their rows are read.
  std::set<DataType> not_for_ground = {proto::OPTIMIZED_POSE};  // Types that the base station is not sent.
};

class Invariants {
 public:
  using PoseVersion = std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>;  // Term, run.

  using Report = std::function<void(const std::string& rule, std::string text)>;
  struct Team {
    AgentId liar = 0;       // Whose word, and whose records, prove nothing; 0: there is none.
    AgentId base = 0;       // The base station; 0: there is none.
    bool has_keys = false;  // Not everybody's word of others' records is taken (actors/storage/peer_authority.h).
  };
  explicit Invariants(Report report) : Invariants(std::move(report), Team()) {}
  Invariants(Report report, const Team& team)
      : report_(std::move(report)), liar_(team.liar), base_(team.base), has_keys_(team.has_keys) {}

  // A record was seen: on its way to a store, or read.
  void SeeRecord(const RecordKey& key, const std::string& content, AgentId where);
  // `agent` acts on these; not durable: only until its RoleActor ends.
  void SeeRoles(AgentId agent, const proto::RoleAssignment& roles, bool is_durable = true);
  void ForgetUnstoredRoles(AgentId agent) { unstored_roles_of_.erase(agent); }
  // The robot of `agent` gives it that, in the order in which it was learnt.
  void SeeGiven(AgentId agent, const proto::Record& record) {
    if (agent != liar_) states_.OnGiven(agent, record);
  }
  // The agent confirmed to its robot that it stored the record, with the marks that storage sets.
  void SeeInserted(AgentId agent, const RecordKey& key, const proto::Record& record);
  // The agent confirmed that it stored this note, and keeps all of them.
  void SeeKept(const RecordKey& key) { kept_notes_[key.stream].held.Add(key.seq); }
  // An agent inserted this event so shortly before the end that the operator's last orders need not bring it to others.
  void ExcuseLate(const RecordKey& key) { late_[key.stream].held.Add(key.seq); }
  // `agent` told another that it has these, or its disk holds them while it does not run.
  void SeeHave(AgentId agent, const HaveSet& have);

  // Its disk holds other things than what it said from now on.
  void ForgetDisk(AgentId agent);
  void ForgetRoles(AgentId agent) { roles_of_.erase(agent); }
  // The record's row was damaged: it may be gone from there, and what it had replaced is.
  void ForgetRecord(AgentId agent, const RecordKey& key);
  // What the agent had dropped of that origin and type may be forgotten there.
  void ForgetDropped(AgentId agent, AgentId origin, DataType type);

  // Whether some agent acted on roles that name `agent`: who does not hold these yet refuses what it brings of others,
  // and takes it once it does.
  bool HasHadRole(AgentId agent) const { return had_role_.contains(agent); }

  // Whether a record of `have` takes the place of that one.
  bool IsReplacedIn(const HaveSet& have, const RecordKey& key) const;

  // What `agent` has now, whole.
  void CheckHave(AgentId agent, const HaveSet& have);
  // Likewise, or whole of some origins.
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
  // Both are of the same `latest` key, or one record.
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
  std::map<RecordKey, std::uint64_t> content_of_;                     // Hashes.
  std::map<RecordKey, std::set<std::uint64_t>> inserted_as_;          // Hashes of the possible contents.
  std::map<std::string, std::pair<AgentId, AgentId>> assignment_of_;  // Leader and survivor, by term.
  std::set<AgentId> had_role_;                                        // In any of these.
  std::map<AgentId, proto::RoleAssignment> roles_of_;                 // Durable.
  std::map<AgentId, proto::RoleAssignment> unstored_roles_of_;
  StateChecker states_;
  HaveSet late_;
  HaveSet kept_notes_;
  HaveSet inserted_;                 // Without what was lost with all disks that had it.
  std::map<AgentId, HaveSet> held_;  // What each certainly has.
  std::map<std::pair<Node, PoseVersion>, std::string> pose_of_;
  std::map<RecordKey, PoseName> pose_names_;
  std::map<RecordKey, std::pair<Node, Node>> verdict_names_;  // The range's ends.
  struct Poses {
    HaveSet held;  // When last looked at.
    std::map<Node, PoseVersion> newest;
  };
  std::map<AgentId, Poses> poses_of_;
};

}  // namespace moondb::simulation
