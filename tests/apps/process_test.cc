// Tests the programs as an operator uses them: with real processes, real sockets, a real disk and kill -9.

#include <gmock/gmock.h>
#include <google/protobuf/util/json_util.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <future>
#include <optional>
#include <random>
#include <set>

#include "apps/common/data_folder.h"
#include "model/text.h"
#include "proto/share_status.pb.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::Not;
using testing::StartsWith;

class ProcessTest : public ProcessTeam {
 protected:
  void UpWithAutomaticFailover() {
    std::string text = *ReadTextFile(team_file_);
    const std::string manual = "failover: manual, leader_timeout_s: 120";
    text.replace(text.find(manual), manual.size(), "failover: automatic, leader_timeout_s: 2");
    ASSERT_TRUE(WriteTextFile(team_file_, text).has_value());
    MoonctlExpecting(0, {"up"});
    ASSERT_TRUE(Until([this] {
      return MoonctlExpecting(0, {"status", "-a", "rover2"}).find("3/3") != std::string::npos;
    }));
  }
};

constexpr char kMapJson[] = R"({
  "node": {"agent_id": 2, "index": 0},
  "node_from_map": {"position_m": {}, "orientation": {"w": 1}},
  "layers": [{"width_cells": 4, "height_cells": 4, "resolution_um": 50000, "cells": "VVVVVQ=="}]})";
constexpr char kNodeJson[] = R"({
  "node": {"agent_id": 2, "index": 0}, "map_from_node": {"position_m": {"x": 1}, "orientation": {"w": 1}}})";

std::string KeyOf(const std::string& out) { return out.substr(0, out.find('\n')); }

// Returns maps of noise, which are hard to compress.
std::vector<proto::Record> NoisyMaps(int count, std::uint64_t seed, AgentId agent = 2) {
  std::mt19937_64 random(seed);
  std::vector<proto::Record> records;
  for (int i = 0; i < count; ++i) {
    proto::Record& record = records.emplace_back();
    record.set_timestamp_ns(i + 1);
    proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
    map.mutable_node()->set_agent_id(agent);
    map.mutable_node_from_map()->mutable_position_m();
    map.mutable_node_from_map()->mutable_orientation()->set_w(1);
    proto::MapLayer& layer = *map.add_layers();
    layer.set_width_cells(100);
    layer.set_height_cells(100);
    layer.set_resolution_um(50000);
    Grid grid(100, 100);
    for (Cell& cell : grid.cells) cell = static_cast<Cell>(random() % 3);
    layer.set_cells(PackCells(grid));
  }
  return records;
}

TEST_F(ProcessTest, AMapReachesTheLeaderAndThenTheSurvivor) {
  MoonctlExpecting(0, {"up"});
  EXPECT_THAT(MoonctlExpecting(0, {"status"}), HasSubstr("designated_survivor"));
  // Insert a record at rover3 too. The survivor can receive it only through the leader.
  const std::string state =
      KeyOf(MoonctlExpecting(0, {"record", "insert", "temperature", "{\"celsius\": -20}", "-a", "rover3"}));
  EXPECT_EQ(MoonctlExpecting(0, {"record", "next-node", "-a", "rover2"}), "0\n");
  MoonctlExpecting(0, {"record", "insert", "pose_graph_node", kNodeJson, "-a", "rover2"});
  EXPECT_NE(MoonctlExpecting(0, {"record", "next-node", "-a", "rover2"}), "0\n");
  const std::string map =
      KeyOf(MoonctlExpecting(0, {"record", "insert", "local_traversability_map", kMapJson, "-a", "rover2"}));
  MoonctlExpecting(1, {"record", "get", map, "-a", "rover1"});

  MoonctlExpecting(0, {"sync", "now", "--wait"});
  const auto held = MoonctlJson(0, {"record", "get", map, "-a", "rover1"});
  EXPECT_EQ(held.fields().at("type").string_value(), "local_traversability_map");
  MoonctlExpecting(0, {"record", "get", state, "-a", "rover1"});
  MoonctlExpecting(1, {"record", "get", state, "-a", "rover2"});
  MoonctlExpecting(0, {"replicate", "now", "--wait"});
  MoonctlExpecting(0, {"record", "get", state, "-a", "rover2"});

  MoonctlExpecting(0, {"map", "export", folder_ / "map"});
  EXPECT_THAT(*ReadTextFile(folder_ / "map" / "map.yaml"), HasSubstr("free_thresh: 0.196"));
  MoonctlExpecting(0, {"down"});
  for (const char* name : {"rover1", "rover2", "rover3", "base"}) EXPECT_EQ(PidOf(name), 0) << name;
}

