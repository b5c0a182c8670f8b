// Draws merged maps and trajectories in colour, as images for WritePng.
//
// Images are RGB, with the frame's +y axis up and one or more pixels per cell. A map whose image would exceed
// kImageSideMax is drawn at a smaller scale. Thread-safe.
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

inline constexpr int kCropMarginCells = 20;  // Unknown cells kept around a cropped map.

// Returns the colours of unknown, free and hazard cells: dark grey, light, dark red.
const std::array<Color, 3>& CellColors();

// Returns an image with one gray pixel per cell: 0 unknown, 1 free, 2 hazard. Used for file formats that store the
// colours in a palette.
Image CellPicture(const MergedMap& map);

// Returns the colour of the agent with this index in the team. Colours repeat after eight agents.
Color AgentColor(std::size_t place);

struct Track {
  Color color = {0, 0, 0};
  std::vector<Eigen::Vector2d> points_m;  // In the frame `map`, in order of time.
};

// Returns one track per agent, in the order of `agents`. The track of an agent without poses is empty.
std::vector<Track> TracksOf(const std::map<NodeKey, Pose>& poses, const std::vector<AgentId>& agents);

struct MapPictureOptions {
  int pixels_per_cell = 1;  // 1 to 16; reduced if the picture would be too large.
  // Text in a bar above the map; empty: no bar. Supports letters (drawn as capitals), digits and .,:;+-=%/()'_<>.
  std::string caption;
  bool is_cropped = true;  // Crop to the known cells and a small margin; merged maps have wide unknown borders.
};

// Draws a map in the colours of CellColors(), with the tracks on top.
Image DrawMap(const MergedMap& map, const std::vector<Track>& tracks, const MapPictureOptions& options = {});

// Places two pictures next to each other on a dark background, with their tops aligned.
Image SideBySide(const Image& left, const Image& right);

struct TrajectoryPlotOptions {
  int width_px = 900;  // The height follows from the extent of the tracks: 200 to 1800 pixels.
  std::string caption;
};

// Draws trajectories: `truth` as wide pale lines, `before` as thin grey lines, `after` in the agents' colours. Adds a
// scale bar.
Image DrawTrajectories(const std::vector<Track>& before, const std::vector<Track>& after,
                       const std::vector<Track>& truth, const TrajectoryPlotOptions& options = {});

}  // namespace moondb
