
#include <cctype>
#include <string>

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/common/utc.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/follow.h"
#include "apps/moonctl/record_json.h"
#include "apps/moonctl/time_span_option.h"
#include "model/custom_types.h"
#include "model/did_you_mean.h"
#include "model/record_check.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr std::uint32_t kListMax = 1000;
constexpr std::size_t kJsonBytesMax = 16 * 1024 * 1024;

struct RecordArguments {
  std::string type;
  std::string json;
  std::string payload_file;
  std::string key;
  std::string origin;
  std::uint32_t limit = 20;
  bool is_local = false;
  bool follows = false;
  bool is_history = false;
  TimeSpanArguments times;
};

Result<DataType> TypeNamed(const std::string& name, const CustomTypes& custom_types) {
  if (const auto type = DataTypeFromName(name, custom_types)) return *type;
  return Fail(ErrorCode::kInvalid, "no data type \"" + name + "\"" + DidYouMean(name, DataTypeNames(custom_types)));
}

// Connects to the agent given with -a, otherwise to the only agent of this machine.
Result<AgentClient> ConnectToChosen(CommandContext& context) {
  const auto chosen = context.ChosenOrOnlyHere();
  if (!chosen) return tl::unexpected(chosen.error());
  return context.Connect((*chosen)->name());
}

// Returns the content of FILE for "@FILE", otherwise the text itself.
Result<std::string> TextOrFile(const std::string& text) {
  if (!text.starts_with("@")) return text;
  return ReadTextFile(text.substr(1), kJsonBytesMax);
}

Result<proto::Record> MakeRecord(const TeamFile& team, const RecordArguments& arguments) {
  const Result<DataType> type = TypeNamed(arguments.type, team.config.custom_types());
  if (!type) return tl::unexpected(type.error());
  const Result<std::string> body = TextOrFile(arguments.json);
  if (!body) return tl::unexpected(InputError(body.error()));
  const bool has_file = !arguments.payload_file.empty();
  if (!IsCustom(*type)) {
    if (has_file) return Fail(ErrorCode::kInvalid, "only custom types have a payload", "--payload-file");
    std::string text = *body;
    std::erase_if(text, [](char letter) { return std::isspace(static_cast<unsigned char>(letter)) != 0; });
    if (text == "{}")
      return Fail(ErrorCode::kInvalid, "the JSON object is empty: give each field, also fields that are 0");
    return RecordFromJson(arguments.type, *body);
  }
  Result<proto::Record> record = CustomRecordFromJson(arguments.type, *type, has_file && body->empty() ? "{}" : *body);
  if (!record || !has_file) return record;
  if (!record->custom().payload().empty()) {
    return Fail(ErrorCode::kInvalid, "cannot be combined with a payload in the JSON object", "--payload-file");
  }
  Result<std::string> payload = ReadTextFile(arguments.payload_file, kCustomPayloadBytesMax);
  if (!payload) return tl::unexpected(InputError(payload.error()));
  record->mutable_custom()->set_payload(*std::move(payload));
  return record;
}

ExitCode InsertRecord(CommandContext& context, const RecordArguments& arguments) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  auto record = MakeRecord(**team, arguments);
  if (!record) return context.Report(record.error());
  record->set_timestamp_ns(UtcNowNs());
  auto target = ConnectToChosen(context);
  if (!target) return context.Report(target.error());
  auto keys = target->client->Insert({*record}, arguments.is_local);
  if (!keys) return context.Report(keys.error());
  const std::string key = keys->empty() || arguments.is_local ? "" : ToString(keys->front());
  JsonWriter json;
  json.BeginObject().Key("key").String(key).EndObject();
  return context.Done(json.text(), arguments.is_local ? "stored, local" : key);
}

ExitCode ShowNextNode(CommandContext& context) {
  auto target = ConnectToChosen(context);
  if (!target) return context.Report(target.error());
  const Result<std::uint64_t> next = target->client->NextNodeIndex();
  if (!next) return context.Report(next.error());
  JsonWriter json;
  json.BeginObject().Key("next_node_index").String(std::to_string(*next)).EndObject();
  return context.Done(json.text(), std::to_string(*next));
}

std::string KeyOf(const proto::StoredRecord& stored) {
  return stored.key().seq() == 0 ? "(local)" : ToString(FromProto(stored.key()));
}

Result<proto::Record> Decode(const proto::StoredRecord& stored) {
  proto::Record record;
  if (record.ParseFromString(stored.content())) return record;
  return Fail(ErrorCode::kCorrupt, KeyOf(stored) + " cannot be decoded");
}

ExitCode GetRecord(CommandContext& context, const RecordArguments& arguments) {
  const auto key = ParseRecordKey(arguments.key);
  if (!key) return context.Report(key.error());
  auto target = ConnectToChosen(context);
  if (!target) return context.Report(target.error());
  const CustomTypes& custom_types = (*context.Team())->config.custom_types();
  const Result<proto::StoredRecord> stored = target->client->ReadOne(*key);
  if (!stored) return context.Report(stored.error());
  const Result<proto::Record> record = Decode(*stored);
  if (!record) return context.Report(record.error());
  JsonWriter json;
  WriteRecord(*stored, *record, custom_types, json);
  return context.Done(json.text(), json.text());
}

// Prints new records as they arrive, one per line.
ExitCode FollowList(CommandContext& context, Client& client, proto::ReadRequest request) {
  const proto::TeamConfig& team = (*context.Team())->config;
  request.set_is_newest_first(false);
  request.clear_records_max();
  return FollowRecords(context, client, std::move(request),
                       [&](const proto::StoredRecord& stored, const proto::Record& record) {
                         if (context.is_json) {
                           JsonWriter json;
                           WriteRecord(stored, record, team.custom_types(), json);
                           return json.text();
                         }
                         return KeyOf(stored) + "  " + DataTypeName(stored.key().data_type(), team.custom_types()) +
                                "  " + AgentName(team, stored.key().origin_agent()) + "  " +
                                FormatUtc(record.timestamp_ns()) + "  " + ValueText(record);
                       });
}

