#include "actors/sharing/replica_actor.h"

#include <algorithm>

#include "model/order_number.h"
#include "model/team_member.h"
#include "model/term.h"
#include "proto/share_status.pb.h"

namespace moondb {
namespace {

// If the asked agent makes no progress for kPatienceMin, the leader asks the next agent. The time doubles whenever
// it expires, up to kPatienceMax, and returns to kPatienceMin when a batch arrives.
constexpr Duration kPatienceMin = std::chrono::minutes(1);
constexpr Duration kPatienceMax = std::chrono::hours(1);

}  // namespace

Result<int> ReplicaActor::Share(Context& context, const proto::ShareRequest& request, bool is_leaders) {
  if (!request.from_agents().empty()) {
    return Fail(ErrorCode::kInvalid,
                "must be empty: only sync collects from agents, replication copies from leader to survivor",
                "from_agents");
  }
  if (request.destination() == self())
    return Fail(ErrorCode::kInvalid, "is this agent itself; name another agent", "destination");
  if (request.destination() != 0) {
    Open(context, request.destination(), proto::RecordFilter(),
         /*is_by_role=*/is_leaders && request.destination() == context.sender().agent, request.bytes_max());
    return 1;
  }
  if (!is_leading()) {
    return Fail(ErrorCode::kRefused,
                NameOf(self()) + " does not lead: send the command to the leader, " + NameOf(roles().leader()));
  }
  if (roles().survivor() == 0) return Fail(ErrorCode::kRefused, "no designated survivor is assigned");
  if (HasLeft(team(), roles().survivor())) {
    return Fail(ErrorCode::kRefused,
                NameOf(roles().survivor()) + " is the designated survivor, but has left the team; assign another one");
  }
  Open(context, roles().survivor(), proto::RecordFilter(), /*is_by_role=*/true, request.bytes_max());
  // An order with a byte limit does not continue with records that are gathered later.
  order_to_bring_on_ = request.bytes_max() == 0 ? order_in_hand() : 0;
  return 1;
}

void ReplicaActor::OnNewRoles(Context& context, const proto::RoleAssignment& previous) {
  if (OrderOf(roles().term()) == OrderOf(previous.term())) return;
  order_to_bring_on_ = 0;
  SetFlow(context);
  BeginGathering(context);
  NotifySyncActor(context);
  if (roles().leader() == previous.leader() && roles().survivor() == previous.survivor()) return;
  const std::optional<std::uint64_t> bytes_left = CloseByRole(context);
  if (bytes_left && is_leading() && roles().survivor() != 0) {
    Open(context, roles().survivor(), proto::RecordFilter(), /*is_by_role=*/true, *bytes_left);
  }
}

void ReplicaActor::SetFlow(const Context& context) {
  const AgentId survivor = roles().survivor();
  const bool is_to_be_served = is_leading() && survivor != 0 && !HasLeft(team(), survivor);
  flow().SetDestinations(is_to_be_served ? std::set{survivor} : std::set<AgentId>(), context.now());
}

void ReplicaActor::OnStored(const proto::RecordsStored& stored) {
  const auto is_shared = [this](std::uint32_t type) {
    return SharePolicyOf(team(), static_cast<DataType>(type)) != proto::POLICY_NONE;
  };
  flow().Note([&](AgentId) { return std::ranges::any_of(stored.data_types(), is_shared); });
}

// --- Gathering by a leader ---

void ReplicaActor::AddStatus(const Context& context, proto::ShareStatus& status) const {
  for (const AgentId agent : to_ask_) {
    status.add_gathers_from(agent);
    if (CanBeAsked(context, agent)) continue;
    proto::LaterGathering& later = *status.add_gathers_later();
    later.set_agent(agent);
    later.set_is_away(!is_connected(agent));
    later.set_why(is_connected(agent) ? WhyWindowIsShut(context, agent) : "is out of reach");
  }
  status.set_gathers_now_from(asked_);
}

bool ReplicaActor::CanBeAsked(const Context& context, AgentId agent) const {
  return is_connected(agent) && IsWindowOpen(context, agent);
}

void ReplicaActor::BeginGathering(Context& context) {
  CancelOrders(context);
  to_ask_.clear();
  refused_.clear();
  orders_to_gather_.clear();
  patience_ = kPatienceMin;
  if (is_leading()) {
    for (const proto::AgentConfig& agent : team().agents()) {
      if (agent.id() == self() || agent.left()) continue;
      if (agent.id() == roles().survivor()) {
        to_ask_.push_front(agent.id());
      } else {
        to_ask_.push_back(agent.id());
      }
    }
  }
  RequestNext(context);
}

void ReplicaActor::RequestNext(Context& context) {
  ++step_;
  const auto next = std::find_if(to_ask_.begin(), to_ask_.end(),
                                 [this, &context](AgentId agent) { return CanBeAsked(context, agent); });
  asked_ = next == to_ask_.end() ? 0 : *next;
  if (asked_ == 0) return;
  orders_to_gather_[asked_] = OrderFrom(context, asked_);
  last_progress_ = context.now();
  StartStepTimer(context, patience_, step_);
}

void ReplicaActor::PassOver(Context& context) {
  CancelOrder(context, asked_);
  std::erase(to_ask_, asked_);
  to_ask_.push_back(asked_);
  RequestNext(context);
}

void ReplicaActor::CrossOff(Context& context, AgentId agent) {
  if (std::erase(to_ask_, agent) == 0) return;
  NotifySyncActor(context);
  if (order_to_bring_on_ != 0) OpenAgain(context, order_to_bring_on_, roles().survivor(), proto::RecordFilter());
  if (agent == asked_) RequestNext(context);
}

void ReplicaActor::OnGathering(Context& context, const proto::Gathering&) { NotifySyncActor(context); }

void ReplicaActor::NotifySyncActor(Context& context) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  proto::Gathering& gathering = *message.mutable_gathering();
  *gathering.mutable_term() = roles().term();
  const std::vector<AgentId> from = *YetToGather();
  *gathering.mutable_from() = {from.begin(), from.end()};
  is_sync_notified_ = context.Send({self(), actor_name::kSync}, std::move(message)) != SendResult::kFull;
}

