// The door for records: what a robot or a peer hands in is checked here once; behind it, records are trusted.
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

// The data type that a record's body stands for; DATA_TYPE_UNSPECIFIED for none, and for a custom one whose id is none.
DataType TypeOf(const proto::Record& record);

// kInvalid with the field named: no body, a number that is not finite, a ratio outside 0 to 1, an agent id outside
// 1 to kAgentIdMax, enum values unknown, an edge of a node with itself, a range that is negative or above 1e6 m, a
// variance that is not positive, a covariance that has not 21 numbers or is not positive definite, odometry between
// nodes of two agents, a range between nodes of one agent, a map as in FromProto(LocalTraversabilityMap), a custom
// record whose id is not 1000 to 1999 or whose payload, key or metadata is too long, or whose metadata is not UTF-8.
// Whether agents and custom types exist in the team is the caller's to check.
Result<void> CheckRecord(const proto::Record& record);

// The agents that the record speaks of, in the order of its fields.
std::vector<NamedAgent> AgentsNamedIn(const proto::Record& record);

// The `latest` key of a record (empty for states; the node for optimized poses; the edge for verdicts; a custom
// record's own), as bytes.
std::string LatestKey(const proto::Record& record);

// The name that robots give to what is unique (nodes, edges: type of measurement and both ends), empty for others.
std::string NaturalKey(const proto::Record& record);

}  // namespace moondb
