#include "apps/moondb_view/graph_book.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <vector>

#include "apps/common/json_writer.h"
#include "model/agent_name.h"
#include "model/start_poses.h"
#include "model/team_member.h"
#include "runtime/team/role_signature.h"

namespace moondb {
namespace {

constexpr KnownGraph::Limits kLimits{.nodes_max = 200'000, .edges_max = 600'000};

// Writes a position or an angle with three digits after the point.
void WriteThousandths(double value, JsonWriter& json) {
  json.Number(std::isfinite(value) ? std::round(value * 1000) / 1000 : value);
}

std::string NameOf(const proto::TeamConfig& team, const NodeKey& node) {
  return AgentName(team, node.agent) + ":" + std::to_string(node.index);
}

const char* KindName(DrawnLine::Kind kind) {
  return kind == DrawnLine::Kind::kRange ? "range" : kind == DrawnLine::Kind::kMatch ? "match" : "closure";
}

template <typename Item>
std::vector<Item> Thinned(std::vector<Item> items, std::size_t items_max) {
  while (items.size() > items_max) {
    std::vector<Item> half;
    for (std::size_t i = (items.size() - 1) % 2; i < items.size(); i += 2) half.push_back(items[i]);
    items = std::move(half);
  }
  return items;
}

// Returns the lines without their poses.
std::vector<DrawnLine> LinesOf(const KnownGraph& known, const PoseGraph& graph) {
  std::vector<DrawnLine> lines;
  const auto add = [&](DrawnLine::Kind kind, const auto& edge) {
    const PublishedVerdict* verdict = known.FindVerdict(KeyOf(edge));
    const bool is_rejected = verdict != nullptr && !verdict->is_inlier;
    lines.push_back({kind, edge.from, edge.to, {}, {}, is_rejected, edge.timestamp_ns});
  };
  for (const RangeEdge& range : graph.ranges) add(DrawnLine::Kind::kRange, range);
  for (const LoopClosure& closure : graph.closures) {
    add(closure.source == kRegistrationSource ? DrawnLine::Kind::kMatch : DrawnLine::Kind::kClosure, closure);
  }
  return lines;
}

}  // namespace

GraphBook::GraphBook(const proto::TeamConfig& team)
    : team_(team), authority_(RoleChainOptions(team)), graph_(kLimits) {}

void GraphBook::Add(const RecordKey& key, const proto::Record& record) {
  if (authority_.Counts(key, record)) (void)graph_.Add(key, record);
}

GraphView GraphBook::View() const {
  const PoseGraph graph = graph_.graph();
  const std::map<NodeKey, Pose> poses = graph_.FindNewestPoses(graph.nodes);
  const std::set<AgentId> known_starts = KnownStarts(team_);
  std::map<AgentId, std::vector<PoseView>> tracks;
  for (const GraphNode& node : graph.nodes) {
    const bool is_optimized = graph_.FindPublished(node.key) != nullptr;
    tracks[node.key.agent].push_back({node.key, node.timestamp_ns, poses.at(node.key), is_optimized});
  }
  GraphView view;
  std::set<AgentId> placed;
  for (auto& [agent, track] : tracks) {
    std::ranges::sort(track, {}, &PoseView::node);
    const auto published = std::find_if(track.rbegin(), track.rend(), std::mem_fn(&PoseView::is_optimized));
    const auto* config = FindAgent(team_, agent);
    const bool is_base = config != nullptr && config->kind() == proto::AGENT_KIND_BASE_STATION;
    const bool is_placed = published == track.rend() ? is_base || known_starts.contains(agent)
                                                     : !graph_.IsPublishedUnplaced(published->node);
    if (is_placed) placed.insert(agent);
    view.tracks.push_back({{agent, Thinned(std::move(track), kTrackPosesMax)}, is_placed});
  }
  for (DrawnLine& line : LinesOf(graph_, graph)) {
    const auto from = poses.find(line.from);
    const auto to = poses.find(line.to);
    if (from == poses.end() || to == poses.end()) continue;
    if (!placed.contains(line.from.agent) || !placed.contains(line.to.agent)) continue;
    line.map_from_from = from->second;
    line.map_from_to = to->second;
    view.lines.push_back(line);
  }
  if (view.lines.size() > kLinesMax) {
    std::ranges::stable_sort(view.lines, std::greater(), &DrawnLine::timestamp_ns);
    view.lines.resize(kLinesMax);
  }
  return view;
}

std::string PosesJson(const proto::TeamConfig& team, const GraphView& view) {
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  for (const auto& [track, is_placed] : view.tracks) {
    json.BeginObject().Key("id").Number(track.agent).Key("name").String(AgentName(team, track.agent));
    json.Key("is_placed").Bool(is_placed);
    const auto write = [&json, &poses = track.poses](const char* name, const auto& value_of) {
      json.Key(name).BeginArray();
      for (const PoseView& pose : poses) WriteThousandths(value_of(pose), json);
      json.EndArray();
    };
    write("time_s", [](const PoseView& pose) { return static_cast<double>(pose.timestamp_ns) * 1e-9; });
    write("x_m", [](const PoseView& pose) { return pose.map_from_body.position_m.x(); });
    write("y_m", [](const PoseView& pose) { return pose.map_from_body.position_m.y(); });
    write("yaw_rad", [](const PoseView& pose) { return pose.map_from_body.Yaw(); });
    write("is_optimized", [](const PoseView& pose) { return pose.is_optimized ? 1 : 0; });
    json.EndObject();
  }
  return json.EndArray().EndObject().text();
}

std::string LinesJson(const proto::TeamConfig& team, const GraphView& view) {
  JsonWriter json;
  json.BeginObject().Key("lines").BeginArray();
  for (const DrawnLine& line : view.lines) {
    json.BeginArray().String(KindName(line.kind));
    for (const Pose* pose : {&line.map_from_from, &line.map_from_to}) {
      WriteThousandths(pose->position_m.x(), json);
      WriteThousandths(pose->position_m.y(), json);
    }
    json.Number(line.is_rejected ? 1 : 0).String(NameOf(team, line.from)).String(NameOf(team, line.to)).EndArray();
  }
  return json.EndArray().EndObject().text();
}

}  // namespace moondb