TEST_F(ProcessTest, ExplainsACellAndExcludesQuarantinedMapsEverywhere) {
  MoonctlExpecting(0, {"up"});
  MoonctlExpecting(0, {"record", "insert", "pose_graph_node", kNodeJson, "-a", "rover2"});
  std::string map = kMapJson;  // This map does not overlap the rover's own footprint.
  map.replace(map.find("\"position_m\": {}"), 16, "\"position_m\": {\"x\": 3}");
  MoonctlExpecting(0, {"record", "insert", "local_traversability_map", map, "-a", "rover2"});
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  const std::string why = MoonctlExpecting(0, {"map", "why", "3.99", "0.01"});
  EXPECT_THAT(why, HasSubstr("(3.975, 0.025) is free at rover1"));
  EXPECT_THAT(why, HasSubstr("2:0"));
  EXPECT_THAT(MoonctlExpecting(0, {"map", "why", "1", "0"}), HasSubstr("the rover stood there"));
  EXPECT_THAT(MoonctlExpecting(0, {"map", "why", "-500", "3"}), HasSubstr("no map covers it"));

  auto leader = Connect("rover1");
  proto::MapTilesRequest tiles;
  MergedTiles changed = leader->NextMapTiles(tiles).value();
  EXPECT_TRUE(changed.is_everything);
  EXPECT_FALSE(changed.tiles.empty());
  tiles.set_wait_s(0.2);
  EXPECT_TRUE(leader->NextMapTiles(tiles).value().tiles.empty());

  const std::string said =
      MoonctlExpecting(0, {"map", "quarantine", "--agent", "rover2", "--to", "2030-01-01T00:00Z", "--reason", "slip"});
  const std::string id = said.substr(11, said.find(' ', 11) - 11);
  tiles.set_wait_s(30);
  changed = leader->NextMapTiles(tiles).value();
  EXPECT_FALSE(changed.is_everything);
  EXPECT_FALSE(changed.tiles.empty()) << "reported when it was stored";
  EXPECT_THAT(MoonctlExpecting(0, {"map", "stats"}), HasSubstr(id));
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  EXPECT_THAT(MoonctlExpecting(0, {"map", "stats", "-a", "rover3"}), HasSubstr(id));
  Kill("rover1");
  MoonctlExpecting(0, {"up"});
  EXPECT_THAT(MoonctlExpecting(0, {"map", "stats", "-a", "rover1"}), HasSubstr("slip"));

  EXPECT_THAT(Moonctl({"map", "quarantine", "--lift", "1.0000000000000001.31.9"}).error, HasSubstr("no quarantine"));
  MoonctlExpecting(0, {"map", "quarantine", "--lift", id, "-a", "rover1"});
  EXPECT_THAT(MoonctlExpecting(0, {"map", "stats", "-a", "rover1"}), Not(HasSubstr(id)));
  EXPECT_EQ(Moonctl({"map", "quarantine", "--agent", "rover2", "--from", "yesterday"}).exit_code, 2);
  EXPECT_EQ(Moonctl({"map", "why", "nan", "2"}).exit_code, 2);
}

TEST_F(ProcessTest, HealthReportsToScriptsByItsExitCode) {
  MoonctlExpecting(0, {"up"});
  ASSERT_TRUE(Until([this] { return Moonctl({"health"}).exit_code == 0; }));
  EXPECT_THAT(MoonctlExpecting(0, {"health"}), HasSubstr("rover1  good"));
  EXPECT_TRUE(MoonctlJson(0, {"health"}).fields().at("is_healthy").bool_value());
  Kill("rover3");
  ASSERT_TRUE(Until([this] { return Moonctl({"health"}).exit_code == 1; }));
  const std::string text = MoonctlExpecting(1, {"health"});
  EXPECT_THAT(text, HasSubstr("rover3  unknown"));
  EXPECT_THAT(text, HasSubstr("does not reach rover3"));
  EXPECT_FALSE(MoonctlJson(1, {"health"}).fields().at("is_healthy").bool_value());
  Kill("rover1");
  EXPECT_THAT(MoonctlExpecting(3, {"status"}), HasSubstr("rover1 leads (term 1), but does not answer"));
}

TEST_F(ProcessTest, OnARobotCommandsTakeTheOnlyAgentWhoseSecretKeyIsThere) {
  MoonctlExpecting(0, {"up"});
  MoonctlExpecting(0, {"config", "pack", "rover2", folder_ / "rover2.pack"});
  MoonctlExpecting(0, {"config", "unpack", folder_ / "rover2.pack", folder_ / "robot"});
  const std::string robot = folder_ / "robot" / "team.yaml";
  EXPECT_THAT(MoonctlExpecting(0, {"-t", robot, "record", "next-node"}), StartsWith("0"));
  MoonctlExpecting(0, {"-t", robot, "record", "insert", "temperature", R"({"celsius": 4})"});
  EXPECT_THAT(MoonctlExpecting(0, {"-a", "rover2", "record", "list", "temperature"}), HasSubstr("rover2"));
  EXPECT_THAT(MoonctlExpecting(0, {"-t", robot, "drive", "off"}), HasSubstr("rover2 neither drives nor sleeps"));
  EXPECT_THAT(Moonctl({"record", "next-node"}).error, HasSubstr("the secret keys of several agents are here"));
  const Outcome no_store = Moonctl({"-t", robot, "-a", "rover3", "db", "query", "SELECT 1"});
  EXPECT_EQ(no_store.exit_code, 1);
  EXPECT_THAT(no_store.error, HasSubstr("the store of rover3 is not on this computer"));
  const Outcome elsewhere = Moonctl({"-t", robot, "doctor", "-a", "rover3"});
  EXPECT_EQ(elsewhere.exit_code, 1);
  EXPECT_THAT(elsewhere.out, HasSubstr("but not those of rover3"));
  EXPECT_THAT(elsewhere.out, HasSubstr("run moonctl doctor on the computer of rover3"));
}

// Overwrites bytes 4096 to 12287 of a stopped agent's store with noise.
void DamageStore(const std::filesystem::path& file, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::string noise(8192, '\0');
  for (char& byte : noise) byte = static_cast<char>(random());
  std::fstream store(file, std::ios::in | std::ios::out | std::ios::binary);
  store.seekp(4096);
  store.write(noise.data(), static_cast<std::streamsize>(noise.size()));
  ASSERT_TRUE(store.good());
}

