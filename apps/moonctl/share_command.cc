#include <algorithm>
#include <cmath>
#include <functional>
#include <set>
#include <thread>

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/pause_command.h"
#include "apps/moonctl/share_status.h"
#include "apps/moonctl/share_wait.h"
#include "model/term.h"

namespace moondb {
namespace {

struct ShareArguments {
  std::vector<std::string> from;
  std::uint64_t bytes_max = 0;
  bool is_waiting = false;
};

const char* KindName(proto::SharingKind kind) {
  return kind == proto::SHARING_KIND_REPLICATION ? "replication" : "sync";
}

// Whether the request means that agent's records.
std::function<bool(AgentId)> IsAsked(const proto::ShareRequest& request) {
  return [from = std::set<AgentId>(request.from_agents().begin(), request.from_agents().end())](AgentId agent) {
    return from.empty() || from.contains(agent);
  };
}

// Which sessions a request at `target` starts (proto/sharing.proto): at the leader, from those asked and then from
// itself to all; elsewhere from the agent to the leader.
std::vector<SharePair> PairsOf(const proto::TeamConfig& team, const proto::RoleAssignment& roles, AgentId target,
                               const proto::ShareRequest& request) {
  if (request.kind() == proto::SHARING_KIND_REPLICATION) return {{target, roles.survivor(), request.kind()}};
  if (target != roles.leader()) return {{target, roles.leader(), request.kind()}};
  std::vector<SharePair> pairs;
  const auto is_meant = IsAsked(request);
  for (const proto::AgentConfig& agent : team.agents()) {
    if (agent.id() == target || agent.left()) continue;
    if (is_meant(agent.id())) pairs.push_back({agent.id(), target, request.kind()});
    if (is_meant(target)) pairs.push_back({target, agent.id(), request.kind()});
  }
  return pairs;
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

// What came of an order.
struct Shared {
  std::string agent;  // The agent that took the order.
  std::uint32_t session_count = 0;
  bool is_waited = false;
  bool is_limited = false;
  std::vector<std::string> unreachable;
  std::vector<ShareWait::NotGathered> not_gathered;
};

// One order of an operator's, given to the agent of -a or to the leader. It names the term whose roles moonctl has
// read; where that agent acts on another one, or the roles change while moonctl waits, moonctl begins anew.
class ShareOrder {
 public:
  ShareOrder(CommandContext& context, proto::ShareRequest request, bool is_waiting)
      : context_(context), request_(std::move(request)), is_waiting_(is_waiting), limit_(context) {}

  // kRefused where the roles do not come to rest.
  Result<Shared> Give();

 private:
  struct Target {
    AgentClient client;
    proto::RoleAssignment roles;
  };

  // Nothing: the roles have changed, see changed_.
  Result<std::optional<Shared>> Try();
  Result<std::optional<Target>> ChooseTarget();
  Result<std::uint64_t> Order(Target& target, Shared& shared);
  std::string TermText(const proto::RoleAssignment& roles) const;

  CommandContext& context_;
  proto::ShareRequest request_;
  bool is_waiting_;
  WaitLimit limit_;
  std::string changed_;
};

constexpr char kExpectedTerm[] = "expected_term";  // Field of the refusal.
// Before each beginning. A new leader stores its term and asks around for up to 2 s before it acts.
constexpr std::chrono::milliseconds kPauses[] = {std::chrono::milliseconds(100), std::chrono::milliseconds(300),
                                                 std::chrono::milliseconds(1000), std::chrono::milliseconds(2000),
                                                 std::chrono::milliseconds(3000)};

Result<Shared> ShareOrder::Give() {
  auto shared = Try();
  for (const std::chrono::milliseconds pause : kPauses) {
    if (!shared || *shared || limit_.is_over()) break;
    std::this_thread::sleep_for(pause);
    shared = Try();
  }
  if (!shared) return tl::unexpected(shared.error());
  if (*shared) return **std::move(shared);
  return Fail(ErrorCode::kRefused, "the roles do not come to rest: " + changed_ + "; see moonctl role show");
}

Result<std::optional<Shared>> ShareOrder::Try() {
  auto target = ChooseTarget();
  if (!target) return tl::unexpected(target.error());
  if (!*target) return std::nullopt;
  Client& client = *(*target)->client.client;
  const proto::RoleAssignment& roles = (*target)->roles;
  Shared shared;
  shared.agent = (*target)->client.agent->name();
  const auto is_changed = [this](const Error& error) {
    if (error.field != kExpectedTerm) return false;
    changed_ = error.text;
    return true;
  };
  *request_.mutable_expected_term() = roles.term();
  if (!is_waiting_) {
    const auto ordered = Order(**target, shared);
    if (!ordered && is_changed(ordered.error())) return std::nullopt;
    if (!ordered) return tl::unexpected(ordered.error());
    return shared;
  }
  ShareWait::Options options;
  options.target = (*target)->client.agent->id();
  options.roles = roles;
  options.pairs = PairsOf((*context_.Team())->config, roles, options.target, request_);
  // What a limit ends is not all in any case.
  if (options.target == roles.leader() && request_.bytes_max() == 0) options.is_gathering_meant = IsAsked(request_);
  ShareWait wait(context_, std::move(options));
  const auto is_done = wait.Wait([&] { return Order(**target, shared); }, limit_);
  if (!is_done && is_changed(is_done.error())) return std::nullopt;
  if (!is_done) return tl::unexpected(is_done.error());
  const auto now = client.Roles();
  const bool is_term_kept = *is_done && now && OrderOf(now->roles().term()) == OrderOf(roles.term());
  if (!is_term_kept) {
    if (*is_done && !now) return tl::unexpected(now.error());
    const proto::RoleAssignment& newer = wait.newer_roles() ? *wait.newer_roles() : now->roles();
    changed_ = "the order was given in " + TermText(roles) + ", now " + TermText(newer) + " stands";
    return std::nullopt;
  }
  shared.is_waited = true;
  shared.is_limited = wait.is_any_limited();
  shared.unreachable = wait.unreachable();
  for (const ShareWait::NotGathered& from : wait.not_gathered()) shared.not_gathered.push_back(from);
  return shared;
}

Result<std::optional<ShareOrder::Target>> ShareOrder::ChooseTarget() {
  std::optional<proto::RoleAssignment> newest;
  if (context_.agent.empty()) {
    auto roles = context_.Roles();
    if (!roles) return tl::unexpected(roles.error());
    newest = *roles;
  }
  auto client = newest ? context_.ConnectToLeaderOf(*newest) : context_.Connect(context_.agent);
  if (!client) return tl::unexpected(client.error());
  auto held = client->client->Roles();
  if (!held) return tl::unexpected(held.error());
  if (newest && OrderOf(held->roles().term()) != OrderOf(newest->term())) {
    changed_ = client->agent->name() + " holds " + TermText(held->roles()) + ", another agent " + TermText(*newest);
    return std::nullopt;
  }
  return Target{*std::move(client), held->roles()};
}

Result<std::uint64_t> ShareOrder::Order(Target& target, Shared& shared) {
  auto reply = target.client.client->Share(request_);
  if (!reply) return tl::unexpected(reply.error());
  shared.session_count = reply->session_count();
  return reply->order();
}

std::string ShareOrder::TermText(const proto::RoleAssignment& roles) const {
  const proto::Term& term = roles.term();
  return "term " + moondb::TermText(term) +
         (term.issuer() == 0 ? "" : " by " + AgentName((*context_.Team())->config, term.issuer()));
}

std::string JsonOf(const Shared& shared, proto::SharingKind kind) {
  JsonWriter json;
  json.BeginObject().Key("agent").String(shared.agent).Key("kind").String(KindName(kind));
  json.Key("session_count").Number(shared.session_count);
  json.Key("is_acknowledged").Bool(shared.is_waited && !shared.is_limited);
  json.Key("unreachable").BeginArray();
  for (const std::string& name : shared.unreachable) json.String(name);
  json.EndArray().Key("not_gathered").BeginArray();
  for (const ShareWait::NotGathered& from : shared.not_gathered) {
    json.BeginObject().Key("agent").String(from.agent).Key("why").String(from.why).EndObject();
  }
  json.EndArray().EndObject();
  return json.text();
}

std::string TextOf(const Shared& shared, proto::SharingKind kind) {
  std::string text = std::string(KindName(kind)) + " at " + shared.agent;
  if (!shared.is_waited) {
    return text + ": started, see moonctl " + (kind == proto::SHARING_KIND_SYNC ? "sync" : "replicate") + " status";
  }
  text += shared.is_limited ? ": what the limit allows is acknowledged, more is left" : ": everything is acknowledged";
  if (!shared.unreachable.empty()) text += "; unreachable: " + Joined(shared.unreachable);
  std::vector<std::string> not_gathered;
  for (const ShareWait::NotGathered& from : shared.not_gathered) {
    const auto& named = shared.unreachable;
    if (std::find(named.begin(), named.end(), from.agent) == named.end()) {
      not_gathered.push_back(from.agent + " (" + from.why + ")");
    }
  }
  if (!not_gathered.empty()) text += "; not there yet is what is held only by " + Joined(not_gathered);
  return text;
}

ExitCode ShareNow(CommandContext& context, proto::SharingKind kind, const ShareArguments& arguments) {
  auto request = MakeRequest(context, kind, arguments);
  if (!request) return context.Report(request.error());
  const auto shared = ShareOrder(context, *std::move(request), arguments.is_waiting).Give();
  if (!shared) return context.Report(shared.error());
  const bool is_partial = !shared->unreachable.empty() || !shared->not_gathered.empty();
  return context.Print(is_partial ? ExitCode::kUnreachable : ExitCode::kDone, JsonOf(*shared, kind),
                       TextOf(*shared, kind));
}

void WriteSession(const proto::TeamConfig& team, const proto::ShareSession& session, JsonWriter& json) {
  const SharePace pace = PaceOf(session);
  json.BeginObject().Key("to").String(AgentName(team, session.destination()));
  json.Key("bytes_per_s").Number(pace.bytes_per_s.value_or(NAN)).Key("eta_s").Number(pace.eta_s.value_or(NAN));
  json.Key("session").Raw(ToJson(session)).EndObject();
}

// The sessions of one agent of this kind, or that there is none yet.
void ShowSessions(const proto::TeamConfig& team, const std::string& agent, const proto::ShareStatus& status,
                  proto::SharingKind kind, Table& table, JsonWriter& json) {
  json.Key("sessions").BeginArray();
  bool is_any = false;
  for (const proto::ShareSession& session : status.sessions()) {
    if (session.kind() != kind) continue;
    is_any = true;
    table.Add(ShareStatusRow(team, agent, session));
    WriteSession(team, session, json);
  }
  if (!is_any) table.Add({agent, "-", "nothing sent since its start"});
  json.EndArray().Key("received_records").Number(status.received_records());
}

// What an agent refused of its peers, beyond the sessions; empty where all is well.
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
              DataTypeName(type, team.custom_types()) + ": it understands something else by that type";
    }
  }
  return text;
}

