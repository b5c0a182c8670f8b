// The table of built-in data types: one row per type, with all its properties except its database table
// (actors/storage/record_tables.cc).
//
// Rows do not contain names. The name of a type is its enumerator in proto::DataType in lower case, and also its field
// in proto::Record. docs/DATA_TYPES.md explains how to add a type; tests/model/data_types_test.cc reports forgotten
// steps. Custom types (model/custom_types.h) have no row. Thread-safe.
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

// The agents that may write records of a type, in addition to the rules for signatures and sharing
// (model/record_authority.h).
enum class Speaker {
  // Any agent. The record describes its own origin (robot states, events, custom types), or other rules decide (role
  // assignments, see model/role_chain.h).
  kAnyAgent,
  // An agent that the record names. Used for nodes and maps, odometry between nodes of one agent, and ranges between
  // two agents. Future types such as loop closures and priors belong here.
  kNamedAgent,
  // The leader of the term in the record. Used for optimised poses and edge verdicts.
  kLeader,
  // An agent that the record names, an agent in command_from of the team file, or the leader of the term in the record.
  // Used for quarantines of maps.
  kNamedAgentOrLeader,
};

// An agent that a record names. It must be a member of the team.
struct NamedAgent {
  AgentId agent = 0;
  std::string field;  // Path of the field: "pose_graph_edge.from.agent_id".
};

// Term and run of the solve that produced a record.
using RecordVersion = std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>;

// Properties of a data type. The default values are those of a robot state: states are shared early, and only the
// newest state per robot is kept.
struct DataTypeRow {
  DataType type = proto::DATA_TYPE_UNSPECIFIED;

  ShareRank rank = ShareRank::kStates;
  // Default policies, used if the team file sets none. By default an agent keeps superseded records of its own robot
  // for a type under `latest`, unless the type has versions (see `version`).
  proto::Policy share = proto::POLICY_LATEST;
  proto::Policy ground = proto::POLICY_LATEST;
  // Whether the policy `latest` is allowed.
  bool may_be_latest = true;
  // If true, records of this type are pruned only if an order names the type, because other records depend on them. A
  // graph without some of its nodes is broken, and a map whose quarantine is pruned is used again.
  bool is_kept_unless_named = false;

  // Validates the fields of a record.
  void (*check)(const proto::Record& record, FieldChecker& check) = nullptr;
  // Returns the agents that a record names. Null if records of the type name none.
  std::vector<NamedAgent> (*agents)(const proto::Record& record) = nullptr;
  Speaker speaker = Speaker::kAnyAgent;
  // Returns the natural key, which robots choose (NaturalKey). Null for a type without natural keys.
  std::string (*natural_key)(const proto::Record& record) = nullptr;
  // Returns the latest key: under `latest`, only the newest record per key is kept (LatestKey). Null: all records of an
  // origin have the same key.
  std::string (*latest_key)(const proto::Record& record) = nullptr;
  // Returns the version. If two records have the same latest key, the record with the higher (version, record key) is
  // kept. Null: the record key alone decides.
  RecordVersion (*version)(const proto::Record& record) = nullptr;
};

// Returns the rows in the order of the types' numbers.
std::span<const DataTypeRow> DataTypeRows();

// Returns the row of a type; null for a type without a row (unknown or custom).
const DataTypeRow* FindDataType(DataType type);

// Returns the ShareRank of a type; lower ranks are shared first. Messages without a type rank like
// robot states; types without a row rank like custom types.
int SharingRank(DataType type);
bool IsState(DataType type);  // Returns whether the type has the rank of robot states.

}  // namespace moondb
