#include "actors/pgo/pgo_actor.h"

#include <algorithm>
#include <utility>

#include "actors/pgo/team_facts.h"
#include "model/agent_name.h"
#include "model/data_types.h"
#include "model/duration.h"
#include "proto/types.pb.h"
#include "runtime/team/role_signature.h"

namespace moondb {

namespace {

constexpr std::uint32_t kQuiet = 1;
constexpr std::uint32_t kSolved = 2;

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
      reader_(
          RoleChainOptions(options_.team), ReaderOptions(options_),
          [this] { known_ = KnownGraph(LimitsOf(options_.team)); },
          [this](const RecordKey& key, const proto::Record& record) { (void)known_.Add(key, record); }),
      writer_({options_.insert_records_max, options_.storage_timeout}),
      quiet_({kQuiet, options_.solve_when_quiet, options_.solve_apart, options_.solve_apart}) {}

void PgoActor::OnStart(Context& context) {
  context.Watch(Topic::kRoles);
  context.Watch(Topic::kStored);
}

// Accepts messages only from actors of this agent. Requests of clients arrive through the gateway.
void PgoActor::OnMessage(Context& context, const proto::Message& message) {
  if (context.sender().agent != options_.self) return;
  if (reader_.OnMessage(context, message)) return OnRead(context);
  if (writer_.OnMessage(context, message)) return OnWritten(context);
  switch (message.body_case()) {
    case proto::Message::kRolesChanged:
      return OnRoles(context, message.roles_changed().roles());
    case proto::Message::kOptimizeRequest:
      return OnOptimizeRequest(context, message);
    case proto::Message::kGraphStatsRequest:
      return OnGraphStatsRequest(context);
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
    case kQuiet:
      return OnQuiet(context);
    case kSolved:
      if (phase_ == Phase::kWriting && timer.value() == solve_id_) WritePublication(context);
      return;
  }
}

void PgoActor::OnRoles(Context& context, const proto::RoleAssignment& roles) {
  const bool is_new_term = !roles_ || OrderOf(roles_->term()) != OrderOf(roles.term());
  if (is_new_term) last_run_ = 0;
  roles_ = roles;
  if (is_new_term) AwaitQuiet(context);  // Earlier leaders may have left records that no solve has used.
  if (phase_ == Phase::kIdle) return;
  if (const std::optional<Error> error = WhyNotLeader()) return FinishWith(context, *error);
  if (is_new_term) FinishWith(context, Error{ErrorCode::kRefused, "the roles changed during the solve; try again", {}});
}

std::optional<Error> PgoActor::WhyNotLeader() const {
  if (!roles_) return Error{ErrorCode::kRefused, "this agent does not know the team's roles yet; try again", {}};
  if (roles_->leader() == options_.self) return std::nullopt;
  if (roles_->leader() == 0)
    return Error{ErrorCode::kRefused, "only the leader solves the pose graph, and the team has no leader", {}};
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
    *refusal.mutable_error() =
        ToProto(Error{ErrorCode::kFull, "too many requests wait for this solve; try again later", {}});
    return Answer(context, requester, refusal);
  }
  requesters_.push_back(requester);
  if (phase_ == Phase::kIdle) Begin(context, requester.request);
}

void PgoActor::Begin(Context& context, proto::OptimizeRequest request) {
  request_ = std::move(request);
  phase_ = Phase::kReading;
  reply_.Clear();
  reader_.Read(context);
  OnRead(context);
}

void PgoActor::OnRecordsStored(Context& context, const proto::RecordsStored& stored) {
  reader_.OnRecordsStored(stored);
  const auto is_news = [](auto type) {
    const DataTypeRow* row = FindDataType(static_cast<DataType>(type));
    return row != nullptr && row->is_news_for_solve;
  };
  if (std::any_of(stored.data_types().begin(), stored.data_types().end(), is_news)) AwaitQuiet(context);
}

void PgoActor::AwaitQuiet(Context& context) {
  if (options_.solve_when_quiet > Duration::zero() && Leads()) quiet_.OnNews(context);
}

void PgoActor::OnQuiet(Context& context) {
  if (!Leads()) quiet_.Stop();
  if (quiet_.OnTimer(context, /*is_busy=*/phase_ != Phase::kIdle)) Begin(context, {});
}

void PgoActor::OnGraphStatsRequest(Context& context) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  *message.mutable_graph_stats_reply() = stats_;
  message.mutable_graph_stats_reply()->set_is_solving(phase_ != Phase::kIdle);
  message.mutable_graph_stats_reply()->set_is_due(Leads() && quiet_.has_news());
  (void)context.Reply(std::move(message));  // Ignore a failed send: the client may have disconnected.
}

void PgoActor::OnRead(Context& context) {
  if (phase_ != Phase::kReading || reader_.is_reading()) return;
  if (!reader_.result()) return FinishWith(context, reader_.result().error());
  SolveNow(context);
}

void PgoActor::ReportLeftOut(Context& context, std::map<AgentId, std::uint64_t> left_out) {
  for (const auto& [origin, count] : known_.CountLeftOut()) left_out[origin] += count;
  reader_.Report(context, std::move(left_out));
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
  if (solution.is_accepted && request_.window_nodes() == 0) quiet_.Stop();  // The solve used all news.
  reply_ = ToReply(solution);
  reply_.set_seconds(std::chrono::duration<double>(context.now() - begin).count());
  stats_.set_solve_count(stats_.solve_count() + 1);

  const std::uint64_t run = 1 + std::max(last_run_, known_.LastRun(roles_->term()));
  publication_ =
      MakePublication(solution, known_, agents_, options_.publication, roles_->term(), run, context.utc_now_ns());
  if (!publication_.records.empty()) last_run_ = run;
  reply_.set_updated_pose_count(static_cast<double>(publication_.pose_count));
  phase_ = Phase::kWriting;
  // Return to the mailbox before the first insert, to handle a role change that arrived during the solve.
  (void)context.AfterTimer(Duration::zero(), kSolved, ++solve_id_);
}

void PgoActor::WritePublication(Context& context) {
  writer_.Write(context, std::move(publication_.records));
  OnWritten(context);
}

void PgoActor::OnWritten(Context& context) {
  if (phase_ != Phase::kWriting || writer_.is_writing()) return;
  if (!writer_.result()) return FinishWith(context, writer_.result().error());
  Finish(context);
}

void PgoActor::FinishWith(Context& context, const Error& error) {
  *reply_.mutable_error() = ToProto(error);
  Finish(context);
}

void PgoActor::Finish(Context& context) {
  reader_.Stop(context);
  writer_.Stop(context);
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
