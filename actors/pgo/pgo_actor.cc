#include "actors/pgo/pgo_actor.h"

#include <algorithm>
#include <utility>

#include "actors/pgo/team_facts.h"
#include "model/agent_name.h"
#include "model/duration.h"
#include "proto/types.pb.h"
#include "runtime/team/role_signature.h"

namespace moondb {

namespace {

constexpr std::uint32_t kStorageTimeout = 1;
constexpr std::uint32_t kQuiet = 2;
constexpr std::uint32_t kSolved = 3;

RecordReader::Options ReaderOptions(const PgoActor::Options& options) {
  RecordReader::Options reader;
  reader.data_types = {proto::POSE_GRAPH_NODE, proto::POSE_GRAPH_EDGE, proto::POSE_PRIOR,     proto::MAP_MATCH,
                       proto::OPTIMIZED_POSE,  proto::EDGE_VERDICT,    proto::MAP_QUARANTINE, proto::ROLE_ASSIGNMENT};
  reader.page_records_max = static_cast<std::uint32_t>(options.read_records_max);
  reader.answer_timeout = options.storage_timeout;
  return reader;
}

KnownGraph::Limits LimitsOf(const proto::TeamConfig& team) {
  KnownGraph::Limits limits;
  limits.agent_count = static_cast<std::size_t>(std::max(team.agents_size(), 1));
  return limits;
}

}  // namespace

PgoActor::PgoActor(Options options)
    : options_(std::move(options)),
      agents_(FactsOf(options_.team)),
      known_(LimitsOf(options_.team)),
      authority_(RoleChainOptions(options_.team)),
      reader_(ReaderOptions(options_),
              [this](Context&, const proto::StoredRecord& stored) { return TakeRecord(stored); }) {}

void PgoActor::OnStart(Context& context) {
  // Start at a random id. Otherwise storage's reply to a request from before a restart could match a new request.
  request_id_ = context.rng()() >> 1;
  context.Watch(Topic::kRoles);
  context.Watch(Topic::kStored);
}

// Accepts messages only from actors of this agent. Requests of clients arrive through the gateway.
void PgoActor::OnMessage(Context& context, const proto::Message& message) {
  if (context.sender().agent != options_.self) return;
  if (reader_.OnMessage(context, message)) return OnRead(context);
  switch (message.body_case()) {
    case proto::Message::kRolesChanged:
      return OnRoles(context, message.roles_changed().roles());
    case proto::Message::kOptimizeRequest:
      return OnOptimizeRequest(context, message);
    case proto::Message::kGraphStatsRequest:
      return OnGraphStatsRequest(context);
    case proto::Message::kInsertReply:
      if (IsFromStorage(context, message) && phase_ == Phase::kWriting) OnInsertReply(context, message.insert_reply());
      return;
    case proto::Message::kTimer:
      return OnTimer(context, message.timer());
    case proto::Message::kRecordsStored:
      if (context.sender().actor == actor_name::kStorage) OnRecordsStored(context, message.records_stored());
      return;
    default:
      return;
  }
}

void PgoActor::OnTimer(Context& context, const proto::Timer& timer) {
  switch (timer.kind()) {
    case kStorageTimeout:
      return OnTimeout(context, timer.value());
    case kQuiet:
      return OnQuiet(context);
    case kSolved:
      if (phase_ == Phase::kWriting && timer.value() == request_id_) WriteNextChunk(context);
      return;
  }
}

bool PgoActor::IsFromStorage(const Context& context, const proto::Message& message) const {
  return context.sender() == Address{options_.self, actor_name::kStorage} && message.request_id() == request_id_;
}

void PgoActor::OnRoles(Context& context, const proto::RoleAssignment& roles) {
  const bool is_new_term = !roles_ || OrderOf(roles_->term()) != OrderOf(roles.term());
  if (is_new_term) last_run_ = 0;
  roles_ = roles;
  if (is_new_term) AwaitQuiet(context);  // Earlier leaders may have left records that no solve has used.
  if (phase_ == Phase::kIdle) return;
  if (const std::optional<Error> error = WhyNotLeader()) return FinishWith(context, *error);
  if (is_new_term) FinishWith(context, Error{ErrorCode::kRefused, "the roles changed meanwhile; ask again", {}});
}

std::optional<Error> PgoActor::WhyNotLeader() const {
  if (!roles_) return Error{ErrorCode::kRefused, "this agent does not know the team's roles yet; try again", {}};
  if (roles_->leader() == options_.self) return std::nullopt;
  if (roles_->leader() == 0) return Error{ErrorCode::kRefused, "nobody leads: the leader solves the pose graph", {}};
  const std::string name = AgentName(options_.team, roles_->leader());
  return Error{ErrorCode::kRefused, "the leader solves the pose graph, and " + name + " leads; ask there", {}};
}

void PgoActor::OnOptimizeRequest(Context& context, const proto::Message& message) {
  const bool is_late = phase_ == Phase::kWriting;
  const Requester requester{context.sender(), message.request_id(), message.optimize_request(), is_late};
  proto::OptimizeReply refusal;
  if (const std::optional<Error> error = WhyNotLeader()) {
    *refusal.mutable_error() = ToProto(*error);
    return Answer(context, requester, refusal);
  }
  if (requesters_.size() >= options_.requesters_max) {
    *refusal.mutable_error() = ToProto(Error{ErrorCode::kFull, "too many wait for this solve; try again later", {}});
    return Answer(context, requester, refusal);
  }
  requesters_.push_back(requester);
  if (phase_ == Phase::kIdle) Begin(context, requester.request);
}

void PgoActor::Begin(Context& context, proto::OptimizeRequest request) {
  request_ = std::move(request);
  phase_ = Phase::kReading;
  reply_.Clear();
  StartReading(context);
}

void PgoActor::StartReading(Context& context) {
  if (std::exchange(is_outdated_, false)) {
    known_ = KnownGraph(LimitsOf(options_.team));
    authority_.Restart();
    reader_.ReadAgain(context);
  } else {
    reader_.Read(context);
  }
  OnRead(context);
}

void PgoActor::OnRecordsStored(Context& context, const proto::RecordsStored& stored) {
  is_outdated_ = is_outdated_ || stored.is_pruned();
  const auto is_news = [](auto type) {
    return type == proto::POSE_GRAPH_NODE || type == proto::POSE_GRAPH_EDGE || type == proto::POSE_PRIOR ||
           type == proto::MAP_MATCH || type == proto::MAP_QUARANTINE;
  };
  if (std::any_of(stored.data_types().begin(), stored.data_types().end(), is_news)) AwaitQuiet(context);
}

void PgoActor::AwaitQuiet(Context& context) {
  if (options_.solve_when_quiet <= Duration::zero() || !Leads()) return;
  quiet_.newest_news = context.now();
  if (std::exchange(quiet_.is_awaited, true)) return;
  quiet_.oldest_news = quiet_.newest_news;
  (void)context.AfterTimer(options_.solve_when_quiet, kQuiet);
}

void PgoActor::OnQuiet(Context& context) {
  quiet_.is_awaited = false;
  if (!Leads()) return;
  MonotonicTime due =
      std::min(quiet_.newest_news + options_.solve_when_quiet, quiet_.oldest_news + options_.solve_apart);
  if (quiet_.last_periodic) due = std::max(due, *quiet_.last_periodic + options_.solve_apart);
  if (phase_ != Phase::kIdle) due = std::max(due, context.now() + options_.solve_when_quiet);
  if (context.now() >= due) {
    quiet_.last_periodic = context.now();
    return Begin(context, {});
  }
  quiet_.is_awaited = true;
  (void)context.AfterTimer(due - context.now(), kQuiet);
}

void PgoActor::OnGraphStatsRequest(Context& context) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  *message.mutable_graph_stats_reply() = stats_;
  message.mutable_graph_stats_reply()->set_is_solving(phase_ != Phase::kIdle);
  (void)context.Reply(std::move(message));  // Ignore a failed send: the client may have disconnected.
}

