// Checks each field of proto/team.proto: its description, its range, its default and its key in the example team file.
#include <gtest/gtest.h>

#include <regex>

#include "model/record_check.h"
#include "model/text.h"
#include "proto/team.pb.h"
#include "runtime/team/field_rules.h"
#include "runtime/team/team_check.h"

namespace moondb {
namespace {

using google::protobuf::FieldDescriptor;

const FieldDescriptor& FieldNamed(const std::string& name) {
  return *google::protobuf::DescriptorPool::generated_pool()->FindFieldByName("moondb.proto." + name);
}

// Returns the fields of all keys of the team file.
std::vector<const FieldDescriptor*> Keys() {
  std::vector<const FieldDescriptor*> keys;
  const auto& file = *proto::TeamConfig::descriptor()->file();
  for (int i = 0; i < file.message_type_count(); ++i) {
    for (int j = 0; j < file.message_type(i)->field_count(); ++j) keys.push_back(file.message_type(i)->field(j));
  }
  return keys;
}

TEST(TeamFieldsTest, HaveADescriptionAndNumbersHaveARange) {
  for (const FieldDescriptor* key : Keys()) {
    const proto::FieldRule& rule = RuleOf(*key);
    EXPECT_NE(rule.text(), "") << key->full_name() << " in proto/team.proto";
    const bool is_number =
        key->cpp_type() == FieldDescriptor::CPPTYPE_DOUBLE || key->cpp_type() == FieldDescriptor::CPPTYPE_UINT32;
    EXPECT_EQ(rule.has_low() && rule.has_high(), is_number) << key->full_name() << " in proto/team.proto";
    EXPECT_EQ(rule.count_max() > 0, key->is_repeated() && !key->is_map()) << key->full_name() << " in proto/team.proto";
  }
}

TEST(TeamFieldsTest, AppearInTheCommentedTeamFile) {
  const Result<std::string> yaml = ReadTextFile(std::string(MOONDB_SOURCE_DIR) + "/configs/cadre.yaml");
  ASSERT_TRUE(yaml);
  for (const FieldDescriptor* key : Keys()) {
    EXPECT_TRUE(std::regex_search(*yaml, std::regex("(^|[ {\n])" + key->name() + ":")))
        << "configs/cadre.yaml lacks " << key->full_name();
  }
}

TEST(TeamFieldsTest, HaveDefaultsWithinTheirRanges) {
  proto::TeamConfig team;
  team.set_team("t");
  team.set_team_id("00112233445566778899aabbccddeeff");
  proto::AgentConfig& agent = *team.add_agents();
  agent.set_id(1);
  agent.set_name("a");
  agent.set_address("ipc:///a");
  agent.mutable_start();
  proto::CustomType& type = *team.add_custom_types();
  type.set_id(1000);
  type.set_name("b");
  FillFields({}, &team);
  PlacedErrors errors("defaults");
  CheckFields(team, PlacesOf(team), &errors);
  EXPECT_EQ(errors.Text(), "");
  EXPECT_EQ(agent.start().sigma_m(), 0.05);
  EXPECT_EQ(type.bytes_max(), 4096u);
  EXPECT_FALSE(team.has_site()) << "a section without defaults is left out";
}

TEST(TeamFieldsTest, HaveTheSameLimitsAsTheCode) {
  EXPECT_EQ(RuleOf(FieldNamed("AgentConfig.id")).high(), kAgentIdMax);
  EXPECT_EQ(RuleOf(FieldNamed("TeamConfig.agents")).count_max(), static_cast<unsigned>(kAgentCountMax));
  EXPECT_EQ(RuleOf(FieldNamed("CustomType.id")).low(), kCustomDataTypeMin);
  EXPECT_EQ(RuleOf(FieldNamed("CustomType.id")).high(), kCustomDataTypeMax);
  EXPECT_EQ(RuleOf(FieldNamed("CustomType.bytes_max")).high(), kCustomPayloadBytesMax);
}

}  // namespace
}  // namespace moondb
