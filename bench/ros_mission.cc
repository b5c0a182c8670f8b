// ros_mission: plays a recorded mission as ROS messages to moondb_ros's mapping. Writes the records that come out as a
// mission of the same form, so that both can be solved and compared (docs/benchmarks/pose_graph.md).
//
// Messages of each rover: odometry at 10 Hz, interpolated between the recorded nodes; and each local map as occupancy
// grids, one topic per layer, in the frame of the robot. The frame of the maps is the frame of the robot here, and the
// true poses are those of that frame.
//
// Usage: ros_mission MISSION OUT [AGE_S]     a node each AGE_S seconds (10)
#include <fmt/core.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "apps/moondb_ros/robot_mapper.h"
#include "model/file_writing.h"
#include "model/mission.h"

namespace moondb {
namespace {

constexpr std::int64_t kStart_ns = 1'800'000'000'000'000'000;  // A whole second.
constexpr std::int64_t kOdometryPeriod_ns = 100'000'000;
constexpr std::size_t kLayers = 4;

// The node poses of one rover by time, in nanoseconds of the mission.
using Poses = std::map<std::int64_t, Pose>;

Pose PoseAt(const Poses& poses, std::int64_t timestamp_ns) {
  const auto next = poses.lower_bound(timestamp_ns);
  if (next == poses.end()) return poses.rbegin()->second;
  if (next->first == timestamp_ns || next == poses.begin()) return next->second;
  const auto before = std::prev(next);
  return Interpolated(
      before->second, next->second,
      static_cast<double>(timestamp_ns - before->first) / static_cast<double>(next->first - before->first));
}

RosGrid ToGrid(const MapLayer& layer, std::int64_t timestamp_ns) {
  RosGrid grid;
  grid.timestamp_ns = timestamp_ns;
  grid.frame = "base_link";
  grid.resolution_m = layer.resolution_um * 1e-6;
  grid.width = static_cast<std::uint32_t>(layer.grid.width);
  grid.height = static_cast<std::uint32_t>(layer.grid.height);
  grid.frame_from_origin.position_m = {-grid.resolution_m * grid.width / 2, -grid.resolution_m * grid.height / 2, 0};
  for (const Cell cell : layer.grid.cells) {
    grid.values.push_back(cell == Cell::kUnknown ? -1 : cell == Cell::kHazard ? 100 : 0);
  }
  return grid;
}

class Converter {
 public:
  Converter(const Mission& mission, std::filesystem::path out, double age_s)
      : mission_(mission), out_(std::move(out)), age_s_(age_s) {
    made_.agents = mission.agents;
  }

  Result<void> Run() {
    if (const auto failure = MakeFolders(out_ / "maps")) {
      return Fail(ErrorCode::kInternal, failure.message(), out_.string());
    }
    for (MissionAgent& agent : made_.agents) {
      if (agent.is_base_station) {
        AddBaseStation(agent.id);
      } else if (const Result<void> added = AddRover(agent); !added) {
        return added;
      }
    }
    std::ranges::sort(made_.maps, {}, &MissionMap::timestamp_ns);
    return WriteMission(made_, out_);
  }

 private:
  void AddBaseStation(AgentId agent) {
    for (const GraphNode& node : mission_.graph.nodes) {
      if (node.key.agent != agent) continue;
      made_.graph.nodes.push_back(node);
      made_.truth[node.key] = mission_.truth.at(node.key);
    }
  }

  Result<void> AddRover(MissionAgent& agent) {
    Poses raw, truth;
    std::map<std::int64_t, const MissionMap*> maps;
    for (const MissionMap& map : mission_.maps) {
      if (map.agent == agent.id) maps[map.timestamp_ns] = &map;
    }
    if (maps.empty()) return Fail(ErrorCode::kInvalid, agent.name + " has no maps");
    const Pose node_from_map = maps.begin()->second->node_from_map;
    for (const GraphNode& node : mission_.graph.nodes) {
      if (node.key.agent != agent.id) continue;
      raw[node.timestamp_ns] = node.map_from_node * node_from_map;
      truth[node.timestamp_ns] = mission_.truth.at(node.key) * node_from_map;
    }
    agent.start = raw.begin()->second;

    RobotMapper::Options options;
    options.agent = agent.id;
    options.rule = {1e6, 1e6, age_s_};
    options.first = agent.start;
    options.odometry_kind = proto::ODOMETRY_KIND_LIDAR;
    for (std::size_t i = 0; i < kLayers; ++i) options.grid_topics.push_back("/grid" + std::to_string(i));
    TopicLog log([](const std::string& line) { fmt::print(stderr, "{}\n", line); }, std::chrono::hours(1));
    RobotMapper mapper(options, std::nullopt, log);
    // Odometry goes on for a second after the last node, because a node waits for its messages.
    for (std::int64_t now_ns = raw.begin()->first; now_ns <= raw.rbegin()->first + 1'000'000'000;
         now_ns += kOdometryPeriod_ns) {
      if (const auto map = maps.find(now_ns); map != maps.end()) {
        const Result<TraversabilityMap> layers = ReadMissionMap(mission_, *map->second);
        if (!layers) return tl::unexpected(layers.error());
        for (std::size_t i = 0; i < kLayers; ++i) mapper.OnGrid(i, ToGrid(layers->layers.at(i), kStart_ns + now_ns));
      }
      const auto node = mapper.OnOdometry({kStart_ns + now_ns, "odom", "base_link", PoseAt(raw, now_ns)}, true);
      if (!node) continue;
      if (const Result<void> added = AddNode(agent, *node, truth); !added) return added;
    }
    return {};
  }

  Result<void> AddNode(const MissionAgent& agent, const RobotMapper::Made& node, const Poses& truth) {
    const std::int64_t timestamp_ns = node.records.front().timestamp_ns() - kStart_ns;
    const NodeKey key{agent.id, node.records.front().pose_graph_node().node().index()};
    made_.truth[key] = PoseAt(truth, timestamp_ns);
    for (proto::Record record : node.records) {
      record.set_timestamp_ns(timestamp_ns);
      if (!record.has_local_traversability_map()) {
        if (const Result<void> added = AddRecord(record, made_.graph); !added) return added;
        continue;
      }
      const Result<TraversabilityMap> map = FromProto(record.local_traversability_map());
      if (!map) return tl::unexpected(map.error());
      const std::string name = agent.letter + std::to_string(key.index);
      const std::filesystem::path file = "maps/" + name + ".png";
      made_.maps.push_back({name, agent.id, timestamp_ns, key, map->node_from_map, static_cast<int>(map->layers.size()),
                            map->layers[0].grid.width, map->layers[0].resolution_m(), file});
      if (const Result<void> written = WriteMissionMap(out_ / file, *map); !written) return written;
    }
    return {};
  }

  const Mission& mission_;
  const std::filesystem::path out_;
  const double age_s_;
  Mission made_;
};

int RunProgram(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: ros_mission MISSION OUT [AGE_S]\n");
    return 2;
  }
  const Result<Mission> mission = ReadMission(argv[1]);
  const Result<void> done = mission ? Converter(*mission, argv[2], argc > 3 ? std::atof(argv[3]) : 10).Run()
                                    : tl::unexpected(mission.error());
  if (done) return 0;
  fmt::print(stderr, "ros_mission: {}\n", ToString(done.error()));
  return 1;
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) { return moondb::RunProgram(argc, argv); }
