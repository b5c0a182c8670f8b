// MergeActor: keeps the merged map of all that this agent holds (paper, Section 5) and answers questions about it: the
// map itself (MergeRequest), why a cell is what it is, which maps still have a say, what changed since a version.
//
// When asked, it reads the records that StorageActor got since (nodes, optimized poses, local traversability maps,
// quarantines), page by page, into a MapCollection, and brings a Merger up to date on its own thread: spawn it with
// kOwnThread. Maps whose node is unknown wait for it. A question is answered by reads that began after it came, so its
// sender sees what it saw stored. After a restart everything is read anew: state comes from storage, never from memory.
//
// A MergeRequest with `agents` takes maps of these origins and the footprints of their nodes only. It, and one for raw
// poses, is merged from nothing, beside the merged map of everything, of which only what changed is merged again.
//
// A MapTilesRequest with wait_s is a subscription: where nothing has changed it waits, at most so long, and is looked
// at again when StorageActor publishes that records were stored, once in look_period at most.
//
// RetentionActor asks for the maps that win no cell any more (OccludedMapsRequest); an error of it is a ControlReply.
// Once StorageActor publishes that records were pruned, everything is read anew for the next question.
//
// Errors in replies: kFull (more than requests_max wait; a bound of Merger or of the reply's size),
// kUnavailable (no storage; GL is forced and has no driver; the system stops), kTimedOut (storage is silent), kInvalid
// (the team file's map does not fit CheckGrid), and StorageActor's own.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "actors/merge/map_collection.h"
#include "actors/merge/merger.h"
#include "model/record_authority.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/rate_limited_log.h"
#include "runtime/record_reader.h"

namespace moondb {

class MergeActor final : public Actor {
 public:
  struct Options {
    AgentId self = 0;
    proto::TeamConfig team;  // Complete and checked: map.resolution_m, map.footprint_m, kinds of agents.
    MergeBackend backend = MergeBackend::kAuto;
    int merge_threads = 1;  // How many merge at once on the CPU.
    // Called with who merges, "cpu" or "gl", at the start and when a driver is lost or comes back; on the actor's
    // thread.
    std::function<void(const std::string& backend)> on_backend = {};
    std::size_t maps_max = MapCollection::Options().maps_max;  // Maps in one merge.
    std::size_t requests_max = 64;                             // Waiting, subscriptions too.
    Duration look_period = std::chrono::seconds(1);
    Duration storage_timeout = std::chrono::seconds(30);
    std::uint32_t page_records_max = 512;
    std::uint32_t page_content_bytes_max = 4 * 1024 * 1024;
    std::size_t reply_bytes_max = 24 * 1024 * 1024;  // Of the compressed cells; below the transport's own bound.
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
    MonotonicTime answer_by;  // A subscription waits until then.
    bool has_timer = false;   // For it.
  };

  void OnQuestion(Context& context, const proto::Message& message);
  void OnRead(Context& context);
  void LookSoon(Context& context);  // At the subscriptions.
  void OnRecordsStored(Context& context, const proto::RecordsStored& stored);
  void OnTimer(Context& context, const proto::Timer& timer);

  void StartReading(Context& context);
  void FailAll(Context& context, const Error& error);
  void AnswerCovered(Context& context);
  // Asks storage for all subscriptions again.
  void LookAgain(Context& context);
  void AnswerExpired(Context& context);
  Result<void> TakeOrLeaveOut(const proto::StoredRecord& stored);
  Result<void> TakeRecord(const proto::StoredRecord& stored);
  // Brings the merged map of everything up to date.
  Result<void> Update(Context& context, const MapCollection::Selected& everything);
  Result<proto::MergeReply> Merge(Context& context, const proto::MergeRequest& request);
  Result<void> StartMerger();
  void ReportBackend(Context& context);
  Result<void> RunMerger(Context& context, const MapCollection::Selected& selected, Merger& merger);
  // Nothing where a subscription goes on.
  std::optional<proto::Message> AnswerTo(Context& context, const Waiting& waiting);
  std::optional<proto::Message> AnswerTiles(Context& context, const Waiting& waiting);
  void Answer(Context& context, const Waiting& waiting, proto::Message reply);

  const Options options_;
  MapCollection collection_;
  RecordAuthority authority_;
  RecordReader reader_;                     // Into collection_.
  std::shared_ptr<GatherBackend> backend_;  // Null: GL is forced and absent, or the team's map does not fit.
  Error start_error_;                       // Why.
  std::string backend_description_;         // As it was reported last.
  std::unique_ptr<Merger> merger_;          // Of everything. Null as backend_.
  bool is_current_ = false;                 // It has all that is in collection_.
  bool is_outdated_ = false;                // collection_ may have records that are gone: it is to be read anew.
  std::size_t unusable_map_count_ = 0;      // Of records: cells too fine for the grid.
  std::size_t unplaced_map_count_ = 0;      // Maps and footprints that merger_ did not take the last time.
  std::uint64_t merger_id_ = 0;             // Random: versions of an earlier life mean nothing.
  RateLimitedLog refused_log_;
  RateLimitedLog dropped_log_;
  std::deque<Waiting> waiting_;
  std::deque<Waiting> subscribed_;
  bool is_look_due_ = false;       // A timer for it runs.
  std::size_t covered_count_ = 0;  // The first of `waiting_`: the read in progress began after they came.
};

}  // namespace moondb
