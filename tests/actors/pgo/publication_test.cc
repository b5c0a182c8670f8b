#include "actors/pgo/publication.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "actors/pgo/rover_status.h"
#include "proto/types.pb.h"

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

RoverResult RoverWith(AgentId agent, Anchoring anchoring) {
  RoverResult rover;
  rover.agent = agent;
  rover.anchoring = anchoring;
  return rover;
}

TEST(PublicationTest, CountsRoversWithoutAPlaceAsUnplaced) {
  EXPECT_EQ(FindUnplaced({RoverWith(1, Anchoring::kAnchored), RoverWith(2, Anchoring::kNoRanges),
                          RoverWith(3, Anchoring::kUnanchored), RoverWith(4, Anchoring::kAmbiguous),
                          RoverWith(5, Anchoring::kYawFree)}),
            (std::set<AgentId>{3, 4, 5}));
  EXPECT_EQ(FindUnplaced({RoverWith(1, Anchoring::kYawFree), RoverWith(2, Anchoring::kYawFree)}), std::set<AgentId>())
      << "they share one frame, about the base station";
}

// Poses that did not move are published again when their rover is placed, and when it is no longer.
TEST(PublicationTest, PublishesAgainWhenARoverIsPlaced) {
  KnownGraph known(KnownGraph::Limits{});
  const AgentFactsMap agents;
  proto::Term term;
  term.set_number(1);
  std::uint64_t run = 0;
  const auto publish = [&](Anchoring anchoring) {
    Solution solution;
    solution.is_accepted = true;
    solution.poses[{2, 0}] = Pose::FromPlanar(1, 0, 0);
    solution.rovers = {RoverWith(1, Anchoring::kAnchored), RoverWith(2, anchoring)};
    const Publication publication = MakePublication(solution, known, agents, {}, term, ++run, 0);
    for (const proto::Record& record : publication.records) {
      EXPECT_TRUE(known.Add({{1, 1, proto::OPTIMIZED_POSE}, run}, record));
    }
    return publication.records;
  };
  std::vector<proto::Record> records = publish(Anchoring::kUnanchored);
  ASSERT_EQ(records.size(), 1u);
  EXPECT_TRUE(records[0].optimized_pose().is_unplaced());
  EXPECT_TRUE(publish(Anchoring::kUnanchored).empty());
  records = publish(Anchoring::kAnchored);
  ASSERT_EQ(records.size(), 1u);
  EXPECT_FALSE(records[0].optimized_pose().is_unplaced());
  EXPECT_EQ(publish(Anchoring::kUnanchored).size(), 1u);
}

}  // namespace
}  // namespace moondb