TEST_F(ProcessTest, DamageAndUncleanShutdownAreReportedUntilAcknowledged) {
  MoonctlExpecting(0, {"up"});
  ASSERT_TRUE(Until([this] { return Moonctl({"health"}).exit_code == 0; }));
  MoonctlExpecting(0, {"record", "insert", "temperature", "{\"celsius\": -20}", "-a", "rover3"});
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  MoonctlExpecting(0, {"down"});
  MoonctlExpecting(0, {"up"});
  ASSERT_TRUE(Until([this] { return Moonctl({"health"}).exit_code == 0; })) << "all were stopped in order";
  EXPECT_THAT(MoonctlExpecting(0, {"log", "-a", "rover3"}), HasSubstr("stopped on request"));

  MoonctlExpecting(0, {"down", "-a", "rover3"});
  constexpr std::uint64_t kSeed = 20261122;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  const std::filesystem::path store = folder_ / "moondb-data" / "rover3" / "moondb.sqlite";
  DamageStore(store, kSeed);
  MoonctlExpecting(0, {"up"});
  std::string text = Moonctl({"health", "-a", "rover3"}).out;
  EXPECT_THAT(text, HasSubstr("set aside as " + store.string() + ".damaged-1"));
  EXPECT_THAT(text, HasSubstr("not acknowledged"));
  EXPECT_EQ(Moonctl({"health", "-a", "rover3"}).exit_code, 1);
  // The agent may already have received events of its lost store, but the damage event is still the first one stored.
  const std::string first = "SELECT kind, text FROM v_event WHERE agent_id = 3 ORDER BY row_id LIMIT 1";
  EXPECT_THAT(MoonctlExpecting(0, {"db", "query", first, "-a", "rover3"}), HasSubstr("damage"));
  EXPECT_THAT(MoonctlExpecting(0, {"log", "-a", "rover3", "--origin", "rover3"}), HasSubstr("set aside as"));
  const auto status = MoonctlJson(0, {"status", "-a", "rover3"});
  EXPECT_THAT(status.DebugString(), HasSubstr("damaged-1"));

  Kill("rover2");
  MoonctlExpecting(0, {"up"});
  EXPECT_THAT(Moonctl({"health", "-a", "rover2"}).out, HasSubstr("the previous process ended without a clean stop"));
  EXPECT_THAT(MoonctlExpecting(0, {"health", "acknowledge", "-a", "rover2"}), HasSubstr("ended without a clean stop"));
  EXPECT_THAT(Moonctl({"health", "-a", "rover2"}).out, Not(HasSubstr("ended without a clean stop")));
  EXPECT_THAT(Moonctl({"health", "-a", "rover3"}).out, HasSubstr("set aside")) << "rover2's alone were";
  EXPECT_THAT(MoonctlExpecting(0, {"health", "acknowledge"}), HasSubstr("set aside"));
  // An acknowledgment does not hide that records are missing, unless other agents have already restored them.
  EXPECT_TRUE(Until([this] {
    return Moonctl({"health", "-a", "rover3"}).out.find("records of this agent that this agent's disk never held") !=
               std::string::npos ||
           Moonctl({"record", "list", "temperature", "-a", "rover3"}).out.find("rover3") != std::string::npos;
  })) << Moonctl({"health", "-a", "rover3"}).out;
  MoonctlExpecting(0, {"health", "acknowledge"});  // Perhaps also that other agents know records of the lost store.
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  ASSERT_TRUE(Until([this] { return Moonctl({"health"}).exit_code == 0; })) << Moonctl({"health"}).out;
  // The acknowledgment survives a restart of the agent. The log keeps the acknowledged finding.
  MoonctlExpecting(0, {"down", "-a", "rover3"});
  MoonctlExpecting(0, {"up"});
  ASSERT_TRUE(Until([this] { return Moonctl({"health", "-a", "rover3"}).exit_code == 0; }));
  text = MoonctlExpecting(0, {"log", "-a", "rover3", "--origin", "rover3"});
  EXPECT_THAT(text, HasSubstr("set aside as"));
  EXPECT_THAT(text, HasSubstr("acknowledged"));
}

TEST_F(ProcessTest, ShowsAndPrunesTheHistoryOfARobotsStates) {
  MoonctlExpecting(0, {"up"});
  for (const char* body : {"{\"celsius\": -20}", "{\"celsius\": -21}", "{\"celsius\": -22}"}) {
    MoonctlExpecting(0, {"record", "insert", "temperature", body, "-a", "rover3"});
  }
  const auto rows = [](const std::string& table) { return std::count(table.begin(), table.end(), '\n') - 1; };
  EXPECT_EQ(rows(MoonctlExpecting(0, {"record", "list", "temperature", "-a", "rover3"})), 1);
  const std::vector<std::string> list = {"record", "list", "temperature", "--history", "-a", "rover3"};
  EXPECT_EQ(rows(MoonctlExpecting(0, list)), 2);
  std::vector<std::string> relayed = list;
  relayed.insert(relayed.end(), {"--via", "base"});
  ASSERT_TRUE(Until([&] { return Moonctl(relayed).exit_code == 0; }));
  EXPECT_EQ(rows(MoonctlExpecting(0, relayed)), 2);
  const std::string sql = "SELECT min(fields ->> 'celsius') AS coldest FROM v_history WHERE type = 'temperature'";
  EXPECT_THAT(MoonctlExpecting(0, {"db", "query", sql, "-a", "rover3"}), HasSubstr("-21"));
  EXPECT_THAT(MoonctlExpecting(0, {"db", "info"}), HasSubstr("2, "));
  EXPECT_THAT(MoonctlExpecting(0, {"db", "prune", "--history", "--dry-run", "-a", "rover3"}), HasSubstr("temperature"));
  EXPECT_EQ(rows(MoonctlExpecting(0, list)), 2);
  EXPECT_THAT(MoonctlExpecting(0, {"db", "prune", "--history", "-a", "rover3"}), HasSubstr("temperature"));
  EXPECT_EQ(rows(MoonctlExpecting(0, list)), 0);
  EXPECT_EQ(Moonctl({"record", "list", "--history", "--follow", "-a", "rover3"}).exit_code, 2);
  EXPECT_EQ(Moonctl({"db", "prune", "--history", "--occluded-maps", "-a", "rover3"}).exit_code, 2);
}

TEST_F(ProcessTest, LosesNothingAcknowledgedWhenTheLeaderIsKilledDuringASync) {
  MoonctlExpecting(0, {"up"});
  constexpr std::uint64_t kSeed = 20261121;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  const auto rover2 = Connect("rover2");
  ASSERT_NE(rover2, nullptr);
  const auto inserted = rover2->Insert(NoisyMaps(600, kSeed));
  ASSERT_TRUE(inserted.has_value()) << ToString(inserted.error());

  MoonctlExpecting(0, {"sync", "now"});
  double acknowledged = 0;
  const auto update = [&] {
    const auto status = rover2->ShareStatus();
    if (!status) return;
    for (const proto::ShareSession& session : status->sessions()) {
      if (session.destination() == 1) acknowledged = session.acknowledged_records();
    }
  };
  ASSERT_TRUE(Until([&] { return update(), acknowledged > 0; }));
  Kill("rover1");
  update();
  std::cout << "acknowledged when the leader died: " << acknowledged << " of 600\n";

  // The restarted leader holds all acknowledged records immediately, before it reaches other agents.
  const auto leader = StartAgent("rover1");
  ASSERT_TRUE(Until([&] { return Moonctl({"status", "-a", "rover1"}).exit_code == 0; }));
  EXPECT_GE(static_cast<double>(KeysHeldBy("rover1").size()), acknowledged);
  // All other records arrive when all agents have reached the leader again.
  ASSERT_TRUE(Until([&] { return Moonctl({"sync", "now", "--wait"}).exit_code == 0; }));
  EXPECT_THAT(KeysHeldBy("rover1"), IsSupersetOf(*inserted));
  leader->Signal(SIGTERM);
  EXPECT_EQ(leader->Wait().exit_code, 0);
}

