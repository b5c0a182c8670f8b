// Board: the newest version of everything that moondb_view shows. A viewer asks for what changed after the last version
// that it knows, and then fetches each changed part once. So the server holds no queue for a viewer, and a slow viewer
// misses old versions but never the newest one. Thread-safe.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "model/error.h"

namespace moondb {

// The map to which the tiles belong.
struct BoardMap {
  std::uint32_t resolution_um = 0;
  std::uint32_t tile_cells = 0;
  std::string frame_of;  // Name of the rover whose own frame it is, because it is not placed. Empty: the frame `map`.
  bool operator==(const BoardMap&) const = default;
};

class Board {
 public:
  static constexpr std::size_t kTilesMax = 16'384;     // The most that an agent merges.
  static constexpr std::size_t kTilesListedMax = 256;  // In one answer of ChangesJson.
  static constexpr std::size_t kTilesAskedMax = 64;    // In one answer of FindTiles.
  static constexpr std::size_t kTileBytesAskedMax = 512 * 1024;
  using Bytes = std::shared_ptr<const std::string>;  // Compressed by zlib.

  // `instance` names this run: versions of different runs cannot be compared.
  explicit Board(std::string instance) : instance_(std::move(instance)) {}

  // Replaces a part, such as "team". Equal content is no change.
  void Set(const std::string& part, const std::string& json);
  // Begins a new map, without tiles.
  void BeginMap(const BoardMap& map);
  // Replaces the tile of the current map. `cells` holds one byte per cell. Beyond kTilesMax tiles, new ones are
  // ignored.
  void SetTile(std::int64_t x, std::int64_t y, const std::string& cells);

  // Null: there is none.
  Bytes Find(const std::string& part) const;

  // Returns the tiles at these places: for each, its place as two signed 32-bit numbers, little-endian, and its cells.
  // Places without a tile are left out, and so are those beyond kTilesAskedMax tiles or kTileBytesAskedMax cells.
  // Empty if `map_id` is not the id of the current map.
  std::string FindTiles(std::uint64_t map_id, const std::vector<std::pair<std::int64_t, std::int64_t>>& places) const;

  // Returns what changed after version `since`, as JSON (docs/VIEW.md).
  std::string ChangesJson(std::uint64_t since) const;
  std::uint64_t version() const;
  // Waits until the version is larger than `since`, until `end`, or until End is called.
  void WaitForChange(std::uint64_t since, std::chrono::steady_clock::time_point end) const;
  // Ends all waits, now and later.
  void End();

 private:
  using TileKey = std::pair<std::int64_t, std::int64_t>;
  struct Part {
    std::uint64_t version = 0;
    Bytes bytes;
  };

  const std::string instance_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  bool is_ended_ = false;
  std::uint64_t version_ = 0;
  std::map<std::string, Part> parts_;
  std::uint64_t map_id_ = 0;  // 0: no map yet.
  BoardMap map_;
  std::map<TileKey, Part> tiles_;
  std::map<std::uint64_t, TileKey> tiles_by_version_;  // The same tiles as in `tiles_`.
};

// Compress and restore bytes by zlib. Inflate fails with kCorrupt.
std::string Deflate(const std::string& bytes);
Result<std::string> Inflate(const std::string& deflated);

}  // namespace moondb
