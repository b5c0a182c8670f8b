// Tests that moondb_ros publishes no /map beside another localization. The agent is out of reach, as the map is refused
// before there is one. Waits are loops with a limit, and end as soon as the text is printed.
#include "apps/moondb_ros/ros_bridge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <mutex>

#include "apps/moondb_ros/ros_settings.h"
#include "tests/apps/moondb_ros/dds/ros_peer.h"

namespace moondb {
namespace {

using testing::HasSubstr;

class RosBridgeTest : public testing::Test {
 protected:
  RosBridgeTest() {
    RosBridge::Options options;
    options.settings = ParseRosSettings("{}", "").value();
    options.settings.domain_id = kDomain;
    options.settings.name_space = prefix_;
    options.settings.is_published_as_map = true;
    options.agent = 1;
    options.state_file = testing::TempDir() + prefix_ + ".state";
    options.connect = []() -> Result<std::unique_ptr<Client>> { return Fail(ErrorCode::kUnavailable, "no agent"); };
    options.print = [this](const std::string& line) {
      const std::lock_guard lock(mutex_);
      printed_ += line + "\n";
    };
    bridge_ = RosBridge::Start(std::move(options)).value();
    peer_ = std::make_unique<RosPeer>(kDomain);  // Later, because the first one configures the domain.
    odometry_ = peer_->Writer(nav_msgs_msg_dds__Odometry__desc, Named("odom"), {});
  }

  std::string Named(const std::string& topic) const { return "rt/" + prefix_ + "/" + topic; }

  std::string printed() {
    const std::lock_guard lock(mutex_);
    return printed_;
  }

  // Publishes odometry until the bridge has printed `text`. Returns what it printed.
  std::string PrintedUntil(const std::string& text) {
    nav_msgs_msg_dds__Odometry_ message{};
    char frame[] = "odom";
    char child[] = "base_link";
    message.header.frame_id = frame;
    message.child_frame_id = child;
    message.pose.pose.orientation.w = 1;
    for (int i = 0; i < kStepsMax && printed().find(text) == std::string::npos; ++i) {
      message.header.stamp = {1'800'000'000 + i / 20, static_cast<std::uint32_t>(i % 20) * 50'000'000};
      (void)dds_write(odometry_, &message);
      (void)bridge_->Step();
    }
    return printed();
  }

  static constexpr std::uint32_t kDomain = 78;
  static constexpr char kRefusal[] = "not published, because another program publishes it or the parent of odom";
  const std::string prefix_ = "bridge" + std::to_string(::getpid());  // Tests that run side by side do not meet.
  std::mutex mutex_;
  std::string printed_;
  std::unique_ptr<RosBridge> bridge_;
  std::unique_ptr<RosPeer> peer_;
  dds_entity_t odometry_ = 0;
};

TEST_F(RosBridgeTest, PublishesNoMapBesideAnotherPublisherOfIt) {
  peer_->Writer(nav_msgs_msg_dds__OccupancyGrid__desc, Named("map"), {.is_transient_local = true, .depth = 1});
  EXPECT_THAT(PrintedUntil(kRefusal), HasSubstr(kRefusal));
}

TEST_F(RosBridgeTest, PublishesNoMapIfTheOdometryFrameHasAParent) {
  const dds_entity_t tf =
      peer_->Writer(tf2_msgs_msg_dds__TFMessage__desc, Named("tf_static"), {.is_transient_local = true, .depth = 1});
  geometry_msgs_msg_dds__TransformStamped_ stamped{};
  char parent[] = "map";
  char child[] = "odom";
  stamped.header.frame_id = parent;
  stamped.child_frame_id = child;
  stamped.transform.rotation.w = 1;
  tf2_msgs_msg_dds__TFMessage_ message{};
  message.transforms._buffer = &stamped;
  message.transforms._length = message.transforms._maximum = 1;
  ASSERT_EQ(dds_write(tf, &message), DDS_RETCODE_OK);
  EXPECT_THAT(PrintedUntil(kRefusal), HasSubstr(kRefusal));
}

}  // namespace
}  // namespace moondb
