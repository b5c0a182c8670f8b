// Tests the commands that show which agents hold which records, and whether the records are intact.

#include <gmock/gmock.h>
#include <sqlite3.h>

#include "apps/common/data_folder.h"
#include "model/text.h"
#include "tests/apps/process_team.h"

namespace moondb {
namespace {

using google::protobuf::Struct;
using google::protobuf::Value;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const Value& Field(const Struct& json, const std::string& name) { return json.fields().at(name); }

std::vector<Struct> List(const Struct& json, const std::string& name) {
  std::vector<Struct> structs;
  for (const Value& value : Field(json, name).list_value().values()) structs.push_back(value.struct_value());
  return structs;
}

// Returns the row of the data type pose_graph_node. Requires: exactly one row has this type.
Struct OfNodes(const std::vector<Struct>& rows) {
  std::vector<Struct> found;
  for (const Struct& row : rows) {
    if (row.fields().at("type").string_value() == "pose_graph_node") found.push_back(row);
  }
  EXPECT_EQ(found.size(), 1u);
  return found.empty() ? Struct() : found.front();
}

double Number(const Struct& json, const std::string& name) { return Field(json, name).number_value(); }
std::string Text(const Struct& json, const std::string& name) { return Field(json, name).string_value(); }

class TrustTest : public ProcessTeam {
 protected:
  // More nodes than a verification checks in one slice.
  static constexpr int kNodes = 2500;

  void Start() {
    MoonctlExpecting(0, {"up"});
    const auto rover3 = Connect("rover3");
    ASSERT_NE(rover3, nullptr);
    std::vector<proto::Record> records(kNodes);
    for (int i = 0; i < kNodes; ++i) {
      records[i].set_timestamp_ns(i + 1);
      proto::PoseGraphNode& node = *records[i].mutable_pose_graph_node();
      node.mutable_node()->set_agent_id(3);
      node.mutable_node()->set_index(i);
      node.mutable_map_from_node()->mutable_position_m();
      node.mutable_map_from_node()->mutable_orientation()->set_w(1);
    }
    const auto keys = rover3->Insert(records);
    ASSERT_TRUE(keys) << ToString(keys.error());
    node_ = (*keys)[kNodes / 2];
    MoonctlExpecting(0, {"record", "insert", "temperature", "{\"celsius\": -20}", "-a", "rover3"});
  }

