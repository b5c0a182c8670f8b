#include "actors/registration/register_actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "model/agent_name.h"
#include "model/control_request.h"
#include "model/data_types.h"
#include "proto/types.pb.h"
#include "runtime/team/role_signature.h"

namespace moondb {
namespace {

enum TimerKind : std::uint32_t { kQuiet = 1, kAskPgo = 2, kWaitEnd = 3, kRetry = 4 };

constexpr double kMaskMargin_m = 0.3;  // Added to a rover's body, because its pose is uncertain.
constexpr int kPassesMax = 2;
constexpr double kSameSigmas = 1.0 / 3;

RecordReader::Options ReaderOptions(const RegisterActor::Options& options) {
  RecordReader::Options reader;
  reader.data_types = {proto::POSE_GRAPH_NODE,          proto::POSE_GRAPH_EDGE, proto::OPTIMIZED_POSE, proto::MAP_MATCH,
                       proto::LOCAL_TRAVERSABILITY_MAP, proto::MAP_QUARANTINE,  proto::ROLE_ASSIGNMENT};
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

proto::SubmapNodes ToProto(const SubmapNodes& nodes) {
  proto::SubmapNodes message;
  message.set_first(nodes.first);
  message.set_middle(nodes.middle);
  message.set_last(nodes.last);
  return message;
}

proto::PlacedSubmaps ToProto(const PlacedSubmaps& place) {
  proto::PlacedSubmaps message;
  *message.mutable_submap() = ToProto(place.first);
  *message.mutable_other_submap() = ToProto(place.second);
  message.set_x_m(place.first_from_second.x_m);
  message.set_y_m(place.first_from_second.y_m);
  message.set_yaw_rad(place.first_from_second.yaw_rad);
  return message;
}

}  // namespace

RegisterActor::RegisterActor(Options options)
    : options_(std::move(options)),
      known_(KnownOptions(options_.team)),
      plan_(PlanOptions(options_.team)),
      fields_(options_.fields_max),
      reader_(
          RoleChainOptions(options_.team), ReaderOptions(options_),
          [this] { known_ = KnownMaps(KnownOptions(options_.team)); },
          [this](const RecordKey& key, const proto::Record& record) { (void)known_.Add(key, record); }),
      writer_({options_.insert_records_max, options_.storage_timeout}),
      quiet_({.kind = kQuiet, .quiet = options_.quiet, .wait_max = options_.quiet_wait_max}) {}

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
  if (writer_.OnMessage(context, message)) return OnWritten(context);
  const bool is_answer = message.request_id() == request_id_;
  switch (message.body_case()) {
    case proto::Message::kRolesChanged:
      return OnRoles(context, message.roles_changed().roles());
    case proto::Message::kRecordsStored:
      if (context.sender().actor == actor_name::kStorage) OnRecordsStored(context, message.records_stored());
      return;
    case proto::Message::kDown:
      // A restarted PgoActor does not know the question.
      if (phase_ == Phase::kAsking && message.down().actor() == actor_name::kPgo) RequestAgainLater(context);
      return;
    case proto::Message::kRegistrationRequest:
      return OnRequest(context, message);
    case proto::Message::kGraphStatsReply:
      if (phase_ == Phase::kAsking && is_answer) OnGraphStats(context, message.graph_stats_reply());
      return;
    case proto::Message::kTimer:
      return OnTimer(context, message.timer());
    default:
      return;
  }
}

void RegisterActor::OnTimer(Context& context, const proto::Timer& timer) {
  switch (timer.kind()) {
    case kQuiet:
      if (quiet_.OnTimer(context, phase_ != Phase::kIdle)) StartPass(context);
      return;
    case kRetry:
      // A higher id means that another pass has asked or stopped since.
      if (timer.value() == request_id_ && phase_ == Phase::kIdle) StartPass(context);
      return;
    case kAskPgo:
      if (timer.value() == request_id_ && phase_ == Phase::kAsking) RequestPgo(context);
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
  writer_.Stop(context);
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
  check_.Clear();
  reader_.ForgetAll();
  has_news_ = true;
  passes_since_news_ = 0;
  pass_.Clear();
  records_.clear();
  fields_.Clear();
  report_.Clear();
}

std::optional<Error> RegisterActor::WhyNot() const {
  if (!options_.team.registration().enabled()) {
    return Error{ErrorCode::kRefused, "the team file disables registration (registration: {enabled: false})", {}};
  }
  if (Leads()) return std::nullopt;
  if (!roles_ || roles_->leader() == 0) {
    return Error{ErrorCode::kRefused, "only the leader matches maps, and this agent knows no leader", {}};
  }
  const std::string name = AgentName(options_.team, roles_->leader());
  return Error{ErrorCode::kRefused, "the leader matches maps, and " + name + " leads; ask there", {}};
}

void RegisterActor::OnRecordsStored(Context& context, const proto::RecordsStored& stored) {
  reader_.OnRecordsStored(stored);
  bool matters = stored.is_pruned();
  for (const std::uint32_t type : stored.data_types()) {
    const DataTypeRow* row = FindDataType(static_cast<DataType>(type));
    const bool is_news = row != nullptr && row->is_news_for_matching;
    has_news_ = has_news_ || is_news;
    matters = matters || is_news || type == proto::OPTIMIZED_POSE || type == proto::EDGE_VERDICT;
  }
  if (matters) AwaitQuiet(context);
}

void RegisterActor::AwaitQuiet(Context& context) {
  if (!WhyNot()) quiet_.OnNews(context);
}

// Starts a pass, or continues the one that storage stopped.
void RegisterActor::StartPass(Context& context) {
  Check(phase_ == Phase::kIdle, "one pass runs at a time");
  if (WhyNot()) return;
  if (!records_.empty()) return StoreMatches(context);
  quiet_.Stop();  // The pass reads all records that have arrived.
  if (std::exchange(has_news_, false)) passes_since_news_ = 0;
  for (Waiting& waiting : waiting_) waiting.is_covered = true;
  pass_.Clear();
  phase_ = Phase::kReading;
  reader_.Read(context);
  OnRead(context);
}

void RegisterActor::OnRead(Context& context) {
  if (phase_ != Phase::kReading || reader_.is_reading()) return;
  if (!reader_.result()) {
    has_news_ = true;
    return StopPass(context, ToString(reader_.result().error()));
  }
  reader_.Report(context, known_.CountLeftOut());
  RequestPgo(context);
}

void RegisterActor::RequestPgo(Context& context) {
  phase_ = Phase::kAsking;
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(++request_id_);
  message.mutable_graph_stats_request();
  if (context.Send({options_.self, actor_name::kPgo}, std::move(message)) != SendResult::kAccepted) {
    RequestAgainLater(context);
  }
}

void RegisterActor::RequestAgainLater(Context& context) {
  (void)context.AfterTimer(options_.retry_delay, kAskPgo, request_id_);
}

void RegisterActor::OnGraphStats(Context& context, const proto::GraphStatsReply& stats) {
  if (stats.is_solving()) return RequestAgainLater(context);
  if (!pass_.is_begun()) {
    PlanPass(stats);
    run_ = 1 + known_.LastRun(roles_->term());
  }
  MatchSome(context);
}

void RegisterActor::PlanPass(const proto::GraphStatsReply& stats) {
  MatchReport::Inputs inputs;
  const std::vector<RegisteredMap> maps = known_.FindRegistered(&inputs.unposed_count);
  inputs.registered_count = maps.size();
  inputs.removed_map_match_count = known_.CountMatchesOfRemovedMaps();
  report_.SetTrouble(stats.solve_count() == 0 ? "the leader has not solved the pose graph yet" : "");
  std::vector<PlannedMatch> pairs;
  const bool is_due = stats.solve_count() > 0 && passes_since_news_++ < kPassesMax;
  if (is_due) {
    placed_.clear();
    by_start_.clear();
    for (const proto::RoverSolution& rover : stats.last_solve().rovers()) {
      if (IsPlaced(rover)) placed_.insert(rover.agent_id());
      if (rover.anchoring() == proto::ANCHORING_NO_RANGES) by_start_.insert(rover.agent_id());
    }
    pairs = plan_.StartPass(
        maps, [this](AgentId a, AgentId b) { return a == b || (placed_.contains(a) && placed_.contains(b)); });
    PlanStarts(maps);
  }
  pass_.Begin(std::move(pairs));
  if (is_due && pass_.left_count() == 0) PlanChecks();
  report_.OnPlanned(inputs, left_count() > 0);
}

// Searches for the relative pose of each two rovers whose frames nothing ties together.
void RegisterActor::PlanStarts(const std::vector<RegisteredMap>& maps) {
  std::set<AgentId> agents;
  for (const RegisteredMap& map : maps) agents.insert(map.node.agent);
  const std::set<StartSearch::AgentPair> matched = known_.FindMatched();
  std::vector<StartSearch::AgentPair> wanted, among_lost;
  for (const AgentId a : agents) {
    for (const AgentId b : agents) {
      if (a >= b || (placed_.contains(a) && placed_.contains(b))) continue;
      const bool is_one_placed = placed_.contains(a) || placed_.contains(b);
      if (!is_one_placed && matched.contains({a, b})) continue;
      (is_one_placed ? wanted : among_lost).emplace_back(a, b);
    }
  }
  wanted.insert(wanted.end(), among_lost.begin(), among_lost.end());
  std::map<AgentId, SearchedRover> rovers;
  for (const auto& [a, b] : wanted) {
    for (const AgentId agent : {a, b}) {
      if (rovers.contains(agent)) continue;
      auto rover = SearchedRover::Find(agent, maps, known_, placed_.contains(agent) ? placed_ : std::set<AgentId>());
      if (rover) rovers.emplace(agent, *std::move(rover));
    }
  }
  std::erase_if(wanted, [&](const StartSearch::AgentPair& pair) {
    return !rovers.contains(pair.first) || !rovers.contains(pair.second);
  });
  starts_.Begin(std::move(rovers), wanted);
}

// Checks the places of rovers that only their start places, if hardly any pair of maps has matched.
void RegisterActor::PlanChecks() {
  std::vector<PlaceCheck::AgentPair> doubtful;
  for (const auto& [agents, counts] : plan_.CountResults()) {
    const bool is_by_start = by_start_.contains(agents.first) || by_start_.contains(agents.second);
    if (agents.first != agents.second && is_by_start && PlaceCheck::IsDoubtful(counts)) doubtful.push_back(agents);
  }
  check_.Begin(std::move(doubtful), placed_);
}

void RegisterActor::MatchSome(Context& context) {
  const MonotonicTime begin = context.now();
  const auto budget = std::chrono::milliseconds(options_.team.registration().budget_ms());
  const auto is_full = [this] { return records_.size() >= options_.insert_records_max; };
  for (std::size_t i = 0; i < options_.turn_pairs_max && left_count() > 0 && !is_full(); ++i) {
    if (i > 0 && context.now() - begin >= budget) break;
    if (context.stop_requested()) return;
    if (pass_.left_count() > 0) {
      Match(context, pass_.Next());
      if (pass_.left_count() == 0) PlanChecks();
    } else if (check_.left_count() > 0) {
      check_.Step(known_);
    } else {
      for (const auto& [planned, result] : starts_.Step(known_, fields_)) AddRecord(context, planned, result);
    }
  }
  report_.OnTime(context.now() - begin);
  if (left_count() > 0 && !is_full()) return RequestPgo(context);
  StoreMatches(context);
}

void RegisterActor::StoreMatches(Context& context) {
  phase_ = Phase::kWriting;
  writer_.Write(context, records_);
  OnWritten(context);
}

void RegisterActor::Match(Context& context, const PlannedMatch& planned) {
  if (!plan_.HasWorkFor(planned)) return;
  const std::shared_ptr<const HazardField> first = fields_.FieldOf(planned.first, known_);
  const std::shared_ptr<const HazardField> second = fields_.FieldOf(planned.second, known_);
  if (!first || !second) return;
  const MatchResult result = MatchMaps(*first, *second, planned.expected, planned.window);
  report_.OnMatched(result.verdict);
  plan_.Note(planned, result);
  if (result.verdict == MatchVerdict::kAccepted) AddRecord(context, planned, result);
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

void RegisterActor::OnWritten(Context& context) {
  if (phase_ != Phase::kWriting || writer_.is_writing()) return;
  const std::size_t stored_count = writer_.stored_count();
  Check(stored_count <= records_.size(), "storage accepts no more matches than it was sent");
  report_.OnStored(stored_count);
  if (stored_count > 0) {
    report_.SetTrouble("");
    // Poses that are older than these matches start no pass: the next solve uses the matches.
    if (!has_news_) quiet_.Stop();
  }
  records_.erase(records_.begin(), records_.begin() + static_cast<std::ptrdiff_t>(stored_count));
  if (!writer_.result()) {
    // Storage would refuse these records again.
    if (writer_.result().error().code == ErrorCode::kInvalid) records_.clear();
    return StopPass(context, writer_.result().error().text);
  }
  Check(records_.empty(), "all matches are stored");
  if (left_count() > 0) return RequestPgo(context);
  Finish(context);
}

void RegisterActor::Finish(Context& context) {
  phase_ = Phase::kIdle;
  fields_.Clear();
  AnswerAll(context);
}

// Stops the pass until new records arrive, somebody asks for a pass, or pass_retry has elapsed.
void RegisterActor::StopPass(Context& context, const std::string& reason) {
  trouble_log_.Warn(ToString(context.self()) + ": the matching of maps stopped: " + reason);
  report_.SetTrouble(reason);
  (void)context.AfterTimer(options_.pass_retry, kRetry, ++request_id_);
  phase_ = Phase::kIdle;
  for (Waiting& waiting : waiting_) waiting.is_covered = true;
  AnswerAll(context);
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
    *refusal.mutable_error() =
        ToProto(Error{ErrorCode::kFull, "too many requests wait for matches; try again later", {}});
    return Answer(context, waiting, refusal);
  }
  (void)context.AfterTimer(wait, kWaitEnd, waiting.timer);
  waiting_.push_back(std::move(waiting));
  if (phase_ == Phase::kIdle) StartPass(context);
}

proto::RegistrationReply RegisterActor::State() const {
  proto::RegistrationReply reply = report_.ToReply(phase_ == Phase::kIdle, known_.map_count());
  reply.set_left_count(static_cast<double>(left_count()));
  reply.set_is_due(quiet_.has_news() && (has_news_ || passes_since_news_ < kPassesMax));
  for (const auto& [agents, count] : plan_.CountLeftOut()) {
    proto::LeftOutPairs& out = *reply.add_left_out();
    out.set_agent_id(agents.first);
    out.set_other_agent_id(agents.second);
    out.set_count(static_cast<double>(count));
  }
  for (const auto& [agents, counts] : plan_.CountResults()) {
    proto::MatchedAgents& out = *reply.add_agents();
    out.set_agent_id(agents.first);
    out.set_other_agent_id(agents.second);
    if (const auto fit = check_.fits().find(agents); fit != check_.fits().end()) {
      out.mutable_places()->set_matched(fit->second.matched);
      out.mutable_places()->set_contradicted(fit->second.contradicted);
      out.mutable_places()->set_own_contradicted(fit->second.own_contradicted);
      out.mutable_places()->set_is_contradicted(fit->second.is_contradicted);
    }
    AddCounts(counts, *out.mutable_counts());
  }
  for (const auto& [agents, judged] : starts_.judged()) {
    proto::SearchedStart& start = *reply.add_starts();
    start.set_agent_id(agents.first);
    start.set_other_agent_id(agents.second);
    start.set_is_accepted(judged.verdict == StartVerdict::kAccepted);
    start.set_evidence(judged.best.evidence);
    start.set_rival(judged.rival);
    start.set_matched(judged.best.matched);
    start.set_contradicted(judged.best.contradicted);
    start.set_text(ToString(judged.verdict));
    start.set_remedy(RemedyOf(judged.verdict));
    if (judged.place) *start.mutable_place() = ToProto(*judged.place);
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
