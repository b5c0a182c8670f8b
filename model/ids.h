// Identifiers of agents, nodes and data types, and their names.
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

// Identifies an agent: a team member and its process. Valid ids are 1 to kAgentIdMax; 0 means no agent.
using AgentId = std::uint32_t;
inline constexpr AgentId kAgentIdMax = 65535;

// Identifies a pose-graph node. The robot's software chooses the index.
struct NodeKey {
  AgentId agent = 0;
  std::uint64_t index = 0;
  auto operator<=>(const NodeKey&) const = default;
};

NodeKey FromProto(const proto::NodeKey& node);
proto::NodeKey ToProto(const NodeKey& node);

// A proto::DataType, or the id of a custom type.
using DataType = std::uint32_t;
inline constexpr DataType kCustomDataTypeMin = 1000;
inline constexpr DataType kCustomDataTypeMax = 1999;

constexpr bool IsCustom(DataType type) { return type >= kCustomDataTypeMin && type <= kCustomDataTypeMax; }

// Returns "local_traversability_map", or "type_1007" for a type without a built-in name.
std::string DataTypeName(DataType type);

// Returns the built-in type of this name; nullopt if there is none. The inverse of DataTypeName.
std::optional<DataType> DataTypeFromName(std::string_view name);

// Returns the built-in types in the order of their numbers.
const std::vector<DataType>& BuiltInDataTypes();

// Returns "rover", "leader", "designated_survivor" or "base_station"; "none" for ROLE_UNSPECIFIED.
std::string RoleName(proto::Role role);

}  // namespace moondb
