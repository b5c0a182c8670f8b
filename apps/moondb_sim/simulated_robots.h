// SimulatedRobots: what stands around the agents: rovers that insert a state and a node every ten seconds and a map
// every minute, and again what was not answered; and the optimizer of whoever leads. In one seed of four rovers say
// what state they are in when their agent starts, and then for an hour no more, and a leader that starts optimizes at
// once.
//
// With all actors robots are clients of their agents' gateways, drive (SimulatedDrive), insert a node with its edges
// and a map every minute, and leave the pose graph to PgoActor.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <utility>
#include <vector>

#include "apps/moondb_sim/simulated_drive.h"
#include "apps/moondb_sim/simulated_world.h"

namespace moondb::simulation {

class SimulatedRobots {
 public:
  explicit SimulatedRobots(SimulatedWorld& world) : world_(world), drive_(world) {}

  void Start();                           // Until the world is quiet.
  void TakeInsertReplies(AgentId agent);  // Tells the rules what is stored.
  // The robot's own software, or an operator, tells its agent; 0: no more. Nothing where that does not run.
  void SetLease(AgentId agent, proto::LeaseKind kind, Duration length);
  // Inserts maps that take much room on the disk and little on the radio.
  void LearnPlainMaps(AgentId rover);
  void OnAgentStarted(AgentId agent);  // Before it hears of any other.
  void OnAgentEnded(AgentId agent);    // Nothing that it was asked is answered any more.

 private:
  struct Robot {
    std::uint64_t turns = 0;       // Each with one node, but where it drives.
    MonotonicTime silent_until{};  // With states.
    std::map<std::uint64_t, std::vector<proto::Record>> asked;
    std::deque<proto::Record> open;  // To be inserted.
  };

  bool IsSilent() const;
  Address ListenerOf(AgentId agent) const;  // Where its robot's requests go to,
  Address RobotOf(AgentId agent) const;     // and the answers.
  static Address ActorOf(AgentId agent);
  void Work(AgentId rover);
  void Learn(AgentId rover, Robot& robot);
  void Drive(AgentId agent, Robot& robot);
  void InsertOpen(AgentId agent, Robot& robot);
  // Inserts a record of a custom type with a random payload and one of `key_count` latest keys.
  void ReportCustom(AgentId rover, DataType type, std::uint64_t key_count);
  void ReportState(AgentId rover);
  void Optimize();
  void OptimizeAt(AgentId leader);
  void SetPose(proto::Pose& pose);
  proto::Record Quarantine();
  proto::Record QuarantineOfLate();
  proto::Record MapAt(AgentId rover, std::uint64_t index);
  char DrawCells();
  void Insert(AgentId agent, std::vector<proto::Record> records);
  void NoteInserted(AgentId agent, const std::vector<proto::Record>& records, const proto::InsertReply& reply);

  SimulatedWorld& world_;
  SimulatedDrive drive_;
  std::vector<RecordKey> quarantines_;  // Given with all actors, some of which are lifted later.
  std::uint64_t request_id_ = 0;
  std::map<AgentId, Robot> robots_;
  std::map<std::pair<AgentId, std::uint64_t>, std::uint64_t> run_;  // Of a leader in a term, in its present life.
};

}  // namespace moondb::simulation
