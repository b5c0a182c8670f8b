#include "model/mission.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <system_error>
#include <utility>

#include "model/file_writing.h"
#include "model/png.h"
#include "model/pyfg.h"
#include "model/text.h"
#include "model/text_lines.h"

namespace moondb {

namespace {

constexpr std::string_view kAgentsHeading =
    "agent_id,name,kind,key,start_x_m,start_y_m,start_z_m,start_yaw_rad,start_sigma_m,start_sigma_rad,antenna_x_m,"
    "antenna_y_m,antenna_z_m";
constexpr std::string_view kMapsHeading =
    "map_id,agent_id,stamp_s,node,node_from_map_x_m,node_from_map_y_m,node_from_map_yaw_rad,layers,cells_per_side,"
    "finest_resolution_m,file";
constexpr double kMicrometresPerMetre = 1e6;
constexpr std::size_t kAgentsMax = 52;  // One letter per agent: A to Z, a to z.
constexpr std::uint8_t kFreePixel = 254;
constexpr std::uint8_t kHazardPixel = 0;
constexpr std::uint8_t kUnknownPixel = 205;

// Parses one row of a table, and keeps the first error.
class CsvRow {
 public:
  CsvRow(std::string file_line, std::vector<std::string_view> fields)
      : file_line_(std::move(file_line)), fields_(std::move(fields)) {}

  std::string Text(std::string_view column) {
    const std::string_view text = fields_[next_++];
    if (text.empty()) Stop(std::string(column) + " is empty");
    return std::string(text);
  }

  double Number(std::string_view column, double least, double most) {
    const std::string_view text = fields_[next_++];
    const std::optional<double> value = ParseDouble(text);
    if (!value) {
      Stop(std::string(column) + ": '" + std::string(text) + "' is not a finite number");
    } else if (*value < least || *value > most) {
      Stop(std::string(column) + " must lie between " + FormatDouble(least) + " and " + FormatDouble(most));
    }
    return value.value_or(0);
  }

  std::uint64_t Count(std::string_view column, std::uint64_t least, std::uint64_t most) {
    const std::string_view text = fields_[next_++];
    const std::optional<std::uint64_t> value = ParseUnsigned(text);
    if (!value || *value < least || *value > most) {
      Stop(std::string(column) + ": '" + std::string(text) + "' is not a whole number from " + std::to_string(least) +
           " to " + std::to_string(most));
    }
    return value.value_or(least);
  }

  std::int64_t Timestamp(std::string_view column) {
    const std::string_view text = fields_[next_++];
    const std::optional<std::int64_t> timestamp_ns = ParseTimestampNs(text);
    if (!timestamp_ns) Stop(std::string(column) + ": '" + std::string(text) + "' is not a timestamp in seconds");
    return timestamp_ns.value_or(0);
  }

  void Stop(std::string text) {
    if (is_good_) failure_ = Error{ErrorCode::kInvalid, std::move(text), file_line_};
    is_good_ = false;
  }
  bool is_good() const { return is_good_; }
  tl::unexpected<Error> failure() const { return tl::unexpected(failure_); }

