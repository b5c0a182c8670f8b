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

// The order in which types are shared, lowest first. Role assignments come first, because they decide whose records are
// accepted. kOthers: events and custom types.
enum class ShareRank { kRoles, kStates, kNodes, kEdges, kDerived, kOthers, kMaps };

// The agents that may write records of a type, in addition to the rules for signatures and sharing
// (model/record_authority.h).
enum class Speaker {
  // Any agent: the record describes its origin (robot states, events, custom types), or other rules apply (role
  // assignments, see model/role_chain.h).
  kAnyAgent,
  // An agent that the record names: nodes and maps, odometry between nodes of one agent, ranges between two agents.
  // Loop closures and priors will belong here.
  kNamedAgent,
  // The leader of the term in the record: optimised poses, edge verdicts.
  kLeader,
  // An agent that the record names, an agent in command_from of the team file, or the leader of the term in the record:
  // quarantines of maps.
  kNamedAgentOrLeader,
};

// An agent that a record names. It must be a member of the team.
struct NamedAgent {
  AgentId agent = 0;
  std::string field;  // Path of the field: "pose_graph_edge.from.agent_id".
};

// Term and run of the solve that produced a record.
using RecordVersion = std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>;

// Properties of a data type. The defaults are those of a robot state: shared early, and only the newest per robot.
struct DataTypeRow {
  DataType type = proto::DATA_TYPE_UNSPECIFIED;

  ShareRank rank = ShareRank::kStates;
  // Default policies, if the team file sets none. A type under `latest` keeps its history by default, unless it has
  // versions.
  proto::Policy share = proto::POLICY_LATEST;
  proto::Policy ground = proto::POLICY_LATEST;
  // Whether the policy `latest` is allowed.
  bool may_be_latest = true;
  // If true, records are pruned only if an order names this type, because they depend on each other. A graph without
  // some of its nodes is broken, and a map whose quarantine is pruned is used again.
  bool is_kept_unless_named = false;

  // Validates the fields of a record.
  void (*check)(const proto::Record& record, FieldChecker& check) = nullptr;
  // Returns the agents that a record names. Null if records of the type name none.
  std::vector<NamedAgent> (*agents)(const proto::Record& record) = nullptr;
  Speaker speaker = Speaker::kAnyAgent;
  // Returns the natural key, which robots choose (NaturalKey). Null for a type without one.
  std::string (*natural_key)(const proto::Record& record) = nullptr;
  // Returns the key per which only the newest record is kept under `latest` (LatestKey). Null: one key per origin.
  std::string (*latest_key)(const proto::Record& record) = nullptr;
  // Returns the version. If two records have the same latest key, the one with the higher (version, record key) is
  // kept. Null: only the record key decides.
  RecordVersion (*version)(const proto::Record& record) = nullptr;
};

// Returns the rows in the order of the types' numbers.
std::span<const DataTypeRow> DataTypeRows();

// Returns null for a type without a row (unknown or custom).
const DataTypeRow* FindDataType(DataType type);

// Returns the ShareRank of a type; lower ranks are shared first. Messages without a type rank like
// robot states; types without a row rank like custom types.
int SharingRank(DataType type);
bool IsState(DataType type);  // Returns whether the type has the rank of robot states.

}  // namespace moondb
