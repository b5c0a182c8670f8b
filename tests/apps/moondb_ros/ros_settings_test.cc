#include "apps/moondb_ros/ros_settings.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(RosSettingsTest, HaveDefaults) {
  const Result<RosSettings> settings = ParseRosSettings("{}", "ros.yaml");
  ASSERT_TRUE(settings) << settings.error().text;
  EXPECT_EQ(settings->odometry_topic, "/odom");
  EXPECT_EQ(settings->scan_topic, "/scan");
  EXPECT_EQ(settings->rule.distance_m, 1);
  EXPECT_EQ(settings->rule.turn_deg, 30);
  EXPECT_EQ(settings->rule.age_s, 60);
  EXPECT_EQ(settings->MapTopic(), "/team_map");
  EXPECT_EQ(settings->EpochNs(), 0);
}

TEST(RosSettingsTest, ComeFromYaml) {
  const Result<RosSettings> settings = ParseRosSettings(
      "odom: /wheel_odom\ngrid: [/map, local]\nnamespace: robot1\nodometry: lidar\nsim_time: true\npublish_as_map: "
      "true",
      "ros.yaml");
  ASSERT_TRUE(settings) << settings.error().text;
  EXPECT_EQ(settings->TopicName(settings->odometry_topic), "/robot1/wheel_odom");
  EXPECT_THAT(settings->grid_topics, ElementsAre("/map", "local"));
  EXPECT_EQ(settings->TopicName("local"), "/robot1/local");
  EXPECT_EQ(settings->odometry_kind, proto::ODOMETRY_KIND_LIDAR);
  EXPECT_EQ(settings->EpochNs(), 1'577'836'800'000'000'000);
  EXPECT_EQ(settings->MapTopic(), "/robot1/map");
  EXPECT_EQ(settings->MapFrame(), "map");
}

TEST(RosSettingsTest, ErrorsNameThePlaceAndASuggestion) {
  const auto error_of = [](const std::string& yaml) {
    const Result<RosSettings> settings = ParseRosSettings(yaml, "ros.yaml");
    return settings ? std::string() : settings.error().text;
  };
  EXPECT_THAT(error_of("odm: /odom"), HasSubstr("ros.yaml:1:1"));
  EXPECT_THAT(error_of("odm: /odom"), HasSubstr("did you mean \"odom\"?"));
  EXPECT_THAT(error_of("scan: /scan\nnode_distance_m: 0"), HasSubstr("ros.yaml:2:18: node_distance_m"));
  EXPECT_THAT(error_of("domain_id: 233"), HasSubstr("domain_id"));
  EXPECT_THAT(error_of("odometry: visual"), HasSubstr("wheel"));
  EXPECT_THAT(error_of("sim_epoch: yesterday"), HasSubstr("expected a time such as"));
  EXPECT_THAT(error_of("[1, 2"), HasSubstr("ros.yaml:1"));
}

}  // namespace
}  // namespace moondb
