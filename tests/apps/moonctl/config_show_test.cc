#include "apps/moonctl/config_show.h"

#include <gmock/gmock.h>

#include "model/text.h"
#include "runtime/team/team_config.h"

namespace moondb {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr char kTeam[] = R"(team: moon
team_id: 00112233445566778899aabbccddeeff
insecure: true
agents:
  - {id: 7, name: a, address: "tcp://127.0.0.1:7400", start: {x: 0.1, y: 0}}
  - {id: 3, name: "b", address: "tcp://127.0.0.1:7401", kind: base_station, position_m: [1, 2.5, -1e-7]}
  - {id: 9, name: c, address: "ipc:///tmp/c \"x\""}
radio:
roles: {failover: automatic}
custom_types:
  - {id: 1005, name: late, priority: 2}
  - {id: 1000, name: soil, share: latest}
)";

class ConfigShowTest : public testing::Test {
 protected:
  std::string YamlOf(const std::string& text) {
    const auto team = ParseTeamFile(text, "team.yaml");
    EXPECT_TRUE(team.has_value()) << ToString(team.error());
    return EffectiveYaml(team->config, GivenFields(text));
  }
};

TEST_F(ConfigShowTest, OutputIsATeamFileWithTheSameMeaning) {
  for (const std::string& text : {std::string(kTeam), *ReadTextFile(MOONDB_CONFIGS "/cadre.yaml")}) {
    const auto team = ParseTeamFile(text, "team.yaml");
    const auto again = ParseTeamFile(YamlOf(text), "shown.yaml");
    ASSERT_TRUE(again.has_value()) << ToString(again.error());
    EXPECT_EQ(again->hash, team->hash);
  }
}

TEST_F(ConfigShowTest, MarksDefaults) {
  const std::string yaml = YamlOf(kTeam);
  EXPECT_THAT(yaml, HasSubstr("  - id: 7\n    name: \"a\"\n"));
  EXPECT_THAT(yaml, HasSubstr("    kind: rover   # default\n"));
  EXPECT_THAT(yaml, HasSubstr("    kind: base_station\n"));
  EXPECT_THAT(yaml, HasSubstr("    position_m: [1, 2.5, -1e-07]\n"));
  EXPECT_THAT(yaml, HasSubstr("      x: 0.1\n      y: 0\n      z: 0   # default\n"));
  EXPECT_THAT(yaml, HasSubstr("  failover: automatic\n  leader_timeout_s: 120   # default\n"));
  EXPECT_THAT(yaml, HasSubstr("  budget_kbps: 1000   # default\n"));
  EXPECT_THAT(yaml, HasSubstr("  footprint_m: [0.75, 0.5]   # default\n"));
  EXPECT_THAT(yaml, Not(HasSubstr("site")));
  const auto defaulted = DefaultedFields(ParseTeamFile(kTeam, "t")->config, GivenFields(kTeam));
  EXPECT_THAT(defaulted, Contains("roles.leader"));
  EXPECT_THAT(defaulted, Not(Contains("roles.failover")));
}

TEST_F(ConfigShowTest, KnowsWhichCustomTypeGaveAFieldThoughTheyAreSorted) {
  const std::string yaml = YamlOf(kTeam);
  EXPECT_THAT(yaml, HasSubstr("  - id: 1000\n    name: \"soil\"\n    share: latest\n    ground: none   # default\n"
                              "    rovers: none   # default\n    priority: 5   # default\n"));
  EXPECT_THAT(yaml,
              HasSubstr("  - id: 1005\n    name: \"late\"\n    share: all   # default\n    ground: none   # default\n"
                        "    rovers: none   # default\n    priority: 2\n"));
}

TEST_F(ConfigShowTest, MarksNothingIfTheFileSetsEveryField) {
  const std::string shown = YamlOf(kTeam);
  EXPECT_THAT(YamlOf(shown), Not(HasSubstr("# default")));
}

}  // namespace
}  // namespace moondb
