#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "apps/common/json_writer.h"
#include "apps/common/progress.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/health.h"
#include "apps/moonctl/pause_command.h"
#include "apps/moonctl/share_status.h"
#include "client/orders.h"
#include "model/term.h"

namespace moondb {
namespace {

constexpr std::chrono::minutes kLeaseMargin(2);  // Value of Client::ShareOptions::lease_margin without --timeout.

struct ShareArguments {
  std::vector<std::string> from;
  std::uint64_t bytes_max = 0;
  bool is_waiting = false;
};

const char* KindName(proto::SharingKind kind) {
  return kind == proto::SHARING_KIND_REPLICATION ? "replication" : "sync";
}

Result<proto::ShareRequest> MakeRequest(CommandContext& context, proto::SharingKind kind,
                                        const ShareArguments& arguments) {
  proto::ShareRequest request;
  request.set_kind(kind);
  request.set_bytes_max(arguments.bytes_max);
  auto team = context.Team();
  if (!team) return tl::unexpected(team.error());
  for (const std::string& name : arguments.from) {
    auto agent = MemberNamed((*team)->config, name);
    if (!agent) return tl::unexpected(agent.error());
    request.add_from_agents((*agent)->id());
  }
  return request;
}

std::string Joined(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

// Connects to the agent given with -a, otherwise to the leader in the newest assignment that any agent reports. Sets
// the expected term of `request` to the connected agent's term. Returns kRefused if the leader's term differs from the
// term of the newest assignment.
Result<AgentClient> ConnectToAct(CommandContext& context, proto::ShareRequest& request) {
  std::optional<proto::RoleAssignment> newest;
  if (context.agent.empty()) {
    auto roles = context.Roles();
    if (!roles) return tl::unexpected(roles.error());
    newest = *roles;
  }
  auto connected = newest ? context.ConnectToLeaderOf(*newest) : context.Connect(context.agent);
  if (!connected) return connected;
  auto held = connected->client->Roles();
  if (!held) return tl::unexpected(held.error());
  if (newest && OrderOf(held->roles().term()) != OrderOf(newest->term())) {
    const proto::TeamConfig& team = (*context.Team())->config;
    return Fail(ErrorCode::kRefused,
                connected->agent->name() + " acts on term " + IssuedTermText(team, held->roles().term()) +
                    ", but another agent knows term " + IssuedTermText(team, newest->term()),
                "expected_term");
  }
  *request.mutable_expected_term() = held->roles().term();
  return connected;
}

// --- Results of an order ---

// `asked` is the agent that executes an order of kind `kind`. Returns true if the pair sends records to `asked` so that
// `asked` can pass them on. In a sync, these are all pairs of kind replication. In a replication, these are the pairs
// with the destination `asked`.
bool IsGathering(const proto::PairProgress& pair, proto::SharingKind kind, AgentId asked) {
  return pair.kind() == proto::SHARING_KIND_REPLICATION &&
         (kind == proto::SHARING_KIND_SYNC || pair.destination() == asked);
}

// Returns the agent of the pair that is not `asked`.
AgentId OtherEnd(const proto::PairProgress& pair, AgentId asked) {
  return static_cast<AgentId>(pair.sender() == asked ? pair.destination() : pair.sender());
}

// Lists the incomplete pairs: "rover1 to rover2 (rover2 drives for 38 s more), rover3 to rover1 (408 records left)".
std::string MissingText(const proto::TeamConfig& team, const proto::ShareProgress& progress) {
  std::vector<std::string> pairs;
  for (const proto::PairProgress& pair : progress.pairs()) {
    if (pair.is_complete()) continue;
    const bool is_known = pair.is_missing_known() && pair.missing() > 0;
    const std::string left = is_known ? FormatCount(pair.missing(), "record") + " left" : "";
    const std::string& detail = pair.why().empty() ? left : pair.why();
    pairs.push_back(AgentName(team, pair.sender()) + " to " + AgentName(team, pair.destination()) +
                    (detail.empty() ? "" : " (" + detail + ")"));
  }
  return Joined(pairs);
}

// Shows the progress of an order: "408 records left, 12.3 kB sent, about 4 s left, 0 of 6 sessions complete, rover2
// drives for 38 s more".
class ShareProgressLine {
 public:
  ShareProgressLine(const proto::TeamConfig& team, proto::SharingKind kind, AgentId asked)
      : team_(team), kind_(kind), asked_(asked) {}

  void Show(const proto::ShareProgress& progress) {
    double left = 0;
    double missing = 0;
    double coded_bytes = 0;
    int complete = 0;
    int sessions = 0;
    std::string waits_for;
    for (const proto::PairProgress& pair : progress.pairs()) {
      const bool is_gathering = IsGathering(pair, kind_, asked_);
      sessions += is_gathering ? 0 : 1;
      complete += pair.is_complete() && !is_gathering ? 1 : 0;
      coded_bytes += pair.coded_bytes();
      if (pair.is_complete() || pair.is_stopped()) continue;
      missing += pair.missing();
      left += pair.missing() + 1;
      if (waits_for.empty()) waits_for = is_gathering ? "gathers from " + AgentName(team_, pair.sender()) : pair.why();
    }
    const auto now = std::chrono::steady_clock::now();
    if (left > most_left_) {
      most_left_ = left;
      since_ = now;
    }
    const double gone = most_left_ - left;
    const double passed_s = std::chrono::duration<double>(now - since_).count();
    const double eta_s = gone > 0 ? passed_s * left / gone : 0;
    line_.Show(gone, most_left_,
               FormatCount(missing, "record") + " left, " + FormatBytes(coded_bytes) + " sent" +
                   (eta_s >= 1 ? ", about " + FormatSeconds(eta_s) + " left" : "") + ", " + std::to_string(complete) +
                   " of " + std::to_string(sessions) + " sessions complete" +
                   (waits_for.empty() ? "" : ", " + waits_for));
  }

 private:
  const proto::TeamConfig& team_;
  const proto::SharingKind kind_;
  const AgentId asked_;
  Progress line_{"sharing"};
  double most_left_ = 0;
  std::chrono::steady_clock::time_point since_ = std::chrono::steady_clock::now();
};

// The output of `sync now --wait` or `replicate now --wait` for a finished order.
class SharedReport {
 public:
  SharedReport(const proto::TeamConfig& team, proto::SharingKind kind, const proto::AgentConfig& asked,
               const proto::ShareProgress& progress)
      : team_(team), kind_(kind), asked_(asked), progress_(progress) {
    for (const proto::PairProgress& pair : progress.pairs()) {
      const std::string name = AgentName(team, OtherEnd(pair, asked.id()));
      const bool is_gathering = IsGathering(pair, kind, asked.id());
      session_count_ += is_gathering ? 0 : 1;
      complete_count_ += pair.is_complete() && !is_gathering ? 1 : 0;
      if (pair.is_complete()) continue;
      if (is_gathering) {
        not_gathered_.emplace_back(name, pair.why());
      } else if (pair.is_out_of_reach()) {
        unreachable_.insert(name);
      } else {
        is_limited_ = is_limited_ || pair.is_limited();
        is_failed_ = is_failed_ || !pair.is_limited();
      }
    }
  }

  // Returns true if a connected destination still lacks records for any reason other than the order's byte limit.
  bool is_failed() const { return is_failed_; }
  ExitCode exit_code() const {
    return unreachable_.empty() && not_gathered_.empty() ? ExitCode::kDone : ExitCode::kUnreachable;
  }

  std::string Json() const {
    JsonWriter json;
    json.BeginObject().Key("agent").String(asked_.name()).Key("kind").String(KindName(kind_));
    json.Key("session_count").Number(session_count_);
    json.Key("is_acknowledged").Bool(!is_failed_ && !is_limited_ && unreachable_.empty());
    json.Key("unreachable").BeginArray();
    for (const std::string& name : unreachable_) json.String(name);
    json.EndArray().Key("not_gathered").BeginArray();
    for (const auto& [name, why] : not_gathered_) {
      json.BeginObject().Key("agent").String(name).Key("why").String(why).EndObject();
    }
    json.EndArray().Key("progress").Raw(ToJson(progress_)).EndObject();
    return json.text();
  }

  std::string Text() const {
    std::string text = std::string(KindName(kind_)) + " at " + asked_.name() + ": ";
    const std::string unreachable = Joined({unreachable_.begin(), unreachable_.end()}) + " (out of reach)";
    if (complete_count_ == 0 && !unreachable_.empty()) return text + "no records are exchanged with " + unreachable;
    text += is_limited_ ? "all records up to the limit are acknowledged, and more are left"
                        : "all records are acknowledged";
    if (!unreachable_.empty()) text += ", but no records are exchanged with " + unreachable;
    std::vector<std::string> others;
    for (const auto& [name, why] : not_gathered_) {
      if (!unreachable_.contains(name)) others.push_back(name + " (" + why + ")");
    }
    if (!others.empty()) text += "; missing are records held only by " + Joined(others);
    return text;
  }

 private:
  const proto::TeamConfig& team_;
  const proto::SharingKind kind_;
  const proto::AgentConfig& asked_;
  const proto::ShareProgress& progress_;
  int session_count_ = 0;
  int complete_count_ = 0;
  bool is_limited_ = false;
  bool is_failed_ = false;
  std::set<std::string> unreachable_;
  std::vector<std::pair<std::string, std::string>> not_gathered_;
};

ExitCode ReportStarted(CommandContext& context, proto::SharingKind kind, const proto::AgentConfig& asked,
                       const proto::ShareReply& reply) {
  JsonWriter json;
  json.BeginObject().Key("agent").String(asked.name()).Key("kind").String(KindName(kind));
  json.Key("session_count").Number(reply.session_count()).Key("is_acknowledged").Bool(false);
  json.Key("unreachable").BeginArray().EndArray().Key("not_gathered").BeginArray().EndArray().EndObject();
  return context.Done(json.text(), std::string(KindName(kind)) + " at " + asked.name() +
                                       ": started; watch it with moonctl " +
                                       (kind == proto::SHARING_KIND_SYNC ? "sync" : "replicate") + " status");
}

ExitCode ShareNow(CommandContext& context, proto::SharingKind kind, const ShareArguments& arguments) {
  const auto request = MakeRequest(context, kind, arguments);
  if (!request) return context.Report(request.error());
  std::optional<AgentClient> asked;
  const ConnectToShare connect = [&](proto::ShareRequest& given) -> Result<Client*> {
    auto connected = ConnectToAct(context, given);
    if (!connected) return tl::unexpected(connected.error());
    asked = *std::move(connected);
    return asked->client.get();
  };
  if (!arguments.is_waiting) {
    const auto started = ShareAtOnce(connect, *request);
    return started ? ReportStarted(context, kind, *asked->agent, *started) : context.Report(started.error());
  }
  const proto::TeamConfig& team = (*context.Team())->config;
  std::optional<ShareProgressLine> line;
  Client::ShareOptions options;
  options.limit = context.WaitTimeout();
  options.lease_margin = context.has_timeout() ? std::chrono::minutes(0) : kLeaseMargin;
  options.on_progress = [&](const proto::ShareProgress& progress) {
    if (!line) line.emplace(team, kind, asked->agent->id());
    line->Show(progress);
  };
  const auto progress = ShareUntilDone(connect, *request, options);
  line.reset();
  if (!progress) return context.Report(progress.error());
  const SharedReport report(team, kind, *asked->agent, *progress);
  if (!progress->is_over()) {
    return context.Report(
        {ErrorCode::kTimedOut, "not all records were acknowledged in time: " + MissingText(team, *progress), {}});
  }
  if (report.is_failed()) {
    return context.Report(
        {ErrorCode::kUnavailable,
         "ended before all records were acknowledged: " + MissingText(team, *progress) + "; run the command again",
         {}});
  }
  return context.Print(report.exit_code(), report.Json(), report.Text());
}

void WriteSession(const proto::TeamConfig& team, const proto::ShareSession& session, std::optional<double> left,
                  JsonWriter& json) {
  const SharePace pace = PaceOf(session);
  json.BeginObject().Key("to").String(AgentName(team, session.destination()));
  json.Key("bytes_per_s").Number(pace.bytes_per_s.value_or(NAN)).Key("eta_s").Number(pace.eta_s.value_or(NAN));
  json.Key("left").Number(left.value_or(NAN)).Key("session").Raw(ToJson(session)).EndObject();
}

// Returns the agent to which the agent with this status sends in sessions of this kind; 0 if there is none.
AgentId DestinationOf(const proto::AgentStatus& status, proto::SharingKind kind) {
  const bool is_leader = status.role() == proto::ROLE_LEADER;
  if (kind == proto::SHARING_KIND_REPLICATION) return is_leader ? status.roles().survivor() : 0;
  return is_leader ? 0 : status.roles().leader();
}

// Adds one agent's sessions of this kind to the table and the JSON, also the session that has not begun since the
// agent's start. `own`: the agent's status; null if it is not known.
void ShowSessions(const proto::TeamConfig& team, const std::string& agent, const proto::ShareStatus& status,
                  const proto::AgentStatus* own, proto::SharingKind kind, Table& table, JsonWriter& json) {
  json.Key("sessions").BeginArray();
  std::set<AgentId> shown;
  for (const proto::ShareSession& session : status.sessions()) {
    if (session.kind() != kind) continue;
    shown.insert(static_cast<AgentId>(session.destination()));
    const std::optional<double> left = LeftOf(own, session);
    table.Add(ShareStatusRow(team, agent, session, left));
    WriteSession(team, session, left, json);
  }
  const AgentId destination = own == nullptr ? 0 : DestinationOf(*own, kind);
  if (destination != 0 && !shown.contains(destination)) {
    proto::ShareSession never;
    never.set_destination(destination);
    never.set_kind(kind);
    const std::optional<double> left = LeftOf(own, never);
    table.Add({agent, AgentName(team, destination), "nothing sent since the agent started", "-", "-",
               left ? FormatCount(*left) : "-"});
    WriteSession(team, never, left, json);
  } else if (shown.empty()) {
    table.Add({agent, "-", "nothing sent since the agent started"});
  }
  json.EndArray().Key("received_records").Number(status.received_records());
}

// Describes the records and messages that the agent rejected, dropped or refused, and peers with other team files or
// schemas. Empty: there are none.
std::string RefusedText(const proto::TeamConfig& team, const proto::ShareStatus& status, proto::SharingKind kind) {
  std::string text;
  const auto add = [&text](double count, const char* what) {
    if (count > 0) text += (text.empty() ? "" : ", ") + FormatCount(count) + " " + what;
  };
  add(status.rejected_records(), "records rejected");
  add(status.damaged_messages(), "batches damaged");
  add(status.dropped_messages(), "batches dropped");
  add(status.refused_hellos(), "hellos refused");
  for (const AgentId agent : status.other_config_agents()) {
    text += (text.empty() ? "" : ", ") + AgentName(team, agent) + " has another team file";
  }
  for (const proto::ShareSession& session : status.sessions()) {
    if (session.kind() != kind) continue;
    for (const DataType type : session.other_schema_types()) {
      text += (text.empty() ? "" : ", ") + AgentName(team, session.destination()) + " gets no " +
              DataTypeName(type, team.custom_types()) + ", because its schema of that type differs";
    }
  }
  return text;
}

// Lists, per session and data type, the records that are still to be sent. Empty: there are none.
std::string BacklogText(const proto::TeamConfig& team, const std::string& agent, const proto::ShareStatus& status,
                        proto::SharingKind kind) {
  std::string text;
  for (const proto::ShareSession& session : status.sessions()) {
    if (session.kind() != kind || session.backlog().empty()) continue;
    std::vector<std::string> types;
    for (const proto::TypeBacklog& type : session.backlog()) {
      types.push_back(FormatCount(type.records()) + " " + DataTypeName(type.data_type(), team.custom_types()));
    }
    text += agent + " still has to send to " + AgentName(team, session.destination()) + ": " + Joined(types) + "\n";
  }
  return text;
}

void WriteRefused(const proto::TeamConfig& team, const proto::ShareStatus& status, JsonWriter& json) {
  json.Key("rejected_records").Number(status.rejected_records());
  json.Key("damaged_messages").Number(status.damaged_messages());
  json.Key("dropped_messages").Number(status.dropped_messages());
  json.Key("refused_hellos").Number(status.refused_hellos());
  json.Key("other_config_agents").BeginArray();
  for (const AgentId agent : status.other_config_agents()) json.String(AgentName(team, agent));
  json.EndArray();
}

ExitCode ShowShareStatus(CommandContext& context, proto::SharingKind kind) {
  const auto answers = context.CallEach([](Client& client) { return client.ShareStatus(); });
  if (!answers) return context.Report(answers.error());
  const auto statuses = context.CallEach([](Client& client) { return client.Status(); });
  if (!statuses) return context.Report(statuses.error());
  const auto status_of = [&statuses](const proto::AgentConfig& agent) -> const proto::AgentStatus* {
    for (const auto& [asked, status] : *statuses) {
      if (asked->id() == agent.id() && status) return &*status;
    }
    return nullptr;
  };
  Table table(ShareStatusHeader());
  std::string backlog, refused;
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  for (const auto& asked : *answers) {
    const auto& [agent, status] = asked;
    BeginAgent(asked, json);
    if (status) {
      const proto::TeamConfig& team = (*context.Team())->config;
      ShowSessions(team, agent->name(), *status, status_of(*agent), kind, table, json);
      WriteRefused(team, *status, json);
      backlog += BacklogText(team, agent->name(), *status, kind);
      const std::string text = RefusedText(team, *status, kind);
      if (!text.empty()) refused += agent->name() + ": " + text + "\n";
    } else {
      table.Add({agent->name(), WhyNoAnswer(status.error())}, Tone::kBad);
    }
    json.EndObject();
  }
  json.EndArray().EndObject();
  return context.Print(ExitCodeOf(*answers), json.text(), table.Text() + backlog + refused);
}

Command& AddGroup(Command& app, CommandContext& context, proto::SharingKind kind, const std::string& name,
                  const std::string& description) {
  Command& group = app.AddSubcommand(name, description);
  group.RequireSubcommand();
  auto arguments = std::make_shared<ShareArguments>();
  const bool is_sync = kind == proto::SHARING_KIND_SYNC;
  Command& now = AddCommand(
      group, "now", is_sync ? "Start a sync at the leader (or -a)" : "Start a replication at the leader (or -a)",
      {is_sync ? "moonctl sync now --from rover2 --wait" : "moonctl replicate now --wait --timeout 10m"});
  now.AddFlag("--wait", arguments->is_waiting, "Wait until all records are acknowledged");
  now.AddOption("--max-bytes", arguments->bytes_max, "Maximum number of coded bytes that a session sends")
      .TypeName("BYTES")
      .Positive();
  if (is_sync) now.AddOption("--from", arguments->from, "Request records only from these agents").TypeName("AGENT");
  now.Callback([&context, kind, arguments] {
    context.action = [&context, kind, arguments] { return ShareNow(context, kind, *arguments); };
  });
  Command& status =
      AddCommand(group, "status", "Show sent, acknowledged and remaining records, rate and ETA of each pair",
                 {is_sync ? "moonctl sync status --watch" : "moonctl replicate status", kShows});
  status.Callback([&context, kind, arguments] {
    context.action = [&context, kind, arguments] { return ShowShareStatus(context, kind); };
  });
  return group;
}

}  // namespace

void AddShareCommands(Command& app, CommandContext& context) {
  AddPauseCommands(AddGroup(app, context, proto::SHARING_KIND_SYNC, "sync", "Send records to the leader"), context);
  AddGroup(app, context, proto::SHARING_KIND_REPLICATION, "replicate", "Send all records to the survivor");
}

}  // namespace moondb
