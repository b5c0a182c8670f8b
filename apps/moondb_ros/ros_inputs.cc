#include "apps/moondb_ros/ros_inputs.h"

#include <utility>

namespace moondb {

std::vector<RosGraph::Input> InputsOf(const RosSettings& settings) {
  std::vector<RosGraph::Input> inputs = {
      {settings.TopicName(settings.odometry_topic), RosGraph::Type::kOdometry},
      {settings.TopicName("/tf"), RosGraph::Type::kTransforms},
      {settings.TopicName("/tf_static"), RosGraph::Type::kTransforms, /*is_latched=*/true},
  };
  for (const std::string& topic : settings.grid_topics) {
    inputs.push_back({settings.TopicName(topic), RosGraph::Type::kGrid});
  }
  if (settings.grid_topics.empty()) {
    inputs.push_back({settings.TopicName(settings.scan_topic), RosGraph::Type::kScan});
  }
  return inputs;
}

RobotMapper::Options MapperOptionsOf(const RosSettings& settings) {
  RobotMapper::Options mapper;
  mapper.rule = settings.rule;
  mapper.odometry_kind = settings.odometry_kind;
  mapper.odometry_topic = settings.TopicName(settings.odometry_topic);
  mapper.scan_topic = settings.TopicName(settings.scan_topic);
  for (const std::string& topic : settings.grid_topics) mapper.grid_topics.push_back(settings.TopicName(topic));
  return mapper;
}

RosGraph::Handlers HandlersFor(const std::vector<RosGraph::Input>& inputs, RobotMapper& mapper, TopicLog& log,
                               std::function<void(std::size_t input, const std::string& frames)> hear,
                               std::function<void(const RosOdometry&)> on_odometry) {
  RosGraph::Handlers handlers;
  handlers.on_odometry = [hear, on_odometry = std::move(on_odometry)](std::size_t input, const RosOdometry& message) {
    hear(input, message.frame + " to " + message.child);
    on_odometry(message);
  };
  handlers.on_scan = [hear, &mapper](std::size_t input, RosScan message) {
    hear(input, message.frame);
    mapper.OnScan(std::move(message));
  };
  handlers.on_grid = [hear, &mapper](std::size_t input, RosGrid message) {
    hear(input, message.frame);
    mapper.OnGrid(input - kMapSource, std::move(message));
  };
  handlers.on_transform = [hear, &mapper](std::size_t input, const RosTransform& message) {
    hear(input, message.parent + " to " + message.child);
    mapper.OnTransform(message, input == kTfStatic);
  };
  handlers.on_other_type = [&inputs, &log](std::size_t input, const std::string& type, const std::string& expected) {
    log.Note(inputs[input].topic, "a publisher has the type " + type + ", expected " + expected);
  };
  return handlers;
}

}  // namespace moondb
