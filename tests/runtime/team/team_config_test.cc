#include "runtime/team/team_config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "model/command_from.h"
#include "model/team_id.h"
#include "model/team_member.h"
#include "proto/term.pb.h"
#include "proto/types.pb.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/signing_key.h"
#include "runtime/team/team_init.h"
#include "runtime/team/team_keys.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

// A valid team file with one agent per line, so that the tests know the line numbers of errors.
constexpr char kGood[] = R"(team: test
insecure: true
agents:
  - {id: 1, name: rover1, address: "tcp://127.0.0.1:7400"}
  - {id: 2, name: rover2, address: "tcp://127.0.0.1:7401"}
  - {id: 3, name: base, address: "tcp://127.0.0.1:7402", kind: base_station, position_m: [1, 2, 3]}
team_id: "00112233445566778899aabbccddeeff"
)";

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

struct BadFile {
  const char* name;
  std::string yaml;
  std::string error;
};

std::string Good(const std::string& from, const std::string& to) { return Replaced(kGood, from, to); }

std::string GoodAnd(const std::string& line) { return kGood + line + "\n"; }

const BadFile kBadFiles[] = {
    {"Empty", "", "t:1:1: the file is empty"},
    {"NoFields", "- 1\n", "t:1:1: expected fields such as \"team: NAME\", got a list"},
    {"TwoDocuments", std::string(kGood) + "---\nteam: b\n",
     "t:9:1: a second document begins here; only one is allowed"},
    {"Syntax", "team: test\nagents: [\n", "t:3:1: not YAML: end of sequence flow not found"},
    {"MisspeltKey", Good("address: \"tcp://127.0.0.1:7401\"", "adress: \"tcp://127.0.0.1:7401\""),
     "t:5:27: agents[1].adress: no such field; did you mean \"address\"?"},
    {"StrangeKey", GoodAnd("colour: red"), "t:8:1: colour: no such field"},
    {"KeyWithEscapes", GoodAnd("\"\\e[2J\": red"), "t:8:1: \\x1b[2J: no such field"},
    {"WrongInteger", Good("id: 2", "id: two"), "t:5:10: agents[1].id: expected an integer, got \"two\""},
    {"FractionalId", Good("id: 2", "id: 1.5"), "t:5:10: agents[1].id: expected an integer, got \"1.5\""},
    {"NegativeId", Good("id: 2", "id: -2"),
     "t:5:10: agents[1].id: expected an integer from 0 to 4294967295, got \"-2\""},
    {"IdOutOfRange", Good("id: 2", "id: 65536"), "t:5:10: agents[1].id: expected 1 to 65535, got 65536"},
    {"NoId", Good("id: 2, ", ""), "t:5:5: agents[1].id: missing"},
    {"DoubledKey", Good("id: 2,", "id: 2, id: 4,"), "t:5:13: agents[1].id: given twice, first in line 5"},
    {"DoubledId", Good("id: 2", "id: 1"), "t:5:10: agents[1].id: 1 is already that of agents[0]"},
    {"DoubledName", Good("rover2", "rover1"), "t:5:19: agents[1].name: rover1 is already that of agents[0]"},
    {"DoubledAddress", Good("7401", "7400"),
     "t:5:36: agents[1].address: tcp://127.0.0.1:7400 is already that of agents[0]"},
    {"BadName", Good("rover2", "Rover 2"),
     "t:5:19: agents[1].name: expected at most 32 lower-case letters, digits, - and _, got \"Rover 2\""},
    {"BadTeamName", Good("team: test", "team: ../x"),
     "t:1:7: team: expected at most 32 lower-case letters, digits, - and _, got \"../x\""},
    {"NoPort", Good("127.0.0.1:7401", "127.0.0.1"),
     "t:5:36: agents[1].address: expected tcp://HOST:PORT or ipc:///PATH, got \"tcp://127.0.0.1\""},
    {"PortOutOfRange", Good(":7401", ":74010"),
     "t:5:36: agents[1].address: expected a port from 1 to 65535, got \"74010\""},
    {"Wildcard", Good("127.0.0.1:7401", "0.0.0.0:7401"),
     "t:5:36: agents[1].address: other agents connect to this address, so it cannot be \"0.0.0.0\""},
    {"BadHost", Good("127.0.0.1:7401", "a;b:7401"),
     "t:5:36: agents[1].address: expected a host name or an IP address, got \"a;b\""},
    {"LinkLocalWithoutInterface", Good("127.0.0.1:7401", "[fe80::1]:7401"),
     "t:5:36: agents[1].address: a link-local address needs its interface, such as [fe80::1%wlan0]"},
    {"BadInterface", Good("127.0.0.1:7401", "[fe80::1%]:7401"),
     "t:5:36: agents[1].address: expected a network interface after %, got \"\""},
    {"BadNumber6", Good("127.0.0.1:7401", "[fe80:::1]:7401"),
     "t:5:36: agents[1].address: expected an IPv6 address, got \"fe80:::1\""},
    {"ListenOfAnotherKind", Good("7401\"}", "7401\", listen: \"ipc:///tmp/x\"}"),
     "t:5:68: agents[1].listen: expected tcp://HOST:PORT, beside an address of this kind, got \"ipc:///tmp/x\""},
    {"ListenWithoutPort", Good("7401\"}", "7401\", listen: \"tcp://0.0.0.0:0\"}"),
     "t:5:68: agents[1].listen: expected a port from 1 to 65535, got \"0\""},
    {"ClientAddressOfAnotherKind", Good("7401\"}", "7401\", client_address: \"ipc:///tmp/x\"}"),
     "t:5:76: agents[1].client_address: expected tcp://HOST:PORT, got \"ipc:///tmp/x\""},
    {"ClientWildcard", Good("7401\"}", "7401\", client_address: \"tcp://0.0.0.0:7500\"}"),
     "t:5:76: agents[1].client_address: clients connect to this address, so it cannot be \"0.0.0.0\""},
    {"ClientsWithoutKeys", Good("7401\"}", "7401\", client_address: \"tcp://10.0.0.1:7500\"}"),
     "t:5:76: agents[1].client_address: needs keys, but the team is `insecure: true`"},
    {"RelativeSocket", Good("tcp://127.0.0.1:7401", "ipc://x"),
     "t:5:36: agents[1].address: expected an absolute path after ipc://"},
    {"BadEnum", Good("base_station", "base_staton"),
     "t:6:64: agents[2].kind: expected rover or base_station, got \"base_staton\"; did you mean \"base_station\"?"},
    {"NoPosition", Good(", position_m: [1, 2, 3]", ""), "t:6:5: agents[2].position_m: missing"},
    {"ShortPosition", Good("[1, 2, 3]", "[1, 2]"), "t:6:90: agents[2].position_m: expected 3 numbers (x, y, z), got 2"},
    {"InfinitePosition", Good("[1, 2, 3]", "[1, .inf, 3]"),
     "t:6:94: agents[2].position_m[1]: expected a finite number, got \".inf\""},
    {"HugeNumber", Good("[1, 2, 3]", "[1, 1e999, 3]"),
     "t:6:94: agents[2].position_m[1]: expected a finite number, got \"1e999\""},
    {"PositionOfRover", Good("7401\"}", "7401\", position_m: [0, 0, 0]}"),
     "t:5:72: agents[1].position_m: a rover has start instead; position_m is for base stations"},
    {"StartOfBase", Good("[1, 2, 3]", "[1, 2, 3], start: {x: 1}"),
     "t:6:108: agents[2].start: a base station has position_m instead"},
    {"TwoBases", Good("7401\"}", "7401\", kind: base_station, position_m: [0, 0, 0]}"),
     "t:6:64: agents[2].kind: the team has a base station already: agents[1]"},
    {"NoRover",
     "team: t\ninsecure: true\nagents:\n  - {id: 3, name: b, address: \"ipc:///tmp/b\", "
     "kind: base_station, position_m: [1, 2, 3]}\nteam_id: 00112233445566778899aabbccddeeff\n",
     "t:4:3: agents: expected at least one rover"},
    {"ZeroSigma", Good("7401\"}", "7401\", start: {sigma_m: 0}}"),
     "t:5:77: agents[1].start.sigma_m: expected 1e-06 to 1000, got 0"},
    {"NoKey", Good("insecure: true", "insecure: false"),
     "t:4:5: agents[0].key: missing: the file of the agent's public key (or `insecure: true` for the team)\n"
     "t:5:5: agents[1].key: missing: the file of the agent's public key (or `insecure: true` for the team)\n"
     "t:6:5: agents[2].key: missing: the file of the agent's public key (or `insecure: true` for the team)"},
    {"UnknownLeader", GoodAnd("roles: {leader: rover11}"),
     "t:8:17: roles.leader: no agent is named \"rover11\"; did you mean \"rover1\"?"},
    {"LeaderIsSurvivor", GoodAnd("roles: {leader: rover1, survivor: rover1}"),
     "t:8:35: roles.survivor: rover1 is the leader; the designated survivor must be another rover"},
    {"BaseLeads", GoodAnd("roles: {leader: base}"),
     "t:8:17: roles.leader: base is a base station; only a rover can hold this role"},
    {"BasePreserves", GoodAnd("roles: {survivor: base}"),
     "t:8:19: roles.survivor: base is a base station; only a rover can hold this role"},
    {"ZeroTimeout", GoodAnd("roles: {leader_timeout_s: 0}"),
     "t:8:27: roles.leader_timeout_s: expected 1 to 86400, got 0"},
    {"Failover", GoodAnd("roles: {failover: automatik}"),
     "t:8:19: roles.failover: expected manual or automatic, got \"automatik\"; did you mean \"automatic\"?"},
    {"Budget", GoodAnd("radio: {budget_kbps: -1}"), "t:8:22: radio.budget_kbps: expected 1 to 1000000, got -1"},
    {"StatesPeriod", GoodAnd("radio: {states_period_s: 0.5}"),
     "t:8:26: radio.states_period_s: expected 0, for never, or 1 to 86400, got 0.5"},
    {"Retention", GoodAnd("retention: {keep_days: -1, keep_event_days: 40000, store_mb_max: 0.5, map_part_max: 1.5}"),
     "t:8:24: retention.keep_days: expected 0 to 36500, got -1\n"
     "t:8:45: retention.keep_event_days: expected 0 to 36500, got 40000\n"
     "t:8:66: retention.store_mb_max: expected 0, for no budget, or 1 to 1000000000, got 0.5\n"
     "t:8:85: retention.map_part_max: expected 0 to 1, got 1.5"},
    {"RetentionDisk", GoodAnd("retention: {disk_free_mb_min: .nan}"),
     "t:8:31: retention.disk_free_mb_min: expected a finite number, got \".nan\""},
    {"QuarantinePolicy", GoodAnd("share: {map_quarantine: latest}"),
     "t:8:25: share.map_quarantine: expected none or all, got \"latest\""},
    {"RolesPolicy", GoodAnd("share: {role_assignment: none}"),
     "t:8:26: share.role_assignment: expected all: every agent needs all role assignments to decide which records it "
     "accepts"},
    {"CommandFromNobody", GoodAnd("command_from: []"), "t:8:15: command_from: expected names of agents, or all"},
    {"CommandFromStranger", GoodAnd("command_from: [base, rover11]"),
     "t:8:22: command_from[1]: no agent is named \"rover11\"; did you mean \"rover1\"?"},
    {"CommandFromWord", GoodAnd("command_from: alll"),
     "t:8:15: command_from: no agent is named \"alll\"; did you mean \"all\"?"},
    {"CommandFromAllAndOne", GoodAnd("command_from: [all, base]"),
     "t:8:16: command_from[0]: all must be the only entry, because it names every agent"},
    {"LeftAndLeader", Replaced(GoodAnd("roles: {leader: rover2}"), "name: rover2", "name: rover2, left: true"),
     "t:8:17: roles.leader: rover2 has left the team; name another rover"},
    {"LeftAndSurvivor", Replaced(GoodAnd("roles: {survivor: rover2}"), "name: rover2", "name: rover2, left: true"),
     "t:8:19: roles.survivor: rover2 has left the team; name another rover"},
    {"LeftAndCommands", Replaced(GoodAnd("command_from: [base, rover2]"), "name: rover2", "name: rover2, left: true"),
     "t:8:22: command_from[1]: rover2 has left the team; remove it from this list"},
    {"AllRoversLeft",
     Replaced(Good("name: rover1", "name: rover1, left: true"), "name: rover2", "name: rover2, left: true"),
     "t:4:3: agents: expected at least one rover that has not left"},
    {"BaseThatCommandsLeft", Good("name: base", "name: base, left: true"),
     "t:1:1: command_from: missing: the base station, which commands by default, has left; name the agents that may "
     "command, or all"},
    {"CommandFromTwice", GoodAnd("command_from: [base, base]"), "t:8:22: command_from[1]: base is named twice"},
    {"Codec", GoodAnd("radio: {codec: gzip}"),
     "t:8:16: radio.codec: expected plain, zstd, compact or paper_sql, got \"gzip\""},
    {"NotBool", GoodAnd("radio: {quiet_while_driving: yes}"),
     "t:8:30: radio.quiet_while_driving: expected true or false, got \"yes\""},
    {"Policy", GoodAnd("share: {health: lastest}"),
     "t:8:17: share.health: expected none, latest or all, got \"lastest\"; did you mean \"latest\"?"},
    {"UnspecifiedPolicy", GoodAnd("share: {health: unspecified}"),
     "t:8:17: share.health: expected none, latest or all, got \"unspecified\""},
    {"Footprint", GoodAnd("map: {footprint_m: [0.75]}"),
     "t:8:20: map.footprint_m: expected 2 numbers (length and width), got 1"},
    {"NoList", GoodAnd("map: {footprint_m: 0.75}"), "t:8:20: map.footprint_m: expected a list, got \"0.75\""},
    {"NoValue", GoodAnd("map: {footprint_m: }"), "t:8:7: map.footprint_m: expected a list, got nothing"},
    {"NoMessage", GoodAnd("map: 5"), "t:8:6: map: expected fields such as \"resolution_m: ...\", got \"5\""},
    {"Latitude", GoodAnd("site: {lat_deg: 91}"), "t:8:17: site.lat_deg: expected -90 to 90, got 91"},
    {"SigningKeyInATeamWithoutKeys",
     Good("name: rover2,", "name: rover2, signing_key: \"eBQVrmV@gcGAmNE7f?TwAVN(=Iy!Obr?$HC.M#d>\","),
     "t:5:40: agents[1].signing_key: needs keys, but the team is `insecure: true`"},
    {"Missing", "insecure: true\n",
     "t:1:1: team: missing\n"
     "t:1:1: team_id: missing: `moonctl config check --fix` gives the file one\n"
     "t:1:1: agents: missing"},
    {"NoTeamId", Good("team_id: \"00112233445566778899aabbccddeeff\"\n", ""),
     "t:1:1: team_id: missing: `moonctl config check --fix` gives the file one"},
    {"ShortTeamId", Good("ccddeeff", "ccddeef"),
     "t:7:10: team_id: expected 32 digits of 0 to 9 and a to f, got \"00112233445566778899aabbccddeef\""},
    {"LargeTeamId", Good("ccddeeff", "CCDDEEFF"),
     "t:7:10: team_id: expected 32 digits of 0 to 9 and a to f, got \"00112233445566778899aabbCCDDEEFF\""},
    {"CustomIdOutOfRange", GoodAnd("custom_types: [{id: 999, name: soil}]"),
     "t:8:21: custom_types[0].id: expected 1000 to 1999, got 999"},
    {"CustomWithoutNames", GoodAnd("custom_types: [{}]"),
     "t:8:16: custom_types[0].id: missing\nt:8:16: custom_types[0].name: missing"},
    {"CustomMisspelt", GoodAnd("custom_types: [{id: 1000, nmae: soil}]"),
     "t:8:27: custom_types[0].nmae: no such field; did you mean \"name\"?"},
    {"CustomPolicy", GoodAnd("custom_types: [{id: 1000, name: soil, share: lastest}]"),
     "t:8:46: custom_types[0].share: expected none, latest or all, got \"lastest\"; did you mean \"latest\"?"},
    {"CustomBadName", GoodAnd("custom_types: [{id: 1000, name: 3-soil}]"),
     "t:8:33: custom_types[0].name: expected a lower-case letter, then at most 31 lower-case letters, digits and _, "
     "got "
     "\"3-soil\""},
    {"CustomBuiltInName", GoodAnd("custom_types: [{id: 1000, name: temperature}, {id: 1001, name: type_1000}]"),
     "t:8:33: custom_types[0].name: temperature is a name of moondb's own\n"
     "t:8:64: custom_types[1].name: type_1000 is a name of moondb's own"},
    {"CustomDoubled", GoodAnd("custom_types: [{id: 1000, name: soil}, {id: 1000, name: soil}]"),
     "t:8:45: custom_types[1].id: 1000 is already that of custom_types[0]\n"
     "t:8:57: custom_types[1].name: soil is already that of custom_types[0]"},
    {"CustomBounds", GoodAnd("custom_types: [{id: 1000, name: soil, priority: 0, bytes_max: 8388609}]"),
     "t:8:49: custom_types[0].priority: expected 1 to 9, got 0\n"
     "t:8:63: custom_types[0].bytes_max: expected 1 to 8388608, got 8388609"},
    {"Keep", GoodAnd("keep: {temperature: lates, power: 7, mode: 0d, health: forever}"),
     "t:8:21: keep.temperature: expected all, latest or a duration such as 7d or 12h, got \"lates\"; did you mean "
     "\"latest\"?\n"
     "t:8:35: keep.power: expected all, latest or a duration such as 7d or 12h, got \"7\"\n"
     "t:8:44: keep.mode: expected all, latest or a duration such as 7d or 12h, got \"0d\"\n"
     "t:8:56: keep.health: expected all, latest or a duration such as 7d or 12h, got \"forever\""},
    {"KeepOfWhatIsNotSuperseded", GoodAnd("share: {power: all}\nkeep: {power: 7d, mode: 7d}"),
     "t:9:15: keep.power: records of this type are never superseded, since share.power is all: expected all, got "
     "\"7d\" "
     "(retention.keep_days removes old records)"},
    {"KeepOfAnotherType", GoodAnd("keep: {temprature: all}"),
     "t:8:8: keep.temprature: no such field; did you mean \"temperature\"?"},
    {"CustomKeep",
     GoodAnd("custom_types: [{id: 1000, name: soil, keep: 7d}, {id: 1001, name: core, share: latest, keep: 7w}]"),
     "t:8:45: custom_types[0].keep: records of this type are never superseded, since custom_types[0].share is all: "
     "expected all, got \"7d\" (retention.keep_days removes old records)\n"
     "t:8:94: custom_types[1].keep: expected all, latest or a duration such as 7d or 12h, got \"7w\""},
    {"HistoryLimit", GoodAnd("retention: {history_mb_max: -1}"),
     "t:8:29: retention.history_mb_max: expected 0 to 1000000, got -1"},
    {"AliasLoop", GoodAnd("map: &m {footprint_m: [*m, *m]}"),
     "t:8:6: map.footprint_m[0]: expected a number, got fields\n"
     "t:8:6: map.footprint_m[1]: expected a number, got fields"},
};