TEST_F(ProcessTest, TheSurvivorCanLeadWhenTheLeaderIsDead) {
  MoonctlExpecting(0, {"up"});
  Kill("rover1");
  const auto status = MoonctlJson(3, {"status"});
  const auto& rows = status.fields().at("agents").list_value();
  ASSERT_EQ(rows.values_size(), 4);
  EXPECT_FALSE(rows.values(0).struct_value().fields().at("is_reachable").bool_value());
  EXPECT_TRUE(rows.values(1).struct_value().fields().at("is_reachable").bool_value());

  EXPECT_THAT(MoonctlExpecting(0, {"role", "set", "rover2", "leader", "rover3", "survivor", "--dry-run"}),
              HasSubstr("would be"));
  EXPECT_THAT(MoonctlExpecting(3, {"role", "show"}), testing::Not(HasSubstr("leader                  1  rover2")));
  MoonctlExpecting(0, {"role", "set", "rover2", "leader", "rover3", "survivor"});
  const std::string key =
      KeyOf(MoonctlExpecting(0, {"record", "insert", "power", "{\"battery_ratio\": 0.5}", "-a", "rover3"}));
  // rover1 is dead. The sync completes for all other agents. The exit code reports that records of rover1 may be
  // missing.
  MoonctlExpecting(3, {"sync", "now", "--wait"});
  MoonctlExpecting(0, {"record", "get", key, "-a", "rover2"});
  // Records that only rover1 holds cannot be replicated yet.
  EXPECT_THAT(MoonctlExpecting(3, {"replicate", "now", "--wait"}),
              HasSubstr("all records are acknowledged; missing are records held only by rover1 (is out of reach)"));

  // The deposed leader receives the new roles when it restarts.
  const auto former = StartAgent("rover1");
  EXPECT_TRUE(Until([&] {
    return Moonctl({"role", "show", "-a", "rover1"}).out.find("rover1  rover ") == 0 ||
           Moonctl({"role", "show", "-a", "rover1"}).out.find("\nrover1  rover ") != std::string::npos;
  }));
  MoonctlExpecting(4, {"graph", "optimize", "-a", "rover1"});
}

// A leader that lost its disk requests all records from all agents. `sync now --wait` must wait until the leader has
// received the records of all reachable agents.
TEST_F(ProcessTest, WaitsUntilALeaderThatLostItsDiskHasCollectedAllRecords) {
  MoonctlExpecting(0, {"up"});
  constexpr std::uint64_t kSeed = 20261122;
  SCOPED_TRACE("seed " + std::to_string(kSeed));
  std::set<RecordKey> inserted;
  for (const AgentId agent : {1u, 3u}) {
    const auto keys = Connect("rover" + std::to_string(agent))->Insert(NoisyMaps(300, kSeed, agent));
    ASSERT_TRUE(keys.has_value()) << ToString(keys.error());
    inserted.insert(keys->begin(), keys->end());
  }
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  MoonctlExpecting(0, {"replicate", "now", "--wait"});
  Kill("rover3");  // Leader and survivor hold rover3's records.
  Kill("rover1");
  std::filesystem::remove_all(folder_ / "moondb-data" / "rover1");
  const auto leader = StartAgent("rover1");
  ASSERT_TRUE(Until([&] { return Moonctl({"status", "-a", "rover1"}).exit_code == 0; }));
  const Outcome synced = Moonctl({"sync", "now", "--wait"});
  EXPECT_EQ(synced.exit_code, 3) << synced.error;
  EXPECT_THAT(synced.out,
              HasSubstr("all records are acknowledged, but no records are exchanged with rover3 (out of reach)"));
  EXPECT_THAT(KeysHeldBy("rover1"), IsSupersetOf(inserted));
  const auto replicated = MoonctlJson(3, {"replicate", "now", "--wait"}).fields();
  EXPECT_TRUE(replicated.at("is_acknowledged").bool_value());
  const auto& not_gathered = replicated.at("not_gathered").list_value();
  ASSERT_EQ(not_gathered.values_size(), 1);
  EXPECT_EQ(not_gathered.values(0).struct_value().fields().at("agent").string_value(), "rover3");
  EXPECT_THAT(KeysHeldBy("rover2"), IsSupersetOf(inserted));
}

TEST_F(ProcessTest, ARoleSwapReturnsWhenTheNewLeaderActsOnIt) {
  MoonctlExpecting(0, {"up"});
  for (int i = 0; i < 4; ++i) {
    const std::string leader = i % 2 == 0 ? "rover2" : "rover1";
    EXPECT_THAT(MoonctlExpecting(0, {"role", "swap"}), HasSubstr("by " + leader + ": leader " + leader));
    EXPECT_THAT(MoonctlExpecting(0, {"sync", "now", "--wait"}), HasSubstr("sync at " + leader));
  }
  EXPECT_THAT(MoonctlExpecting(0, {"role", "swap", "--no-wait"}), HasSubstr("leader rover2, survivor rover1"));
}

TEST_F(ProcessTest, ReportsAgentsThatDidNotConfirmAChangeOfRoles) {
  MoonctlExpecting(0, {"up"});
  Kill("rover3");
  const std::vector<std::string> set = {"role", "set", "rover3", "survivor", "--timeout", "1s"};
  EXPECT_THAT(MoonctlExpecting(3, set), HasSubstr("survivor rover3; not yet confirmed by rover3"));
  const auto shown = MoonctlJson(3, {"role", "set", "rover3", "survivor", "--timeout", "1s"}).fields();
  EXPECT_EQ(shown.at("not_confirmed").list_value().values(0).string_value(), "rover3");
  MoonctlExpecting(0, {"role", "set", "rover3", "survivor", "--no-wait"});
  MoonctlExpecting(0, {"role", "set", "rover2", "survivor"});
}

