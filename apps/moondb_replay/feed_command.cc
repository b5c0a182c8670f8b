#include "apps/moondb_replay/feed_command.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include "apps/common/progress.h"
#include "apps/common/table.h"
#include "apps/common/team_clients.h"
#include "apps/moondb_replay/feed_plan.h"
#include "model/text.h"

namespace moondb {
namespace {

Result<TimeSpan> SpanOf(const FeedArguments& arguments) {
  constexpr double kSecondsMax = 9e9;  // Times up to this value fit into 63 bits as nanoseconds.
  TimeSpan span{std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max()};
  for (const auto& [seconds, bound] : {std::pair(arguments.from_s, &span.from_ns), {arguments.to_s, &span.to_ns}}) {
    if (!seconds) continue;
    if (!std::isfinite(*seconds) || std::abs(*seconds) > kSecondsMax) {
      return Fail(ErrorCode::kInvalid, "--from and --to are seconds of the mission");
    }
    *bound = std::llround(*seconds * 1e9);
  }
  return span;
}

// Returns the mission's agent with the same name and id as the team's agent.
Result<const MissionAgent*> MissionAgentOf(const Mission& mission, const proto::AgentConfig& agent) {
  for (const MissionAgent& known : mission.agents) {
    if (known.id == agent.id() && known.name == agent.name()) return &known;
  }
  return Fail(ErrorCode::kInvalid, "the mission has no agent " + std::to_string(agent.id()) + " named " + agent.name() +
                                       "; make the team file by moonctl config init --mission");
}

// Removes from `records` the records that the agent already holds. Returns how many were removed.
Result<std::size_t> LeaveOutKnown(Client& client, AgentId agent, std::vector<proto::Record>& records) {
  proto::ReadRequest request;
  request.add_origin_agents(agent);
  request.set_records_max(1024);
  std::set<std::string> known;
  const auto read = client.ReadAll(request, [&known](const proto::StoredRecord&, const proto::Record& record) {
    known.insert(FeedKey(record));
    return Result<void>();
  });
  if (!read) return tl::unexpected(read.error());
  return std::erase_if(records, [&known](const proto::Record& record) { return known.contains(FeedKey(record)); });
}

Result<void> FeedAgent(const TeamFile& team, const proto::AgentConfig& agent, const Mission& mission,
                       const TimeSpan& span) {
  auto known = MissionAgentOf(mission, agent);
  if (!known) return tl::unexpected(known.error());
  auto client =
      ConnectTo(team, agent, {.connect_timeout = std::chrono::seconds(10), .timeout = std::chrono::seconds(60)});
  if (!client) return tl::unexpected(client.error());
  auto records = PlanFeed(mission, agent.id(), span);
  if (!records) return tl::unexpected(records.error());
  const std::size_t planned = records->size();
  auto left_out = LeaveOutKnown(**client, agent.id(), *records);
  if (!left_out) return tl::unexpected(left_out.error());

  const auto start = std::chrono::steady_clock::now();
  Progress progress("feed " + agent.name());
  const auto show = [&](std::size_t count) {
    progress.Show(static_cast<double>(count), static_cast<double>(records->size()),
                  std::to_string(count) + " of " + std::to_string(records->size()) + " records");
  };
  if (auto inserted = InsertInBatches(**client, *records, show); !inserted) return inserted;
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  std::printf("%s: %zu records in %.2f s%s\n", agent.name().c_str(), planned - *left_out, seconds.count(),
              *left_out == 0 ? "" : (", " + std::to_string(*left_out) + " were there already").c_str());
  std::fflush(stdout);
  return {};
}

}  // namespace

Result<void> Feed(const FeedArguments& arguments) {
  auto team = ReadTeamFile(arguments.team);
  if (!team) return tl::unexpected(team.error());
  auto span = SpanOf(arguments);
  if (!span) return tl::unexpected(span.error());
  std::set<std::string> chosen;
  for (const std::string& name : arguments.agents) {
    if (auto named = AgentNamed(team->config, name); !named) return tl::unexpected(named.error());
    chosen.insert(name);
  }
  auto mission = ReadMission(arguments.mission);
  if (!mission) return tl::unexpected(mission.error());
  for (const proto::AgentConfig& agent : team->config.agents()) {
    if (!chosen.empty() && !chosen.contains(agent.name())) continue;
    if (auto fed = FeedAgent(*team, agent, *mission, *span); !fed) return fed;
  }
  return {};
}

}  // namespace moondb