class TeamConfigBadFileTest : public ::testing::TestWithParam<BadFile> {};

TEST_P(TeamConfigBadFileTest, IsReportedWithPlaceAndField) {
  const Result<TeamFile> team = ParseTeamFile(GetParam().yaml, "t");
  ASSERT_FALSE(team);
  EXPECT_EQ(team.error().code, ErrorCode::kInvalid);
  EXPECT_EQ(team.error().text, GetParam().error);
}

INSTANTIATE_TEST_SUITE_P(All, TeamConfigBadFileTest, ::testing::ValuesIn(kBadFiles),
                         [](const auto& file) { return std::string(file.param.name); });

TEST(TeamConfigTest, ReportsAllErrorsInTheOrderOfTheirPlaces) {
  std::string yaml = Replaced(kGood, "id: 2", "id: two");
  yaml = Replaced(yaml, "team: test", "taem: test");
  yaml += "share: {power: all, power: none}\n";
  EXPECT_EQ(ParseTeamFile(yaml, "t").error().text,
            "t:1:1: taem: no such field; did you mean \"team\"?\n"
            "t:5:10: agents[1].id: expected an integer, got \"two\"\n"
            "t:8:21: share.power: given twice, first in line 8");
}

TEST(TeamConfigTest, BoundsAgentsAndErrors) {
  std::string many = "team: t\nagents:\n";
  for (int i = 0; i < 200; ++i) many += "  - {id: x}\n";
  const std::string text = ParseTeamFile(many, "t").error().text;
  EXPECT_THAT(text, HasSubstr("t:3:3: agents: at most 64 are allowed, got 200\n"));
  EXPECT_THAT(text, HasSubstr("\nt: and 702 more errors"));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 100);
}