TEST_F(ProcessTest, OperatesTheWholeTeamThroughTheBaseStation) {
  MoonctlExpecting(0, {"up"});
  MoonctlExpecting(0, {"record", "insert", "pose_graph_node", kNodeJson, "-a", "rover2", "--via", "base"});
  MoonctlExpecting(0, {"record", "insert", "local_traversability_map", kMapJson, "-a", "rover2", "--via", "base"});
  MoonctlExpecting(0, {"--via", "base", "sync", "now", "--wait"});
  MoonctlExpecting(0, {"--via", "base", "graph", "optimize"});
  MoonctlExpecting(0, {"--via", "base", "map", "export", folder_ / "map"});
  MoonctlExpecting(0, {"--via", "base", "role", "set", "rover2", "leader", "rover3", "survivor"});
  EXPECT_THAT(MoonctlExpecting(0, {"--via", "base", "status"}), HasSubstr("designated_survivor"));
  EXPECT_THAT(Moonctl({"--via", "bass", "status"}).error, HasSubstr("did you mean \"base\"?"));
  EXPECT_EQ(Moonctl({"--via", "bass", "status"}).exit_code, 2);
  Kill("rover1");
  EXPECT_TRUE(Until([&] { return Moonctl({"--via", "base", "status"}).exit_code == 3; }));
  EXPECT_THAT(MoonctlExpecting(3, {"--via", "base", "status"}), HasSubstr("rover1 cannot be reached from base"));
  EXPECT_THAT(MoonctlExpecting(0, {"--via", "base", "-a", "rover3", "status"}), HasSubstr("rover3"));
}

TEST_F(ProcessTest, ShowsTheTeamsEventLogAndReadsTheFileOfARunningAgent) {
  MoonctlExpecting(0, {"up"});
  MoonctlExpecting(0, {"role", "set", "rover2", "leader", "rover1", "survivor", "--reason", "sun is low"});
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  const std::string log = MoonctlExpecting(0, {"log"});
  EXPECT_THAT(log, HasSubstr("started, moondb"));
  EXPECT_THAT(log, HasSubstr("rover2 leads, "));
  EXPECT_THAT(log, HasSubstr("role set: leader rover2 survivor rover1 (sun is low) ("));
  EXPECT_THAT(log, HasSubstr("sync now ("));
  EXPECT_THAT(MoonctlExpecting(0, {"log", "--origin", "base"}), Not(HasSubstr("rover2")));
  EXPECT_GT(MoonctlJson(0, {"log"}).fields().at("events").list_value().values_size(), 6);

  const std::string started = "SELECT count(*) FROM v_event WHERE kind = 'started'";
  EXPECT_THAT(MoonctlExpecting(0, {"-a", "rover2", "db", "query", started}), HasSubstr("\n4\n"));
  MoonctlExpecting(2, {"-a", "rover2", "db", "query", "DELETE FROM agent_event"});
  MoonctlExpecting(2, {"db", "query", started});
  MoonctlExpecting(2, {"--via", "base", "-a", "rover2", "db", "query", started});
  MoonctlExpecting(0, {"-a", "rover2", "db", "backup", folder_ / "copy.sqlite"});
  MoonctlExpecting(2, {"-a", "rover2", "db", "backup", folder_ / "copy.sqlite"});
  MoonctlExpecting(1, {"-a", "rover2", "db", "backup", folder_ / "none" / "copy.sqlite"});
}

TEST_F(ProcessTest, StopsOnASignalWithinASecond) {
  const auto agent = StartAgent("rover1");
  ASSERT_TRUE(Until([&] { return agent->Out().find("ready: rover1") == 0; }));
  const auto start = std::chrono::steady_clock::now();
  agent->Signal(SIGTERM);
  const Outcome outcome = agent->Wait();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.error;
  // The documented limit is one second. Three seconds allow for a loaded machine.
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(3));
}