ExitCode ListRecords(CommandContext& context, const RecordArguments& arguments) {
  proto::ReadRequest request;
  request.set_is_newest_first(true);
  request.set_is_history(arguments.is_history);
  request.set_records_max(arguments.limit);
  request.set_content_bytes_max(8 * 1024 * 1024);
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  const CustomTypes& custom_types = (*team)->config.custom_types();
  if (!arguments.type.empty()) {
    auto type = TypeNamed(arguments.type, custom_types);
    if (!type) return context.Report(type.error());
    request.add_data_types(*type);
  }
  if (!arguments.origin.empty()) {
    auto origin = AgentNamed((*team)->config, arguments.origin);
    if (!origin) return context.Report(origin.error());
    request.add_origin_agents((*origin)->id());
  }
  if (const auto set = SetTimes(arguments.times, UtcNowNs(), request); !set) return context.Report(set.error());
  auto target = ConnectToChosen(context);
  if (!target) return context.Report(target.error());
  if (arguments.follows) return FollowList(context, *target->client, std::move(request));
  auto page = target->client->Read(request);
  if (!page) return context.Report(page.error());

  Table table({"KEY", "TYPE", "ORIGIN", "TIME", "BYTES", "VALUE"});
  JsonWriter json;
  json.BeginObject().Key("records").BeginArray();
  for (const proto::StoredRecord& stored : page->records()) {
    const Result<proto::Record> record = Decode(stored);
    if (!record) return context.Report(record.error());
    WriteRecord(stored, *record, custom_types, json);
    table.Add({KeyOf(stored), DataTypeName(stored.key().data_type(), custom_types),
               AgentName((*team)->config, stored.key().origin_agent()), FormatUtc(record->timestamp_ns()),
               std::to_string(stored.content().size()), ValueText(*record)});
  }
  json.EndArray().EndObject();
  return context.Done(json.text(), table.Text());
}

}  // namespace

void AddRecordCommands(Command& app, CommandContext& context) {
  Command& group = app.AddSubcommand("record", "Insert, get and list records of an agent (-a)");
  group.RequireSubcommand();
  auto arguments = std::make_shared<RecordArguments>();

  Command& insert = AddCommand(
      group, "insert", "Insert one record, with agent -a as its origin",
      {"moonctl -a rover2 record insert temperature '{\"celsius\": -40.5}'\n"
       // A loop closure.
       "moonctl -a rover2 record insert pose_graph_edge '{\"from\": {\"agent_id\": 2, \"index\": 140}, \"to\": "
       "{\"agent_id\": 1, \"index\": 17}, \"source\": \"apriltag\", \"relative_pose\": {\"from_from_to\": "
       "{\"position_m\": {\"x\": 1.2}, \"orientation\": {\"w\": 1}}, \"covariance\": "
       "[0.01,0,0,0,0,0,0.01,0,0,0,0,0.01,0,0,0,0.01,0,0,0.01,0,0.0004]}}'\n"
       // A position by GNSS.
       "moonctl -a rover2 record insert pose_prior '{\"node\": {\"agent_id\": 2, \"index\": 140}, \"position_m\": "
       "{\"x\": 12.1, \"y\": 7.4}, \"covariance\": [0.01,0,0,0.01,0,0.04], \"source\": \"gnss\"}'"});
  insert.AddOption("type", arguments->type, "Data type, such as temperature, or a custom type of the team file")
      .TypeName("DATATYPE")
      .Required();
  insert.AddOption(
      "json", arguments->json,
      "Body of the record, such as {\"celsius\": -20}; @FILE reads it. For a custom type {\"payload\": BASE64, "
      "\"latest_key\": BASE64, \"metadata\": TEXT}, or payload_text and latest_key_text");
  insert.AddOption("--payload-file", arguments->payload_file, "File with the payload of a custom type")
      .TypeName("FILE");
  insert.AddFlag("--local", arguments->is_local, "Do not share the record");
  insert.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return InsertRecord(context, *arguments); }; });

  AddCommand(group, "next-node", "Show the index of the robot's next node",
             {"moonctl -a rover1 record next-node", kShows})
      .Callback([&context] { context.action = [&context] { return ShowNextNode(context); }; });

  Command& get = AddCommand(group, "get", "Show one record as JSON",
                            {"moonctl -a rover1 record get 2.5f3c9a1e0b7d4c21.30.17", kShows});
  get.AddOption("key", arguments->key, "Key of the record, such as 2.5f3c9a1e0b7d4c21.30.17").Required();
  get.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return GetRecord(context, *arguments); }; });

  Command& list = AddCommand(group, "list", "List the newest records",
                             {"moonctl -a rover1 record list temperature --since 10m --limit 5", kShows});
  list.AddOption("type", arguments->type, "Data type to list").TypeName("DATATYPE");
  Option& follow = list.AddFlag("-f,--follow", arguments->follows,
                                "Print new records, one per line (with --json one document each), until Ctrl-C");
  list.AddOption("--origin", arguments->origin, "Show only records of this agent").TypeName("AGENT");
  list.AddFlag("--history", arguments->is_history,
               "List the superseded states of the agent's own robot that `keep` in the team file retains")
      .Excludes(follow);
  AddTimeSpanOptions(list, arguments->times, follow);
  list.AddOption("--limit", arguments->limit, "Maximum number of records (20)").Within(1u, kListMax);
  list.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return ListRecords(context, *arguments); }; });
}

}  // namespace moondb
