#include <CLI/CLI.hpp>
#include <chrono>

#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/commands.h"
#include "model/text.h"
#include "runtime/did_you_mean.h"

namespace moondb {
namespace {

constexpr std::uint32_t kListMax = 1000;
constexpr std::size_t kJsonBytesMax = 16 * 1024 * 1024;

struct RecordArguments {
  std::string type;
  std::string json;
  std::string key;
  std::string origin;
  std::uint32_t limit = 20;
  bool is_local = false;
};

Result<DataType> TypeNamed(const std::string& name) {
  if (const auto type = DataTypeFromName(name)) return *type;
  std::vector<std::string> names;
  const auto* known = proto::DataType_descriptor();
  for (int i = 0; i < known->value_count(); ++i) {
    const auto number = static_cast<DataType>(known->value(i)->number());
    if (number != 0) names.push_back(DataTypeName(number));
  }
  return Fail(ErrorCode::kInvalid, "no data type \"" + name + "\"" + DidYouMean(name, names));
}

std::int64_t UtcNowNs() {
  const auto since_epoch = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(since_epoch).count();
}

// The agent whose records these are; there is no natural choice of one.
Result<AgentClient> ConnectToChosen(CommandContext& context) {
  if (!context.agent.empty()) return context.Connect(context.agent);
  return Fail(ErrorCode::kInvalid, "which agent? Give -a rover1");
}

ExitCode InsertRecord(CommandContext& context, const RecordArguments& arguments) {
  if (auto type = TypeNamed(arguments.type); !type) return context.Report(type.error());
  std::string body = arguments.json;
  if (body.starts_with("@")) {
    auto read = ReadTextFile(body.substr(1), kJsonBytesMax);
    if (!read) return context.Report(read.error());
    body = std::move(*read);
  }
  auto record = RecordFromJson(arguments.type, body);
  if (!record) return context.Report(record.error());
  record->set_stamp_ns(UtcNowNs());
  auto target = ConnectToChosen(context);
  if (!target) return context.Report(target.error());
  auto keys = target->client->Insert({*record}, arguments.is_local);
  if (!keys) return context.Report(keys.error());
  const std::string key = keys->empty() || arguments.is_local ? "" : ToString(keys->front());
  JsonWriter json;
  json.BeginObject().Key("key").String(key).EndObject();
  return context.Done(json.text(), arguments.is_local ? "stored, local" : key);
}

void WriteRecord(const proto::StoredRecord& stored, const proto::Record& record, JsonWriter& json) {
  json.BeginObject().Key("key").String(stored.key().seq() == 0 ? "" : ToString(FromProto(stored.key())));
  json.Key("type").String(DataTypeName(stored.key().data_type()));
  json.Key("bytes").Number(static_cast<double>(stored.content().size()));
  json.Key("record").Raw(ToJson(record)).EndObject();
}

ExitCode GetRecord(CommandContext& context, const RecordArguments& arguments) {
  const auto key = ParseRecordKey(arguments.key);
  if (!key) return context.Report(key.error());
  auto target = ConnectToChosen(context);
  if (!target) return context.Report(target.error());
  proto::ReadRequest request;
  request.add_data_types(key->stream.type);
  request.add_origin_agents(key->stream.origin);
  std::string found;
  const auto read = target->client->ReadAll(
      request, [&](const proto::StoredRecord& stored, const proto::Record& record) -> Result<void> {
        if (FromProto(stored.key()) != *key) return {};
        JsonWriter json;
        WriteRecord(stored, record, json);
        found = json.text();
        return Fail(ErrorCode::kNotFound, "no further");  // Ends the reading.
      });
  if (!found.empty()) return context.Done(found, found);
  if (!read) return context.Report(read.error());
  return context.Report({ErrorCode::kNotFound, target->agent->name() + " does not hold " + arguments.key, {}});
}

ExitCode ListRecords(CommandContext& context, const RecordArguments& arguments) {
  proto::ReadRequest request;
  request.set_is_newest_first(true);
  request.set_records_max(arguments.limit);
  request.set_content_bytes_max(8 * 1024 * 1024);
  if (!arguments.type.empty()) {
    auto type = TypeNamed(arguments.type);
    if (!type) return context.Report(type.error());
    request.add_data_types(*type);
  }
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  if (!arguments.origin.empty()) {
    auto origin = AgentNamed((*team)->config, arguments.origin);
    if (!origin) return context.Report(origin.error());
    request.add_origin_agents((*origin)->id());
  }
  auto target = ConnectToChosen(context);
  if (!target) return context.Report(target.error());
  auto page = target->client->Read(request);
  if (!page) return context.Report(page.error());

  Table table({"KEY", "TYPE", "ORIGIN", "STAMP", "BYTES"});
  JsonWriter json;
  json.BeginObject().Key("records").BeginArray();
  for (const proto::StoredRecord& stored : page->records()) {
    proto::Record record;
    if (!record.ParseFromString(stored.content())) {
      return context.Report({ErrorCode::kCorrupt, ToString(FromProto(stored.key())) + " does not decode", {}});
    }
    WriteRecord(stored, record, json);
    table.Add({stored.key().seq() == 0 ? "(local)" : ToString(FromProto(stored.key())),
               DataTypeName(stored.key().data_type()), AgentName((*team)->config, stored.key().origin_agent()),
               FormatStampNs(record.stamp_ns()), std::to_string(stored.content().size())});
  }
  json.EndArray().EndObject();
  return context.Done(json.text(), table.Text());
}

}  // namespace

void AddRecordCommands(CLI::App& app, CommandContext& context) {
  CLI::App& group = *app.add_subcommand("record", "Insert, get and list records of an agent (-a)");
  group.require_subcommand(1);
  auto arguments = std::make_shared<RecordArguments>();

  CLI::App& insert = *group.add_subcommand("insert", "Insert one record, as the agent's own");
  insert.add_option("type", arguments->type, "Such as temperature")->required();
  insert.add_option("json", arguments->json, "Its body, such as {\"celsius\": -20}; @FILE reads it")->required();
  insert.add_flag("--local", arguments->is_local, "Keep it on this agent");
  insert.callback(
      [&context, arguments] { context.action = [&context, arguments] { return InsertRecord(context, *arguments); }; });

  CLI::App& get = *group.add_subcommand("get", "Show one record as JSON");
  get.add_option("key", arguments->key, "Such as 2.5f3c9a1e0b7d4c21.30.17")->required();
  get.callback(
      [&context, arguments] { context.action = [&context, arguments] { return GetRecord(context, *arguments); }; });

  CLI::App& list = *group.add_subcommand("list", "The newest records");
  list.add_option("type", arguments->type, "Of this data type only");
  list.add_option("--origin", arguments->origin, "Of this agent only");
  list.add_option("--limit", arguments->limit, "At most so many (20)")->check(CLI::Range(1u, kListMax));
  list.callback(
      [&context, arguments] { context.action = [&context, arguments] { return ListRecords(context, *arguments); }; });
}

}  // namespace moondb