TEST_F(ProcessTest, NotifiesTheServiceManagerThatItIsReadyHealthyAndStopping) {
  const std::string path = (folder_ / "notify.sock").string();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(path.size(), sizeof(address.sun_path));
  path.copy(address.sun_path, path.size());
  const int manager = ::socket(AF_UNIX, SOCK_DGRAM, 0);
  ASSERT_EQ(::bind(manager, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  const timeval patience{.tv_sec = 60, .tv_usec = 0};
  ASSERT_EQ(::setsockopt(manager, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof(patience)), 0);
  const auto next = [manager] {
    char text[64] = {};
    const ssize_t size = ::recv(manager, text, sizeof(text), 0);
    return std::string(text, static_cast<std::size_t>(std::max<ssize_t>(size, 0)));
  };
  ::setenv("NOTIFY_SOCKET", path.c_str(), 1);
  const auto agent = StartAgent("rover1");
  ::unsetenv("NOTIFY_SOCKET");
  EXPECT_EQ(next(), "READY=1");
  EXPECT_THAT(agent->Out(), testing::StartsWith("ready: rover1"));
  EXPECT_EQ(next(), "WATCHDOG=1");
  agent->Signal(SIGTERM);
  std::string last = next();
  while (last == "WATCHDOG=1") last = next();
  EXPECT_EQ(last, "STOPPING=1");
  EXPECT_EQ(agent->Wait().exit_code, 0);
  ::close(manager);
}

TEST_F(ProcessTest, AgentsLogJsonIfConfigured) {
  MoonctlExpecting(0, {"up", "--log-format", "json"});
  MoonctlExpecting(0, {"down"});
  const std::string log = *ReadTextFile(folder_ / "moondb-data" / "rover1" / "agent.log");
  std::string_view rest = log;
  std::set<std::string> texts;
  while (!rest.empty()) {
    const std::string line(TakeLine(rest));
    google::protobuf::Struct event;
    EXPECT_TRUE(google::protobuf::util::JsonStringToMessage(line, &event).ok()) << line;
    EXPECT_EQ((*event.mutable_fields())["agent"].string_value(), "rover1") << line;
    texts.insert((*event.mutable_fields())["text"].string_value());
  }
  EXPECT_TRUE(texts.contains("stopping"));
  EXPECT_TRUE(texts.contains("rover2 is connected"));
  MoonctlExpecting(2, {"up", "--log-format", "xml"});
}

TEST_F(ProcessTest, RefusesASecondAgentOnTheSameDataOrAddress) {
  const auto agent = StartAgent("rover1");
  ASSERT_TRUE(Until([&] { return agent->Out().find("ready: rover1") == 0; }));
  const Outcome same_data = StartAgent("rover1")->Wait();
  EXPECT_EQ(same_data.exit_code, 1);
  EXPECT_THAT(same_data.error, HasSubstr("in use by another agent process (pid " + std::to_string(agent->pid())));
  const Outcome same_address = StartAgent("rover1", {"--data-dir", folder_ / "other"})->Wait();
  EXPECT_EQ(same_address.exit_code, 1) << same_address.error;
  EXPECT_EQ(std::count(same_address.error.begin(), same_address.error.end(), '\n'), 1) << same_address.error;
  EXPECT_EQ(Moonctl({"status", "-a", "rover1"}).exit_code, 0);
}

// After `kill -9`, a process may hold its files for a moment.
TEST_F(ProcessTest, StartsAnAgentWhoseProcessIsStillEnding) {
  std::optional<DataFolderLock> ending = *DataFolderLock::Take(folder_ / "moondb-data" / "rover1");
  auto up = std::async(std::launch::async, [this] { return Moonctl({"up", "-a", "rover1"}); });
  (void)up.wait_for(std::chrono::milliseconds(500));  // Gives moonctl time to look for the agent.
  ending.reset();
  const Outcome outcome = up.get();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
  EXPECT_THAT(outcome.out, HasSubstr("started"));
  MoonctlExpecting(0, {"status", "-a", "rover1"});
  MoonctlExpecting(0, {"down"});
}

TEST_F(ProcessTest, StartsNothingOnABadTeamFile) {
  std::string text = *ReadTextFile(team_file_);
  text.replace(text.find("name: rover2"), 12, "nmae: rover2");
  ASSERT_TRUE(WriteTextFile(team_file_, text).has_value());
  const Outcome checked = Moonctl({"config", "check"});
  EXPECT_EQ(checked.exit_code, 2);
  EXPECT_THAT(checked.error, HasSubstr("did you mean \"name\""));
  EXPECT_EQ(Moonctl({"up"}).exit_code, 2);
  const Outcome agent = StartAgent("rover1")->Wait();
  EXPECT_EQ(agent.exit_code, 2);
  EXPECT_THAT(agent.error, HasSubstr("did you mean \"name\""));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "moondb-data"));
}

TEST_F(ProcessTest, StopsTheOthersWhenOneCannotStart) {
  std::filesystem::create_directories(folder_ / "moondb-data" / "rover3" /
                                      "moondb.sqlite");  // A folder in place of the database file.
  const auto up = MoonctlJson(1, {"up"});
  const auto& rows = up.fields().at("agents").list_value();
  ASSERT_EQ(rows.values_size(), 4);
  EXPECT_THAT(rows.values(2).struct_value().fields().at("state").string_value(), HasSubstr("moondb.sqlite"));
  EXPECT_EQ(rows.values(0).struct_value().fields().at("state").string_value(), "stopped again");
  for (const char* name : {"rover1", "rover2", "rover3", "base"}) EXPECT_EQ(PidOf(name), 0) << name;
}

TEST_F(ProcessTest, SetsADamagedDatabaseAsideAndIsFilledAgain) {
  MoonctlExpecting(0, {"up"});
  std::string key = MoonctlExpecting(0, {"-a", "rover3", "record", "insert", "temperature", R"({"celsius": -40.5})"});
  key.resize(key.find('\n'));
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  MoonctlExpecting(0, {"down"});
  const std::filesystem::path database = folder_ / "moondb-data" / "rover3" / "moondb.sqlite";
  std::filesystem::remove(database.string() + "-wal");
  std::ofstream(database) << std::string(8192, 'x');
  MoonctlExpecting(0, {"up"});
  EXPECT_TRUE(std::filesystem::exists(database.string() + ".damaged-1"));
  // Retry: a restarted leader does not lead at once.
  EXPECT_TRUE(Until([&] {
    (void)Moonctl({"sync", "now", "--wait"});
    return MoonctlExpecting(0, {"-a", "rover3", "record", "list", "temperature"}).find(key) != std::string::npos;
  }));
  MoonctlExpecting(0, {"down"});
}

TEST_F(ProcessTest, DoesNotStopATeamOfAnotherDataFolder) {
  MoonctlExpecting(0, {"up"});
  const pid_t leader = PidOf("rover1");
  const std::string elsewhere = folder_ / "elsewhere";
  for (const char* command : {"up", "down"}) {
    const std::string said = MoonctlExpecting(1, {command, "--data-dir", elsewhere});
    EXPECT_THAT(said, testing::HasSubstr("process " + std::to_string(leader) + " runs this agent"));
  }
  EXPECT_EQ(PidOf("rover1"), leader);
  EXPECT_FALSE(std::filesystem::exists(elsewhere + "/rover1/moondb.sqlite"));
  MoonctlExpecting(0, {"status"});
  MoonctlExpecting(0, {"down"});
}