TEST(TeamConfigTest, FillsInDefaults) {
  const Result<TeamFile> team = ParseTeamFile(kGood, "t");
  ASSERT_TRUE(team) << team.error().text;
  const proto::TeamConfig& config = team->config;
  EXPECT_EQ(config.roles().leader(), "rover1");
  EXPECT_EQ(config.roles().survivor(), "rover2");
  EXPECT_EQ(config.roles().leader_timeout_s(), 120);
  EXPECT_EQ(config.radio().budget_kbps(), 1000);
  EXPECT_TRUE(config.radio().quiet_while_driving());
  EXPECT_EQ(config.retention().map_part_max(), 0.7);
  EXPECT_EQ(config.retention().disk_free_mb_min(), 512);
  EXPECT_EQ(config.retention().store_mb_max(), 0);
  EXPECT_FALSE(config.retention().drop_occluded_maps());
  EXPECT_EQ(config.retention().history_mb_max(), 64);
  EXPECT_EQ(config.keep().at("temperature"), "all");
  EXPECT_EQ(config.keep().at("optimized_pose"), "latest");
  EXPECT_EQ(config.keep().at("edge_verdict"), "latest");
  EXPECT_TRUE(KeepRuleOf(config, proto::TEMPERATURE).IsOfAnyAge());
  EXPECT_FALSE(KeepRuleOf(config, proto::OPTIMIZED_POSE).KeepsAny());
  EXPECT_TRUE(KeepRuleOf(config, proto::POSE_GRAPH_NODE).IsOfAnyAge());
  EXPECT_EQ(config.radio().codec(), proto::CODEC_COMPACT);
  EXPECT_EQ(config.map().resolution_m(), 0.05);
  EXPECT_THAT(config.map().footprint_m(), ::testing::ElementsAre(0.75, 0.5));
  EXPECT_THAT(config.agents(0).antenna_m(), ::testing::ElementsAre(0, 0, 0));
  EXPECT_EQ(SharePolicyOf(config, proto::TEMPERATURE), proto::POLICY_LATEST);
  EXPECT_EQ(SharePolicyOf(config, proto::POSE_GRAPH_EDGE), proto::POLICY_ALL);
  EXPECT_EQ(SharePolicyOf(config, proto::EDGE_VERDICT), proto::POLICY_LATEST);
  EXPECT_EQ(SharePolicyOf(config, proto::LOCAL_TRAVERSABILITY_MAP), proto::POLICY_ALL);
  EXPECT_EQ(GroundPolicyOf(config, proto::POSE_GRAPH_NODE), proto::POLICY_ALL);
  EXPECT_EQ(GroundPolicyOf(config, proto::OPTIMIZED_POSE), proto::POLICY_LATEST);
  EXPECT_EQ(GroundPolicyOf(config, proto::POSE_GRAPH_EDGE), proto::POLICY_NONE);
  EXPECT_EQ(SharePolicyOf(config, 1007), proto::POLICY_NONE);
  EXPECT_EQ(SharePolicyOf(config, 0xFFFF'FFFF), proto::POLICY_NONE);
}

TEST(TeamConfigTest, RoversGetOthersRecordsByAPolicyOfTheirOwn) {
  const Result<TeamFile> team =
      ParseTeamFile(GoodAnd("rovers: {pose_graph_node: all, power: none}\n"
                            "custom_types: [{id: 1000, name: soil, rovers: latest}, {id: 1001, name: core}]"),
                    "t");
  ASSERT_TRUE(team) << team.error().text;
  EXPECT_EQ(RoversPolicyOf(team->config, proto::POSE_GRAPH_NODE), proto::POLICY_ALL);
  EXPECT_EQ(RoversPolicyOf(team->config, proto::POWER), proto::POLICY_NONE);
  EXPECT_EQ(RoversPolicyOf(team->config, proto::LOCAL_TRAVERSABILITY_MAP), proto::POLICY_NONE) << "by default";
  EXPECT_EQ(RoversPolicyOf(team->config, 1000), proto::POLICY_LATEST);
  EXPECT_EQ(RoversPolicyOf(team->config, 1001), proto::POLICY_NONE);
}

TEST(TeamConfigTest, PoliciesForRoversChangeTheHashOnlyIfTheyAskForSomething) {
  const auto hash = [](const std::string& line) { return ParseTeamFile(GoodAnd(line), "t")->hash; };
  EXPECT_EQ(hash("rovers: {power: none}"), hash(""));
  EXPECT_NE(hash("rovers: {power: latest}"), hash(""));
}

TEST(TeamConfigTest, RefusesPoliciesForRoversThatCannotBeKept) {
  const auto refused = [](const std::string& line) { return ParseTeamFile(GoodAnd(line), "t").error().text; };
  EXPECT_THAT(refused("rovers: {maps: all}"), HasSubstr("rovers"));
  EXPECT_THAT(refused("rovers: {role_assignment: all}"), HasSubstr("sends this type to all rovers anyway"));
  EXPECT_THAT(refused("rovers: {map_quarantine: all}"), HasSubstr("sends this type to all rovers anyway"));
  EXPECT_THAT(refused("rovers: {agent_event: all}"), HasSubstr("rovers.agent_event: events are not sent to rovers"));
  EXPECT_THAT(refused("rovers: {power: all}"),
              HasSubstr("rovers.power: expected none or latest, because share.power is latest"));
  EXPECT_THAT(refused("share: {optimized_pose: none}\nrovers: {optimized_pose: latest}"),
              HasSubstr("rovers.optimized_pose: expected none, because share.optimized_pose is none"));
  EXPECT_THAT(refused("custom_types: [{id: 1000, name: soil, share: latest, rovers: all}]"),
              HasSubstr("custom_types[0].rovers: expected none or latest, because custom_types[0].share is latest"));
}

TEST(TeamConfigTest, ReadsHowLongRobotsKeepSupersededStates) {
  const Result<TeamFile> team = ParseTeamFile(
      GoodAnd(
          "keep: {temperature: 36h, power: latest}\n"
          "share: {optimized_pose: all}\n"
          "retention: {history_mb_max: 0}\n"
          "custom_types: [{id: 1000, name: soil, share: latest, keep: 90m}, {id: 1001, name: core, share: latest}]"),
      "t");
  ASSERT_TRUE(team) << team.error().text;
  const proto::TeamConfig& config = team->config;
  EXPECT_EQ(KeepRuleOf(config, proto::TEMPERATURE).at_most, std::chrono::hours(36));
  EXPECT_FALSE(KeepRuleOf(config, proto::POWER).KeepsAny());
  EXPECT_TRUE(KeepRuleOf(config, proto::MODE).IsOfAnyAge());
  EXPECT_EQ(config.keep().at("optimized_pose"), "all") << "records of this type are never superseded";
  EXPECT_EQ(KeepRuleOf(config, 1000).at_most, std::chrono::minutes(90));
  EXPECT_TRUE(KeepRuleOf(config, 1001).IsOfAnyAge());
  EXPECT_EQ(config.retention().history_mb_max(), 0);
}

TEST(TeamConfigTest, DeclaresCustomTypes) {
  const Result<TeamFile> team = ParseTeamFile(
      GoodAnd("custom_types: [{id: 1999, name: core, ground: latest, share: none, priority: 1, bytes_max: 8388608}, "
              "{id: 1000, name: soil_moisture}]"),
      "t");
  ASSERT_TRUE(team) << team.error().text;
  const proto::CustomType& soil = team->config.custom_types(0);
  EXPECT_EQ(soil.id(), 1000u) << "sorted by id";
  EXPECT_EQ(soil.priority(), 5u);
  EXPECT_EQ(soil.bytes_max(), 4096u);
  EXPECT_EQ(SharePolicyOf(team->config, 1000), proto::POLICY_ALL);
  EXPECT_EQ(GroundPolicyOf(team->config, 1000), proto::POLICY_NONE);
  EXPECT_EQ(SharePolicyOf(team->config, 1999), proto::POLICY_NONE);
  EXPECT_EQ(GroundPolicyOf(team->config, 1999), proto::POLICY_LATEST);
  EXPECT_EQ(SharePolicyOf(team->config, 1001), proto::POLICY_NONE);
  EXPECT_EQ(DataTypesOf(team->config).size(), BuiltInDataTypes().size() + 2);
  EXPECT_EQ(DataTypesOf(team->config).back(), 1999u);
}

TEST(TeamConfigTest, BoundsTheNumberOfCustomTypes) {
  std::string yaml = std::string(kGood) + "custom_types:\n";
  for (int i = 0; i < 65; ++i) {
    yaml += "  - {id: " + std::to_string(1000 + i) + ", name: t" + std::to_string(i) + "}\n";
  }
  EXPECT_EQ(ParseTeamFile(yaml, "t").error().text, "t:9:3: custom_types: at most 64 are allowed, got 65");
}

TEST(TeamConfigTest, RequiresNeitherBaseStationNorSurvivor) {
  const Result<TeamFile> team = ParseTeamFile(
      "team: t\nteam_id: \"00112233445566778899aabbccddeeff\"\ninsecure: true\n"
      "agents: [{id: 7, name: a, address: \"ipc:///tmp/a\"}]\n",
      "t");
  ASSERT_TRUE(team) << team.error().text;
  EXPECT_EQ(BaseStationOf(team->config), 0u);
  EXPECT_EQ(InitialRoles(team->config).leader(), 7u);
  EXPECT_EQ(InitialRoles(team->config).survivor(), 0u);
  EXPECT_TRUE(CheckRoles(team->config, InitialRoles(team->config)));
}

TEST(TeamConfigTest, HashesTheMeaningNotTheText) {
  const auto hash = [](const std::string& yaml) { return ParseTeamFile(yaml, "t").value().hash; };
  EXPECT_EQ(hash(kGood), hash("# Another comment.\n" + GoodAnd("roles: {survivor: rover2}")));
  EXPECT_NE(hash(kGood), hash(GoodAnd("radio: {budget_kbps: 999}")));
  const std::string soil = "{id: 1000, name: soil}", core = "{id: 1001, name: core}";
  EXPECT_EQ(hash(GoodAnd("custom_types: [" + soil + ", " + core + "]")),
            hash(GoodAnd("custom_types: [" + core + ", " + soil + "]")));
  EXPECT_NE(hash(GoodAnd("custom_types: [" + soil + "]")), hash(kGood));
  EXPECT_EQ(hash(GoodAnd("keep: {power: 7d, mode: all}")), hash(GoodAnd("keep: {power: 168h}")));
  EXPECT_NE(hash(GoodAnd("keep: {power: 7d}")), hash(kGood));
}

// The Python client reads the same files (tests/python/moondb/team_file_test.py).
TEST(TeamConfigTest, AcceptsAndRefusesTheFilesOfTheTable) {
  std::size_t count = 0;
  for (const char* const folder : {"accepted", "refused"}) {
    for (const auto& file :
         std::filesystem::directory_iterator(std::filesystem::path(MOONDB_SOURCE_DIR) / "tests/team_files" / folder)) {
      const Result<TeamFile> team = ReadTeamFile(file.path());
      EXPECT_EQ(team.has_value(), folder == std::string("accepted"))
          << file.path() << (team ? "" : ": " + team.error().text);
      ++count;
    }
  }
  EXPECT_GT(count, 50u);
}

// A team whose agents are upgraded one after the other must not look as if its team files differed. The hash is that of
// a build before `at_risk`.
TEST(TeamConfigTest, AddedKeysChangeTheHashOnlyIfTheyAreNotAtTheirDefaults) {
  const auto hash = [](const std::string& yaml) { return ParseTeamFile(yaml, "t").value().hash; };
  EXPECT_EQ(hash(kGood), 0xe465c6f46e2e3940);
  EXPECT_EQ(hash(GoodAnd("at_risk: {records: 10000}")), hash(kGood));
  EXPECT_NE(hash(GoodAnd("at_risk: {records: 9999}")), hash(kGood));
  EXPECT_NE(hash(GoodAnd("at_risk: {records: 0}")), hash(kGood));
}

TEST(TeamConfigTest, RefusesInvalidRoles) {
  const proto::TeamConfig team = ParseTeamFile(kGood, "t").value().config;
  const auto why = [&](AgentId leader, AgentId survivor) {
    proto::RoleAssignment roles;
    roles.set_leader(leader);
    roles.set_survivor(survivor);
    const Result<void> result = CheckRoles(team, roles);
    return result ? std::string() : ToString(result.error());
  };
  EXPECT_EQ(why(1, 2), "");
  EXPECT_EQ(why(2, 0), "");
  EXPECT_EQ(why(0, 2), "leader: the team needs a leader");
  EXPECT_EQ(why(9, 2), "leader: no agent has the id 9");
  EXPECT_EQ(why(3, 2), "leader: base is a base station; only a rover can hold this role");
  EXPECT_EQ(why(1, 1), "survivor: rover1 cannot be leader and designated survivor at once");
  EXPECT_EQ(why(1, 3), "survivor: base is a base station; only a rover can hold this role");
}

TEST(TeamConfigTest, NamesTheRoleOfEachAgent) {
  const proto::TeamConfig team = ParseTeamFile(GoodAnd("roles: {leader: rover2}"), "t").value().config;
  const proto::RoleAssignment roles = InitialRoles(team);
  EXPECT_EQ(RoleOf(team, roles, 1), proto::ROLE_DESIGNATED_SURVIVOR);
  EXPECT_EQ(RoleOf(team, roles, 2), proto::ROLE_LEADER);
  EXPECT_EQ(RoleOf(team, roles, 3), proto::ROLE_BASE_STATION);
  EXPECT_EQ(RoleOf(team, roles, 4), proto::ROLE_UNSPECIFIED);
}

TEST(TeamConfigTest, KeepsAgentsThatHaveLeftWithoutAnyRole) {
  const proto::TeamConfig team = ParseTeamFile(Good("name: rover1", "name: rover1, left: true"), "t").value().config;
  EXPECT_TRUE(HasLeft(team, 1));
  EXPECT_FALSE(HasLeft(team, 2));
  EXPECT_FALSE(HasLeft(team, 9)) << "never was there";
  const proto::RoleAssignment roles = InitialRoles(team);
  EXPECT_EQ(roles.leader(), 2u) << "the first rover that stays";
  EXPECT_EQ(roles.survivor(), 0u);
  EXPECT_EQ(RoleOf(team, roles, 1), proto::ROLE_UNSPECIFIED);
  proto::RoleAssignment earlier;
  earlier.set_leader(1);
  EXPECT_TRUE(CheckRoles(team, earlier)) << "what was stays history";
}

TEST(TeamConfigTest, AcceptsNoCommandsThroughAnAgentThatHasLeft) {
  const std::string everybody = GoodAnd("command_from: all");
  const proto::TeamConfig team =
      ParseTeamFile(Replaced(everybody, "name: rover1", "name: rover1, left: true"), "t").value().config;
  EXPECT_FALSE(MayCommand(team, 1));
  EXPECT_TRUE(MayCommand(team, 2));
}

TEST(TeamConfigTest, MayHaveAnotherBaseStationIfOneHasLeft) {
  const std::string base =
      "  - {id: 3, name: base, address: \"tcp://127.0.0.1:7402\", kind: base_station, position_m: [1, 2, 3]";
  const std::string second =
      "  - {id: 4, name: base2, address: \"tcp://127.0.0.1:7403\", kind: base_station, position_m: [1, 2, 3]}\n";
  const auto team = ParseTeamFile(Good(base + "}\n", base + ", left: true}\n" + second), "t");
  ASSERT_TRUE(team) << team.error().text;
  EXPECT_EQ(BaseStationOf(team->config), 4u);
  EXPECT_TRUE(MayCommand(team->config, 4));
  EXPECT_FALSE(MayCommand(team->config, 3));
  EXPECT_FALSE(ParseTeamFile(Good(base + "}\n", base + "}\n" + second), "t")) << "two that both stay";
}

class TeamFileTest : public ::testing::Test {
 protected:
  static mode_t ModeOf(const std::filesystem::path& path) {
    struct stat status {};
    EXPECT_EQ(stat(path.c_str(), &status), 0) << path;
    return status.st_mode & 0777;
  }

  static void Write(const std::filesystem::path& path, const std::string& text) { std::ofstream(path) << text; }

  static std::string Text(const std::filesystem::path& path) {
    std::ostringstream text;
    text << std::ifstream(path).rdbuf();
    return text.str();
  }

  const TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
};

TEST_F(TeamFileTest, InitialTeamIsReadBack) {
  const std::filesystem::path path = folder_ / "new" / "team.yaml";
  const Result<void> written = WriteInitialTeam(path, 4, 7400);
  ASSERT_TRUE(written) << ToString(written.error());
  const Result<TeamFile> team = ReadTeamFile(path);
  ASSERT_TRUE(team) << team.error().text;
  ASSERT_EQ(team->config.agents_size(), 4);
  EXPECT_EQ(team->config.agents(1).name(), "rover2");
  EXPECT_EQ(team->config.agents(1).address(), "tcp://127.0.0.1:7401");
  EXPECT_EQ(BaseStationOf(team->config), 4u);
  EXPECT_EQ(team->folder, folder_ / "new");
  for (const proto::AgentConfig& agent : team->config.agents()) {
    const std::filesystem::path public_path = team->folder / agent.key();
    EXPECT_EQ(ModeOf(public_path), 0644u);
    EXPECT_EQ(ModeOf(SecretKeyPath(public_path)), 0600u);
    EXPECT_EQ(ModeOf(SigningSecretPath(SecretKeyPath(public_path))), 0600u);
    EXPECT_EQ(SigningKey::Read(SigningSecretPath(SecretKeyPath(public_path))).value().public_key(),
              agent.signing_key());
    EXPECT_EQ(PublicKeyOf(ReadSecretKey(SecretKeyPath(public_path)).value()).value(),
              ReadPublicKey(public_path).value());
  }
  // The folder holds the team file, twelve key files and no other file.
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(team->folder), {}), 13);
}

