// ros_listener: a ROS 2 program that waits for the team's map, with the Cyclone settings of its command line. Joins the
// domain, prints `received SECONDS` once the map has come, stays for --hold seconds, prints `newest TIMESTAMP` of the
// last map, and leaves; all that --times times. Publishes odometry on --odom meanwhile. Ends with 1 if a map does not
// come within --limit seconds.
//
// With --write SIDE it is the other side: a RosGraph that has written a map of SIDE x SIDE cells, for --hold seconds.
// With --times it writes each second a map whose timestamp is its number, and prints `wrote TIMESTAMP SECONDS`.
//
// Usage: ros_listener --domain 8 --topic team_map [--config XML] [--limit 50] [--times 1] [--hold 0] [--odom odom2]
//                     [--write 4000]
#include <dds/dds.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

#include "apps/moondb_ros/dds/ros_graph.h"
#include "tests/apps/moondb_ros/dds/ros_peer.h"

namespace moondb {
namespace {

using Clock = std::chrono::steady_clock;
constexpr auto kStep = std::chrono::milliseconds(50);

struct Arguments {
  std::uint32_t domain_id = 0;
  std::string topic = "team_map";
  std::string config;  // Elements of Cyclone's <Domain>.
  std::string odometry_topic;
  double limit_s = 50;
  double hold_s = 0;
  int times = 1;
  std::uint32_t write_side_cells = 0;
};

double SecondsSince(Clock::time_point start) { return std::chrono::duration<double>(Clock::now() - start).count(); }

bool Write(const Arguments& arguments) {
  RosGraph::Options options;
  options.domain_id = arguments.domain_id;
  options.map_topic = "/" + arguments.topic;
  const auto graph = RosGraph::Join(options, {});
  if (!graph) return false;
  RosGrid map;
  map.frame = "team_map";
  map.resolution_m = 0.05;
  map.width = map.height = arguments.write_side_cells;
  map.values.assign(std::size_t{map.width} * map.height, 0);
  for (std::size_t i = 0; i < map.values.size(); i += 7) map.values[i] = 100;
  if (!(*graph)->WriteMap(map)) return false;
  std::printf("written\n");
  std::fflush(stdout);
  const auto start = Clock::now();
  for (int number = 1; number < arguments.times; ++number) {
    while (SecondsSince(start) < number) (*graph)->Spin(kStep);
    map.timestamp_ns = number * 1'000'000'000LL;
    const auto before = Clock::now();
    const Result<void> written = (*graph)->WriteMap(map);
    std::printf("wrote %d %.3f %s\n", number, SecondsSince(before), written ? "" : written.error().text.c_str());
    std::fflush(stdout);
  }
  while (SecondsSince(start) < arguments.hold_s) (*graph)->Spin(kStep);
  return true;
}

bool Listen(const Arguments& arguments) {
  const auto start = Clock::now();
  const std::string config = "<CycloneDDS><Domain Id=\"any\">" + arguments.config + "</Domain></CycloneDDS>";
  const dds_entity_t domain = dds_create_domain(arguments.domain_id, config.c_str());
  if (domain < 0) {
    std::printf("no participant\n");
    return false;
  }
  bool is_received = false;
  std::int32_t newest_s = 0;
  {
    RosPeer peer(arguments.domain_id);
    const dds_entity_t map = peer.Reader(nav_msgs_msg_dds__OccupancyGrid__desc, "rt/" + arguments.topic,
                                         {.is_transient_local = true, .depth = 1});
    dds_entity_t odometry = 0;
    if (!arguments.odometry_topic.empty()) {
      odometry = peer.Writer(nav_msgs_msg_dds__Odometry__desc, "rt/" + arguments.odometry_topic, {});
    }
    nav_msgs_msg_dds__Odometry_ message{};
    char frame[] = "odom";
    char child[] = "base_link";
    message.header.frame_id = frame;
    message.child_frame_id = child;
    message.pose.pose.orientation.w = 1;
    Clock::time_point received_at = start;
    while (is_received ? SecondsSince(received_at) < arguments.hold_s : SecondsSince(start) < arguments.limit_s) {
      if (odometry > 0) (void)dds_write(odometry, &message);
      message.header.stamp.nanosec += 1'000'000;
      const auto see = [&](const nav_msgs_msg_dds__OccupancyGrid_& grid) { newest_s = grid.header.stamp.sec; };
      if (RosPeer::Take<nav_msgs_msg_dds__OccupancyGrid_>(map, see) && !is_received) {
        is_received = true;
        received_at = Clock::now();
        std::printf("received %.2f\n", SecondsSince(start));
        std::fflush(stdout);
      }
      std::this_thread::sleep_for(kStep);
    }
  }
  if (is_received) std::printf("newest %d\n", newest_s);
  (void)dds_delete(domain);
  return is_received;
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  moondb::Arguments arguments;
  moondb::ForEachOption(argc, argv, [&arguments](const std::string& name, const char* value) {
    if (name == "--domain") arguments.domain_id = static_cast<std::uint32_t>(std::atoi(value));
    if (name == "--topic") arguments.topic = value;
    if (name == "--config") arguments.config = value;
    if (name == "--odom") arguments.odometry_topic = value;
    if (name == "--limit") arguments.limit_s = std::atof(value);
    if (name == "--hold") arguments.hold_s = std::atof(value);
    if (name == "--write") arguments.write_side_cells = static_cast<std::uint32_t>(std::atoi(value));
    if (name == "--times") arguments.times = std::atoi(value);
  });
  if (arguments.write_side_cells > 0) return moondb::Write(arguments) ? 0 : 1;
  for (int i = 0; i < arguments.times; ++i) {
    if (!moondb::Listen(arguments)) return 1;
  }
  return 0;
}
