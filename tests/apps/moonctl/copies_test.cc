#include "apps/moonctl/copies.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb {
namespace {

const StreamKey kNodes{2, 7, proto::POSE_GRAPH_NODE};
const StreamKey kStates{2, 7, proto::TEMPERATURE};

HaveSet Held(const StreamKey& stream, std::uint64_t first, std::uint64_t last) {
  HaveSet have;
  have[stream].held.Add({first, last});
  return have;
}

TEST(CopiesTest, CountsCopiesOfEachAgentsRecords) {
  const auto counts = CountCopies({Held(kNodes, 1, 10), Held(kNodes, 1, 6), Held(kNodes, 1, 2)}, {});
  ASSERT_EQ(counts.size(), 3u);
  EXPECT_EQ(counts[0].one, 4u);
  EXPECT_EQ(counts[0].two, 4u);
  EXPECT_EQ(counts[0].three_or_more, 2u);
  EXPECT_EQ(counts[1].one, 0u);
  EXPECT_EQ(counts[1].two, 4u);
  EXPECT_EQ(counts[2].three_or_more, 2u);
  EXPECT_EQ(counts[0].alone, Held(kNodes, 7, 10));
}

TEST(CopiesTest, DoesNotCountASupersededState) {
  HaveSet origin;
  origin[kStates].held.Add({5, 5});
  origin[kStates].dropped.Add({1, 4});
  const HaveSet leader = Held(kStates, 4, 4);
  const auto counts = CountCopies({origin, leader}, {proto::TEMPERATURE});
  EXPECT_EQ(counts[0].one, 1u);
  EXPECT_EQ(counts[1].one, 0u) << "a newer state exists";
}

// Under the policy `all` a dropped record was pruned, and the other copy may be the last one.
TEST(CopiesTest, CountsARecordThatAnotherAgentPruned) {
  HaveSet rover;
  rover[kNodes].dropped.Add({1, 4});
  const auto counts = CountCopies({rover, Held(kNodes, 1, 4)}, {proto::TEMPERATURE});
  EXPECT_EQ(counts[1].one, 4u);
}

}  // namespace
}  // namespace moondb
