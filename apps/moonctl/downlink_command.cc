#include <filesystem>
#include <limits>

#include "actors/sharing/bundle_file.h"
#include "apps/common/hash_text.h"
#include "apps/common/progress.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/record_json.h"
#include "model/team_member.h"
#include "model/text.h"

namespace moondb {
namespace {

struct DownlinkArguments {
  std::uint32_t budget_kb = 0;
  std::uint32_t number = 0;
  std::string out;   // Path of a fetched bundle. Empty: NAME-NUMBER.bundle in the current folder.
  std::string file;  // Path of a bundle.
};

void WriteBundle(const proto::DownlinkBundle& bundle, JsonWriter& json) {
  json.BeginObject().Key("number").Number(bundle.number());
  json.Key("made").String(FormatUtc(bundle.made_ns()));
  json.Key("records").Number(bundle.record_count()).Key("bytes").Number(bundle.bytes());
  json.Key("hash").String(HashText(bundle.hash())).EndObject();
}

std::string Describe(const proto::DownlinkBundle& bundle) {
  return "bundle " + std::to_string(bundle.number()) + ": " + FormatCount(bundle.record_count(), "record") + ", " +
         FormatBytes(bundle.bytes());
}

std::string LeftText(double left_count) {
  return left_count == 0 ? "all records are in bundles" : "records in no bundle yet: " + FormatCount(left_count);
}

// Connects to the agent given with -a. Otherwise connects to the base station, or to the leader if the team has none.
Result<AgentClient> ConnectToDownlinker(CommandContext& context) {
  auto team = context.Team();
  if (!team) return tl::unexpected(team.error());
  const AgentId base = BaseStationOf((*team)->config);
  if (!context.agent.empty() || base == 0) return context.ConnectToChosenOrLeader();
  return context.Connect(AgentName((*team)->config, base));
}

// Returns a command for the operator to type, such as "moonctl downlink ack 7". Includes the option -a if the operator
// gave -a to the running command.
std::string Typed(const CommandContext& context, const std::string& words) {
  return "moonctl " + (context.agent.empty() ? "" : "-a " + context.agent + " ") + "downlink " + words;
}

// Returns kRefused if a file with other content than `file` exists at `path`. That file may be the only copy of an
// older bundle with the same number, made before the agent lost its store.
Result<void> KeepAnother(const std::string& path, const std::string& file) {
  if (!std::filesystem::exists(path)) return {};
  const auto present = ReadTextFile(path, kBundleBytesMax);
  if (present && *present == file) return {};
  return Fail(ErrorCode::kRefused, "already exists with other content; give another path with --out", path);
}

// Fetches a bundle from the agent, checks it and writes it to a file. Returns the file's path.
Result<std::string> Fetch(const AgentClient& from, std::uint32_t number, const std::string& out) {
  Progress progress("bundle " + std::to_string(number));
  const auto file = from.client->FetchBundle(number, [&progress](double bytes, double all) {
    progress.Show(bytes, all, FormatBytes(bytes) + " of " + FormatBytes(all));
  });
  if (!file) return tl::unexpected(file.error());
  if (auto read = ReadBundle(*file, [](const proto::StoredRecord&) { return Result<void>(); }); !read) {
    return Fail(read.error().code, "bundle " + std::to_string(number) + " " + read.error().text);
  }
  const std::string path = out.empty() ? from.agent->name() + "-" + std::to_string(number) + ".bundle" : out;
  if (auto kept = KeepAnother(path, *file); !kept) return tl::unexpected(kept.error());
  if (auto written = WriteTextFile(path, *file); !written) return tl::unexpected(written.error());
  return path;
}

ExitCode MakeBundle(CommandContext& context, const DownlinkArguments& arguments) {
  auto target = ConnectToDownlinker(context);
  if (!target) return context.Report(target.error());
  proto::DownlinkRequest request;
  request.set_bytes_max(std::uint64_t{1000} * arguments.budget_kb);
  const auto reply = target->client->Downlink(request);
  if (!reply) return context.Report(reply.error());
  JsonWriter json;
  json.BeginObject().Key("agent").String(target->agent->name()).Key("left").Number(reply->left_count());
  if (!reply->has_made()) {
    json.Key("bundle").Null().EndObject();
    return context.Done(json.text(), "nothing to send: every record for the ground station is in a bundle");
  }
  const std::string number = std::to_string(reply->made().number());
  auto file = Fetch(*target, reply->made().number(), arguments.out);
  if (!file) {
    file.error().text += "; the agent keeps the bundle; fetch it with " + Typed(context, "get " + number);
    return context.Report(file.error());
  }
  json.Key("bundle");
  WriteBundle(reply->made(), json);
  json.Key("file").String(*file).EndObject();
  return context.Done(json.text(), Describe(reply->made()) + "; " + LeftText(reply->left_count()) + "\nwrote " + *file +
                                       "; after the ground station has received the file, run " +
                                       Typed(context, "ack " + number + " --file " + *file));
}

ExitCode ListBundles(CommandContext& context) {
  auto target = ConnectToDownlinker(context);
  if (!target) return context.Report(target.error());
  const auto reply = target->client->Downlink({});
  if (!reply) return context.Report(reply.error());
  Table table({"BUNDLE", "MADE", "RECORDS", "SIZE", "HASH"});
  JsonWriter json;
  json.BeginObject().Key("agent").String(target->agent->name()).Key("waiting").BeginArray();
  for (const proto::DownlinkBundle& bundle : reply->waiting()) {
    WriteBundle(bundle, json);
    table.Add({std::to_string(bundle.number()), FormatUtc(bundle.made_ns()), FormatCount(bundle.record_count()),
               FormatBytes(bundle.bytes()), HashText(bundle.hash())});
  }
  json.EndArray().Key("left").Number(reply->left_count()).EndObject();
  const std::string waiting = reply->waiting().empty() ? "no bundle waits for an acknowledgment\n" : table.Text();
  return context.Done(json.text(), waiting + LeftText(reply->left_count()));
}

ExitCode GetBundle(CommandContext& context, const DownlinkArguments& arguments) {
  auto target = ConnectToDownlinker(context);
  if (!target) return context.Report(target.error());
  const auto file = Fetch(*target, arguments.number, arguments.out);
  if (!file) return context.Report(file.error());
  JsonWriter json;
  json.BeginObject().Key("file").String(*file).EndObject();
  return context.Done(json.text(), "wrote " + *file);
}

// Checks that the agent's bundle with this number equals the file.
Result<void> CheckSame(Client& client, const DownlinkArguments& arguments) {
  const auto file = ReadTextFile(arguments.file, kBundleBytesMax);
  if (!file) return tl::unexpected(InputError(file.error()));
  const auto reply = client.Downlink({});
  if (!reply) return tl::unexpected(reply.error());
  for (const proto::DownlinkBundle& bundle : reply->waiting()) {
    if (bundle.number() != arguments.number) continue;
    if (bundle.hash() == HashOfBundle(*file)) return {};
    return Fail(ErrorCode::kRefused, "is not identical to the agent's bundle " + std::to_string(bundle.number()),
                arguments.file);
  }
  return Fail(ErrorCode::kNotFound, "the agent has no unacknowledged bundle " + std::to_string(arguments.number));
}

ExitCode AcknowledgeBundle(CommandContext& context, const DownlinkArguments& arguments) {
  auto target = ConnectToDownlinker(context);
  if (!target) return context.Report(target.error());
  if (!arguments.file.empty()) {
    if (auto same = CheckSame(*target->client, arguments); !same) return context.Report(same.error());
  }
  proto::DownlinkRequest request;
  request.set_acknowledge(arguments.number);
  const auto reply = target->client->Downlink(request);
  if (!reply) return context.Report(reply.error());
  JsonWriter json;
  json.BeginObject().Key("acknowledged").Number(arguments.number);
  json.Key("waiting").Number(reply->waiting_size()).Key("left").Number(reply->left_count()).EndObject();
  return context.Done(json.text(), "bundle " + std::to_string(arguments.number) + " is acknowledged; " +
                                       "unacknowledged bundles: " + FormatCount(reply->waiting_size()) + "; " +
                                       LeftText(reply->left_count()));
}

ExitCode ShowBundle(CommandContext& context, const DownlinkArguments& arguments) {
  const auto file = ReadTextFile(arguments.file, kBundleBytesMax);
  if (!file) return context.Report(InputError(file.error()));
  // Without a team file, the bundle is shown without the names of the custom types.
  CustomTypes custom_types;
  if (!context.TeamPath().empty()) {
    const auto team = context.Team();
    if (!team) return context.Report(team.error());
    custom_types = (*team)->config.custom_types();
  }
  std::map<std::string, double> counts;
  JsonWriter records;
  records.BeginArray();
  const auto head = ReadBundle(*file, [&](const proto::StoredRecord& stored) -> Result<void> {
    proto::Record record;
    if (!record.ParseFromString(stored.content())) {
      return Fail(ErrorCode::kCorrupt,
                  ToString(FromProto(stored.key())) +
                      " cannot be decoded: fetch the bundle again, or read it with the version of moondb that made it");
    }
    counts[DataTypeName(stored.key().data_type(), custom_types)] += 1;
    if (context.is_json) WriteRecord(stored, record, custom_types, records);
    return {};
  });
  if (!head) return context.Report(InputError({head.error().code, head.error().text, arguments.file}));
  records.EndArray();
  JsonWriter json;
  json.BeginObject().Key("team").String(head->team()).Key("agent").Number(head->agent_id());
  json.Key("number").Number(head->number()).Key("made").String(FormatUtc(head->made_ns()));
  json.Key("hash").String(HashText(HashOfBundle(*file))).Key("records").Raw(records.text()).EndObject();
  Table table({"TYPE", "RECORDS"});
  for (const auto& [type, count] : counts) table.Add({type, FormatCount(count)});
  return context.Done(json.text(), "bundle " + std::to_string(head->number()) + " of team " + OneLine(head->team()) +
                                       ", made by agent " + std::to_string(head->agent_id()) + " at " +
                                       FormatUtc(head->made_ns()) + "\n" + table.Text());
}

void AddNumber(Command& command, DownlinkArguments& arguments) {
  command.AddOption("number", arguments.number, "Number of the bundle")
      .TypeName("NUMBER")
      .Within(1u, std::numeric_limits<std::uint32_t>::max())
      .Required();
}

void AddOut(Command& command, DownlinkArguments& arguments) {
  command.AddOption("--out", arguments.out, "Output file (default: AGENT-NUMBER.bundle here)").TypeName("FILE");
}

}  // namespace

void AddDownlinkCommands(Command& app, CommandContext& context) {
  auto arguments = std::make_shared<DownlinkArguments>();
  const auto act = [&context, arguments](ExitCode (*action)(CommandContext&, const DownlinkArguments&)) {
    return [&context, arguments, action] {
      context.action = [&context, arguments, action] { return action(context, *arguments); };
    };
  };

  Command& group =
      AddCommand(app, "downlink", "Make a bundle of records that the ground station lacks (at the base station, or -a)",
                 {"moonctl downlink --budget-kb 64"});
  group.AllowSubcommand();
  group.AddOption("--budget-kb", arguments->budget_kb, "Maximum size of the bundle file in kB (2 to 16000)")
      .TypeName("KB")
      .Within(2u, 16000u);
  AddOut(group, *arguments);

  AddCommand(group, "list", "List the bundles that the ground station has not acknowledged",
             {"moonctl downlink list", kShows})
      .Callback([&context] { context.action = [&context] { return ListBundles(context); }; });
  Command& get =
      AddCommand(group, "get", "Fetch an unacknowledged bundle again", {"moonctl downlink get 7 --out pass-12.bundle"});
  AddNumber(get, *arguments);
  AddOut(get, *arguments);
  get.Callback(act(GetBundle));
  Command& ack =
      AddCommand(group, "ack", "Acknowledge a bundle that the ground station has received, so that it is deleted",
                 {"moonctl downlink ack 7 --file pass-12.bundle"});
  AddNumber(ack, *arguments);
  ack.AddOption("--file", arguments->file, "Acknowledge only if FILE equals the bundle").TypeName("FILE");
  ack.Callback(act(AcknowledgeBundle));
  Command& show = AddCommand(group, "show", "Show the contents of a bundle file; --json prints its records",
                             {"moonctl downlink show pass-12.bundle --json"});
  show.AddOption("file", arguments->file, "Bundle file").TypeName("FILE").Required();
  show.Callback(act(ShowBundle));

  group.Callback([&context, &group, arguments, act] {
    if (group.GivenSubcommand() != nullptr) return;
    if (arguments->budget_kb > 0) return act(MakeBundle)();
    context.action = [&context] {
      return context.Report({ErrorCode::kInvalid, "expected downlink --budget-kb N, list, get, ack or show", {}});
    };
  });
}

}  // namespace moondb
