#include "apps/moondb_ros/ros_settings.h"

#include <chrono>
#include <optional>

#include "apps/common/utc.h"
#include "proto/ros.pb.h"
#include "runtime/team/field_rules.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {
std::string RosSettings::TopicName(const std::string& topic) const {
  const std::string name = topic.starts_with('/') ? topic : "/" + topic;
  if (name_space.empty()) return name;
  return (name_space.starts_with('/') ? name_space : "/" + name_space) + name;
}

Result<RosSettings> ParseRosSettings(const std::string& yaml, const std::string& name) {
  PlacedErrors errors(name);
  Places places;
  proto::RosConfig config;
  ReadYaml(yaml, &config, &places, &errors);
  if (errors.empty()) {
    CheckFields(config, places, &errors);
    FillFields(places, &config);
  }
  const std::optional<std::chrono::sys_seconds> epoch = ParseUtc(config.sim_epoch());
  if (errors.empty() && !epoch) {
    errors.Add(PlaceOf(places, "sim_epoch"), "sim_epoch", "expected a time such as 2020-01-01T00:00Z");
  }
  if (!errors.empty()) return Fail(ErrorCode::kInvalid, errors.Text());
  RosSettings settings;
  settings.team = config.team();
  settings.agent = config.agent();
  settings.data_folder = config.data_dir();
  settings.odometry_topic = config.odom();
  settings.scan_topic = config.scan();
  settings.grid_topics.assign(config.grid().begin(), config.grid().end());
  settings.name_space = config.namespace_();
  settings.rule = {config.node_distance_m(), config.node_turn_deg(), config.node_age_s()};
  settings.odometry_kind = config.odometry();
  settings.is_published_as_map = config.publish_as_map();
  settings.is_simulated_time = config.sim_time();
  settings.sim_epoch_ns = std::chrono::nanoseconds(epoch->time_since_epoch()).count();
  settings.domain_id = config.domain_id();
  return settings;
}

}  // namespace moondb