void PgoActor::OnTimeout(Context& context, std::uint64_t request_id) {
  if (phase_ != Phase::kWriting || request_id != request_id_) return;
  FinishWith(context, Error{ErrorCode::kTimedOut, "storage did not answer", {}});
}

Result<void> PgoActor::TakeRecord(const proto::StoredRecord& stored) {
  proto::Record record;
  // The record validator has checked every stored record. A record of a later version that this version cannot parse is
  // skipped.
  const RecordKey key = FromProto(stored.key());
  if (record.ParseFromString(stored.content()) && authority_.Counts(key, record)) (void)known_.Add(key, record);
  return {};
}

void PgoActor::OnRead(Context& context) {
  if (phase_ != Phase::kReading || reader_.is_reading()) return;
  if (!reader_.result()) return FinishWith(context, reader_.result().error());
  if (authority_.TakeOutdated()) {
    is_outdated_ = true;
    return StartReading(context);
  }
  SolveNow(context);
}

void PgoActor::ReportLeftOut(Context& context, std::map<AgentId, std::uint64_t> left_out) {
  for (const auto& [origin, count] : known_.CountLeftOut()) left_out[origin] += count;
  if (std::optional<proto::Message> report = authority_.TakeReport(std::move(left_out))) {
    // The report is only informative. Ignore a failed send.
    (void)context.Send({options_.self, actor_name::kStorage}, *std::move(report));
  }
}

SolverOptions PgoActor::OptionsOf(const proto::OptimizeRequest& request) const {
  SolverOptions solver = options_.solver;
  solver.window_nodes = request.window_nodes();
  for (const proto::NodeKey& node : request.covariance_of()) solver.covariance_of.push_back(FromProto(node));
  if (request.with_covariance()) {
    for (const NodeKey& node : known_.NewestNodes()) solver.covariance_of.push_back(node);
  }
  return solver;
}

