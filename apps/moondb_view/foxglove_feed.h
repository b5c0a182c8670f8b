// FoxgloveFeed: puts what AgentWatch reads into Channels. Thread-safe.
#pragma once

#include <map>
#include <mutex>
#include <set>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "apps/moondb_view/channels.h"
#include "apps/moondb_view/foxglove_messages.h"
#include "client/merged_map.h"

namespace moondb {

class FoxgloveFeed {
 public:
  // One Grid for each square of this many cells, because a Grid replaces the previous one of its topic.
  static constexpr std::int64_t kBlockCells = 256;

  // Requires: `channels` and `team` outlive the feed.
  FoxgloveFeed(Channels& channels, const proto::TeamConfig& team);

  void SetTeam(const std::string& json);
  void SetGraph(const GraphView& view);
  // Adds the events of `newest`, the oldest last, that the last list did not have.
  void AddEvents(const std::vector<EventView>& newest);
  // Begins a new map. `frame_of` as in MergedTiles.
  void BeginMap(AgentId frame_of);
  void SetTiles(const std::vector<MergedTile>& tiles);

 private:
  using Place = std::pair<std::int64_t, std::int64_t>;

  Channels& channels_;
  const proto::TeamConfig& team_;
  std::mutex mutex_;
  std::string map_frame_ = kMapFrameId;
  std::map<Place, CellBlock> blocks_;
  std::set<std::tuple<std::int64_t, AgentId, std::string>> known_events_;  // Events of the last list.
  std::uint32_t status_ = 0;
  std::uint32_t transforms_ = 0;
  std::uint32_t poses_ = 0;
  std::uint32_t scene_ = 0;
  std::uint32_t log_ = 0;
};

}  // namespace moondb
