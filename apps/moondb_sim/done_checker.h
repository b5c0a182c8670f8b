// DoneChecker: whether an order is done when an agent answers that it is complete: the rule done_is_true.
//
// The operator gives orders that wait for their end. What each agent held then is noted; when the answer comes the
// stores are looked at, at that instant. Of what a leader gathers, once in a term, counts what was noted last before
// the leader's term began.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/moondb_sim/simulated_world.h"
#include "proto/sharing.pb.h"

namespace moondb::simulation {

class DoneChecker {
 public:
  explicit DoneChecker(SimulatedWorld& world) : world_(world) {}

  // The operator of an agent that leads gives an order.
  void Order(AgentId leader, proto::SharingKind kind);
  // Whether an order was answered, so that CheckAnswers must be called before anything else happens. Not within a
  // handler.
  bool HasAnswers();
  void CheckAnswers();

  // The agent acts on other roles from now on.
  void OnRoles(AgentId agent);
  // Its disk holds other things from now on.
  void OnDiskLost(AgentId agent);

 private:
  using Stores = std::map<AgentId, HaveSet>;  // Of running agents.

  struct Waiting {
    AgentId leader = 0;
    proto::SharingKind kind = proto::SHARING_KIND_UNSPECIFIED;
    Stores before;  // When the order was given.
  };

  void Check(const Waiting& waiting, const proto::ShareProgress& progress);
  std::optional<std::string> WhyNotDone(const Waiting& waiting, const proto::ShareProgress& progress);
  // "agent 3 to agent 1: 3.0001...12 is not there"; nothing where all that is `meant` is.
  template <typename IsMeant>
  std::optional<std::string> WhyLacking(const Stores& before, const Stores& now, AgentId sender, AgentId destination,
                                        IsMeant is_meant) const;
  Stores ReadStores();

  SimulatedWorld& world_;
  std::uint64_t last_request_id_ = 0;
  std::map<std::uint64_t, Waiting> waiting_;  // By request id.
  std::vector<std::pair<Waiting, proto::ShareReply>> answers_;
  Stores last_;                               // When an order was given last.
  std::map<AgentId, Stores> before_term_of_;  // By leader.
  std::map<AgentId, MonotonicTime> roles_changed_at_;
};

}  // namespace moondb::simulation
