// The names of agents, nodes and data types.
#pragma once

#include <compare>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace moondb::proto {
class NodeKey;
enum Role : int;
}  // namespace moondb::proto

namespace moondb {

// A team member and its process; 1 to kAgentIdMax. 0 means nobody.
using AgentId = std::uint32_t;
inline constexpr AgentId kAgentIdMax = 65535;

// A pose-graph node: the index is given by the agent's robot.
struct NodeKey {
  AgentId agent = 0;
  std::uint64_t index = 0;
  auto operator<=>(const NodeKey&) const = default;
};

NodeKey FromProto(const proto::NodeKey& node);
proto::NodeKey ToProto(const NodeKey& node);

// A proto::DataType, or a custom one.
using DataType = std::uint32_t;
inline constexpr DataType kCustomDataTypeMin = 1000;
inline constexpr DataType kCustomDataTypeMax = 1999;

constexpr bool IsCustom(DataType type) { return type >= kCustomDataTypeMin && type <= kCustomDataTypeMax; }

// "local_traversability_map"; "type_1007" for a type without a name here.
std::string DataTypeName(DataType type);

// The inverse, for the built-in types.
std::optional<DataType> DataTypeFromName(std::string_view name);

// In the order of their numbers.
const std::vector<DataType>& BuiltInDataTypes();

// The order in which types are shared, a ShareRank (model/data_types.h): a smaller one goes first. Messages that are of
// no type go with the states, types without a row with the custom ones.
int SharingRank(DataType type);
bool IsState(DataType type);  // Of the rank of a robot's states.

// "rover", "leader", "designated_survivor", "base_station".
std::string RoleName(proto::Role role);

}  // namespace moondb
