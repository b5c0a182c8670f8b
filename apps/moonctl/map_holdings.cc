#include "apps/moonctl/map_holdings.h"

#include <algorithm>
#include <chrono>
#include <string>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/agent_answers.h"
#include "apps/moonctl/command_context.h"
#include "apps/moonctl/holdings.h"
#include "model/agent_name.h"
#include "model/team_member.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "runtime/team/team_config.h"

namespace moondb {
namespace {

// An agent's have-set, and the timestamp of its last map of each origin.
struct HeldMaps {
  HaveSet have;
  std::map<AgentId, std::int64_t> last_ns;
};

Result<HeldMaps> ReadHeldMaps(Client& client) {
  HeldMaps maps;
  auto have = client.GetHaveSet();
  if (!have) return tl::unexpected(have.error());
  maps.have = *std::move(have);
  const auto status = client.Status();
  if (!status) return tl::unexpected(status.error());
  for (const proto::MapTimes& times : status->storage().map_times()) {
    if (times.last_ns() != 0) maps.last_ns[times.origin_agent()] = times.last_ns();
  }
  return maps;
}

// Returns 0 for a timestamp in the future.
double SecondsSince(std::int64_t timestamp_ns) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::max(0.0, std::chrono::duration<double>(now - std::chrono::nanoseconds(timestamp_ns)).count());
}

bool IsMeant(const proto::TeamConfig& team, const proto::RoleAssignment& roles, AgentId agent, AgentId origin) {
  return agent == origin || agent == roles.leader() || agent == roles.survivor() || GetsAllMaps(team, agent);
}

}  // namespace

bool GetsAllMaps(const proto::TeamConfig& team, AgentId agent) {
  const auto policy_of = agent == BaseStationOf(team) ? GroundPolicyOf : RoversPolicyOf;
  return policy_of(team, proto::LOCAL_TRAVERSABILITY_MAP) == proto::POLICY_ALL;
}

std::vector<MapHolding> MapHoldingsOf(const proto::TeamConfig& team, const proto::RoleAssignment& roles, AgentId agent,
                                      const HaveSet& have, const HaveSet& leaders) {
  std::vector<MapHolding> holdings;
  for (const auto& [series, row] : HoldingsOf({have, leaders})) {
    const auto& [origin, type] = series;
    if (type != proto::LOCAL_TRAVERSABILITY_MAP) continue;
    holdings.push_back({origin, row[0].held, row[0].lacking, IsMeant(team, roles, agent, origin)});
  }
  return holdings;
}

ExitCode ShowMapHoldings(CommandContext& context) {
  const auto roles = context.Roles();
  if (!roles) return context.Report(roles.error());
  auto leader = context.ConnectToLeaderOf(*roles);
  if (!leader) return context.Report(leader.error());
  const auto leaders = leader->client->GetHaveSet();
  if (!leaders) return context.Report(leaders.error());
  const auto answers = context.CallEach([](Client& client) { return ReadHeldMaps(client); });
  if (!answers) return context.Report(answers.error());
  const proto::TeamConfig& team = (*context.Team())->config;
  Table table({"AGENT", "MAPS OF", "HELD", "LACKS", "NEWEST"});
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  std::string without;
  bool is_any_lacking = false;
  for (const auto& asked : *answers) {
    const auto& [agent, maps] = asked;
    BeginAgent(asked, json);
    if (!maps) {
      without += agent->name() + ": " + WhyNoAnswer(maps.error()) + "\n";
      json.EndObject();
      continue;
    }
    json.Key("maps").BeginArray();
    for (const MapHolding& holding : MapHoldingsOf(team, *roles, agent->id(), maps->have, *leaders)) {
      const auto newest = maps->last_ns.find(holding.origin);
      const bool has_newest = newest != maps->last_ns.end();
      is_any_lacking = is_any_lacking || (holding.is_meant && holding.lacking > 0);
      const std::string lacks = std::to_string(holding.lacking) + (holding.is_meant ? "" : ", by policy");
      table.Add({agent->name(), AgentName(team, holding.origin), std::to_string(holding.held), lacks,
                 has_newest ? FormatSeconds(SecondsSince(newest->second)) + " old" : "-"});
      json.BeginObject().Key("of").String(AgentName(team, holding.origin));
      json.Key("held").Number(static_cast<double>(holding.held));
      json.Key("lacking").Number(static_cast<double>(holding.lacking)).Key("is_meant").Bool(holding.is_meant);
      if (has_newest) json.Key("newest_age_s").Number(SecondsSince(newest->second));
      json.EndObject();
    }
    json.EndArray().EndObject();
  }
  json.EndArray().EndObject();
  const ExitCode code = is_any_lacking ? ExitCode::kFailed : ExitCodeOf(*answers);
  return context.Print(code, json.text(), table.Text() + without);
}

}  // namespace moondb
