// PgoActor: the leader solves the team's pose graph, on request or periodically, and publishes the poses that moved and
// the verdicts that changed as records (paper, Section 5.2; docs/POSE_GRAPH.md).
//
// A request that arrives during a solve waits. If it equals the request in progress and arrived before the solver ran,
// both requests get the same reply. Otherwise the request is processed later, in order of arrival. A reply is sent once
// all published records are committed.
//
// If this agent is not the leader, or if the roles change during the solve, the reply is kRefused. If too many requests
// wait, the reply is kFull. If storage does not answer, the reply is kTimedOut. Records that were committed before an
// error remain.
//
// Watches Topic::kRoles and Topic::kStored. Spawn this actor under actor_name::kPgo on its own thread, because a solve
// takes seconds. A solve ends early when the system stops.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "actors/pgo/known_graph.h"
#include "actors/pgo/pose_graph_solver.h"
#include "actors/pgo/publication.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/derived_reader.h"
#include "runtime/quiet_timer.h"
#include "runtime/record_writer.h"

namespace moondb {

class PgoActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // Validated configuration: start poses, antennas, the base station's position, names.
    SolverOptions solver;    // Set thread_count to 1 in simulation. The actor overrides stop_requested.
    PublicationOptions publication;
    // A periodic solve starts once no nodes, edges, priors, map matches or quarantines have been stored for this long,
    // which indicates a completed sync.
    // 0: solve only on request.
    Duration solve_when_quiet{};
    Duration solve_apart = std::chrono::seconds(60);    // Minimum time between periodic solves.
    Duration solve_time_max = std::chrono::minutes(5);  // A solve that takes longer ends without a result.
    std::size_t requesters_max = 16;                    // Maximum number of requests that wait.
    std::size_t read_records_max = 1000;                // Maximum number of records per read request.
    std::size_t insert_records_max = 200;               // Maximum number of records per insert request.
    Duration storage_timeout = std::chrono::seconds(30);
  };

  explicit PgoActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  enum class Phase { kIdle, kReading, kWriting };

  struct Requester {
    Address address;
    std::uint64_t request_id = 0;
    proto::OptimizeRequest request;
    // True if the request arrived after the current solve had read its records. The next solve then answers the
    // request.
    bool is_late = false;
  };

  void OnRoles(Context& context, const proto::RoleAssignment& roles);
  void OnOptimizeRequest(Context& context, const proto::Message& message);
  void OnGraphStatsRequest(Context& context);
  void OnRead(Context& context);
  void OnWritten(Context& context);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnRecordsStored(Context& context, const proto::RecordsStored& stored);
  void OnQuiet(Context& context);

  bool Leads() const { return roles_ && roles_->leader() == options_.self; }
  void AwaitQuiet(Context& context);
  void Begin(Context& context, proto::OptimizeRequest request);

  std::optional<Error> WhyNotLeader() const;
  void SolveNow(Context& context);
  // Reports to storage the records that the solve does not use, because of a limit or of the origin's role. `left_out`:
  // number of edges that this solve leaves out, by origin.
  void ReportLeftOut(Context& context, std::map<AgentId, std::uint64_t> left_out);
  SolverOptions OptionsOf(const proto::OptimizeRequest& request) const;
  void WritePublication(Context& context);
  void FinishWith(Context& context, const Error& error);
  void Finish(Context& context);
  void Answer(Context& context, const Requester& requester, const proto::OptimizeReply& reply);

  const Options options_;
  const AgentFactsMap agents_;
  std::optional<proto::RoleAssignment> roles_;
  KnownGraph known_;
  DerivedReader reader_;  // Reads records into known_.
  RecordWriter writer_;   // Stores the records of publication_.

  Phase phase_ = Phase::kIdle;
  std::uint64_t solve_id_ = 0;         // Number of the solve whose publication is written.
  std::vector<Requester> requesters_;  // Waiting requests in order of arrival.
  proto::OptimizeRequest request_;     // The request being processed.
  Publication publication_;
  proto::OptimizeReply reply_;  // Reply to the request being processed.

  QuietTimer quiet_;  // A periodic solve starts after a pause in arriving records.

  // Number of the last solve (run) that this actor has published in the current term.
  std::uint64_t last_run_ = 0;
  proto::GraphStatsReply stats_;
};

}  // namespace moondb
