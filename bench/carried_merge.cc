#include "bench/carried_merge.h"

#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "actors/merge/map_collection.h"
#include "actors/merge/merger.h"
#include "bench/measure.h"
#include "model/check.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr AgentId kRover = 1;
constexpr double kRadius_m = 20;  // The rover drives on a circle, so that all maps lie within the world's square.
constexpr double kStep_m = 0.5;
constexpr double kMoved_m = 0.5;

class Drive {
 public:
  Drive(const MergeWorld& world, std::shared_ptr<GatherBackend> backend)
      : world_(world), collection_(OptionsOf(world)), merger_(world.grid, std::move(backend)) {
    for (const MapAtPose& map : world.maps) {
      centre_m_ += map.map_from_node.position_m / static_cast<double>(world.maps.size());
    }
    while (node_ + 1 < world.maps.size()) AddNode();
    for (std::size_t node = 0; node + kCarriedNodes < world.maps.size(); ++node) Solve(node, 1, 0);
  }

  // Adds the next node and its map. Maps repeat after the last one of the world.
  void AddNode() {
    const NodeKey node{kRover, node_};
    collection_.AddRawPose(KeyOf(proto::POSE_GRAPH_NODE, node_), node, PoseOf(node_));
    const MapAtPose& map = world_.maps[node_ % world_.maps.size()];
    TraversabilityMap moved = map.map;
    moved.node = node;
    Check(
        collection_.AddMap(KeyOf(proto::LOCAL_TRAVERSABILITY_MAP, node_), {.ns = map.timestamp_ns}, moved).has_value(),
        "the world's maps are valid");
    ++node_;
  }

  // Moves the last node that has an optimised pose, and with it kCarriedNodes nodes at least.
  void MoveLastSolved(std::uint64_t run) {
    Solve(world_.maps.size() - 1 - kCarriedNodes, run, kMoved_m * static_cast<double>(run % 2));
  }

  Result<void> Merge() {
    const MapCollection::Selected selected = collection_.Select({});
    merger_.Assign(selected.maps, selected.footprints);
    const auto merged = merger_.Merge({});
    return merged ? Result<void>() : tl::unexpected(merged.error());
  }

 private:
  static MapCollection::Options OptionsOf(const MergeWorld& world) {
    MapCollection::Options options;
    options.grid = world.grid;
    return options;
  }

  static RecordKey KeyOf(DataType type, std::uint64_t number) { return {{kRover, 1, type}, number + 1}; }

  Pose PoseOf(std::size_t node) const {
    Pose pose = world_.maps.front().map_from_node;
    const double angle = kStep_m / kRadius_m * static_cast<double>(node);
    pose.position_m = centre_m_ + Eigen::Vector3d(kRadius_m * std::cos(angle), kRadius_m * std::sin(angle), 0);
    return pose;
  }

  void Solve(std::size_t node, std::uint64_t run, double moved_m) {
    Pose pose = PoseOf(node);
    pose.position_m.x() += moved_m;
    proto::Term term;
    term.set_number(1);
    collection_.AddOptimizedPose(KeyOf(proto::OPTIMIZED_POSE, run * world_.maps.size() + node), {kRover, node},
                                 {.map_from_node = pose}, term, run);
  }

  const MergeWorld& world_;
  Eigen::Vector3d centre_m_ = Eigen::Vector3d::Zero();
  MapCollection collection_;
  Merger merger_;
  std::size_t node_ = 0;
};

Result<double> MedianMs(int repetitions, const std::function<Result<void>()>& work) {
  std::vector<double> times_ms;
  for (int i = 0; i < repetitions; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    if (const Result<void> done = work(); !done) return tl::unexpected(done.error());
    times_ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
  }
  return Median(times_ms);
}

}  // namespace

Result<CarriedMerge> MeasureCarriedMerge(const MergeWorld& world, int repetitions) {
  Check(world.maps.size() > kCarriedNodes, "some node has an optimised pose");
  auto backend = CreateGatherBackend(MergeBackend::kCpu);
  if (!backend) return tl::unexpected(backend.error());
  Drive drive(world, *std::move(backend));
  if (const Result<void> done = drive.Merge(); !done) return tl::unexpected(done.error());
  CarriedMerge measured;
  std::uint64_t run = 1;
  const Result<double> moved = MedianMs(repetitions, [&] {
    drive.MoveLastSolved(++run);
    return drive.Merge();
  });
  if (!moved) return tl::unexpected(moved.error());
  measured.moved_pose_ms = *moved;
  const Result<double> added = MedianMs(repetitions, [&] {
    drive.AddNode();
    return drive.Merge();
  });
  if (!added) return tl::unexpected(added.error());
  measured.new_map_ms = *added;
  return measured;
}

}  // namespace moondb