void PgoActor::SolveNow(Context& context) {
  SolverOptions solver = OptionsOf(request_);
  const MonotonicTime begin = context.now();
  bool is_late = false;
  solver.stop_requested = [&] {
    is_late = context.now() - begin > options_.solve_time_max;
    return is_late || context.stop_requested();
  };
  const LastSolution last = request_.from_scratch() ? LastSolution{} : known_.FindLastSolution();
  const KnownGraph::Selection selection = known_.SelectForSolve(KnownGraph::SolveSizeMax(known_.node_count()));
  ReportLeftOut(context, selection.left_out);
  AgentFactsMap agents = agents_;
  for (const auto& [node, pose] : known_.FindContinuations()) {
    AgentFacts& facts = agents[node.agent];
    if (facts.is_base_station) continue;
    facts.start = pose;
    facts.start_index = node.index;
  }
  const std::optional<AgentId> frame_of = ChooseMapFrame(selection.graph, known_, agents);
  Solution solution = SolvePoseGraph(selection.graph, agents, last, solver);
  if (frame_of && solution.is_accepted) {
    solution.text = "no rover has a start: the frame of the map is that of " + AgentName(options_.team, *frame_of);
  }
  if (is_late && !solution.is_accepted) {
    solution.text = "took longer than " +
                    FormatDuration(std::chrono::duration_cast<std::chrono::milliseconds>(options_.solve_time_max)) +
                    ", so the poses stay as they were";
  }
  reply_ = ToReply(solution);
  reply_.set_seconds(std::chrono::duration<double>(context.now() - begin).count());
  stats_.set_solve_count(stats_.solve_count() + 1);

  const std::uint64_t run = 1 + std::max(last_run_, known_.LastRun(roles_->term()));
  publication_ =
      MakePublication(solution, known_, agents_, options_.publication, roles_->term(), run, context.utc_now_ns());
  if (!publication_.records.empty()) last_run_ = run;
  reply_.set_updated_pose_count(static_cast<double>(publication_.pose_count));
  phase_ = Phase::kWriting;
  written_count_ = 0;
  // Return to the mailbox before the first insert, to handle a role change that arrived during the solve.
  (void)context.AfterTimer(Duration::zero(), kSolved, ++request_id_);
}

void PgoActor::WriteNextChunk(Context& context) {
  const std::size_t left = publication_.records.size() - written_count_;
  if (left == 0) return Finish(context);
  const std::size_t count = std::min(left, options_.insert_records_max);
  proto::Message message;
  proto::InsertRequest& request = *message.mutable_insert_request();
  for (std::size_t i = 0; i < count; ++i) *request.add_records() = publication_.records[written_count_ + i];
  written_count_ += count;
  AskToInsert(context, std::move(message));
}

void PgoActor::AskToInsert(Context& context, proto::Message message) {
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(++request_id_);
  const SendResult result = context.Send({options_.self, actor_name::kStorage}, std::move(message));
  if (result != SendResult::kAccepted) {
    const std::string text = std::string("storage cannot be asked: ") + ToString(result);
    return FinishWith(context, Error{ErrorCode::kUnavailable, text, {}});
  }
  timeout_ = context.AfterTimer(options_.storage_timeout, kStorageTimeout, request_id_);
}

void PgoActor::OnInsertReply(Context& context, const proto::InsertReply& reply) {
  context.Cancel(timeout_);
  if (IsError(reply.error())) return FinishWith(context, FromProto(reply.error()));
  WriteNextChunk(context);
}

void PgoActor::FinishWith(Context& context, const Error& error) {
  *reply_.mutable_error() = ToProto(error);
  Finish(context);
}

void PgoActor::Finish(Context& context) {
  context.Cancel(timeout_);
  reader_.Stop(context);
  phase_ = Phase::kIdle;
  publication_ = {};
  *stats_.mutable_last_solve() = reply_;
  const std::string question = request_.SerializeAsString();
  std::vector<Requester> waiting;
  for (Requester& requester : std::exchange(requesters_, {})) {
    if (!Leads() || (!requester.is_late && requester.request.SerializeAsString() == question)) {
      Answer(context, requester, reply_);
    } else {
      requester.is_late = false;
      waiting.push_back(std::move(requester));
    }
  }
  requesters_ = std::move(waiting);
  if (!requesters_.empty()) Begin(context, requesters_.front().request);
}

void PgoActor::Answer(Context& context, const Requester& requester, const proto::OptimizeReply& reply) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(requester.request_id);
  *message.mutable_optimize_reply() = reply;
  // Ignore a failed send: the requester may have disconnected.
  (void)context.Send(requester.address, std::move(message));
}

}  // namespace moondb
