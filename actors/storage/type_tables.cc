#include "actors/storage/type_tables.h"

#include <cmath>
#include <string_view>

#include "model/record_key.h"
#include "model/text.h"
#include "proto/types.pb.h"

namespace moondb {

namespace {

using proto::Record;

constexpr char kPose[] =
    "x REAL NOT NULL, y REAL NOT NULL, z REAL NOT NULL,"
    "qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL, qw REAL NOT NULL";
constexpr char kNode[] = "node_agent INTEGER NOT NULL, node_index INTEGER NOT NULL, ";
constexpr char kVersion[] =
    "term_number INTEGER NOT NULL, term_issuer INTEGER NOT NULL, term_issuer_epoch INTEGER NOT NULL, "
    "run INTEGER NOT NULL";
constexpr char kEnds[] =
    "from_agent INTEGER NOT NULL, from_index INTEGER NOT NULL, to_agent INTEGER NOT NULL, to_index INTEGER NOT NULL,";

void BindPose(const proto::Pose& pose, Query& query) {
  query << pose.position_m().x() << pose.position_m().y() << pose.position_m().z();
  query << pose.orientation().x() << pose.orientation().y() << pose.orientation().z() << pose.orientation().w();
}

void BindNode(const proto::NodeKey& node, Query& query) { query << node.agent_id() << node.index(); }

// Returns the angle of the body's x axis in the horizontal plane.
double YawOf(const proto::Quaternion& q) {
  return std::atan2(2 * (q.w() * q.z() + q.x() * q.y()), 1 - 2 * (q.y() * q.y() + q.z() * q.z()));
}

void BindVersion(const proto::Term& term, std::uint64_t run, Query& query) {
  query << term.number() << term.issuer() << term.issuer_epoch() << run;
}

std::vector<TypeTable> MakeTypeTables() {
  return {
      {.type = proto::TEMPERATURE,
       .columns = "celsius REAL NOT NULL",
       .bind = [](const Record& record, Query& query) { query << record.temperature().celsius(); }},

      {.type = proto::POWER,
       .columns = "battery_ratio REAL, draw_w REAL NOT NULL",
       .bind =
           [](const Record& record, Query& query) {
             const proto::Power& power = record.power();
             if (power.has_battery_ratio()) {
               query << power.battery_ratio();
             } else {
               query << nullptr;
             }
             query << power.draw_w();
           }},

      {.type = proto::AWAKE_STATUS,
       .columns = "is_awake INTEGER NOT NULL",
       .bind = [](const Record& record, Query& query) { query << record.awake_status().is_awake(); }},

      {.type = proto::MODE,
       .columns = "activity INTEGER NOT NULL",
       .bind = [](const Record& record, Query& query) { query << static_cast<int>(record.mode().activity()); }},

      {.type = proto::HEALTH,
       .columns = "level INTEGER NOT NULL, text TEXT NOT NULL",
       .bind =
           [](const Record& record, Query& query) {
             query << static_cast<int>(record.health().level()) << std::string_view(record.health().text());
           }},

      {.type = proto::EXPLORATION,
       .columns = "explored_ratio REAL NOT NULL",
       .bind = [](const Record& record, Query& query) { query << record.exploration().explored_ratio(); }},

      {.type = proto::DISTRIBUTED_MEASUREMENTS,
       .columns = "completed_ratio REAL NOT NULL",
       .bind = [](const Record& record,
                  Query& query) { query << record.distributed_measurements().completed_ratio(); }},

      {.type = proto::POSE_GRAPH_NODE,
       .columns = std::string(kNode) + kPose,
       .bind =
           [](const Record& record, Query& query) {
             BindNode(record.pose_graph_node().node(), query);
             BindPose(record.pose_graph_node().map_from_node(), query);
           }},

      {.type = proto::POSE_GRAPH_EDGE,
       .columns = std::string(kEnds) + "is_range INTEGER NOT NULL, range_m REAL, variance_m2 REAL, "
                                       "source TEXT NOT NULL",
       .bind =
           [](const Record& record, Query& query) {
             const proto::PoseGraphEdge& edge = record.pose_graph_edge();
             BindNode(edge.from(), query);
             BindNode(edge.to(), query);
             query << edge.has_range();
             if (edge.has_range()) {
               query << edge.range().range_m() << edge.range().variance_m2();
             } else {
               query << nullptr << nullptr;
             }
             query << std::string_view(edge.source());
           }},

      {.type = proto::OPTIMIZED_POSE,
       .columns = std::string(kNode) + kVersion + ", " + kPose + ", is_unplaced INTEGER NOT NULL",
       .bind =
           [](const Record& record, Query& query) {
             BindNode(record.optimized_pose().node(), query);
             BindVersion(record.optimized_pose().term(), record.optimized_pose().run(), query);
             BindPose(record.optimized_pose().map_from_node(), query);
             query << record.optimized_pose().is_unplaced();
           },
       .agent_condition = "node_agent = ?6"},

      {.type = proto::EDGE_VERDICT,
       .columns = std::string(kEnds) +
                  "is_range INTEGER NOT NULL, is_inlier INTEGER NOT NULL, residual_sigmas REAL NOT NULL, " + kVersion +
                  ", is_prior INTEGER NOT NULL, source TEXT NOT NULL",
       .bind =
           [](const Record& record, Query& query) {
             const proto::EdgeVerdict& verdict = record.edge_verdict();
             BindNode(verdict.from(), query);
             BindNode(verdict.to(), query);
             query << verdict.is_range() << verdict.is_inlier() << verdict.residual_sigmas();
             BindVersion(verdict.term(), verdict.run(), query);
             query << verdict.is_prior() << std::string_view(verdict.source());
           },
       .agent_condition = "(from_agent = ?6 OR to_agent = ?6)"},

      {.type = proto::POSE_PRIOR,
       .columns = std::string(kNode) + "x REAL NOT NULL, y REAL NOT NULL, z REAL NOT NULL, yaw REAL, "
                                       "source TEXT NOT NULL",
       .bind =
           [](const Record& record, Query& query) {
             const proto::PosePrior& prior = record.pose_prior();
             BindNode(prior.node(), query);
             const proto::Vector3& position_m = prior.has_pose()           ? prior.pose().position_m()
                                                : prior.has_position_yaw() ? prior.position_yaw().position_m()
                                                                           : prior.position_m();
             query << position_m.x() << position_m.y() << position_m.z();
             if (prior.has_position_m()) {
               query << nullptr;
             } else {
               query << (prior.has_pose() ? YawOf(prior.pose().orientation()) : prior.position_yaw().yaw_rad());
             }
             query << std::string_view(prior.source());
           }},

      {.type = proto::MAP_MATCH,
       .columns = std::string(kEnds) + kPose +
                  ", from_map TEXT NOT NULL, to_map TEXT NOT NULL, from_timestamp_ns INTEGER NOT NULL, "
                  "to_timestamp_ns INTEGER NOT NULL, " +
                  "overlap REAL NOT NULL, matched REAL NOT NULL, second_best REAL NOT NULL, " + kVersion,
       .bind =
           [](const Record& record, Query& query) {
             const proto::MapMatch& match = record.map_match();
             BindNode(match.from(), query);
             BindNode(match.to(), query);
             BindPose(match.relative_pose().from_from_to(), query);
             query.BindCopy(ToString(FromProto(match.from_map()))).BindCopy(ToString(FromProto(match.to_map())));
             query << match.from_timestamp_ns() << match.to_timestamp_ns();
             query << match.overlap() << match.matched() << match.second_best();
             BindVersion(match.term(), match.run(), query);
           }},

      {.type = proto::LOCAL_TRAVERSABILITY_MAP,
       .columns = std::string(kNode) +
                  "layer_count INTEGER NOT NULL,"
                  "finest_resolution_um INTEGER NOT NULL, finest_width_cells INTEGER NOT NULL,"
                  "finest_height_cells INTEGER NOT NULL, " +
                  kPose,
       .bind =
           [](const Record& record, Query& query) {
             const proto::LocalTraversabilityMap& map = record.local_traversability_map();
             BindNode(map.node(), query);
             // CheckRecord requires at least one layer. The finest layer is the first.
             const proto::MapLayer& finest = map.layers(0);
             query << map.layers_size() << finest.resolution_um() << finest.width_cells() << finest.height_cells();
             BindPose(map.node_from_map(), query);
           }},

      {.type = proto::MAP_QUARANTINE,
       .columns = "maps_of INTEGER NOT NULL, from_ns INTEGER NOT NULL, to_ns INTEGER NOT NULL, reason TEXT NOT NULL, "
                  "lifts TEXT NOT NULL",
       .bind =
           [](const Record& record, Query& query) {
             const proto::MapQuarantine& quarantine = record.map_quarantine();
             query << quarantine.agent_id() << quarantine.from_ns() << quarantine.to_ns()
                   << std::string_view(quarantine.reason());
             query.BindCopy(quarantine.has_lifts() ? ToString(FromProto(quarantine.lifts())) : "");
           }},

      {.type = proto::AGENT_EVENT,
       .columns = "kind INTEGER NOT NULL, text TEXT NOT NULL, given_by TEXT NOT NULL",
       .bind =
           [](const Record& record, Query& query) {
             const proto::AgentEvent& event = record.agent_event();
             query << static_cast<int>(event.kind()) << std::string_view(event.text()) << std::string_view(event.by());
           }},

      {.type = proto::ROLE_ASSIGNMENT,
       .columns = "term_number INTEGER NOT NULL, term_issuer INTEGER NOT NULL, term_issuer_epoch INTEGER NOT NULL,"
                  "leader INTEGER NOT NULL, survivor INTEGER NOT NULL, reason TEXT NOT NULL",
       .bind =
           [](const Record& record, Query& query) {
             const proto::RoleAssignment& roles = record.role_assignment();
             query << roles.term().number() << roles.term().issuer() << roles.term().issuer_epoch() << roles.leader()
                   << roles.survivor() << std::string_view(roles.reason());
           }},
  };
}

}  // namespace

const std::vector<TypeTable>& TypeTables() {
  static const std::vector<TypeTable> kTables = MakeTypeTables();
  return kTables;
}

std::vector<std::string> ColumnNames(const std::string& columns) {
  std::vector<std::string> names;
  for (const std::string_view column : Split(columns, ',')) {
    const std::string_view words = column.substr(std::min(column.find_first_not_of(' '), column.size()));
    names.emplace_back(words.substr(0, words.find(' ')));
  }
  return names;
}

}  // namespace moondb
