
#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/db_commands.h"
#include "apps/moonctl/holdings.h"
#include "apps/moonctl/map_holdings.h"
#include "model/custom_types.h"
#include "proto/status.pb.h"

namespace moondb {
namespace {

struct DiffArguments {
  std::string first;
  std::string second;
};

// Returns a table header: the columns in `first`, then the agents' names.
template <typename T>
std::vector<std::string> HeaderOf(std::vector<std::string> first, const AgentAnswers<T>& answers) {
  for (const auto& [agent, answer] : answers) first.push_back(agent->name());
  return first;
}

double CountOf(const proto::StorageStatus& storage, std::optional<DataType> type) {
  double count = 0;
  for (const proto::RecordCount& part : storage.counts()) {
    if (!type || part.data_type() == *type) count += part.count();
  }
  return count;
}

// Returns a table with one row per data type, including types that are not shared. Shows "?" for agents that do not
// answer.
std::string RowsText(const CustomTypes& custom_types, const AgentAnswers<proto::AgentStatus>& answers) {
  std::set<DataType> types;
  for (const auto& [agent, status] : answers) {
    if (!status) continue;
    for (const proto::RecordCount& part : status->storage().counts()) types.insert(part.data_type());
  }
  Table table(HeaderOf({"ROWS"}, answers));
  const auto add = [&](const std::string& name, std::optional<DataType> type) {
    std::vector<std::string> row{name};
    for (const auto& [agent, status] : answers) {
      row.push_back(status ? FormatCount(CountOf(status->storage(), type)) : "?");
    }
    table.Add(std::move(row));
  };
  for (const DataType type : types) add(DataTypeName(type, custom_types), type);
  add("all", std::nullopt);
  return table.Text();
}

// Bytes that storage wrote per day. The last day in the agent's report counts as today.
struct WrittenBytes {
  double today = 0;
  double yesterday = 0;
  double mean = 0;  // Mean of the reported days, including today so far.
};

WrittenBytes WrittenBytesOf(const proto::StorageStatus& storage) {
  WrittenBytes written;
  if (storage.written().empty()) return written;
  const std::uint32_t today = storage.written().rbegin()->day();
  double sum = 0;
  for (const proto::DayBytes& day : storage.written()) {
    if (day.day() == today) written.today = day.bytes();
    if (day.day() + 1 == today) written.yesterday = day.bytes();
    sum += day.bytes();
  }
  written.mean = sum / storage.written_size();
  return written;
}

std::string BudgetText(const proto::StorageStatus& storage) {
  return storage.database_bytes_max() > 0 ? FormatBytes(storage.database_bytes_max()) : "-";
}

std::string HistoryText(const proto::StorageStatus& storage) {
  if (storage.history_count() == 0) return "-";
  return FormatCount(storage.history_count()) + ", " + FormatBytes(storage.history_bytes());
}

ExitCode ShowInfo(CommandContext& context) {
  const auto answers = context.CallEach([](Client& client) { return client.Status(); });
  if (!answers) return context.Report(answers.error());
  Table table({"AGENT", "DATABASE", "BUDGET", "MAPS", "HISTORY", "WAL", "DISK FREE", "WRITTEN TODAY", "YESTERDAY",
               "MEAN A DAY", "PRUNED", "REFUSED"});
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  std::string remarks;
  for (const auto& asked : *answers) {
    const auto& [agent, status] = asked;
    BeginAgent(asked, json);
    if (status) {
      const proto::StorageStatus& storage = status->storage();
      const WrittenBytes written = WrittenBytesOf(storage);
      table.Add({agent->name(), FormatBytes(storage.database_bytes()), BudgetText(storage),
                 FormatBytes(storage.map_bytes()), HistoryText(storage), FormatBytes(storage.wal_bytes()),
                 FormatBytes(storage.disk_free_bytes()), FormatBytes(written.today), FormatBytes(written.yesterday),
                 FormatBytes(written.mean), FormatCount(storage.pruned_count()),
                 FormatCount(storage.rejected_count())});
      if (!storage.space_low().empty()) remarks += agent->name() + ": space low: " + storage.space_low() + "\n";
      json.Key("storage").Raw(ToJson(storage));
    } else {
      table.Add({agent->name(), WhyNoAnswer(status.error())});
    }
    json.EndObject();
  }
  json.EndArray().EndObject();
  const CustomTypes& custom_types = (*context.Team())->config.custom_types();
  return context.Print(ExitCodeOf(*answers), json.text(),
                       table.Text() + remarks + "\n" + RowsText(custom_types, *answers));
}

std::string HoldingText(const Holding& holding) {
  if (holding.held == 0) return "-";
  const std::string held = std::to_string(holding.held);
  return holding.lacking == 0 ? held : held + ", lacks " + std::to_string(holding.lacking);
}

ExitCode ShowHoldings(CommandContext& context) {
  const auto answers = context.CallEach([](Client& client) { return client.GetHaveSet(); });
  if (!answers) return context.Report(answers.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  std::string without;
  std::vector<HaveSet> haves;
  for (const auto& asked : *answers) {
    const auto& [agent, have] = asked;
    BeginAgent(asked, json);
    json.EndObject();
    haves.push_back(have ? *have : HaveSet());
    if (!have) without += agent->name() + ": " + WhyNoAnswer(have.error()) + "\n";
  }
  json.EndArray().Key("holdings").BeginArray();
  Table table(HeaderOf({"ORIGIN", "TYPE"}, *answers));
  for (const auto& [series, holdings] : HoldingsOf(haves)) {
    const std::string type = DataTypeName(series.second, team.custom_types());
    std::vector<std::string> row{AgentName(team, series.first), type};
    json.BeginObject().Key("origin").String(row[0]).Key("type").String(type).Key("held_by").BeginArray();
    for (std::size_t i = 0; i < holdings.size(); ++i) {
      const auto& [agent, answer] = (*answers)[i];
      row.push_back(answer ? HoldingText(holdings[i]) : "?");
      if (!answer) continue;
      json.BeginObject().Key("agent").String(agent->name());
      json.Key("held").Number(static_cast<double>(holdings[i].held));
      json.Key("lacking").Number(static_cast<double>(holdings[i].lacking)).EndObject();
    }
    json.EndArray().EndObject();
    table.Add(std::move(row));
  }
  json.EndArray().EndObject();
  return context.Print(ExitCodeOf(*answers), json.text(), table.Text() + without);
}

template <typename Arguments>
using FileCommand = ExitCode (*)(CommandContext&, const Arguments&);

// Adds a command that works on the database file of the agent given with -a.
template <typename Arguments>
std::pair<Command*, std::shared_ptr<Arguments>> AddFileCommand(Command& group, CommandContext& context,
                                                               const std::string& name, const std::string& description,
                                                               const CommandNote& note,
                                                               FileCommand<Arguments> command) {
  auto arguments = std::make_shared<Arguments>();
  Command* added = &AddCommand(group, name, description, note);
  added->AddOption("--data-dir", arguments->data_folder, "Folder of the agents' data folders, as given to moonctl up");
  added->Callback([&context, arguments, command] {
    context.action = [&context, arguments, command] { return command(context, *arguments); };
  });
  return {added, arguments};
}

void AddQuery(Command& group, CommandContext& context) {
  const auto [query, arguments] = AddFileCommand<QueryArguments>(
      group, context, "query", "Run a read-only SQL query on the database file of agent -a, on this machine",
      {"moonctl -a rover1 db query \"select * from v_event\" --csv --out events.csv", kShows}, QueryFile);
  query->AddOption("sql", arguments->text, "SELECT statement; the views v_* are stable (docs/commands/records.md)")
      .Required();
  query->AddOption("--limit", arguments->rows_max, "Maximum number of rows (1000; as CSV 1000000)")
      .Within(std::size_t{1}, kQueryRowsMax);
  Option& csv = query->AddFlag("--csv", arguments->is_csv, "Print CSV: NULL is empty, a blob hexadecimal");
  query->AddOption("--out", arguments->out, "Write the CSV to this file").TypeName("FILE").Needs(csv);
}

void AddBackUp(Command& group, CommandContext& context) {
  const auto [backup, arguments] = AddFileCommand<StoreFileArguments>(
      group, context, "backup", "Back up the database of agent -a, on this machine; the agent may keep running",
      {"moonctl -a rover1 db backup rover1.sqlite"}, BackUpFile);
  backup->AddOption("file", arguments->text, "Path of the copy; must not exist yet").Required();
}

}  // namespace

void AddDbCommands(Command& app, CommandContext& context) {
  Command& group = app.AddSubcommand("db", "Inspect, verify, prune and back up the agents' databases");
  group.RequireSubcommand();
  const auto add = [&](const std::string& name, const std::string& description, const CommandNote& note,
                       ExitCode (*command)(CommandContext&)) {
    AddCommand(group, name, description, note).Callback([&context, command] {
      context.action = [&context, command] { return command(context); };
    });
  };
  add("info", "Show sizes, and rows by data type, of each agent (or -a)", {"moonctl db info", kShows}, ShowInfo);
  auto is_for_maps = std::make_shared<bool>(false);
  Command& holdings =
      AddCommand(group, "holdings", "Show which agent holds which shared records, by origin and data type",
                 {"moonctl db holdings", kShows});
  holdings.AddFlag(
      "--maps", *is_for_maps,
      "Show only local maps, with the age of the newest; exit code 1 if an agent lacks maps that it should have");
  holdings.Callback([&context, is_for_maps] {
    context.action = [&context, is_for_maps] {
      return *is_for_maps ? ShowMapHoldings(context) : ShowHoldings(context);
    };
  });
  add("verify", "Check each record of each agent (or -a) for damage; exit code 1 if there is any",
      {"moonctl db verify -a rover2"}, VerifyStores);

  auto arguments = std::make_shared<DiffArguments>();
  Command& diff = AddCommand(group, "diff", "Compare the records of two agents; exit code 1 if they differ",
                             {"moonctl db diff rover1 rover2", kShows});
  diff.AddOption("first", arguments->first, "First agent").TypeName("AGENT").Required();
  diff.AddOption("second", arguments->second, "Second agent").TypeName("AGENT").Required();
  diff.Callback([&context, arguments] {
    context.action = [&context, arguments] { return CompareStores(context, arguments->first, arguments->second); };
  });

  auto prune_arguments = std::make_shared<PruneArguments>();
  Command& prune = AddCommand(
      group, "prune", "Remove records of agent -a that leader and survivor also hold (exit code 4: unreachable)",
      {"moonctl -a rover2 db prune --older-than 30d --dry-run"});
  prune.AddOption("--older-than", prune_arguments->older_than, "Remove records older than AGE (30d, 12h, 90m)")
      .TypeName("AGE");
  prune
      .AddOption(
          "--type", prune_arguments->types,
          "Remove records of this data type; may be repeated. The pose graph and quarantines are removed only if named")
      .TypeName("DATATYPE");
  Option& occluded_maps = prune.AddFlag("--occluded-maps", prune_arguments->occluded_maps,
                                        "Remove only maps that win no cell of the merged map");
  prune
      .AddFlag("--history", prune_arguments->is_history,
               "Remove only the robot's superseded states, of which no other agent has a copy")
      .Excludes(occluded_maps);
  prune.AddOption("--max-mb", prune_arguments->megabytes_max, "Remove at most this much (MB), oldest first")
      .TypeName("MB")
      .Within(0.001, 1e9);
  prune.AddFlag("--dry-run", prune_arguments->is_dry_run, "List what would be removed, and remove nothing");
  prune.Callback([&context, prune_arguments] {
    context.action = [&context, prune_arguments] { return PruneStore(context, *prune_arguments); };
  });

  AddQuery(group, context);
  AddBackUp(group, context);
}

}  // namespace moondb
