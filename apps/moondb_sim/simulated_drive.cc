#include "apps/moondb_sim/simulated_drive.h"

#include <cmath>

#include "apps/moondb_sim/simulated_config.h"
#include "model/pose_graph.h"
#include "model/traversability_map.h"

namespace moondb::simulation {
namespace {

constexpr double kStep_m = 2;
constexpr double kTurn_rad = 0.15;
constexpr double kStepNoise_m = 0.03;  // Noise constants are half widths of uniform distributions.
constexpr double kTurnNoise_rad = 0.005;
constexpr double kRangeNoise_m = 0.15;
constexpr std::int32_t kMapCells = 16;
constexpr std::uint32_t kMapResolution_um = 200'000;
constexpr double kHazardRatio = 0.1;
// One map in 40 is large and has random cells, so that it does not fit into one message with any codec.
constexpr std::uint64_t kRandomMapEvery = 40;
constexpr std::int32_t kLargeMapCells = 320;

double VarianceOf(double width) { return width * width / 3; }

}  // namespace

std::vector<proto::Record> SimulatedDrive::NextNode(AgentId agent) {
  std::vector<proto::Record> records;
  const bool is_base = agent == world_.base;
  const auto [entry, is_first] = ways_.try_emplace(agent);
  Way& way = entry->second;
  if (is_first) way.truth = way.raw = StartOf(agent, is_base);
  if (!is_first) records.push_back(Step(agent, way));
  const NodeKey key{agent, way.nodes++};
  records.push_back(ToRecord(GraphNode{key, world_.ClockOf(agent), way.raw}));
  for (const auto& [other, its] : ways_) {
    if (!is_base && other != agent && its.nodes > 0) records.push_back(Range(agent, other));
  }
  return records;
}

proto::Record SimulatedDrive::Step(AgentId rover, Way& way) {
  const Pose step = Pose::FromPlanar(kStep_m, 0, kTurn_rad);
  const Pose seen =
      Pose::FromPlanar(kStep_m + Noise(kStepNoise_m), Noise(kStepNoise_m), kTurn_rad + Noise(kTurnNoise_rad));
  way.truth = way.truth * step;
  way.raw = way.raw * seen;
  OdometryEdge edge{{rover, way.nodes - 1}, {rover, way.nodes}, world_.ClockOf(rover), seen};
  const double step_variance = VarianceOf(kStepNoise_m);
  const double turn_variance = VarianceOf(kTurnNoise_rad);
  edge.covariance.diagonal() << step_variance, step_variance, step_variance, turn_variance, turn_variance,
      turn_variance;
  return ToRecord(edge);
}

proto::Record SimulatedDrive::Range(AgentId from, AgentId to) {
  const double distance_m = (ways_.at(from).truth.position_m - ways_.at(to).truth.position_m).norm();
  return ToRecord(RangeEdge{LastNode(from), LastNode(to), world_.ClockOf(from),
                            std::max(0.0, distance_m + Noise(kRangeNoise_m)), VarianceOf(kRangeNoise_m)});
}

proto::Record SimulatedDrive::MapHere(AgentId rover) {
  const bool is_large = world_.rng() % kRandomMapEvery == 0;
  const std::int32_t side = is_large ? kLargeMapCells : kMapCells;
  TraversabilityMap map;
  map.node = LastNode(rover);
  MapLayer& layer = map.layers.emplace_back();
  layer.grid = Grid(side, side);
  layer.resolution_um = is_large ? kMapResolution_um / 10 : kMapResolution_um;
  for (Cell& cell : layer.grid.cells) {
    const double draw = world_.Draw();
    if (is_large) cell = static_cast<Cell>(world_.rng() % 3);
    if (!is_large) cell = draw < kHazardRatio ? Cell::kHazard : Cell::kFree;
  }
  proto::Record record;
  record.set_timestamp_ns(world_.ClockOf(rover));
  *record.mutable_local_traversability_map() = ToProto(map);
  return record;
}

}  // namespace moondb::simulation
