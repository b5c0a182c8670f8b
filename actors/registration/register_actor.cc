#include "actors/registration/register_actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "model/agent_name.h"
#include "model/control_request.h"
#include "proto/types.pb.h"
#include "runtime/team/role_signature.h"

namespace moondb {
namespace {

enum TimerKind : std::uint32_t { kQuiet = 1, kTimeout = 2, kAskPgo = 3, kWaitEnd = 4 };

constexpr double kMaskMargin_m = 0.3;  // Added to a rover's body, because its pose is uncertain.
constexpr int kPassesMax = 2;
constexpr double kSameSigmas = 1.0 / 3;

RecordReader::Options ReaderOptions(const RegisterActor::Options& options) {
  RecordReader::Options reader;
  reader.data_types = {proto::POSE_GRAPH_NODE,          proto::OPTIMIZED_POSE, proto::MAP_MATCH,
                       proto::LOCAL_TRAVERSABILITY_MAP, proto::MAP_QUARANTINE, proto::ROLE_ASSIGNMENT};
  reader.answer_timeout = options.storage_timeout;
  return reader;
}

KnownMaps::Options KnownOptions(const proto::TeamConfig& team) {
  KnownMaps::Options options;
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.kind() == proto::AGENT_KIND_ROVER) options.rovers.insert(agent.id());
  }
  if (team.map().footprint_m_size() == 2) {
    options.body_radius_m = std::hypot(team.map().footprint_m(0), team.map().footprint_m(1)) / 2 + kMaskMargin_m;
  }
  return options;
}

MatchPlan::Options PlanOptions(const proto::TeamConfig& team) {
  MatchPlan::Options options;
  options.wide.side_m = team.registration().window_m();
  return options;
}

// Returns whether the rover's poses are in the frame `map`, so that they can be compared with other rovers' poses.
bool IsPlaced(const proto::RoverSolution& rover) {
  return rover.anchoring() == proto::ANCHORING_ANCHORED || rover.anchoring() == proto::ANCHORING_NO_RANGES ||
         rover.anchoring() == proto::ANCHORING_AMBIGUOUS;
}

}  // namespace

RegisterActor::RegisterActor(Options options)
    : options_(std::move(options)),
      authority_(RoleChainOptions(options_.team)),
      known_(KnownOptions(options_.team)),
      plan_(PlanOptions(options_.team)),
      reader_(ReaderOptions(options_),
              [this](Context&, const proto::StoredRecord& stored) { return TakeRecord(stored); }) {}

void RegisterActor::OnStart(Context& context) {
  request_id_ = context.rng()() >> 1;
  context.Watch(Topic::kRoles);
  context.Watch(Topic::kStored);
  context.Monitor({options_.self, actor_name::kPgo});
}

// Accepts messages only from actors of this agent. Requests of clients arrive through the gateway.
void RegisterActor::OnMessage(Context& context, const proto::Message& message) {
  if (context.sender().agent != options_.self) return;
  if (reader_.OnMessage(context, message)) return OnRead(context);
  const bool is_answer = message.request_id() == request_id_;
  switch (message.body_case()) {
    case proto::Message::kRolesChanged:
      return OnRoles(context, message.roles_changed().roles());
    case proto::Message::kRecordsStored:
      if (context.sender().actor == actor_name::kStorage) OnRecordsStored(context, message.records_stored());
      return;
    case proto::Message::kDown:
      // A restarted PgoActor does not know the question.
      if (phase_ == Phase::kAsking && message.down().actor() == actor_name::kPgo) AskAgainLater(context);
      return;
    case proto::Message::kRegistrationRequest:
      return OnRequest(context, message);
    case proto::Message::kGraphStatsReply:
      if (phase_ == Phase::kAsking && is_answer) OnGraphStats(context, message.graph_stats_reply());
      return;
    case proto::Message::kInsertReply:
      if (phase_ == Phase::kWriting && is_answer) OnInsertReply(context, message.insert_reply());
      return;
    case proto::Message::kTimer:
      return OnTimer(context, message.timer());
    default:
      return;
  }
}

