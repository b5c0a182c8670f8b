#include "actors/merge/page_shares.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "actors/merge/tile.h"

namespace moondb {
namespace {

// Returns an item of `origin` that covers `pages` pages in a row from page (x, y) on.
SharedItem ItemAt(AgentId origin, std::uint64_t seq, std::int64_t x, std::int64_t y = 0, std::int64_t pages = 1) {
  return {origin,
          {1, seq, 0},
          0,
          {x * kPageSideCells, y * kPageSideCells, (x + pages) * kPageSideCells - 1, (y + 1) * kPageSideCells - 1}};
}

// Returns the sequence numbers of the items without room, by origin.
std::map<AgentId, std::set<std::uint64_t>> WithoutRoom(const std::vector<SharedItem>& items, std::size_t pages_max) {
  std::map<AgentId, std::set<std::uint64_t>> seqs;
  for (const std::size_t i : FindItemsWithoutRoom(items, pages_max)) {
    seqs[items[i].origin].insert(std::get<1>(items[i].age));
  }
  return seqs;
}

TEST(PageSharesTest, AllItemsHaveRoomInFewPages) {
  std::vector<SharedItem> items;
  for (std::uint64_t seq = 0; seq < 100; ++seq) items.push_back(ItemAt(1, seq, static_cast<std::int64_t>(seq % 4)));
  EXPECT_TRUE(FindItemsWithoutRoom(items, 4).empty());
  EXPECT_TRUE(FindItemsWithoutRoom({}, 4).empty());
}

TEST(PageSharesTest, AnOriginWithTooManyPagesKeepsItsNewestItemsAndOthersKeepAll) {
  std::vector<SharedItem> items = {ItemAt(1, 1, 0), ItemAt(1, 2, 1), ItemAt(2, 1, 1000)};
  for (std::uint64_t seq = 1; seq <= 20; ++seq) items.push_back(ItemAt(3, seq, 10 * static_cast<std::int64_t>(seq)));
  std::set<std::uint64_t> oldest;
  for (std::uint64_t seq = 1; seq <= 13; ++seq) oldest.insert(seq);
  EXPECT_EQ(WithoutRoom(items, 10), (std::map<AgentId, std::set<std::uint64_t>>{{3, oldest}}));
}

TEST(PageSharesTest, OriginsWithTooManyPagesHaveEqualShares) {
  std::vector<SharedItem> items;
  for (std::uint64_t seq = 1; seq <= 20; ++seq) {
    items.push_back(ItemAt(1, seq, 10 * static_cast<std::int64_t>(seq)));
    items.push_back(ItemAt(2, seq, 10 * static_cast<std::int64_t>(seq), /*y=*/5));
  }
  const auto without_room = WithoutRoom(items, 10);
  EXPECT_EQ(without_room.at(1).size(), 15u);
  EXPECT_EQ(without_room.at(2).size(), 15u);
}

// 64 rovers in one place touch the same 25 pages.
TEST(PageSharesTest, APageOfSeveralOriginsCountsOnce) {
  std::vector<SharedItem> items;
  for (AgentId rover = 1; rover <= 64; ++rover) {
    for (std::int64_t y = 0; y < 5; ++y) items.push_back(ItemAt(rover, static_cast<std::uint64_t>(y), 0, y, 5));
  }
  for (std::uint64_t seq = 0; seq < 500; ++seq) items.push_back(ItemAt(70, seq, 20 * static_cast<std::int64_t>(seq)));
  const auto without_room = WithoutRoom(items, 125);
  EXPECT_EQ(without_room.size(), 1u);
  EXPECT_EQ(without_room.at(70).size(), 400u);
}

TEST(PageSharesTest, AnItemWithMorePagesThanAllNeverHasRoomAndTakesNone) {
  const std::vector<SharedItem> items = {ItemAt(1, 1, 0), ItemAt(1, 2, 0, 0, 1'000'000'000), ItemAt(1, 3, 3)};
  EXPECT_EQ(WithoutRoom(items, 2), (std::map<AgentId, std::set<std::uint64_t>>{{1, {2}}}));
}

// Compares with a search over all levels.
TEST(PageSharesTest, TheLevelIsTheHighestAtWhichAllPagesAreWithinTheLimit) {
  const std::uint64_t first_seed = std::random_device()();
  for (std::uint64_t seed = first_seed; seed < first_seed + 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 rng(seed);
    std::vector<SharedItem> items;
    for (std::uint64_t seq = 0; seq < 30; ++seq) {
      items.push_back(ItemAt(1 + static_cast<AgentId>(rng() % 3), seq, static_cast<std::int64_t>(rng() % 20),
                             static_cast<std::int64_t>(rng() % 4), 1 + static_cast<std::int64_t>(rng() % 3)));
    }
    const std::size_t pages_max = 4 + rng() % 20;
    std::set<std::size_t> expected;
    for (std::size_t level = 0; level <= pages_max; ++level) {
      std::set<PageKey> all;
      std::set<std::size_t> without_room;
      for (AgentId origin = 1; origin <= 3; ++origin) {
        std::set<PageKey> taken;
        bool is_full = false;
        for (std::size_t i = items.size(); i-- > 0;) {
          if (items[i].origin != origin) continue;
          std::set<PageKey> more = taken;
          for (std::int64_t x = items[i].box.first_x; x <= items[i].box.last_x; x += kPageSideCells) {
            more.insert(PageAt(x, items[i].box.first_y));
          }
          is_full = is_full || more.size() > level;
          if (is_full) without_room.insert(i);
          if (!is_full) taken = std::move(more);
        }
        all.insert(taken.begin(), taken.end());
      }
      if (all.size() <= pages_max) expected = without_room;
    }
    const auto found = FindItemsWithoutRoom(items, pages_max);
    EXPECT_EQ(std::set<std::size_t>(found.begin(), found.end()), expected);
    EXPECT_TRUE(std::is_sorted(found.begin(), found.end()));
  }
}

}  // namespace
}  // namespace moondb
