#include "actors/merge/page_shares.h"

#include <algorithm>
#include <map>
#include <tuple>
#include <unordered_map>
#include <unordered_set>

#include "actors/merge/tile.h"

namespace moondb {
namespace {

// Calls visit(page key) for each page that touches `box`.
template <typename Visit>
void ForEachPage(const CellBox& box, Visit visit) {
  const PageKey first = PageAt(box.first_x, box.first_y);
  const PageKey last = PageAt(box.last_x, box.last_y);
  for (std::int64_t y = first.y; y <= last.y; ++y) {
    for (std::int64_t x = first.x; x <= last.x; ++x) {
      visit(PageKey{static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)});
    }
  }
}

// Returns the number of pages that touch `box`, or a number above `pages_max` if they are more.
std::size_t CountPages(const CellBox& box, std::size_t pages_max) {
  if (box.is_empty()) return 0;
  const auto width = static_cast<std::uint64_t>((box.last_x >> kPageSideBits) - (box.first_x >> kPageSideBits) + 1);
  const auto height = static_cast<std::uint64_t>((box.last_y >> kPageSideBits) - (box.first_y >> kPageSideBits) + 1);
  return width > pages_max || height > pages_max ? pages_max + 1 : static_cast<std::size_t>(width * height);
}

bool AreAllInFewPages(std::span<const SharedItem> items, std::size_t pages_max) {
  CellBox all;
  for (const SharedItem& item : items) all.Add(item.box);
  return CountPages(all, pages_max) <= pages_max;
}

// Number of pages that an item and all newer items of its origin take together.
struct Demand {
  std::size_t item = 0;
  std::size_t pages = 0;
};

using PageLevels = std::unordered_map<PageKey, std::size_t, PageKeyHash>;

// Returns the demands of one origin, the newest item first, up to the first one above pages_max. Lowers the number of
// each page in `levels` to the demand at which this origin takes it.
std::vector<Demand> AddOrigin(std::span<const SharedItem> items, std::vector<std::size_t> of_origin,
                              std::size_t pages_max, PageLevels& levels) {
  std::sort(of_origin.begin(), of_origin.end(), [&items](std::size_t a, std::size_t b) {
    return std::tie(items[a].age, items[a].number) > std::tie(items[b].age, items[b].number);
  });
  std::unordered_set<PageKey, PageKeyHash> taken;
  std::vector<Demand> demands;
  std::vector<PageKey> added;
  for (const std::size_t item : of_origin) {
    added.clear();
    if (!items[item].box.is_empty()) {
      ForEachPage(items[item].box, [&](const PageKey& page) {
        if (taken.insert(page).second) added.push_back(page);
      });
    }
    if (taken.size() > pages_max) break;
    demands.push_back({item, taken.size()});
    for (const PageKey& page : added) {
      std::size_t& level = levels.try_emplace(page, taken.size()).first->second;
      level = std::min(level, taken.size());
    }
  }
  return demands;
}

// Returns the highest level at which the pages of all origins together are within the limit.
std::size_t LevelOf(const PageLevels& levels, std::size_t pages_max) {
  if (levels.size() <= pages_max) return pages_max;
  std::vector<std::size_t> sorted;
  sorted.reserve(levels.size());
  for (const auto& [page, level] : levels) sorted.push_back(level);
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(pages_max), sorted.end());
  return sorted[pages_max] - 1;
}

}  // namespace

std::vector<std::size_t> FindItemsWithoutRoom(std::span<const SharedItem> items, std::size_t pages_max) {
  if (AreAllInFewPages(items, pages_max)) return {};
  std::map<AgentId, std::vector<std::size_t>> origins;
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (CountPages(items[i].box, pages_max) <= pages_max) origins[items[i].origin].push_back(i);
  }
  PageLevels levels;
  std::vector<std::vector<Demand>> demands;
  for (auto& [origin, of_origin] : origins) {
    demands.push_back(AddOrigin(items, std::move(of_origin), pages_max, levels));
  }
  const std::size_t level = LevelOf(levels, pages_max);
  std::vector<bool> has_room(items.size());
  for (const std::vector<Demand>& of_origin : demands) {
    for (const Demand& demand : of_origin) has_room[demand.item] = demand.pages <= level;
  }
  std::vector<std::size_t> without_room;
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (!has_room[i]) without_room.push_back(i);
  }
  return without_room;
}

}  // namespace moondb
