#include "apps/moonctl/holdings.h"

#include <gtest/gtest.h>

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