void RegisterActor::OnTimer(Context& context, const proto::Timer& timer) {
  switch (timer.kind()) {
    case kQuiet: {
      const Duration left = newest_stored_ + options_.quiet - context.now();
      if (left > Duration::zero()) return (void)context.AfterTimer(left, kQuiet);
      is_quiet_awaited_ = false;
      if (phase_ == Phase::kIdle) StartPass(context);
      return;
    }
    case kTimeout:
      if (timer.value() == request_id_ && phase_ == Phase::kWriting) Abandon(context, "storage does not answer");
      return;
    case kAskPgo:
      if (timer.value() == request_id_ && phase_ == Phase::kAsking) AskPgo(context);
      return;
    case kWaitEnd: {
      const auto waiting = std::ranges::find(waiting_, timer.value(), &Waiting::timer);
      if (waiting == waiting_.end()) return;
      Answer(context, *waiting, State());
      waiting_.erase(waiting);
      return;
    }
  }
}

void RegisterActor::OnRoles(Context& context, const proto::RoleAssignment& roles) {
  const bool is_new_term = !roles_ || OrderOf(roles_->term()) != OrderOf(roles.term());
  roles_ = roles;
  if (!is_new_term) return;
  reader_.Stop(context);
  Reset();
  if (const std::optional<Error> error = WhyNot()) return AnswerAll(context, error);
  AwaitQuiet(context);
}

// Forgets everything. Other agents than the leader hold no maps here.
void RegisterActor::Reset() {
  phase_ = Phase::kIdle;
  known_ = KnownMaps(KnownOptions(options_.team));
  plan_.Clear();
  starts_.Clear();
  is_outdated_ = true;
  has_news_ = true;
  passes_since_news_ = 0;
  is_planned_ = false;
  pairs_.clear();
  records_.clear();
  fields_.clear();
  registered_count_ = pass_count_ = stored_count_ = 0;
  counts_.clear();
  spent_ = {};
  text_.clear();
}

std::optional<Error> RegisterActor::WhyNot() const {
  if (!options_.team.registration().enabled()) {
    return Error{ErrorCode::kRefused, "the team file disables registration (registration: {enabled: false})", {}};
  }
  if (Leads()) return std::nullopt;
  if (!roles_ || roles_->leader() == 0) {
    return Error{ErrorCode::kRefused, "the leader matches maps, and this agent knows of none", {}};
  }
  const std::string name = AgentName(options_.team, roles_->leader());
  return Error{ErrorCode::kRefused, "the leader matches maps, and " + name + " leads; ask there", {}};
}

void RegisterActor::OnRecordsStored(Context& context, const proto::RecordsStored& stored) {
  is_outdated_ = is_outdated_ || stored.is_pruned();
  bool matters = stored.is_pruned();
  for (const std::uint32_t type : stored.data_types()) {
    const bool is_news = type == proto::POSE_GRAPH_NODE || type == proto::POSE_GRAPH_EDGE ||
                         type == proto::POSE_PRIOR || type == proto::LOCAL_TRAVERSABILITY_MAP ||
                         type == proto::MAP_QUARANTINE;
    has_news_ = has_news_ || is_news;
    matters = matters || is_news || type == proto::OPTIMIZED_POSE || type == proto::EDGE_VERDICT;
  }
  if (matters) AwaitQuiet(context);
}

void RegisterActor::AwaitQuiet(Context& context) {
  if (WhyNot()) return;
  newest_stored_ = context.now();
  if (std::exchange(is_quiet_awaited_, true)) return;
  (void)context.AfterTimer(options_.quiet, kQuiet);
}

void RegisterActor::StartPass(Context& context) {
  if (WhyNot()) return;
  if (std::exchange(has_news_, false)) passes_since_news_ = 0;
  for (Waiting& waiting : waiting_) waiting.is_covered = true;
  is_planned_ = false;
  pairs_.clear();
  records_.clear();
  matched_count_ = written_count_ = 0;
  phase_ = Phase::kReading;
  StartReading(context);
}

