// ros_robot: a simulated robot in a small building, as a ROS 2 graph shows it: /odom with the errors of wheels, /scan,
// /tf_static. Drives for some simulated seconds, then stands until SIGTERM. Receives /team_map and /tf as Nav2 does,
// prints a line for each map and for the first transform, and at the end what it received:
//   map WIDTH HEIGHT CELL_M KNOWN_CELLS HAZARD_CELLS MAPS_RECEIVED HASH      (HASH: of the origin and all cells)
//   placed X Y YAW TRUE_X TRUE_Y TRUE_YAW      (pose in team_map by tf, and the true pose), or `not placed`
// --map writes the last map as a picture, --truth a line `seconds x y yaw` with the true pose of each whole second.
//
// Usage: ros_robot --robot 1 [--namespace robot1] [--seconds 60] [--speed 1] [--domain 0] [--map FILE.png]
//                  [--truth FILE]
#include <dds/dds.h>
#include <signal.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "model/cell_colors.h"
#include "model/geometry.h"
#include "model/png.h"
#include "tests/apps/moondb_ros/dds/ros_peer.h"
#include "tests/apps/moondb_ros/dds/simulated_building.h"

namespace moondb {
namespace {

volatile sig_atomic_t is_ended = 0;

struct Arguments {
  int robot = 1;
  std::string name_space;
  double seconds = 60;
  double speed = 1;
  std::uint32_t domain_id = 0;
  std::string map_file;
  std::string truth_file;
};

class Robot {
 public:
  explicit Robot(const Arguments& arguments)
      : arguments_(arguments),
        way_(WayOf(arguments.robot)),
        random_(static_cast<unsigned>(arguments.robot)),
        peer_(arguments.domain_id) {
    const std::string prefix = arguments.name_space.empty() ? "rt" : "rt/" + arguments.name_space;
    odometry_ = peer_.Writer(nav_msgs_msg_dds__Odometry__desc, prefix + "/odom", {});
    scan_ = peer_.Writer(sensor_msgs_msg_dds__LaserScan__desc, prefix + "/scan", {.is_reliable = false, .depth = 5});
    static_ = peer_.Writer(tf2_msgs_msg_dds__TFMessage__desc, prefix + "/tf_static",
                           {.is_transient_local = true, .depth = 1});
    map_ = peer_.Reader(nav_msgs_msg_dds__OccupancyGrid__desc, prefix + "/team_map",
                        {.is_transient_local = true, .depth = 1});
    tf_ = peer_.Reader(tf2_msgs_msg_dds__TFMessage__desc, prefix + "/tf", {.depth = 100});
    position_m_ = way_[0];
    yaw_rad_ = Heading();
  }

  void Run() {
    PublishStatic();
    const auto start = std::chrono::steady_clock::now();
    const auto step = std::chrono::duration<double>(kStep_s / arguments_.speed);
    const int steps = static_cast<int>(arguments_.seconds / kStep_s);
    for (int i = 0; i < steps; ++i) {
      std::this_thread::sleep_until(start + i * std::chrono::duration_cast<std::chrono::nanoseconds>(step));
      time_s_ = i * kStep_s;
      Move();
      ObserveTruth(i);
      PublishOdometry();
      if (i % 2 == 0) PublishScan();
      Receive();
    }
    while (is_ended == 0) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      time_s_ += kStep_s;
      PublishOdometry();
      PublishScan();
      Receive();
    }
    Report();
  }

 private:
  static constexpr double kStep_s = 0.05;
  static constexpr double kSpeed_m_s = 0.5;
  static constexpr double kTurn_rad_s = 0.8;

  double Heading() const {
    const Eigen::Vector2d to = way_[target_] - position_m_;
    return std::atan2(to.y(), to.x());
  }

  // Turns toward the next point of the way, then drives to it. Odometry: 1 % of scale, 2 % of noise, some drift in yaw.
  void Move() {
    if ((way_[target_] - position_m_).norm() < 0.05) target_ = (target_ + 1) % way_.size();
    const double left_rad = std::remainder(Heading() - yaw_rad_, 2 * M_PI);
    std::normal_distribution<double> noise(0, 1);
    double turn_rad = 0;
    double way_m = 0;
    if (std::abs(left_rad) > 0.02) {
      turn_rad = std::clamp(left_rad, -kTurn_rad_s * kStep_s, kTurn_rad_s * kStep_s);
    } else {
      way_m = std::min(kSpeed_m_s * kStep_s, (way_[target_] - position_m_).norm());
    }
    yaw_rad_ += turn_rad;
    position_m_ += way_m * Eigen::Vector2d(std::cos(yaw_rad_), std::sin(yaw_rad_));
    odom_yaw_rad_ += turn_rad * (1 + 0.01 * noise(random_)) + 0.002 * way_m * noise(random_) / std::sqrt(kStep_s);
    const double odom_way_m = way_m * (1.01 + 0.02 * noise(random_));
    odom_m_ += odom_way_m * Eigen::Vector2d(std::cos(odom_yaw_rad_), std::sin(odom_yaw_rad_));
  }

