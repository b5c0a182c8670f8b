// learn_map_tables: generates actors/sharing/coding/trained_tables_data.cc. These tables are the initial model with
// which each coded run of maps starts.
//
//   learn_map_tables > actors/sharing/coding/trained_tables_data.cc
//
// The training data are generated maps: of lasers in buildings, of cameras on the Moon, and rolling maps
// (bench/rolling_maps.h). The output is part of the wire format (actors/sharing/coding/map_codec.h), so new tables
// require a new wire version (docs/COMPATIBILITY.md).
//
// Takes a minute. After a change of the model's structure, first build this program with an empty string in
// trained_tables_data.cc.
#include <algorithm>
#include <cstdio>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "actors/sharing/coding/map_codec.h"
#include "actors/sharing/coding/trained_tables.h"
#include "apps/moondb_mission/mission_maker.h"
#include "apps/moondb_mission/random.h"
#include "bench/laser_maps.h"
#include "bench/rolling_maps.h"

namespace moondb {
namespace {

// Upper limit of a context's count (BitModel::SetCountLimit). With the highest possible limit, a trained probability is
// an average over many maps.
constexpr std::uint32_t kCountLimit = BitModel::kCountMax;
constexpr int kDrives = 150;
constexpr int kMapsPerDrive = 16;
constexpr int kRollingMaps = 8;
constexpr std::size_t kPieceMaps = 8;
constexpr double kCamera_min = 3;

using Drive = std::vector<TraversabilityMap>;

// Makes one drive for each rover of a generated mission.
std::vector<Drive> MakeCameraDrives(std::uint64_t seed) {
  MissionOptions options;
  options.seed = seed;
  options.minutes = kCamera_min;
  options.terrain.side_m = 30;
  options.terrain.rock_area_share = 0.01 + 0.01 * static_cast<double>(seed % 6);
  const Result<MadeMission> made = MakeMission(options);
  std::vector<Drive> drives(static_cast<std::size_t>(options.rover_count));
  for (std::size_t i = 0; made && i < made->maps.size(); ++i) {
    drives[made->maps[i].node.agent - 1].push_back(made->maps[i]);
  }
  return drives;
}

// Splits a drive into runs of kPieceMaps maps, and appends the runs to `pieces`.
void AddPieces(const Drive& drive, std::vector<Drive>& pieces) {
  for (std::size_t first = 0; first < drive.size(); first += kPieceMaps) {
    const auto begin = drive.begin() + static_cast<std::ptrdiff_t>(first);
    pieces.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(std::min(kPieceMaps, drive.size() - first)));
  }
}

// Returns runs of all kinds of maps in random order. The model adapts most to its last input, so the kinds must be
// mixed.
std::vector<Drive> MakePieces() {
  std::vector<Drive> pieces;
  for (int i = 0; i < kDrives; ++i) {
    const std::uint64_t seed = static_cast<std::uint64_t>(i) + 1;
    AddPieces(MakeLaserMaps(seed, kMapsPerDrive), pieces);
    if (i % 15 == 0) {
      for (const Drive& drive : MakeCameraDrives(seed)) AddPieces(drive, pieces);
    }
    if (i % 30 == 0) {
      RollingOptions rolling;
      rolling.seed = seed;
      rolling.map_count = kRollingMaps;
      AddPieces(MakeRollingMaps(rolling), pieces);
    }
  }
  Random random(1);
  for (std::size_t i = pieces.size(); i > 1; --i) {
    std::swap(pieces[i - 1], pieces[static_cast<std::size_t>(random.Index(static_cast<int>(i)))]);
  }
  return pieces;
}

void Learn(const Drive& drive, MapRunEncoder::Previous previous, BitModel& model) {
  MapRunEncoder encoder(previous);
  encoder.model() = model;
  for (const TraversabilityMap& map : drive) encoder.Add(map.layers);
  model = encoder.model();
}

void Print(std::string_view text) {
  constexpr std::size_t kLineCharacters = 114;
  std::printf("// Made by bench/learn_map_tables.cc; see there. Not to be changed by hand.\n");
  std::printf("#include \"actors/sharing/coding/trained_tables.h\"\n\nnamespace moondb {\n\n");
  std::printf("// clang-format off\nconst std::string_view kTrainedTables =\n");
  while (!text.empty()) {
    const std::string line(text.substr(0, kLineCharacters));
    text.remove_prefix(line.size());
    std::printf("    \"%s\"%s\n", line.c_str(), text.empty() ? ";" : "");
  }
  std::printf("// clang-format on\n\n}  // namespace moondb\n");
}

int Main() {
  const std::vector<Drive> pieces = MakePieces();
  BitModel model;
  model.SetCountLimit(kCountLimit);
  for (const MapRunEncoder::Previous previous :
       {MapRunEncoder::Previous::kNever, MapRunEncoder::Previous::kWherePlaced}) {
    for (const Drive& drive : pieces) Learn(drive, previous, model);
  }
  Print(WriteTables(model));
  return 0;
}

}  // namespace
}  // namespace moondb

int main() { return moondb::Main(); }
