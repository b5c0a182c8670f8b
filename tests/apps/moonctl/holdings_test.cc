#include "apps/moonctl/holdings.h"

#include <gtest/gtest.h>

#include "apps/moonctl/map_holdings.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr DataType kNode = proto::POSE_GRAPH_NODE;
constexpr DataType kState = proto::TEMPERATURE;

HaveSet Held(const StreamKey& stream, std::uint64_t first, std::uint64_t last) {
  HaveSet have;
  have[stream].held.Add({first, last});
  return have;
}

TEST(HoldingsTest, CountsWhatIsHeldAndWhatIsLackingOverAllEpochs) {
  HaveSet leader = Held({2, 7, kNode}, 1, 10);
  leader[{2, 8, kNode}].held.Add({1, 3});
  const HaveSet rover = Held({2, 8, kNode}, 1, 5);
  const auto holdings = HoldingsOf({leader, rover, HaveSet()});
  ASSERT_EQ(holdings.size(), 1u);
  const auto& [series, row] = *holdings.begin();
  EXPECT_EQ(series, Series(2, kNode));
  ASSERT_EQ(row.size(), 3u);
  EXPECT_EQ(row[0].held, 13u);
  EXPECT_EQ(row[0].lacking, 2u);
  EXPECT_EQ(row[1].held, 5u);
  EXPECT_EQ(row[1].lacking, 10u);
  EXPECT_EQ(row[2].held, 0u);
  EXPECT_EQ(row[2].lacking, 15u);
}

// Agents 1 (leader), 2 (survivor) and 3 are rovers, 4 is the base station.
TEST(MapHoldingsTest, AnAgentShouldHaveTheMapsThatRolesAndPoliciesBringIt) {
  proto::TeamConfig team;
  for (std::uint32_t id = 1; id <= 4; ++id) team.add_agents()->set_id(id);
  team.mutable_agents(3)->set_kind(proto::AGENT_KIND_BASE_STATION);
  proto::RoleAssignment roles;
  roles.set_leader(1);
  roles.set_survivor(2);
  const StreamKey maps{3, 7, proto::LOCAL_TRAVERSABILITY_MAP};
  HaveSet leader = Held(maps, 1, 10);
  leader[{3, 7, kNode}].held.Add({1, 20});
  const HaveSet some = Held(maps, 3, 12);
  for (const AgentId agent : {1u, 2u, 3u, 4u}) {
    const auto holdings = MapHoldingsOf(team, roles, agent, some, leader);
    ASSERT_EQ(holdings.size(), 1u);
    EXPECT_EQ(holdings[0].origin, 3u);
    EXPECT_EQ(holdings[0].held, 10u);
    EXPECT_EQ(holdings[0].lacking, 2u);
    EXPECT_EQ(holdings[0].is_meant, agent != 4) << agent;
  }
  roles.set_survivor(0);
  EXPECT_FALSE(MapHoldingsOf(team, roles, 2, some, leader)[0].is_meant);
  (*team.mutable_rovers())["local_traversability_map"] = proto::POLICY_ALL;
  EXPECT_TRUE(MapHoldingsOf(team, roles, 2, some, leader)[0].is_meant);
  EXPECT_FALSE(MapHoldingsOf(team, roles, 4, some, leader)[0].is_meant);
  (*team.mutable_ground())["local_traversability_map"] = proto::POLICY_ALL;
  EXPECT_TRUE(MapHoldingsOf(team, roles, 4, some, leader)[0].is_meant);
}

TEST(HoldingsTest, SupersededRecordsAreNotLacking) {
  HaveSet newer = Held({2, 7, kState}, 5, 5);
  newer[{2, 7, kState}].dropped.Add({1, 4});
  const HaveSet older = Held({2, 7, kState}, 3, 3);
  const auto row = HoldingsOf({newer, older}).at({2, kState});
  EXPECT_EQ(row[0].held, 1u);
  EXPECT_EQ(row[0].lacking, 0u);
  EXPECT_EQ(row[1].held, 1u);
  EXPECT_EQ(row[1].lacking, 1u);  // Only seq 5: seqs 1, 2 and 4 are superseded.
  HaveSet nothing;
  nothing[{3, 7, kState}].dropped.Add({1, 4});
  EXPECT_TRUE(HoldingsOf({nothing, HaveSet()}).empty());
}

TEST(HoldingsTest, ComparesTwo) {
  HaveSet first = Held({2, 7, kNode}, 1, 10);
  first[{3, 9, kNode}].held.Add({1, 2});
  const HaveSet second = Held({2, 7, kNode}, 4, 12);
  const auto pairs = CompareHoldings(first, second);
  ASSERT_EQ(pairs.size(), 2u);
  const HoldingPair& both = pairs.at({2, kNode});
  EXPECT_EQ(both.first.lacking, 2u);
  EXPECT_EQ(both.second.lacking, 3u);
  EXPECT_EQ(both.both, Held({2, 7, kNode}, 4, 10));
  EXPECT_EQ(pairs.at({3, kNode}).second.lacking, 2u);
  EXPECT_TRUE(pairs.at({3, kNode}).both.streams().empty());
}

}  // namespace
}  // namespace moondb