TEST_F(TeamFileTest, AWrittenTeamKeepsItsFields) {
  proto::TeamConfig config = ParseTeamFile(GoodAnd("roles: {failover: automatic}\n"
                                                   "share: {power: none}\n"
                                                   "keep: {temperature: 7d, mode: latest}\n"
                                                   "radio: {quiet_while_driving: false}\n"
                                                   "site: {lat_deg: 7.4, lon_deg: -59.123456789, north_yaw_rad: 0.1}\n"
                                                   "map: {resolution_m: 0.0125}"),
                                           "t")
                                 .value()
                                 .config;
  config.mutable_agents(0)->mutable_start()->set_yaw(1.0 / 3.0);
  config.add_custom_types()->set_id(1000);
  config.mutable_custom_types(0)->set_name("soil");
  config.mutable_agents(0)->mutable_start()->set_sigma_m(0.2);
  config.mutable_roles()->set_leader("rover1");
  config.mutable_roles()->clear_survivor();
  config.mutable_agents(1)->set_left(true);
  ASSERT_TRUE(WriteTeam(folder_ / "team.yaml", config));
  const Result<TeamFile> team = ReadTeamFile(folder_ / "team.yaml");
  ASSERT_TRUE(team) << team.error().text;
  config.mutable_agents(0)->mutable_start()->set_sigma_rad(0.01);  // Default of sigma_rad, which the file omits.
  config.mutable_custom_types(0)->set_share(proto::POLICY_ALL);    // Default of `share`, which the file omits.
  config.mutable_custom_types(0)->set_ground(proto::POLICY_NONE);
  config.mutable_custom_types(0)->set_rovers(proto::POLICY_NONE);
  config.mutable_custom_types(0)->set_priority(5);
  config.mutable_custom_types(0)->set_bytes_max(4096);
  config.mutable_custom_types(0)->set_keep("all");
  EXPECT_EQ(team->config.DebugString(), config.DebugString());
}

