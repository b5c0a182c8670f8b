// RoleChain: which of the assignments of roles that are known count, and so who has led and survived.
//
// An assignment names by its signature the one that it follows, and counts for one of two reasons:
//   - its issuer may command the team (command_from of the team file): then it begins a reign, the one after that of
//   the
//     assignment that it follows, and need not hold what it follows;
//   - its issuer leads or survives in the one that it follows, which counts: then it is the next change of that reign.
// The team file's roles are change 0 of reign 0 and count. Two may follow one, as two leaders decide in two halves of a
// team: both count, and the newer term stands. So how high a term is says how long its chain is, and nobody who never
// led moves anything.
//
// Signatures are checked by whoever adds (runtime/team/role_signature.h). In a team without keys assignments have none,
// and each counts. What follows an assignment that is not known waits for it, up to kWaitingAssignmentsMax of all
// issuers; beyond, one of an issuer that has few takes the place of the oldest of the issuer that has most. Of one
// issuer kAssignmentsOfIssuerMax count at most, so that nobody who led once fills the memory. Not copied.
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
    proto::RoleAssignment initial;             // The team file's, without a signature.
    std::function<bool(AgentId)> may_command;  // As command_from has it.
    bool has_keys = true;                      // Whether assignments are signed.
  };

  enum class Standing {
    kCounts,
    kLacksPredecessor,  // May count once what it follows is known.
    kNever,             // Its issuer may not decide it, or has decided too many.
  };

  // Of a team without keys.
  static Options WithoutKeys() {
    Options options;
    options.has_keys = false;
    return options;
  }

  explicit RoleChain(Options options);
  RoleChain(const RoleChain&) = delete;
  RoleChain& operator=(const RoleChain&) = delete;

  // What became of it; one that is known already changes nothing.
  Standing Add(const proto::RoleAssignment& roles);
  Standing StandingOf(const proto::RoleAssignment& roles) const;

  // Of those that count; null for a signature that none has. Empty: the team file's.
  const proto::RoleAssignment* Find(const std::string& signature) const;
  std::size_t size() const { return counting_.size(); }  // Of those that count, with the team file's.
  // The one of the newest term that counts.
  const proto::RoleAssignment& newest() const { return *newest_; }
  // Whether an assignment that counts, or the team file, named the agent leader or designated survivor.
  bool HasHadRole(AgentId agent) const { return had_role_.contains(agent); }
  // Whether one of this term that counts names the agent leader.
  bool HasLedIn(AgentId agent, const proto::Term& term) const;
  // What ends with this one, newest first, back to where a reign begins; at most so many bytes of them, but one. Empty
  // where it is not known to count.
  std::vector<proto::RoleAssignment> ChainOf(const std::string& signature, std::size_t bytes_max) const;

  // What `issuer`'s next assignment after `follows` is to say of its place: its term's number, and what it follows.
  // `is_command`: as one that may command the team.
  static proto::RoleAssignment Next(const proto::RoleAssignment& follows, bool is_command);

 private:
  const proto::RoleAssignment& Keep(const proto::RoleAssignment& roles);
  // Whether one more of this issuer may wait; may remove one of an issuer that has more.
  bool MakeRoomToWait(AgentId issuer);

  Options options_;
  // By signature; in a team without keys by term.
  std::map<std::string, proto::RoleAssignment> counting_;
  std::multimap<std::string, proto::RoleAssignment> waiting_;  // By what they follow.
  std::map<AgentId, std::size_t> counting_of_issuer_;
  std::set<AgentId> had_role_;
  std::multimap<std::string, AgentId> leaders_;  // By term, serialised.
  const proto::RoleAssignment* newest_ = nullptr;
};

}  // namespace moondb
