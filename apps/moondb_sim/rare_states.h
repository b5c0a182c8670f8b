// RareStates: how often a run came into states that are reached seldom, and in which mistakes hide: a sweep that never
// reached one has not tried it. Counted from outside, by what actors handle and the radio carries.
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

// In the order in which reports show them. Some are reached with all actors alone.
const std::vector<RareState>& RareStateKinds();

class RareStates {
 public:
  // An actor is about to handle the message.
  void OnHandle(const Address& actor, const proto::Message& message);
  void OnRadio(AgentId from, AgentId to, const proto::Message& message);
  void OnAgentEnded(AgentId agent);
  // One that others see: its name is one of RareStateKinds.
  void Count(const std::string& name) { ++counts_[name]; }

  const std::map<std::string, int>& counts() const { return counts_; }

 private:
  using Session = std::tuple<AgentId, std::string, AgentId>;  // Sender, actor, receiver.
  struct Fragment {
    std::uint64_t session_id = 0;
    std::uint64_t term = 0;  // Its sender's, when it was sent last.
  };

  void OnRoles(const Address& actor, std::uint64_t term);
  void OnFragment(const Session& session, const proto::Batch& batch);

  std::map<std::string, int> counts_;
  std::map<Address, std::uint64_t> term_of_;                         // That each actor received last.
  std::map<AgentId, std::uint64_t> newest_term_;                     // Of each agent's actors.
  std::set<Session> ending_;                                         // Their last batches are not acknowledged.
  std::map<std::pair<AgentId, std::uint64_t>, Fragment> fragments_;  // By receiver and hash of the whole.
  std::map<AgentId, int> merging_;                                   // Questions that MergeActor has not answered.
  std::map<AgentId, int> solving_;
};

}  // namespace moondb::simulation
