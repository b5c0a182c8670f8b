#include "apps/moonctl/share_status.h"

#include "apps/common/table.h"
#include "apps/common/team_clients.h"

namespace moondb {
namespace {

constexpr char kUnknown[] = "-";

std::string StateOf(const proto::ShareSession& session) {
  if (!session.waits_for().empty()) return "waits: " + session.waits_for();
  if (!session.is_open()) return "idle";
  return session.is_remaining_known() ? "sending" : "waiting";
}

}  // namespace

SharePace PaceOf(const proto::ShareSession& session) {
  SharePace pace;
  if (session.session_s() <= 0 || session.session_acknowledged_records() <= 0) return pace;
  pace.bytes_per_s = session.session_acknowledged_bytes() / session.session_s();
  if (session.is_remaining_known()) {
    pace.eta_s = session.remaining() * session.session_s() / session.session_acknowledged_records();
  }
  return pace;
}

std::optional<double> LeftOf(const proto::AgentStatus* status, const proto::ShareSession& session) {
  if (session.is_open() && session.is_remaining_known()) return session.remaining();
  const bool is_replication = session.kind() == proto::SHARING_KIND_REPLICATION;
  const bool is_known = status != nullptr && (is_replication || session.destination() == status->roles().leader());
  if (!is_known) return std::nullopt;
  for (const proto::PeerBacklog& backlog : status->storage().backlogs()) {
    if (backlog.agent_id() == session.destination()) return is_replication ? backlog.all_count() : backlog.own_count();
  }
  return std::nullopt;
}

std::vector<std::string> ShareStatusHeader() {
  return {"FROM", "TO",  "STATE",     "SENT",    "ACKNOWLEDGED", "LEFT",     "CODED",
          "RATE", "ETA", "QUIET FOR", "RESENDS", "SESSIONS",     "LAST END", "LAST ERROR"};
}

std::vector<std::string> ShareStatusRow(const proto::TeamConfig& team, const std::string& sender,
                                        const proto::ShareSession& session, std::optional<double> left) {
  const SharePace pace = PaceOf(session);
  return {sender,
          AgentName(team, session.destination()),
          StateOf(session),
          FormatCount(session.sent_records()),
          FormatCount(session.acknowledged_records()),
          left ? FormatCount(*left) : kUnknown,
          FormatBytes(session.coded_bytes()),
          pace.bytes_per_s ? FormatBytes(*pace.bytes_per_s) + "/s" : kUnknown,
          pace.eta_s ? FormatSeconds(*pace.eta_s) : kUnknown,
          FormatSeconds(session.seconds_since_progress()),
          FormatCount(session.resends()),
          FormatCount(session.completed_sessions()),
          session.last_end_case() == proto::ShareSession::kSecondsSinceEnd
              ? FormatSeconds(session.seconds_since_end()) + " ago"
              : kUnknown,
          session.last_error()};
}

}  // namespace moondb
