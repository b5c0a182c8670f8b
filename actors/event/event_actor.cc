#include "actors/event/event_actor.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "model/agent_name.h"
#include "model/control_message.h"
#include "model/event.h"
#include "model/term.h"
#include "proto/control.pb.h"
#include "proto/types.pb.h"
#include "runtime/system_status.h"

namespace moondb {

namespace {

constexpr std::uint32_t kPeriod = 1;
constexpr std::size_t kRequestersMax = 64;
constexpr std::size_t kAcknowledgmentsMax = 16;
// Longer than the requester's timeout, so no requester still waits when an acknowledgment is dropped.
constexpr Duration kAcknowledgmentTimeout = std::chrono::minutes(2);

}  // namespace

EventActor::EventActor(Options options)
    : options_(std::move(options)), leases_(options_.team.radio().quiet_while_driving()) {}

void EventActor::OnStart(Context& context) {
  // A restart count above zero means that only this actor restarted, not the agent.
  double restarts = 0;
  for (const proto::ActorStatus& actor : context.GetSystemStatus().actors) {
    if (actor.name() == context.self().actor) restarts = actor.restarts();
  }
  if (restarts == 0) {
    Log(context, proto::EVENT_KIND_STARTED, "started, moondb " + options_.version);
  } else {
    Log(context, proto::EVENT_KIND_RESTART, "the actor event failed and was restarted (moonctl trace)");
  }
  // Start at a random id. A late reply to a request from before a restart then matches no current request.
  next_request_id_ = context.rng()() | 1;
  context.WatchPeers();
  context.Watch(Topic::kRoles);
  context.Watch(Topic::kLeases);
  context.Watch(Topic::kStored);
  OnPeriod(context);
}

void EventActor::OnMessage(Context& context, const proto::Message& message) {
  if (context.sender().agent != options_.self) return;
  switch (message.body_case()) {
    case proto::Message::kTimer:
      return OnPeriod(context);
    case proto::Message::kRolesChanged:
      return OnRoles(context, message.roles_changed().roles());
    case proto::Message::kPeerEvent:
      return OnPeerEvent(context, message.peer_event());
    case proto::Message::kLeasesChanged:
      return leases_.SetAll(message.leases_changed());
    case proto::Message::kRecordsStored:
      if (context.sender().actor == actor_name::kStorage) OnRecordsStored(message.records_stored());
      return;
    case proto::Message::kControlRequest:
      return OnControlRequest(context, message);
    case proto::Message::kControlReply:
      return OnControlReply(context, message);
    case proto::Message::kInsertReply:
      return OnInserted(context, message.request_id(), message.insert_reply());
    default:
      return;
  }
}

void EventActor::OnControlRequest(Context& context, const proto::Message& message) {
  const Result<proto::ControlRequest> request = ControlRequestOf(message);
  if (!request) return;
  if (request->has_status()) OnRequester(context, message.request_id(), std::nullopt);
  if (request->has_acknowledge()) OnRequester(context, message.request_id(), request->acknowledge().until_ns());
}

void EventActor::OnControlReply(Context& context, const proto::Message& message) {
  const Result<proto::ControlReply> reply = ControlReplyOf(message);
  if (!reply) return;
  if (reply->has_share_status()) OnShareStatus(context, context.sender().actor, reply->share_status());
  if (reply->status().has_storage()) OnStorageStatus(context, reply->status().storage());
  if (message.request_id() == findings_request_id_) OnFindings(context, reply->status());
}

// Only the agent that issued an assignment logs it; otherwise each agent would log the same assignment. Term 0, the
// team file's assignment, is not logged.
void EventActor::OnRoles(Context& context, const proto::RoleAssignment& roles) {
  const bool is_new = OrderOf(roles.term()) != OrderOf(roles_.term());
  const bool is_first = roles_.term().number() == 0 && roles_.leader() == 0;
  roles_ = roles;
  // The first assignment that this actor receives is not new: it was in force before the actor started.
  if (!is_new || is_first || roles.term().issuer() != options_.self) return;
  const std::string reason = roles.reason().empty() ? "" : ": " + roles.reason();
  Log(context, proto::EVENT_KIND_ROLES,
      AgentName(options_.team, roles.leader()) + " leads, " + AgentName(options_.team, roles.survivor()) +
          " is the designated survivor, term " + TermText(roles.term()) + reason);
}

void EventActor::OnPeriod(Context& context) {
  (void)context.AfterTimer(options_.period, kPeriod);
  for (const proto::ActorStatus& actor : context.GetSystemStatus().actors) {
    LogRise(context, proto::EVENT_KIND_RESTART, "system", actor.name(), actor.restarts(),
            "failures of the actor " + actor.name() + ", which was restarted (moonctl trace)");
  }
  heard_.insert("system");
  proto::ControlRequest request;
  request.mutable_status();
  Ask(context, actor_name::kStorage, request);
  request.mutable_share_status();
  Ask(context, actor_name::kSync, request);
  Ask(context, actor_name::kReplica, request);
  LogLostPeers(context);
  std::erase_if(acknowledgments_, [&context](const auto& waiting) {
    return context.now() - waiting.second.asked_at > kAcknowledgmentTimeout;
  });
  RequestFindings(context);  // Repeats the request if storage did not answer the last one.
}

void EventActor::OnPeerEvent(Context& context, const proto::PeerEvent& event) {
  const auto agent = static_cast<AgentId>(event.peer());
  const auto known = peers_.find(agent);
  if (!event.is_connected()) {
    if (known == peers_.end() || !std::exchange(known->second.is_connected, false)) return;
    known->second.lost_at = context.now();
    known->second.lost_utc_ns = context.utc_now_ns();
    return;
  }
  Peer& peer = peers_[agent];
  peer.is_connected = true;
  peer.is_back_reported = false;
  if (peer.is_reported) return LogReturn(context, agent, peer, peer.lost_utc_ns);
  LogReturnedPeers(context);
}

void EventActor::LogReturn(Context& context, AgentId agent, Peer& peer, std::int64_t lost_utc_ns) {
  peer.is_reported = false;
  peer.is_back_reported = true;
  const double away_s = static_cast<double>(context.utc_now_ns() - lost_utc_ns) / 1e9;
  LogAt(context, proto::EVENT_KIND_LOST, BackPeerText(AgentName(options_.team, agent), away_s), context.utc_now_ns());
}

// Logs the return of peers whose loss was logged before this actor restarted.
void EventActor::LogReturnedPeers(Context& context) {
  for (const proto::HealthFinding& finding : std::vector(findings_)) {
    for (auto& [agent, peer] : peers_) {
      const bool is_back = peer.is_connected && !peer.is_back_reported;
      if (is_back && SaysLost(finding.text(), AgentName(options_.team, agent))) {
        LogReturn(context, agent, peer, finding.timestamp_ns());
      }
    }
  }
}

void EventActor::LogLostPeers(Context& context) {
  const bool is_silent = leases_.MayBeSilent(options_.self, context.now());
  for (auto& [agent, peer] : peers_) {
    if (peer.is_connected || peer.is_reported) continue;
    if (is_silent || leases_.MayBeSilent(agent, context.now())) {
      // While silence is expected, restart the `lost_after` timeout.
      peer.lost_at = context.now();
      peer.lost_utc_ns = context.utc_now_ns();
      continue;
    }
    const bool was_reported_lately =
        peer.last_reported_at && context.now() - *peer.last_reported_at < options_.lost_again_after;
    if (was_reported_lately || context.now() - peer.lost_at < options_.lost_after) continue;
    peer.is_reported = true;
    peer.last_reported_at = context.now();
    LogAt(context, proto::EVENT_KIND_LOST, LostPeerText(AgentName(options_.team, agent)), peer.lost_utc_ns);
  }
}

void EventActor::OnRecordsStored(const proto::RecordsStored& stored) {
  const auto& types = stored.data_types();
  is_event_stored_ = is_event_stored_ || stored.is_pruned() ||
                     std::find(types.begin(), types.end(), proto::AGENT_EVENT) != types.end();
}

void EventActor::OnRequester(Context& context, std::uint64_t request_id, std::optional<std::int64_t> until_ns) {
  const Requester requester{context.sender(), request_id, until_ns};
  if (std::exchange(is_event_stored_, false)) ++findings_version_;
  if (known_version_ == findings_version_ || requesters_.size() >= kRequestersMax)
    return AnswerRequester(context, requester);
  requesters_.push_back(requester);
  RequestFindings(context);
}

void EventActor::RequestFindings(Context& context) {
  if (known_version_ == findings_version_) return;
  asked_version_ = findings_version_;
  findings_request_id_ = next_request_id_++;
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  message.set_request_id(findings_request_id_);
  message.mutable_findings_request();
  (void)context.Send({options_.self, actor_name::kStorage}, std::move(message));
}

void EventActor::OnFindings(Context& context, const proto::AgentStatus& status) {
  findings_.assign(status.findings().begin(), status.findings().end());
  known_version_ = asked_version_;
  LogReturnedPeers(context);
  // If this reply is outdated, wait for the reply to a newer request, which is in flight or is sent in the next period.
  if (known_version_ != findings_version_) return;
  for (const Requester& requester : std::exchange(requesters_, {})) {
    if (known_version_ == findings_version_) {
      AnswerRequester(context, requester);
    } else {
      requesters_.push_back(requester);  // Answering an earlier requester changed the findings.
    }
  }
}

void EventActor::AnswerRequester(Context& context, const Requester& requester) {
  if (requester.acknowledges_until_ns) return Acknowledge(context, requester);
  proto::ControlReply reply;
  *reply.mutable_status()->mutable_findings() = {findings_.begin(), findings_.end()};
  Reply(context, requester.from, requester.request_id, reply);
}

void EventActor::Acknowledge(Context& context, const Requester& requester) {
  const std::int64_t until_ns = *requester.acknowledges_until_ns;
  proto::ControlReply reply;
  proto::AcknowledgeReply& acknowledged = *reply.mutable_acknowledge();
  const auto count = std::count_if(findings_.begin(), findings_.end(), [until_ns](const proto::HealthFinding& finding) {
    return finding.timestamp_ns() <= until_ns;
  });
  const bool is_full = acknowledgments_.size() >= kAcknowledgmentsMax;
  if (is_full) {
    *acknowledged.mutable_error() =
        ToProto(Error{ErrorCode::kFull, "too many acknowledgments wait to be stored; try again later", {}});
  }
  if (count == 0 || is_full) return Reply(context, requester.from, requester.request_id, reply);
  const std::uint64_t id = next_request_id_++;
  acknowledgments_[id] = {requester.from, requester.request_id, static_cast<std::uint32_t>(count), context.now()};
  proto::Message insert;
  insert.set_ms_type(proto::CONTROL);
  insert.set_request_id(id);
  *insert.mutable_insert_request()->add_records() =
      MakeEvent(proto::EVENT_KIND_ACKNOWLEDGED, AcknowledgedText(until_ns, static_cast<std::size_t>(count)), "",
                context.utc_now_ns());
  // If the send fails, the acknowledgment times out.
  (void)context.Send({options_.self, actor_name::kStorage}, std::move(insert));
  ++findings_version_;
  RequestFindings(context);
}

void EventActor::OnInserted(Context& context, std::uint64_t request_id, const proto::InsertReply& inserted) {
  const auto node = acknowledgments_.extract(request_id);
  if (node.empty()) return;
  proto::ControlReply reply;
  proto::AcknowledgeReply& acknowledged = *reply.mutable_acknowledge();
  if (IsError(inserted.error())) {
    *acknowledged.mutable_error() = inserted.error();
  } else {
    acknowledged.set_count(node.mapped().count);
  }
  Reply(context, node.mapped().from, node.mapped().request_id, reply);
}

void EventActor::Reply(Context& context, const Address& to, std::uint64_t request_id,
                       const proto::ControlReply& reply) {
  proto::Message message = MessageOf(reply);
  message.set_request_id(request_id);
  (void)context.Send(to, std::move(message));
}

void EventActor::OnStorageStatus(Context& context, const proto::StorageStatus& status) {
  LogRise(context, proto::EVENT_KIND_REJECTED, actor_name::kStorage, "rejected", status.rejected_count(),
          "records were refused by storage");
  heard_.insert(actor_name::kStorage);
}

void EventActor::OnShareStatus(Context& context, const std::string& actor, const proto::ShareStatus& status) {
  LogRise(context, proto::EVENT_KIND_REJECTED, actor, "records", status.rejected_records(),
          "records from peers were refused");
  LogRise(context, proto::EVENT_KIND_REJECTED, actor, "messages", status.damaged_messages(),
          "messages from peers were damaged");
  LogRise(context, proto::EVENT_KIND_REJECTED, actor, "hellos", status.refused_hellos(),
          "requests to open a sharing session were refused (another team, version or kind of sharing)");
  std::set<AgentId>& refusing = refusing_[actor];
  const std::set<AgentId> before = std::exchange(refusing, {status.refusing().begin(), status.refusing().end()});
  for (const proto::ShareSession& session : status.sessions()) {
    const auto destination = static_cast<AgentId>(session.destination());
    const std::string to = AgentName(options_.team, destination);
    if (refusing.contains(destination) && !before.contains(destination)) {
      Log(context, proto::EVENT_KIND_SHARING,
          to + " does not accept all records; the others wait to be sent again: " + session.last_error());
    }
    // A destination may also leave `refusing` because the roles have changed.
    if (before.contains(destination) && !refusing.contains(destination) && session.last_error().empty()) {
      Log(context, proto::EVENT_KIND_SHARING, to + " accepts records again");
    }
    const std::string why = session.last_error().empty() ? "" : ": " + session.last_error();
    LogRise(context, proto::EVENT_KIND_SHARING, actor, "to " + to, session.closed_sessions(),
            "sharing sessions to " + to + " ended before all records were acknowledged" + why);
  }
  heard_.insert(actor);
}

void EventActor::Ask(Context& context, const std::string& actor, const proto::ControlRequest& request) const {
  // If the actor is busy or missing, the next period asks again.
  (void)context.Send({options_.self, actor}, MessageOf(request));
}

void EventActor::LogRise(Context& context, proto::EventKind kind, const std::string& source, const std::string& counter,
                         double count, const std::string& text) {
  double& reported = counts_.try_emplace({source, counter}, heard_.contains(source) ? 0 : count).first->second;
  // A counter that fell was reset to zero by a restart of its actor.
  const double before = std::exchange(reported, count);
  const double rise = count < before ? count : count - before;
  if (rise >= 1) Log(context, kind, std::to_string(std::llround(rise)) + " " + text);
}

void EventActor::Log(Context& context, proto::EventKind kind, const std::string& text) {
  LogAt(context, kind, text, context.utc_now_ns());
}

void EventActor::LogAt(Context& context, proto::EventKind kind, const std::string& text, std::int64_t timestamp_ns) {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  *message.mutable_insert_request()->add_records() = MakeEvent(kind, text, "", timestamp_ns);
  (void)context.Send({options_.self, actor_name::kStorage}, std::move(message));
  if (kind != proto::EVENT_KIND_LOST) return;
  ++findings_version_;
  RequestFindings(context);
}

}  // namespace moondb
