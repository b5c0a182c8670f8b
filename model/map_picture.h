// Pictures for people: merged maps and trajectories in colour, ready for WritePng.
//
// North (+y) is up, one or more pixels a cell, RGB. Pure functions; sizes are bounded by kImageSideMax through a
// smaller scale where a map is too large.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "model/geometry.h"
#include "model/ids.h"
#include "model/png.h"
#include "model/traversability_map.h"

namespace moondb {

inline constexpr int kCropMarginCells = 20;  // Left of what is unknown around a map.

// Of unknown, free and hazard: dark grey, light, dark red.
const std::array<Color, 3>& CellColors();

// One gray pixel a cell, of value 0 unknown, 1 free, 2 hazard: for files that hold their colours beside the pixels.
Image CellPicture(const MergedMap& map);

// A colour for each agent, by its place in the team; repeats after eight.
Color AgentColor(std::size_t place);

struct Track {
  Color color = {0, 0, 0};
  std::vector<Eigen::Vector2d> points_m;  // In the frame `map`, in order of time.
};

// One track per agent, in the order of `agents`; agents without a pose give an empty track.
std::vector<Track> TracksOf(const std::map<NodeKey, Pose>& poses, const std::vector<AgentId>& agents);

struct MapPictureOptions {
  int pixels_per_cell = 1;  // 1 to 16; less where the picture would be too large.
  std::string caption;      // In a bar above; empty: no bar. Letters (shown as capitals), digits and .,:;+-=%/()'_<>.
  bool is_cropped = true;   // To the known cells and a small margin; merged maps have wide unknown borders.
};

// In the colours of cells, tracks on top.
Image DrawMap(const MergedMap& map, const std::vector<Track>& tracks, const MapPictureOptions& options = {});

// Two pictures next to each other on a dark ground, tops aligned.
Image SideBySide(const Image& left, const Image& right);

struct TrajectoryPlotOptions {
  int width_px = 900;  // The height follows from the tracks' extent, within 200 to 1800.
  std::string caption;
};

// Truth as broad pale lines, before as thin grey, after in the agents' colours, with a bar of whole metres as a scale.
Image DrawTrajectories(const std::vector<Track>& before, const std::vector<Track>& after,
                       const std::vector<Track>& truth, const TrajectoryPlotOptions& options = {});

}  // namespace moondb
