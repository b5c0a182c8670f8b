// GraphBook: the team's pose graph as the page draws it: trajectories, and measurements as lines. Not thread-safe.
#pragma once

#include <string>
#include <vector>

#include "actors/pgo/known_graph.h"
#include "model/record_authority.h"
#include "proto/record.pb.h"
#include "proto/team.pb.h"
#include "views/track_view.h"

namespace moondb {

// A measurement between two nodes of placed agents.
struct DrawnLine {
  enum class Kind { kRange, kClosure, kMatch };
  Kind kind = Kind::kRange;
  NodeKey from;
  NodeKey to;
  Pose map_from_from;
  Pose map_from_to;
  bool is_rejected = false;  // By the last solve.
  std::int64_t timestamp_ns = 0;
};

struct DrawnTrack {
  TrackView track;
  bool is_placed = false;  // False: the poses lie in a frame of the robot's own.
};

struct GraphView {
  std::vector<DrawnTrack> tracks;  // One for each agent with a node.
  std::vector<DrawnLine> lines;
};

// The parts "poses" and "lines" of the page.
std::string PosesJson(const proto::TeamConfig& team, const GraphView& view);
std::string LinesJson(const proto::TeamConfig& team, const GraphView& view);

class GraphBook {
 public:
  // Lines beyond this number are left out, those between the oldest nodes first.
  static constexpr std::size_t kLinesMax = 5000;
  // Longer trajectories lose every second node until they fit. The newest node stays.
  static constexpr std::size_t kTrackPosesMax = 2000;

  // Requires: `team` outlives the book.
  explicit GraphBook(const proto::TeamConfig& team);

  // Adds a record of the graph, a quarantine or a role assignment. Ignores records that agents ignore, and damaged
  // ones.
  void Add(const RecordKey& key, const proto::Record& record);
  // Returns true if a record that was ignored has become valid: all records must be added again, to a new book.
  bool TakeOutdated() { return authority_.TakeOutdated(); }

  GraphView View() const;

 private:
  const proto::TeamConfig& team_;
  RecordAuthority authority_;
  KnownGraph graph_;
};

}  // namespace moondb
