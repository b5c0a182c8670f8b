// Draws the odometry, ranges and start poses of a recorded mission again from the true poses, with the noise model of
// apps/moondb_mission/measurement.h.
#pragma once

#include <cstdint>

#include "model/mission.h"

namespace moondb {

Mission Redraw(const Mission& mission, std::uint64_t seed);

}  // namespace moondb