TEST_F(TeamFileTest, GivesEachTeamAnIdOfItsOwn) {
  ASSERT_TRUE(WriteInitialTeam(folder_ / "a" / "team.yaml", 2, 7400));
  ASSERT_TRUE(WriteInitialTeam(folder_ / "b" / "team.yaml", 2, 7400, "a"));
  const proto::TeamConfig a = ReadTeamFile(folder_ / "a" / "team.yaml").value().config;
  const proto::TeamConfig b = ReadTeamFile(folder_ / "b" / "team.yaml").value().config;
  EXPECT_EQ(a.team(), "a") << "as its folder is called";
  EXPECT_EQ(b.team(), "a");
  EXPECT_TRUE(IsTeamId(a.team_id())) << a.team_id();
  EXPECT_NE(a.team_id(), b.team_id());
}

TEST(TeamNameTest, KeepsTheAllowedCharactersOfAText) {
  EXPECT_EQ(PlainNameOf("my-team_2"), "my-team_2");
  EXPECT_EQ(PlainNameOf("My Team"), "my-team");
  EXPECT_EQ(PlainNameOf("M\u00f6nd / \x1b[2J"), "m-nd-2j");
  EXPECT_EQ(PlainNameOf("  "), "team");
  EXPECT_EQ(PlainNameOf(""), "team");
  EXPECT_EQ(PlainNameOf(std::string(31, 'a') + " b"), std::string(31, 'a'));
}

