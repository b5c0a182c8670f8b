#include "model/have_page.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "proto/have.pb.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

// Returns `have` as pages of at most `bytes_max` bytes each.
std::vector<proto::HaveSet> PagesOf(const HaveSet& have, std::size_t bytes_max) {
  std::vector<proto::HaveSet> pages;
  for (std::optional<RecordKey> from = RecordKey(); from;) {
    HavePageWriter writer(*from, bytes_max);
    for (auto it = have.streams().lower_bound(from->stream); it != have.streams().end(); ++it) {
      if (!writer.Add(it->first, it->second)) break;
    }
    EXPECT_TRUE(!writer.next() || *writer.next() > *from) << "each page goes on";
    from = writer.next();
    pages.push_back(std::move(writer.page()));
  }
  return pages;
}

HaveSet Join(const std::vector<proto::HaveSet>& pages) {
  HaveSet joined;
  for (const proto::HaveSet& page : pages) joined.Merge(*FromProto(page));
  return joined;
}

HaveSet DrawHave(std::mt19937_64& rng) {
  HaveSet have;
  for (std::uint64_t i = rng() % 40; i > 0; --i) {
    StreamHave& stream = have[{static_cast<AgentId>(1 + rng() % 5), rng(), static_cast<DataType>(rng() % 2000)}];
    std::uint64_t seq = 1 + rng() % 3;
    for (std::uint64_t k = rng() % (rng() % 8 == 0 ? 200 : 4) + 1; k > 0; --k, seq += 2 + rng() % 1000) {
      const std::uint64_t last = seq + rng() % 50;
      (rng() % 2 == 0 ? stream.held : stream.dropped).Add({seq, last});
      seq = last;
    }
  }
  return have;
}

TEST(HavePageTest, ASmallHaveSetIsOnePageWithTheSameBytes) {
  HaveSet have;
  for (AgentId origin = 1; origin <= 60; ++origin) have[{origin, 7, proto::POWER}].held.Add({1, 1000});
  const auto pages = PagesOf(have, kHavePageBytesMax);
  ASSERT_EQ(pages.size(), 1u);
  EXPECT_EQ(pages[0].SerializeAsString(), ToProto(have).SerializeAsString());
  EXPECT_EQ(PagesOf(HaveSet(), kHavePageBytesMax).size(), 1u) << "who has nothing says so";
}

TEST(HavePageTest, PagesKeepToTheirSizeAndJoinToTheWhole) {
  const std::uint64_t first_seed = std::random_device()();
  for (std::uint64_t seed = first_seed; seed < first_seed + 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 rng(seed);
    const HaveSet have = DrawHave(rng);
    const std::size_t bytes_max = 60 + rng() % 2000;
    const auto pages = PagesOf(have, bytes_max);
    for (const proto::HaveSet& page : pages) EXPECT_LE(page.ByteSizeLong(), bytes_max);
    EXPECT_EQ(Join(pages), have);
    if (testing::Test::HasFailure()) return;
  }
}

TEST(HavePageTest, CutsNoStreamThatFitsIntoAPage) {
  HaveSet have;
  for (std::uint64_t epoch = 1; epoch <= 50; ++epoch) {
    for (std::uint64_t i = 1; i <= 10; ++i) have[{1, epoch, proto::POWER}].held.Add(10 * i);
  }
  std::size_t streams = 0;
  for (const proto::HaveSet& page : PagesOf(have, 300)) streams += static_cast<std::size_t>(page.streams_size());
  EXPECT_EQ(streams, 50u);
}

TEST(HavePageTest, CutsAStreamThatFitsIntoNone) {
  HaveSet have;
  StreamHave& stream = have[{1, 7, proto::POWER}];
  for (std::uint64_t i = 1; i <= 100; ++i) (i % 2 == 0 ? stream.held : stream.dropped).Add(10 * i);
  const auto pages = PagesOf(have, 100);
  EXPECT_GT(pages.size(), 5u);
  EXPECT_EQ(Join(pages), have);
}

// Records that arrive between two pages may merge intervals.
TEST(HavePageTest, ContinuesInsideIntervalsThatHaveMerged) {
  HavePageWriter writer({{1, 7, proto::POWER}, 50}, 1000);
  StreamHave have;
  have.held.Add({1, 100});
  ASSERT_TRUE(writer.Add({1, 7, proto::POWER}, have));
  ASSERT_EQ(writer.page().streams_size(), 1);
  EXPECT_EQ(writer.page().streams(0).held(0).first(), 50u);
  EXPECT_EQ(writer.page().streams(0).held(0).last(), 100u);
}

// The have-set has the maximum number of streams. Two streams have the maximum number of intervals, and all others have
// one interval. All numbers have the maximum length on the wire.
TEST(HavePageTest, TheLargestHaveSetIsWithinTheLimits) {
  HaveSet have;
  const std::uint64_t epoch = UINT64_MAX - kHaveStreamsMax;
  for (int i = 0; i < kHaveStreamsMax; ++i)
    have[{kAgentIdMax, epoch + static_cast<std::uint64_t>(i), 1999}].held.Add(1);
  for (int i = 0; i < 2; ++i) {
    StreamHave& stream = have[{kAgentIdMax, epoch + static_cast<std::uint64_t>(i), 1999}];
    stream = StreamHave();
    std::uint64_t seq = kSeqMax / 2;
    for (int k = 0; k < kHaveIntervalsPerStreamMax; ++k, seq += 4) {
      stream.held.Add(seq);
      stream.dropped.Add(seq + 2);
    }
  }
  const auto pages = PagesOf(have, kHavePageBytesMax);
  EXPECT_LT(static_cast<int>(pages.size()), kHavePagesMax);
  for (const proto::HaveSet& page : pages) EXPECT_LE(page.ByteSizeLong(), kHavePageBytesMax);
  EXPECT_EQ(Join(pages), have);
}

}  // namespace
}  // namespace moondb
