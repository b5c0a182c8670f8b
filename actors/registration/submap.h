// Submap: the local maps of 15 m of driving, fused along the raw odometry of one rover. Two submaps say more about
// their relative pose than two local maps, because they contain corners, rooms and whole rocks.
//
// Frame: that of the middle node of the window, projected to the plane. Cells of 10 cm take their observations from
// layers of 10 to 20 cm, or from finer layers if a map has none of these. Each map counts up to 9 m about its origin. A
// cell is a hazard if at least 40 % of the maps that know it say so, free if at most 15 % do, and otherwise unknown.
//
// Limits: a submap covers the inner kSideMax_m. Immutable and usable on any thread.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "actors/registration/distance_field.h"
#include "actors/registration/hazard_field.h"
#include "actors/registration/planar_offset.h"
#include "actors/registration/rover_track.h"
#include "model/record_key.h"
#include "model/traversability_map.h"

namespace moondb {

// A map of a track.
struct TrackMap {
  RecordKey key;
  std::size_t index = 0;         // Index of its node in the track.
  PlanarOffset odom_from_local;  // Raw pose of the map.
};

// The maps of one window of a track.
struct SubmapWindow {
  std::size_t middle = 0;      // Index in the track of the middle node.
  std::vector<TrackMap> maps;  // Sorted by index and key.
  std::uint64_t hash = 0;      // Hash of the maps' keys. Two windows with one hash have the same cells.
};

struct SubmapWindowOptions {
  double length_m = 15;
  double spacing_m = 7.5;
  std::size_t count_max = 32;
  std::size_t maps_max = 64;  // Maps of a window, spread evenly if there are more. Each takes about 1 ms to fuse.
};

// Returns the windows of a track, the newest first. Windows hold at least one map, and no two have the same middle. The
// last window ends at the end of the track and may be shorter. Longer tracks keep windows that are spread evenly.
std::vector<SubmapWindow> FindWindows(const RoverTrack& track, std::vector<TrackMap> maps,
                                      const SubmapWindowOptions& options = {});

class Submap {
 public:
  static constexpr double kCell_m = 0.10;
  static constexpr double kSideMax_m = 36;
  static constexpr double kReach_m = 1.0;  // Reach of the distances.

  // The cells of a map that is part of the submap.
  struct Source {
    TraversabilityMap map;
    PlanarOffset submap_from_local;
    std::vector<MaskedDisc> masked;  // In the frame of the map.
  };

  explicit Submap(std::span<const Source> sources);

  struct Point {
    Eigen::Vector2d position_m;
    Eigen::Vector2d normal;  // Across the wall, if it is part of one.
    bool is_corner = false;  // Hazards lie on all sides, as at corners and rocks: both directions are normal.
    int wall = 0;            // The straight wall that it is part of, below wall_count(); not of a corner.
  };
  // Centres of the hazard cells.
  const std::vector<Point>& points() const { return points_; }
  int wall_count() const { return wall_count_; }
  const DistanceField& distances() const { return distances_; }

 private:
  void FindNormals(const std::vector<Cell>& cells);
  void FindWalls();

  const SquareGrid grid_;
  std::vector<Point> points_;
  int wall_count_ = 0;
  DistanceField distances_;
};

}  // namespace moondb