// What each session has left to send, by type; empty where nothing is.
std::string BacklogText(const proto::TeamConfig& team, const std::string& agent, const proto::ShareStatus& status,
                        proto::SharingKind kind) {
  std::string text;
  for (const proto::ShareSession& session : status.sessions()) {
    if (session.kind() != kind || session.backlog().empty()) continue;
    std::vector<std::string> types;
    for (const proto::TypeBacklog& type : session.backlog()) {
      types.push_back(FormatCount(type.records()) + " " + DataTypeName(type.data_type(), team.custom_types()));
    }
    text += agent + " has left for " + AgentName(team, session.destination()) + ": " + Joined(types) + "\n";
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
  const auto answers = context.AskEach([](Client& client) { return client.ShareStatus(); });
  if (!answers) return context.Report(answers.error());
  Table table(ShareStatusHeader());
  std::string backlog, refused;
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  for (const auto& asked : *answers) {
    const auto& [agent, status] = asked;
    BeginAgent(asked, json);
    if (status) {
      const proto::TeamConfig& team = (*context.Team())->config;
      ShowSessions(team, agent->name(), *status, kind, table, json);
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
  Command& now =
      AddCommand(group, "now", "Start it, at the leader or at -a",
                 {is_sync ? "moonctl sync now --from rover2 --wait" : "moonctl replicate now --wait --timeout 10m"});
  now.AddFlag("--wait", arguments->is_waiting, "Until everything is acknowledged");
  now.AddOption("--max-bytes", arguments->bytes_max, "Each session ends when it has sent so many coded bytes")
      .TypeName("BYTES")
      .Positive();
  if (is_sync) now.AddOption("--from", arguments->from, "Only from these agents").TypeName("AGENT");
  now.Callback([&context, kind, arguments] {
    context.action = [&context, kind, arguments] { return ShareNow(context, kind, *arguments); };
  });
  Command& status = AddCommand(group, "status", "Per pair: sent, acknowledged, left, rate, ETA",
                               {is_sync ? "moonctl sync status --watch" : "moonctl replicate status", kShows});
  status.Callback([&context, kind, arguments] {
    context.action = [&context, kind, arguments] { return ShowShareStatus(context, kind); };
  });
  return group;
}

}  // namespace

void AddShareCommands(Command& app, CommandContext& context) {
  AddPauseCommands(AddGroup(app, context, proto::SHARING_KIND_SYNC, "sync", "Bring records to the leader"), context);
  AddGroup(app, context, proto::SHARING_KIND_REPLICATION, "replicate", "Bring all records to the survivor");
}

}  // namespace moondb
