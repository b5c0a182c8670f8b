// RegisterActor: finds the relative poses of rovers by matching their local maps. Works only at the leader.
//
// After each solve, the actor reads the maps and poses from StorageActor and matches pairs of nearby maps in passes
// (match_plan.h, map_matching.h). It stores accepted matches as records of the type map_match, which the next solve
// uses as loop closures of the source "registration". At most two passes follow new maps, measurements or quarantines,
// so matches and solves do not trigger each other endlessly. Matches are stored every insert_records_max, so a crash or
// a change of the leader loses few. If storage refuses them, for example because the disk is full, the actor keeps
// them, and tries again after pass_retry or with the next records; then the pass continues.
//
// Rovers that nothing ties together are searched for in each other's submaps (start_search.h).
//
// Before each turn the actor asks PgoActor for its state, and continues only if PgoActor is idle: nobody waits for a
// solve because of a match. Between the turns, the actor handles other messages. Spawn it under actor_name::kRegister
// with Placement::kBackground.
//
// Deterministic: the same sequence of records, solves and terms gives the same matches.
//
// Memory: the packed maps (KnownMaps::Options::bytes_max), and 64 fields of about 1 MB (5 MB for maps of 40 m) during a
// pass. Each pair matched in this term takes about 150 bytes. While rovers are not placed, StartSearch adds its own.
//
// Error codes in replies: kRefused if this agent does not lead; kFull if more than requests_max requests wait; kRefused
// if the team file disables registration; any error of StorageActor.
#pragma once

#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "actors/registration/field_cache.h"
#include "actors/registration/known_maps.h"
#include "actors/registration/match_pass.h"
#include "actors/registration/match_plan.h"
#include "actors/registration/match_report.h"
#include "actors/registration/place_check.h"
#include "actors/registration/start_search.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/derived_reader.h"
#include "runtime/quiet_timer.h"
#include "runtime/rate_limited_log.h"
#include "runtime/record_writer.h"

namespace moondb {

class RegisterActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    // Complete, validated configuration of the team. Used fields: registration, map.footprint_m, and the kinds of
    // agents.
    proto::TeamConfig team;
    // A pass starts once no record that matters has been stored for this long, and at the latest quiet_wait_max after
    // the first one.
    Duration quiet = std::chrono::seconds(2);
    Duration quiet_wait_max = std::chrono::seconds(30);
    Duration pass_retry = std::chrono::seconds(30);         // After a pass that storage stopped.
    Duration retry_delay = std::chrono::milliseconds(500);  // While PgoActor is busy.
    Duration storage_timeout = std::chrono::seconds(30);
    std::size_t fields_max = 64;
    std::size_t turn_pairs_max = 64;       // Pairs of one turn, in addition to the budget of the team file.
    std::size_t insert_records_max = 128;  // Matches stored together.
    std::size_t requests_max = 64;         // Waiting requests.
  };

  explicit RegisterActor(Options options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  enum class Phase {
    kIdle,
    kReading,  // Reads records from storage.
    kAsking,   // Asks PgoActor, or waits until it is idle.
    kWriting,  // Stores matches.
  };

  struct Waiting {
    Address sender;
    std::uint64_t request_id = 0;
    std::uint64_t timer = 0;  // Value of the timer that ends the wait.
    bool is_covered = false;  // True if a pass has started since the request arrived.
  };

  bool Leads() const { return roles_ && roles_->leader() == options_.self; }
  void OnRoles(Context& context, const proto::RoleAssignment& roles);
  void OnRecordsStored(Context& context, const proto::RecordsStored& stored);
  void OnTimer(Context& context, const proto::Timer& timer);
  void OnRequest(Context& context, const proto::Message& message);
  void OnRead(Context& context);
  void OnGraphStats(Context& context, const proto::GraphStatsReply& stats);
  void OnWritten(Context& context);

  void AwaitQuiet(Context& context);
  void StartPass(Context& context);
  void StoreMatches(Context& context);
  void RequestPgo(Context& context);
  void RequestAgainLater(Context& context);
  void PlanPass(const proto::GraphStatsReply& stats);
  void MatchSome(Context& context);
  void PlanStarts(const std::vector<RegisteredMap>& maps);
  void PlanChecks();
  void Match(Context& context, const PlannedMatch& planned);
  std::size_t left_count() const { return pass_.left_count() + starts_.left_count() + check_.left_count(); }
  void AddRecord(Context& context, const PlannedMatch& planned, const MatchResult& result);
  bool IsNews(const LoopClosure& closure) const;
  void Finish(Context& context);
  void StopPass(Context& context, const std::string& reason);
  void Reset();
  std::optional<Error> WhyNot() const;
  proto::RegistrationReply State() const;
  void Answer(Context& context, const Waiting& waiting, proto::RegistrationReply reply);
  void AnswerAll(Context& context, const std::optional<Error>& error = std::nullopt);

  const Options options_;
  std::optional<proto::RoleAssignment> roles_;
  KnownMaps known_;
  MatchPlan plan_;
  StartSearch starts_;
  PlaceCheck check_;
  std::set<AgentId> placed_;    // Rovers whose poses are in the frame `map`.
  std::set<AgentId> by_start_;  // Placed rovers that only their start ties to it.
  FieldCache fields_;
  DerivedReader reader_;  // Reads records into known_.
  RecordWriter writer_;
  QuietTimer quiet_;  // A pass starts after a pause in arriving records.

  Phase phase_ = Phase::kIdle;
  bool has_news_ = true;  // True if maps, measurements or quarantines were stored since the last pass.
  int passes_since_news_ = 0;
  std::uint64_t request_id_ = 0;  // Id of the request that PgoActor has not answered yet.
  MatchPass pass_;
  std::vector<proto::Record> records_;  // Matches that storage has not accepted yet.
  std::uint64_t run_ = 0;
  MatchReport report_;
  std::uint64_t wait_count_ = 0;
  std::vector<Waiting> waiting_;
  RateLimitedLog trouble_log_;
};

}  // namespace moondb