  void ObserveTruth(int step) {
    if (arguments_.truth_file.empty() || step % static_cast<int>(1 / kStep_s) != 0) return;
    if (!truth_.is_open()) truth_.open(arguments_.truth_file);
    truth_ << std::lround(time_s_) << " " << position_m_.x() << " " << position_m_.y() << " " << yaw_rad_ << std::endl;
  }

  std_msgs_msg_dds__Header_ Header(const char* frame) const {
    std_msgs_msg_dds__Header_ header{};
    header.stamp.sec = static_cast<std::int32_t>(time_s_);
    header.stamp.nanosec = static_cast<std::uint32_t>((time_s_ - header.stamp.sec) * 1e9);
    header.frame_id = const_cast<char*>(frame);
    return header;
  }

  void PublishStatic() {
    geometry_msgs_msg_dds__TransformStamped_ stamped{};
    stamped.header = Header("base_link");
    char laser[] = "laser";
    stamped.child_frame_id = laser;
    stamped.transform = {{0.1, 0, 0.2}, {0, 0, 0, 1}};
    tf2_msgs_msg_dds__TFMessage_ message{};
    message.transforms._buffer = &stamped;
    message.transforms._length = message.transforms._maximum = 1;
    (void)dds_write(static_, &message);
  }

  void PublishOdometry() {
    nav_msgs_msg_dds__Odometry_ message{};
    message.header = Header("odom");
    char base[] = "base_link";
    message.child_frame_id = base;
    message.pose.pose.position = {odom_m_.x(), odom_m_.y(), 0};
    message.pose.pose.orientation = {0, 0, std::sin(odom_yaw_rad_ / 2), std::cos(odom_yaw_rad_ / 2)};
    (void)dds_write(odometry_, &message);
  }

  void PublishScan() {
    constexpr int kRays = 360;
    std::vector<float> ranges(kRays);
    const Eigen::Vector2d scanner_m = position_m_ + 0.1 * Eigen::Vector2d(std::cos(yaw_rad_), std::sin(yaw_rad_));
    std::normal_distribution<double> noise(0, 0.01);
    for (int i = 0; i < kRays; ++i) {
      const double range_m = RangeTo(walls_, scanner_m, yaw_rad_ - M_PI + i * 2 * M_PI / kRays, 8);
      ranges[static_cast<std::size_t>(i)] =
          range_m < 8 ? static_cast<float>(range_m + noise(random_)) : std::numeric_limits<float>::infinity();
    }
    sensor_msgs_msg_dds__LaserScan_ message{};
    message.header = Header("laser");
    message.angle_min = static_cast<float>(-M_PI);
    message.angle_max = static_cast<float>(M_PI);
    message.angle_increment = static_cast<float>(2 * M_PI / kRays);
    message.range_min = 0.1F;
    message.range_max = 8;
    message.ranges._buffer = ranges.data();
    message.ranges._length = message.ranges._maximum = kRays;
    (void)dds_write(scan_, &message);
  }

  void Receive() {
    while (RosPeer::Take<nav_msgs_msg_dds__OccupancyGrid_>(map_, [this](const auto& message) {
      ++map_count_;
      info_ = message.info;
      cells_.assign(message.data._buffer, message.data._buffer + message.data._length);
      std::printf("at %.0f s: a map of %.1f x %.1f m, %td known cells\n", time_s_, info_.width * info_.resolution,
                  info_.height * info_.resolution, KnownCells());
      std::fflush(stdout);
    })) {
    }
    while (RosPeer::Take<tf2_msgs_msg_dds__TFMessage_>(tf_, [this](const auto& message) {
      const auto& transform = message.transforms._buffer[0].transform;
      team_from_odom_ = {{transform.translation.x, transform.translation.y, transform.translation.z},
                         {transform.rotation.w, transform.rotation.x, transform.rotation.y, transform.rotation.z}};
      if (!has_transform_) std::printf("at %.0f s: the first transform from team_map to odom\n", time_s_);
      std::fflush(stdout);
      has_transform_ = true;
    })) {
    }
  }

