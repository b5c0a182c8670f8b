#include "apps/common/json_writer.h"
#include "apps/common/progress.h"
#include "apps/common/table.h"
#include "apps/moonctl/db_commands.h"
#include "apps/moonctl/fingerprints.h"
#include "apps/moonctl/holdings.h"
#include "model/custom_types.h"

namespace moondb {
namespace {

constexpr std::size_t kKeysMax = 10;  // Maximum size of each Difference::differing.

struct Side {
  AgentClient agent;
  HaveSet have;

  const std::string& name() const { return agent.agent->name(); }
};

struct Difference {
  HoldingPair holdings;
  std::vector<RecordKey> differing;  // Records whose contents differ between the agents; only the first kKeysMax.

  // `lacking` counts the records that only the other agent holds.
  bool is_equal() const { return holdings.first.lacking + holdings.second.lacking == 0 && differing.empty(); }
};

using Differences = std::map<Series, Difference>;

Result<Side> Open(CommandContext& context, const std::string& name) {
  auto agent = context.Connect(name);
  if (!agent) return tl::unexpected(agent.error());
  auto have = agent->client->GetHaveSet();
  if (!have) return tl::unexpected(have.error());
  return Side{*std::move(agent), *std::move(have)};
}

std::uint64_t CountHeld(const HaveSet& have) {
  std::uint64_t count = 0;
  for (const auto& [stream, in_stream] : have.streams()) count += in_stream.held.Count();
  return count;
}

// Removes from `differing` the records that one of the agents no longer holds. Such records were superseded during the
// comparison, so they are no difference.
Result<void> LeaveOutWhatIsGone(Side& first, Side& second, Differences& differences) {
  const auto first_now = first.agent.client->GetHaveSet();
  if (!first_now) return tl::unexpected(first_now.error());
  const auto second_now = second.agent.client->GetHaveSet();
  if (!second_now) return tl::unexpected(second_now.error());
  for (auto& [series, difference] : differences) {
    std::erase_if(difference.differing, [&](const RecordKey& key) {
      return !first_now->Get(key.stream).held.Contains(key.seq) || !second_now->Get(key.stream).held.Contains(key.seq);
    });
  }
  return {};
}

Result<Differences> Compare(Side& first, Side& second) {
  const auto asking = [](Side& side) {
    return [&side](const StreamKey& stream, const IntervalSet& seqs) {
      return FingerprintOf(*side.agent.client, stream, seqs);
    };
  };
  const double total = static_cast<double>(CountHeld(HeldByBoth(first.have, second.have)));
  Progress progress("comparing");
  double done = 0;
  Differences differences;
  bool is_any_differing = false;
  for (auto& [series, holdings] : CompareHoldings(first.have, second.have)) {
    auto differing = FindDiffering(holdings.both, asking(first), asking(second), kKeysMax);
    if (!differing) return tl::unexpected(differing.error());
    is_any_differing = is_any_differing || !differing->empty();
    done += static_cast<double>(CountHeld(holdings.both));
    progress.Show(done, total, FormatCount(done) + " records held by both");
    differences[series] = {std::move(holdings), *std::move(differing)};
  }
  if (!is_any_differing) return differences;
  if (auto checked = LeaveOutWhatIsGone(first, second, differences); !checked) return tl::unexpected(checked.error());
  return differences;
}

std::string DifferText(const Difference& difference) {
  const std::string count = std::to_string(difference.differing.size());
  return difference.differing.size() < kKeysMax ? count : count + " or more";
}

std::string DifferencesText(const proto::TeamConfig& team, const Side& first, const Side& second,
                            const Differences& differences) {
  Table table(
      {"ORIGIN", "TYPE", first.name(), second.name(), "ONLY " + first.name(), "ONLY " + second.name(), "DIFFER"});
  std::string keys;
  bool is_equal = true;
  for (const auto& [series, difference] : differences) {
    const auto& [on_first, on_second, both] = difference.holdings;
    table.Add({AgentName(team, series.first), DataTypeName(series.second, team.custom_types()),
               std::to_string(on_first.held), std::to_string(on_second.held), std::to_string(on_second.lacking),
               std::to_string(on_first.lacking), DifferText(difference)});
    for (const RecordKey& key : difference.differing) keys += ToString(key) + " differs\n";
    is_equal = is_equal && difference.is_equal();
  }
  if (!keys.empty()) keys += "moonctl db verify shows which agent's copy is damaged\n";
  return table.Text() + keys + first.name() + " and " + second.name() +
         (is_equal ? " hold the same records" : " differ");
}

std::string DifferencesJson(const proto::TeamConfig& team, const Side& first, const Side& second,
                            const Differences& differences, bool is_equal) {
  const auto number = [](std::uint64_t count) { return static_cast<double>(count); };
  JsonWriter json;
  json.BeginObject().Key("first").String(first.name()).Key("second").String(second.name());
  json.Key("is_equal").Bool(is_equal).Key("series").BeginArray();
  for (const auto& [series, difference] : differences) {
    const auto& [on_first, on_second, both] = difference.holdings;
    json.BeginObject().Key("origin").String(AgentName(team, series.first));
    json.Key("type").String(DataTypeName(series.second, team.custom_types()));
    json.Key("first_held").Number(number(on_first.held)).Key("second_held").Number(number(on_second.held));
    json.Key("first_only").Number(number(on_second.lacking)).Key("second_only").Number(number(on_first.lacking));
    json.Key("differing").BeginArray();
    for (const RecordKey& key : difference.differing) json.String(ToString(key));
    json.EndArray().EndObject();
  }
  return json.EndArray().EndObject().text();
}

}  // namespace

ExitCode CompareStores(CommandContext& context, const std::string& first_name, const std::string& second_name) {
  if (first_name == second_name) return context.Report({ErrorCode::kInvalid, "expected two different agents", {}});
  auto first = Open(context, first_name);
  if (!first) return context.Report(first.error());
  auto second = Open(context, second_name);
  if (!second) return context.Report(second.error());
  const auto differences = Compare(*first, *second);
  if (!differences) return context.Report(differences.error());
  const bool is_equal =
      std::all_of(differences->begin(), differences->end(), [](const auto& row) { return row.second.is_equal(); });
  const proto::TeamConfig& team = (*context.Team())->config;
  return context.Print(is_equal ? ExitCode::kDone : ExitCode::kFailed,
                       DifferencesJson(team, *first, *second, *differences, is_equal),
                       DifferencesText(team, *first, *second, *differences));
}

}  // namespace moondb
