#include "actors/merge/merger.h"

#include <algorithm>
#include <bit>
#include <iterator>
#include <string>
#include <tuple>
#include <utility>

#include "actors/merge/cpu_gather.h"
#include "actors/merge/page_shares.h"
#include "model/check.h"

namespace moondb {
namespace {

bool HasTile(const Page& page) {
  return std::any_of(page.tiles.begin(), page.tiles.end(), [](const auto& tile) { return tile != nullptr; });
}

}  // namespace

Merger::Merger(const MergeGrid& grid, std::shared_ptr<GatherBackend> backend)
    : grid_(grid), backend_(std::move(backend)) {
  Check(CheckGrid(grid_).has_value(), "the grid was checked");
  Check(backend_ != nullptr, "a merger has a backend");
}

Merger::~Merger() = default;

void Merger::Retire(Thing thing) {
  if (added_.erase(thing.get()) > 0) return;  // The item was added after the last merge, so no tile refers to it.
  thing->is_retired = true;
  retired_.push_back(std::move(thing));
}

Result<void> Merger::Put(const PlacedMap& placed) {
  Thing& held = maps_[placed.map->key];
  if (held != nullptr && held->placed.map == placed.map &&
      AreSamePose(held->placed.map_from_node, placed.map_from_node)) {
    return {};
  }
  Result<Thing> thing = PlaceMap(placed, grid_);
  if (!thing) {
    if (held == nullptr) maps_.erase(placed.map->key);
    return tl::unexpected(thing.error());
  }
  if (held != nullptr) Retire(std::move(held));
  held = std::move(*thing);
  added_.insert(held.get());
  return {};
}

bool Merger::Withdraw(const RecordKey& key) {
  const auto found = maps_.find(key);
  if (found == maps_.end()) return false;
  Retire(std::move(found->second));
  maps_.erase(found);
  return true;
}

Result<void> Merger::PutFootprint(const Footprint& footprint) {
  const auto found = footprints_.find(footprint.node);
  if (found != footprints_.end() && AreSamePose(found->second->placed.map_from_node, footprint.map_from_node)) {
    found->second->age = AgeOf(footprint.record);
    return {};
  }
  Result<Thing> thing = PlaceFootprint(footprint, grid_);
  if (!thing) return tl::unexpected(thing.error());
  (*thing)->age = AgeOf(footprint.record);
  WithdrawFootprint(footprint.node);
  added_.insert(thing->get());
  footprints_.emplace(footprint.node, std::move(*thing));
  return {};
}

bool Merger::WithdrawFootprint(const NodeKey& node) {
  const auto found = footprints_.find(node);
  if (found == footprints_.end()) return false;
  Retire(std::move(found->second));
  footprints_.erase(found);
  return true;
}

std::vector<Error> Merger::Assign(std::span<const PlacedMap> maps, std::span<const Footprint> footprints) {
  std::map<RecordKey, const PlacedMap*> wanted_maps;
  for (const PlacedMap& placed : maps) wanted_maps.emplace(placed.map->key, &placed);
  std::map<NodeKey, const Footprint*> wanted_footprints;
  for (const Footprint& footprint : footprints) wanted_footprints.emplace(footprint.node, &footprint);

  std::vector<RecordKey> gone_maps;
  for (const auto& [key, thing] : maps_) {
    if (!wanted_maps.contains(key)) gone_maps.push_back(key);
  }
  for (const RecordKey& key : gone_maps) Withdraw(key);
  std::vector<NodeKey> gone_footprints;
  for (const auto& [node, thing] : footprints_) {
    if (!wanted_footprints.contains(node)) gone_footprints.push_back(node);
  }
  for (const NodeKey& node : gone_footprints) WithdrawFootprint(node);

  // An item that cannot be placed at its new pose is withdrawn from its old pose too.
  std::vector<Error> refused;
  for (const auto& [key, placed] : wanted_maps) {
    const Result<void> put = Put(*placed);
    if (put) continue;
    Withdraw(key);
    refused.push_back({put.error().code, "map " + ToString(key) + ": " + put.error().text, put.error().field});
  }
  for (const auto& [node, footprint] : wanted_footprints) {
    const Result<void> put = PutFootprint(*footprint);
    if (put) continue;
    WithdrawFootprint(node);
    refused.push_back({put.error().code, "footprint: " + put.error().text, put.error().field});
  }
  WithdrawItemsWithoutRoom();
  return refused;
}

void Merger::WithdrawItemsWithoutRoom() {
  std::vector<SharedItem> items;
  items.reserve(maps_.size() + footprints_.size());
  for (const auto& [key, thing] : maps_) items.push_back({key.stream.origin, thing->age, 0, thing->extent});
  for (const auto& [node, thing] : footprints_) items.push_back({node.agent, thing->age, node.index, thing->extent});
  without_room_.clear();
  auto map = maps_.begin();
  auto footprint = footprints_.begin();
  std::size_t at = 0;  // Index of `map`, or of `footprint` once all maps are passed.
  const std::size_t map_count = maps_.size();
  for (const std::size_t index : FindItemsWithoutRoom(items, grid_.pages_max)) {
    ++without_room_[items[index].origin];
    for (; at < index; ++at) at < map_count ? (void)++map : (void)++footprint;
    ++at;
    if (index < map_count) {
      Retire(std::move(map->second));
      map = maps_.erase(map);
    } else {
      Retire(std::move(footprint->second));
      footprint = footprints_.erase(footprint);
    }
  }
}

Result<MergeSummary> Merger::Merge(const StopPredicate& stop) {
  MergeSummary summary;
  if (!added_.empty() || !retired_.empty() || is_everything_due_) {
    summary.is_full = is_everything_due_ || IsMostlyNew();
    UpdateExtent();
    UpdateOrder();
    if (summary.is_full) {
      MarkEverything();
    } else {
      MarkDirty();
    }
    added_.clear();
    std::move(retired_.begin(), retired_.end(), std::back_inserter(buried_));
    retired_.clear();
  }
  if (!dirty_.empty()) {
    Result<std::vector<GatherWork>> works = MakeWorks();
    is_everything_due_ = !works;
    if (!works) {
      dirty_.clear();
      FreeBuried();
      return tl::unexpected(works.error());
    }
    ++version_;
    const Result<void> gathered = backend_->Gather(order_, *works, stop);
    ObserveChanges(*works, summary);
    if (!gathered) return tl::unexpected(gathered.error());
    dirty_.clear();
  }
  buried_.clear();
  summary.version = version_;
  return summary;
}

// Returns true if gathering all tiles is cheaper than finding the affected tiles. With many changes, the search would
// examine the same tile many times. Examining a tile costs about 1/16 of gathering it.
bool Merger::IsMostlyNew() const {
  const std::size_t changes = added_.size() + retired_.size();
  if (changes > 8 && changes > (maps_.size() + footprints_.size()) / 2) return true;
  std::int64_t looks = 0;
  const auto count = [&looks](const PlacedThing& thing) {
    looks += (thing.extent.width() / kTileSideCells + 1) * (thing.extent.height() / kTileSideCells + 1);
  };
  for (const PlacedThing* thing : added_) count(*thing);
  for (const Thing& thing : retired_) count(*thing);
  constexpr std::int64_t kLooksForATile = 16;
  return changes > 8 && looks > kLooksForATile * static_cast<std::int64_t>(pages_.size() * kTilesInPage);
}

void Merger::UpdateExtent() {
  if (retired_.empty()) {
    for (const PlacedThing* thing : added_) extent_.Add(thing->extent);
    return;
  }
  extent_ = {};
  for (const auto& [key, thing] : maps_) extent_.Add(thing->extent);
  for (const auto& [node, thing] : footprints_) extent_.Add(thing->extent);
}

void Merger::UpdateOrder() {
  if (!retired_.empty()) {
    std::erase_if(order_, [](const OrderedBlock& ordered) { return ordered.block->owner->is_retired; });
  }
  const auto first_added = static_cast<std::ptrdiff_t>(order_.size());
  for (PlacedThing* thing : added_) {
    for (PlacedBlock& block : thing->blocks) order_.push_back({block.rectangle.box, &block});
  }
  const auto above = [](const OrderedBlock& a, const OrderedBlock& b) { return StandsAbove(*a.block, *b.block); };
  std::sort(order_.begin() + first_added, order_.end(), above);
  std::inplace_merge(order_.begin(), order_.begin() + first_added, order_.end(), above);
  std::uint32_t rank = 0;
  for (const OrderedBlock& ordered : order_) ordered.block->rank = rank++;
}

void Merger::MarkDirty() {
  for (const Thing& thing : retired_) MarkWins(*thing);
  for (const PlacedThing* thing : added_) {
    // With more than pages_max dirty pages, MakeWorks marks all tiles. Stop early.
    if (dirty_.size() > grid_.pages_max) return;
    MarkGains(*thing);
  }
}

// Frees the withdrawn maps and footprints in buried_, except those that a tile still refers to.
void Merger::FreeBuried() {
  std::unordered_set<const PlacedThing*> named;
  for (const auto& [key, page] : pages_) {
    for (const std::unique_ptr<Tile>& tile : page->tiles) {
      if (tile == nullptr) continue;
      for (const PlacedBlock* block : tile->blocks) named.insert(block->owner);
    }
  }
  std::erase_if(buried_, [&named](const Thing& thing) { return !named.contains(thing.get()); });
}

// Drops pages without a known cell.
void Merger::ForgetEmptyPages() {
  std::erase_if(pages_, [](const auto& entry) { return !HasTile(*entry.second); });
  ++forgotten_;
}

// Marks the tiles in which `retired` won a cell.
void Merger::MarkWins(const PlacedThing& retired) {
  ForEachTile(retired.extent, [&](const PageKey& key, std::size_t index, const CellBox&) {
    const Page* page = FindPage(key);
    if (page == nullptr || page->tiles[index] == nullptr) return;
    const auto& blocks = page->tiles[index]->blocks;
    const auto is_its = [&retired](const PlacedBlock* block) { return block->owner == &retired; };
    if (std::any_of(blocks.begin(), blocks.end(), is_its)) dirty_[key] |= static_cast<std::uint16_t>(1 << index);
  });
}

// Marks the tiles in which `added` may win a cell.
void Merger::MarkGains(const PlacedThing& added) {
  for (const PlacedBlock& block : added.blocks) {
    ForEachTile(block.rectangle.box, [&](const PageKey& key, std::size_t index, const CellBox& box) {
      const auto bit = static_cast<std::uint16_t>(1 << index);
      const auto dirty = dirty_.find(key);
      if (dirty != dirty_.end() && (dirty->second & bit) != 0) return;
      const Page* page = FindPage(key);
      const Tile* tile = page == nullptr ? nullptr : page->tiles[index].get();
      if (WouldWinIn(block, box, tile)) dirty_[key] |= bit;
    });
  }
}

void Merger::MarkEverything() {
  for (const auto& [key, page] : pages_) {
    if (HasTile(*page)) dirty_[key] = UINT16_MAX;
  }
  for (const OrderedBlock& ordered : order_) {
    // With more than pages_max dirty pages, MakeWorks fails. Stop early.
    if (dirty_.size() > grid_.pages_max) return;
    const CellBox& box = ordered.box;
    const PageKey first = PageAt(box.first_x, box.first_y);
    const PageKey last = PageAt(box.last_x, box.last_y);
    for (std::int64_t y = first.y; y <= last.y; ++y) {
      for (std::int64_t x = first.x; x <= last.x; ++x) {
        dirty_[{static_cast<std::int32_t>(x), static_cast<std::int32_t>(y)}] = UINT16_MAX;
      }
    }
  }
}

// Drops all pages and marks all tiles. Old and new pages together would exceed the limit if, for example, all maps have
// moved. Returns false, and changes nothing but dirty_, if the present maps and footprints alone exceed the limit.
bool Merger::StartOver() {
  auto old_pages = std::exchange(pages_, {});
  dirty_.clear();
  MarkEverything();
  if (dirty_.size() > grid_.pages_max) {
    pages_ = std::move(old_pages);
    return false;
  }
  ++forgotten_;
  return true;
}

Page* Merger::FindPage(const PageKey& key) const {
  const auto found = pages_.find(key);
  return found == pages_.end() ? nullptr : found->second.get();
}

// Returns one work item per dirty page. Items of neighbouring pages are adjacent, because backends cache the block list
// of a region of pages.
Result<std::vector<GatherWork>> Merger::MakeWorks() {
  const auto is_new = [this](const auto& dirty) { return !pages_.contains(dirty.first); };
  const auto count_pages = [&] {
    return pages_.size() + static_cast<std::size_t>(std::count_if(dirty_.begin(), dirty_.end(), is_new));
  };
  if (count_pages() > grid_.pages_max) ForgetEmptyPages();
  if (count_pages() > grid_.pages_max && !StartOver()) {
    return Fail(ErrorCode::kFull, "the maps cover more than " + std::to_string(grid_.pages_max) +
                                      " pages of 256 x 256 cells: merge fewer agents or coarser");
  }
  std::vector<GatherWork> works;
  works.reserve(dirty_.size());
  for (const auto& [key, tiles] : dirty_) {
    std::unique_ptr<Page>& page = pages_[key];
    if (page == nullptr) page = std::make_unique<Page>();
    works.push_back({key, page.get(), tiles, 0});
  }
  const auto place = [](const GatherWork& work) {
    return std::tuple(work.key.y >> 3, work.key.x >> 3, work.key.y, work.key.x);
  };
  std::sort(works.begin(), works.end(), [&](const auto& a, const auto& b) { return place(a) < place(b); });
  return works;
}

void Merger::ObserveChanges(std::span<const GatherWork> works, MergeSummary& summary) {
  for (const GatherWork& work : works) {
    summary.gathered_tiles += static_cast<std::size_t>(std::popcount(work.tiles));
    summary.changed_tiles += static_cast<std::size_t>(std::popcount(work.changed));
    for (std::size_t tile = 0; tile < kTilesInPage; ++tile) {
      if ((work.changed >> tile & 1) != 0) work.page->versions[tile] = version_;
    }
    const auto is_nothing = [](std::uint64_t version) { return version == 0; };
    if (std::all_of(work.page->versions.begin(), work.page->versions.end(), is_nothing)) pages_.erase(work.key);
  }
}

}  // namespace moondb
