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

std::vector<std::string> ShareStatusHeader() {
  return {"FROM", "TO",  "STATE",     "SENT",    "ACKNOWLEDGED", "LEFT",      "CODED",
          "RATE", "ETA", "QUIET FOR", "RESENDS", "SESSIONS",     "LAST ERROR"};
}

std::vector<std::string> ShareStatusRow(const proto::TeamConfig& team, const std::string& sender,
                                        const proto::ShareSession& session) {
  const SharePace pace = PaceOf(session);
  return {sender,
          AgentName(team, session.destination()),
          StateOf(session),
          FormatCount(session.sent_records()),
          FormatCount(session.acknowledged_records()),
          session.is_remaining_known() ? FormatCount(session.remaining()) : kUnknown,
          FormatBytes(session.coded_bytes()),
          pace.bytes_per_s ? FormatBytes(*pace.bytes_per_s) + "/s" : kUnknown,
          pace.eta_s ? FormatSeconds(*pace.eta_s) : kUnknown,
          FormatSeconds(session.seconds_since_progress()),
          FormatCount(session.resends()),
          FormatCount(session.completed_sessions()),
          session.last_error()};
}

}  // namespace moondb
