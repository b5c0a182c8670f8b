#include "apps/moondb_view/graph_book.h"

#include <algorithm>
#include <cmath>
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

// The nodes of one agent that are drawn.
using Track = std::vector<const GraphNode*>;

Track Thinned(const Track& track, std::size_t poses_max) {
  Track thinned = track;
  while (thinned.size() > poses_max) {
    Track half;
    for (std::size_t i = (thinned.size() - 1) % 2; i < thinned.size(); i += 2) half.push_back(thinned[i]);
    thinned = std::move(half);
  }
  return thinned;
}

struct Line {
  const char* kind;
  NodeKey from;
  NodeKey to;
  bool is_rejected = false;
  std::int64_t timestamp_ns = 0;
};

std::vector<Line> LinesOf(const KnownGraph& known, const PoseGraph& graph, std::size_t lines_max) {
  std::vector<Line> lines;
  for (const RangeEdge& range : graph.ranges) {
    const PublishedVerdict* verdict = known.FindVerdict(KeyOf(range));
    lines.push_back({"range", range.from, range.to, verdict != nullptr && !verdict->is_inlier, range.timestamp_ns});
  }
  for (const LoopClosure& closure : graph.closures) {
    const PublishedVerdict* verdict = known.FindVerdict(KeyOf(closure));
    lines.push_back({closure.source == kRegistrationSource ? "match" : "closure", closure.from, closure.to,
                     verdict != nullptr && !verdict->is_inlier, closure.timestamp_ns});
  }
  if (lines.size() > lines_max) {
    std::ranges::stable_sort(lines, std::greater(), &Line::timestamp_ns);
    lines.resize(lines_max);
  }
  return lines;
}

}  // namespace

GraphBook::GraphBook(const proto::TeamConfig& team)
    : team_(team), authority_(RoleChainOptions(team)), graph_(kLimits) {}

void GraphBook::Add(const RecordKey& key, const proto::Record& record) {
  if (authority_.Counts(key, record)) (void)graph_.Add(key, record);
}

GraphBook::Pages GraphBook::Write() const {
  const PoseGraph graph = graph_.graph();
  const std::map<NodeKey, Pose> poses = graph_.FindNewestPoses(graph.nodes);
  std::map<AgentId, Track> tracks;
  for (const GraphNode& node : graph.nodes) tracks[node.key.agent].push_back(&node);
  const std::set<AgentId> known_starts = KnownStarts(team_);
  Pages pages;
  JsonWriter json;
  json.BeginObject().Key("agents").BeginArray();
  for (auto& [agent, track] : tracks) {
    std::ranges::sort(track, {}, [](const GraphNode* node) { return node->key; });
    const auto published = std::find_if(track.rbegin(), track.rend(), [this](const GraphNode* node) {
      return graph_.FindPublished(node->key) != nullptr;
    });
    const auto* config = FindAgent(team_, agent);
    const bool is_base = config != nullptr && config->kind() == proto::AGENT_KIND_BASE_STATION;
    const bool is_placed = published == track.rend() ? is_base || known_starts.contains(agent)
                                                     : !graph_.IsPublishedUnplaced((*published)->key);
    pages.is_placed[agent] = is_placed;
    json.BeginObject().Key("id").Number(agent).Key("name").String(AgentName(team_, agent));
    json.Key("is_placed").Bool(is_placed);
    const Track drawn = Thinned(track, kTrackPosesMax);
    const auto write = [&](const char* name, const auto& value_of) {
      json.Key(name).BeginArray();
      for (const GraphNode* node : drawn) WriteThousandths(value_of(*node, poses.at(node->key)), json);
      json.EndArray();
    };
    write("time_s", [](const GraphNode& node, const Pose&) { return static_cast<double>(node.timestamp_ns) * 1e-9; });
    write("x_m", [](const GraphNode&, const Pose& pose) { return pose.position_m.x(); });
    write("y_m", [](const GraphNode&, const Pose& pose) { return pose.position_m.y(); });
    write("yaw_rad", [](const GraphNode&, const Pose& pose) { return pose.Yaw(); });
    write("is_optimized",
          [this](const GraphNode& node, const Pose&) { return graph_.FindPublished(node.key) != nullptr ? 1 : 0; });
    json.EndObject();
  }
  pages.poses = json.EndArray().EndObject().text();
  JsonWriter lines;
  lines.BeginObject().Key("lines").BeginArray();
  for (const Line& line : LinesOf(graph_, graph, kLinesMax)) {
    const auto from = poses.find(line.from);
    const auto to = poses.find(line.to);
    if (from == poses.end() || to == poses.end()) continue;
    if (!pages.is_placed[line.from.agent] || !pages.is_placed[line.to.agent]) continue;
    lines.BeginArray().String(line.kind);
    for (const Pose* pose : {&from->second, &to->second}) {
      WriteThousandths(pose->position_m.x(), lines);
      WriteThousandths(pose->position_m.y(), lines);
    }
    lines.Number(line.is_rejected ? 1 : 0).String(NameOf(team_, line.from)).String(NameOf(team_, line.to)).EndArray();
  }
  pages.lines = lines.EndArray().EndObject().text();
  return pages;
}

}  // namespace moondb
