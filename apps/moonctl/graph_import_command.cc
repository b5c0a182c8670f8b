#include <memory>

#include "apps/common/json_writer.h"
#include "apps/common/progress.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/g2o_graph.h"
#include "apps/moonctl/graph_commands.h"
#include "apps/moonctl/graph_files.h"
#include "apps/moonctl/graph_import.h"
#include "apps/moonctl/team_letters.h"

namespace moondb {
namespace {

std::string Count(std::size_t count) { return std::to_string(count); }

// Reads a PyFG file or g2o files. Converts g2o to PyFG.
Result<Pyfg> ReadImported(CommandContext& context, const proto::TeamConfig& team, const GraphFileArguments& arguments) {
  auto file = ReadGraphFile(arguments);
  if (!file) return tl::unexpected(file.error());
  if (!file->is_g2o) return std::move(file->pyfg);
  AgentId plain_agent = 0;
  if (!context.agent.empty()) {
    const auto chosen = context.ChosenAgents();
    if (!chosen) return tl::unexpected(chosen.error());
    for (const auto& [letter, agent] : AgentsByLetter(team)) {
      if (agent == chosen->front()->id()) plain_agent = letter;
    }
  }
  return ToPyfg(file->g2o, plain_agent);
}

// Inserts all records. Returns the counts of those that no agent had stored before.
Result<GraphCounts> InsertAll(CommandContext& context, const proto::TeamConfig& team, const GraphImport& import) {
  // Connect to all agents before inserting the first record.
  std::map<AgentId, AgentClient> clients;
  for (const auto& [agent, records] : import.records) {
    auto connected = context.Connect(AgentName(team, agent));
    if (!connected) return tl::unexpected(connected.error());
    clients.emplace(agent, std::move(*connected));
  }
  Progress progress("import");
  GraphCounts added;
  std::size_t before = 0;
  for (const auto& [agent, records] : import.records) {
    Client& client = *clients.at(agent).client;
    const Result<HaveSet> stored = client.GetHaveSet();
    if (!stored) return tl::unexpected(stored.error());
    const auto count = [&](std::size_t end, const std::vector<RecordKey>& keys) {
      for (std::size_t i = 0; i < keys.size(); ++i) {
        if (!stored->Get(keys[i].stream).held.Contains(keys[i].seq)) added.Add(records[end - keys.size() + i]);
      }
      progress.Show(static_cast<double>(before + end), static_cast<double>(import.counts.total()),
                    Count(before + end) + " of " + Count(import.counts.total()) + " records");
    };
    if (auto done = InsertInBatches(client, records, count); !done) return tl::unexpected(done.error());
    before += records.size();
  }
  return added;
}

std::string ImportText(const GraphImport& import, const GraphCounts& added) {
  const GraphCounts& all = import.counts;
  const std::string left_out = "; excluded " + Count(import.left_out_count);
  if (added.total() == 0 && all.total() > 0) {
    return "nothing is new: all " + Count(all.nodes) + " nodes and " + Count(all.edges()) + " edges" +
           (all.priors > 0 ? " and " + Count(all.priors) + " priors" : "") + " are stored already" + left_out;
  }
  std::string text = "inserted " + Count(added.nodes) + " nodes, " + Count(added.odometry) + " odometry edges, " +
                     Count(added.ranges) + " ranges, " + Count(added.closures) + " loop closures and " +
                     Count(added.priors) + " priors at " + Count(import.records.size()) + " agents" + left_out;
  const std::size_t stored_count = all.total() - added.total();
  if (stored_count > 0) text += "; " + Count(stored_count) + " records were stored already";
  return text;
}

ExitCode ImportGraph(CommandContext& context, const GraphFileArguments& arguments) {
  auto team = context.Team();
  if (!team) return context.Report(team.error());
  auto pyfg = ReadImported(context, (*team)->config, arguments);
  if (!pyfg) return context.Report(pyfg.error());
  auto import = PrepareImport((*team)->config, *pyfg);
  if (!import) return context.Report(import.error());
  const Result<GraphCounts> added = InsertAll(context, (*team)->config, *import);
  if (!added) return context.Report(added.error());
  JsonWriter json;
  json.BeginObject().Key("nodes").Number(static_cast<double>(added->nodes));
  json.Key("odometry").Number(static_cast<double>(added->odometry));
  json.Key("ranges").Number(static_cast<double>(added->ranges));
  json.Key("loop_closures").Number(static_cast<double>(added->closures));
  json.Key("priors").Number(static_cast<double>(added->priors));
  json.Key("stored_already").Number(static_cast<double>(import->counts.total() - added->total()));
  json.Key("left_out").Number(static_cast<double>(import->left_out_count)).EndObject();
  return context.Done(json.text(), ImportText(*import, *added));
}

}  // namespace

void AddGraphImport(Command& group, CommandContext& context) {
  auto arguments = std::make_shared<GraphFileArguments>();
  Command& command =
      AddCommand(group, "import",
                 "Insert a graph, each rover's part at its own agent. The letters A, B, ... are the rovers "
                 "in the order of the team file; g2o ids without a letter need -a",
                 {"moonctl graph import mission.pyfg\nmoonctl graph import 0.g2o 1.g2o"});
  AddGraphFileOptions(command, *arguments);
  command.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return ImportGraph(context, *arguments); }; });
}

}  // namespace moondb
