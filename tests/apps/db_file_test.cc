// Reads a store's files with programs that are not part of moondb: a CSV reader and SQLite's sqldiff.

#include <gmock/gmock.h>

#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string NodeJson(int agent, int index) {
  return R"({"node": {"agent_id": )" + std::to_string(agent) + R"(, "index": )" + std::to_string(index) +
         R"(}, "map_from_node": {"position_m": {"x": 1.5}, "orientation": {"w": 1}}})";
}

constexpr char kMapJson[] = R"({
  "node": {"agent_id": 3, "index": 0},
  "node_from_map": {"position_m": {}, "orientation": {"w": 1}},
  "layers": [{"width_cells": 4, "height_cells": 4, "resolution_um": 50000, "cells": "VVVVVQ=="}]})";

class DbFileTest : public ProcessTeam {
 protected:
  bool HasProgram(const std::string& name) { return Run({"/bin/sh", "-c", "command -v " + name}).exit_code == 0; }

  // Compares copies of the leader's and the survivor's store with tools/diff_stores, which uses SQLite's sqldiff.
  Outcome DiffStores(const std::string& name) {
    const auto leader = folder_ / (name + "_leader.sqlite"), survivor = folder_ / (name + "_survivor.sqlite");
    MoonctlExpecting(0, {"-a", "rover1", "db", "backup", leader});
    MoonctlExpecting(0, {"-a", "rover2", "db", "backup", survivor});
    return Run({MOONDB_TOOLS "/diff_stores", leader, survivor});
  }
};

TEST_F(DbFileTest, WritesCsvThatAnotherProgramReads) {
  MoonctlExpecting(0, {"up"});
  const std::string sql =
      "SELECT 'a,b' AS \"x,y\", '\"hi\" said' AS said, 'two' || char(10) || 'lines' AS lines, NULL AS absent, '' AS "
      "empty, x'00ff' AS blob, 1.5 AS number, -9223372036854775808 AS whole, 'h\u00fcgel' AS text "
      "UNION ALL SELECT 1, 2, 3, 4, 5, 6, 7, 8, 9";
  const auto file = folder_ / "answer.csv";
  EXPECT_THAT(MoonctlExpecting(0, {"-a", "rover1", "db", "query", sql, "--csv", "--out", file}),
              HasSubstr("answer.csv: 2 rows"));
  const Outcome read =
      Run({"/usr/bin/env", "python3", "-c",
           "import csv, sys; print(list(csv.reader(open(sys.argv[1], encoding='utf-8', newline=''))))", file});
  EXPECT_EQ(read.out,
            "[['x,y', 'said', 'lines', 'absent', 'empty', 'blob', 'number', 'whole', 'text'], "
            "['a,b', '\"hi\" said', 'two\\nlines', '', '', '00ff', '1.5', '-9223372036854775808', 'h\u00fcgel'], "
            "['1', '2', '3', '4', '5', '6', '7', '8', '9']]\n")
      << read.error;

  // NULL and the empty text must differ. stdout must contain only the table.
  EXPECT_EQ(MoonctlExpecting(0, {"-a", "rover1", "db", "query", "SELECT NULL AS a, '' AS b", "--csv"}), "a,b\n,\"\"\n");
  const Outcome cut = Moonctl({"-a", "rover1", "db", "query", "SELECT 1 AS a UNION SELECT 2", "--csv", "--limit", "1"});
  EXPECT_EQ(cut.out, "a\n1\n");
  EXPECT_THAT(cut.error, HasSubstr("there are more rows"));
  const auto json = MoonctlJson(0, {"-a", "rover1", "db", "query", "SELECT 1", "--csv", "--out", file});
  EXPECT_EQ(json.fields().at("rows").number_value(), 1);

  MoonctlExpecting(2, {"-a", "rover1", "db", "query", "SELECT 1", "--csv", "--json"});
  MoonctlExpecting(2, {"-a", "rover1", "db", "query", "SELECT 1", "--out", file});
  MoonctlExpecting(1, {"-a", "rover1", "db", "query", "SELECT 1", "--csv", "--out", folder_ / "none" / "a.csv"});
}

TEST_F(DbFileTest, LeaderAndSurvivorAreTheSameToSqldiff) {
  if (!HasProgram("sqldiff") || !HasProgram("sqlite3")) GTEST_SKIP() << "sqlite3 or sqldiff is not installed";
  MoonctlExpecting(0, {"up"});
  // Each agent inserts its rows before it receives rows of others, so the leader and the survivor store the rows in
  // different orders.
  for (int rover = 1; rover <= 3; ++rover) {
    const std::string name = "rover" + std::to_string(rover);
    for (int index = 0; index < 3; ++index) {
      MoonctlExpecting(0, {"record", "insert", "pose_graph_node", NodeJson(rover, index), "-a", name});
    }
    MoonctlExpecting(0, {"record", "insert", "temperature", "{\"celsius\": -20}", "-a", name});
  }
  MoonctlExpecting(0, {"record", "insert", "local_traversability_map", kMapJson, "-a", "rover3"});
  MoonctlExpecting(0, {"record", "insert", "--local", "pose_graph_node", NodeJson(2, 99), "-a", "rover2"});
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  MoonctlExpecting(0, {"replicate", "now", "--wait"});

  const Outcome same = DiffStores("same");
  EXPECT_EQ(same.exit_code, 0) << same.out << same.error;
  EXPECT_THAT(same.out, HasSubstr("pose_graph_node: 9 rows, the same\n"));
  EXPECT_THAT(same.out, HasSubstr("local_traversability_map: 1 rows, the same\n"));
  EXPECT_THAT(same.out, HasSubstr("temperature: 3 rows, the same\n"));
  EXPECT_THAT(same.out, Not(HasSubstr("agent_event: 0 rows")));

  MoonctlExpecting(0, {"record", "insert", "pose_graph_node", NodeJson(1, 3), "-a", "rover1"});
  const Outcome ahead = DiffStores("ahead");
  EXPECT_EQ(ahead.exit_code, 1) << ahead.out << ahead.error;
  EXPECT_THAT(ahead.out, HasSubstr("pose_graph_node: not the same\nDELETE FROM pose_graph_node WHERE origin=1 "));
  EXPECT_THAT(ahead.out, HasSubstr("temperature: 3 rows, the same\n"));

  EXPECT_EQ(Run({MOONDB_TOOLS "/diff_stores", folder_ / "same_leader.sqlite", folder_ / "none"}).exit_code, 2);
  EXPECT_EQ(Run({MOONDB_TOOLS "/diff_stores", folder_ / "same_leader.sqlite", team_file_}).exit_code, 2);
}

}  // namespace
}  // namespace moondb
