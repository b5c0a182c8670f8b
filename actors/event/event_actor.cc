#include "actors/event/event_actor.h"

#include <cmath>
#include <utility>

#include "model/agent_name.h"
#include "model/event.h"
#include "model/term.h"

namespace moondb {

namespace {

constexpr std::uint32_t kPeriod = 1;

}  // namespace

void EventActor::OnStart(Context& context) {
  // An actor that is made anew begins its life with no counts; its agent did not start again.
  double restarts = 0;
  for (const proto::ActorStatus& actor : context.GetSystemStatus().actors) {
    if (actor.name() == context.self().actor) restarts = actor.restarts();
  }
  if (restarts == 0) {
    Tell(context, proto::EVENT_KIND_STARTED, "started, moondb " + options_.version);
  } else {
    Tell(context, proto::EVENT_KIND_RESTART, "the actor event failed, and was made anew (moonctl trace)");
  }
  OnPeriod(context);
}

void EventActor::OnMessage(Context& context, const proto::Message& message) {
  if (context.sender().agent != options_.self) return;
  switch (message.body_case()) {
    case proto::Message::kTimer:
      return OnPeriod(context);
    case proto::Message::kRolesChanged:
      return OnRoles(context, message.roles_changed().roles());
    case proto::Message::kStorageStatus:
      return OnStorageStatus(context, message.storage_status());
    case proto::Message::kShareStatus:
      return OnShareStatus(context, context.sender().actor, message.share_status());
    default:
      return;
  }
}

// Who issued the assignment tells it; the others would say the same again. The one of term 0 is the team file's.
void EventActor::OnRoles(Context& context, const proto::RoleAssignment& roles) {
  const bool is_new = OrderOf(roles.term()) != OrderOf(roles_.term());
  const bool is_first = roles_.term().number() == 0 && roles_.leader() == 0;
  roles_ = roles;
  // The first one heard is what the agent had before it started.
  if (!is_new || is_first || roles.term().issuer() != options_.self) return;
  const std::string reason = roles.reason().empty() ? "" : ": " + roles.reason();
  Tell(context, proto::EVENT_KIND_ROLES,
       AgentName(options_.team, roles.leader()) + " leads, " + AgentName(options_.team, roles.survivor()) +
           " is the designated survivor, term " + std::to_string(roles.term().number()) + reason);
}

void EventActor::OnPeriod(Context& context) {
  (void)context.AfterTimer(options_.period, kPeriod);
  for (const proto::ActorStatus& actor : context.GetSystemStatus().actors) {
    TellRise(context, proto::EVENT_KIND_RESTART, "system", actor.name(), actor.restarts(),
             "failures of the actor " + actor.name() + ", which was made anew (moonctl trace)");
  }
  heard_.insert("system");
  proto::Message message;
  message.mutable_storage_status_request();
  Ask(context, actor_name::kStorage, message);
  message.mutable_share_status_request();
  Ask(context, actor_name::kSync, message);
  Ask(context, actor_name::kReplica, std::move(message));
}

void EventActor::OnStorageStatus(Context& context, const proto::StorageStatus& status) {
  TellRise(context, proto::EVENT_KIND_REJECTED, actor_name::kStorage, "rejected", status.rejected_count(),
           "records were refused by storage");
  heard_.insert(actor_name::kStorage);
}

void EventActor::OnShareStatus(Context& context, const std::string& actor, const proto::ShareStatus& status) {
  TellRise(context, proto::EVENT_KIND_REJECTED, actor, "records", status.rejected_records(),
           "records from peers were refused");
  TellRise(context, proto::EVENT_KIND_REJECTED, actor, "messages", status.damaged_messages(),
           "messages from peers were damaged");
  TellRise(context, proto::EVENT_KIND_REJECTED, actor, "hellos", status.refused_hellos(),
           "beginnings of sharing were refused (another team, version or kind)");
  for (const proto::ShareSession& session : status.sessions()) {
    const std::string to = AgentName(options_.team, session.destination());
    const std::string why = session.last_error().empty() ? "" : ": " + session.last_error();
    TellRise(context, proto::EVENT_KIND_SHARING, actor, "to " + to, session.closed_sessions(),
             "sharings to " + to + " ended before all was acknowledged" + why);
  }
  heard_.insert(actor);
}

void EventActor::Ask(Context& context, const std::string& actor, proto::Message message) const {
  message.set_ms_type(proto::CONTROL);
  // Busy or missing: the next period asks again.
  (void)context.Send({options_.self, actor}, std::move(message));
}

void EventActor::TellRise(Context& context, proto::EventKind kind, const std::string& source,
                          const std::string& counter, double count, const std::string& text) {
  double& told = counts_.try_emplace({source, counter}, heard_.contains(source) ? 0 : count).first->second;
  // One that fell was made anew with what it counts.
  const double before = std::exchange(told, count);
  const double rise = count < before ? count : count - before;
  if (rise >= 1) Tell(context, kind, std::to_string(std::llround(rise)) + " " + text);
}

void EventActor::Tell(Context& context, proto::EventKind kind, const std::string& text) const {
  proto::Message message;
  message.set_ms_type(proto::CONTROL);
  *message.mutable_insert_request()->add_records() = MakeEvent(kind, text, "", context.utc_now_ns());
  (void)context.Send({options_.self, actor_name::kStorage}, std::move(message));
}

}  // namespace moondb
