#include "actors/sharing/sync_actor.h"

#include <algorithm>
#include <utility>

#include "model/data_types.h"
#include "model/team_member.h"
#include "model/term.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

// Values of OnStepTimer's `step`.
constexpr std::uint64_t kShareStates = 0;
constexpr std::uint64_t kBringOn = 1;

// Records of agents that finish within this time go on to the others together.
constexpr Duration kBringOnAfter = std::chrono::seconds(1);

// Adds the types that a policy shares to the list of `add_type`. The records of a type are limited to the newest if the
// policy asks for less than `share`.
void AddTypes(const proto::TeamConfig& team, proto::Policy (*policy_of)(const proto::TeamConfig&, DataType),
              void (proto::RecordFilter::*add_type)(std::uint32_t), proto::RecordFilter& filter) {
  for (const DataType type : DataTypesOf(team)) {
    const proto::Policy policy = policy_of(team, type);
    if (policy == proto::POLICY_NONE) continue;
    (filter.*add_type)(type);
    if (policy == proto::POLICY_LATEST && SharePolicyOf(team, type) == proto::POLICY_ALL) {
      filter.add_newest_only_types(type);
    }
  }
}

}  // namespace

proto::RecordFilter GroundRecords(const proto::TeamConfig& team) {
  proto::RecordFilter filter;
  AddTypes(team, GroundPolicyOf, &proto::RecordFilter::add_data_types, filter);
  return filter;
}

Result<int> SyncActor::Share(Context& context, const proto::ShareRequest& request, bool is_leaders) {
  if (!is_from_here(context)) {
    const AgentId requester = context.sender().agent;
    const AgentId destination = request.destination() == 0 ? requester : request.destination();
    if (destination == self())
      return Fail(ErrorCode::kInvalid, "is this agent itself; name another agent", "destination");
    Open(context, destination, OwnRecords(), /*is_by_role=*/is_leaders && destination == requester,
         request.bytes_max());
    return 1;
  }
  if (is_leading()) {
    if (request.destination() == 0 || request.destination() == self()) return Collect(context, request);
    OpenAsLeader(context, request.destination(), /*is_by_role=*/false, request.bytes_max());
    return 1;
  }
  if (!request.from_agents().empty()) {
    return Fail(ErrorCode::kRefused,
                "only the leader, " + NameOf(roles().leader()) + ", collects from other agents: send the command there",
                "from_agents");
  }
  if (roles().leader() == 0) return Fail(ErrorCode::kRefused, "the team has no leader now", "destination");
  if (request.destination() == 0 && HasLeft(team(), roles().leader())) {
    return Fail(ErrorCode::kRefused,
                NameOf(roles().leader()) + " is the leader, but has left the team; assign another one", "destination");
  }
  if (request.destination() == self())
    return Fail(ErrorCode::kInvalid, "is this agent itself; name another agent", "destination");
  const AgentId destination = request.destination() == 0 ? roles().leader() : request.destination();
  Open(context, destination, OwnRecords(), /*is_by_role=*/request.destination() == 0, request.bytes_max());
  return 1;
}

void SyncActor::OnNewRoles(Context& context, const proto::RoleAssignment& previous) {
  SetFlow(context);
  if (OrderOf(roles().term()) != OrderOf(previous.term())) collecting_order_ = 0;
  if (roles().leader() == previous.leader()) return;
  CancelOrders(context);
  is_bringing_on_ = false;
  lacking_.clear();
  collecting_order_ = 0;
  const bool was_leading = previous.leader() == self();
  const std::optional<std::uint64_t> bytes_left = CloseByRole(context);
  if (bytes_left && !was_leading && !is_leading() && roles().leader() != 0) {
    Open(context, roles().leader(), OwnRecords(), /*is_by_role=*/true, *bytes_left);
  }
}