void ReplicaActor::OnReceived(Context& context, AgentId sender, const Received& received) {
  if (!is_sync_notified_) NotifySyncActor(context);
  patience_ = kPatienceMin;
  if (sender == asked_) last_progress_ = context.now();
  // Only the end of this term's gathering order shows that the sender has sent all records.
  const auto order = orders_to_gather_.find(sender);
  const std::optional<proto::OrderEnd> end = OrderEndBy(sender);
  const bool is_gathered = order != orders_to_gather_.end() && end && HasReached(end->order(), order->second);
  if (!received.is_all || !is_gathered) return;
  if (end->not_taken() > 0) refused_.insert(sender);
  CrossOff(context, sender);
}

void ReplicaActor::OnOrderRefused(Context& context, AgentId peer) {
  if (!orders_to_gather_.contains(peer)) return;
  refused_.insert(peer);
  CrossOff(context, peer);
}

std::optional<std::vector<AgentId>> ReplicaActor::YetToGather() const {
  std::vector<AgentId> agents(to_ask_.begin(), to_ask_.end());
  agents.insert(agents.end(), refused_.begin(), refused_.end());
  return agents;
}

void ReplicaActor::OnStepTimer(Context& context, std::uint64_t step) {
  if (!is_sync_notified_) NotifySyncActor(context);
  if (step != step_ || asked_ == 0) return;
  const Duration quiet = context.now() - last_progress_;
  if (quiet < patience_) {
    StartStepTimer(context, patience_ - quiet, step_);
    return;
  }
  patience_ = std::min(2 * patience_, kPatienceMax);
  PassOver(context);
}

void ReplicaActor::OnPeerEvent(Context& context, AgentId peer) {
  if (!is_sync_notified_) NotifySyncActor(context);
  if (asked_ == 0) return RequestNext(context);
  if (peer == asked_ && !is_connected(peer)) PassOver(context);
}

void ReplicaActor::OnWindowsChanged(Context& context) {
  if (!is_sync_notified_) NotifySyncActor(context);
  if (asked_ == 0) return RequestNext(context);
  if (!IsWindowOpen(context, asked_)) PassOver(context);
}

}  // namespace moondb