TEST(TeamIdLineTest, IsAddedAndTheRestIsKept) {
  const std::string id = "0123456789abcdef0123456789abcdef";
  const std::string line = "team_id: \"" + id + "\"   # Unique id of the team; never change it.";
  const std::string without = Good("team_id: \"00112233445566778899aabbccddeeff\"\n", "");
  EXPECT_EQ(WithTeamId(without, id).value(), Replaced(without, "team: test\n", "team: test\n" + line + "\n"));
  const std::string windows = "# A comment.\r\n  team: test   # Ours.\r\n  insecure: true\r\n";
  EXPECT_EQ(WithTeamId(windows, id).value(),
            "# A comment.\r\n  team: test   # Ours.\r\n  " + line + "\r\n  insecure: true\r\n");
  EXPECT_EQ(WithTeamId("insecure: true\nteam: test", id).value(), "insecure: true\nteam: test\n" + line + "\n");
  EXPECT_THAT(WithTeamId("{team: test, insecure: true}\n", id).error().text,
              HasSubstr("add  team_id: \"" + id + "\"  by hand"));
  EXPECT_FALSE(WithTeamId("team: [\n", id));
  EXPECT_FALSE(WithTeamId("insecure: true\n", id));
}

TEST(SigningKeyLinesTest, AreAddedToEachAgentAndTheRestIsKept) {
  const std::string a = SigningKey::FromSeed({1}).public_key();
  const std::string b = SigningKey::FromSeed({2}).public_key();
  const std::string yaml =
      "team: test   # Ours.\n"
      "agents:\n"
      "  # The first.\n"
      "  - id: 1\n"
      "    name: one\n"
      "    key: \"one.pub\"   # Made by hand.\n"
      "    antenna_m: [0, 0, 1]\n"
      "  - {id: 2, name: two, key: two.pub, left: true}   # In braces.\n"
      "  - key: three.pub\n"
      "    id: 3\n"
      "    name: three\n";
  const auto fixed = WithSigningKeys(yaml, {{"one", a}, {"two", b}});
  ASSERT_TRUE(fixed) << fixed.error().text;
  std::string expected = Replaced(yaml, "# Made by hand.\n", "# Made by hand.\n    signing_key: \"" + a + "\"\n");
  expected = Replaced(expected, "key: two.pub", "signing_key: \"" + b + "\", key: two.pub");
  EXPECT_EQ(*fixed, expected);
  const auto third = WithSigningKeys(yaml, {{"three", a}});
  ASSERT_TRUE(third) << third.error().text;
  EXPECT_EQ(*third, Replaced(yaml, "three.pub\n", "three.pub\n    signing_key: \"" + a + "\"\n"));
}