TEST_F(ProcessTest, SharesACustomDataType) {
  std::ofstream(team_file_, std::ios::app)
      << "custom_types:\n  - {id: 1000, name: soil_moisture, share: all, ground: latest, bytes_max: 64}\n";
  MoonctlExpecting(0, {"up"});
  const std::vector<std::string> insert = {"record", "insert", "-a", "rover3", "soil_moisture"};
  const auto with = [&insert](std::vector<std::string> more) {
    more.insert(more.begin(), insert.begin(), insert.end());
    return more;
  };
  const std::string text = KeyOf(
      MoonctlExpecting(0, with({R"({"payload_text": "wet", "latest_key_text": "hole 3", "metadata": "by eye"})"})));
  ASSERT_TRUE(WriteTextFile(folder_ / "scan.bin", std::string("\xFF\x00\x01", 3)).has_value());
  const std::string file = KeyOf(MoonctlExpecting(0, with({"--payload-file", folder_ / "scan.bin"})));
  MoonctlExpecting(0, {"sync", "now", "--wait"});

  const auto shown = MoonctlJson(0, {"record", "get", text, "-a", "rover1"}).fields();
  EXPECT_EQ(shown.at("type").string_value(), "soil_moisture");
  EXPECT_EQ(shown.at("payload_text").string_value(), "wet");
  EXPECT_EQ(shown.at("latest_key_text").string_value(), "hole 3");
  const auto custom = shown.at("record").struct_value().fields().at("custom").struct_value().fields();
  EXPECT_EQ(custom.at("metadata").string_value(), "by eye");
  const auto binary = MoonctlJson(0, {"record", "get", file, "-a", "rover1"}).fields();
  EXPECT_EQ(binary.count("payload_text"), 0u);
  EXPECT_EQ(
      binary.at("record").struct_value().fields().at("custom").struct_value().fields().at("payload").string_value(),
      "/wAB");
  EXPECT_THAT(MoonctlExpecting(0, {"record", "list", "soil_moisture", "-a", "rover1"}),
              testing::AllOf(HasSubstr(text), HasSubstr(file), HasSubstr("soil_moisture")));
  EXPECT_THAT(MoonctlExpecting(0, {"record", "list", "type_1500", "-a", "rover1"}), testing::Not(HasSubstr(text)));

  const std::string large = R"({"payload_text": ")" + std::string(65, 'x') + "\"}";
  EXPECT_THAT(Moonctl(with({large})).error, HasSubstr("has 65 bytes; soil_moisture allows 64"));
  EXPECT_THAT(Moonctl({"record", "insert", "-a", "rover3", "soil_moistur", "{}"}).error,
              HasSubstr("did you mean \"soil_moisture\"?"));

  const auto rover = Connect("rover3");
  ASSERT_NE(rover, nullptr);
  Client::Custom value;
  value.type = "soil_moisture";
  value.payload = "from C++";
  const auto key = rover->InsertCustom(value);
  ASSERT_TRUE(key.has_value()) << ToString(key.error());
  EXPECT_EQ(ToString(*key), "3." + text.substr(2, 16) + ".1000.3");
}

TEST_F(ProcessTest, SharingWaitsWhileARoverDrives) {
  MoonctlExpecting(0, {"up"});
  const std::string state =
      KeyOf(MoonctlExpecting(0, {"record", "insert", "temperature", "{\"celsius\": -20}", "-a", "rover2"}));
  const std::string node =
      KeyOf(MoonctlExpecting(0, {"record", "insert", "pose_graph_node", kNodeJson, "-a", "rover2"}));
  EXPECT_THAT(MoonctlExpecting(0, {"-a", "rover2", "drive", "on", "--for", "10m"}),
              HasSubstr("rover2 drives for 600 s"));
  EXPECT_THAT(MoonctlExpecting(0, {"-a", "rover3", "sleep", "--for", "1h"}), HasSubstr("rover3 sleeps for 3600 s"));
  EXPECT_TRUE(Until([&] {
    const std::string known_to_leader = MoonctlExpecting(0, {"status", "-a", "rover1"});
    return known_to_leader.find("rover2 drives for") != std::string::npos &&
           known_to_leader.find("rover3 sleeps for") != std::string::npos;
  }));
  MoonctlExpecting(0, {"sync", "now", "--from", "rover2"});
  EXPECT_TRUE(Until([&] {
    return MoonctlExpecting(0, {"sync", "status"}).find("waits: rover2 drives for") != std::string::npos;
  }));
  const Outcome late = Moonctl({"sync", "now", "--from", "rover2", "--wait", "--timeout", "1s"});
  EXPECT_EQ(late.exit_code, 5);
  EXPECT_THAT(late.error, HasSubstr("rover2 to rover1 (rover2 drives for"));
  MoonctlExpecting(0, {"record", "get", state, "-a", "rover1"});
  MoonctlExpecting(1, {"record", "get", node, "-a", "rover1"});

  EXPECT_THAT(MoonctlExpecting(0, {"-a", "rover2", "drive", "off"}), HasSubstr("rover2 neither drives nor sleeps"));
  EXPECT_TRUE(Until([&] { return Moonctl({"record", "get", node, "-a", "rover1"}).exit_code == 0; }));
  MoonctlExpecting(0, {"-a", "rover3", "sleep", "off"});
  EXPECT_TRUE(Until([&] { return MoonctlExpecting(0, {"status"}).find("sleeps") == std::string::npos; }));
  MoonctlExpecting(0, {"down"});
}

TEST_F(ProcessTest, AnOperatorPausesTheTeamAndOneAgentAndResumes) {
  MoonctlExpecting(0, {"up"});
  const std::string node =
      KeyOf(MoonctlExpecting(0, {"record", "insert", "pose_graph_node", kNodeJson, "-a", "rover2"}));
  EXPECT_THAT(MoonctlExpecting(0, {"sync", "pause"}), HasSubstr("rover2  is paused for 600 s more"));
  EXPECT_THAT(MoonctlExpecting(0, {"sync", "resume", "-a", "rover3"}), HasSubstr("rover3  not paused"));
  const auto paused = MoonctlJson(0, {"sync", "pause", "--for", "2h", "-a", "rover2"});
  const auto& answers = paused.fields().at("agents").list_value();
  ASSERT_EQ(answers.values_size(), 1);
  const auto& lease = answers.values(0).struct_value().fields().at("lease").struct_value();
  EXPECT_NEAR(lease.fields().at("paused_s").number_value(), 7200, 10);
  EXPECT_TRUE(Until([&] {
    const std::string known_to_leader = MoonctlExpecting(0, {"status", "-a", "rover1"});
    return known_to_leader.find("base is paused for ") != std::string::npos &&
           known_to_leader.find("rover3 is paused for ") == std::string::npos;
  }));
  MoonctlExpecting(0, {"sync", "now"});
  EXPECT_TRUE(Until([&] {
    return MoonctlExpecting(0, {"sync", "status"}).find("waits: rover2 is paused for 7") != std::string::npos;
  }));
  MoonctlExpecting(1, {"record", "get", node, "-a", "rover1"});

  Kill("base");
  EXPECT_THAT(MoonctlExpecting(3, {"sync", "resume"}), HasSubstr("base    unreachable: agent base is not running"));
  EXPECT_TRUE(Until([&] { return Moonctl({"record", "get", node, "-a", "rover1"}).exit_code == 0; }));
  EXPECT_THAT(MoonctlExpecting(0, {"log", "-a", "rover2"}),
              testing::AllOf(HasSubstr("sync pause for 7200 s"), HasSubstr("sync resume")));
  for (const char* bad : {"-5", "0", "25h", "soon", ""}) {
    EXPECT_THAT(Moonctl({"sync", "pause", "--for", bad}).error, HasSubstr("--for")) << bad;
  }
  MoonctlExpecting(2, {"sync", "pause", "-a", "rover9"});
}

