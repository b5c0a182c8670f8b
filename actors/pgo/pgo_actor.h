// PgoActor: the leader solves the team's pose graph on request and publishes where everybody was (paper, Section 5.2).
//
//   OptimizeRequest -> reads what is new in its storage, page by page -> solves, in the handler -> inserts the poses
//   that moved and the verdicts that changed, in chunks -> OptimizeReply, once all of them are committed.
//
// A request may want all solved from scratch, only a window of the newest nodes, or covariances (proto/graph.proto).
//
// With `solve_when_quiet` it also solves by itself, while it leads: when nodes or edges have come to its storage and no
// more of them for so long, which is how a completed sync looks from here; where they never stop, `solve_apart` after
// the first.
//
// Optimized poses and verdicts are records like any other: versioned by (term, run), shared by policy, read back here,
// so a new leader continues from the last one's solution. An agent that is not the leader refuses (kRefused, with the
// leader's name). A request that comes while one is worked on waits: for the same answer where it asks the same
// before the solve begins, else for its turn; at most `requesters_max`, then kFull. Storage that does not answer within
// `storage_timeout` gives kTimedOut; what it committed stays and is not published again. A leader that loses its role
// meanwhile answers kRefused and writes no further chunk: what a change of roles finds being solved is not published at
// all.
//
// A solve has limits (KnownGraph::Limits, SolveSizeMax, solve_time_max). Records that exceed them are left out, of
// those agents first that have most, and AgentStatus.refused names these.
//
// Listens to RolesChanged (also asked of RoleActor at the start), OptimizeRequest, GraphStatsRequest, RecordsStored.
// Spawn it under actor_name::kPgo with a thread of its own: a solve takes up to seconds. Solves end early when the
// system stops.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "actors/pgo/known_graph.h"
#include "actors/pgo/pose_graph_solver.h"
#include "actors/pgo/publication.h"
#include "model/record_authority.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/record_reader.h"

namespace moondb {

class PgoActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // Checked: start poses, antennas, the base station's place, names.
    SolverOptions solver;    // thread_count: 1 in simulation. stop_requested is set by the actor.
    PublicationOptions publication;
    Duration solve_when_quiet{};                        // 0: on request only.
    Duration solve_apart = std::chrono::seconds(60);    // Between two solves that nobody asked for, at least.
    Duration solve_time_max = std::chrono::minutes(5);  // Then the solve ends, and changes nothing.
    std::size_t requesters_max = 16;                    // Requests that wait for an answer.
    std::size_t read_records_max = 1000;                // Of one page.
    std::size_t insert_records_max = 200;               // Of one chunk.
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
    bool is_late = false;  // Asked after the solve in hand had read its records: the next one's.
  };

  bool IsFromStorage(const Context& context, const proto::Message& message) const;
  void OnRoles(Context& context, const proto::RoleAssignment& roles);
  void OnOptimizeRequest(Context& context, const proto::Message& message);
  void OnGraphStatsRequest(Context& context);
  void OnRead(Context& context);
  void OnInsertReply(Context& context, const proto::InsertReply& reply);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnTimeout(Context& context, std::uint64_t request_id);
  void OnRecordsStored(Context& context, const proto::RecordsStored& stored);
  void OnQuiet(Context& context);

  bool Leads() const { return roles_ && roles_->leader() == options_.self; }
  void AwaitQuiet(Context& context);
  void Begin(Context& context, proto::OptimizeRequest request);
  void StartReading(Context& context);

  std::optional<Error> WhyNotLeader() const;
  Result<void> TakeRecord(const proto::StoredRecord& stored);
  void SolveNow(Context& context);
  // Which records the solve does not use for want of room or of their origin's role; `left_out`: edges of this solve.
  void ReportLeftOut(Context& context, std::map<AgentId, std::uint64_t> left_out);
  SolverOptions OptionsOf(const proto::OptimizeRequest& request) const;
  void WriteNextChunk(Context& context);
  void AskToInsert(Context& context, proto::Message message);
  void FinishWith(Context& context, const Error& error);
  void Finish(Context& context);
  void Answer(Context& context, const Requester& requester, const proto::OptimizeReply& reply);

  const Options options_;
  const AgentFactsMap agents_;
  std::optional<proto::RoleAssignment> roles_;
  KnownGraph known_;
  RecordAuthority authority_;
  bool is_outdated_ = false;  // known_ may have records that are gone, or lack some that count by now.
  RecordReader reader_;       // Into known_.

  Phase phase_ = Phase::kIdle;
  std::uint64_t request_id_ = 0;       // The insert that storage has not answered yet.
  TimerId timeout_ = 0;                // After which storage has not answered that insert.
  std::vector<Requester> requesters_;  // First come, first served.
  proto::OptimizeRequest request_;     // In hand.
  Publication publication_;
  std::size_t written_count_ = 0;
  proto::OptimizeReply reply_;  // Of the solve in hand.

  // Until records stop coming.
  struct Quiet {
    bool is_awaited = false;      // A timer runs.
    MonotonicTime oldest_news{};  // When the oldest news came that no solve has seen.
    MonotonicTime newest_news{};
    std::optional<MonotonicTime> last_periodic;
  };
  Quiet quiet_;

  std::uint64_t last_run_ = 0;  // In the present term, of this actor's life.
  proto::GraphStatsReply stats_;
};

}  // namespace moondb
