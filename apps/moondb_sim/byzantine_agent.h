// ByzantineAgent: a rover that an attacker has taken over. Its own actors run as usual, but it also sends forged
// messages to the actors of other agents. Links are authenticated, so it sends the forged messages under its own
// identity. It sends only messages that agents accept from each other (runtime/transport/inbound.h). It knows all
// records of all agents.
//
// The agent has no role in the team file, and stops its attacks when an honest agent gives it a role. SECURITY.md
// describes what a malicious leader can do. Attacks use their own random stream, so adding one does not change the rest
// of a seeded run.
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

// All attacks, in the order of `--list`. RareStateOf returns the name of the rare state (rare_states.h) that counts
// handled messages of an attack.
const std::vector<AttackKind>& AttackKinds();
std::string RareStateOf(const AttackKind& kind);

class ByzantineAgent {
 public:
  // If the world has no Byzantine agent, this object does nothing.
  ByzantineAgent(SimulatedWorld& world, ByzantineChecker& checker);

  void Start();  // Attacks at random times until SimulatedWorld::is_quiet.

  // Called before an actor of any agent handles `message`.
  void OnHandle(const Address& actor, const proto::Message& message);
  // Called when `from` sends `message` to `to`. Returns true if the message is an attack.
  bool OnRadio(AgentId from, AgentId to, const proto::Message& message);

  // Each of these functions sends messages of one attack to `target`. Requires: `target` is an honest agent.
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
  proto::RoleAssignment RolesOf(AgentId agent) const;  // Roles on which the agent acts; empty if it does not run.
  AgentId DrawHonest();
  AgentId DrawHonestBut(AgentId agent);
  std::optional<RecordKey> DrawKey(AgentId holder, AgentId origin);
  void Attack();
  void Send(const Address& to, const std::string& as_actor, proto::Message message);
  void SendBatch(AgentId target, proto::Batch batch);
  void SendRecord(AgentId target, const RecordKey& key, const proto::Record& record);
  void SendRecords(AgentId target, const std::vector<std::pair<RecordKey, proto::Record>>& records);
  void Remember(const Address& to, const proto::Message& message);
  proto::Record RecordLike(const RecordKey& key);
  proto::RoleAssignment Assignment(AgentId target);
  proto::ControlRequest DrawOrder(AgentId target);

  SimulatedWorld& world_;
  ByzantineChecker& checker_;
  std::mt19937_64 rng_;
  std::size_t kind_ = 0;       // Index of the present attack in AttackKinds().
  bool is_attacking_ = false;  // True while an attack sends messages.
  int dense_count_ = 0;        // Dense graphs sent so far.
  std::deque<Seen> seen_;      // The last messages that the Byzantine agent's actors handled or sent.
  // Id of the newest session that each other agent opened with each of the Byzantine agent's actors.
  std::map<std::pair<AgentId, std::string>, std::uint64_t> sessions_;
  std::map<std::uint64_t, std::size_t> in_flight_;  // Index in AttackKinds() of each sent attack, by message hash.
};

}  // namespace moondb::simulation
