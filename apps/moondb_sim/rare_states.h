// RareStates: counts how often a run reached rare states, in which bugs hide. A sweep that never reached a rare state
// has not tested it.
#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "proto/message.pb.h"
#include "runtime/actor.h"

namespace moondb::simulation {

struct RareState {
  std::string name;
  std::string what;
};

// All rare states, in the order of reports. Some occur only with SimulatedActors::kAll.
const std::vector<RareState>& RareStateKinds();

class RareStates {
 public:
  // Called before an actor handles the message.
  void OnHandle(const Address& actor, const proto::Message& message);
  void OnRadio(AgentId from, AgentId to, const proto::Message& message);
  void OnAgentEnded(AgentId agent);
  // Adds one to the count of a state that another class observed. Requires: `name` is one of RareStateKinds.
  void Count(const std::string& name) { ++counts_[name]; }

  const std::map<std::string, int>& counts() const { return counts_; }

 private:
  using Session = std::tuple<AgentId, std::string, AgentId>;  // Sending agent, sending actor, receiving agent.
  struct Fragment {
    std::uint64_t session_id = 0;
    std::uint64_t term = 0;  // Term of the sender when it last sent the fragment.
  };

  void OnRoles(const Address& actor, std::uint64_t term);
  void OnFragment(const Session& session, const proto::Batch& batch);

  std::map<std::string, int> counts_;
  std::map<Address, std::uint64_t> term_of_;      // Newest term that each actor received.
  std::map<AgentId, std::uint64_t> newest_term_;  // Newest term that any actor of the agent received.
  std::set<Session> ending_;                      // Sessions whose last batch is not acknowledged.
  // Last fragment sent, by receiver and hash of the whole record.
  std::map<std::pair<AgentId, std::uint64_t>, Fragment> fragments_;
  std::map<AgentId, int> merging_;  // Number of unanswered requests at each agent's MergeActor.
  std::map<AgentId, int> solving_;
};

}  // namespace moondb::simulation
