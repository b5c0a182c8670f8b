// Validates records from a robot or a peer. Each record is validated once, when it enters the agent, and trusted
// afterwards.
#pragma once

#include <string>
#include <vector>

#include "model/data_types.h"
#include "model/error.h"
#include "model/ids.h"
#include "proto/record.pb.h"

namespace moondb {

inline constexpr std::size_t kRecordContentBytesMax = 16 * 1024 * 1024;
inline constexpr std::size_t kCustomPayloadBytesMax = 8 * 1024 * 1024;  // The largest bytes_max of a custom type.
inline constexpr std::size_t kCustomKeyBytesMax = 256;
inline constexpr std::size_t kCustomMetadataBytesMax = 1024;

// Returns the data type of the record's body. Returns DATA_TYPE_UNSPECIFIED if there is no body, or if the id of a
// custom record is not 1000 to 1999.
DataType TypeOf(const proto::Record& record);

// Validates a record. Does not check whether the agents and the custom type exist in the team. Fails with kInvalid and
// the field for:
//   - a missing body, an unknown enum value, or an agent id outside of 1 to kAgentIdMax;
//   - a number that is not finite, or a ratio outside of 0 to 1;
//   - an edge from a node to itself, odometry between nodes of two agents, or a range between nodes of one agent;
//   - a range that is negative or above 1e6 m, or a variance that is not positive;
//   - a prior without a measurement, or a loop closure or prior whose source is invalid (IsSource);
//   - a covariance that is not positive definite, or whose number of entries does not fit the measurement;
//   - a map that fails FromProto(LocalTraversabilityMap);
//   - a custom record with an id outside of 1000 to 1999, a payload, key or metadata that is too long, or metadata that
//     is not UTF-8.
Result<void> CheckRecord(const proto::Record& record);

// Returns the agents that the record names, in the order of its fields.
std::vector<NamedAgent> AgentsNamedIn(const proto::Record& record);

// Returns the latest key as bytes. The policy `latest` keeps only the newest record per origin and latest key. The key
// is empty for robot states, the node for optimized poses, the edge or prior for verdicts, and CustomRecord.latest_key
// for custom records.
std::string LatestKey(const proto::Record& record);

// Returns the natural key, by which robots identify a node, an edge or a prior: the NodeKey of a node; otherwise the
// kind of measurement, its nodes and its source. Empty for other types.
std::string NaturalKey(const proto::Record& record);

}  // namespace moondb
