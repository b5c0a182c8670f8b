#include "actors/sharing/sharing_actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "model/agent_name.h"
#include "model/command_from.h"
#include "model/control_message.h"
#include "model/control_request.h"
#include "model/data_types.h"
#include "model/order_number.h"
#include "model/team_id.h"
#include "model/team_member.h"
#include "model/term.h"
#include "model/text.h"
#include "model/wire_version.h"
#include "proto/control.pb.h"
#include "runtime/team/role_signature.h"
#include "runtime/team/team_config.h"
#include "runtime/transport.h"

namespace moondb {
namespace {

enum TimerKind : std::uint32_t { kSession = 1, kOrders = 2, kStep = 3, kBudget = 4, kWatch = 5, kFlow = 6 };

// Upper bound of a message's bytes besides the streams of its have-set. The assertions below check that the two largest
// kinds of messages fit into a peer message: a page of a have-set, and the acknowledgment of a full batch whose records
// all belong to different streams.
constexpr std::size_t kAroundBytesMax = 8 * 1024;
static_assert(kHavePageBytesMax + kAroundBytesMax <= kPeerMessageBytesMax);
static_assert(kBatchRecordsMax * (kHaveStreamBytesMax + kHaveIntervalBytesMax) + kAroundBytesMax <=
              kPeerMessageBytesMax);

constexpr Duration kBudgetPeriod = std::chrono::seconds(5);

// Returns the radio budget in bytes per second; 0 if the team file sets none, as in tests.
double BudgetOf(const proto::TeamConfig& team) { return team.radio().budget_kbps() * 1000 / 8; }

// Returns the data types that may be sent in a window of kStatesOnly: built-in states under the policy `latest`. Their
// records are small, and each agent has at most one record of each type.
std::vector<DataType> StateTypesOf(const proto::TeamConfig& team) {
  std::vector<DataType> types;
  for (const DataType type : BuiltInDataTypes()) {
    if (IsState(type) && SharePolicyOf(team, type) == proto::POLICY_LATEST) types.push_back(type);
  }
  return types;
}

// Returns the codec for sent batches: the team file's codec if it names one, or else the default of the options.
proto::Codec CodecOf(const SharingActor::Options& options) {
  const proto::Codec codec = options.team.radio().codec();
  return codec == proto::CODEC_UNSPECIFIED ? options.session.codec : codec;
}

Duration FlowPeriodOf(const proto::TeamConfig& team) {
  return std::chrono::duration_cast<Duration>(std::chrono::duration<double>(team.radio().sync_period_s()));
}

PeerOrders::Options OrderOptionsOf(const SharingActor::Options& options, proto::SharingKind kind) {
  return {options.self, kind, options.session.resend_after, options.session.resend_after_max};
}

}  // namespace

SharingActor::SharingActor(Options options, proto::SharingKind kind)
    : options_(std::move(options)),
      kind_(kind),
      leases_(options_.team.radio().quiet_while_driving()),
      orders_(OrderOptionsOf(options_, kind)),
      radio_share_(BudgetOf(options_.team)),
      flow_{FlowSchedule(FlowPeriodOf(options_.team)), {}} {}

void SharingActor::OnStart(Context& context) {
  context.WatchPeers();
  context.Watch(Topic::kRoles);
  context.Watch(Topic::kLeases);
  if (flow().is_on()) context.Watch(Topic::kStored);
  roles_ = InitialRoles(options_.team);
  roles_.clear_term();
  for (const proto::AgentConfig& agent : options_.team.agents()) lost_at_[agent.id()] = context.now();
  const std::uint64_t random = context.rng()();
  last_order_ = BeginOrderNumbers(random);
  SharingReceiver::Options receiver;
  receiver.team = options_.team.team();
  receiver.team_id = TeamIdBytes(options_.team.team_id());
  receiver.config_hash = options_.config_hash;
  receiver.kind = kind_;
  receiver.bytes_per_second_max = BudgetOf(options_.team);
  receiver.schemas = SchemasOf(options_.team.custom_types());
  // The statements of peers run in SQLite, so accept statements only if the team uses this codec.
  if (CodecOf(options_) == proto::CODEC_PAPER_SQL) receiver.paper_sql = options_.session.paper_sql;
  receiver.sessions_max = static_cast<std::size_t>(options_.team.agents_size());
  receiver.unacked_bytes_max = static_cast<std::uint32_t>(options_.session.unacked_bytes_max);
  receiver.have_page_bytes_max = options_.have_page_bytes_max;
  receiver_.emplace(std::move(receiver), random);
  OnStarted(context);
}

void SharingActor::OnMessage(Context& context, const proto::Message& message) {
  if (is_from_here(context)) {
    OnLocal(context, message);
  } else if (FindAgent(options_.team, context.sender().agent) != nullptr) {
    OnPeer(context, message);
  }
  ShareDue(context);
  DivideBudget(context);
  AnswerWhoWaits(context);
}

void SharingActor::OnLocal(Context& context, const proto::Message& message) {
  switch (message.body_case()) {
    case proto::Message::kTimer:
      return OnTimer(context, message.timer());
    case proto::Message::kPeerEvent:
      return OnLink(context, message.peer_event());
    case proto::Message::kRolesChanged:
      return SetRoles(context, message.roles_changed().roles());
    case proto::Message::kLeasesChanged:
      return OnLeasesChanged(context, message.leases_changed());
    case proto::Message::kRecordsStored:
      if (context.sender().actor == actor_name::kStorage) OnStored(message.records_stored());
      return;
    case proto::Message::kHaveReply:
      return Perform(context, receiver_->OnHaveReply(message.request_id(), message.have_reply()));
    case proto::Message::kStoreReply:
      return OnStoreReply(context, message);
    case proto::Message::kMissingReply:
      // A session that sent no request with this id ignores the answer.
      for (auto& [destination, outgoing] : outgoing_) {
        Perform(context, outgoing,
                outgoing.session.OnMissingReply(message.request_id(), message.missing_reply(), context.now()));
      }
      return;
    case proto::Message::kPeerHaveRequest:
      return OnPeerHaveRequest(context, message);
    case proto::Message::kSharingLoad:
      return radio_share_.SetMovingElsewhere(message.sharing_load().moving_sessions());
    case proto::Message::kGathering:
      return OnGathering(context, message.gathering());
    case proto::Message::kShareRequest:
      return OnShareRequest(context, message);
    case proto::Message::kShareProgressRequest:
      return OnProgressRequest(context, message);
    case proto::Message::kControlRequest:
      return OnControlRequest(context, message);
    default:
      return;
  }
}

void SharingActor::OnPeer(Context& context, const proto::Message& message) {
  const AgentId peer = context.sender().agent;
  switch (message.body_case()) {
    case proto::Message::kHello:
      return OnHello(context, message.hello());
    case proto::Message::kBatch:
      return OnBatch(context, message);
    case proto::Message::kHave:
      if (Outgoing* outgoing = FindOutgoing(peer)) {
        Perform(context, *outgoing, outgoing->session.OnHave(message.have(), context.now()));
      }
      return;
    case proto::Message::kRefusal:
      if (Outgoing* outgoing = FindOutgoing(peer)) {
        Perform(context, *outgoing, outgoing->session.OnRefusal(message.refusal(), context.now()));
      }
      return;
    case proto::Message::kShareRequest:
      return OnShareRequest(context, message);
    case proto::Message::kShareReply:
      return OnShareReply(context, message);
    default:
      return;
  }
}

void SharingActor::OnHello(Context& context, const proto::Hello& hello) {
  const AgentId peer = context.sender().agent;
  const bool was_other_config = receiver_->other_configs().contains(peer);
  SharingActions answer = receiver_->OnHello(peer, hello, context.now());
  if (!answer.empty() && answer.front().message.has_refusal()) {
    refused_log_.Warn(ToString(context.self()) + ": refused to open a session with " + NameOf(peer) + ": " +
                      ToString(FromProto(answer.front().message.refusal().error())));
    return Perform(context, std::move(answer));
  }
  if (!was_other_config && receiver_->other_configs().contains(peer)) {
    refused_log_.Warn(ToString(context.self()) + ": " + NameOf(peer) + " runs with another team file");
  }
  Perform(context, std::move(answer));
}

void SharingActor::OnBatch(Context& context, const proto::Message& message) {
  Result<SharingActions> actions = receiver_->OnBatch(context.sender().agent, message, context.now());
  if (!actions) {
    refused_log_.Warn(ToString(context.self()) + ": dropped a damaged batch of " + NameOf(context.sender().agent) +
                      ": " + ToString(actions.error()));
    return;
  }
  // A batch that was refused, dropped or late, or that cannot be decoded without missing batches, is no progress.
  const bool is_taken =
      !actions->empty() && !actions->front().message.has_refusal() && !actions->front().message.have().needs_new_run();
  Perform(context, *std::move(actions));
  if (is_taken) OnReceived(context, context.sender().agent, {});
}

void SharingActor::OnStoreReply(Context& context, const proto::Message& message) {
  const proto::StoreReply& reply = message.store_reply();
  if (reply.rejected_count() > 0) {
    refused_log_.Warn(ToString(context.self()) + ": storage refused " + std::to_string(reply.rejected_count()) +
                      " records of a peer");
  }
  SharingActions acknowledgments = receiver_->OnStoreReply(message.request_id(), reply);
  std::map<AgentId, Received> stored;
  for (const SharingAction& action : acknowledgments) {
    if (!action.message.has_have()) continue;
    if (const auto end = OrderEndBy(action.to)) orders_.TakeEnd(action.to, end->order());
    Received& received = stored[action.to];
    received.is_all = action.message.remaining() == 0;
    if (reply.stored_count() == 0) continue;
    for (const proto::StreamHave& stream : reply.covered().streams()) {
      received.types.insert(static_cast<DataType>(stream.data_type()));
    }
  }
  Perform(context, std::move(acknowledgments));
  for (const auto& [sender, received] : stored) OnReceived(context, sender, received);
}

void SharingActor::OnPeerHaveRequest(Context& context, const proto::Message& message) {
  Outgoing* outgoing = FindOutgoing(message.peer_have_request().peer());
  if (outgoing) Perform(context, *outgoing, outgoing->session.OnPeerHaveRequest(message.request_id()));
}

void SharingActor::OnShareRequest(Context& context, const proto::Message& message) {
  const proto::ShareRequest& request = message.share_request();
  const bool is_leaders =
      !is_from_here(context) && (context.sender().agent == roles_.leader() || IsNewer(message.term(), roles_.term()));
  Result<void> checked = CheckOrderer(context, message.term());
  if (checked) checked = CheckShareRequest(request);
  if (checked && is_from_here(context) && !roles_.has_term() && roles_.leader() == options_.self) {
    checked = Fail(
        ErrorCode::kUnavailable,
        NameOf(options_.self) + " does not know yet whether it still leads: it is asking the other agents; try again");
  }
  if (checked) checked = CheckExpectedTerm(context, request);
  in_hand_ = {context.sender().agent, is_from_here(context) ? ++last_order_ : request.order()};
  pairs_in_hand_.clear();
  Result<int> started = 1;
  if (!checked) {
    started = tl::unexpected(checked.error());
  } else if (!IsBeingCarriedOut(in_hand_)) {
    started = Share(context, request, is_leaders);
  }
  if (started && is_from_here(context)) WatchOrder(context, request);
  const ShareOrderId carried_out = std::exchange(in_hand_, {});
  if (started && is_from_here(context) && request.wait_s() > 0) {
    OrderWatch::Request waiting{context.sender().agent, context.sender().actor, message.request_id(),
                                carried_out.number};
    waiting.until = context.now() + BoundedWait(request.wait_s(), kOrderWaitMax_s);
    waiting.is_for_end = true;
    const Result<void> waits = watch_.Wait(std::move(waiting));
    if (waits) return;
    started = tl::unexpected(waits.error());
  }
  proto::Message reply;
  reply.set_ms_type(proto::CONTROL);
  proto::ShareReply& body = *reply.mutable_share_reply();
  if (is_from_here(context)) *body.mutable_roles() = roles_;
  body.set_order(carried_out.number);
  if (started) {
    body.set_session_count(static_cast<std::uint32_t>(*started));
  } else {
    *body.mutable_error() = ToProto(started.error());
  }
  (void)context.Reply(std::move(reply));
}

// The leader repeats an order when this agent reconnects, since this agent's process may have restarted. Returns true
// if the order is a repetition of one that a session is carrying out.
bool SharingActor::IsBeingCarriedOut(ShareOrderId id) {
  const Outgoing* outgoing = id.agent == options_.self || id.number == 0 ? nullptr : FindOutgoing(id.agent);
  return outgoing != nullptr && outgoing->session.StateOf(id) == StandingOrder::Reached::kOpen;
}

void SharingActor::OnControlRequest(Context& context, const proto::Message& message) {
  const Result<proto::ControlRequest> request = ControlRequestOf(message);
  if (!request || !request->has_share_status()) return;
  proto::ControlReply reply;
  proto::ShareStatus& status = *reply.mutable_share_status();
  for (const auto& [destination, outgoing] : outgoing_) {
    proto::ShareSession& session = *status.add_sessions();
    session = outgoing.session.Status(context.now());
    if (!session.is_open()) continue;
    session.set_waits_for(WhyWindowIsShut(context, destination));
    session.set_waits_for_s(SecondsUntilWindowOpens(context, destination));
  }
  *status.mutable_roles() = roles_;
  AddStatus(context, status);
  for (const AgentId due : flow().FindDue()) status.add_due(due);
  for (const AgentId refusing : flow().FindRefusing()) status.add_refusing(refusing);
  status.set_received_records(receiver_->counts().received_records);
  status.set_rejected_records(receiver_->counts().rejected_records);
  status.set_damaged_messages(receiver_->counts().damaged_messages);
  status.set_dropped_messages(receiver_->counts().dropped_messages);
  status.set_refused_hellos(receiver_->counts().refused_hellos);
  *status.mutable_other_config_agents() = {receiver_->other_configs().begin(), receiver_->other_configs().end()};
  (void)context.Reply(MessageOf(reply));
}

void SharingActor::OnLink(Context& context, const proto::PeerEvent& event) {
  if (event.is_connected()) {
    connected_.insert(event.peer());
    lost_at_.erase(event.peer());
    receiver_->OnConnected(event.peer());
    if (Outgoing* outgoing = FindOutgoing(event.peer())) {
      Perform(context, *outgoing, outgoing->session.OnConnected(context.now()));
    }
    PerformOrders(context, orders_.OnConnected(event.peer(), context.now()));
  } else {
    connected_.erase(event.peer());
    lost_at_.try_emplace(event.peer(), context.now());
  }
  OnPeerEvent(context, event.peer());
}

void SharingActor::OnLeasesChanged(Context& context, const proto::LeasesChanged& changed) {
  leases_.SetAll(changed);
  for (auto& [destination, outgoing] : outgoing_) {
    Perform(context, outgoing, outgoing.session.SetWindow(WindowTo(context, destination), context.now()));
  }
  OnWindowsChanged(context);
}

void SharingActor::OnTimer(Context& context, const proto::Timer& timer) {
  if (timer.kind() == kOrders) {
    orders_timer_.armed.reset();
    return PerformOrders(context, orders_.OnTimer(context.now()));
  }
  if (timer.kind() == kBudget) {
    is_budget_timer_armed_ = false;
    return;
  }
  if (timer.kind() == kFlow) {
    flow_.timer.armed.reset();
    return;  // ShareDue runs after each message.
  }
  if (timer.kind() == kWatch) {
    watch_timer_.armed.reset();
    return;  // AnswerWhoWaits runs after each message and updates the orders.
  }
  if (timer.kind() == kStep) return OnStepTimer(context, timer.value());
  Outgoing* outgoing = FindOutgoing(static_cast<AgentId>(timer.value()));
  if (outgoing == nullptr) return;
  outgoing->timer.armed.reset();
  Perform(context, *outgoing, outgoing->session.OnTimer(context.now()));
}

void SharingActor::SetRoles(Context& context, const proto::RoleAssignment& roles) {
  const proto::RoleAssignment previous = std::exchange(roles_, roles);
  watch_.EndTerm(roles_.term(),
                 {ErrorCode::kRefused,
                  (previous.leader() == roles_.leader() ? "the roles have changed"
                                                        : "leadership moved to " + NameOf(roles_.leader())) +
                      std::string(" in term ") + TermText(roles_.term()),
                  "expected_term"});
  OnNewRoles(context, previous);
}

Result<void> SharingActor::CheckOrderer(const Context& context, const proto::Term& term) const {
  const AgentId from = context.sender().agent;
  if (HasLeft(options_.team, from)) return Fail(ErrorCode::kRefused, NameOf(from) + " has left the team");
  const bool may_order = from == roles_.leader() || from == roles_.survivor() || MayCommand(options_.team, from);
  if (is_from_here(context) || may_order || !HasSigningKeys(options_.team)) return {};
  if (IsNewer(term, roles_.term())) {
    return Fail(ErrorCode::kUnavailable,
                NameOf(options_.self) + " does not know term " + TermText(term) + " yet; try again");
  }
  return Fail(ErrorCode::kRefused, NameOf(from) + " is neither leader nor survivor in term " + TermText(roles_.term()) +
                                       ", nor named in command_from of the team file");
}

Result<void> SharingActor::CheckShareRequest(const proto::ShareRequest& request) const {
  if (request.kind() != kind_)
    return Fail(ErrorCode::kInvalid, "is not the kind of sharing that this actor does", "kind");
  const auto check_agent = [this](AgentId agent, const std::string& field) -> Result<void> {
    if (FindAgent(options_.team, agent) == nullptr) {
      return Fail(ErrorCode::kInvalid, "no agent has the id " + std::to_string(agent), field);
    }
    if (HasLeft(options_.team, agent)) return Fail(ErrorCode::kRefused, NameOf(agent) + " has left the team", field);
    return {};
  };
  if (request.destination() != 0) {
    if (auto checked = check_agent(request.destination(), "destination"); !checked) return checked;
  }
  for (int i = 0; i < request.from_agents_size(); ++i) {
    auto checked = check_agent(request.from_agents(i), "from_agents[" + std::to_string(i) + "]");
    if (!checked) return checked;
  }
  return {};
}

Result<void> SharingActor::CheckExpectedTerm(const Context& context, const proto::ShareRequest& request) const {
  const bool is_relied_on = is_from_here(context) && request.has_expected_term() && request.destination() == 0;
  if (!is_relied_on || OrderOf(request.expected_term()) == OrderOf(roles_.term())) return {};
  return Fail(ErrorCode::kRefused,
              "the roles have changed: " + NameOf(options_.self) + " acts on term " + TermText(roles_.term()) +
                  ", but the order requires term " + TermText(request.expected_term()),
              "expected_term");
}

std::string SharingActor::TermText(const proto::Term& term) const {
  return moondb::TermText(term) + (term.issuer() == 0 ? "" : " by " + NameOf(term.issuer()));
}

SharingActor::Outgoing& SharingActor::FindOrMakeOutgoing(Context& context, AgentId destination) {
  if (Outgoing* outgoing = FindOutgoing(destination)) return *outgoing;
  SharingSession::Options session_options = options_.session;
  session_options.state_types = StateTypesOf(options_.team);
  session_options.schemas = SchemasOf(options_.team.custom_types());
  session_options.codec = CodecOf(options_);
  SharingSession session(std::move(session_options), kind_, destination, context.rng()());
  (void)session.SetWindow(WindowTo(context, destination), context.now());  // A closed session returns no actions.
  return outgoing_.emplace(destination, Outgoing{std::move(session), false, {}}).first->second;
}

void SharingActor::Open(Context& context, AgentId destination, proto::RecordFilter filter, bool is_by_role,
                        std::uint64_t bytes_max) {
  Outgoing& outgoing = FindOrMakeOutgoing(context, destination);
  outgoing.is_by_role = is_by_role;
  if (order_in_hand() != 0) pairs_in_hand_.push_back({destination, /*is_incoming=*/false});
  Perform(context, outgoing, outgoing.session.Order(std::move(filter), context.now(), bytes_max, in_hand_));
}

void SharingActor::OpenAgain(Context& context, std::uint64_t order, AgentId destination, proto::RecordFilter filter) {
  in_hand_ = {options_.self, order};
  Open(context, destination, std::move(filter), /*is_by_role=*/true);
  in_hand_ = {};
  pairs_in_hand_.clear();
}

void SharingActor::SharePeriodicStates(Context& context, AgentId destination) {
  proto::RecordFilter states;
  states.add_origin_agents(options_.self);
  for (const DataType type : StateTypesOf(options_.team)) states.add_data_types(type);
  if (!states.data_types().empty()) SharePeriodic(context, destination, states, /*is_for_states=*/true);
}

void SharingActor::SharePeriodic(Context& context, AgentId destination, const proto::RecordFilter& filter,
                                 bool is_for_states) {
  Outgoing& outgoing = FindOrMakeOutgoing(context, destination);
  if (!outgoing.session.is_open()) outgoing.is_by_role = true;
  Perform(context, outgoing, outgoing.session.SharePeriodic(filter, is_for_states, context.now()));
}

void SharingActor::ShareDue(Context& context) {
  if (!flow().is_on()) return;
  const auto state_of = [&](AgentId destination) { return FlowStateOf(context, destination); };
  for (const AgentId destination : flow().TakeDue(context.now(), state_of)) {
    SharePeriodic(context, destination, FlowRecordsFor(destination), /*is_for_states=*/false);
  }
  Arm(context, flow_.timer, flow().deadline(state_of), kFlow, 0);
}

FlowSchedule::State SharingActor::FlowStateOf(const Context& context, AgentId destination) {
  FlowSchedule::State state;
  state.is_ready = is_connected(destination) && IsWindowOpen(context, destination);
  const Outgoing* outgoing = FindOutgoing(destination);
  state.is_busy = outgoing != nullptr && outgoing->session.is_ordered();
  if (outgoing != nullptr && !outgoing->session.is_open()) state.has_refused = outgoing->session.has_refused();
  return state;
}

std::optional<std::uint64_t> SharingActor::CloseByRole(Context& context) {
  std::optional<std::uint64_t> bytes_left;
  for (auto& [destination, outgoing] : outgoing_) {
    if (!outgoing.is_by_role || !outgoing.session.is_open() || destination == roles_.leader()) continue;
    if (outgoing.session.is_ordered()) {
      const std::uint64_t left = outgoing.session.bytes_left();
      const bool is_unlimited = left == 0 || bytes_left == 0;
      bytes_left = is_unlimited ? 0 : std::max(bytes_left.value_or(0), left);
    }
    outgoing.session.KeepError("ended because the roles changed");
    Perform(context, outgoing, outgoing.session.Close());
  }
  return bytes_left;
}

std::uint64_t SharingActor::OrderFrom(Context& context, AgentId peer, std::uint64_t bytes_max) {
  order_refusals_.erase(peer);
  if (order_in_hand() != 0) pairs_in_hand_.push_back({peer, /*is_incoming=*/true});
  const std::uint64_t number = order_in_hand() != 0 ? order_in_hand() : ++last_order_;
  PerformOrders(context, orders_.Place(peer, number, bytes_max, context.now()));
  return number;
}

// Ignores the end of an order that this actor never gave, even if the peer reports one.
std::optional<proto::OrderEnd> SharingActor::OrderEndBy(AgentId peer) const {
  const proto::OrderEnd& end = receiver_->heard(peer).order_end;
  return HasReached(last_order_, end.order()) ? std::optional(end) : std::nullopt;
}

void SharingActor::OnShareReply(Context& context, const proto::Message& message) {
  const AgentId peer = context.sender().agent;
  const proto::ShareReply& reply = message.share_reply();
  // The peer does not know the current roles yet. The order stays unanswered and is sent again.
  if (reply.error().code() == proto::ERROR_CODE_UNAVAILABLE) return;
  if (!orders_.TakeAnswer(peer, message.request_id(), !IsError(reply.error()))) return;
  ArmOrdersTimer(context);
  if (!IsError(reply.error())) return;
  order_refusals_[peer] = OneLine(reply.error().text());
  refused_log_.Warn(ToString(context.self()) + ": " + NameOf(peer) +
                    " does not share: " + OneLine(ToString(FromProto(reply.error()))));
  OnOrderRefused(context, peer);
}

void SharingActor::CancelOrder(Context& context, AgentId peer) {
  orders_.Cancel(peer);
  ArmOrdersTimer(context);
}

void SharingActor::CancelOrders(Context& context) {
  orders_.CancelAll();
  ArmOrdersTimer(context);
}

void SharingActor::StartStepTimer(Context& context, Duration delay, std::uint64_t step) {
  (void)context.AfterTimer(delay, kStep, step);
}

std::string SharingActor::NameOf(AgentId agent) const { return AgentName(options_.team, agent); }

bool SharingActor::IsWindowOpen(const Context& context, AgentId peer) const {
  return leases_.IsOpen(options_.self, peer, context.now());
}

SharingSession::Window SharingActor::WindowTo(const Context& context, AgentId peer) const {
  if (IsWindowOpen(context, peer)) return SharingSession::Window::kOpen;
  for (const AgentId end : {options_.self, peer}) {
    if (leases_.LeftOf(end, context.now()).sleeping_s() > 0) return SharingSession::Window::kShut;
  }
  return SharingSession::Window::kStatesOnly;
}

std::string SharingActor::WhyWindowIsShut(const Context& context, AgentId peer) const {
  for (const AgentId end : {options_.self, peer}) {
    if (!leases_.IsQuiet(end, context.now())) continue;
    return NameOf(end) + " " + ToString(leases_.LeftOf(end, context.now()));
  }
  return "";
}

double SharingActor::SecondsUntilWindowOpens(const Context& context, AgentId peer) const {
  double seconds = 0;
  for (const AgentId end : {options_.self, peer}) {
    if (!leases_.IsQuiet(end, context.now())) continue;
    const proto::AgentLease left = leases_.LeftOf(end, context.now());
    seconds = std::max({seconds, left.driving_s(), left.sleeping_s(), left.paused_s()});
  }
  return seconds;
}

SharingActor::Outgoing* SharingActor::FindOutgoing(AgentId destination) {
  const auto it = outgoing_.find(destination);
  return it == outgoing_.end() ? nullptr : &it->second;
}

void SharingActor::Perform(Context& context, Outgoing& outgoing, SharingActions actions) {
  for (SharingAction& action : actions) {
    const bool is_to_peer = action.to != 0;
    if (action.message.has_hello()) {
      proto::Hello& hello = *action.message.mutable_hello();
      hello.set_wire_version(kWireVersion);
      hello.set_team(options_.team.team());
      hello.set_team_id(TeamIdBytes(options_.team.team_id()));
      hello.set_config_hash(options_.config_hash);
    }
    const Address to =
        is_to_peer ? Address{action.to, context.self().actor} : Address{options_.self, actor_name::kStorage};
    const SendResult sent = context.Send(to, std::move(action.message));
    if (sent != SendResult::kAccepted) {
      outgoing.session.KeepError("sending to " + ToString(to) + ": " + ToString(sent));
    }
  }
  ArmSessionTimer(context, outgoing);
}

void SharingActor::Perform(Context& context, SharingActions actions) {
  for (SharingAction& action : actions) {
    const Address to =
        action.to != 0 ? Address{action.to, context.self().actor} : Address{options_.self, actor_name::kStorage};
    (void)context.Send(to, std::move(action.message));
  }
}

void SharingActor::PerformOrders(Context& context, SharingActions actions) {
  for (SharingAction& action : actions) *action.message.mutable_term() = roles_.term();
  Perform(context, std::move(actions));
  ArmOrdersTimer(context);
}

void SharingActor::Arm(Context& context, DeadlineTimer& timer, std::optional<MonotonicTime> deadline,
                       std::uint32_t kind, AgentId peer) {
  if (timer.armed == deadline) return;
  // Keep a timer that is set to an earlier time: one early wake-up costs less than setting the timer again with each
  // message.
  if (timer.armed && deadline && *timer.armed < *deadline) return;
  if (timer.armed) context.Cancel(timer.timer);
  timer.armed = deadline;
  if (deadline) {
    const Duration delay = *deadline > context.now() ? *deadline - context.now() : Duration::zero();
    timer.timer = context.AfterTimer(delay, kind, peer);
  }
}

void SharingActor::ArmSessionTimer(Context& context, Outgoing& outgoing) {
  Arm(context, outgoing.timer, outgoing.session.deadline(), kSession, outgoing.session.destination());
}

void SharingActor::ArmOrdersTimer(Context& context) { Arm(context, orders_timer_, orders_.deadline(), kOrders, 0); }

void SharingActor::DivideBudget(Context& context) {
  if (!radio_share_.is_limited()) return;
  const std::size_t incoming = receiver_->MovingSessions(context.now());
  std::size_t moving = incoming;
  for (const auto& [destination, outgoing] : outgoing_) moving += outgoing.session.is_moving() ? 1 : 0;
  receiver_->SetMovingElsewhere(moving - incoming + radio_share_.moving_elsewhere());
  for (auto& [destination, outgoing] : outgoing_) {
    if (!outgoing.session.is_moving()) continue;
    outgoing.session.SetRate(radio_share_.Part(moving), context.now());
    ArmSessionTimer(context, outgoing);
  }
  // No message arrives when a sender becomes silent, so a timer makes this actor divide the budget again.
  if (incoming > 0 && !is_budget_timer_armed_) {
    (void)context.AfterTimer(kBudgetPeriod, kBudget, 0);
    is_budget_timer_armed_ = true;
  }
  if (radio_share_.MustNotify(moving)) NotifyOfLoad(context, moving);
}

void SharingActor::NotifyOfLoad(Context& context, std::size_t moving) {
  proto::Message load;
  load.set_ms_type(proto::CONTROL);
  load.mutable_sharing_load()->set_moving_sessions(static_cast<std::uint32_t>(moving));
  const char* other = kind_ == proto::SHARING_KIND_SYNC ? actor_name::kReplica : actor_name::kSync;
  const SendResult sent = context.Send({options_.self, other}, std::move(load));
  if (sent != SendResult::kFull) radio_share_.ObserveNotified(moving);
}

}  // namespace moondb