void RegisterActor::StartReading(Context& context) {
  if (std::exchange(is_outdated_, false)) {
    known_ = KnownMaps(KnownOptions(options_.team));
    authority_.Restart();
    reader_.ReadAgain(context);
  } else {
    reader_.Read(context);
  }
  OnRead(context);
}

Result<void> RegisterActor::TakeRecord(const proto::StoredRecord& stored) {
  proto::Record record;
  const RecordKey key = FromProto(stored.key());
  // The record validator has checked every stored record. A record of a later version that this version cannot parse is
  // skipped.
  if (record.ParseFromString(stored.content()) && authority_.Counts(key, record)) (void)known_.Add(key, record);
  return {};
}

void RegisterActor::OnRead(Context& context) {
  if (phase_ != Phase::kReading || reader_.is_reading()) return;
  if (!reader_.result()) return Abandon(context, ToString(reader_.result().error()));
  if (authority_.TakeOutdated()) {
    is_outdated_ = true;
    return StartReading(context);
  }
  if (std::optional<proto::Message> report = authority_.TakeReport(known_.CountLeftOut())) {
    // The report is only informative. Ignore a failed send.
    (void)context.Send({options_.self, actor_name::kStorage}, *std::move(report));
  }
  AskPgo(context);
}

void RegisterActor::AskPgo(Context& context) {
  phase_ = Phase::kAsking;
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(++request_id_);
  message.mutable_graph_stats_request();
  if (context.Send({options_.self, actor_name::kPgo}, std::move(message)) != SendResult::kAccepted) {
    AskAgainLater(context);
  }
}

void RegisterActor::AskAgainLater(Context& context) {
  (void)context.AfterTimer(options_.retry_delay, kAskPgo, request_id_);
}

void RegisterActor::OnGraphStats(Context& context, const proto::GraphStatsReply& stats) {
  if (stats.is_solving()) return AskAgainLater(context);
  if (!is_planned_) {
    PlanPass(stats);
    run_ = 1 + known_.LastRun(roles_->term());
  }
  MatchSome(context);
}

void RegisterActor::PlanPass(const proto::GraphStatsReply& stats) {
  is_planned_ = true;
  const std::vector<RegisteredMap> maps = known_.FindRegistered();
  registered_count_ = maps.size();
  if (stats.solve_count() == 0) {
    text_ = "the leader has not solved the pose graph yet";
    return;
  }
  text_.clear();
  if (passes_since_news_++ >= kPassesMax) return;
  std::set<AgentId> placed;
  for (const proto::RoverSolution& rover : stats.last_solve().rovers()) {
    if (IsPlaced(rover)) placed.insert(rover.agent_id());
  }
  pairs_ = plan_.StartPass(
      maps, [&placed](AgentId a, AgentId b) { return a == b || (placed.contains(a) && placed.contains(b)); });
  start_begin_ = pairs_.size();
  for (PlannedMatch& planned : starts_.Plan(maps, placed)) pairs_.push_back(std::move(planned));
  pass_count_ += pairs_.empty() ? 0 : 1;
}

void RegisterActor::MatchSome(Context& context) {
  const MonotonicTime begin = context.now();
  const auto budget = std::chrono::milliseconds(options_.team.registration().budget_ms());
  for (std::size_t i = 0; i < options_.turn_pairs_max && matched_count_ < pairs_.size(); ++i) {
    if (i > 0 && context.now() - begin >= budget) break;
    if (context.stop_requested()) return;
    const std::size_t index = matched_count_++;
    Match(context, pairs_[index], index >= start_begin_);
  }
  spent_ += context.now() - begin;
  if (matched_count_ < pairs_.size()) return AskPgo(context);
  phase_ = Phase::kWriting;
  WriteNextChunk(context);
}

