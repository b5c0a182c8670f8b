#include "actors/pgo/publication.h"

#include <gtest/gtest.h>

#include <string>

namespace moondb {
namespace {

FactorSet SetOf(AgentId producer, FactorKind kind, const std::string& source, std::size_t count) {
  FactorSet set;
  set.producer = producer;
  set.kind = kind;
  set.agents = {1, 3};
  set.source = source;
  set.factors.resize(count);
  return set;
}

TEST(PublicationTest, ListsRefusedSetsWithTheirProducer) {
  Solution solution;
  solution.is_accepted = true;
  solution.refused = {SetOf(3, FactorKind::kLoopClosure, "apriltag", 5), SetOf(3, FactorKind::kRange, "", 40)};
  const proto::OptimizeReply reply = ToReply(solution);
  ASSERT_EQ(reply.refused_sets_size(), 2);
  EXPECT_TRUE(reply.refused_sets(0).is_range());
  EXPECT_EQ(reply.refused_sets(0).count(), 40);
  EXPECT_EQ(reply.refused_sets(0).producer(), 3u);
  EXPECT_EQ(reply.refused_sets(1).source(), "apriltag");
  EXPECT_FALSE(reply.refused_sets(1).is_range());
}

TEST(PublicationTest, SumsSetsOfManySources) {
  Solution solution;
  solution.is_accepted = true;
  for (int i = 0; i < 1000; ++i) {
    solution.refused.push_back(SetOf(3, FactorKind::kLoopClosure, "tool" + std::to_string(i), 2));
  }
  const proto::OptimizeReply reply = ToReply(solution);
  ASSERT_EQ(reply.refused_sets_size(), 1) << "a rover may invent any number of sources";
  EXPECT_EQ(reply.refused_sets(0).count(), 2000);
  EXPECT_EQ(reply.refused_sets(0).source(), "");
}

}  // namespace
}  // namespace moondb
