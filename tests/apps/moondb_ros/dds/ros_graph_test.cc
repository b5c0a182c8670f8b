// Tests moondb_ros's side of DDS with a second participant in this process. Waits are loops with a limit, and end as
// soon as the message is there.
#include "apps/moondb_ros/dds/ros_graph.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <limits>

#include "tests/apps/moondb_ros/dds/ros_peer.h"

namespace moondb {
namespace {

using testing::ElementsAre;

class RosGraphTest : public testing::Test {
 protected:
  void Join(std::int64_t epoch_ns = 0) {
    RosGraph::Options options;
    options.domain_id = domain_id_;
    options.inputs = {{"/" + prefix_ + "/odom", RosGraph::Type::kOdometry},
                      {"/" + prefix_ + "/tf_static", RosGraph::Type::kTransforms, /*is_latched=*/true},
                      {"/" + prefix_ + "/scan", RosGraph::Type::kScan},
                      {"/" + prefix_ + "/grid", RosGraph::Type::kGrid},
                      {"/" + prefix_ + "/tf", RosGraph::Type::kTransforms}};
    options.map_topic = "/" + prefix_ + "/team_map";
    options.tf_topic = "/" + prefix_ + "/tf";
    options.epoch_ns = epoch_ns;
    RosGraph::Handlers handlers;
    handlers.on_odometry = [this](std::size_t, const RosOdometry& message) { odometry_.push_back(message); };
    handlers.on_scan = [this](std::size_t, RosScan message) { scans_.push_back(std::move(message)); };
    handlers.on_grid = [this](std::size_t, RosGrid message) { grids_.push_back(std::move(message)); };
    handlers.on_transform = [this](std::size_t, const RosTransform& message) { transforms_.push_back(message); };
    handlers.on_other_type = [this](std::size_t input, const std::string& type, const std::string&) {
      other_types_[input] = type;
    };
    auto joined = RosGraph::Join(std::move(options), std::move(handlers));
    ASSERT_TRUE(joined) << joined.error().text;
    graph_ = *std::move(joined);
    peer_ = std::make_unique<RosPeer>(domain_id_);
  }
  ~RosGraphTest() override { peer_.reset(); }

  // Name of a topic on DDS.
  std::string Named(const std::string& topic) const { return "rt/" + prefix_ + "/" + topic; }

  template <typename Condition>
  bool SpinUntil(const Condition& condition) {
    for (int i = 0; i < kStepsMax; ++i) {
      if (condition()) return true;
      graph_->Spin(std::chrono::milliseconds(50));
    }
    return false;
  }

  static RosGrid SmallMap(std::int8_t value) {
    RosGrid map;
    map.timestamp_ns = 1'700'000'000'250'000'000;
    map.frame = "team_map";
    map.resolution_m = 0.05;
    map.width = 3;
    map.height = 2;
    map.frame_from_origin.position_m = {-3.2, 6.4, 0};
    map.values = {-1, 0, 100, value, 0, -1};
    return map;
  }

