#include "apps/moondb_replay/feed_command.h"

#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <set>

#include "apps/common/team_clients.h"
#include "apps/moondb_replay/agent_feed.h"
#include "apps/moondb_replay/feed_plan.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr double kSpeedMax = 1000;

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

Result<AgentFeed> PrepareFeed(const TeamFile& team, const proto::AgentConfig& agent, const Mission& mission,
                              const TimeSpan& span) {
  auto known = MissionAgentOf(mission, agent);
  if (!known) return tl::unexpected(known.error());
  AgentFeed feed;
  feed.name = agent.name();
  feed.id = agent.id();
  auto client =
      ConnectTo(team, agent, {.connect_timeout = std::chrono::seconds(10), .timeout = std::chrono::seconds(60)});
  if (!client) return tl::unexpected(client.error());
  feed.client = *std::move(client);
  auto records = PlanFeed(mission, agent.id(), span);
  if (!records) return tl::unexpected(records.error());
  feed.records = *std::move(records);
  auto left_out = LeaveOutKnown(feed);
  if (!left_out) return tl::unexpected(left_out.error());
  feed.left_out = *left_out;
  return feed;
}

}  // namespace

Result<void> Feed(const FeedArguments& arguments) {
  auto team = ReadTeamFile(arguments.team);
  if (!team) return tl::unexpected(team.error());
  auto span = SpanOf(arguments);
  if (!span) return tl::unexpected(span.error());
  if (arguments.speed && !(*arguments.speed > 0 && *arguments.speed <= kSpeedMax)) {
    return Fail(ErrorCode::kInvalid, "--speed is a number above 0 and at most 1000, such as 10");
  }
  std::set<std::string> chosen;
  for (const std::string& name : arguments.agents) {
    if (auto named = AgentNamed(team->config, name); !named) return tl::unexpected(named.error());
    chosen.insert(name);
  }
  auto mission = ReadMission(arguments.mission);
  if (!mission) return tl::unexpected(mission.error());
  std::vector<AgentFeed> feeds;
  for (const proto::AgentConfig& agent : team->config.agents()) {
    if (!chosen.empty() && !chosen.contains(agent.name())) continue;
    auto feed = PrepareFeed(*team, agent, *mission, *span);
    if (!feed) return tl::unexpected(feed.error());
    if (arguments.speed) {
      feeds.push_back(*std::move(feed));
    } else if (auto fed = FeedAtOnce(*feed); !fed) {
      return fed;
    }
  }
  return arguments.speed ? FeedInTime(feeds, *arguments.speed) : Result<void>();
}

}  // namespace moondb