std::shared_ptr<const HazardField> RegisterActor::FieldOf(const RegisteredMap& map) {
  const auto found = std::ranges::find(fields_, map.key, [](const auto& field) { return field.first; });
  if (found != fields_.end()) {
    fields_.splice(fields_.begin(), fields_, found);
    return found->second;
  }
  // A registered map is held until the next reading.
  const std::optional<TraversabilityMap> cells = known_.FindMap(map.key);
  if (!cells) return nullptr;
  fields_.emplace_front(map.key, std::make_shared<const HazardField>(*cells, known_.FindRovers(map)));
  if (fields_.size() > options_.fields_max) fields_.pop_back();
  return fields_.front().second;
}

void RegisterActor::Match(Context& context, const PlannedMatch& planned, bool is_start) {
  const AgentId rover = planned.second.node.agent;
  if (is_start && !starts_.FindAgreeing(rover).empty()) return;  // The start of the rover is known.
  if (!is_start && !plan_.HasWorkFor(planned)) return;
  const std::shared_ptr<const HazardField> first = FieldOf(planned.first);
  const std::shared_ptr<const HazardField> second = FieldOf(planned.second);
  if (!first || !second) return;
  const MatchResult result = MatchMaps(*first, *second, planned.expected, planned.window);
  ++counts_[result.verdict];
  if (!is_start) {
    plan_.Note(planned, result);
    if (result.verdict == MatchVerdict::kAccepted) AddRecord(context, planned, result);
    return;
  }
  starts_.Note(planned, result);
  for (const auto& [agreeing, its_result] : starts_.FindAgreeing(rover)) AddRecord(context, agreeing, its_result);
}

void RegisterActor::AddRecord(Context& context, const PlannedMatch& planned, const MatchResult& result) {
  const LoopClosure closure = ToLoopClosure(planned.first, planned.second, result);
  if (!IsNews(closure)) return;
  proto::Record& record = records_.emplace_back();
  record.set_timestamp_ns(context.utc_now_ns());
  proto::MapMatch& match = *record.mutable_map_match();
  *match.mutable_from() = ToProto(closure.from);
  *match.mutable_to() = ToProto(closure.to);
  *match.mutable_relative_pose()->mutable_from_from_to() = ToProto(closure.from_from_to);
  AddUpperTriangle(closure.covariance, *match.mutable_relative_pose()->mutable_covariance());
  *match.mutable_from_map() = ToProto(planned.first.key);
  *match.mutable_to_map() = ToProto(planned.second.key);
  match.set_from_timestamp_ns(planned.first.timestamp_ns);
  match.set_to_timestamp_ns(planned.second.timestamp_ns);
  match.set_overlap(result.overlap);
  match.set_matched(result.matched);
  match.set_second_best(std::clamp(result.second_best, 0.0, 1.0));
  *match.mutable_term() = roles_->term();
  match.set_run(run_);
}

// Returns false if the stored match of the same nodes differs by less than a third of sigma.
bool RegisterActor::IsNews(const LoopClosure& closure) const {
  const KnownMaps::Match* const stored = known_.FindMatch(closure.from, closure.to);
  if (stored == nullptr) return true;
  const Pose moved = stored->closure.from_from_to.Inverse() * closure.from_from_to;
  const double sigma_m = std::sqrt(closure.covariance.topLeftCorner<2, 2>().trace() / 2);
  const double sigma_rad = std::sqrt(closure.covariance(5, 5));
  return moved.position_m.norm() > kSameSigmas * sigma_m || std::abs(moved.Yaw()) > kSameSigmas * sigma_rad;
}

void RegisterActor::WriteNextChunk(Context& context) {
  const std::size_t count = std::min(records_.size() - written_count_, options_.insert_records_max);
  if (count == 0) return Finish(context);
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(++request_id_);
  for (std::size_t i = 0; i < count; ++i) {
    *message.mutable_insert_request()->add_records() = std::move(records_[written_count_ + i]);
  }
  written_count_ += count;
  const SendResult result = context.Send({options_.self, actor_name::kStorage}, std::move(message));
  if (result != SendResult::kAccepted) {
    return Abandon(context, std::string("storage cannot be asked: ") + ToString(result));
  }
  timeout_ = context.AfterTimer(options_.storage_timeout, kTimeout, request_id_);
}