TEST(SigningKeyLinesTest, AreAddedForAgentsWhoseKeyIsFound) {
  const std::string key = SigningKey::FromSeed({1}).public_key();
  EXPECT_THAT(WithSigningKeys("team: test\nagents: [{id: 1, name: one}]\n", {{"one", key}}).error().text,
              HasSubstr("cannot insert the signing_key of \"one\""));
  EXPECT_FALSE(WithSigningKeys("team: [\n", {{"one", key}}));
  const std::string windows = "agents:\r\n- name: one\r\n  key: one.pub";
  EXPECT_EQ(WithSigningKeys(windows, {{"one", key}}).value(), windows + "\n  signing_key: \"" + key + "\"\n");
}

TEST_F(TeamFileTest, AddsAnAgentBelowTheLastOneAndKeepsTheRest) {
  ASSERT_TRUE(WriteInitialTeam(folder_ / "team.yaml", 3, 7400));
  const std::string yaml = *ReadTextFile(folder_ / "team.yaml");
  proto::AgentConfig agent;
  agent.set_name("rover9");
  agent.set_address("tcp://10.0.0.9:7400");
  NewFiles files;
  const auto longer = AddAgent(yaml, folder_ / "team.yaml", agent, &files);
  ASSERT_TRUE(longer) << longer.error().text;
  EXPECT_EQ(agent.id(), 4u);
  const std::string added =
      "  - id: 4\n    name: rover9\n    address: \"tcp://10.0.0.9:7400\"\n    key: \"rover9.pub\"\n" +
      ("    signing_key: \"" + agent.signing_key() + "\"\n");
  EXPECT_EQ(*longer, Replaced(yaml, "\n# Initial leader", added + "\n# Initial leader"));
  ASSERT_TRUE(files.Publish());
  const auto team = ParseTeamFile(*longer, "team.yaml");
  ASSERT_TRUE(team) << team.error().text;
  EXPECT_TRUE(ReadTeamKeys(team->config, folder_, 4, ""));
  EXPECT_TRUE(ReadSigningKey(team->config, folder_, 4, ""));
}

TEST_F(TeamFileTest, AddsAnAgentToFilesWrittenByHand) {
  const std::string head = "team: test\nteam_id: \"00000000000000000000000000000001\"\ninsecure: true\n";
  const std::string one = "{id: 7, name: one, address: \"tcp://h:1\"}";
  const std::string two = "id: 8\n  name: two\n  address: \"tcp://h:2\"\n";
  const auto add = [&](const std::string& yaml) {
    proto::AgentConfig agent;
    agent.set_name("two");
    agent.set_address("tcp://h:2");
    NewFiles files;
    return AddAgent(yaml, folder_ / "team.yaml", agent, &files);
  };
  const std::string braces = head + "agents:\n- " + one + "   # In braces.\nroles: {leader: one}\n";
  const auto in_braces = add(braces);
  ASSERT_TRUE(in_braces) << in_braces.error().text;
  EXPECT_EQ(*in_braces, Replaced(braces, "roles:", "- " + two + "roles:"));
  const std::string without_end = head + "roles: {leader: one}\nagents:\n- " + one;
  EXPECT_EQ(add(without_end).value(), without_end + "\n- " + two);
  EXPECT_THAT(add(head + "roles: {leader: one}\nagents: [" + one + "]\n").error().text, HasSubstr("add it by hand"));
  EXPECT_THAT(add(head + "agents:\n- {id: 7, name: two, address: \"tcp://h:1\"}\n").error().text,
              HasSubstr("two is already that of agents[0]"));
  EXPECT_FALSE(add("team: [\n"));
}

TEST_F(TeamFileTest, OverwritesNothing) {
  Write(folder_ / "rover2.sec", "precious");
  const Result<void> written = WriteInitialTeam(folder_ / "team.yaml", 3, 7400);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kRefused);
  EXPECT_EQ(written.error().text, (folder_ / "rover2.sec").string() + ": exists already and is left as it is");
  EXPECT_EQ(Text(folder_ / "rover2.sec"), "precious");
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 1);
}

TEST_F(TeamFileTest, KeepsAddressesForClientsAndReportsThoseInUse) {
  proto::TeamConfig config = ParseTeamFile(kGood, "t").value().config;
  config.set_insecure(false);
  config.mutable_agents(0)->set_client_address("tcp://10.0.0.1:7500");
  config.mutable_agents(1)->set_client_address("tcp://10.0.0.2:7500");
  ASSERT_TRUE(WriteTeam(folder_ / "team.yaml", config));
  EXPECT_EQ(ReadTeamFile(folder_ / "team.yaml")->config.agents(1).client_address(), "tcp://10.0.0.2:7500");
  config.mutable_agents(0)->set_client_address("tcp://10.0.0.2:7500");
  EXPECT_THAT(WriteTeam(folder_ / "t", config).error().text,
              HasSubstr("agents[1].client_address: tcp://10.0.0.2:7500 is already that of agents[0]"));
  config.mutable_agents(0)->set_client_address(config.agents(1).address());
  EXPECT_THAT(WriteTeam(folder_ / "t", config).error().text, HasSubstr("is already that of agents[1]"));
}

