// Helpers for tests of merging: maps drawn as text, and random worlds. MergeByBruteForce and MergeByGeometry compute
// the expected merge, and share no code with the backends.
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

// Returns a map of one layer, drawn as text with the top row first: '.' is free, '#' is a hazard, ' ' is unknown. The
// lower left corner of the layer lies at the origin of the map's frame. The map's node is {agent, 1}.
TraversabilityMap DrawMap(const std::vector<std::string>& rows, std::uint32_t resolution_um, AgentId agent = 1);

// Returns the cells of a merged map as rows of text, in the form that DrawMap reads.
std::vector<std::string> Print(const MergedMap& merged);

RecordKey MapKey(AgentId agent, std::uint64_t seq);

struct World {
  MergeGrid grid;
  std::vector<PlacedMap> maps;
  std::vector<Footprint> footprints;
};

// Returns a random world with a few hundred cells per side. Its layers have any size (also 1 x N, and more than one
// block), offset, resolution and heading. Some maps have equal timestamps or tilted poses. In one of three worlds all
// cell centres lie on borders. One of three worlds lies 1,000 km from the origin.
World MakeRandomWorld(std::mt19937_64& rng);

// Returns a random world with layers up to 200 times finer than the merged map, and with footprints of many cells.
World MakeFineWorld(std::mt19937_64& rng);

// Merges all maps and footprints of `world` in one merge.
MergeResult MergeBy(std::shared_ptr<GatherBackend> backend, const World& world);

// Returns all cells of the merger's merged map.
MergeResult ReadAll(const Merger& merger);

// Returns how many cells differ in value, map or layer. Returns the number of all cells if the sizes or origins differ.
std::size_t CountDifferences(const MergeResult& a, const MergeResult& b);

// Merges cell by cell: looks the cell up in every block, with 64-bit integers, and takes the value with the highest
// priority.
MergeResult MergeByBruteForce(const World& world);

// Result of MergeByGeometry, which uses trigonometry in long double and does not round to integers. `is_certain` is
// false for a cell whose centre lies closer than `margin_cells` to a border of a map's cell or of a footprint.
struct GeometricMerge {
  std::vector<Cell> cells;
  std::vector<bool> is_certain;
};
GeometricMerge MergeByGeometry(const World& world, const CellBox& extent, long double margin_cells);

}  // namespace moondb
