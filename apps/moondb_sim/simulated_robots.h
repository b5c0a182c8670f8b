// SimulatedRobots: simulates the agents' robots, and an optimizer at each leader. Every ten seconds a rover inserts a
// state and a node, and every minute a map. Rovers repeat unanswered inserts of nodes and edges. In one seed of four, a
// rover reports its state when its agent starts and then not for an hour, and a leader optimizes right after its start.
//
// With SimulatedActors::kAll, robots are clients of their agents' gateways and drive (SimulatedDrive). They insert a
// node, its edges and a map every minute. PgoActor replaces the optimizer.
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

  void Start();                           // Inserts records until SimulatedWorld::is_quiet.
  void TakeInsertReplies(AgentId agent);  // Reports newly confirmed records to the invariants.
  // Requests a lease of `kind` for the time `length`, as a robot's software or an operator does. `length` 0 ends the
  // lease. Does nothing if the agent does not run.
  void SetLease(AgentId agent, proto::LeaseKind kind, Duration length);
  // Inserts large uniform maps, which take much space on the disk and little on the radio.
  void LearnPlainMaps(AgentId rover);
  void OnAgentStarted(AgentId agent);  // Call before the agent connects to others.
  void OnAgentEnded(AgentId agent);    // Drops the agent's open requests.

 private:
  struct Robot {
    std::uint64_t turns = 0;       // Number of past turns. The robot has a turn (Work) every ten seconds.
    MonotonicTime silent_until{};  // The robot reports no states before this time.
    std::map<std::uint64_t, std::vector<proto::Record>> asked;
    std::deque<proto::Record> open;  // Records to insert at the next turn.
  };

  bool IsSilent() const;
  Address ListenerOf(AgentId agent) const;  // Address to which the agent's robot sends requests.
  Address RobotOf(AgentId agent) const;     // Address at which the agent's robot receives answers.
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
  void ObserveInserted(AgentId agent, const std::vector<proto::Record>& records, const proto::InsertReply& reply);

  SimulatedWorld& world_;
  SimulatedDrive drive_;
  // Stored quarantines, some of which are lifted later. Used only with SimulatedActors::kAll.
  std::vector<RecordKey> quarantines_;
  std::uint64_t request_id_ = 0;
  std::map<AgentId, Robot> robots_;
  // Run number of the last optimized poses, by leader and term number. Cleared when the leader's process ends.
  std::map<std::pair<AgentId, std::uint64_t>, std::uint64_t> run_;
};

}  // namespace moondb::simulation