  const std::uint32_t domain_id_ = 77;
  const std::string prefix_ = "test" + std::to_string(::getpid());  // Tests that run side by side do not meet.
  std::unique_ptr<RosGraph> graph_;
  std::unique_ptr<RosPeer> peer_;
  std::vector<RosOdometry> odometry_;
  std::vector<RosScan> scans_;
  std::vector<RosGrid> grids_;
  std::vector<RosTransform> transforms_;
  std::map<std::size_t, std::string> other_types_;
};

TEST_F(RosGraphTest, ReadsOdometryOfAReliablePublisher) {
  Join();
  const dds_entity_t writer = peer_->Writer(nav_msgs_msg_dds__Odometry__desc, Named("odom"), {});
  nav_msgs_msg_dds__Odometry_ message{};
  message.header.stamp = {1'700'000'000, 500'000'000};
  char frame[] = "odom";
  char child[] = "base_link";
  message.header.frame_id = frame;
  message.child_frame_id = child;
  message.pose.pose.position = {1, 2, 3};
  message.pose.pose.orientation = {0, 0, 0.6, 0.8};
  // As drivers state what they do not measure.
  constexpr double kCovariances[] = {1e308, 1e10, 0, std::numeric_limits<double>::quiet_NaN()};
  for (std::size_t i = 0; i < std::size(message.pose.covariance); ++i) message.pose.covariance[i] = kCovariances[i % 4];
  ASSERT_TRUE(SpinUntil([&] {
    (void)dds_write(writer, &message);
    return !odometry_.empty();
  }));
  EXPECT_EQ(odometry_[0].timestamp_ns, 1'700'000'000'500'000'000);
  EXPECT_EQ(odometry_[0].frame, "odom");
  EXPECT_EQ(odometry_[0].child, "base_link");
  EXPECT_EQ(odometry_[0].frame_from_child.position_m, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(odometry_[0].frame_from_child.orientation.z(), 0.6);
  EXPECT_EQ(odometry_[0].frame_from_child.orientation.w(), 0.8);
  ASSERT_EQ(graph_->PublishersOf(0).size(), 1u);
  EXPECT_TRUE(graph_->PublishersOf(0)[0].is_reliable);
  EXPECT_FALSE(graph_->PublishersOf(0)[0].is_transient_local);
}

TEST_F(RosGraphTest, ReadsScansOfABestEffortPublisher) {
  Join(/*epoch_ns=*/1'577'836'800'000'000'000);
  const dds_entity_t writer =
      peer_->Writer(sensor_msgs_msg_dds__LaserScan__desc, Named("scan"), {.is_reliable = false, .depth = 5});
  sensor_msgs_msg_dds__LaserScan_ message{};
  message.header.stamp = {12, 5};
  char frame[] = "laser";
  message.header.frame_id = frame;
  message.angle_min = -1;
  message.angle_increment = 0.5F;
  message.range_max = 10;
  float ranges[] = {1, 2, 3};
  message.ranges._buffer = ranges;
  message.ranges._length = message.ranges._maximum = 3;
  ASSERT_TRUE(SpinUntil([&] {
    (void)dds_write(writer, &message);
    return !scans_.empty();
  }));
  EXPECT_EQ(scans_[0].timestamp_ns, 1'577'836'812'000'000'005) << "simulated time counts from the epoch";
  EXPECT_THAT(scans_[0].ranges_m, ElementsAre(1, 2, 3));
  EXPECT_EQ(scans_[0].angle_increment_rad, 0.5);
}

TEST_F(RosGraphTest, ReadsStaticTransformsThatWerePublishedBefore) {
  Join();
  // A publisher that keeps no messages does not hide those of the next one.
  (void)peer_->Writer(tf2_msgs_msg_dds__TFMessage__desc, Named("tf_static"), {});
  constexpr std::size_t kStatic = 1;
  ASSERT_TRUE(SpinUntil([&] { return !graph_->PublishersOf(kStatic).empty(); }));
  const dds_entity_t writer =
      peer_->Writer(tf2_msgs_msg_dds__TFMessage__desc, Named("tf_static"), {.is_transient_local = true, .depth = 1});
  geometry_msgs_msg_dds__TransformStamped_ stamped[2] = {};
  char base[] = "base_link";
  char laser[] = "laser";
  char camera[] = "camera";
  stamped[0].header.frame_id = stamped[1].header.frame_id = base;
  stamped[0].child_frame_id = laser;
  stamped[1].child_frame_id = camera;
  stamped[0].transform = {{0.2, 0, 0.3}, {0, 0, 0, 1}};
  stamped[1].transform = {{0.1, 0, 0.3}, {0, 0, 0, 1}};
  tf2_msgs_msg_dds__TFMessage_ message{};
  message.transforms._buffer = stamped;
  message.transforms._length = message.transforms._maximum = 2;
  ASSERT_EQ(dds_write(writer, &message), DDS_RETCODE_OK);
  ASSERT_TRUE(SpinUntil([&] { return transforms_.size() == 2; }));
  EXPECT_EQ(transforms_[0].child, "laser");
  EXPECT_EQ(transforms_[0].parent_from_child.position_m.x(), 0.2);
  EXPECT_EQ(transforms_[1].child, "camera");
}

TEST_F(RosGraphTest, ALateReaderGetsTheMap) {
  Join();
  ASSERT_TRUE(graph_->WriteMap(SmallMap(0)));
  ASSERT_TRUE(graph_->WriteMap(SmallMap(100)));
  const dds_entity_t reader =
      peer_->Reader(nav_msgs_msg_dds__OccupancyGrid__desc, Named("team_map"), {.is_transient_local = true, .depth = 1});
  std::vector<std::int8_t> cells;
  nav_msgs_msg_dds__MapMetaData_ info{};
  std::string frame;
  ASSERT_TRUE(SpinUntil([&] {
    return RosPeer::Take<nav_msgs_msg_dds__OccupancyGrid_>(reader, [&](const auto& message) {
      cells.assign(message.data._buffer, message.data._buffer + message.data._length);
      info = message.info;
      frame = message.header.frame_id;
    });
  }));
  EXPECT_THAT(cells, ElementsAre(-1, 0, 100, 100, 0, -1));
  EXPECT_EQ(frame, "team_map");
  EXPECT_EQ(info.width, 3u);
  EXPECT_EQ(info.height, 2u);
  EXPECT_FLOAT_EQ(info.resolution, 0.05F);
  EXPECT_EQ(info.origin.position.x, -3.2);
  EXPECT_EQ(info.origin.orientation.w, 1);
}

TEST_F(RosGraphTest, AVolatileReaderGetsTheMapThatWasWrittenBefore) {
  Join();
  ASSERT_TRUE(graph_->WriteMap(SmallMap(100)));
  const dds_entity_t reader = peer_->Reader(nav_msgs_msg_dds__OccupancyGrid__desc, Named("team_map"), {.depth = 5});
  bool is_seen = false;
  EXPECT_TRUE(SpinUntil([&] {
    return RosPeer::Take<nav_msgs_msg_dds__OccupancyGrid_>(
        reader, [&](const auto& message) { is_seen = message.data._length == 6; });
  }));
  EXPECT_TRUE(is_seen);
}

TEST_F(RosGraphTest, WritesTransforms) {
  Join();
  const dds_entity_t reader = peer_->Reader(tf2_msgs_msg_dds__TFMessage__desc, Named("tf"), {.depth = 100});
  RosTransform transform{1'700'000'000'000'000'007, "team_map", "odom", Pose::FromPlanar(4, 5, 0)};
  bool is_right = false;
  EXPECT_TRUE(SpinUntil([&] {
    (void)graph_->WriteTransform(transform);
    return RosPeer::Take<tf2_msgs_msg_dds__TFMessage_>(reader, [&](const auto& message) {
      const auto& stamped = message.transforms._buffer[0];
      is_right = message.transforms._length == 1 && stamped.header.stamp.sec == 1'700'000'000 &&
                 stamped.header.stamp.nanosec == 7 && std::string(stamped.header.frame_id) == "team_map" &&
                 std::string(stamped.child_frame_id) == "odom" && stamped.transform.translation.y == 5;
    });
  }));
  EXPECT_TRUE(is_right);
}

TEST_F(RosGraphTest, ReadsTransformsOfOthersAndNotItsOwn) {
  Join();
  const dds_entity_t writer = peer_->Writer(tf2_msgs_msg_dds__TFMessage__desc, Named("tf"), {.depth = 100});
  geometry_msgs_msg_dds__TransformStamped_ stamped{};
  char odom[] = "odom";
  char base[] = "base_link";
  stamped.header.frame_id = odom;
  stamped.child_frame_id = base;
  stamped.transform.rotation.w = 1;
  tf2_msgs_msg_dds__TFMessage_ message{};
  message.transforms._buffer = &stamped;
  message.transforms._length = message.transforms._maximum = 1;
  ASSERT_TRUE(SpinUntil([&] {
    (void)graph_->WriteTransform({1'700'000'000'000'000'000, "team_map", "odom", Pose()});
    (void)dds_write(writer, &message);
    return transforms_.size() >= 5;
  }));
  for (const RosTransform& transform : transforms_) EXPECT_EQ(transform.parent, "odom");
}

TEST_F(RosGraphTest, NamesAPublisherOfAnotherType) {
  Join();
  (void)peer_->Writer(sensor_msgs_msg_dds__LaserScan__desc, Named("odom"), {});
  ASSERT_TRUE(SpinUntil([&] { return !other_types_.empty(); }));
  EXPECT_EQ(other_types_[0], "sensor_msgs::msg::dds_::LaserScan_");
  EXPECT_TRUE(odometry_.empty());
}

TEST_F(RosGraphTest, ReadsOnWhenAWeakerPublisherJoins) {
  Join();
  const dds_entity_t reliable = peer_->Writer(nav_msgs_msg_dds__Odometry__desc, Named("odom"), {});
  nav_msgs_msg_dds__Odometry_ message{};
  char frame[] = "odom";
  message.header.frame_id = message.child_frame_id = frame;
  ASSERT_TRUE(SpinUntil([&] {
    (void)dds_write(reliable, &message);
    return !odometry_.empty();
  }));
  const dds_entity_t weaker = peer_->Writer(nav_msgs_msg_dds__Odometry__desc, Named("odom"), {.is_reliable = false});
  message.header.stamp.sec = 77;
  EXPECT_TRUE(SpinUntil([&] {
    (void)dds_write(weaker, &message);
    return odometry_.back().timestamp_ns == 77'000'000'000;
  }));
}

TEST_F(RosGraphTest, AnnouncesRosTypeHashes) {
  Join();
  const dds_entity_t reader = peer_->Reader(nav_msgs_msg_dds__OccupancyGrid__desc, Named("team_map"), {});
  std::string user_data;
  ASSERT_TRUE(SpinUntil([&] {
    dds_instance_handle_t writer = 0;
    if (dds_get_matched_publications(reader, &writer, 1) < 1) return false;
    dds_builtintopic_endpoint_t* endpoint = dds_get_matched_publication_data(reader, writer);
    void* bytes = nullptr;
    std::size_t size = 0;
    if (dds_qget_userdata(endpoint->qos, &bytes, &size)) user_data.assign(static_cast<char*>(bytes), size);
    dds_free(bytes);
    dds_builtintopic_free_endpoint(endpoint);
    return true;
  }));
  EXPECT_EQ(user_data, "typehash=RIHS01_8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7;");
}

}  // namespace
}  // namespace moondb
