// MergeActor: maintains the merged map of all records of this agent (paper, Section 5) and answers requests about it.
// Requests ask for the map itself (MergeRequest), the sources of a cell's value, map statistics, changes since a
// version, or the fully occluded maps. Spawn the actor with kOwnThread.
//
// Before it answers, the actor reads the new records from StorageActor into a MapCollection and updates a Merger. A
// reply covers all records that were stored when the request was sent. A MergeRequest for some agents or for raw poses
// is merged from scratch; the merged map of all records is updated incrementally. After a restart, and after records
// were pruned, the actor reads all records again.
//
// A MapTilesRequest with wait_s is a subscription. If nothing has changed, the request waits for at most wait_s. When
// StorageActor publishes that records were stored, the subscriptions are evaluated again, at most once per look_period.
//
// Error codes in replies:
// - kFull: more than requests_max requests wait, or a limit of Merger or of the reply size is exceeded;
// - kUnavailable: storage is not running, GL is forced without a driver, or the system stops;
// - kTimedOut: storage does not answer;
// - kInvalid: the map configuration of the team file fails CheckGrid;
// - any error of StorageActor.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "actors/merge/map_collection.h"
#include "actors/merge/merger.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/derived_reader.h"
#include "runtime/rate_limited_log.h"

namespace moondb {

class MergeActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    // Complete, validated configuration of the team. Used fields: map.resolution_m, map.footprint_m, the kinds of
    // agents and their starts.
    proto::TeamConfig team;
    MergeBackend backend = MergeBackend::kAuto;
    int merge_threads = 1;  // Number of CPU threads that merge.
    // Called with the name of the backend in use, "cpu" or "gl", at the start and when a driver is lost or recovers.
    // Runs on the actor's thread.
    std::function<void(const std::string& backend)> on_backend = {};
    std::size_t maps_max = MapCollection::Options().maps_max;  // Maximum number of maps in one merge.
    // Maximum number of waiting requests, including subscriptions.
    std::size_t requests_max = 64;
    Duration look_period = std::chrono::milliseconds(500);
    Duration storage_timeout = std::chrono::seconds(30);
    std::uint32_t page_records_max = 512;
    std::uint32_t page_content_bytes_max = 4 * 1024 * 1024;
    // Maximum size of the compressed cells in a reply; below the transport's limit for a message.
    std::size_t reply_bytes_max = 24 * 1024 * 1024;
    // Maximum area of an export, which takes one byte a cell of memory. Equals the area of all pages, twice.
    std::int64_t export_cells_max = 128ll << 20;
  };

  explicit MergeActor(Options options);
  ~MergeActor() override;

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  struct Waiting {
    Address sender;
    std::uint64_t request_id = 0;
    proto::Message question;
    MonotonicTime answer_by;  // End time of a subscription.
    bool has_timer = false;   // True if a timer for answer_by is running.
  };

  void OnQuestion(Context& context, const proto::Message& message);
  void OnRead(Context& context);
  // Starts a timer that calls EvaluateAgain, if there are subscriptions and no such timer is running.
  void EvaluateSoon(Context& context);
  void OnRecordsStored(Context& context, const proto::RecordsStored& stored);
  void OnTimer(Context& context, const proto::Timer& timer);

  void StartReading(Context& context);
  void FailAll(Context& context, const Error& error);
  void AnswerCovered(Context& context);
  // Schedules all subscriptions for another evaluation, which follows a read of the new records from storage. Starts
  // this read unless a read is in progress.
  void EvaluateAgain(Context& context);
  void AnswerExpired(Context& context);
  void Take(const RecordKey& key, const proto::Record& record);
  void Forget();
  // Updates merger_ if it does not include all of collection_. `everything`: collection_.Select({}).
  Result<void> Update(Context& context, const MapCollection::Selected& everything);
  Result<proto::MergeReply> Merge(Context& context, const proto::MergeRequest& request);
  Result<void> StartMerger();
  void ReportBackend(Context& context);
  void ReportLeftOut(Context& context);
  Result<void> RunMerger(Context& context, const MapCollection::Selected& selected, Merger& merger);
  // Returns the reply; nullopt if the request is a subscription that continues to wait.
  std::optional<proto::Message> AnswerTo(Context& context, const Waiting& waiting);
  Result<proto::MapStatsReply> Stats(Context& context, const proto::MapStatsRequest& request);
  std::optional<proto::Message> AnswerTiles(Context& context, const Waiting& waiting);
  void Answer(Context& context, const Waiting& waiting, proto::Message reply);

  const Options options_;
  MapCollection collection_;
  DerivedReader reader_;  // Reads records into collection_.
  // Null if GL is forced but unavailable, or if the team's map configuration is invalid.
  std::shared_ptr<GatherBackend> backend_;
  Error start_error_;                   // Reason why backend_ is null.
  std::string backend_description_;     // Description of the backend that was reported last.
  std::unique_ptr<Merger> merger_;      // Merged map of all records. Null if backend_ is null.
  AgentId frame_of_ = 0;                // MapCollection::Selected::frame_of of merger_.
  bool is_current_ = false;             // True if merger_ includes all of collection_.
  std::size_t unusable_map_count_ = 0;  // Number of map records whose cells are too fine for the grid.
  std::size_t refused_count_ = 0;       // Number of maps and footprints that merger_ rejected in the last update.
  // Random id of merger_. Clients may compare two version numbers of the merged map only if the ids are equal. A new id
  // is chosen at each start, when merger_ drops empty pages, and when its frame changes.
  std::uint64_t merger_id_ = 0;
  RateLimitedLog refused_log_;
  RateLimitedLog dropped_log_;
  std::deque<Waiting> waiting_;
  std::deque<Waiting> subscribed_;
  bool is_look_due_ = false;  // True if a timer for evaluating the subscriptions is running.
  // Number of requests at the front of waiting_ that arrived before the read in progress started.
  std::size_t covered_count_ = 0;
};

}  // namespace moondb
