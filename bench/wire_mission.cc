#include "bench/wire_mission.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "apps/moondb_mission/mission_maker.h"
#include "apps/moondb_mission/random.h"
#include "bench/rolling_maps.h"
#include "model/data_types.h"
#include "model/record_check.h"
#include "model/record_hash.h"
#include "model/record_key.h"

namespace moondb {

namespace {

constexpr std::int64_t kStart_ns = 1'760'000'000'000'000'000;
constexpr std::int64_t kSecond_ns = 1'000'000'000;
constexpr std::uint64_t kEpoch = 0x5F3C9A1E0B7D4C21;

// Period in seconds of all states except temperatures, which are recorded every second.
constexpr int kOtherStatesEvery = 3;

// Collects records by data type and origin. States come first in the result, and maps last.
class Recorder {
 public:
  void Add(AgentId origin, proto::Record record) {
    record.set_timestamp_ns(record.timestamp_ns() + kStart_ns);
    const std::uint32_t type = TypeOf(record);
    std::vector<proto::StoredRecord>& stream = streams_[{type, origin}];
    const RecordKey key{{origin, kEpoch + origin, type}, stream.size() + 1};
    proto::StoredRecord& stored = stream.emplace_back();
    *stored.mutable_key() = ToProto(key);
    record.set_is_state(IsState(type));
    stored.set_content(record.SerializeAsString());
    stored.set_hash(HashRecord(key, stored.content()));
  }

  std::vector<WireStream> Take() {
    std::vector<WireStream> streams;
    for (auto& [key, records] : streams_) streams.push_back({key.first, std::move(records)});
    return streams;
  }

 private:
  std::map<std::pair<std::uint32_t, AgentId>, std::vector<proto::StoredRecord>> streams_;
};

void AddStates(AgentId origin, int seconds, Recorder& recorder) {
  Random random(origin);
  double celsius = 10;
  for (int second = 0; second < seconds; ++second) {
    const std::int64_t timestamp_ns = second * kSecond_ns + random.Index(2'000'000);
    celsius += 0.05 * random.Normal();
    proto::Record temperature;
    temperature.set_timestamp_ns(timestamp_ns);
    // The sensor's resolution is 1/16 degree.
    temperature.mutable_temperature()->set_celsius(std::round(celsius * 16) / 16);
    recorder.Add(origin, temperature);
    if (second % kOtherStatesEvery != 0) continue;
    proto::Record power;
    power.set_timestamp_ns(timestamp_ns);
    power.mutable_power()->set_battery_ratio(std::round((0.9 - second * 1e-4) * 4096) / 4096);
    power.mutable_power()->set_draw_w(12 + random.Index(64) / 16.0);
    recorder.Add(origin, power);
  }
}

void AddMap(AgentId origin, std::int64_t timestamp_ns, const TraversabilityMap& map, Recorder& recorder) {
  proto::Record record;
  record.set_timestamp_ns(timestamp_ns);
  *record.mutable_local_traversability_map() = ToProto(map);
  recorder.Add(origin, std::move(record));
}

void AddGraph(const PoseGraph& graph, Recorder& recorder) {
  for (const GraphNode& node : graph.nodes) recorder.Add(node.key.agent, ToRecord(node));
  for (const OdometryEdge& edge : graph.odometry) recorder.Add(edge.to.agent, ToRecord(edge));
  for (const RangeEdge& edge : graph.ranges) recorder.Add(edge.from.agent, ToRecord(edge));
}

Matrix6d DiagonalCovariance() {
  Matrix6d covariance = Matrix6d::Zero();
  for (int i = 0; i < 6; ++i) covariance(i, i) = i < 3 ? 4e-4 : 1e-4;
  return covariance;
}

// Returns the pose graph of a straight drive with noise, for maps whose generator has no poses.
PoseGraph MakeGraph(AgentId origin, int node_count, std::int64_t period_ns, Random& random) {
  PoseGraph graph;
  for (int i = 0; i < node_count; ++i) {
    const NodeKey key{origin, static_cast<std::uint64_t>(i)};
    const Pose step = Pose::FromPlanar(0.5 + 0.01 * random.Normal(), 0.01 * random.Normal(), 0.02 * random.Normal());
    const Pose pose = i == 0 ? Pose{} : graph.nodes.back().map_from_node * step;
    if (i > 0) graph.odometry.push_back({graph.nodes.back().key, key, i * period_ns, step, DiagonalCovariance()});
    graph.nodes.push_back({key, i * period_ns, pose});
  }
  return graph;
}

WireMission Finish(std::string name, Recorder& recorder, std::map<AgentId, std::vector<TraversabilityMap>> maps) {
  WireMission mission;
  mission.name = std::move(name);
  mission.streams = recorder.Take();
  for (auto& [agent, of_rover] : maps) mission.rover_maps.push_back(std::move(of_rover));
  return mission;
}

WireMission ToWire(std::string name, const Mission& mission, const std::vector<TraversabilityMap>& maps) {
  Recorder recorder;
  std::map<AgentId, std::vector<TraversabilityMap>> by_rover;
  AddGraph(mission.graph, recorder);
  std::int64_t last_ns = 0;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    AddMap(mission.maps[i].agent, mission.maps[i].timestamp_ns, maps[i], recorder);
    by_rover[mission.maps[i].agent].push_back(maps[i]);
    last_ns = std::max(last_ns, mission.maps[i].timestamp_ns);
  }
  for (const AgentId rover : RoverIds(mission)) AddStates(rover, static_cast<int>(last_ns / kSecond_ns), recorder);
  return Finish(std::move(name), recorder, std::move(by_rover));
}

}  // namespace

WireMission MakeRollingMission() {
  constexpr int kRovers = 3;
  constexpr int kMapsPerRover = 100;
  constexpr std::int64_t kPeriod_s = 12;
  Recorder recorder;
  std::map<AgentId, std::vector<TraversabilityMap>> by_rover;
  for (AgentId rover = 1; rover <= kRovers; ++rover) {
    Random random(1000 + rover);
    AddGraph(MakeGraph(rover, kMapsPerRover, kPeriod_s * kSecond_ns, random), recorder);
    AddStates(rover, kMapsPerRover * kPeriod_s, recorder);
    RollingOptions options;
    options.seed = 9000 + rover;
    options.map_count = kMapsPerRover;
    std::vector<TraversabilityMap> maps = MakeRollingMaps(options);
    for (int i = 0; i < kMapsPerRover; ++i) {
      maps[static_cast<std::size_t>(i)].node = {rover, static_cast<std::uint64_t>(i)};
      AddMap(rover, i * kPeriod_s * kSecond_ns, maps[static_cast<std::size_t>(i)], recorder);
    }
    by_rover[rover] = std::move(maps);
  }
  return Finish("rolling", recorder, std::move(by_rover));
}

Result<WireMission> MakeSingleViewMission() {
  MissionOptions options;
  options.seed = 71;
  options.minutes = 16;
  const Result<MadeMission> made = MakeMission(options);
  if (!made) return tl::unexpected(made.error());
  return ToWire("single_view", made->mission, made->maps);
}

Result<WireMission> ReadRecordedMission(const std::filesystem::path& folder) {
  const Result<Mission> mission = ReadMission(folder);
  if (!mission) return tl::unexpected(mission.error());
  std::vector<TraversabilityMap> maps;
  for (const MissionMap& map : mission->maps) {
    Result<TraversabilityMap> read = ReadMissionMap(*mission, map);
    if (!read) return tl::unexpected(read.error());
    maps.push_back(*std::move(read));
  }
  return ToWire(folder.filename().string(), *mission, maps);
}

}  // namespace moondb