TEST_F(ProcessTest, ReportsErrorsOfALease) {
  const auto error = [this](std::vector<std::string> command) {
    const Outcome outcome = Moonctl(std::move(command));
    EXPECT_EQ(outcome.exit_code, 2) << outcome.error;
    return outcome.error;
  };
  for (const char* bad : {"-5", "0", "soon", "25h", "1e9", "nan", ""}) {
    EXPECT_THAT(error({"-a", "rover2", "drive", "on", "--for", bad}), HasSubstr("--for"));
    EXPECT_THAT(error({"-a", "rover2", "sleep", "--for", bad}), HasSubstr("--for")) << bad;
  }
  EXPECT_THAT(error({"-a", "rover2", "drive", "on"}), HasSubstr("--for is required"));
  EXPECT_THAT(error({"-a", "rover2", "drive", "onn", "--for", "5"}), HasSubstr("did you mean \"on\"?"));
  EXPECT_THAT(error({"drive", "on", "--for", "5"}), HasSubstr("name one: -a rover1"));
  EXPECT_THAT(error({"-a", "rover2", "sleep"}), HasSubstr("expected sleep --for DURATION"));
  EXPECT_THAT(error({"-a", "rover2", "sleep", "off", "--for", "5"}), HasSubstr("expected sleep --for DURATION"));
  for (const char* bad : {"2026-13-01T00:00Z", "2026-11-22T06:00", "2026-11-22T24:00Z", "tomorrow"}) {
    EXPECT_THAT(error({"-a", "rover2", "sleep", "--until", bad}), HasSubstr("expected a time in UTC")) << bad;
  }
  EXPECT_THAT(error({"-a", "rover2", "sleep", "--until", "2020-01-01T00:00:30Z"}),
              HasSubstr("not within the next 24 h"));
}

TEST_F(ProcessTest, TheSurvivorTakesTheLeadOfAKilledLeader) {
  ASSERT_NO_FATAL_FAILURE(UpWithAutomaticFailover());
  Kill("rover1");
  const auto role_of = [this](const std::string& name) {
    const auto shown = MoonctlJson(0, {"role", "show", "-a", name}).fields();
    return shown.at("agents").list_value().values(0).struct_value().fields().at("role").string_value();
  };
  EXPECT_TRUE(Until([&] { return role_of("rover2") == "leader" && role_of("rover3") == "designated_survivor"; }));
  const auto former = StartAgent("rover1");
  EXPECT_TRUE(Until([&] {
    return Moonctl({"status", "-a", "rover1"}).exit_code == 0 && role_of("rover1") == "rover";
  }));
}

// A stopped process keeps its connections, so only unanswered requests show that it hangs.
TEST_F(ProcessTest, TheSurvivorTakesTheLeadOfALeaderThatHangs) {
  ASSERT_NO_FATAL_FAILURE(UpWithAutomaticFailover());
  const pid_t leader = PidOf("rover1");
  ASSERT_EQ(kill(leader, SIGSTOP), 0);
  const auto is_replaced = [this] {
    return MoonctlExpecting(0, {"role", "show", "-a", "rover2"}).find("rover2  leader ") != std::string::npos;
  };
  // Failover takes 4/3 of leader_timeout_s plus 3 s. Without the survivor's heartbeats to the leader, the link would be
  // closed only after 33 s.
  EXPECT_TRUE(Until(is_replaced, std::chrono::seconds(15)));
  ASSERT_EQ(kill(leader, SIGCONT), 0);
}

TEST_F(ProcessTest, ReportsErrorsInCommands) {
  EXPECT_THAT(Moonctl({"statsu"}).error, HasSubstr("did you mean \"status\"?"));
  EXPECT_EQ(Moonctl({"statsu"}).exit_code, 2);
  EXPECT_THAT(Moonctl({"role", "set", "rovr2", "leader"}).error, HasSubstr("did you mean \"rover2\"?"));
  EXPECT_THAT(Moonctl({"record", "insert", "temperature", "{ }", "-a", "rover1"}).error,
              HasSubstr("the JSON object is empty"));
  EXPECT_THAT(Moonctl({"record", "insert", "temperture", "{}", "-a", "rover1"}).error,
              HasSubstr("did you mean \"temperature\"?"));
  EXPECT_THAT(Moonctl({"record", "insert", "temperature", "{\"celsiu\": 1}", "-a", "rover1"}).error,
              HasSubstr("celsiu"));
  const auto error = MoonctlJson(2, {"role", "set", "rovr2", "leader"});
  EXPECT_EQ(error.fields().at("error").struct_value().fields().at("code").string_value(), "invalid");
  EXPECT_EQ(MoonctlJson(3, {"record", "list", "-a", "rover1"})
                .fields()
                .at("error")
                .struct_value()
                .fields()
                .at("code")
                .string_value(),
            "unavailable");
  MoonctlJson(0, {"version"});
  MoonctlJson(0, {"config", "show"});
}

}  // namespace
}  // namespace moondb