  // Changes one byte of a node's content in the store file of a running agent.
  void ChangeAByte(const std::string& agent, const RecordKey& key) {
    const std::string path = DefaultDataRoot(team_file_.parent_path()) / agent / "moondb.sqlite";
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
    sqlite3_busy_timeout(database, 10'000);
    const std::string sql =
        "UPDATE pose_graph_node SET content = CAST(x'FF' || substr(content, 2) AS BLOB) WHERE origin = " +
        std::to_string(key.stream.origin) + " AND seq = " + std::to_string(key.seq);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
    EXPECT_EQ(sqlite3_changes(database), 1);
    sqlite3_close(database);
  }

  RecordKey node_;
};

TEST_F(TrustTest, ShowsSentAndAcknowledgedRecordsPerPair) {
  Start();
  EXPECT_THAT(MoonctlExpecting(0, {"sync", "status", "-a", "base"}), HasSubstr("nothing sent since the agent started"));
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  EXPECT_THAT(MoonctlExpecting(0, {"sync", "status"}),
              AllOf(HasSubstr("QUIET FOR"), HasSubstr("rover3  rover1  idle")));
  const auto rows = List(MoonctlJson(0, {"sync", "status", "-a", "rover3"}), "agents");
  ASSERT_EQ(rows.size(), 1u);
  const auto sessions = List(rows[0], "sessions");
  ASSERT_EQ(sessions.size(), 1u);
  EXPECT_EQ(Text(sessions[0], "to"), "rover1");
  EXPECT_EQ(Field(sessions[0], "eta_s").kind_case(), Value::kNullValue);
  const Struct session = Field(sessions[0], "session").struct_value();
  EXPECT_EQ(Number(session, "acknowledged_records"), kNodes + 1);
  EXPECT_EQ(Number(session, "remaining"), 0);
  EXPECT_TRUE(Field(session, "is_remaining_known").bool_value());

  Kill("rover2");
  EXPECT_THAT(MoonctlExpecting(3, {"replicate", "status"}), HasSubstr("rover2  unreachable"));
  EXPECT_THAT(Moonctl({"sync", "status", "-a", "rovr2"}).error, HasSubstr("did you mean \"rover2\"?"));
  EXPECT_EQ(Moonctl({"sync", "status", "-a", "rovr2"}).exit_code, 2);
}

TEST_F(TrustTest, ShowsTheHistoryOfRolesWithReasons) {
  MoonctlExpecting(0, {"up"});
  // A leader takes a new term at its start. Wait for this term.
  ASSERT_TRUE(Until([&] { return Moonctl({"role", "history"}).out.find("start of the leader") != std::string::npos; }));
  MoonctlExpecting(0, {"role", "swap", "--reason", "a full battery"});
  const auto history = List(MoonctlJson(0, {"role", "history", "-a", "rover2"}), "history");
  ASSERT_GE(history.size(), 2u);
  EXPECT_EQ(Number(history.back(), "leader"), 2);
  EXPECT_EQ(Number(history.back(), "survivor"), 1);
  EXPECT_EQ(Text(history.back(), "reason"), "a full battery");
  const std::string shown = MoonctlExpecting(0, {"role", "history", "-a", "rover2"});
  EXPECT_THAT(shown, testing::ContainsRegex("start of the leader\n.*rover2 +rover1 +20.*UTC +a full battery\n"));
  EXPECT_THAT(Moonctl({"role", "histroy"}).error, HasSubstr("did you mean \"history\"?"));
}

TEST_F(TrustTest, ShowsHoldingsAndTheirDifferences) {
  Start();
  EXPECT_THAT(MoonctlExpecting(1, {"db", "diff", "rover3", "rover1"}), HasSubstr("rover3 and rover1 differ"));
  const Struct nodes = OfNodes(List(MoonctlJson(1, {"db", "diff", "rover1", "rover3"}), "series"));
  EXPECT_EQ(Number(nodes, "first_held"), 0);
  EXPECT_EQ(Number(nodes, "second_held"), kNodes);
  EXPECT_EQ(Number(nodes, "first_only"), 0);
  EXPECT_EQ(Number(nodes, "second_only"), kNodes);

  MoonctlExpecting(0, {"sync", "now", "--wait"});
  EXPECT_THAT(MoonctlExpecting(0, {"db", "holdings"}),
              testing::ContainsRegex("rover3 +pose_graph_node +2500 +- +2500"));
  const Struct holdings = OfNodes(List(MoonctlJson(0, {"db", "holdings"}), "holdings"));
  EXPECT_EQ(Number(List(holdings, "held_by")[1], "lacking"), kNodes);
  MoonctlExpecting(0, {"replicate", "now", "--wait"});
  EXPECT_THAT(MoonctlExpecting(0, {"db", "diff", "rover2", "rover1"}), HasSubstr("hold the same records"));

  // If a record changed at one agent, the counts are equal but the fingerprints differ.
  ChangeAByte("rover1", node_);
  EXPECT_THAT(MoonctlExpecting(1, {"db", "diff", "rover2", "rover1"}), HasSubstr(ToString(node_) + " differs"));
  const auto series = List(MoonctlJson(1, {"db", "diff", "rover1", "rover2"}), "series");
  EXPECT_EQ(Field(OfNodes(series), "differing").list_value().values_size(), 1);

  Kill("rover3");
  EXPECT_THAT(MoonctlExpecting(3, {"db", "holdings"}), AllOf(HasSubstr("?"), HasSubstr("rover3: unreachable")));
  MoonctlExpecting(3, {"db", "diff", "rover1", "rover3"});
  EXPECT_EQ(Moonctl({"db", "diff", "rover1", "rover1"}).exit_code, 2);
  EXPECT_THAT(Moonctl({"db", "diff", "rover1", "rovr2"}).error, HasSubstr("did you mean \"rover2\"?"));
  EXPECT_THAT(Moonctl({"db", "holding"}).error, HasSubstr("did you mean \"holdings\"?"));
}

TEST_F(TrustTest, FindsDamageInAStore) {
  Start();
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  EXPECT_THAT(MoonctlExpecting(0, {"db", "verify"}), Not(HasSubstr("DAMAGED\n")));
  ChangeAByte("rover1", node_);
  EXPECT_THAT(MoonctlExpecting(1, {"db", "verify"}),
              AllOf(testing::ContainsRegex("rover1 +25[0-9]+ +1 +0 +0 .* DAMAGED\n"),
                    testing::ContainsRegex("rover3 +25[0-9]+ +0 +0 +0 .* sound\n"),
                    HasSubstr("rover1: " + ToString(node_) + ": its content does not match its hash\n")));
  const auto agents = List(MoonctlJson(1, {"db", "verify"}), "agents");
  ASSERT_EQ(agents.size(), 4u);
  EXPECT_FALSE(Field(agents[0], "is_sound").bool_value());
  EXPECT_EQ(Number(agents[0], "damaged"), 1);
  EXPECT_GT(Number(agents[0], "held"), kNodes);  // rover1 holds the nodes and events.
  EXPECT_TRUE(Field(agents[2], "is_sound").bool_value());
  MoonctlExpecting(0, {"db", "verify", "-a", "rover3"});

  Kill("rover2");
  // The exit code reports the damage, not the unreachable agent.
  EXPECT_THAT(MoonctlExpecting(1, {"db", "verify"}), HasSubstr("rover2  unreachable"));
  MoonctlExpecting(3, {"db", "verify", "-a", "rover2"});
  EXPECT_EQ(Moonctl({"db", "verify", "-a", "nobody"}).exit_code, 2);
  EXPECT_THAT(Moonctl({"db", "verfy"}).error, HasSubstr("did you mean \"verify\"?"));
}

TEST_F(TrustTest, PrunesOnlyRecordsThatLeaderAndSurvivorHold) {
  Start();
  const std::vector<std::string> prune = {"-a", "rover3", "db", "prune", "--type", "pose_graph_node"};
  EXPECT_THAT(MoonctlExpecting(0, prune), testing::ContainsRegex("all +0 +0 B\n.*2,?500 more records are kept until"));
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  MoonctlExpecting(0, {"replicate", "now", "--wait"});
  std::vector<std::string> dry_run = prune;
  dry_run.push_back("--dry-run");
  EXPECT_THAT(MoonctlExpecting(0, dry_run), testing::ContainsRegex("pose_graph_node +2,?500 "));
  EXPECT_EQ(List(MoonctlJson(0, prune), "pruned").size(), 1u);
  EXPECT_THAT(MoonctlExpecting(0, {"db", "holdings"}),
              testing::ContainsRegex("rover3 +pose_graph_node +2500 +2500 +- "));
  MoonctlExpecting(0, {"sync", "now", "--wait"});
  EXPECT_THAT(MoonctlExpecting(0, {"db", "holdings"}),
              testing::ContainsRegex("rover3 +pose_graph_node +2500 +2500 +- "));
  MoonctlExpecting(0, {"replicate", "now", "--wait"});
  EXPECT_THAT(MoonctlExpecting(0, {"db", "diff", "rover1", "rover2"}), HasSubstr("hold the same records"));
  MoonctlExpecting(0, {"db", "verify", "-a", "rover3"});
  EXPECT_THAT(MoonctlExpecting(0, {"log", "-a", "rover3"}), HasSubstr("db prune pose_graph_node"));

  Kill("rover2");
  const Outcome refused = Moonctl(prune);
  EXPECT_EQ(refused.exit_code, 4);
  EXPECT_THAT(refused.error, HasSubstr("rover3 removes nothing: rover2, the designated survivor,"));
  EXPECT_THAT(Text(MoonctlJson(4, prune), "text"), HasSubstr("rover2, the designated survivor,"));
}

TEST_F(TrustTest, ReportsErrorsOfAPrune) {
  EXPECT_THAT(Moonctl({"db", "prune", "--max-mb", "1"}).error, HasSubstr("which agent's store? Give -a rover1"));
  const auto error_of = [this](const std::vector<std::string>& more) {
    std::vector<std::string> arguments = {"-a", "rover3", "db", "prune"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = Moonctl(arguments);
    EXPECT_EQ(outcome.exit_code, 2) << outcome.error;
    return outcome.error;
  };
  EXPECT_THAT(error_of({}), HasSubstr("no records are selected"));
  EXPECT_THAT(error_of({"--older-than", "soon"}), HasSubstr("expected an age such as 30d"));
  EXPECT_THAT(error_of({"--older-than", "-3d"}), HasSubstr("--older-than"));
  EXPECT_THAT(error_of({"--type", "nodes"}), HasSubstr("no data type \"nodes\""));
  EXPECT_THAT(error_of({"--max-mb", "0"}), HasSubstr("--max-mb"));
}

TEST_F(TrustTest, ShowsSizes) {
  Start();
  EXPECT_THAT(MoonctlExpecting(0, {"db", "info"}),
              AllOf(HasSubstr("WAL"), testing::ContainsRegex("pose_graph_node +0 +0 +2500")));
  const auto agents = List(MoonctlJson(0, {"db", "info", "-a", "rover3"}), "agents");
  ASSERT_EQ(agents.size(), 1u);
  const Struct storage = Field(agents[0], "storage").struct_value();
  EXPECT_GT(Number(storage, "wal_bytes"), 0);
  EXPECT_GT(Number(storage, "database_bytes"), Number(storage, "wal_bytes"));
  EXPECT_GE(Number(List(storage, "written").back(), "bytes"), Number(storage, "wal_bytes"));
}

}  // namespace
}  // namespace moondb
