// Rules on the contents of records that hold at a client's insert alone. Stored records stay valid, here and at peers.
// Thread-safe.
#pragma once

#include "model/error.h"
#include "proto/record.pb.h"

namespace moondb {

// Requires variances within kVarianceMin and kVarianceMax (model/pose_graph.h): of a range, and of x, y and yaw in
// odometry, loop closures and priors. The variances of z, roll and pitch may be larger: drivers of planar robots
// give 1e6 to 1e308 for what they do not measure. The solver uses such a measurement as a planar robot's
// (LimitVariances). Also refuses a covariance that is nearly singular.
//
// A quarantine must be shared, and without the fields that the agent fills in. `is_local`: the record is not shared.
//
// Requires: the record passes CheckRecord. Fails with kInvalid and the field; the text names the axis of a covariance.
Result<void> CheckForInsert(const proto::Record& record, bool is_local = false);

}  // namespace moondb
