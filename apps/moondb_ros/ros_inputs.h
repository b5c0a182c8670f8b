// The inputs of moondb_ros: which topics it reads, and how their messages reach a RobotMapper.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "apps/moondb_ros/dds/ros_graph.h"
#include "apps/moondb_ros/robot_mapper.h"
#include "apps/moondb_ros/ros_settings.h"
#include "apps/moondb_ros/topic_log.h"

namespace moondb {

// The order of the inputs; kMapSource is the scan, or the first of the grids.
enum RosInputIndex : std::size_t { kOdometry, kTf, kTfStatic, kMapSource };

std::vector<RosGraph::Input> InputsOf(const RosSettings& settings);

// Returns the options of a mapper for these settings, without agent, first pose and boot id.
RobotMapper::Options MapperOptionsOf(const RosSettings& settings);

// Returns handlers that pass scans, grids and transforms to `mapper`, and note publishers of other types in `log`.
// `hear` is called for each message, with the frames that it names. `on_odometry` gets the odometry. `inputs`, `mapper`
// and `log` must outlive the handlers.
RosGraph::Handlers HandlersFor(const std::vector<RosGraph::Input>& inputs, RobotMapper& mapper, TopicLog& log,
                               std::function<void(std::size_t input, const std::string& frames)> hear,
                               std::function<void(const RosOdometry&)> on_odometry);

}  // namespace moondb
