// ros_robot: a simulated robot in a small building, as a ROS 2 graph shows it: /odom with the errors of wheels, /scan,
// /tf_static. Drives for some simulated seconds, then stands until SIGTERM. Receives /team_map and /tf as Nav2 does,
// and prints at the end what it received:
//   map WIDTH HEIGHT CELL_M KNOWN_CELLS HAZARD_CELLS MAPS_RECEIVED
//   placed X Y YAW TRUE_X TRUE_Y TRUE_YAW      (pose in team_map by tf, and the true pose), or `not placed`

//
// Usage: ros_robot --robot 1 [--namespace robot1] [--seconds 60] [--speed 1] [--domain 0] [--map FILE.pgm]
#include <dds/dds.h>
#include <signal.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "model/geometry.h"
#include "tests/apps/moondb_ros/dds/ros_peer.h"

namespace moondb {
namespace {

volatile sig_atomic_t is_ended = 0;

struct Wall {
  Eigen::Vector2d a;
  Eigen::Vector2d b;
};

// A building of 16 x 10 m: a corridor, three rooms off it, and furniture that makes each room unlike the others.
std::vector<Wall> Building() {
  std::vector<Wall> walls;
  const auto add = [&walls](double ax, double ay, double bx, double by) { walls.push_back({{ax, ay}, {bx, by}}); };
  const auto box = [&add](double x, double y, double width, double height) {
    add(x, y, x + width, y);
    add(x + width, y, x + width, y + height);
    add(x + width, y + height, x, y + height);
    add(x, y + height, x, y);
  };
  box(0, 0, 16, 10);
  add(0, 4, 2, 4), add(3.4, 4, 7.5, 4), add(8.9, 4, 13, 4),
      add(14.4, 4, 16, 4);                         // The corridor's wall with three openings.
  add(5, 4, 5, 10), add(11, 4, 11, 10);            // Between the rooms.
  box(0.4, 8.2, 1.6, 0.8), box(3.6, 6, 0.5, 0.5);  // A table and a pillar.
  box(6, 8.5, 3, 0.6), box(9.8, 5.2, 0.6, 1.8);
  box(11.6, 6.4, 0.9, 0.9), box(14.2, 8.6, 1.4, 0.5), box(13.2, 5.4, 0.4, 0.4);
  box(5.2, 0.5, 0.7, 0.7), box(10.4, 1.2, 1.2, 0.4), box(1.2, 1.4, 0.5, 1);
  return walls;
}

// The ways of three robots, which cross in the corridor.
std::vector<Eigen::Vector2d> WayOf(int robot) {
  if (robot == 2)
    return {{8.2, 6}, {7, 7.5}, {9, 7.6}, {8.2, 4}, {8.2, 2.4}, {13.6, 2.6}, {13.7, 6}, {13.7, 3}, {8.2, 2.6}};
  if (robot == 3)
    return {{13.7, 7.6}, {14.8, 7.2}, {13.7, 5}, {13.7, 2.6}, {8.2, 2.8}, {2.7, 2.6}, {2.7, 6}, {2.7, 3}, {13.7, 3}};
  return {{2.7, 6}, {1.4, 7}, {3, 8.4}, {2.7, 4}, {2.8, 2.6}, {8.2, 2.6}, {8.2, 6.6}, {8.2, 3}, {2.7, 2.8}};
}

double RangeTo(const std::vector<Wall>& walls, const Eigen::Vector2d& from, double angle_rad, double range_max_m) {
  const Eigen::Vector2d way(std::cos(angle_rad), std::sin(angle_rad));
  double nearest_m = range_max_m;
  for (const Wall& wall : walls) {
    const Eigen::Vector2d along = wall.b - wall.a;
    const double det = way.x() * -along.y() + way.y() * along.x();
    if (std::abs(det) < 1e-9) continue;
    const Eigen::Vector2d to = wall.a - from;
    const double range_m = (to.x() * -along.y() + to.y() * along.x()) / det;
    const double part = (way.x() * to.y() - way.y() * to.x()) / det;
    if (range_m > 0 && part >= 0 && part <= 1) nearest_m = std::min(nearest_m, range_m);
  }
  return nearest_m;
}

struct Arguments {
  int robot = 1;
  std::string name_space;
  double seconds = 60;
  double speed = 1;
  std::uint32_t domain_id = 0;
  std::string map_file;
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
    })) {
    }
    while (RosPeer::Take<tf2_msgs_msg_dds__TFMessage_>(tf_, [this](const auto& message) {
      const auto& transform = message.transforms._buffer[0].transform;
      team_from_odom_ = {{transform.translation.x, transform.translation.y, transform.translation.z},
                         {transform.rotation.w, transform.rotation.x, transform.rotation.y, transform.rotation.z}};
      has_transform_ = true;
    })) {
    }
  }

  void Report() const {
    std::printf("map %u %u %.3f %td %td %d\n", info_.width, info_.height, static_cast<double>(info_.resolution),
                static_cast<std::ptrdiff_t>(cells_.size()) - std::count(cells_.begin(), cells_.end(), -1),
                std::count(cells_.begin(), cells_.end(), 100), map_count_);
    const Pose pose = team_from_odom_ * Pose::FromPlanar(odom_m_.x(), odom_m_.y(), odom_yaw_rad_);
    if (has_transform_) {
      std::printf("placed %.3f %.3f %.3f %.3f %.3f %.3f\n", pose.position_m.x(), pose.position_m.y(), pose.Yaw(),
                  position_m_.x(), position_m_.y(), std::remainder(yaw_rad_, 2 * M_PI));
    } else {
      std::printf("not placed\n");
    }
    if (arguments_.map_file.empty() || cells_.empty()) return;
    std::ofstream file(arguments_.map_file, std::ios::binary);
    file << "P5\n" << info_.width << " " << info_.height << "\n255\n";
    for (std::uint32_t row = info_.height; row-- > 0;) {
      for (std::uint32_t column = 0; column < info_.width; ++column) {
        const std::int8_t value = cells_[static_cast<std::size_t>(row) * info_.width + column];
        file.put(static_cast<char>(value < 0 ? 205 : value == 0 ? 254 : 0));
      }
    }
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
  bool has_transform_ = false;
  Pose team_from_odom_;
};

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  moondb::Arguments arguments;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i];
    if (name == "--robot") arguments.robot = std::atoi(argv[i + 1]);
    if (name == "--namespace") arguments.name_space = argv[i + 1];
    if (name == "--seconds") arguments.seconds = std::atof(argv[i + 1]);
    if (name == "--speed") arguments.speed = std::atof(argv[i + 1]);
    if (name == "--domain") arguments.domain_id = static_cast<std::uint32_t>(std::atoi(argv[i + 1]));
    if (name == "--map") arguments.map_file = argv[i + 1];
  }
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