void SyncActor::OnReceived(Context& context, AgentId sender, const Received& received) {
  if (!is_bringing_on_) return;
  for (const proto::AgentConfig& agent : team().agents()) {
    if (agent.id() == self() || agent.id() == sender || agent.left()) continue;
    const auto is_wanted = [&](DataType type) { return IsForAll(agent.id(), type); };
    if (std::ranges::any_of(received.types, is_wanted)) lacking_.insert(agent.id());
  }
  if (!received.is_all) return;
  if (is_any_order_open()) return ForwardSoon(context);
  Forward(context);
}

// An agent that is lost in the middle of its records may have brought in some.
void SyncActor::OnPeerEvent(Context& context, AgentId) { ForwardSoon(context); }

void SyncActor::ForwardSoon(Context& context) {
  if (lacking_.empty() || std::exchange(is_bring_timer_running_, true)) return;
  StartStepTimer(context, kBringOnAfter, kBringOn);
}

void SyncActor::Forward(Context& context) {
  for (const AgentId destination : std::exchange(lacking_, {})) {
    OpenAgain(context, collecting_order_, destination, LeadersRecordsFor(destination));
  }
}

bool SyncActor::IsForAll(AgentId destination, DataType type) const {
  if (destination == BaseStationOf(team())) return GroundPolicyOf(team(), type) != proto::POLICY_NONE;
  const DataTypeRow* row = FindDataType(type);
  return RoversPolicyOf(team(), type) != proto::POLICY_NONE ||
         (row != nullptr && row->leader_sends == LeaderSends::kToAllRovers);
}

void SyncActor::OnGathering(Context& context, const proto::Gathering& gathering) {
  const bool is_of_same_term = gathering_ && OrderOf(gathering_->term()) == OrderOf(gathering.term());
  const bool is_any_done = !is_of_same_term || gathering_->from_size() > gathering.from_size();
  gathering_ = gathering;
  if (!is_any_done || collecting_order_ == 0 || !is_leading()) return;
  for (const proto::AgentConfig& agent : team().agents()) {
    if (agent.id() == self() || agent.left()) continue;
    OpenAgain(context, collecting_order_, agent.id(), LeadersRecordsFor(agent.id()));
  }
}

// ReplicaActor receives a new term a little earlier or later than this actor, so ignore a report about another term.
std::optional<std::vector<AgentId>> SyncActor::YetToGather() const {
  if (!gathering_ || OrderOf(gathering_->term()) != OrderOf(roles().term())) return std::nullopt;
  return std::vector<AgentId>(gathering_->from().begin(), gathering_->from().end());
}

int SyncActor::Collect(Context& context, const proto::ShareRequest& request) {
  const auto& from = request.from_agents();
  const auto is_meant = [&from](AgentId agent) {
    return from.empty() || std::find(from.begin(), from.end(), agent) != from.end();
  };
  // An order with a byte limit does not continue when more records arrive.
  const bool is_limited = request.bytes_max() != 0;
  if (is_meant(self()) || is_limited) {
    collecting_order_ = is_limited ? 0 : order_in_hand();
    is_bringing_on_ = !is_limited;
    lacking_.clear();
  }
  int count = 0;
  for (const proto::AgentConfig& agent : team().agents()) {
    if (agent.id() == self() || agent.left()) continue;
    if (is_meant(agent.id())) {
      OrderFrom(context, agent.id(), request.bytes_max());
      ++count;
    }
    if (is_meant(self())) {
      OpenAsLeader(context, agent.id(), /*is_by_role=*/true, request.bytes_max());
      ++count;
    }
  }
  return count;
}

void SyncActor::OpenAsLeader(Context& context, AgentId destination, bool is_by_role, std::uint64_t bytes_max) {
  Open(context, destination, LeadersRecordsFor(destination), is_by_role, bytes_max);
}