  void Report() const {
    std::printf("map %u %u %.3f %td %td %d %zx\n", info_.width, info_.height, static_cast<double>(info_.resolution),
                KnownCells(), std::count(cells_.begin(), cells_.end(), 100), map_count_, MapHash());
    const Pose pose = team_from_odom_ * Pose::FromPlanar(odom_m_.x(), odom_m_.y(), odom_yaw_rad_);
    if (has_transform_) {
      std::printf("placed %.3f %.3f %.3f %.3f %.3f %.3f\n", pose.position_m.x(), pose.position_m.y(), pose.Yaw(),
                  position_m_.x(), position_m_.y(), std::remainder(yaw_rad_, 2 * M_PI));
    } else {
      std::printf("not placed\n");
    }
    if (arguments_.map_file.empty() || cells_.empty()) return;
    const std::array<Color, 3>& colors = CellColors();
    Image image(static_cast<int>(info_.width), static_cast<int>(info_.height), 3);
    for (int row = 0; row < image.height; ++row) {
      for (int column = 0; column < image.width; ++column) {
        const std::int8_t value = cells_[static_cast<std::size_t>(row) * info_.width + static_cast<unsigned>(column)];
        const Color& color = colors[value < 0 ? 0 : value == 0 ? 1 : 2];
        std::ranges::copy(color, image.At(column, image.height - 1 - row));
      }
    }
    const Result<std::string> bytes = PngBytes(image);
    if (bytes) std::ofstream(arguments_.map_file, std::ios::binary) << *bytes;
  }

  std::ptrdiff_t KnownCells() const {
    return static_cast<std::ptrdiff_t>(cells_.size()) - std::count(cells_.begin(), cells_.end(), -1);
  }

  std::size_t MapHash() const {
    std::string bytes(reinterpret_cast<const char*>(cells_.data()), cells_.size());
    bytes.append(reinterpret_cast<const char*>(&info_.origin), sizeof info_.origin);
    return std::hash<std::string>()(bytes);
  }

  const Arguments arguments_;
  const std::vector<Wall> walls_ = Building();
  const std::vector<Eigen::Vector2d> way_;
  std::mt19937 random_;
  RosPeer peer_;
  dds_entity_t odometry_, scan_, static_, map_, tf_;
  std::size_t target_ = 1;
  double time_s_ = 0;
  Eigen::Vector2d position_m_;
  double yaw_rad_ = 0;
  Eigen::Vector2d odom_m_ = Eigen::Vector2d::Zero();
  double odom_yaw_rad_ = 0;
  int map_count_ = 0;
  nav_msgs_msg_dds__MapMetaData_ info_{};
  std::vector<std::int8_t> cells_;
  std::ofstream truth_;
  bool has_transform_ = false;
  Pose team_from_odom_;
};

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  moondb::Arguments arguments;
  moondb::ForEachOption(argc, argv, [&arguments](const std::string& name, const char* value) {
    if (name == "--robot") arguments.robot = std::atoi(value);
    if (name == "--namespace") arguments.name_space = value;
    if (name == "--seconds") arguments.seconds = std::atof(value);
    if (name == "--speed") arguments.speed = std::atof(value);
    if (name == "--domain") arguments.domain_id = static_cast<std::uint32_t>(std::atoi(value));
    if (name == "--truth") arguments.truth_file = value;
    if (name == "--map") arguments.map_file = value;
  });
  signal(SIGTERM, [](int) { moondb::is_ended = 1; });
  // As ROS 2 Jazzy's middleware with automatic discovery on this computer alone.
  const dds_entity_t domain = dds_create_domain(
      arguments.domain_id,
      "<CycloneDDS><Domain Id=\"any\"><General><Interfaces><NetworkInterface name=\"lo\"/></Interfaces>"
      "<AllowMulticast>false</AllowMulticast></General><Discovery><ParticipantIndex>auto</ParticipantIndex>"
      "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex><Peers><Peer address=\"localhost\"/></Peers></Discovery>"
      "</Domain></CycloneDDS>");
  if (domain < 0) return 1;
  moondb::Robot(arguments).Run();
  return 0;
}
