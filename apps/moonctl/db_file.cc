#include <chrono>
#include <cstdio>

#include "actors/storage/store_file.h"
#include "apps/common/csv.h"
#include "apps/common/data_folder.h"
#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/db_commands.h"
#include "model/text.h"
#include "runtime/team/team_keys.h"

namespace moondb {
namespace {

// Returns the path of the database file of the agent given with -a. The file is on this machine but may be missing.
Result<std::filesystem::path> StoreOf(CommandContext& context, const std::string& data_folder) {
  if (!context.via.empty()) {
    return Fail(ErrorCode::kInvalid,
                "cannot be used: this command reads a file on this machine; run it on the agent's machine", "--via");
  }
  const auto chosen = context.ChosenOrOnlyHere();
  if (!chosen) return tl::unexpected(chosen.error());
  const TeamFile& team = **context.Team();
  const std::filesystem::path root =
      data_folder.empty() ? DefaultDataRoot(team.folder) : std::filesystem::path(data_folder);
  const auto folder = FindDataFolder(root, team.config, **chosen);
  if (!folder) return tl::unexpected(folder.error());
  const std::filesystem::path file = *folder / kDatabaseFile;
  std::error_code ignored;
  if (!std::filesystem::exists(file, ignored) && !HasSecretKey(team.config, team.folder, **chosen)) {
    const std::string& name = (*chosen)->name();
    return Fail(ErrorCode::kNotFound,
                "the store of " + name + " is not on this computer: run the command on the computer of " + name,
                "--agent");
  }
  return file;
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

std::string JsonOf(const QueryAnswer& answer) {
  JsonWriter json;
  json.BeginObject().Key("columns").BeginArray();
  for (const std::string& column : answer.columns) json.String(column);
  json.EndArray().Key("rows").BeginArray();
  for (const std::vector<QueryCell>& row : answer.rows) {
    json.BeginArray();
    for (const QueryCell& cell : row) Write(cell, json);
    json.EndArray();
  }
  json.EndArray().Key("is_cut").Bool(answer.is_cut).EndObject();
  return json.text();
}

std::string TableOf(const QueryAnswer& answer) {
  Table table(answer.columns);
  for (const std::vector<QueryCell>& row : answer.rows) {
    std::vector<std::string> texts;
    for (const QueryCell& cell : row) texts.push_back(TextOf(cell));
    table.Add(std::move(texts));
  }
  return table.Text() + (answer.is_cut ? "there are more rows; raise --limit\n" : "");
}

// Returns the rows as CSV. NULL becomes an empty field, and a blob becomes hexadecimal digits.
std::string CsvOf(const QueryAnswer& answer) {
  std::string text;
  const char* separator = "";
  for (const std::string& column : answer.columns) {
    text += separator + CsvField(column);
    separator = ",";
  }
  text += "\n";
  for (const std::vector<QueryCell>& row : answer.rows) {
    separator = "";
    for (const QueryCell& cell : row) {
      text += separator + (cell.kind == QueryCell::Kind::kNull ? "" : CsvField(cell.text));
      separator = ",";
    }
    text += "\n";
  }
  return text;
}

// Writes CSV to the file `out`, or to stdout if `out` is empty. Reports truncation on stderr, because a truncated CSV
// looks complete.
ExitCode PutOutCsv(CommandContext& context, const QueryAnswer& answer, const std::string& out) {
  if (answer.is_cut)
    std::fputs("moonctl: the output is truncated, because there are more rows; raise --limit\n", stderr);
  const std::string csv = CsvOf(answer);
  if (out.empty()) return context.Done("", csv);
  if (auto written = WriteTextFile(out, csv); !written) return context.Report(written.error());
  JsonWriter json;
  json.BeginObject().Key("file").String(out).Key("rows").Number(static_cast<double>(answer.rows.size()));
  json.Key("is_cut").Bool(answer.is_cut).EndObject();
  return context.Done(json.text(), "wrote " + out + ": " + std::to_string(answer.rows.size()) + " rows");
}

constexpr std::size_t kRowsShown = 1000;

}  // namespace

ExitCode QueryFile(CommandContext& context, const QueryArguments& arguments) {
  if (context.is_json && arguments.is_csv && arguments.out.empty()) {
    return context.Report({ErrorCode::kInvalid,
                           "--json and --csv cannot both be printed to stdout; give --out FILE for the CSV", "--csv"});
  }
  const auto file = StoreOf(context, arguments.data_folder);
  if (!file) return context.Report(file.error());
  const std::size_t rows_max = arguments.is_csv ? kQueryRowsMax : kRowsShown;
  const auto deadline = std::chrono::steady_clock::now() + context.WaitTimeout();
  const auto answer = QueryStore(*file, arguments.text, arguments.rows_max == 0 ? rows_max : arguments.rows_max,
                                 [deadline] { return std::chrono::steady_clock::now() > deadline; });
  if (!answer) return context.Report(answer.error());
  if (arguments.is_csv) return PutOutCsv(context, *answer, arguments.out);
  return context.is_json ? context.Done(JsonOf(*answer), "") : context.Done("", TableOf(*answer));
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
                      "wrote " + arguments.text + ", a copy of " + file->string() + ", " + FormatBytes(bytes));
}

}  // namespace moondb
