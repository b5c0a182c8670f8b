#include <algorithm>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include "apps/common/graph_reading.h"
#include "apps/common/json_writer.h"
#include "apps/common/proto_json.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/map_overlap.h"
#include "apps/moonctl/map_questions.h"
#include "apps/moonctl/node_name.h"
#include "apps/moonctl/submap_overlap.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

struct OverlapArguments {
  std::vector<std::string> nodes;  // Two names.
  std::string file;
};

using NodePair = std::pair<NodeKey, NodeKey>;

// Returns the rovers if the arguments name two; otherwise they name nodes.
std::optional<std::pair<AgentId, AgentId>> ParseRovers(const proto::TeamConfig& team,
                                                       const OverlapArguments& arguments) {
  const auto first = AgentNamed(team, arguments.nodes.at(0));
  const auto second = AgentNamed(team, arguments.nodes.at(1));
  if (!first || !second || *first == *second) return std::nullopt;
  return std::pair{(*first)->id(), (*second)->id()};
}

Result<NodePair> ParseNodes(const proto::TeamConfig& team, const OverlapArguments& arguments) {
  const auto first = ParseNodeName(team, arguments.nodes.at(0), "NODE");
  if (!first) return tl::unexpected(first.error());
  const auto second = ParseNodeName(team, arguments.nodes.at(1), "NODE");
  if (!second) return tl::unexpected(second.error());
  if (*first == *second) return Fail(ErrorCode::kInvalid, "name two different nodes", "NODE");
  return NodePair{*first, *second};
}

// The newest local map of a node.
struct NodeMap {
  std::pair<std::int64_t, RecordKey> age;  // Timestamp and record key.
  proto::LocalTraversabilityMap body;
};

// Reads the newest map of each of the two nodes. A node without a map is absent.
Result<std::map<NodeKey, NodeMap>> ReadNewestMaps(Client& client, const NodePair& nodes) {
  proto::ReadRequest request;
  request.add_data_types(proto::LOCAL_TRAVERSABILITY_MAP);
  for (const AgentId agent : std::set{nodes.first.agent, nodes.second.agent}) request.add_origin_agents(agent);
  std::map<NodeKey, NodeMap> newest;
  const auto take = [&](const proto::StoredRecord& stored, const proto::Record& record) -> Result<void> {
    const NodeKey node = FromProto(record.local_traversability_map().node());
    if (node != nodes.first && node != nodes.second) return {};
    const std::pair age{record.timestamp_ns(), FromProto(stored.key())};
    const auto [entry, is_new] = newest.try_emplace(node, NodeMap{age, record.local_traversability_map()});
    if (!is_new && age > entry->second.age) entry->second = {age, record.local_traversability_map()};
    return {};
  };
  if (auto read = client.ReadAll(request, take); !read) return tl::unexpected(read.error());
  return newest;
}

Result<TraversabilityMap> MapOf(const std::map<NodeKey, NodeMap>& maps, const NodeKey& node, const std::string& name,
                                const std::string& agent) {
  const auto found = maps.find(node);
  if (found == maps.end()) return Fail(ErrorCode::kNotFound, agent + " holds no local map of " + name);
  return FromProto(found->second.body);
}

Result<GraphNode> NodeOf(const PoseGraph& graph, const NodeKey& key, const std::string& name,
                         const std::string& agent) {
  const auto found = std::ranges::find(graph.nodes, key, &GraphNode::key);
  if (found == graph.nodes.end()) return Fail(ErrorCode::kNotFound, agent + " holds no node " + name);
  return *found;
}

// Returns first_from_second by the map match of the nodes; nullopt if there is none.
std::optional<Pose> MatchOf(const PoseGraph& graph, const NodePair& nodes) {
  for (const LoopClosure& closure : graph.closures) {
    if (closure.source != kRegistrationSource) continue;
    if (NodePair{closure.from, closure.to} == nodes) return closure.from_from_to;
    if (NodePair{closure.to, closure.from} == nodes) return closure.from_from_to.Inverse();
  }
  return std::nullopt;
}

