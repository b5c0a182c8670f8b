#include "apps/moondb_view/foxglove_messages.h"

#include <google/protobuf/descriptor.pb.h>

#include <set>

#include "apps/picture/tracks.h"
#include "model/agent_name.h"

namespace moondb {
namespace {

constexpr Color kRejectedColor{213, 94, 0};

void Set(std::int64_t timestamp_ns, google::protobuf::Timestamp& timestamp) {
  std::int64_t seconds = timestamp_ns / 1'000'000'000;
  std::int64_t nanos = timestamp_ns % 1'000'000'000;
  if (nanos < 0) {
    --seconds;
    nanos += 1'000'000'000;
  }
  timestamp.set_seconds(seconds);
  timestamp.set_nanos(static_cast<std::int32_t>(nanos));
}

template <typename Vector>
void Set(const Eigen::Vector3d& value, Vector& vector) {
  vector.set_x(value.x());
  vector.set_y(value.y());
  vector.set_z(value.z());
}

void Set(const Eigen::Quaterniond& value, foxglove::Quaternion& quaternion) {
  quaternion.set_x(value.x());
  quaternion.set_y(value.y());
  quaternion.set_z(value.z());
  quaternion.set_w(value.w());
}

void Set(const Pose& value, foxglove::Pose& pose) {
  Set(value.position_m, *pose.mutable_position());
  Set(value.orientation, *pose.mutable_orientation());
}

void Set(const Color& value, foxglove::Color& color) {
  color.set_r(value[0] / 255.0);
  color.set_g(value[1] / 255.0);
  color.set_b(value[2] / 255.0);
  color.set_a(1);
}

foxglove::SceneEntity& AddEntity(const std::string& id, std::int64_t timestamp_ns, foxglove::SceneUpdate& scene) {
  foxglove::SceneEntity& entity = *scene.add_entities();
  Set(timestamp_ns, *entity.mutable_timestamp());
  entity.set_frame_id(kMapFrameId);
  entity.set_id(id);
  return entity;
}

foxglove::LinePrimitive& AddLine(foxglove::LinePrimitive::Type type, const Color& color, double thickness_px,
                                 foxglove::SceneEntity& entity) {
  foxglove::LinePrimitive& line = *entity.add_lines();
  line.set_type(type);
  Set(Pose(), *line.mutable_pose());
  line.set_thickness(thickness_px);
  line.set_scale_invariant(true);
  Set(color, *line.mutable_color());
  return line;
}

Color ColorOf(DrawnLine::Kind kind) {
  if (kind == DrawnLine::Kind::kRange) return {41, 112, 150};
  return kind == DrawnLine::Kind::kMatch ? Color{0, 105, 92} : Color{122, 43, 191};
}

void AddFile(const google::protobuf::FileDescriptor& file, std::set<std::string>& added,
             google::protobuf::FileDescriptorSet& files) {
  if (!added.insert(file.name()).second) return;
  for (int i = 0; i < file.dependency_count(); ++i) AddFile(*file.dependency(i), added, files);
  file.CopyTo(files.add_file());
}

}  // namespace

foxglove::Grid GridOf(const CellBlock& block, const std::string& frame, std::int64_t timestamp_ns) {
  foxglove::Grid grid;
  Set(timestamp_ns, *grid.mutable_timestamp());
  grid.set_frame_id(frame);
  const double cell_m = block.resolution_um * 1e-6;
  Pose corner;
  corner.position_m = {static_cast<double>(block.origin_cell_x) * cell_m,
                       static_cast<double>(block.origin_cell_y) * cell_m, 0};
  Set(corner, *grid.mutable_pose());
  grid.set_column_count(block.side_cells);
  grid.mutable_cell_size()->set_x(cell_m);
  grid.mutable_cell_size()->set_y(cell_m);
  grid.set_row_stride(block.side_cells);
  grid.set_cell_stride(1);
  foxglove::PackedElementField& field = *grid.add_fields();
  field.set_name("cell");
  field.set_type(foxglove::PackedElementField::UINT8);
  grid.set_data(block.cells);
  return grid;
}

foxglove::FrameTransforms TransformsOf(const proto::TeamConfig& team, const GraphView& view) {
  foxglove::FrameTransforms transforms;
  for (const auto& [track, is_placed] : view.tracks) {
    if (!is_placed || track.poses.empty()) continue;
    const PoseView& newest = track.poses.back();
    foxglove::FrameTransform& transform = *transforms.add_transforms();
    Set(newest.timestamp_ns, *transform.mutable_timestamp());
    transform.set_parent_frame_id(kMapFrameId);
    transform.set_child_frame_id(AgentName(team, track.agent));
    Set(newest.map_from_body.position_m, *transform.mutable_translation());
    Set(newest.map_from_body.orientation, *transform.mutable_rotation());
  }
  return transforms;
}

foxglove::PosesInFrame PosesOf(const GraphView& view) {
  foxglove::PosesInFrame poses;
  poses.set_frame_id(kMapFrameId);
  std::int64_t newest_ns = 0;
  for (const auto& [track, is_placed] : view.tracks) {
    if (!is_placed || track.poses.empty()) continue;
    newest_ns = std::max(newest_ns, track.poses.back().timestamp_ns);
    Set(track.poses.back().map_from_body, *poses.add_poses());
  }
  Set(newest_ns, *poses.mutable_timestamp());
  return poses;
}

foxglove::SceneUpdate SceneOf(const proto::TeamConfig& team, const GraphView& view, std::int64_t timestamp_ns) {
  foxglove::SceneUpdate scene;
  // All entities are replaced, so that those that are no longer drawn vanish.
  scene.add_deletions()->set_type(foxglove::SceneEntityDeletion::ALL);
  Set(timestamp_ns, *scene.mutable_deletions(0)->mutable_timestamp());
  for (std::size_t i = 0; i < view.tracks.size(); ++i) {
    const auto& [track, is_placed] = view.tracks[i];
    if (!is_placed || track.poses.empty()) continue;
    const std::string name = AgentName(team, track.agent);
    const Color color = AgentColor(i);
    foxglove::SceneEntity& entity = AddEntity("track " + name, timestamp_ns, scene);
    foxglove::LinePrimitive& line = AddLine(foxglove::LinePrimitive::LINE_STRIP, color, 3, entity);
    for (const PoseView& pose : track.poses) Set(pose.map_from_body.position_m, *line.add_points());
    foxglove::TextPrimitive& text = *entity.add_texts();
    Set(track.poses.back().map_from_body, *text.mutable_pose());
    text.set_billboard(true);
    text.set_font_size(14);
    text.set_scale_invariant(true);
    Set(color, *text.mutable_color());
    text.set_text(name);
  }
  for (const auto& [kind, name] :
       {std::pair(DrawnLine::Kind::kRange, "ranges"), std::pair(DrawnLine::Kind::kClosure, "loop closures"),
        std::pair(DrawnLine::Kind::kMatch, "map matches")}) {
    for (const bool is_rejected : {false, true}) {
      foxglove::SceneEntity& entity =
          AddEntity(std::string(is_rejected ? "rejected " : "") + name, timestamp_ns, scene);
      foxglove::LinePrimitive& line =
          AddLine(foxglove::LinePrimitive::LINE_LIST, is_rejected ? kRejectedColor : ColorOf(kind), 1, entity);
      for (const DrawnLine& drawn : view.lines) {
        if (drawn.kind != kind || drawn.is_rejected != is_rejected) continue;
        Set(drawn.map_from_from.position_m, *line.add_points());
        Set(drawn.map_from_to.position_m, *line.add_points());
      }
    }
  }
  return scene;
}

foxglove::Log LogOf(const std::string& agent, const EventView& event) {
  foxglove::Log log;
  Set(event.timestamp_ns, *log.mutable_timestamp());
  log.set_level(event.severity == Severity::kError     ? foxglove::Log::ERROR
                : event.severity == Severity::kWarning ? foxglove::Log::WARNING
                                                       : foxglove::Log::INFO);
  log.set_name(agent);
  log.set_message(event.kind + ": " + event.TextBy());
  return log;
}

std::string SchemaOf(const google::protobuf::Descriptor& message) {
  google::protobuf::FileDescriptorSet files;
  std::set<std::string> added;
  AddFile(*message.file(), added, files);
  return files.SerializeAsString();
}

}  // namespace moondb
