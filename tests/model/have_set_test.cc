#include "model/have_set.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "proto/have.pb.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

using Interval = IntervalSet::Interval;

IntervalSet Set(std::initializer_list<Interval> intervals) {
  IntervalSet set;
  for (const Interval& interval : intervals) set.Add(interval);
  return set;
}

TEST(IntervalSetTest, JoinsWhatTouchesOrOverlaps) {
  IntervalSet set = Set({{1, 3}, {7, 9}});
  set.Add(4);
  EXPECT_EQ(set, Set({{1, 4}, {7, 9}}));
  set.Add(Interval{5, 8});
  EXPECT_EQ(set.intervals(), (std::vector<Interval>{{1, 9}}));
}

TEST(IntervalSetTest, SplitsWhereASeqIsRemoved) {
  IntervalSet set = Set({{1, 5}});
  set.Remove(3);
  set.Remove(5);
  set.Remove(9);
  EXPECT_EQ(set.intervals(), (std::vector<Interval>{{1, 2}, {4, 4}}));
}

TEST(IntervalSetTest, AgreesWithAPlainSetOnRandomOperations) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 rng(seed);
  for (int round = 0; round < 200; ++round) {
    IntervalSet set, other;
    std::set<std::uint64_t> plain, plain_other;
    for (int i = 0; i < 60; ++i) {
      const std::uint64_t first = 1 + rng() % 50, last = first + rng() % 6, seq = 1 + rng() % 50;
      switch (rng() % 3) {
        case 0:
          set.Add(Interval{first, last});
          for (std::uint64_t s = first; s <= last; ++s) plain.insert(s);
          break;
        case 1:
          set.Remove(seq);
          plain.erase(seq);
          break;
        default:
          other.Add(seq);
          plain_other.insert(seq);
      }
    }
    const IntervalSet minus = set.Minus(other);
    const IntervalSet both = set.Intersection(other);
    std::uint64_t minus_count = 0;
    for (std::uint64_t s = 1; s <= 60; ++s) {
      ASSERT_EQ(set.Contains(s), plain.count(s) == 1) << s;
      const bool is_left = plain.count(s) && !plain_other.count(s);
      ASSERT_EQ(minus.Contains(s), is_left) << s;
      ASSERT_EQ(both.Contains(s), plain.count(s) && plain_other.count(s)) << s;
      minus_count += is_left;
    }
    ASSERT_EQ(minus.Count(), minus_count);
    ASSERT_EQ(set.Count(), plain.size());
    ASSERT_EQ(set.Max(), plain.empty() ? 0 : *plain.rbegin());
    for (std::size_t i = 1; i < minus.intervals().size(); ++i) {
      ASSERT_GT(minus.intervals()[i].first, minus.intervals()[i - 1].last + 1);
    }
  }
}

TEST(HaveSetTest, MergesBothSidesAndDroppedWins) {
  const StreamKey key{1, 2, proto::TEMPERATURE};
  HaveSet ours, theirs;
  ours[key].held = Set({{1, 4}});
  theirs[key].dropped = Set({{1, 3}});
  theirs[key].held = Set({{4, 6}});
  ours.Merge(theirs);
  EXPECT_EQ(ours.Get(key).held, Set({{4, 6}}));
  EXPECT_EQ(ours.Get(key).Covered(), Set({{1, 6}}));
}

TEST(HaveSetTest, FindsTheIntervalsAroundOthers) {
  const StreamKey key{1, 2, proto::TEMPERATURE};
  HaveSet ours, named;
  ours[key].held = Set({{1, 4}, {6, 9}, {20, 20}});
  ours[key].dropped = Set({{11, 15}, {30, 40}});
  ours[{2, 2, proto::TEMPERATURE}].held = Set({{1, 1}});
  named[key].held = Set({{4, 7}, {9, 9}, {35, 50}, {60, 60}});
  HaveSet around;
  around[key].held = Set({{1, 4}, {6, 9}});
  around[key].dropped = Set({{30, 40}});
  EXPECT_EQ(ours.Around(named), around);
}

