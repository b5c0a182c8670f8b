#include <CLI/CLI.hpp>

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/commands.h"
#include "runtime/did_you_mean.h"

namespace moondb {
namespace {

// What `role set` and `role swap` were given.
struct RoleArguments {
  std::vector<std::string> words;
  bool is_dry_run = false;
  std::string reason;
};

std::string TermText(const proto::TeamConfig& team, const proto::Term& term) {
  return std::to_string(term.number()) + (term.issuer() == 0 ? "" : " by " + AgentName(team, term.issuer()));
}

// What each agent holds: a split team shows.
ExitCode ShowRoles(CommandContext& context) {
  const auto answers = context.AskEach([](Client& client) { return client.Roles(); });
  if (!answers) return context.Report(answers.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  Table table({"AGENT", "OWN ROLE", "TERM", "LEADER", "SURVIVOR", "REASON"});
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  for (const auto& asked : *answers) {
    const auto& [agent, shown] = asked;
    BeginAgent(asked, json);
    if (shown) {
      const proto::RoleAssignment& roles = shown->roles();
      const auto role = RoleName(RoleOf(team, roles, agent->id()));
      table.Add({agent->name(), role, TermText(team, roles.term()), AgentName(team, roles.leader()),
                 AgentName(team, roles.survivor()), roles.reason()});
      json.Key("role").String(role).Key("roles").Raw(ToJson(roles));
    } else {
      table.Add({agent->name(), WhyNoAnswer(shown.error())}, Tone::kBad);
    }
    json.EndObject();
  }
  json.EndArray().EndObject();
  return context.Print(ExitCodeOf(*answers), json.text(), table.Text());
}

ExitCode ShowHistory(CommandContext& context) {
  auto chosen = context.ConnectToChosenOrLeader();
  if (!chosen) return context.Report(chosen.error());
  auto shown = chosen->client->Roles(/*with_history=*/true);
  if (!shown) return context.Report(shown.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  if (shown->history().empty()) {
    return context.Done(ToJson(*shown), chosen->agent->name() + " knows only the team file's roles");
  }
  Table table({"TERM", "BY", "LEADER", "SURVIVOR", "WHEN", "REASON"});
  for (const proto::RoleAssignment& roles : shown->history()) {
    table.Add({std::to_string(roles.term().number()), AgentName(team, roles.term().issuer()),
               AgentName(team, roles.leader()), AgentName(team, roles.survivor()), FormatUtc(roles.stamp_ns()),
               roles.reason()});
  }
  return context.Done(ToJson(*shown), table.Text());
}

// "rover2 leader rover3 survivor" to a request.
Result<proto::RoleSetRequest> ParsePairs(const proto::TeamConfig& team, const std::vector<std::string>& words) {
  if (words.empty() || words.size() % 2 != 0) {
    return Fail(ErrorCode::kInvalid, "expected pairs of an agent and a role, such as: role set rover2 leader");
  }
  proto::RoleSetRequest request;
  for (std::size_t i = 0; i < words.size(); i += 2) {
    auto agent = AgentNamed(team, words[i]);
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

// "swap rover1 rover2": these two must be the leader and the survivor, or it is not what the operator thinks.
Result<proto::RoleSetRequest> ParseSwap(CommandContext& context, const std::vector<std::string>& words) {
  proto::RoleSetRequest request;
  request.set_is_swap(true);
  if (words.empty()) return request;
  auto team = context.Team();
  if (!team) return tl::unexpected(team.error());
  auto a = AgentNamed((*team)->config, words[0]);
  auto b = AgentNamed((*team)->config, words[1]);
  if (!a || !b) return tl::unexpected(!a ? a.error() : b.error());
  auto roles = context.Roles();
  if (!roles) return tl::unexpected(roles.error());
  const std::set<AgentId> named{(*a)->id(), (*b)->id()};
  if (named != std::set<AgentId>{roles->leader(), roles->survivor()}) {
    return Fail(ErrorCode::kRefused, "leader and survivor are " + AgentName((*team)->config, roles->leader()) +
                                         " and " + AgentName((*team)->config, roles->survivor()));
  }
  return request;
}

// Whom to tell: -a; else the agent that is to lead; else the leader; else anyone who answers.
Result<AgentClient> ChooseTarget(CommandContext& context, const proto::RoleSetRequest& request) {
  if (!context.agent.empty()) return context.Connect(context.agent);
  if (auto options = context.ClientOptions(); !options) return tl::unexpected(options.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  if (request.leader() != 0) {
    if (auto connected = context.Connect(AgentName(team, request.leader()))) return connected;
  }
  if (auto leader = context.ConnectToChosenOrLeader()) return leader;
  for (const proto::AgentConfig& agent : team.agents()) {
    if (auto connected = context.Connect(agent.name())) return connected;
  }
  return Fail(ErrorCode::kUnavailable, "no agent of team " + team.team() + " answers");
}

ExitCode ChangeRoles(CommandContext& context, Result<proto::RoleSetRequest> request, const RoleArguments& arguments) {
  if (!request) return context.Report(request.error());
  request->set_is_dry_run(arguments.is_dry_run);
  request->set_reason(arguments.reason);
  auto target = ChooseTarget(context, *request);
  if (!target) return context.Report(target.error());
  auto shown = target->client->SetRoles(*request);
  if (!shown) return context.Report(shown.error());

  const proto::TeamConfig& team = (*context.Team())->config;
  std::string text = arguments.is_dry_run ? "would be: " : "";
  text += "term " + TermText(team, shown->roles().term()) + ": leader " + AgentName(team, shown->roles().leader()) +
          ", survivor " + AgentName(team, shown->roles().survivor());
  return context.Done(ToJson(*shown), text);
}

}  // namespace

void AddRoleCommands(CLI::App& app, CommandContext& context) {
  CLI::App& role = *app.add_subcommand("role", "Who leads, who is the designated survivor");
  role.require_subcommand(1);
  role.add_subcommand("show", "The roles as each agent knows them")->callback([&context] {
    context.action = [&context] { return ShowRoles(context); };
  });
  role.add_subcommand("history", "The assignments that the leader (or -a) has acted on, oldest first")
      ->callback([&context] { context.action = [&context] { return ShowHistory(context); }; });

  auto arguments = std::make_shared<RoleArguments>();
  const auto add_common = [&arguments](CLI::App& command) {
    command.add_flag("--dry-run", arguments->is_dry_run, "Say what would be, change nothing");
    command.add_option("--reason", arguments->reason, "Kept with the assignment");
  };
  CLI::App& set = *role.add_subcommand("set", "Give roles: AGENT leader|survivor [AGENT leader|survivor]");
  set.add_option("pairs", arguments->words, "AGENT ROLE ...")
      ->type_name("{AGENT,leader,survivor}")
      ->required()
      ->expected(2, 4);
  add_common(set);
  set.callback([&context, arguments] {
    context.action = [&context, arguments] {
      auto team = context.Team();
      if (!team) return context.Report(team.error());
      return ChangeRoles(context, ParsePairs((*team)->config, arguments->words), *arguments);
    };
  });
  CLI::App& swap = *role.add_subcommand("swap", "Exchange leader and survivor");
  swap.add_option("agents", arguments->words, "The two, to be sure")->type_name("AGENT")->expected(0, 2);
  add_common(swap);
  swap.callback([&context, arguments] {
    context.action = [&context, arguments] {
      if (arguments->words.size() == 1) {
        return context.Report({ErrorCode::kInvalid, "expected two agents, or none", {}});
      }
      auto team = context.Team();
      if (!team) return context.Report(team.error());
      return ChangeRoles(context, ParseSwap(context, arguments->words), *arguments);
    };
  });
}

}  // namespace moondb
