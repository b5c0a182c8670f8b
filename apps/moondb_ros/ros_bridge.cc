#include "apps/moondb_ros/ros_bridge.h"

#include <cstdlib>
#include <utility>

#include "apps/common/utc.h"
#include "apps/moondb_ros/dds/network_interfaces.h"

namespace moondb {
namespace {

constexpr auto kStep = std::chrono::milliseconds(50);
constexpr auto kMapPeriod = std::chrono::seconds(5);
constexpr auto kTransformPeriod = std::chrono::milliseconds(100);
constexpr auto kAddressesPeriod = std::chrono::seconds(5);
constexpr auto kSilentAfter = std::chrono::seconds(10);
// The transform's timestamp lies ahead of the newest odometry, as that of other localizations, so that it is there when
// a program asks for it.
constexpr std::int64_t kAhead_ns = 500'000'000;
constexpr std::int64_t kClockTolerance_ns = 1'000'000'000;

RobotMapper::Options WithAgent(const RosBridge::Options& options) {
  RobotMapper::Options mapper = MapperOptionsOf(options.settings);
  mapper.agent = options.agent;
  mapper.first = options.first;
  mapper.boot_id = options.boot_id;
  return mapper;
}

}  // namespace

Result<std::unique_ptr<RosBridge>> RosBridge::Start(Options options) {
  std::unique_ptr<RosBridge> bridge(new RosBridge(std::move(options)));
  if (const Result<void> joined = bridge->Join(); !joined) return tl::unexpected(joined.error());
  return bridge;
}

RosBridge::RosBridge(Options options)
    : options_(std::move(options)),
      inputs_(InputsOf(options_.settings)),
      log_(options_.print, kSilentAfter),
      mapper_(WithAgent(options_), options_.stored, log_),
      link_(options_.agent, options_.is_start_known, options_.state_file, options_.connect, options_.print) {}

Result<void> RosBridge::Join() {
  addresses_ = FindRosInterfaces().addresses;
  graph_.reset();  // A process has one participant configuration per domain.
  RosGraph::Options graph;
  graph.domain_id = options_.settings.domain_id;
  graph.inputs = inputs_;
  graph.map_topic = options_.settings.MapTopic();
  graph.tf_topic = options_.settings.TopicName("/tf");
  graph.epoch_ns = options_.settings.EpochNs();
  Result<std::unique_ptr<RosGraph>> joined = RosGraph::Join(std::move(graph), MakeHandlers());
  if (!joined) return tl::unexpected(joined.error());
  graph_ = *std::move(joined);
  return {};
}

RosGraph::Handlers RosBridge::MakeHandlers() {
  const auto hear = [this](std::size_t input, const std::string&) {
    // Static transforms are published once, which is no silence.
    if (input != kTfStatic) log_.Hear(inputs_[input].topic, std::chrono::steady_clock::now());
  };
  RosGraph::Handlers handlers =
      HandlersFor(inputs_, mapper_, log_, hear, [this](const RosOdometry& message) { OnOdometry(message); });
  handlers.on_transform = [this, to_mapper = std::move(handlers.on_transform)](std::size_t input,
                                                                               const RosTransform& message) {
    if (FrameName(message.parent) == options_.settings.MapFrame() && !options_.settings.is_published_as_map) {
      return log_.Drop(inputs_[input].topic, "another program publishes the transform from team_map");
    }
    to_mapper(input, message);
  };
  return handlers;
}

void RosBridge::OnOdometry(const RosOdometry& message) {
  const std::int64_t ahead_ns = message.timestamp_ns - UtcNowNs();
  if (!options_.settings.is_simulated_time && std::llabs(ahead_ns) > kClockTolerance_ns) {
    log_.Note(inputs_[kOdometry].topic,
              "its timestamps differ from this computer's clock by more than 1 s: set the clocks (NTP), or use "
              "--sim-time for a simulation");
  }
  std::optional<RobotMapper::Made> made = mapper_.OnOdometry(message, link_.HasRoom());
  if (made) link_.Insert(*std::move(made), *mapper_.last_node()->track_from_node);
}

Result<void> RosBridge::Step() {
  if (graph_ != nullptr) graph_->Spin(kStep);
  const Time now = std::chrono::steady_clock::now();
  log_.CheckSilence(now);
  CheckAddresses(now);
  if (graph_ != nullptr) {
    PublishTransform(now);
    PublishMap(now);
  }
  const std::optional<Error> refusal = link_.Refusal();
  if (refusal) return tl::unexpected(*refusal);
  return {};
}

void RosBridge::CheckAddresses(Time now) {
  if (now - addresses_read_ < kAddressesPeriod) return;
  addresses_read_ = now;
  if (graph_ != nullptr && FindRosInterfaces().addresses == addresses_) return;
  if (graph_ != nullptr) options_.print("this computer's addresses changed: joining the ROS graph again");
  const Result<void> joined = Join();
  if (!joined) return log_.Note("the ROS graph", joined.error().text);
  WriteMap();
}

std::string RosBridge::RootFrame() const { return mapper_.frames().RootOf(mapper_.track().frame()); }

std::optional<Pose> RosBridge::MapFromRoot(const std::string& root) {
  const OdometryTrack& track = mapper_.track();
  const std::optional<Pose> map_from_track = link_.TeamFromTrack();
  std::optional<Pose> odom_from_root = Pose();
  if (root != FrameName(track.frame())) {
    // The value for the time of the published timestamp, if the robot's localization looks ahead, too.
    odom_from_root = mapper_.frames().Find(track.frame(), root, track.newest_ns() + kAhead_ns);
    if (!odom_from_root) odom_from_root = mapper_.frames().Find(track.frame(), root, track.newest_ns());
  }
  if (!map_from_track || !odom_from_root) return std::nullopt;
  return *map_from_track * track.track_from_odom() * *odom_from_root;
}

void RosBridge::PublishTransform(Time now) {
  if (mapper_.track().is_empty() || now - transform_written_ < kTransformPeriod) return;
  transform_written_ = now;
  const std::string root = RootFrame();
  if (IsMapOfOthers()) {
    return log_.Note(options_.settings.MapTopic(),
                     "not published, because another program publishes it or the parent of " + mapper_.track().frame() +
                         ": remove --publish-as-map");
  }
  const std::optional<Pose> map_from_root = MapFromRoot(root);
  if (!map_from_root) return;
  const auto written = graph_->WriteTransform(
      {mapper_.track().newest_ns() + kAhead_ns, options_.settings.MapFrame(), root, *map_from_root});
  if (!written) log_.Note(inputs_[kTf].topic, written.error().text);
}

void RosBridge::PublishMap(Time now) {
  if (now - map_written_ < kMapPeriod) return;
  const OdometryTrack& track = mapper_.track();
  // Simulated time is known from odometry alone.
  if (IsMapOfOthers() || (track.is_empty() && options_.settings.is_simulated_time)) return;
  Eigen::Vector2d robot_m = Eigen::Vector2d::Zero();
  const std::optional<Pose> map_from_track = link_.TeamFromTrack();
  if (map_from_track && !track.is_empty()) {
    robot_m = (*map_from_track * *track.PoseAt(track.newest_ns())).position_m.head<2>();
  }
  std::optional<TeamMapImage::Picture> picture = link_.TakeNewMap(robot_m);
  if (!picture) return;
  map_written_ = now;
  picture->grid.timestamp_ns = track.is_empty() ? UtcNowNs() : track.newest_ns();
  picture->grid.frame = options_.settings.MapFrame();
  if (picture->is_partial) {
    log_.Note(options_.settings.MapTopic(),
              "the team's map is larger than 4096 cells a side: the part around the "
              "robot is published");
  }
  map_ = std::move(picture->grid);
  WriteMap();
}

void RosBridge::WriteMap() {
  if (map_.values.empty()) return;
  if (const auto written = graph_->WriteMap(map_); !written) {
    log_.Note(options_.settings.MapTopic(), written.error().text);
  }
}

bool RosBridge::IsMapOfOthers() const {
  if (!options_.settings.is_published_as_map) return false;
  return RootFrame() != FrameName(mapper_.track().frame()) || graph_->IsPublishedByOthers(options_.settings.MapTopic());
}

}  // namespace moondb
