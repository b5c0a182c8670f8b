#include <map>
#include <set>

#include "apps/common/hash_text.h"
#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/copies.h"
#include "model/custom_types.h"
#include "runtime/team/team_config.h"

namespace moondb {
namespace {

std::set<DataType> LatestTypes(const proto::TeamConfig& team) {
  std::set<DataType> types;
  for (const DataType type : DataTypesOf(team)) {
    if (SharePolicyOf(team, type) == proto::POLICY_LATEST) types.insert(type);
  }
  return types;
}

// Returns "40 local_traversability_map of rover2, 5 pose_graph_node of rover2".
std::string LostText(const proto::TeamConfig& team, const HaveSet& records) {
  std::map<std::pair<AgentId, DataType>, std::uint64_t> counts;
  for (const auto& [stream, have] : records.streams()) counts[{stream.origin, stream.type}] += have.held.Count();
  std::string text;
  for (const auto& [series, count] : counts) {
    text += (text.empty() ? "" : ", ") + FormatCount(static_cast<double>(count)) + " " +
            DataTypeName(series.second, team.custom_types()) + " of " + AgentName(team, series.first);
  }
  return text;
}

// Writes the keys of records as intervals of seqs.
void WriteKeys(const proto::TeamConfig& team, const HaveSet& records, JsonWriter& json) {
  json.BeginArray();
  for (const auto& [stream, have] : records.streams()) {
    for (const IntervalSet::Interval& interval : have.held.intervals()) {
      json.BeginObject().Key("origin").String(AgentName(team, stream.origin));
      json.Key("epoch").String(HashText(stream.epoch));
      json.Key("type").String(DataTypeName(stream.type, team.custom_types()));
      json.Key("first").Number(static_cast<double>(interval.first));
      json.Key("last").Number(static_cast<double>(interval.last)).EndObject();
    }
  }
  json.EndArray();
}

ExitCode ShowRisk(CommandContext& context) {
  const auto answers = context.CallEach([](Client& client) { return client.GetHaveSet(); });
  if (!answers) return context.Report(answers.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  std::vector<HaveSet> haves;
  for (const auto& [agent, have] : *answers) haves.push_back(have ? *have : HaveSet());
  const std::vector<CopyCounts> counts = CountCopies(haves, LatestTypes(team));
  Table table({"AGENT", "ONE COPY", "TWO", "THREE OR MORE"});
  std::string lost;
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  for (std::size_t i = 0; i < answers->size(); ++i) {
    const auto& [agent, have] = (*answers)[i];
    BeginAgent((*answers)[i], json);
    if (!have) {
      table.Add({agent->name(), WhyNoAnswer(have.error())}, Tone::kBad);
      lost += agent->name() +
              " did not answer: its copies are not counted, and the records that only it holds are unknown\n";
      json.EndObject();
      continue;
    }
    const auto text = [](std::uint64_t count) { return FormatCount(static_cast<double>(count)); };
    table.Add({agent->name(), text(counts[i].one), text(counts[i].two), text(counts[i].three_or_more)});
    if (counts[i].one > 0) {
      lost +=
          "if " + agent->name() + "'s disk is lost, these records are lost: " + LostText(team, counts[i].alone) + "\n";
    }
    json.Key("one_copy").Number(static_cast<double>(counts[i].one));
    json.Key("two_copies").Number(static_cast<double>(counts[i].two));
    json.Key("three_or_more_copies").Number(static_cast<double>(counts[i].three_or_more));
    json.Key("lost_without");
    WriteKeys(team, counts[i].alone, json);
    json.EndObject();
  }
  json.EndArray().EndObject();
  return context.Print(ExitCodeOf(*answers), json.text(), table.Text() + lost);
}

}  // namespace

void AddRiskCommand(Command& app, CommandContext& context) {
  AddCommand(app, "risk", "Show how many copies each agent's records have, and which are lost if its disk is lost",
             {"moonctl risk --json", kShows})
      .Callback([&context] { context.action = [&context] { return ShowRisk(context); }; });
}

}  // namespace moondb
