// ByzantineAgent: a rover that was taken over. Beside what its own actors do, which are as everybody's, it sends the
// others' actors whatever it likes: as itself, since links are known by their keys, and of what may leave an agent
// (runtime/transport/inbound.h). It knows all that any agent has, and neither leads nor survives. Once an honest agent
// gives it a role it lies no more: what a leader that was taken over can do is known (SECURITY.md).
//
// Its chance is its own: which attacks there are changes no other draw of a run.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "apps/moondb_sim/byzantine_checker.h"
#include "apps/moondb_sim/simulated_world.h"

namespace moondb::proto {
class ControlRequest;
}  // namespace moondb::proto

namespace moondb::simulation {

struct AttackKind {
  std::string name;
  std::string what;
};

// In the order in which `--list` shows them. Each has a rare state, of the name that RareStateOf gives.
const std::vector<AttackKind>& AttackKinds();
std::string RareStateOf(const AttackKind& kind);

class ByzantineAgent {
 public:
  // Nothing ever happens where the world has none.
  ByzantineAgent(SimulatedWorld& world, ByzantineChecker& checker);

  void Start();  // Until the world is quiet.

  // An actor of any agent is about to handle the message.
  void OnHandle(const Address& actor, const proto::Message& message);
  // A message is on its way; true: it is an attack.
  bool OnRadio(AgentId from, AgentId to, const proto::Message& message);

  // The attacks; the target is honest.
  void ForgeRecord(AgentId target);
  void ForgeEvent(AgentId target);
  void ForgePose(AgentId target);
  void Slander(AgentId target);
  void Claim(AgentId target);
  void ClaimEpochs(AgentId target);
  void Drop(AgentId target);
  void Replay(AgentId target);
  void Announce(AgentId target);
  void Order(AgentId target);
  void OrderToShare(AgentId target);
  void Equivocate(AgentId target);
  void Flood(AgentId target);
  void JoinAll(AgentId target);

 private:
  struct Seen {
    Address to;
    proto::Message message;
  };

  std::uint64_t Draw(std::uint64_t count) { return rng_() % count; }
  proto::RoleAssignment RolesOf(AgentId agent) const;  // On which it acts; none where it does not run.
  AgentId DrawHonest();
  AgentId DrawHonestBut(AgentId agent);
  std::optional<RecordKey> DrawKey(AgentId holder, AgentId origin);
  void Attack();
  void Send(const Address& to, const std::string& as_actor, proto::Message message);
  void Bring(AgentId target, proto::Batch batch);
  void BringRecord(AgentId target, const RecordKey& key, const proto::Record& record);
  void BringRecords(AgentId target, const std::vector<std::pair<RecordKey, proto::Record>>& records);
  void Remember(const Address& to, const proto::Message& message);
  proto::Record RecordLike(const RecordKey& key);
  proto::RoleAssignment Assignment(AgentId target);
  proto::ControlRequest DrawOrder(AgentId target);

  SimulatedWorld& world_;
  ByzantineChecker& checker_;
  std::mt19937_64 rng_;
  std::size_t kind_ = 0;                                               // Of the attack that is being made.
  bool is_attacking_ = false;                                          // What is sent now is an attack.
  int dense_count_ = 0;                                                // Dense graphs that it has brought.
  std::deque<Seen> seen_;                                              // Messages that its actors handled or sent.
  std::map<std::pair<AgentId, std::string>, std::uint64_t> sessions_;  // That others opened with it, by their actor.
  std::map<std::uint64_t, std::size_t> in_flight_;                     // Kinds of attacks, by hash of the message.
};

}  // namespace moondb::simulation
