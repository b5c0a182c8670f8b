#include "apps/moondb_view/board.h"

#include <zlib.h>

#include <array>
#include <chrono>

#include "apps/common/json_writer.h"
#include "apps/mcap/little_endian.h"

namespace moondb {

std::string Deflate(const std::string& bytes) {
  uLongf size = compressBound(bytes.size());
  std::string deflated(size, '\0');
  const int done = compress2(reinterpret_cast<Bytef*>(deflated.data()), &size,
                             reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(), Z_DEFAULT_COMPRESSION);
  deflated.resize(done == Z_OK ? size : 0);  // Fails only if memory is exhausted.
  return deflated;
}

Result<std::string> Inflate(const std::string& deflated) {
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return Fail(ErrorCode::kInternal, "zlib does not start");
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(deflated.data()));
  stream.avail_in = static_cast<uInt>(deflated.size());
  std::string bytes;
  std::array<char, 16'384> part{};
  int done = Z_OK;
  while (done == Z_OK) {
    stream.next_out = reinterpret_cast<Bytef*>(part.data());
    stream.avail_out = static_cast<uInt>(part.size());
    done = inflate(&stream, Z_NO_FLUSH);
    bytes.append(part.data(), part.size() - stream.avail_out);
  }
  (void)inflateEnd(&stream);
  if (done != Z_STREAM_END) return Fail(ErrorCode::kCorrupt, "the compressed bytes are damaged");
  return bytes;
}

void Board::Set(const std::string& name, const std::string& json) {
  auto bytes = std::make_shared<const std::string>(Deflate(json));
  const std::lock_guard lock(mutex_);
  Part& part = parts_[name];
  if (part.bytes != nullptr && *part.bytes == *bytes) return;
  part = {++version_, std::move(bytes)};
  changed_.notify_all();
}

void Board::BeginMap(const BoardMap& map) {
  const std::lock_guard lock(mutex_);
  map_ = map;
  map_id_ = ++version_;
  tiles_.clear();
  tiles_by_version_.clear();
  changed_.notify_all();
}

void Board::SetTile(std::int64_t x, std::int64_t y, const std::string& cells) {
  auto bytes = std::make_shared<const std::string>(Deflate(cells));
  const std::lock_guard lock(mutex_);
  const TileKey key(x, y);
  if (tiles_.size() >= kTilesMax && !tiles_.contains(key)) return;
  Part& tile = tiles_[key];
  tiles_by_version_.erase(tile.version);
  tile = {++version_, std::move(bytes)};
  tiles_by_version_[version_] = key;
  changed_.notify_all();
}

Board::Bytes Board::Find(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto part = parts_.find(name);
  return part == parts_.end() ? nullptr : part->second.bytes;
}

std::string Board::FindTiles(std::uint64_t map_id, const std::vector<TileKey>& places) const {
  std::vector<std::pair<TileKey, Bytes>> found;
  {
    const std::lock_guard lock(mutex_);
    if (map_id != map_id_) return "";
    for (const TileKey& place : places) {
      const auto tile = tiles_.find(place);
      if (tile != tiles_.end() && found.size() < kTilesAskedMax) found.emplace_back(place, tile->second.bytes);
    }
  }
  std::string answer;
  for (const auto& [place, bytes] : found) {
    const Result<std::string> cells = Inflate(*bytes);
    if (!cells || answer.size() + cells->size() > kTileBytesAskedMax) continue;
    AppendLittleEndian(static_cast<std::int32_t>(place.first), answer);
    AppendLittleEndian(static_cast<std::int32_t>(place.second), answer);
    answer += *cells;
  }
  return answer;
}

std::string Board::ChangesJson(std::uint64_t since) const {
  const std::lock_guard lock(mutex_);
  JsonWriter json;
  json.BeginObject().Key("instance").String(instance_);
  // Tiles are listed in the order of their versions. If not all fit, the next request continues after the last one.
  std::uint64_t listed = version_;
  std::size_t count = 0;
  json.Key("tiles").BeginArray();
  for (auto tile = tiles_by_version_.upper_bound(since); tile != tiles_by_version_.end(); ++tile) {
    if (count++ == kTilesListedMax) {
      listed = std::prev(tile)->first;
      break;
    }
    const auto& [x, y] = tile->second;
    json.BeginArray().Number(static_cast<double>(x)).Number(static_cast<double>(y));
    json.Number(static_cast<double>(tile->first)).EndArray();
  }
  json.EndArray().Key("is_more").Bool(listed != version_).Key("version").Number(static_cast<double>(listed));
  json.Key("resources").BeginObject();
  for (const auto& [name, part] : parts_) {
    if (part.version > since) json.Key(name).Number(static_cast<double>(part.version));
  }
  json.EndObject().Key("map");
  if (map_id_ == 0) return json.Null().EndObject().text();
  json.BeginObject().Key("id").Number(static_cast<double>(map_id_)).Key("resolution_um").Number(map_.resolution_um);
  json.Key("tile_cells").Number(map_.tile_cells).Key("frame_of").String(map_.frame_of).EndObject();
  return json.EndObject().text();
}

std::uint64_t Board::version() const {
  const std::lock_guard lock(mutex_);
  return version_;
}

void Board::WaitForChange(std::uint64_t since, std::chrono::steady_clock::time_point end) const {
  std::unique_lock lock(mutex_);
  changed_.wait_until(lock, end, [&] { return is_ended_ || version_ > since; });
}

void Board::End() {
  const std::lock_guard lock(mutex_);
  is_ended_ = true;
  changed_.notify_all();
}

}  // namespace moondb
