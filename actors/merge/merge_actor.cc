#include "actors/merge/merge_actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "actors/merge/cleared_hazards.h"
#include "actors/merge/map_answers.h"
#include "model/control_message.h"
#include "model/geometry.h"
#include "proto/types.pb.h"
#include "runtime/team/role_signature.h"

namespace moondb {
namespace {

enum TimerKind : std::uint32_t { kLook = 1, kSubscriptionEnd = 2 };

RecordReader::Options ReaderOptions(const MergeActor::Options& options) {
  RecordReader::Options reader;
  reader.data_types = {proto::POSE_GRAPH_NODE, proto::OPTIMIZED_POSE, proto::LOCAL_TRAVERSABILITY_MAP,
                       proto::MAP_QUARANTINE, proto::ROLE_ASSIGNMENT};
  reader.page_records_max = options.page_records_max;
  reader.page_bytes_max = options.page_content_bytes_max;
  reader.answer_timeout = options.storage_timeout;
  return reader;
}

MapCollection::Options CollectionOptions(const MergeActor::Options& of_actor) {
  MapCollection::Options options = MapCollection::OptionsOf(of_actor.team, of_actor.self);
  options.maps_max = of_actor.maps_max;
  return options;
}

MapCollection::Selection SelectionOf(const proto::MergeRequest& request) {
  MapCollection::Selection selection;
  selection.use_raw_poses = request.use_raw_poses();
  selection.agents.insert(request.agents().begin(), request.agents().end());
  return selection;
}

// Returns a reply with the error, in the reply type that belongs to the request `question`.
proto::Message ErrorReply(const proto::Message& question, const Error& error) {
  proto::Message reply;
  switch (question.body_case()) {
    case proto::Message::kMapWhyRequest:
      *reply.mutable_map_why_reply()->mutable_error() = ToProto(error);
      break;
    case proto::Message::kMapStatsRequest:
      *reply.mutable_map_stats_reply()->mutable_error() = ToProto(error);
      break;
    case proto::Message::kMapTilesRequest:
      *reply.mutable_map_tiles_reply()->mutable_error() = ToProto(error);
      break;
    case proto::Message::kOccludedMapsRequest:
      return ErrorMessage(error);
    default:
      *reply.mutable_merge_reply()->mutable_error() = ToProto(error);
  }
  return reply;
}

}  // namespace

MergeActor::MergeActor(Options options)
    : options_(std::move(options)),
      collection_(CollectionOptions(options_)),
      reader_(
          RoleChainOptions(options_.team), ReaderOptions(options_), [this] { Forget(); },
          [this](const RecordKey& key, const proto::Record& record) { Take(key, record); }) {}

MergeActor::~MergeActor() = default;

// StartMerger runs here and not in the constructor, because a GL context is best created on the thread that uses it.
void MergeActor::OnStart(Context& context) {
  merger_id_ = context.rng()() | 1;
  context.Watch(Topic::kStored);
  if (Result<void> started = StartMerger(); !started) {
    start_error_ = started.error();
    spdlog::error("{}: {}", ToString(context.self()), ToString(start_error_));
  } else {
    ReportBackend(context);
  }
}

Result<void> MergeActor::StartMerger() {
  const MergeGrid grid = CollectionOptions(options_).grid;
  if (Result<void> checked = CheckGrid(grid); !checked) return checked;
  Result<std::unique_ptr<GatherBackend>> backend = CreateGatherBackend(options_.backend, options_.merge_threads);
  if (!backend) return tl::unexpected(backend.error());
  backend_ = std::move(*backend);
  merger_ = std::make_unique<Merger>(grid, backend_);
  return {};
}

void MergeActor::OnMessage(Context& context, const proto::Message& message) {
  if (reader_.OnMessage(context, message)) return OnRead(context);
  switch (message.body_case()) {
    case proto::Message::kMergeRequest:
    case proto::Message::kMapWhyRequest:
    case proto::Message::kMapStatsRequest:
    case proto::Message::kMapTilesRequest:
    case proto::Message::kOccludedMapsRequest:
      // Ignore requests of other agents: nobody has checked them. The gateway checks the requests of clients.
      if (context.sender().agent == options_.self) OnQuestion(context, message);
      return;
    case proto::Message::kRecordsStored:
      if (context.sender() == Address{options_.self, actor_name::kStorage}) {
        OnRecordsStored(context, message.records_stored());
      }
      return;
    case proto::Message::kTimer:
      if (context.sender().agent == options_.self) OnTimer(context, message.timer());
      return;
    default:
      return;
  }
}

void MergeActor::OnQuestion(Context& context, const proto::Message& message) {
  Waiting waiting{context.sender(), message.request_id(), message, context.now()};
  if (waiting_.size() + subscribed_.size() >= options_.requests_max) {
    const std::string text =
        std::to_string(options_.requests_max) + " requests for the map wait already; try again later";
    return Answer(context, waiting, ErrorReply(message, {ErrorCode::kFull, text, {}}));
  }
  if (message.map_tiles_request().wait_s() > 0) {
    waiting.answer_by +=
        std::chrono::duration_cast<Duration>(std::chrono::duration<double>(message.map_tiles_request().wait_s()));
  }
  waiting_.push_back(std::move(waiting));
  if (!reader_.is_reading()) StartReading(context);
}

void MergeActor::StartReading(Context& context) {
  covered_count_ = waiting_.size();
  reader_.Read(context);
  OnRead(context);
}

void MergeActor::Forget() {
  collection_ = MapCollection(CollectionOptions(options_));
  unusable_map_count_ = 0;
  is_current_ = false;
}

void MergeActor::OnRead(Context& context) {
  if (reader_.is_reading()) return;
  if (!reader_.result()) return FailAll(context, reader_.result().error());
  ReportLeftOut(context);
  AnswerCovered(context);
  if (!waiting_.empty()) StartReading(context);
}

// Reports the records that the collection dropped, and those without room in the last merge of all records.
void MergeActor::ReportLeftOut(Context& context) {
  std::map<AgentId, std::uint64_t> counts = collection_.CountLeftOut();
  if (merger_ != nullptr) {
    for (const auto& [agent, count] : merger_->CountWithoutRoom()) counts[agent] += count;
  }
  reader_.Report(context, std::move(counts));
}

void MergeActor::OnTimer(Context& context, const proto::Timer& timer) {
  if (timer.kind() == kLook) {
    is_look_due_ = false;
    return EvaluateAgain(context);
  }
  if (timer.kind() == kSubscriptionEnd) AnswerExpired(context);
}

void MergeActor::OnRecordsStored(Context& context, const proto::RecordsStored& stored) {
  reader_.OnRecordsStored(stored);
  if (stored.is_pruned() || reader_.Reads(stored)) EvaluateSoon(context);
}

void MergeActor::EvaluateSoon(Context& context) {
  if (subscribed_.empty() || is_look_due_) return;
  is_look_due_ = true;
  (void)context.AfterTimer(options_.look_period, kLook);
}

void MergeActor::EvaluateAgain(Context& context) {
  if (subscribed_.empty()) return;
  for (Waiting& subscription : std::exchange(subscribed_, {})) waiting_.push_back(std::move(subscription));
  if (!reader_.is_reading()) StartReading(context);
}

void MergeActor::AnswerExpired(Context& context) {
  std::deque<Waiting> expired;
  std::deque<Waiting> left;
  for (Waiting& subscription : std::exchange(subscribed_, {})) {
    (subscription.answer_by <= context.now() ? expired : left).push_back(std::move(subscription));
  }
  subscribed_ = std::move(left);
  for (const Waiting& subscription : expired) {
    if (auto answer = AnswerTiles(context, subscription)) Answer(context, subscription, *std::move(answer));
  }
}

void MergeActor::FailAll(Context& context, const Error& error) {
  for (const Waiting& waiting : std::exchange(waiting_, {})) {
    Answer(context, waiting, ErrorReply(waiting.question, error));
  }
}

void MergeActor::Take(const RecordKey& key, const proto::Record& record) {
  if (Result<void> added = collection_.Add(key, record); !added) {
    if (record.has_local_traversability_map()) ++unusable_map_count_;
    // The record validator accepted the record, but the map cannot be merged (for example, its cells are too fine for
    // the grid).
    refused_log_.Warn("merge: excludes record " + ToString(key) + ": " + ToString(added.error()));
  }
  is_current_ = false;
}

void MergeActor::AnswerCovered(Context& context) {
  for (std::size_t i = 0; i < covered_count_ && !waiting_.empty(); ++i) {
    Waiting waiting = std::move(waiting_.front());
    waiting_.pop_front();
    if (auto answer = AnswerTo(context, waiting)) {
      Answer(context, waiting, *std::move(answer));
    } else {
      if (!std::exchange(waiting.has_timer, true)) {
        (void)context.AfterTimer(waiting.answer_by - context.now(), kSubscriptionEnd);
      }
      subscribed_.push_back(std::move(waiting));
    }
  }
}

std::optional<proto::Message> MergeActor::AnswerTo(Context& context, const Waiting& waiting) {
  const proto::Message& question = waiting.question;
  proto::Message answer;
  if (question.has_merge_request()) {
    Result<proto::MergeReply> reply = Merge(context, question.merge_request());
    if (!reply) return ErrorReply(question, reply.error());
    *answer.mutable_merge_reply() = *std::move(reply);
    return answer;
  }
  if (!is_current_) {
    const Result<void> updated = Update(context, collection_.Select({}));
    if (!updated) return ErrorReply(question, updated.error());
  }
  if (question.has_map_tiles_request()) return AnswerTiles(context, waiting);
  if (question.has_map_why_request()) {
    *answer.mutable_map_why_reply() = WhyOf(collection_, *merger_, question.map_why_request());
  } else if (question.has_occluded_maps_request()) {
    *answer.mutable_occluded_maps_reply() =
        OccludedMapsOf(collection_, *merger_, question.occluded_maps_request().records_max());
  } else {
    Result<proto::MapStatsReply> stats = Stats(context, question.map_stats_request());
    if (!stats) return ErrorReply(question, stats.error());
    *answer.mutable_map_stats_reply() = *std::move(stats);
  }
  return answer;
}

Result<proto::MapStatsReply> MergeActor::Stats(Context& context, const proto::MapStatsRequest& request) {
  proto::MapStatsReply stats = StatsOf(collection_, *merger_);
  stats.set_backend(backend_->description());
  stats.set_refused_map_count(static_cast<double>(unusable_map_count_ + refused_count_));
  if (!request.with_cleared()) return stats;
  const auto cleared =
      FindClearedHazards(collection_.Select({}), *merger_, backend_, [&context] { return context.stop_requested(); });
  if (!cleared) return tl::unexpected(cleared.error());
  AddCleared(*cleared, merger_->grid(), stats);
  return stats;
}

std::optional<proto::Message> MergeActor::AnswerTiles(Context& context, const Waiting& waiting) {
  const proto::MapTilesRequest& request = waiting.question.map_tiles_request();
  const std::uint64_t since_version = request.merger_id() == merger_id_ ? request.since_version() : 0;
  Result<proto::MapTilesReply> tiles = ChangedTiles(*merger_, since_version, request, options_.reply_bytes_max);
  if (!tiles) return ErrorReply(waiting.question, tiles.error());
  if (tiles->tiles().empty() && context.now() < waiting.answer_by) return std::nullopt;
  tiles->set_merger_id(merger_id_);
  tiles->set_frame_of(frame_of_);
  proto::Message answer;
  *answer.mutable_map_tiles_reply() = *std::move(tiles);
  return answer;
}

Result<void> MergeActor::Update(Context& context, const MapCollection::Selected& everything) {
  if (merger_ == nullptr) return tl::unexpected(start_error_);
  if (is_current_) return {};
  const std::uint64_t forgotten = merger_->forgotten();
  Result<void> merged = RunMerger(context, everything, *merger_);
  is_current_ = merged.has_value();
  const bool has_moved = std::exchange(frame_of_, everything.frame_of) != everything.frame_of;
  // A new id makes clients with older tiles fetch every tile again.
  if (merger_->forgotten() != forgotten || has_moved) merger_id_ = context.rng()() | 1;
  ReportLeftOut(context);
  return merged;
}

Result<proto::MergeReply> MergeActor::Merge(Context& context, const proto::MergeRequest& request) {
  if (merger_ == nullptr) return tl::unexpected(start_error_);
  const MonotonicTime start = context.now();
  const MapCollection::Selection selection = SelectionOf(request);
  const MapCollection::Selected selected = collection_.Select(selection);
  std::optional<Merger> own_merger;  // For a selection.
  if (!selection.is_everything()) own_merger.emplace(merger_->grid(), backend_);
  Merger& merger = own_merger ? *own_merger : *merger_;
  const Result<void> updated = own_merger ? RunMerger(context, selected, merger) : Update(context, selected);
  if (!updated) return tl::unexpected(updated.error());
  const Crop crop = merger.CropTo(options_.export_cells_max);
  const Result<MergedMap> merged = merger.ReadCells(crop.box);
  if (!merged) return tl::unexpected(merged.error());
  Result<std::string> cells = CompressCells(merged->grid, options_.reply_bytes_max);
  if (!cells) return tl::unexpected(cells.error());

  proto::MergeReply reply;
  reply.set_resolution_um(merged->resolution_um);
  reply.set_origin_cell_x(merged->origin_cell_x);
  reply.set_origin_cell_y(merged->origin_cell_y);
  reply.set_width_cells(static_cast<std::uint32_t>(merged->grid.width));
  reply.set_height_cells(static_cast<std::uint32_t>(merged->grid.height));
  reply.set_zstd_cells(*std::move(cells));
  reply.set_map_count(static_cast<double>(merger.map_count()));
  for (const AgentId agent : merger.FindMapOrigins()) reply.add_maps_of(agent);
  reply.set_frame_of(selected.frame_of);
  AddUnplaced(selected, *reply.mutable_unplaced());
  AddCut(selected, *reply.mutable_cut());
  reply.set_waiting_map_count(static_cast<double>(selected.waiting_maps.size()));
  reply.set_node_count(static_cast<double>(merger.footprint_count()));
  AddLeftOut(merger, crop, reply);
  AddFarNodes(selected.far_nodes, *reply.mutable_far_nodes());
  reply.set_far_node_count(static_cast<double>(selected.far_nodes.size()));
  reply.set_backend(backend_->name());
  reply.set_seconds(std::chrono::duration<double>(context.now() - start).count());
  return reply;
}

// Reports the name of the backend at the start, and when a GL driver is lost or recovers.
void MergeActor::ReportBackend(Context& context) {
  std::string description = backend_->description();
  if (description == backend_description_) return;
  backend_description_ = std::move(description);
  spdlog::info("{}: merges on {}", ToString(context.self()), backend_description_);
  if (options_.on_backend) options_.on_backend(backend_->name());
}

Result<void> MergeActor::RunMerger(Context& context, const MapCollection::Selected& selected, Merger& merger) {
  const std::vector<Error> refusals = merger.Assign(selected.maps, selected.footprints);
  if (&merger == merger_.get()) refused_count_ = refusals.size();
  for (const Error& refused : refusals) {
    refused_log_.Warn(ToString(context.self()) + ": excludes " + ToString(refused));
  }
  const Result<MergeSummary> merged = merger.Merge([&context] { return context.stop_requested(); });
  ReportBackend(context);
  if (!merged) return tl::unexpected(merged.error());
  return {};
}

void MergeActor::Answer(Context& context, const Waiting& waiting, proto::Message reply) {
  reply.set_request_id(waiting.request_id);
  if (context.Send(waiting.sender, std::move(reply)) == SendResult::kAccepted) return;
  dropped_log_.Warn(ToString(context.self()) + ": " + ToString(waiting.sender) + " is gone, so its answer is dropped");
}

}  // namespace moondb