 private:
  std::string file_line_;
  std::vector<std::string_view> fields_;
  std::size_t next_ = 0;
  bool is_good_ = true;
  Error failure_;
};

// Calls `read_row` with each row of a table, and stops at the first error. Fails if the first line is not `heading`.
template <typename ReadRow>
Result<void> ReadCsv(const std::filesystem::path& file, std::string_view heading, ReadRow read_row) {
  Result<TextLines> lines = TextLines::OfFile(file);
  if (!lines) return tl::unexpected(lines.error());
  if (lines->Next() != heading) {
    if (!lines->result()) return lines->result();
    return Fail(ErrorCode::kInvalid, "the heading is not " + std::string(heading), FileLine(file.string(), 1));
  }
  const std::size_t columns = Split(heading, ',').size();
  while (const std::optional<std::string_view> row_text = lines->Next()) {
    if (row_text->empty()) continue;
    std::vector<std::string_view> fields = Split(*row_text, ',');
    const std::string file_line = FileLine(file.string(), lines->number());
    if (fields.size() != columns) {
      return Fail(ErrorCode::kInvalid,
                  "has " + std::to_string(fields.size()) + " fields instead of " + std::to_string(columns), file_line);
    }
    CsvRow row(file_line, std::move(fields));
    read_row(row);
    if (!row.is_good()) return row.failure();
  }
  return lines->result();
}

MissionAgent ReadAgent(CsvRow& row) {
  MissionAgent agent;
  agent.id = static_cast<AgentId>(row.Count("agent_id", 1, kAgentIdMax));
  agent.name = row.Text("name");
  const std::string kind = row.Text("kind");
  agent.is_base_station = kind == "base_station";
  if (kind != "rover" && kind != "base_station") row.Stop("kind: '" + kind + "' must be rover or base_station");
  const std::string key = row.Text("key");
  if (key.size() != 1 || AgentOfLetter(key.front()) == 0) row.Stop("key: '" + key + "' is not a letter");
  agent.letter = key.empty() ? '?' : key.front();
  const double x_m = row.Number("start_x_m", -kCoordinateMax_m, kCoordinateMax_m);
  const double y_m = row.Number("start_y_m", -kCoordinateMax_m, kCoordinateMax_m);
  const double z_m = row.Number("start_z_m", -kCoordinateMax_m, kCoordinateMax_m);
  agent.start = Pose::FromPlanar(x_m, y_m, row.Number("start_yaw_rad", -100, 100));
  agent.start.position_m.z() = z_m;
  agent.start_sigma_m = row.Number("start_sigma_m", 0, kCoordinateMax_m);
  agent.start_sigma_rad = row.Number("start_sigma_rad", 0, 100);
  agent.antenna_m.x() = row.Number("antenna_x_m", -100, 100);
  agent.antenna_m.y() = row.Number("antenna_y_m", -100, 100);
  agent.antenna_m.z() = row.Number("antenna_z_m", -100, 100);
  return agent;
}

Result<std::vector<MissionAgent>> ReadAgents(const std::filesystem::path& file) {
  std::vector<MissionAgent> agents;
  const Result<void> done = ReadCsv(file, kAgentsHeading, [&agents](CsvRow& row) {
    MissionAgent agent = ReadAgent(row);
    for (const MissionAgent& other : agents) {
      if (other.id == agent.id) row.Stop("agent_id " + std::to_string(agent.id) + " occurs a second time");
      if (other.name == agent.name) row.Stop("name " + agent.name + " occurs a second time");
      if (other.letter == agent.letter) row.Stop(std::string("key ") + agent.letter + " occurs a second time");
    }
    if (agents.size() >= kAgentsMax) row.Stop("too many agents");
    agents.push_back(std::move(agent));
  });
  if (!done) return tl::unexpected(done.error());
  return agents;
}

std::string KeyText(const Mission& mission, NodeKey key) {
  const MissionAgent* agent = FindAgent(mission, key.agent);
  return std::string(1, agent ? agent->letter : '?') + std::to_string(key.index);
}

// Replaces the letters of keys in the graph file by agent ids.
class KeyMapper {
 public:
  explicit KeyMapper(const std::vector<MissionAgent>& agents) {
    for (const MissionAgent& agent : agents) ids_[AgentOfLetter(agent.letter)] = agent.id;
  }

  void Map(NodeKey& key) {
    const auto id = ids_.find(key.agent);
    if (id != ids_.end()) {
      key.agent = id->second;
    } else if (stranger_.empty()) {
      stranger_ = LetterOfAgent(key.agent) + std::to_string(key.index);
    }
  }

  void Map(Pyfg& pyfg) {
    for (GraphNode& node : pyfg.graph.nodes) Map(node.key);
    for (PyfgLandmark& landmark : pyfg.landmarks) Map(landmark.key);
    for (OdometryEdge& edge : pyfg.graph.odometry) Map(edge.from), Map(edge.to);
    for (RangeEdge& edge : pyfg.graph.ranges) Map(edge.from), Map(edge.to);
  }