void SyncActor::SetFlow(const Context& context) {
  std::set<AgentId> destinations;
  for (const proto::AgentConfig& agent : team().agents()) {
    const bool is_to_be_served =
        is_leading() ? agent.id() != self() && agent.id() != roles().survivor() : agent.id() == roles().leader();
    if (is_to_be_served && !agent.left()) destinations.insert(agent.id());
  }
  flow().SetDestinations(destinations, context.now());
}

void SyncActor::OnStored(const proto::RecordsStored& stored) {
  const auto is_shared = [this](std::uint32_t type) {
    return SharePolicyOf(team(), static_cast<DataType>(type)) != proto::POLICY_NONE;
  };
  const auto is_for_agent_named = [](std::uint32_t type) {
    const DataTypeRow* row = FindDataType(static_cast<DataType>(type));
    return row != nullptr && row->leader_sends == LeaderSends::kToAgentNamed;
  };
  flow().Note([&](AgentId destination) {
    if (!is_leading()) return std::ranges::any_of(stored.own_data_types(), is_shared);
    return std::ranges::any_of(stored.own_data_types(), is_for_agent_named) ||
           std::ranges::any_of(stored.data_types(),
                               [&](std::uint32_t type) { return IsForAll(destination, static_cast<DataType>(type)); });
  });
}

proto::RecordFilter SyncActor::FlowRecordsFor(AgentId destination) const {
  return is_leading() ? LeadersRecordsFor(destination) : OwnRecords();
}

void SyncActor::OnStarted(Context& context) {
  SetFlow(context);
  StartStatesTimer(context);
  proto::Message question;
  question.set_ms_type(proto::CONTROL);
  question.mutable_gathering();
  // If ReplicaActor has not started yet, this question is lost, but ReplicaActor later sends an unsolicited report.
  (void)context.Send({self(), actor_name::kReplica}, std::move(question));
}

void SyncActor::StartStatesTimer(Context& context) {
  const double period_s = team().radio().states_period_s();
  if (period_s <= 0) return;
  StartStepTimer(context, std::chrono::duration_cast<Duration>(std::chrono::duration<double>(period_s)), kShareStates);
}

void SyncActor::OnStepTimer(Context& context, std::uint64_t step) {
  if (step == kBringOn) {
    is_bring_timer_running_ = false;
    return Forward(context);
  }
  StartStatesTimer(context);
  const AgentId leader = roles().leader();
  if (leader != 0 && leader != self() && is_connected(leader)) SharePeriodicStates(context, leader);
}

proto::RecordFilter SyncActor::OwnRecords() const {
  proto::RecordFilter filter;
  filter.add_origin_agents(self());
  filter.add_everyones_types(proto::ROLE_ASSIGNMENT);  // The destination may lack assignments of any issuer.
  return filter;
}

proto::RecordFilter SyncActor::LeadersRecordsFor(AgentId destination) const {
  const bool is_base = destination == BaseStationOf(team());
  proto::RecordFilter filter = is_base ? GroundRecords(team()) : proto::RecordFilter();
  filter.set_own_records_of(destination);
  if (!is_base) {
    filter.add_origin_agents(self());
    filter.set_optimized_poses_of_agent(destination);
    AddTypes(team(), RoversPolicyOf, &proto::RecordFilter::add_everyones_types, filter);
    for (const DataTypeRow& row : DataTypeRows()) {
      // Role assignments are sent under every policy: they decide which records are accepted.
      const bool is_shared = row.rank == ShareRank::kRoles || SharePolicyOf(team(), row.type) != proto::POLICY_NONE;
      if (!is_shared) continue;
      if (row.leader_sends == LeaderSends::kToAgentNamed) filter.add_data_types(row.type);
      if (row.leader_sends == LeaderSends::kToAllRovers) filter.add_everyones_types(row.type);
    }
  }
  // An empty list of types means "all types" to storage, so restrict the filter to the destination's own records.
  if (filter.data_types().empty()) {
    filter.clear_origin_agents();
    filter.add_origin_agents(destination);
  }
  return filter;
}

}  // namespace moondb
