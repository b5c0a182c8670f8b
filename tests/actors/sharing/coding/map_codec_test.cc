#include "actors/sharing/coding/map_codec.h"

#include <gtest/gtest.h>
#include <xxhash.h>

#include <numbers>
#include <random>

#include "drawn_maps.h"

namespace moondb {
namespace {

using Previous = MapRunEncoder::Previous;

Layers WithoutCells(Layers layers) {
  for (MapLayer& layer : layers) layer.grid.cells.clear();
  return layers;
}

std::string Encode(const std::vector<Layers>& maps, Previous previous, const Layers* reference = nullptr) {
  MapRunEncoder encoder(previous, reference);
  for (const Layers& map : maps) encoder.Add(map);
  return encoder.Finish();
}

Result<void> Decode(MapRunDecoder& decoder, std::string_view coded, std::vector<Layers>& maps) {
  std::vector<Layers*> pointers;
  for (Layers& map : maps) {
    map = WithoutCells(std::move(map));
    pointers.push_back(&map);
  }
  return decoder.Decode(coded, pointers);
}

void ExpectSame(const std::vector<Layers>& decoded, const std::vector<Layers>& maps) {
  for (std::size_t i = 0; i < maps.size(); ++i) {
    for (std::size_t layer = 0; layer < maps[i].size(); ++layer) {
      ASSERT_TRUE(decoded[i][layer].grid == maps[i][layer].grid) << "map " << i << ", layer " << layer;
    }
  }
}

void ExpectRoundTrip(const std::vector<Layers>& maps, Previous previous, const Layers* reference = nullptr) {
  const std::string coded = Encode(maps, previous, reference);
  MapRunDecoder decoder(reference);
  std::vector<Layers> decoded = maps;
  const Result<void> done = Decode(decoder, coded, decoded);
  ASSERT_TRUE(done) << ToString(done.error());
  ExpectSame(decoded, maps);
}

std::vector<Layers> Drive(int count, double step_m = 0.4, double turn_rad = 0.4) {
  std::vector<Layers> maps;
  for (int i = 0; i < count; ++i) maps.push_back(RoomMap(5, -2 + i * step_m, 0.3 * i * step_m, i * turn_rad));
  return maps;
}

TEST(MapCodecTest, RestoresAdversarialMaps) {
  for (const Layers& map : AdversarialMaps()) ExpectRoundTrip({map}, Previous::kNever);
  ExpectRoundTrip(AdversarialMaps(), Previous::kNever);
  ExpectRoundTrip(AdversarialMaps(), Previous::kWherePlaced);
}

TEST(MapCodecTest, RestoresTenThousandRandomMaps) {
  const unsigned seed = 31;
  SCOPED_TRACE(seed);
  std::mt19937_64 rng(seed);
  constexpr int kMapsPerString = 40;  // More than kRunMapsMax, the limit of maps in a compression run.
  for (int string = 0; string < 250; ++string) {
    std::vector<Layers> maps;
    for (int i = 0; i < kMapsPerString; ++i) maps.push_back(RandomMap(rng));
    ExpectRoundTrip(maps, string % 4 == 0 ? Previous::kWherePlaced : Previous::kNever);
    if (HasFatalFailure()) FAIL() << "string " << string;
  }
}

TEST(MapCodecTest, ContinuesARunFromStringToString) {
  const std::vector<Layers> maps = Drive(40);
  MapRunEncoder encoder(Previous::kWhereItPays);
  MapRunDecoder decoder;
  for (std::size_t i = 0; i < maps.size(); i += 5) {
    std::vector<Layers> some(maps.begin() + static_cast<std::ptrdiff_t>(i),
                             maps.begin() + static_cast<std::ptrdiff_t>(i) + 5);
    for (const Layers& map : some) encoder.Add(map);
    std::vector<Layers> decoded = some;
    const Result<void> done = Decode(decoder, encoder.Finish(), decoded);
    ASSERT_TRUE(done) << ToString(done.error());
    ExpectSame(decoded, some);
  }
}

TEST(MapCodecTest, LearnsThroughARun) {
  const std::vector<Layers> maps = Drive(16);
  std::size_t alone = 0;
  for (const Layers& map : maps) alone += Encode({map}, Previous::kNever).size();
  EXPECT_LT(Encode(maps, Previous::kNever).size(), alone * 19 / 20);
}

TEST(MapCodecTest, GainsFromThePreviousMapThoughTheRobotTurns) {
  const std::vector<Layers> maps = Drive(8);
  EXPECT_LT(Encode(maps, Previous::kWhereItPays).size(), Encode(maps, Previous::kNever).size() * 9 / 10);
}

TEST(MapCodecTest, IgnoresThePreviousMapIfItDoesNotPay) {
  const std::vector<Layers> maps = {RoomMap(1, 0, 0, 0), RoomMap(2, 1, 1, 0)};
  EXPECT_LE(Encode(maps, Previous::kWhereItPays).size(), Encode(maps, Previous::kNever).size());
}

TEST(MapCodecTest, UsesTheNewestMapOfTheSameSourceAsThePreviousMap) {
  const std::vector<Layers> mine = Drive(6);
  const auto size_with = [&](bool are_sources_stated) {
    MapRunEncoder encoder(Previous::kWhereItPays);
    for (std::size_t i = 0; i < mine.size(); ++i) {
      encoder.Add(mine[i], 1);
      encoder.Add(RoomMap(100 + i, 1, 1, 2), are_sources_stated ? 2 : 1);
    }
    return encoder.Finish().size();
  };
  EXPECT_LT(size_with(true), size_with(false));
}

TEST(MapCodecTest, GainsFromAMapThatBothEndsHold) {
  const std::vector<Layers> maps = Drive(2);
  const std::size_t alone = Encode({maps[1]}, Previous::kWhereItPays).size();
  EXPECT_LT(Encode({maps[1]}, Previous::kWhereItPays, &maps[0]).size(), alone * 19 / 20);
  ExpectRoundTrip({maps[1]}, Previous::kWhereItPays, &maps[0]);
}

TEST(MapCodecTest, RefusesAReferenceThatIsNotHeld) {
  const std::vector<Layers> maps = Drive(2);
  const std::string coded = Encode({maps[1]}, Previous::kWherePlaced, &maps[0]);
  MapRunDecoder decoder;
  std::vector<Layers> decoded = {maps[1]};
  EXPECT_FALSE(Decode(decoder, coded, decoded));
}

TEST(MapCodecTest, RefusesAStringOutOfOrder) {
  const std::vector<Layers> maps = Drive(3);
  MapRunEncoder encoder(Previous::kNever);
  encoder.Add(maps[0]);
  encoder.Finish();
  encoder.Add(maps[1]);
  MapRunDecoder decoder;
  std::vector<Layers> decoded = {maps[1]};
  EXPECT_FALSE(Decode(decoder, encoder.Finish(), decoded));
  std::vector<Layers> nothing;
  EXPECT_FALSE(Decode(decoder, "", nothing)) << "the run is over";
}

TEST(MapCodecTest, RefusesNearlyEveryTruncationAndDamage) {
  const std::vector<Layers> maps = {RoomMap(3, 0, 0, 1)};
  const std::string coded = Encode(maps, Previous::kNever);
  int accepted = 0;
  const auto try_it = [&](const std::string& bytes) {
    MapRunDecoder decoder;
    std::vector<Layers> decoded = maps;
    if (Decode(decoder, bytes, decoded)) ++accepted;
  };
  for (std::size_t size = 0; size < coded.size(); ++size) try_it(coded.substr(0, size));
  for (std::size_t i = 0; i < coded.size(); ++i) {
    std::string damaged = coded;
    damaged[i] = static_cast<char>(damaged[i] ^ (1 << i % 8));
    try_it(damaged);
  }
  try_it(coded + "behind");
  EXPECT_LE(accepted, 1) << "of some hundreds, with 16 bits of checksum";
}

TEST(MapCodecTest, RefusesSizesBeyondItsLimits) {
  std::vector<Layers> maps(1);
  const auto refuses = [&] {
    MapRunDecoder decoder;
    std::vector<Layers*> pointers;
    for (Layers& map : maps) pointers.push_back(&map);
    return !decoder.Decode("", pointers);
  };
  EXPECT_TRUE(refuses()) << "no layers";
  maps[0].resize(1);
  maps[0][0].resolution_um = 50'000;
  for (const auto& [width, height] :
       {std::pair{0, 5}, {5, -1}, {kCodedMapSideMax + 1, 1}, {2000, 2000}, {INT32_MAX, INT32_MAX}}) {
    maps[0][0].grid.width = width;
    maps[0][0].grid.height = height;
    EXPECT_TRUE(refuses()) << width << " x " << height;
  }
  maps[0][0].grid.width = maps[0][0].grid.height = 1024;
  maps.resize(5, maps[0]);
  std::vector<Layers*> five;
  for (Layers& map : maps) five.push_back(&map);
  const Result<void> done = MapRunDecoder().Decode("", five);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().text, "has more cells than may be coded at once");
  maps = {Layers(17, MapLayer{Grid(1, 1), 1, 0, 0})};
  EXPECT_TRUE(refuses()) << "17 layers";
  maps = {Layers(1, MapLayer{Grid(1, 1), 0, 0, 0})};
  EXPECT_TRUE(refuses()) << "no resolution";
}

TEST(MapCodecTest, SurvivesRandomBytes) {
  const unsigned seed = 32;
  SCOPED_TRACE(seed);
  std::mt19937_64 rng(seed);
  for (int round = 0; round < 300; ++round) {
    std::string bytes(rng() % 200, '\0');
    for (char& byte : bytes) byte = static_cast<char>(rng());
    std::vector<Layers> maps = Drive(2);
    MapRunDecoder decoder(round % 2 == 0 ? &maps[0] : nullptr);
    Decode(decoder, bytes, maps);
  }
}

// Returns eight maps of blocks that move past the robot, with some noise. Integer arithmetic makes the maps the same on
// every machine.
std::vector<Layers> RollingBlocks() {
  std::vector<Layers> maps;
  for (int i = 0; i < 8; ++i) {
    maps.push_back(DrawLayers(3, 32, 32, [i](int layer, int column, int row) {
      if ((column * 31 + row * 17 + i * 7 + layer) % 97 == 0) return Cell::kUnknown;
      const int x = (((column - 16) << layer) + 4 * i + 1024) >> 3;
      const int y = (((row - 16) << layer) + 1024) >> 3;
      return (7 * x + 13 * y + x * y) % 5 == 0 ? Cell::kHazard : Cell::kFree;
    }));
  }
  return maps;
}

// Returns three maps with rows of 151 cells. The encoder codes such long rows in several blocks.
std::vector<Layers> WideMaps() {
  std::vector<Layers> maps;
  for (int i = 0; i < 3; ++i) {
    maps.push_back(DrawLayers(3, 151, 90, [i](int layer, int column, int row) {
      const int x = (((column - 75) << layer) + 4 * i + 1024) >> 3;
      const int y = (((row - 45) << layer) + 1024) >> 3;
      if ((x * 3 + y * 5) % 11 < 3 || (column * 31 + row * 17 + i * 7) % 89 == 0) return Cell::kUnknown;
      return (7 * x + 13 * y + x * y) % 5 == 0 ? Cell::kHazard : Cell::kFree;
    }));
  }
  return maps;
}

// If a hash changes, the wire format has changed and needs a new wire version (docs/COMPATIBILITY.md).
TEST(MapCodecTest, WritesTheGoldenBytes) {
  const auto hash_of = [](const std::string& bytes) { return XXH64(bytes.data(), bytes.size(), 0); };
  std::string adversarial;
  for (const Layers& map : AdversarialMaps()) adversarial += Encode({map}, Previous::kNever) + "|";
  const std::vector<Layers> small = {DrawLayers(
      2, 4, 4, [](int layer, int column, int row) { return static_cast<Cell>((layer + column * row) % 3); })};
  EXPECT_EQ(hash_of(adversarial), 16007101078288236084u);
  EXPECT_EQ(hash_of(Encode(AdversarialMaps(), Previous::kNever)), 4260601223363408080u);
  EXPECT_LT(Encode(RollingBlocks(), Previous::kWherePlaced).size(), Encode(RollingBlocks(), Previous::kNever).size());
  EXPECT_EQ(hash_of(Encode(RollingBlocks(), Previous::kWherePlaced)), 6975038015779577220u);
  EXPECT_EQ(hash_of(Encode(small, Previous::kNever)), 9959682941389959764u);
}

TEST(MapCodecTest, WritesTheGoldenBytesOfWideMaps) {
  const auto hash_of = [](const std::string& bytes) { return XXH64(bytes.data(), bytes.size(), 0); };
  EXPECT_EQ(hash_of(Encode(WideMaps(), Previous::kNever)), 10796012693193619213u);
  EXPECT_EQ(hash_of(Encode(WideMaps(), Previous::kWherePlaced)), 12817401328065089537u);
  ExpectRoundTrip(WideMaps(), Previous::kWherePlaced);
}

}  // namespace
}  // namespace moondb
