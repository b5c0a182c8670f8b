#include "model/origin_quota.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <set>

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

RecordKey KeyOf(AgentId origin, std::uint64_t seq, std::uint64_t epoch = 1) { return {{origin, epoch, 20}, seq}; }

struct Weighed {
  RecordKey key;
  std::uint64_t weight = 1;
};

// Adds `records` to a quota in this order. Returns the keys of the records that the quota keeps at the end.
std::set<RecordKey> KeptOf(std::uint64_t limit, const std::vector<Weighed>& records) {
  OriginQuota<RecordKey> quota(limit);
  std::set<RecordKey> kept;
  for (const auto& [key, weight] : records) {
    kept.insert(key);
    for (const auto& removed : quota.Add(key, weight, key)) {
      EXPECT_EQ(removed.key, removed.note);
      EXPECT_EQ(kept.erase(removed.key), 1u) << "removed once: " << ToString(removed.key);
    }
  }
  return kept;
}

// Returns the keys that the quota must keep by its definition. Tries levels (a maximum weight per origin) from the
// highest down, and uses the first level at which all origins together fit into `limit`.
std::set<RecordKey> ExpectedKept(std::uint64_t limit, const std::vector<Weighed>& records) {
  std::map<AgentId, std::uint64_t> weights;
  std::uint64_t heaviest = 0;
  for (const auto& [key, weight] : records) heaviest = std::max(heaviest, weights[key.stream.origin] += weight);
  std::uint64_t level = heaviest;
  const auto used = [&weights, &level] {
    std::uint64_t sum = 0;
    for (const auto& [agent, weight] : weights) sum += std::min(weight, level);
    return sum;
  };
  while (used() > limit) --level;
  std::set<RecordKey> kept;
  for (const auto& [key, weight] : records) {
    std::uint64_t as_new = 0;
    for (const auto& [other, other_weight] : records) {
      const bool is_as_new = std::pair(other.stream.epoch, other.seq) >= std::pair(key.stream.epoch, key.seq);
      if (other.stream.origin == key.stream.origin && is_as_new) as_new += other_weight;
    }
    if (as_new <= level) kept.insert(key);
  }
  return kept;
}

TEST(OriginQuotaTest, KeepsAllThatFits) {
  EXPECT_EQ(KeptOf(3, {{KeyOf(1, 1)}, {KeyOf(1, 2)}, {KeyOf(2, 1)}}).size(), 3u);
}

TEST(OriginQuotaTest, CutsTheLargestOriginsToOneLevelAndKeepsTheirNewestRecords) {
  OriginQuota<int> quota(10);
  std::vector<RecordKey> removed;
  const auto add = [&](const RecordKey& key) {
    for (const auto& one : quota.Add(key, 1, 0)) removed.push_back(one.key);
  };
  for (std::uint64_t seq = 1; seq <= 2; ++seq) add(KeyOf(1, seq));
  for (std::uint64_t seq = 1; seq <= 8; ++seq) add(KeyOf(2, seq));
  EXPECT_THAT(removed, IsEmpty());
  add(KeyOf(2, 9));
  EXPECT_THAT(removed, ElementsAre(KeyOf(2, 1)));
  for (std::uint64_t seq = 1; seq <= 6; ++seq) add(KeyOf(3, seq));
  std::map<AgentId, std::uint64_t> left_out;
  quota.CountLeftOut(left_out);
  EXPECT_THAT(left_out, ElementsAre(Pair(2, 5), Pair(3, 2))) << "2 of agent 1, and 4 each of agents 2 and 3 have room";
}

TEST(OriginQuotaTest, HasNoRoomForARecordThatIsLargerThanTheLevel) {
  EXPECT_THAT(KeptOf(10, {{KeyOf(1, 1), 3}, {KeyOf(2, 1), 8}, {KeyOf(2, 2), 1}}),
              ElementsAre(KeyOf(1, 1), KeyOf(2, 2)));
}

TEST(OriginQuotaTest, DependsOnTheSetOfRecordsAndNotOnTheirOrder) {
  const std::uint64_t first_seed = std::random_device()();
  for (std::uint64_t seed = first_seed; seed < first_seed + 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 rng(seed);
    std::vector<Weighed> records;
    const std::uint64_t weight_max = 1 + rng() % 9;
    for (AgentId origin = 1; origin <= 4; ++origin) {
      const std::uint64_t count = rng() % 12;
      for (std::uint64_t i = 0; i < count; ++i) {
        records.push_back({KeyOf(origin, 1 + i / 3, 1 + i % 3), 1 + rng() % weight_max});
      }
    }
    const std::uint64_t limit = 1 + rng() % 60;
    const std::set<RecordKey> expected = ExpectedKept(limit, records);
    for (int order = 0; order < 5; ++order) {
      std::shuffle(records.begin(), records.end(), rng);
      EXPECT_EQ(KeptOf(limit, records), expected) << "limit " << limit;
    }
  }
}

}  // namespace
}  // namespace moondb
