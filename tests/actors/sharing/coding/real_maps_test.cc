// Compares two codings of the maps in recorded missions (folder MOONDB_DATA): the map codec, and zstd of cells packed
// into 2 bits each.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <map>

#include "actors/sharing/coding/map_codec.h"
#include "actors/sharing/coding/zstd_frame.h"
#include "model/mission.h"

namespace moondb {
namespace {

using Previous = MapRunEncoder::Previous;
using Layers = std::vector<MapLayer>;

struct Sizes {
  std::size_t packed = 0, single = 0, batch = 0, previous = 0;
};

std::map<AgentId, std::vector<Layers>> ReadMaps(const std::filesystem::path& folder) {
  std::map<AgentId, std::vector<Layers>> maps;
  const Result<Mission> mission = ReadMission(folder);
  EXPECT_TRUE(mission) << folder;
  for (std::size_t i = 0; mission && i < mission->maps.size(); ++i) {
    const Result<TraversabilityMap> map = ReadMissionMap(*mission, mission->maps[i]);
    EXPECT_TRUE(map);
    if (map) maps[mission->maps[i].agent].push_back(map->layers);
  }
  return maps;
}

std::size_t PackedSize(const Layers& layers) {
  std::string cells;
  for (const MapLayer& layer : layers) cells += PackCells(layer.grid);
  return CompressFrame(cells, FrameChecksum::kNone)->size();
}

void ExpectDecodes(const std::string& coded, const std::vector<Layers>& maps) {
  std::vector<Layers> decoded = maps;
  std::vector<Layers*> pointers;
  for (Layers& map : decoded) {
    for (MapLayer& layer : map) layer.grid.cells.clear();
    pointers.push_back(&map);
  }
  MapRunDecoder decoder;
  ASSERT_TRUE(decoder.Decode(coded, pointers));
  for (std::size_t i = 0; i < maps.size(); ++i) {
    for (std::size_t layer = 0; layer < maps[i].size(); ++layer) {
      ASSERT_TRUE(decoded[i][layer].grid == maps[i][layer].grid);
    }
  }
}

std::size_t RunSize(const std::vector<Layers>& maps, Previous previous) {
  MapRunEncoder encoder(previous);
  for (const Layers& map : maps) encoder.Add(map);
  const std::string coded = encoder.Finish();
  if (previous == Previous::kWhereItPays) ExpectDecodes(coded, maps);
  return coded.size();
}

void Measure(const std::vector<Layers>& maps, Sizes& sizes) {
  for (std::size_t i = 0; i < maps.size(); ++i) {
    sizes.packed += PackedSize(maps[i]);
    sizes.single += RunSize({maps[i]}, Previous::kNever);
  }
  for (std::size_t i = 0; i < maps.size(); i += kRunMapsMax) {
    const auto begin = maps.begin() + static_cast<std::ptrdiff_t>(i);
    const std::vector<Layers> run(begin, begin + static_cast<std::ptrdiff_t>(std::min(kRunMapsMax, maps.size() - i)));
    sizes.batch += RunSize(run, Previous::kNever);
    sizes.previous += RunSize(run, Previous::kWhereItPays);
  }
}

TEST(RealMapsTest, NeedLessThanAThirdOfTheBytesOfPackedCells) {
  const char* data = std::getenv("MOONDB_DATA");
  if (data == nullptr) GTEST_SKIP() << "MOONDB_DATA is not set";
  Sizes sizes;
  for (const char* name : {"intel_team", "orebro_team"}) {
    for (const auto& [agent, maps] : ReadMaps(std::filesystem::path(data) / name)) Measure(maps, sizes);
  }
  const auto share = [&](std::size_t size) { return static_cast<double>(size) / static_cast<double>(sizes.packed); };
  std::cout << "of packed cells with zstd: single " << share(sizes.single) << ", in runs " << share(sizes.batch)
            << ", with the previous map " << share(sizes.previous) << "\n";
  EXPECT_LE(share(sizes.single), 0.29);
  EXPECT_LE(share(sizes.batch), 0.27);
  EXPECT_LE(share(sizes.previous), 0.25);
}

}  // namespace
}  // namespace moondb
