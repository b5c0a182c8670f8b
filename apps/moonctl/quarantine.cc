#include "apps/moonctl/quarantine.h"

#include "apps/common/json_writer.h"
#include "apps/common/utc.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/node_name.h"
#include "apps/moonctl/time_span_option.h"
#include "model/pose_graph.h"
#include "model/record_key.h"

namespace moondb {
namespace {

constexpr std::int64_t kBeginning = INT64_MIN;
constexpr std::int64_t kEndOfTime = INT64_MAX;

struct QuarantineArguments {
  std::string agent;
  std::string from;
  std::string to;
  std::string reason;
  std::string lift;
  // Only for parts of the graph.
  std::vector<std::string> nodes;
  bool is_range = false;
  std::string source;
};

Result<std::int64_t> TimestampOf(const std::string& text, std::int64_t missing, const char* option) {
  return text.empty() ? missing : ParseTimeOrAge(text, UtcNowNs(), option);
}

Result<void> SetMaps(const proto::TeamConfig& team, const QuarantineArguments& arguments,
                     proto::MapQuarantine& quarantine) {
  if (arguments.agent.empty()) {
    return Fail(ErrorCode::kInvalid,
                "expected --agent NAME, or --lift ID of a quarantine that moonctl map stats lists");
  }
  const auto agent = AgentNamed(team, arguments.agent);
  if (!agent) return tl::unexpected(agent.error());
  const Result<std::int64_t> from = TimestampOf(arguments.from, kBeginning, "--from");
  if (!from) return tl::unexpected(from.error());
  const Result<std::int64_t> to = TimestampOf(arguments.to, kEndOfTime, "--to");
  if (!to) return tl::unexpected(to.error());
  if (*from > *to) return Fail(ErrorCode::kInvalid, "is earlier than --from", "--to");
  quarantine.set_agent_id((*agent)->id());
  quarantine.set_from_ns(*from);
  quarantine.set_to_ns(*to);
  return {};
}

Result<void> SetProducer(const proto::TeamConfig& team, const QuarantineArguments& arguments,
                         proto::MapQuarantine& quarantine) {
  if (!arguments.nodes.empty() || arguments.is_range) {
    return Fail(ErrorCode::kInvalid,
                "selects all ranges, loop closures and priors of an agent, or those of its --source; omit the node",
                "--agent");
  }
  const auto agent = AgentNamed(team, arguments.agent);
  if (!agent) return tl::unexpected(agent.error());
  quarantine.set_agent_id((*agent)->id());
  quarantine.mutable_producer()->set_source(arguments.source);
  return {};
}

Result<void> SetGraphPart(const proto::TeamConfig& team, const QuarantineArguments& arguments,
                          proto::MapQuarantine& quarantine) {
  if (!arguments.agent.empty()) return SetProducer(team, arguments, quarantine);
  if (arguments.nodes.empty()) {
    return Fail(ErrorCode::kInvalid,
                "expected a node such as rover3:500, two nodes of a factor, --agent NAME or --lift ID");
  }
  std::vector<proto::NodeKey> nodes;
  for (const std::string& text : arguments.nodes) {
    const Result<NodeKey> node = ParseNodeName(team, text, "NODE");
    if (!node) return tl::unexpected(node.error());
    nodes.push_back(ToProto(*node));
  }
  quarantine.set_agent_id(nodes.front().agent_id());
  const bool is_node = nodes.size() == 1 && arguments.source.empty();
  if (is_node && !arguments.is_range) {
    *quarantine.mutable_node() = nodes.front();
    return {};
  }
  if (nodes.size() > 2 || (nodes.size() == 2 && arguments.is_range != arguments.source.empty()) ||
      (nodes.size() == 1 && arguments.is_range)) {
    return Fail(
        ErrorCode::kInvalid,
        "expected two nodes with --range, two with --source NAME (a loop closure), or one with --source NAME (a "
        "prior)");
  }
  proto::QuarantinedFactor& factor = *quarantine.mutable_factor();
  *factor.mutable_from() = nodes.front();
  *factor.mutable_to() = nodes.back();
  factor.set_is_range(arguments.is_range);
  factor.set_is_prior(nodes.size() == 1);
  factor.set_source(arguments.source);
  return {};
}

using SetPart = Result<void> (*)(const proto::TeamConfig&, const QuarantineArguments&, proto::MapQuarantine&);

Result<proto::Record> MakeQuarantine(CommandContext& context, const QuarantineArguments& arguments, SetPart set_part) {
  proto::Record record;
  record.set_timestamp_ns(UtcNowNs());
  proto::MapQuarantine& quarantine = *record.mutable_map_quarantine();
  quarantine.set_reason(arguments.reason);
  if (!arguments.lift.empty()) {
    if (!arguments.agent.empty() || !arguments.nodes.empty()) {
      return Fail(ErrorCode::kInvalid, "cannot be combined with an agent or a node", "--lift");
    }
    const Result<RecordKey> key = ParseRecordKey(arguments.lift);
    if (!key) return Fail(ErrorCode::kInvalid, key.error().text, "--lift");
    *quarantine.mutable_lifts() = ToProto(*key);
    return record;
  }
  auto team = context.Team();
  if (!team) return tl::unexpected(team.error());
  if (auto set = set_part((*team)->config, arguments, quarantine); !set) return tl::unexpected(set.error());
  return record;
}

// Returns kNotFound if `quarantine` lifts a quarantine that does not exist, for example because the operator mistyped
// its ID.
Result<void> CheckStands(Client& client, const proto::MapQuarantine& quarantine) {
  if (!quarantine.has_lifts()) return {};
  const auto stats = client.MapStats();
  if (!stats) return tl::unexpected(stats.error());
  for (const proto::StandingQuarantine& standing : stats->quarantines()) {
    if (FromProto(standing.record()) == FromProto(quarantine.lifts())) return {};
  }
  return Fail(ErrorCode::kNotFound, "no quarantine in force has this ID; moonctl map stats lists the quarantines",
              "--lift");
}

ExitCode SetQuarantine(CommandContext& context, const QuarantineArguments& arguments, SetPart set_part) {
  const auto record = MakeQuarantine(context, arguments, set_part);
  if (!record) return context.Report(record.error());
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  if (auto stands = CheckStands(*target->client, record->map_quarantine()); !stands) {
    return context.Report(stands.error());
  }
  auto keys = target->client->Insert({*record});
  if (!keys) return context.Report(keys.error());
  const std::string key = ToString(keys->front());
  JsonWriter json;
  json.BeginObject().Key("agent").String(target->agent->name()).Key("key").String(key).EndObject();
  auto roles = target->client->Roles();
  const bool is_leader = roles && roles->roles().leader() == target->agent->id();
  const std::string next = is_leader
                               ? "moonctl sync now sends it to all other agents"
                               : "moonctl sync now sends it to the leader; a second one sends it to all other agents";
  const std::string what =
      arguments.lift.empty() ? "quarantine " + key + " is in force" : arguments.lift + " is lifted";
  return context.Done(json.text(), what + " at " + target->agent->name() + "; " + next);
}

// Adds the options that both commands have.
void AddCommonOptions(Command& command, QuarantineArguments& arguments) {
  command.AddOption("--reason", arguments.reason, "Reason, stored with the quarantine");
  command.AddOption("--lift", arguments.lift, "Lift the quarantine with this ID (see moonctl map stats)")
      .TypeName("ID");
}

}  // namespace

void AddMapQuarantine(Command& group, CommandContext& context) {
  auto arguments = std::make_shared<QuarantineArguments>();
  Command& command =
      AddCommand(group, "quarantine", "Exclude an agent's maps from all merged maps",
                 {"moonctl map quarantine --agent rover2 --from 2026-11-21T10:00Z --reason \"wheel slip\""});
  command.AddOption("--agent", arguments->agent, "Agent whose maps to exclude").TypeName("AGENT");
  command.AddOption("--from", arguments->from, "Start of the time range in UTC: 2026-11-22T06:00Z").TypeName("TIME");
  command.AddOption("--to", arguments->to, "End of the time range in UTC").TypeName("TIME");
  AddCommonOptions(command, *arguments);
  command.Callback([&context, arguments] {
    context.action = [&context, arguments] { return SetQuarantine(context, *arguments, SetMaps); };
  });
}

void AddGraphQuarantine(Command& group, CommandContext& context) {
  auto arguments = std::make_shared<QuarantineArguments>();
  Command& command = AddCommand(group, "quarantine", "Exclude a node's pose, or measurements, from all solves and maps",
                                {"moonctl graph quarantine rover3:500 --reason \"wrong unit\"\n"
                                 "moonctl graph quarantine rover1:9 rover2:9 --range\n"
                                 "moonctl graph quarantine rover2:140 rover1:17 --source apriltag\n"
                                 "moonctl graph quarantine --agent rover2 --source slam_toolbox"});
  command.AddOption("node", arguments->nodes, "A node, or the two nodes of a range or loop closure").TypeName("NODE");
  command.AddFlag("--range", arguments->is_range, "Exclude the range between the two nodes");
  command.AddOption("--source", arguments->source, "Exclude the loop closure or prior of this source").TypeName("NAME");
  command
      .AddOption("--agent", arguments->agent, "Exclude all ranges, loop closures and priors that this agent inserted")
      .TypeName("AGENT");
  AddCommonOptions(command, *arguments);
  command.Callback([&context, arguments] {
    context.action = [&context, arguments] { return SetQuarantine(context, *arguments, SetGraphPart); };
  });
}

std::string QuarantinedText(const proto::TeamConfig& team, const proto::MapQuarantine& quarantine) {
  switch (quarantine.graph_part_case()) {
    case proto::MapQuarantine::kNode:
      return "node " + NodeName(team, FromProto(quarantine.node()));
    case proto::MapQuarantine::kFactor: {
      const FactorKey factor = KeyOf(quarantine.factor());
      std::string text = ToString(factor.kind) + " " + NodeName(team, factor.from);
      if (factor.kind != FactorKind::kPrior) text += " " + NodeName(team, factor.to);
      return factor.source.empty() ? text : text + " " + factor.source;
    }
    case proto::MapQuarantine::kProducer:
      if (quarantine.producer().source().empty()) return "ranges, loop closures and priors";
      return "loop closures and priors of " + quarantine.producer().source();
    case proto::MapQuarantine::GRAPH_PART_NOT_SET:
      return "maps";
  }
  return "maps";
}

}  // namespace moondb
