// The table of built-in data types: one row per type, with all its properties except its database table
// (actors/storage/type_tables.cc).
//
// The name of a type is its enumerator in proto::DataType in lower case, and also its field in proto::Record.
// docs/DATA_TYPES.md explains how to add a type. Custom types (model/custom_types.h) have no row. Thread-safe.
#pragma once

#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "model/field_checker.h"
#include "model/ids.h"
#include "model/term.h"
#include "proto/policy.pb.h"
#include "proto/record.pb.h"
#include "proto/types.pb.h"

namespace moondb {

// The order in which types are shared, lowest rank first. Role assignments are first, because they decide whose records
// are accepted. kOthers: events and custom types.
enum class ShareRank { kRoles, kStates, kNodes, kEdges, kDerived, kOthers, kMaps };

// Which agents may write records of a type. RecordAuthority (model/record_authority.h) applies these rules.
enum class Speaker {
  // Any agent. Used for robot states, events and custom types, which describe their own origin, and for role
  // assignments, which RoleChain (model/role_chain.h) checks.
  kAnyAgent,
  // An agent that the record names. Used for nodes, maps, odometry between nodes of one agent, and ranges and loop
  // closures between two agents.
  kNamedAgent,
  // An agent that the record names, or an agent in command_from of the team file. Used for priors.
  kNamedAgentOrCommander,
  // The leader of the term in the record. Used for optimised poses, edge verdicts and map matches.
  kLeader,
  // An agent that the record names, an agent in command_from of the team file, or the leader of the term in the record.
  // Used for quarantines of maps.
  kNamedAgentOrLeader,
};

// Which rovers the leader sends the records of a type to, in addition to their own records. The base station gets
// records by the policies `ground`.
enum class LeaderSends {
  kNothing,
  kToAgentNamed,  // The leader's own records about nodes of the rover.
  kToAllRovers,   // The records of all origins: all agents must apply the same ones.
};

// An agent that a record names. The agent must be a member of the team.
struct NamedAgent {
  AgentId agent = 0;
  std::string field;  // Path of the field: "pose_graph_edge.from.agent_id".
};

// Term and run of the solve that produced a record, or the number of the map match in its term.
using RecordVersion = std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>;

// Properties of a data type. The default values are the properties of robot states.
struct DataTypeRow {
  DataType type = proto::DATA_TYPE_UNSPECIFIED;

  ShareRank rank = ShareRank::kStates;
  // Policies that apply if the team file sets none. For a type under `latest`, an agent by default keeps superseded
  // records of its own robot, unless the type has versions (`version` is set).
  proto::Policy share = proto::POLICY_LATEST;
  proto::Policy ground = proto::POLICY_LATEST;
  // True if the team file may set the policy `latest`.
  bool may_be_latest = true;
  // If true, records of this type are pruned only if an order names the type, because other records depend on them. For
  // example, a map is used again if the quarantine of the map is pruned.
  bool is_kept_unless_named = false;

  // True if records are large: they are stored only while the disk has much room, and the store's budget limits their
  // part (retention.map_part_max).
  bool is_bulky = false;
  LeaderSends leader_sends = LeaderSends::kNothing;
  // True if a record of this type is new input for a solve of the pose graph, or for matching local maps.
  bool is_news_for_solve = false;
  bool is_news_for_matching = false;

  // Validates the fields of a record.
  void (*check)(const proto::Record& record, FieldChecker& check) = nullptr;
  // Returns the agents that a record names. Null if records of the type name none.
  std::vector<NamedAgent> (*agents)(const proto::Record& record) = nullptr;
  Speaker speaker = Speaker::kAnyAgent;
  // Returns the term in which the record's origin claims to have led. Required if `speaker` admits leaders.
  const proto::Term& (*term)(const proto::Record& record) = nullptr;
  // Returns the natural key of a record (NaturalKey in model/record_check.h). Null for a type without natural keys.
  std::string (*natural_key)(const proto::Record& record) = nullptr;
  // Returns the latest key of a record (LatestKey in model/record_check.h). The policy `latest` keeps only the newest
  // record per origin and latest key. Null: the latest key is empty.
  std::string (*latest_key)(const proto::Record& record) = nullptr;
  // Returns the version of a record. If two records have the same latest key, the record with the higher version is
  // newer; if the versions are equal, the record with the higher record key is newer. Null: the record key alone
  // decides.
  RecordVersion (*version)(const proto::Record& record) = nullptr;
};

// Returns the rows in the order of the types' numbers.
std::span<const DataTypeRow> DataTypeRows();

// Returns the row of a type; null for a type without a row (unknown or custom).
const DataTypeRow* FindDataType(DataType type);

// Returns the number of a type's ShareRank; types with lower numbers are shared first. DATA_TYPE_UNSPECIFIED has the
// rank of robot states; any other type without a row has the rank of custom types.
int SharingRank(DataType type);
bool IsBulky(DataType type);  // Returns DataTypeRow::is_bulky; false for a type without a row.
bool IsState(DataType type);  // Returns whether the type has the rank of robot states.
// Returns whether only a leader writes records of the type, which it derives from other records. A new leader may lack
// those of a former leader, and derives them again.
bool IsDerived(DataType type);

}  // namespace moondb