TEST_F(TeamFileTest, RefusesToWriteAnInvalidTeam) {
  EXPECT_EQ(WriteInitialTeam(folder_ / "t", 0, 7400).error().field, "agent_count");
  EXPECT_EQ(WriteInitialTeam(folder_ / "t", 4, 65533).error().field, "first_port");
  proto::TeamConfig config = ParseTeamFile(kGood, "t").value().config;
  config.mutable_agents(0)->set_address("tcp://h:1\", id: 9, name: \"x");
  EXPECT_EQ(WriteTeam(folder_ / "t", config).error().code, ErrorCode::kInvalid);
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(TeamFileTest, ReportsErrorsInKeyFiles) {
  const std::filesystem::path path = folder_ / "team.yaml";
  ASSERT_TRUE(WriteInitialTeam(path, 4, 7400));
  std::filesystem::remove(folder_ / "rover1.pub");
  Write(folder_ / "rover2.pub", "short\n");
  Write(folder_ / "base.pub", Text(folder_ / "rover3.pub"));
  const std::string text = ReadTeamFile(path).error().text;
  EXPECT_THAT(text, HasSubstr(": agents[0].key: " + (folder_ / "rover1.pub").string() + ": no such file\n"));
  EXPECT_THAT(text, HasSubstr(": agents[1].key: " + (folder_ / "rover2.pub").string() + ": not a key"));
  EXPECT_THAT(text, HasSubstr(": agents[3].key: is the key of rover3 too"));
}

TEST_F(TeamFileTest, EveryAgentHasASigningKeyOfItsOwn) {
  const std::filesystem::path path = folder_ / "team.yaml";
  ASSERT_TRUE(WriteInitialTeam(path, 3, 7400));
  const std::string yaml = Text(path);
  const proto::TeamConfig team = ReadTeamFile(path).value().config;
  const auto error_of = [&](const std::string& text) {
    Write(path, text);
    const Result<TeamFile> read = ReadTeamFile(path);
    return read ? "no error" : read.error().text;
  };
  const auto without_key_of = [&team](const std::string& text, int agent) {
    return Replaced(text, "    signing_key: \"" + team.agents(agent).signing_key() + "\"\n", "");
  };
  const std::string missing = ".signing_key: missing: `moonctl keys add-signing` gives every agent one that has none";
  const std::string one_lacks = error_of(without_key_of(yaml, 1));
  EXPECT_THAT(one_lacks, HasSubstr(": agents[1]" + missing));
  EXPECT_THAT(one_lacks, Not(HasSubstr("agents[0]")));
  const std::string all_lack = error_of(without_key_of(without_key_of(without_key_of(yaml, 0), 1), 2));
  for (const char* agent : {"agents[0]", "agents[1]", "agents[2]"}) EXPECT_THAT(all_lack, HasSubstr(agent + missing));

  const std::string first = team.agents(0).signing_key();
  const std::string second = team.agents(1).signing_key();
  EXPECT_THAT(error_of(Replaced(yaml, second, first)),
              HasSubstr(": agents[1].signing_key: " + first + " is already that of agents[0]"));
  EXPECT_THAT(error_of(Replaced(yaml, second, std::string(40, '0'))),
              HasSubstr(": agents[1].signing_key: expected 40 characters in Z85 of an Ed25519 key"));
  Write(folder_ / "base.pub", first + "\n");
  EXPECT_THAT(error_of(yaml), HasSubstr(": agents[0].signing_key: is the CURVE key of base: expected a signing key"));
}

TEST_F(TeamFileTest, SecretsThatOthersCanReadAreRefused) {
  ASSERT_TRUE(WriteInitialTeam(folder_ / "team.yaml", 1, 7400));
  std::filesystem::permissions(folder_ / "rover1.sec", std::filesystem::perms(0640));
  EXPECT_THAT(ReadSecretKey(folder_ / "rover1.sec").error().text, HasSubstr("others can read this secret"));
}

TEST_F(TeamFileTest, MissingAndTooLargeFilesAreErrors) {
  EXPECT_EQ(ReadTeamFile(folder_ / "none.yaml").error().code, ErrorCode::kNotFound);
  EXPECT_THAT(ReadTeamFile(folder_).error().text, HasSubstr("not a regular file"));
  // loop.yaml is a link to itself, so its existence cannot be determined.
  std::filesystem::create_symlink("loop.yaml", folder_ / "loop.yaml");
  EXPECT_THAT(ReadTeamFile(folder_ / "loop.yaml").error().text, HasSubstr("symbolic links"));
  Write(folder_ / "large.yaml", kGood + std::string(1'000'000, '#'));
  EXPECT_THAT(ReadTeamFile(folder_ / "large.yaml").error().text, HasSubstr("larger than 1 MB"));
}

TEST_F(TeamFileTest, TheExampleOfTheRepositoryIsValid) {
  const std::filesystem::path example = std::filesystem::path(MOONDB_SOURCE_DIR) / "configs" / "cadre.yaml";
  std::filesystem::copy(example, folder_ / "cadre.yaml");
  for (const char* name : {"rover1", "rover2", "rover3", "base"}) {
    Write(folder_ / (std::string(name) + ".pub"), MakeCurveKeys().value().public_key + "\n");
  }
  const Result<TeamFile> team = ReadTeamFile(folder_ / "cadre.yaml");
  ASSERT_TRUE(team) << team.error().text;
  EXPECT_EQ(team->config.agents_size(), 4);
}

TEST_F(TeamFileTest, TheClientEndpointLiesInAPrivateFolderOfTheUser) {
  TeamFile team = ParseTeamFile(kGood, "t").value();
  setenv("MOONDB_RUN_DIR", folder_.c_str(), 1);
  EXPECT_EQ(ClientEndpoint(team, "rover1").value(), "ipc://" + (folder_ / "test-00112233" / "rover1.sock").string());
  TeamFile other = team;
  other.config.set_team_id("ff112233445566778899aabbccddeeff");
  EXPECT_NE(ClientEndpoint(other, "rover1").value(), ClientEndpoint(team, "rover1").value()) << "of the same name";
  std::filesystem::create_directory(folder_ / "test-00112233");
  std::filesystem::permissions(folder_ / "test-00112233", std::filesystem::perms(0750));
  EXPECT_THAT(ClientEndpoint(team, "rover1").error().text, HasSubstr("must be a folder of this user's"));
  setenv("MOONDB_RUN_DIR", (folder_ / std::string(100, 'x')).c_str(), 1);
  EXPECT_EQ(ClientEndpoint(team, "rover1").error().code, ErrorCode::kInvalid);
  unsetenv("MOONDB_RUN_DIR");
}

}  // namespace
}  // namespace moondb
