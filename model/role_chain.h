// RoleChain: decides which of the known role assignments are valid, and so which agents have been leader or designated
// survivor.
//
// Each assignment contains the signature of its predecessor. A term consists of an era and a revision within the era
// (model/term.h). An assignment is valid (it "counts") in one of two cases:
//   - Its issuer may command the team (command_from of the team file). The assignment then begins a new era, which
//     follows the era of its predecessor. The predecessor need not be known here.
//   - Its predecessor is valid and names the issuer leader or survivor. The assignment is then the next revision in the
//     predecessor's era.
// The team file's roles are valid, as revision 0 of era 0. Two valid assignments may have the same predecessor, for
// example after a partition of the team; the assignment with the newer term is in force.
//
// An assignment whose predecessor is unknown waits until the predecessor is added. At most kWaitingAssignmentsMax
// assignments wait, and at most kAssignmentsOfIssuerMax assignments of one issuer become valid. These limits keep a
// malicious agent from filling the memory.
//
// The caller checks signatures before it adds an assignment (runtime/team/role_signature.h). In a team without keys,
// all assignments are valid. Not copyable.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "model/ids.h"
#include "proto/term.pb.h"

namespace moondb {

inline constexpr std::size_t kWaitingAssignmentsMax = 4096;
inline constexpr std::size_t kAssignmentsOfIssuerMax = 16384;

class RoleChain {
 public:
  struct Options {
    proto::RoleAssignment initial;             // The team file's roles, without a signature.
    std::function<bool(AgentId)> may_command;  // Returns true if command_from names the agent.
    bool has_keys = true;                      // True if assignments are signed.
  };

  enum class Standing {
    kCounts,            // The assignment is valid.
    kLacksPredecessor,  // The assignment may be valid once its predecessor is known.
    kNever,             // The assignment can never become valid.
  };

  static Options WithoutKeys() {
    Options options;
    options.has_keys = false;
    return options;
  }

  explicit RoleChain(Options options);
  RoleChain(const RoleChain&) = delete;
  RoleChain& operator=(const RoleChain&) = delete;

  // Adds an assignment and returns its standing. Idempotent.
  Standing Add(const proto::RoleAssignment& roles);
  Standing StandingOf(const proto::RoleAssignment& roles) const;

  // Returns the valid assignment with this signature, or null; an empty signature means the team file's assignment.
  const proto::RoleAssignment* Find(const std::string& signature) const;
  // Returns the number of valid assignments, including the team file's assignment.
  std::size_t size() const { return counting_.size(); }
  // Returns the valid assignment with the newest term.
  const proto::RoleAssignment& newest() const { return *newest_; }
  // Returns whether a valid assignment, or the team file, names the agent leader or designated survivor.
  bool HasHadRole(AgentId agent) const { return had_role_.contains(agent); }
  // Returns whether a valid assignment of this term names the agent leader.
  bool HasLedIn(AgentId agent, const proto::Term& term) const;
  // Returns the valid assignment with this signature and its predecessors, newest first, back to the first assignment
  // of its era. If the assignments exceed `bytes_max`, leaves out the oldest, but returns at least one. Empty if no
  // valid assignment has this signature.
  std::vector<proto::RoleAssignment> ChainOf(const std::string& signature, std::size_t bytes_max) const;

  // Returns a successor of the assignment `follows`, in which only the predecessor's signature and the term number are
  // set. The term number is the next revision of the same era or, if `is_command`, revision 0 of the next era.
  static proto::RoleAssignment Next(const proto::RoleAssignment& follows, bool is_command);

 private:
  const proto::RoleAssignment& Keep(const proto::RoleAssignment& roles);
  // Returns whether one more assignment of `issuer` may wait. Returns true if fewer than kWaitingAssignmentsMax
  // assignments wait. Otherwise returns true only if another issuer has at least two more waiting assignments than
  // `issuer`; in this case, removes the oldest waiting assignment of the issuer that has the most.
  bool MakeRoomToWait(AgentId issuer);

  Options options_;
  // Valid assignments, keyed by signature; in a team without keys, by TermKey.
  std::map<std::string, proto::RoleAssignment> counting_;
  std::multimap<std::string, proto::RoleAssignment> waiting_;  // Keyed by the signature of the predecessor.
  std::map<AgentId, std::size_t> counting_of_issuer_;
  std::set<AgentId> had_role_;
  std::multimap<std::string, AgentId> leaders_;  // Leaders in valid assignments, keyed by TermKey.
  const proto::RoleAssignment* newest_ = nullptr;
};

}  // namespace moondb