TEST(HaveSetTest, JoinsAsLongAsTheUnionIsNotTooLarge) {
  HaveSet full;
  for (std::uint64_t epoch = 1; epoch <= kHaveStreamsMax; ++epoch) full[{1, epoch, proto::POWER}].held.Add({1, 9});
  HaveSet more;
  more[{1, 1, proto::POWER}].held.Add(10);
  EXPECT_TRUE(full.CheckJoins(more)) << "the stream is there already";
  more[{1, 0, proto::POWER}].held.Add(1);
  EXPECT_FALSE(full.CheckJoins(more));

  HaveSet gaps;
  for (std::uint64_t i = 1; i <= kHaveIntervalsPerStreamMax; ++i) gaps[{1, 1, proto::POWER}].held.Add(2 * i);
  HaveSet filling;
  filling[{1, 1, proto::POWER}].held.Add(3);
  EXPECT_TRUE(gaps.CheckJoins(filling)) << "it joins two intervals";
  HaveSet another;
  another[{1, 1, proto::POWER}].held.Add(2 * kHaveIntervalsPerStreamMax + 10);
  EXPECT_FALSE(gaps.CheckJoins(another));
}

TEST(HaveSetTest, SurvivesTheWire) {
  HaveSet have;
  have[{1, 2, proto::TEMPERATURE}].held = Set({{1, 4}, {9, 9}});
  have[{3, 7, proto::POWER}].dropped = Set({{2, 2}});
  const Result<HaveSet> back = FromProto(ToProto(have));
  ASSERT_TRUE(back.has_value());
  EXPECT_EQ(*back, have);
}

class HaveSetFromPeerTest : public ::testing::Test {
 protected:
  // Checks a have-set with one stream of agent `origin`, which has these intervals. Returns the rejected field, or an
  // empty text if the have-set is valid.
  std::string Refused(std::initializer_list<Interval> held, std::initializer_list<Interval> dropped = {},
                      AgentId origin = 1) {
    proto::HaveSet have;
    proto::StreamHave& stream = *have.add_streams();
    stream.set_origin_agent(origin);
    for (const Interval& i : held) {
      proto::Interval& added = *stream.add_held();
      added.set_first(i.first);
      added.set_last(i.last);
    }
    for (const Interval& i : dropped) {
      proto::Interval& added = *stream.add_dropped();
      added.set_first(i.first);
      added.set_last(i.last);
    }
    const Result<HaveSet> result = FromProto(have);
    return result ? "" : result.error().field;
  }
};

TEST_F(HaveSetFromPeerTest, RefusesWhatNoHonestPeerSends) {
  EXPECT_EQ(Refused({{1, 2}, {4, 5}}), "");
  EXPECT_EQ(Refused({{0, 2}}), "streams[0].held");
  EXPECT_EQ(Refused({{3, 2}}), "streams[0].held");
  EXPECT_EQ(Refused({{4, 5}, {1, 2}}), "streams[0].held");
  EXPECT_EQ(Refused({{1, 2}, {3, 5}}), "streams[0].held");
  EXPECT_EQ(Refused({{1, 5}, {2, 3}}), "streams[0].held");
  EXPECT_EQ(Refused({{1, UINT64_MAX}}), "streams[0].held");
  EXPECT_EQ(Refused({{1, 3}}, {{3, 4}}), "streams[0]");
  EXPECT_EQ(Refused({{1, 3}}, {}, 0), "streams[0].origin_agent");
  EXPECT_EQ(Refused({{1, 3}}, {}, 70000), "streams[0].origin_agent");
}

TEST_F(HaveSetFromPeerTest, BoundsTheIntervalsOfAllStreamsTogether) {
  proto::HaveSet have;
  for (std::uint64_t epoch = 1; epoch <= 5; ++epoch) {
    proto::StreamHave& stream = *have.add_streams();
    stream.set_origin_agent(1);
    stream.set_epoch(epoch);
    for (std::uint64_t i = 0; i < 60'000; ++i) {
      proto::Interval& interval = *stream.add_held();
      interval.set_first(3 * i + 1);
      interval.set_last(3 * i + 2);
    }
    EXPECT_EQ(FromProto(have).has_value(), epoch <= 4) << epoch;
  }
}

TEST_F(HaveSetFromPeerTest, RefusesOneStreamTwice) {
  proto::HaveSet have;
  have.add_streams()->set_origin_agent(1);
  have.add_streams()->set_origin_agent(1);
  EXPECT_FALSE(FromProto(have).has_value());
}

}  // namespace
}  // namespace moondb
