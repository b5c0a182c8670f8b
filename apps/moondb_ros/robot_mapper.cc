#include "apps/moondb_ros/robot_mapper.h"

#include <utility>

namespace moondb {
namespace {

// Localizations publish transforms about a second ahead.
constexpr std::int64_t kAheadMax_ns = 3'000'000'000;

}  // namespace

RobotMapper::RobotMapper(Options options, std::optional<Stored> stored, TopicLog& log)
    : options_(std::move(options)),
      stored_(std::move(stored)),
      log_(log),
      grids_(options_.grid_topics.size()),
      planner_(options_.rule),
      chain_(MakeChain(options_, stored_)) {}

NodeChain RobotMapper::MakeChain(const Options& options, const std::optional<Stored>& stored) {
  std::optional<NodeChain::Last> last;
  if (stored) last = NodeChain::Last{stored->index, stored->timestamp_ns, stored->map_from_node, std::nullopt};
  return {options.agent, options.odometry_kind, options.first, last};
}

void RobotMapper::Continue() {
  if (!stored_) return;
  proto::RosState now = StateAt({track_.newest_ns(), *track_.PoseAt(track_.newest_ns()), false});
  const Result<Pose> odom_from_node = FromProto(stored_->state.odom_from_node());
  const bool is_of_node = stored_->state.has_odom_from_node() && stored_->state.node_index() == stored_->index;
  if (is_of_node && odom_from_node && IsContinued(stored_->state, now)) {
    chain_.Continue(*odom_from_node);
  } else {
    log_.Note(options_.odometry_topic, "does not continue from node " + std::to_string(stored_->index) +
                                           ": the odometry to the next node gets a large covariance (5 m, 60 degrees)");
  }
}

std::optional<RobotMapper::Made> RobotMapper::OnOdometry(const RosOdometry& message, bool has_room) {
  const bool is_first = track_.is_empty();
  const std::uint64_t jump_count = is_first ? 0 : track_.JumpsUntil(track_.newest_ns());
  if (const Result<void> added = track_.Add(message); !added) {
    log_.Drop(options_.odometry_topic, added.error().text);
    return std::nullopt;
  }
  if (is_first) Continue();
  if (track_.JumpsUntil(track_.newest_ns()) != jump_count) {
    log_.Note(options_.odometry_topic,
              "jumped: the odometry to the next node gets a large covariance (5 m, 60 degrees)");
  }
  const std::optional<PlannedNode> node = planner_.Next(track_, has_room);
  if (!node) return std::nullopt;
  const std::optional<TraversabilityMap> map = MapOf(*node);
  Result<std::vector<proto::Record>> records = chain_.Next(*node, map ? &*map : nullptr);
  if (!records) {
    log_.Drop(options_.odometry_topic, records.error().text);
    return std::nullopt;
  }
  Made made{*std::move(records), StateAt(*node)};
  made.state.set_node_index(chain_.last()->index);
  return made;
}

bool RobotMapper::IsFromTheFuture(const std::string& topic, std::int64_t timestamp_ns) {
  if (track_.is_empty() || timestamp_ns <= track_.newest_ns() + kAheadMax_ns) return false;
  log_.Drop(topic, "its timestamp lies more than 3 s after odometry");
  return true;
}

void RobotMapper::OnScan(RosScan message) {
  if (IsFromTheFuture(options_.scan_topic, message.timestamp_ns)) return;
  if (const Result<void> added = scans_.Add(std::move(message)); !added) {
    log_.Drop(options_.scan_topic, added.error().text);
  }
}

void RobotMapper::OnGrid(std::size_t topic, RosGrid message) {
  if (IsFromTheFuture(options_.grid_topics[topic], message.timestamp_ns)) return;
  if (const Result<void> set = grids_.Set(topic, std::move(message)); !set) {
    log_.Drop(options_.grid_topics[topic], set.error().text);
  }
}

void RobotMapper::OnTransform(const RosTransform& message, bool is_static) {
  if (!is_static && IsFromTheFuture("/tf", message.timestamp_ns)) return;
  if (const Result<void> added = frames_.Add(message, is_static); !added) {
    log_.Drop(is_static ? "/tf_static" : "/tf", added.error().text);
  }
}

std::optional<TraversabilityMap> RobotMapper::MapOf(const PlannedNode& node) {
  const bool is_by_grid = !options_.grid_topics.empty();
  Result<TraversabilityMap> map =
      is_by_grid ? grids_.MapAt(node, track_, frames_) : scans_.MapAt(node, track_, frames_);
  if (map) return *std::move(map);
  log_.Note(is_by_grid ? options_.grid_topics.front() : options_.scan_topic,
            map.error().text + ": the node has no map");
  return std::nullopt;
}

proto::RosState RobotMapper::StateAt(const PlannedNode& node) const {
  proto::RosState state;
  state.set_timestamp_ns(node.timestamp_ns);
  state.set_boot_id(options_.boot_id);
  state.set_odometry_frame(track_.frame());
  *state.mutable_odom_from_node() = ToProto(track_.track_from_odom().Inverse() * node.track_from_node);
  return state;
}

}  // namespace moondb
