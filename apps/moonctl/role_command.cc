#include <algorithm>
#include <chrono>
#include <functional>
#include <set>

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/health.h"
#include "client/orders.h"
#include "model/command_from.h"
#include "model/did_you_mean.h"
#include "model/term.h"

namespace moondb {
namespace {

constexpr std::chrono::seconds kLimit(10);

// Arguments of `role set` and `role swap`.
struct RoleArguments {
  std::vector<std::string> words;
  bool is_dry_run = false;
  bool is_at_once = false;
  std::string reason;
};

// Shows the role assignment that each agent holds. Different assignments reveal a split team.
ExitCode ShowRoles(CommandContext& context) {
  const auto answers = context.CallEach([](Client& client) { return client.Roles(); });
  if (!answers) return context.Report(answers.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  Table table({"AGENT", "OWN ROLE", "TERM", "LEADER", "SURVIVOR", "REASON"});
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  std::string remarks;
  for (const auto& asked : *answers) {
    const auto& [agent, shown] = asked;
    BeginAgent(asked, json);
    if (shown) {
      const proto::RoleAssignment& roles = shown->roles();
      const auto role = RoleName(RoleOf(team, roles, agent->id()));
      table.Add({agent->name(), role, IssuedTermText(team, roles.term()), AgentName(team, roles.leader()),
                 AgentName(team, roles.survivor()), roles.reason()});
      json.Key("role").String(role).Key("roles").Raw(ToJson(roles));
      if (shown->has_unstored()) {
        json.Key("unstored").Raw(ToJson(shown->unstored()));
        remarks += agent->name() + ": " + UnstoredText(team, shown->unstored()) + "\n";
      }
    } else {
      table.Add({agent->name(), WhyNoAnswer(shown.error())}, Tone::kBad);
    }
    json.EndObject();
  }
  json.EndArray().EndObject();
  return context.Print(ExitCodeOf(*answers), json.text(), table.Text() + remarks);
}

ExitCode ShowHistory(CommandContext& context) {
  auto chosen = context.ConnectToChosenOrLeader();
  if (!chosen) return context.Report(chosen.error());
  auto shown = chosen->client->Roles(/*with_history=*/true);
  if (!shown) return context.Report(shown.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  if (shown->history().empty()) {
    return context.Done(ToJson(*shown), chosen->agent->name() + " knows only the initial roles of the team file");
  }
  Table table({"TERM", "BY", "LEADER", "SURVIVOR", "WHEN", "REASON"});
  for (const proto::RoleAssignment& roles : shown->history()) {
    table.Add({TermText(roles.term()), AgentName(team, roles.term().issuer()), AgentName(team, roles.leader()),
               AgentName(team, roles.survivor()), FormatUtc(roles.timestamp_ns()), roles.reason()});
  }
  return context.Done(ToJson(*shown), table.Text());
}

// Converts pairs of agent and role, such as "rover2 leader rover3 survivor", to a request.
Result<proto::RoleSetRequest> ParsePairs(const proto::TeamConfig& team, const std::vector<std::string>& words) {
  const bool begins_with_role = !words.empty() && (words[0] == "leader" || words[0] == "survivor");
  if (words.empty() || words.size() % 2 != 0 || begins_with_role) {
    return Fail(ErrorCode::kInvalid, "expected pairs of an agent and a role, such as: role set rover2 leader");
  }
  proto::RoleSetRequest request;
  for (std::size_t i = 0; i < words.size(); i += 2) {
    auto agent = MemberNamed(team, words[i]);
    if (!agent) return tl::unexpected(agent.error());
    const std::string& role = words[i + 1];
    const bool is_survivor = role == "survivor" || role == "designated_survivor";
    if (role != "leader" && !is_survivor) {
      return Fail(ErrorCode::kInvalid, "no such role: \"" + role + "\"" + DidYouMean(role, {"leader", "survivor"}));
    }
    if ((is_survivor ? request.survivor() : request.leader()) != 0) {
      return Fail(ErrorCode::kInvalid, "the role " + role + " is given twice");
    }
    is_survivor ? request.set_survivor((*agent)->id()) : request.set_leader((*agent)->id());
  }
  return request;
}

// Converts the agents of "swap rover1 rover2" to a request. Returns kRefused if these agents are not the current leader
// and survivor, because the operator then relies on outdated roles.
Result<proto::RoleSetRequest> ParseSwap(const proto::TeamConfig& team, const std::vector<std::string>& words,
                                        const proto::RoleAssignment& standing) {
  proto::RoleSetRequest request;
  request.set_is_swap(true);
  if (words.empty()) return request;
  auto a = AgentNamed(team, words[0]);
  auto b = AgentNamed(team, words[1]);
  if (!a || !b) return tl::unexpected(!a ? a.error() : b.error());
  const std::set<AgentId> named{(*a)->id(), (*b)->id()};
  if (named != std::set<AgentId>{standing.leader(), standing.survivor()}) {
    return Fail(ErrorCode::kRefused, "the current leader and survivor are " + AgentName(team, standing.leader()) +
                                         " and " + AgentName(team, standing.survivor()));
  }
  return request;
}

// Returns the roles that the operator's request builds on: the roles that the agent given with -a holds, otherwise the
// team's newest roles.
Result<proto::RoleAssignment> StandingRoles(CommandContext& context) {
  if (context.agent.empty()) return context.Roles();
  auto chosen = context.Connect(context.agent);
  if (!chosen) return tl::unexpected(chosen.error());
  auto held = chosen->client->Roles();
  if (!held) return tl::unexpected(held.error());
  return held->roles();
}

// Connects to the agent given with -a. Otherwise tries the agents that may change the roles first, then all other
// agents. Within each group the future leader comes first, then the current leader and survivor.
Result<AgentClient> ConnectToChange(CommandContext& context, const proto::RoleAssignment& standing,
                                    AgentId new_leader) {
  if (!context.agent.empty()) return context.Connect(context.agent);
  const proto::TeamConfig& team = (*context.Team())->config;
  const auto leader = static_cast<AgentId>(standing.leader());
  const auto survivor = static_cast<AgentId>(standing.survivor());
  std::vector<AgentId> agents{new_leader, leader, survivor};
  for (const proto::AgentConfig& agent : team.agents()) agents.push_back(agent.id());
  std::stable_partition(agents.begin(), agents.end(),
                        [&](AgentId agent) { return agent == leader || agent == survivor || MayCommand(team, agent); });
  std::set<AgentId> asked{0};
  for (const AgentId agent : agents) {
    if (!asked.insert(agent).second) continue;
    if (auto connected = context.Connect(AgentName(team, agent))) return connected;
  }
  return Fail(ErrorCode::kUnavailable, "no agent of team " + team.team() + " answers");
}

std::vector<std::string> NotConfirmed(const proto::TeamConfig& team, const proto::RoleShowReply& shown) {
  std::vector<std::string> names;
  for (const AgentId agent : shown.not_confirmed_by()) names.push_back(AgentName(team, agent));
  return names;
}

std::string JsonOf(const proto::TeamConfig& team, const proto::RoleShowReply& shown) {
  JsonWriter json;
  json.BeginObject().Key("roles").Raw(ToJson(shown.roles())).Key("confirmed_by").BeginArray();
  for (const AgentId agent : shown.confirmed_by()) json.Number(agent);
  json.EndArray().Key("not_confirmed").BeginArray();
  for (const std::string& name : NotConfirmed(team, shown)) json.String(name);
  json.EndArray().EndObject();
  return json.text();
}

using ParseWords = std::function<Result<proto::RoleSetRequest>(const proto::TeamConfig&, const proto::RoleAssignment&)>;

ExitCode ChangeRoles(CommandContext& context, const ParseWords& parse, const RoleArguments& arguments) {
  auto team_file = context.Team();
  if (!team_file) return context.Report(team_file.error());
  const proto::TeamConfig& team = (*team_file)->config;
  // Report mistyped words before sending any request.
  if (auto parsed = parse(team, {}); !parsed && parsed.error().code == ErrorCode::kInvalid) {
    return context.Report(parsed.error());
  }
  const auto standing = StandingRoles(context);
  if (!standing) return context.Report(standing.error());
  auto request = parse(team, *standing);
  if (!request) return context.Report(request.error());
  request->set_is_dry_run(arguments.is_dry_run);
  request->set_reason(arguments.reason);
  const auto connected = ConnectToChange(context, *standing, static_cast<AgentId>(request->leader()));
  if (!connected) return context.Report(connected.error());
  const auto shown = ChangeRolesUntilDone(*connected->client, *std::move(request), *standing,
                                          context.has_timeout() ? context.WaitTimeout() : kLimit,
                                          /*is_waiting=*/!arguments.is_at_once);
  if (!shown) return context.Report(shown.error());

  const proto::RoleAssignment& roles = shown->roles();
  std::string text = arguments.is_dry_run ? "dry run: the roles would be " : "";
  text += "term " + IssuedTermText(team, roles.term()) + ": leader " + AgentName(team, roles.leader()) + ", survivor " +
          AgentName(team, roles.survivor());
  std::string missing;
  for (const std::string& name : NotConfirmed(team, *shown)) missing += (missing.empty() ? "" : " and ") + name;
  if (!missing.empty())
    text += "; not yet confirmed by " + missing + ": an agent out of reach receives the assignment when it reconnects";
  return context.Print(missing.empty() ? ExitCode::kDone : ExitCode::kUnreachable, JsonOf(team, *shown), text);
}

}  // namespace

void AddRoleCommands(Command& app, CommandContext& context) {
  Command& role = app.AddSubcommand("role", "Show or change the leader and the designated survivor");
  role.RequireSubcommand();
  AddCommand(role, "show", "Show the roles that each agent knows", {"moonctl role show", kShows}).Callback([&context] {
    context.action = [&context] { return ShowRoles(context); };
  });
  AddCommand(role, "history", "List the role assignments that the leader (or -a) has acted on, oldest first",
             {"moonctl role history -a rover2", kShows})
      .Callback([&context] { context.action = [&context] { return ShowHistory(context); }; });

  auto arguments = std::make_shared<RoleArguments>();
  const auto add_common = [&arguments](Command& command) {
    command.AddFlag("--dry-run", arguments->is_dry_run, "Show the new roles without changing them");
    command.AddOption("--reason", arguments->reason, "Reason, kept with the assignment");
    command.AddFlag("--no-wait", arguments->is_at_once, "Return without waiting for confirmation");
  };
  Command& set = AddCommand(role, "set", "Assign roles: AGENT leader|survivor [AGENT leader|survivor]",
                            {"moonctl role set rover2 leader rover3 survivor --reason \"rover1 is lost\""});
  set.AddOption("pairs", arguments->words, "AGENT ROLE ...")
      .TypeName("{AGENT,leader,survivor}")
      .Required()
      .Expected(1, 4);
  add_common(set);
  set.Callback([&context, arguments] {
    context.action = [&context, arguments] {
      const auto parse = [arguments](const proto::TeamConfig& team, const proto::RoleAssignment&) {
        return ParsePairs(team, arguments->words);
      };
      return ChangeRoles(context, parse, *arguments);
    };
  });
  Command& swap =
      AddCommand(role, "swap", "Exchange leader and survivor", {"moonctl role swap rover1 rover2 --dry-run"});
  swap.AddOption("agents", arguments->words, "Refuse the swap unless these two agents are leader and survivor")
      .TypeName("AGENT")
      .Expected(0, 2);
  add_common(swap);
  swap.Callback([&context, arguments] {
    context.action = [&context, arguments] {
      if (arguments->words.size() == 1) {
        return context.Report({ErrorCode::kInvalid, "expected two agents, or none", {}});
      }
      const auto parse = [arguments](const proto::TeamConfig& team, const proto::RoleAssignment& standing) {
        return ParseSwap(team, arguments->words, standing);
      };
      return ChangeRoles(context, parse, *arguments);
    };
  });
}

}  // namespace moondb
