#include "apps/moondb_view/foxglove_feed.h"

#include <algorithm>
#include <set>

#include "apps/common/utc.h"
#include "model/agent_name.h"

namespace moondb {
namespace {

constexpr char kMapTopics[] = "/map/";

template <typename Message>
Channel ChannelOf(const std::string& topic) {
  const auto& descriptor = *Message::descriptor();
  return {0, topic, "protobuf", descriptor.full_name(), SchemaOf(descriptor)};
}

std::int64_t FloorDiv(std::int64_t value, std::int64_t divisor) {
  return value / divisor - (value % divisor < 0 ? 1 : 0);
}

}  // namespace

FoxgloveFeed::FoxgloveFeed(Channels& channels, const proto::TeamConfig& team)
    : channels_(channels),
      team_(team),
      status_(channels.Open({0, "/moondb/team", "json", "moondb.team", R"({"type":"object"})"})),
      transforms_(channels.Open(ChannelOf<foxglove::FrameTransforms>("/tf"))),
      poses_(channels.Open(ChannelOf<foxglove::PosesInFrame>("/poses"))),
      scene_(channels.Open(ChannelOf<foxglove::SceneUpdate>("/graph"))),
      log_(channels.Open(ChannelOf<foxglove::Log>("/events"))) {}

void FoxgloveFeed::SetTeam(const std::string& json) { channels_.Set(status_, UtcNowNs(), json); }

void FoxgloveFeed::SetGraph(const GraphView& view) {
  const std::int64_t now_ns = UtcNowNs();
  channels_.Set(transforms_, now_ns, TransformsOf(team_, view).SerializeAsString());
  channels_.Set(poses_, now_ns, PosesOf(view).SerializeAsString());
  channels_.Set(scene_, now_ns, SceneOf(team_, view, now_ns).SerializeAsString());
}

void FoxgloveFeed::AddEvents(const std::vector<EventView>& newest) {
  const std::lock_guard lock(mutex_);
  std::set<std::tuple<std::int64_t, AgentId, std::string>> events;
  for (auto event = newest.rbegin(); event != newest.rend(); ++event) {
    const auto name = std::tuple(event->timestamp_ns, event->agent, event->text);
    events.insert(name);
    if (known_events_.contains(name)) continue;
    channels_.Append(log_, event->timestamp_ns, LogOf(AgentName(team_, event->agent), *event).SerializeAsString());
  }
  known_events_ = std::move(events);
}

void FoxgloveFeed::BeginMap(AgentId frame_of) {
  const std::lock_guard lock(mutex_);
  blocks_.clear();
  channels_.Close(kMapTopics);
  map_frame_ = frame_of == 0 ? kMapFrameId : AgentName(team_, frame_of) + "/map";
}

void FoxgloveFeed::SetTiles(const std::vector<MergedTile>& tiles) {
  const std::lock_guard lock(mutex_);
  std::set<Place> changed;
  for (const MergedTile& tile : tiles) {
    const std::int64_t side = tile.map.grid.width;
    if (side <= 0 || kBlockCells % side != 0) continue;
    const Place first{tile.x * side, tile.y * side};  // The tile's first cell.
    const Place place{FloorDiv(first.first, kBlockCells), FloorDiv(first.second, kBlockCells)};
    CellBlock& block = blocks_[place];
    if (block.cells.empty()) {
      block = {place.first * kBlockCells, place.second * kBlockCells, kBlockCells, tile.map.resolution_um,
               std::string(kBlockCells * kBlockCells, '\0')};
    }
    for (std::int64_t row = 0; row < side; ++row) {
      const std::int64_t at =
          (first.second - block.origin_cell_y + row) * kBlockCells + first.first - block.origin_cell_x;
      std::copy_n(reinterpret_cast<const char*>(tile.map.grid.cells.data()) + row * side, side,
                  block.cells.data() + at);
    }
    changed.insert(place);
  }
  const std::int64_t now_ns = UtcNowNs();
  for (const Place& place : changed) {
    const std::string topic = kMapTopics + std::to_string(place.first) + "_" + std::to_string(place.second);
    Channel described = ChannelOf<foxglove::Grid>(topic);
    described.is_bulk = true;
    const std::uint32_t channel = channels_.Open(std::move(described));
    channels_.Set(channel, now_ns, GridOf(blocks_[place], map_frame_, now_ns).SerializeAsString());
  }
}

}  // namespace moondb