Result<Overlap> ReadOverlap(AgentClient& target, const proto::TeamConfig& team, const NodePair& nodes) {
  Overlap overlap;
  const std::string& agent = target.agent->name();
  OverlaidMaps& maps = overlap.maps;
  maps.first_name = NodeName(team, nodes.first);
  maps.second_name = NodeName(team, nodes.second);
  const auto known = ReadGraphOf(*target.client, team);
  if (!known) return tl::unexpected(known.error());
  const PoseGraph graph = known->graph();
  const auto first = NodeOf(graph, nodes.first, maps.first_name, agent);
  if (!first) return tl::unexpected(first.error());
  const auto second = NodeOf(graph, nodes.second, maps.second_name, agent);
  if (!second) return tl::unexpected(second.error());
  const auto newest = ReadNewestMaps(*target.client, nodes);
  if (!newest) return tl::unexpected(newest.error());
  auto first_map = MapOf(*newest, nodes.first, maps.first_name, agent);
  if (!first_map) return tl::unexpected(first_map.error());
  auto second_map = MapOf(*newest, nodes.second, maps.second_name, agent);
  if (!second_map) return tl::unexpected(second_map.error());
  maps.first = *std::move(first_map);
  maps.second = *std::move(second_map);

  for (const GraphNode& node : {*first, *second}) {
    if (known->FindPublished(node.key) != nullptr) continue;
    overlap.remarks.push_back(NodeName(team, node.key) + " has no optimized pose; odometry places it");
  }
  const std::map<NodeKey, Pose> poses = known->FindNewestPoses(graph.nodes);
  const Pose& map_from_first = poses.at(first->key);
  overlap.placements = {{"odometry", first->map_from_node, second->map_from_node},
                        {"optimized", map_from_first, poses.at(second->key)}};
  if (const std::optional<Pose> match = MatchOf(graph, nodes)) {
    overlap.placements.push_back({"match", map_from_first, map_from_first * *match});
  } else {
    overlap.remarks.push_back(agent +
                              " holds no match between these two nodes: moonctl graph matches lists the matches");
  }
  return overlap;
}

// Returns the direction of north in the frame of the first map.
double NorthYaw(const proto::TeamConfig& team, const Overlap& overlap) {
  const double north_yaw_rad = team.has_site() ? team.site().north_yaw_rad() : std::numbers::pi / 2;
  return north_yaw_rad - (overlap.placements.back().map_from_first_node * overlap.maps.first.node_from_map).Yaw();
}

ExitCode ReportOverlap(CommandContext& context, const Overlap& overlap, const std::string& file) {
  Table table({"POSES", "X m", "Y m", "YAW deg", "COMMON HAZARDS", "WITHIN 10 CM"});
  JsonWriter json;
  json.BeginObject().Key("file").String(file).Key("panels").BeginArray();
  for (const MapPlacement& placement : overlap.placements) {
    const PlanarOffset offset = OffsetOf(overlap.maps, placement);
    const OverlapShare share = MeasureOverlap(overlap.maps, offset);
    table.Add({placement.name, FormatFixed(offset.x_m, 2), FormatFixed(offset.y_m, 2),
               FormatFixed(offset.yaw_rad * 180 / std::numbers::pi, 1), std::to_string(share.common_count),
               share.ratio() ? FormatFixed(*share.ratio() * 100, 0) + " %" : "no overlap"});
    json.BeginObject().Key("poses").String(placement.name).Key("x_m").Number(offset.x_m).Key("y_m").Number(offset.y_m);
    json.Key("yaw_rad").Number(offset.yaw_rad).Key("common").Number(static_cast<double>(share.common_count));
    json.Key("matched").Number(static_cast<double>(share.matched_count)).EndObject();
  }
  json.EndArray().Key("remarks").BeginArray();
  std::string text = "wrote " + file + ": the hazards of " + overlap.maps.first_name +
                     " drawn over the known area of " + overlap.maps.second_name + "\n" + table.Text();
  for (const std::string& remark : overlap.remarks) {
    text += remark + "\n";
    json.String(remark);
  }
  json.EndArray().EndObject();
  return context.Done(json.text(), text);
}

ExitCode DrawOverlap(CommandContext& context, const OverlapArguments& arguments) {
  const auto team = context.Team();
  if (!team) return context.Report(team.error());
  const proto::TeamConfig& config = (*team)->config;
  const auto rovers = ParseRovers(config, arguments);
  const auto nodes = rovers ? NodePair() : ParseNodes(config, arguments);
  if (!nodes) return context.Report(nodes.error());
  auto target = context.ConnectToChosenOrLeader();
  if (!target) return context.Report(target.error());
  const auto overlap =
      rovers ? ReadSubmaps(*target, config, rovers->first, rovers->second) : ReadOverlap(*target, config, *nodes);
  if (!overlap) return context.Report(overlap.error());
  const Picture picture = OverlapPicture(overlap->maps, overlap->placements, NorthYaw(config, *overlap));
  if (auto written = WritePicture(picture, arguments.file); !written) return context.Report(written.error());
  return ReportOverlap(context, *overlap, arguments.file);
}

}  // namespace

void AddMapOverlap(Command& group, CommandContext& context) {
  auto arguments = std::make_shared<OverlapArguments>();
  Command& command =
      AddCommand(group, "overlap", "Draw the local maps of two nodes, or submaps of two rovers, over each other",
                 {"moonctl map overlap rover1:17 rover2:31 --out overlap.png"});
  command
      .AddOption("nodes", arguments->nodes,
                 "Two nodes, such as rover1:17 rover2:31; or two rovers, whose best matching submaps are drawn")
      .TypeName("NODE")
      .Expected(2, 2)
      .Required();
  command.AddOption("--out", arguments->file, "Output picture, .png or .svg").TypeName("FILE").Required();
  command.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return DrawOverlap(context, *arguments); }; });
}

}  // namespace moondb
