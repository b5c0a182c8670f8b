// wire_feed: inserts each record of a whole mission at the agent that is its origin, in a running team.
// bench/socket_bytes.py runs this program.
//
//   wire_feed [--team FILE] MISSION    MISSION: rolling, single_view, or the folder of a recorded mission
//
// The records have the same content and timestamps as in wire_bench. Each agent assigns its own epochs and hashes.
// Prints one JSON object: {"mission", "records", "maps", "paper_sql_bytes" (as in WireSizes)}.
//
// Exit code 0: all records are stored; 1: the mission does not exist, or an agent is unreachable or refuses a record;
// other: wrong arguments.
#include <fmt/core.h>

#include <chrono>
#include <cstdio>
#include <string>
#include <vector>

#include "apps/common/arguments.h"
#include "apps/common/team_clients.h"
#include "bench/wire_measure.h"
#include "model/team_member.h"

namespace moondb {
namespace {

Result<WireMission> MissionOf(const std::string& name) {
  if (name == "rolling") return MakeRollingMission();
  return name == "single_view" ? MakeSingleViewMission() : ReadRecordedMission(name);
}

Result<void> FeedStream(const TeamFile& team, const WireStream& stream) {
  if (stream.records.empty()) return {};
  const proto::AgentConfig* agent = FindAgent(team.config, stream.records.front().key().origin_agent());
  if (agent == nullptr) return Fail(ErrorCode::kInvalid, "the team has no agent for one of the mission's origins");
  auto client = ConnectTo(team, *agent, {.timeout = std::chrono::seconds(60)});
  if (!client) return tl::unexpected(client.error());
  std::vector<proto::Record> records(stream.records.size());
  for (std::size_t i = 0; i < records.size(); ++i) {
    if (!records[i].ParseFromString(stream.records[i].content())) return Fail(ErrorCode::kCorrupt, "no record");
  }
  return InsertInBatches(**client, records, [](std::size_t, const auto&) {});
}

Result<WireMission> Feed(const std::string& team_file, const std::string& name) {
  const Result<TeamFile> team = ReadTeamFile(team_file);
  if (!team) return tl::unexpected(team.error());
  Result<WireMission> mission = MissionOf(name);
  if (!mission) return mission;
  for (const WireStream& stream : mission->streams) {
    if (const Result<void> fed = FeedStream(*team, stream); !fed) return tl::unexpected(fed.error());
  }
  return mission;
}

int Run(const std::string& team_file, const std::string& name) {
  const Result<WireMission> mission = Feed(team_file, name);
  if (!mission) {
    fmt::print(stderr, "wire_feed: {}\n", ToString(mission.error()));
    return 1;
  }
  std::size_t map_count = 0;
  for (const std::vector<TraversabilityMap>& maps : mission->rover_maps) map_count += maps.size();
  fmt::print("{{\"mission\": \"{}\", \"records\": {}, \"maps\": {}, \"paper_sql_bytes\": {}}}\n", mission->name,
             RecordCount(*mission), map_count, PaperSqlBytes(*mission));
  return 0;
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  std::string team_file, mission;
  moondb::Command app("wire_feed", "Gives a whole mission's records to the agents of a running team.");
  app.AddOption("--team", team_file, "The team's file").EnvName("MOONDB_TEAM").Required();
  app.AddOption("mission", mission, "rolling, single_view, or a recorded mission's folder").Required();
  if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code;
  return moondb::Run(team_file, mission);
}
