// The tracks of robots, for pictures.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "model/geometry.h"
#include "model/ids.h"
#include "model/png.h"

namespace moondb {

// A position in the frame `map`, in metres.
struct MapPoint {
  double x_m = 0;
  double y_m = 0;
};

enum class TrackStyle {
  kLine,    // A coloured line with a white border, a dot at its start, and the track's name at its end.
  kBroad,   // A broad, pale line, for the true track.
  kDashed,  // A thin, dashed, dark line, for the track by odometry alone.
  kThin,    // A thin line, for a measurement.
};

struct Track {
  std::string name;  // Shown in the legend, once for each name.
  Color color = {0, 0, 0};
  TrackStyle style = TrackStyle::kLine;
  std::vector<MapPoint> points;  // In order of time. A track with one point is drawn as a square.
};

// Returns the colour of the agent with this index in the team. People with any colour vision can distinguish the
// colours (Okabe and Ito 2008). They repeat after eight agents.
Color AgentColor(std::size_t index);

struct TrackAgent {
  AgentId id = 0;
  std::string name;
};

// Returns one track per agent, in the order of `agents`. The track of an agent without poses is empty.
std::vector<Track> TracksOf(const std::map<NodeKey, Pose>& poses, const std::vector<TrackAgent>& agents);

// Returns the tracks of a picture that compares them: `truth` broad and pale, `before` dashed with the name
// `before_name`, and `after` as they are.
std::vector<Track> ComparedTracks(std::vector<Track> truth, std::vector<Track> before, const std::string& before_name,
                                  const std::vector<Track>& after);

}  // namespace moondb
