// Rules: what must hold of a simulated team at every step, and what the checks of them need to remember.
//
//   one_content        no record's key ever has two contents
//   one_assignment     a term has at most one assignment of roles
//   term_goes_up       no agent acts on a lower term than before, whatever happened to its process
//   acknowledged_held  what an agent said it had is there after a crash (until its disk was lost)
//   one_pose_a_run     a node has at most one optimized pose of a term and run
//   newest_state       at rest the leader holds the last state of each rover that any disk still had
//   nothing_lost       at rest leader and survivor had all that was stored anywhere, unless all disks with it were lost
//   survivor_is_leader at rest the survivor holds what the leader holds
//   home_again         at rest an agent holds what the team holds of it
//   one_leader         at rest all agents have the same roles
//   comes_to_rest      at rest no session is open, and no byte goes on for ever
//   nothing_refused    no agent refused or could not decode what another sent
//   starts             an actor that is made anew does not fail at that
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>

#include "model/have_set.h"
#include "model/record_key.h"
#include "proto/message.pb.h"
#include "runtime/actor.h"

namespace moondb::simulation {

struct Violation {
  std::string rule;
  double time_s = 0;
  std::string text;
};

class Rules {
 public:
  using Report = std::function<void(const std::string& rule, std::string text)>;
  explicit Rules(Report report) : report_(std::move(report)) {}

  // A record was seen: in an insert's answer, on its way to a store, or read.
  void SeeRecord(const RecordKey& key, std::uint64_t content_hash, AgentId where);
  void SeeRoles(AgentId agent, const proto::RoleAssignment& roles);
  // The robot of `agent` was told that it is stored there.
  void SeeInserted(AgentId agent, const RecordKey& key, const proto::Record& record);
  // `agent` told another that it has these.
  void SeeHave(AgentId agent, const HaveSet& have);
  // Its disk holds other things than what it said from now on.
  void ForgetDisk(AgentId agent);
  void ForgetRoles(AgentId agent) { roles_of_.erase(agent); }

  void CheckHeld(AgentId agent, const HaveSet& have) const;
  void CheckStates(AgentId leader, const HaveSet& have, const std::map<RecordKey, std::string>& records) const;
  const HaveSet& inserted() const { return inserted_; }  // Without what was lost with all disks that had it.

 private:
  const Report report_;
  std::map<RecordKey, std::uint64_t> content_of_;
  std::map<std::string, std::string> assignment_of_;  // By term.
  std::map<AgentId, proto::RoleAssignment> roles_of_;
  HaveSet inserted_;
  std::map<AgentId, HaveSet> held_;             // What each certainly has, as told to a robot or a peer.
  std::map<std::string, std::string> pose_of_;  // By node, term and run.
};

}  // namespace moondb::simulation