  const std::string& stranger() const { return stranger_; }  // First key whose letter no agent has; empty: none.

 private:
  std::map<AgentId, AgentId> ids_;
  std::string stranger_;
};

// Returns the raw poses of the rovers' nodes. A rover's first node has the start pose; odometry leads to the later
// nodes.
Result<std::map<NodeKey, Pose>> ComposeRawPoses(const Mission& mission, const std::string& file) {
  std::map<NodeKey, Pose> poses;
  for (const auto& [key, truth] : mission.truth) {
    const bool is_first = poses.empty() || poses.rbegin()->first.agent != key.agent;
    if (is_first) poses.emplace(key, FindAgent(mission, key.agent)->start);
    // `truth` is sorted by agent, so `key` is an agent's first node unless the last entry of `poses` has this agent.
  }
  std::vector<const OdometryEdge*> edges;
  edges.reserve(mission.graph.odometry.size());
  for (const OdometryEdge& edge : mission.graph.odometry) edges.push_back(&edge);
  std::stable_sort(edges.begin(), edges.end(), [](const auto* a, const auto* b) { return a->from < b->from; });
  for (const OdometryEdge* edge : edges) {
    if (edge->from.agent != edge->to.agent || edge->to < edge->from) {
      return Fail(ErrorCode::kInvalid,
                  "odometry from " + KeyText(mission, edge->from) + " to " + KeyText(mission, edge->to) +
                      " does not lead from a node to a later node of one rover",
                  file);
    }
    const auto from = poses.find(edge->from);
    if (from == poses.end()) {
      return Fail(ErrorCode::kInvalid, "no odometry leads to " + KeyText(mission, edge->from), file);
    }
    poses.emplace(edge->to, from->second * edge->from_from_to);
  }
  return poses;
}

Result<void> TakeBaseStations(const Pyfg& pyfg, const std::string& file, Mission& mission) {
  for (const PyfgLandmark& landmark : pyfg.landmarks) {
    const MissionAgent* agent = FindAgent(mission, landmark.key.agent);
    if (!agent->is_base_station || landmark.key.index != 0) {
      return Fail(ErrorCode::kInvalid,
                  KeyText(mission, landmark.key) + " is a fixed point, but only node 0 of a base station may be one",
                  file);
    }
    mission.truth[landmark.key] = Pose{landmark.position_m, agent->start.orientation};
  }
  for (const MissionAgent& agent : mission.agents) {
    if (!agent.is_base_station) continue;
    mission.truth.emplace(NodeKey{agent.id, 0}, agent.start);
    mission.graph.nodes.push_back(GraphNode{NodeKey{agent.id, 0}, 0, agent.start});
  }
  return {};
}

Result<void> TakeGraph(Pyfg pyfg, const std::string& file, Mission& mission) {
  if (pyfg.is_planar) return Fail(ErrorCode::kInvalid, "is 2-D; missions are 3-D", file);
  if (!pyfg.sightings.empty()) return Fail(ErrorCode::kInvalid, "has sightings of landmarks; missions have none", file);
  KeyMapper mapper(mission.agents);
  mapper.Map(pyfg);
  if (!mapper.stranger().empty()) {
    return Fail(ErrorCode::kInvalid, mapper.stranger() + " belongs to no agent of agents.csv", file);
  }
  mission.graph = std::move(pyfg.graph);
  for (const GraphNode& node : mission.graph.nodes) {
    if (FindAgent(mission, node.key.agent)->is_base_station) {
      return Fail(ErrorCode::kInvalid,
                  KeyText(mission, node.key) + " belongs to a base station, but is not a fixed point", file);
    }
    mission.truth[node.key] = node.map_from_node;
  }
  const Result<std::map<NodeKey, Pose>> raw = ComposeRawPoses(mission, file);
  if (!raw) return tl::unexpected(raw.error());
  for (GraphNode& node : mission.graph.nodes) {
    const auto pose = raw->find(node.key);
    if (pose == raw->end()) {
      return Fail(ErrorCode::kInvalid, "no odometry leads to " + KeyText(mission, node.key), file);
    }
    node.map_from_node = pose->second;
  }
  return TakeBaseStations(pyfg, file, mission);
}

// Returns whether a relative path stays inside its folder.
bool IsInside(const std::filesystem::path& file) {
  if (file.empty() || file.is_absolute()) return false;
  return std::none_of(file.begin(), file.end(), [](const std::filesystem::path& part) { return part == ".."; });
}

NodeKey ReadNodeKey(CsvRow& row, const Mission& mission) {
  const std::string text = row.Text("node");
  const std::optional<std::uint64_t> index = ParseUnsigned(std::string_view(text).substr(text.empty() ? 0 : 1));
  NodeKey key;
  for (const MissionAgent& agent : mission.agents) {
    if (!text.empty() && agent.letter == text.front() && index) key = NodeKey{agent.id, *index};
  }
  if (!mission.truth.contains(key)) row.Stop("node: graph.pyfg has no node '" + text + "'");
  return key;
}

MissionMap ReadMap(CsvRow& row, const Mission& mission) {
  MissionMap map;
  map.id = row.Text("map_id");
  map.agent = static_cast<AgentId>(row.Count("agent_id", 1, kAgentIdMax));
  if (!FindAgent(mission, map.agent)) row.Stop("agent_id: agents.csv has no agent " + std::to_string(map.agent));
  map.timestamp_ns = row.Timestamp("stamp_s");
  map.node = ReadNodeKey(row, mission);
  if (map.node.agent != map.agent) row.Stop("node: is not agent " + std::to_string(map.agent) + "'s");
  const double x_m = row.Number("node_from_map_x_m", -1000, 1000);
  const double y_m = row.Number("node_from_map_y_m", -1000, 1000);
  map.node_from_map = Pose::FromPlanar(x_m, y_m, row.Number("node_from_map_yaw_rad", -100, 100));
  map.layers = static_cast<int>(row.Count("layers", 1, kMapLayersMax));
  map.cells_per_side = static_cast<int>(row.Count("cells_per_side", 1, kMapSideCellsMax));
  map.finest_resolution_m = row.Number("finest_resolution_m", 1 / kMicrometresPerMetre, 100);
  if (std::ldexp(map.finest_resolution_m, map.layers - 1) * kMicrometresPerMetre > kMapResolutionUmMax) {
    row.Stop("layers: the coarsest layer's cells exceed 100 m");
  }
  map.file = row.Text("file");
  if (!IsInside(map.file)) row.Stop("file: '" + map.file.string() + "' lies outside the mission's folder");
  return map;
}

Result<void> ReadMaps(const std::filesystem::path& file, Mission& mission) {
  std::set<std::string> ids;
  const Result<void> done = ReadCsv(file, kMapsHeading, [&](CsvRow& row) {
    MissionMap map = ReadMap(row, mission);
    if (!ids.insert(map.id).second) row.Stop("map_id " + map.id + " occurs a second time");
    mission.maps.push_back(std::move(map));
  });
  std::stable_sort(mission.maps.begin(), mission.maps.end(),
                   [](const MissionMap& a, const MissionMap& b) { return a.timestamp_ns < b.timestamp_ns; });
  return done;
}

std::optional<Cell> CellOf(std::uint8_t pixel) {
  switch (pixel) {
    case kFreePixel:
      return Cell::kFree;
    case kHazardPixel:
      return Cell::kHazard;
    case kUnknownPixel:
      return Cell::kUnknown;
    default:
      return std::nullopt;
  }
}

std::uint8_t PixelOf(Cell cell) {
  if (cell == Cell::kFree) return kFreePixel;
  return cell == Cell::kHazard ? kHazardPixel : kUnknownPixel;
}

// Reads the layer whose top row in the picture is `top`. Row 0 is at the top of a picture, but at the bottom of a grid.
Result<Grid> GridOf(const Image& image, int top, int side, const std::string& file) {
  Grid grid(side, side);
  for (int row = 0; row < side; ++row) {
    const int picture_row = top + side - 1 - row;
    for (int column = 0; column < side; ++column) {
      const std::uint8_t pixel = *image.At(column, picture_row);
      const std::optional<Cell> cell = CellOf(pixel);
      if (!cell) {
        return Fail(ErrorCode::kInvalid,
                    "pixel " + std::to_string(column) + ", " + std::to_string(picture_row) + " is " +
                        std::to_string(pixel) + ", neither 254, 0 nor 205",
                    file);
      }
      grid.At(column, row) = *cell;
    }
  }
  return grid;
}

std::string AgentsCsv(const Mission& mission) {
  std::string text(kAgentsHeading);
  for (const MissionAgent& agent : mission.agents) {
    text += "\n" + std::to_string(agent.id) + "," + agent.name + "," +
            (agent.is_base_station ? "base_station" : "rover") + "," + agent.letter;
    for (int i = 0; i < 3; ++i) text += "," + FormatDouble(agent.start.position_m[i]);
    text += "," + FormatDouble(agent.start.Yaw());
    text += "," + FormatDouble(agent.start_sigma_m) + "," + FormatDouble(agent.start_sigma_rad);
    for (int i = 0; i < 3; ++i) text += "," + FormatDouble(agent.antenna_m[i]);
  }
  return text + "\n";
}

std::string MapsCsv(const Mission& mission) {
  std::string text(kMapsHeading);
  for (const MissionMap& map : mission.maps) {
    const Pose& pose = map.node_from_map;
    text += "\n" + map.id + "," + std::to_string(map.agent) + "," + FormatTimestampNs(map.timestamp_ns) + "," +
            KeyText(mission, map.node) + "," + FormatDouble(pose.position_m.x()) + "," +
            FormatDouble(pose.position_m.y()) + "," + FormatDouble(pose.Yaw()) + "," + std::to_string(map.layers) +
            "," + std::to_string(map.cells_per_side) + "," + FormatDouble(map.finest_resolution_m) + "," +
            map.file.generic_string();
  }
  return text + "\n";
}

Result<Pyfg> PyfgOf(const Mission& mission) {
  Pyfg pyfg;
  std::map<AgentId, AgentId> letters;
  for (const MissionAgent& agent : mission.agents) letters[agent.id] = AgentOfLetter(agent.letter);
  const auto to_letter = [&letters](NodeKey key) { return NodeKey{letters[key.agent], key.index}; };
  for (const GraphNode& node : mission.graph.nodes) {
    const auto truth = mission.truth.find(node.key);
    const MissionAgent* agent = FindAgent(mission, node.key.agent);
    if (!agent || AgentOfLetter(agent->letter) == 0 || truth == mission.truth.end()) {
      return Fail(ErrorCode::kInvalid,
                  "node " + KeyText(mission, node.key) + " has no ground truth, or its agent has no letter");
    }
    if (agent->is_base_station) {
      pyfg.landmarks.push_back(PyfgLandmark{to_letter(node.key), std::nullopt, truth->second.position_m});
    } else {
      pyfg.graph.nodes.push_back(GraphNode{to_letter(node.key), node.timestamp_ns, truth->second});
    }
  }
  pyfg.graph.odometry = mission.graph.odometry;
  for (OdometryEdge& edge : pyfg.graph.odometry) edge.from = to_letter(edge.from), edge.to = to_letter(edge.to);
  pyfg.graph.ranges = mission.graph.ranges;
  for (RangeEdge& edge : pyfg.graph.ranges) edge.from = to_letter(edge.from), edge.to = to_letter(edge.to);
  return pyfg;
}

}  // namespace

std::vector<AgentId> RoverIds(const Mission& mission) {
  std::vector<AgentId> ids;
  for (const MissionAgent& agent : mission.agents) {
    if (!agent.is_base_station) ids.push_back(agent.id);
  }
  return ids;
}

const MissionAgent* FindAgent(const Mission& mission, AgentId id) {
  for (const MissionAgent& agent : mission.agents) {
    if (agent.id == id) return &agent;
  }
  return nullptr;
}

Result<Mission> ReadMission(const std::filesystem::path& folder) {
  Mission mission;
  mission.folder = folder;
  Result<std::vector<MissionAgent>> agents = ReadAgents(folder / "agents.csv");
  if (!agents) return tl::unexpected(agents.error());
  mission.agents = *std::move(agents);
  const std::filesystem::path graph_file = folder / "graph.pyfg";
  Result<Pyfg> pyfg = ReadPyfg(graph_file);
  if (!pyfg) return tl::unexpected(pyfg.error());
  Result<void> done = TakeGraph(*std::move(pyfg), graph_file.string(), mission);
  if (done) done = ReadMaps(folder / "maps.csv", mission);
  if (!done) return tl::unexpected(done.error());
  return mission;
}

Result<TraversabilityMap> ReadMissionMap(const Mission& mission, const MissionMap& map) {
  const std::filesystem::path file = mission.folder / map.file;
  const Result<Image> image = ReadPng(file);
  if (!image) return tl::unexpected(image.error());
  const int side = map.cells_per_side;
  if (image->channels != 1) return Fail(ErrorCode::kInvalid, "is not gray", file.string());
  if (image->width != side || image->height != side * map.layers) {
    return Fail(ErrorCode::kInvalid,
                "has " + std::to_string(image->width) + " x " + std::to_string(image->height) +
                    " pixels, but maps.csv says " + std::to_string(side) + " x " + std::to_string(side * map.layers),
                file.string());
  }
  TraversabilityMap result{map.node, map.node_from_map, {}};
  for (int layer = 0; layer < map.layers; ++layer) {
    Result<Grid> grid = GridOf(*image, layer * side, side, file.string());
    if (!grid) return tl::unexpected(grid.error());
    const double resolution_um = std::ldexp(map.finest_resolution_m, layer) * kMicrometresPerMetre;
    result.layers.push_back(MapLayer{*std::move(grid), static_cast<std::uint32_t>(std::llround(resolution_um)), 0, 0});
  }
  return result;
}

Result<void> WriteMission(const Mission& mission, const std::filesystem::path& folder) {
  if (const std::error_code failure = MakeFolders(folder)) {
    return Fail(ErrorCode::kInternal, "cannot be made: " + failure.message(), folder.string());
  }
  const Result<Pyfg> pyfg = PyfgOf(mission);
  if (!pyfg) return tl::unexpected(pyfg.error());
  Result<void> done = WriteTextFile(folder / "agents.csv", AgentsCsv(mission));
  if (done) done = WritePyfg(*pyfg, folder / "graph.pyfg");
  if (done) done = WriteTextFile(folder / "maps.csv", MapsCsv(mission));
  return done;
}

Result<void> WriteMissionMap(const std::filesystem::path& file, const TraversabilityMap& map) {
  if (map.layers.empty()) return Fail(ErrorCode::kInvalid, "a map without layers has no picture", file.string());
  const int width = map.layers.front().grid.width;
  int height = 0;
  for (const MapLayer& layer : map.layers) {
    if (layer.grid.width != width) return Fail(ErrorCode::kInvalid, "layers of several widths", file.string());
    height += layer.grid.height;
  }
  Image image(width, height, 1);
  int top = 0;
  for (const MapLayer& layer : map.layers) {
    for (int row = 0; row < layer.grid.height; ++row) {
      for (int column = 0; column < width; ++column) {
        *image.At(column, top + layer.grid.height - 1 - row) = PixelOf(layer.grid.At(column, row));
      }
    }
    top += layer.grid.height;
  }
  return WritePng(image, file);
}

}  // namespace moondb