void RegisterActor::OnInsertReply(Context& context, const proto::InsertReply& reply) {
  context.Cancel(timeout_);
  if (IsError(reply.error())) return Abandon(context, ToString(FromProto(reply.error())));
  stored_count_ += static_cast<std::size_t>(reply.keys_size());
  WriteNextChunk(context);
}

void RegisterActor::Finish(Context& context) {
  phase_ = Phase::kIdle;
  fields_.clear();
  AnswerAll(context);
}

// Ends the pass without storing its remaining matches. The next pass finds them again.
void RegisterActor::Abandon(Context& context, const std::string& reason) {
  trouble_log_.Warn(ToString(context.self()) + ": the matching of maps was given up: " + reason);
  text_ = reason;
  plan_.Clear();
  starts_.Clear();
  has_news_ = true;
  reader_.Stop(context);
  Finish(context);
}

void RegisterActor::OnRequest(Context& context, const proto::Message& message) {
  Waiting waiting{context.sender(), message.request_id(), ++wait_count_};
  proto::RegistrationReply refusal;
  if (const std::optional<Error> error = WhyNot()) {
    *refusal.mutable_error() = ToProto(*error);
    return Answer(context, waiting, refusal);
  }
  const Duration wait = BoundedWait(message.registration_request().wait_s(), kRegistrationWaitMax_s);
  if (wait <= Duration::zero()) return Answer(context, waiting, State());
  if (waiting_.size() >= options_.requests_max) {
    *refusal.mutable_error() = ToProto(Error{ErrorCode::kFull, "too many wait for matches; try again later", {}});
    return Answer(context, waiting, refusal);
  }
  (void)context.AfterTimer(wait, kWaitEnd, waiting.timer);
  waiting_.push_back(std::move(waiting));
  if (phase_ == Phase::kIdle) StartPass(context);
}

proto::RegistrationReply RegisterActor::State() const {
  proto::RegistrationReply reply;
  reply.set_is_done(phase_ == Phase::kIdle && text_.empty());
  reply.set_map_count(static_cast<double>(registered_count_));
  reply.set_other_map_count(static_cast<double>(known_.map_count() - registered_count_));
  reply.set_left_count(static_cast<double>(pairs_.size() - matched_count_));
  reply.set_pass_count(static_cast<double>(pass_count_));
  reply.set_stored_count(static_cast<double>(stored_count_));
  for (const auto& [verdict, count] : counts_) {
    proto::RegistrationCount& out = *reply.add_counts();
    out.set_verdict(ToString(verdict));
    out.set_count(static_cast<double>(count));
  }
  reply.set_seconds(std::chrono::duration<double>(spent_).count());
  reply.set_text(text_);
  for (const auto& [agents, count] : plan_.CountLeftOut()) {
    proto::LeftOutPairs& out = *reply.add_left_out();
    out.set_agent_id(agents.first);
    out.set_other_agent_id(agents.second);
    out.set_count(static_cast<double>(count));
  }
  return reply;
}

void RegisterActor::AnswerAll(Context& context, const std::optional<Error>& error) {
  proto::RegistrationReply reply = error ? proto::RegistrationReply() : State();
  if (error) *reply.mutable_error() = ToProto(*error);
  std::vector<Waiting> left;
  for (Waiting& waiting : std::exchange(waiting_, {})) {
    if (error || waiting.is_covered) {
      Answer(context, waiting, reply);
    } else {
      left.push_back(std::move(waiting));
    }
  }
  waiting_ = std::move(left);
  if (!waiting_.empty()) StartPass(context);
}

void RegisterActor::Answer(Context& context, const Waiting& waiting, proto::RegistrationReply reply) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(waiting.request_id);
  *message.mutable_registration_reply() = std::move(reply);
  // Ignore a failed send: the requester may have disconnected.
  (void)context.Send(waiting.sender, std::move(message));
}

}  // namespace moondb
