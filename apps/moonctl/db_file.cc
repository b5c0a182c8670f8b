#include <chrono>

#include "actors/storage/store_file.h"
#include "apps/common/data_folder.h"
#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/db_commands.h"
#include "model/text.h"

namespace moondb {
namespace {

// The file of -a, which must lie on this machine.
Result<std::filesystem::path> StoreOf(CommandContext& context, const std::string& data_folder) {
  if (context.agent.empty()) return Fail(ErrorCode::kInvalid, "which agent's file? Give -a rover1");
  if (!context.via.empty()) return Fail(ErrorCode::kInvalid, "reads a file on this machine; run it there", "--via");
  const auto agents = context.ChosenAgents();
  if (!agents) return tl::unexpected(agents.error());
  const std::string& name = agents->front()->name();
  const std::filesystem::path folder =
      data_folder.empty() ? DefaultDataFolder(context.TeamPath(), name) : std::filesystem::path(data_folder) / name;
  return folder / kDatabaseFile;
}

std::string TextOf(const QueryCell& cell) {
  if (cell.kind == QueryCell::Kind::kNull) return "NULL";
  return cell.kind == QueryCell::Kind::kBlob ? "x'" + cell.text + "'" : cell.text;
}

void Write(const QueryCell& cell, JsonWriter& json) {
  if (cell.kind == QueryCell::Kind::kNull) {
    json.Null();
  } else if (cell.kind == QueryCell::Kind::kNumber && ParseDouble(cell.text)) {
    json.Raw(cell.text);
  } else {
    json.String(TextOf(cell));
  }
}

}  // namespace

ExitCode QueryFile(CommandContext& context, const StoreFileArguments& arguments) {
  const auto file = StoreOf(context, arguments.data_folder);
  if (!file) return context.Report(file.error());
  const auto deadline = std::chrono::steady_clock::now() + context.WaitTimeout();
  const auto answer = QueryStore(*file, arguments.text, arguments.rows_max,
                                 [deadline] { return std::chrono::steady_clock::now() > deadline; });
  if (!answer) return context.Report(answer.error());
  Table table(answer->columns);
  JsonWriter json;
  json.BeginObject().Key("columns").BeginArray();
  for (const std::string& column : answer->columns) json.String(column);
  json.EndArray().Key("rows").BeginArray();
  for (const std::vector<QueryCell>& row : answer->rows) {
    std::vector<std::string> texts;
    json.BeginArray();
    for (const QueryCell& cell : row) {
      texts.push_back(TextOf(cell));
      Write(cell, json);
    }
    json.EndArray();
    table.Add(std::move(texts));
  }
  json.EndArray().Key("is_cut").Bool(answer->is_cut).EndObject();
  const std::string cut = answer->is_cut ? "and more; see --limit\n" : "";
  return context.Done(json.text(), table.Text() + cut);
}

ExitCode BackUpFile(CommandContext& context, const StoreFileArguments& arguments) {
  const auto file = StoreOf(context, arguments.data_folder);
  if (!file) return context.Report(file.error());
  if (auto done = BackUpStore(*file, arguments.text); !done) return context.Report(done.error());
  std::error_code error;
  const auto bytes = static_cast<double>(std::filesystem::file_size(arguments.text, error));
  JsonWriter json;
  json.BeginObject().Key("file").String(arguments.text).Key("of").String(file->string());
  json.Key("bytes").Number(bytes).EndObject();
  return context.Done(json.text(),
                      "wrote " + arguments.text + ": all of " + file->string() + ", " + FormatBytes(bytes));
}

}  // namespace moondb
