// Worlds for the tests of merging: small ones by hand, random ones by seed, and two oracles that share no code with
// the backends.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "actors/merge/merger.h"
#include "actors/merge/placement.h"

namespace moondb {

// One map of one layer from text, first line on top: '.' free, '#' hazard, ' ' unknown. Its lower left corner lies at
// the origin of the map's frame, its node is {agent, 1}.
TraversabilityMap DrawMap(const std::vector<std::string>& rows, std::uint32_t resolution_um, AgentId agent = 1);

// The inverse, of a merged map.
std::vector<std::string> Print(const MergedMap& merged);

RecordKey MapKey(AgentId agent, std::uint64_t seq);

struct World {
  MergeGrid grid;
  std::vector<PlacedMap> maps;
  std::vector<Footprint> footprints;
};

// Layers of any size (1 x N and larger than a block too), offset, resolution and turn; equal stamps; tilted poses; one
// in three has all cell centres on borders, one in three lies 1,000 km from the origin. A few hundred cells a side.
World MakeRandomWorld(std::mt19937_64& rng);

// Layers up to 200 times finer than the merged map, and footprints of many cells.
World MakeFineWorld(std::mt19937_64& rng);

// The whole of `world`, merged at once.
MergeResult MergeBy(std::shared_ptr<GatherBackend> backend, const World& world);

// The whole of what is merged.
MergeResult ReadAll(const Merger& merger);

// Cells in which the two differ in value, map or layer; all of them if they are not of one size and place.
std::size_t CountDifferences(const MergeResult& a, const MergeResult& b);

// Every cell of the extent asks every block, in 64-bit integers, and takes the largest key.
MergeResult MergeByBruteForce(const World& world);

// The same from the poses themselves, with trigonometry and in long double, without any rounding to integers. Cells
// for which some centre lies closer than `margin_cells` to a border are left out: `is_certain` is false.
struct GeometricMerge {
  std::vector<Cell> cells;
  std::vector<bool> is_certain;
};
GeometricMerge MergeByGeometry(const World& world, const CellBox& extent, long double margin_cells);

}  // namespace moondb
