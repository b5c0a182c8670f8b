// The built-in data types, one row each: what moondb has to know of a type, except for its table in the database
// (actors/storage/record_tables.cc).
//
// A type's name is its enumerator of proto::DataType in lower case, which is also the name of its field in
// proto::Record: a row gives neither. docs/DATA_TYPES.md says how to add a type; tests/model/data_types_test.cc names
// what was forgotten. Custom types (model/custom_types.h) have no row. Constants, any thread.
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

// The order in which types are shared: a smaller rank goes first. Assignments of roles say whose records are taken.
// kOthers are events and custom types.
enum class ShareRank { kRoles, kStates, kNodes, kEdges, kDerived, kOthers, kMaps };

// Which agents may state a record of a type, beyond what its signature and sharing demand (model/record_authority.h).
enum class Speaker {
  // Any agent. The record describes its origin (robot states, events, custom types), or other rules apply (role
  // assignments: model/role_chain.h).
  kAnyAgent,
  // An agent that the record names: nodes and maps, odometry between nodes of one agent, ranges between two. Loop
  // closures and priors will belong here.
  kNamedAgent,
  // The agent that led in the term that the record gives: optimised poses, edge verdicts.
  kLeader,
  // An agent that the record names, one in command_from of the team file, or the one that led in the term that the
  // record gives: quarantines of maps.
  kNamedAgentOrLeader,
};

// An agent that a record names. It must be a member of the team.
struct NamedAgent {
  AgentId agent = 0;
  std::string field;  // "pose_graph_edge.from.agent_id".
};

// Term and run of the solve that a record comes from.
using RecordVersion = std::pair<decltype(OrderOf(proto::Term())), std::uint64_t>;

// What a row leaves out makes the type a robot's state: shared first, the newest of each robot only.
struct DataTypeRow {
  DataType type = proto::DATA_TYPE_UNSPECIFIED;

  ShareRank rank = ShareRank::kStates;
  // Where the team file says nothing. A type under `latest` keeps its history by default, unless it has versions.
  proto::Policy share = proto::POLICY_LATEST;
  proto::Policy ground = proto::POLICY_LATEST;
  // Whether `latest` may be its policy at all.
  bool may_be_latest = true;
  // Pruned only where an order names it, since its records hang together: a graph without some of its nodes is broken,
  // and a map without its quarantine counts again.
  bool is_kept_unless_named = false;

  // What its fields must keep to, beyond what protobuf says of them.
  void (*check)(const proto::Record& record, FieldChecker& check) = nullptr;
  // The agents that it names; null where it names none.
  std::vector<NamedAgent> (*agents)(const proto::Record& record) = nullptr;
  Speaker speaker = Speaker::kAnyAgent;
  // The name that robots give it (NaturalKey); null for a type without.
  std::string (*natural_key)(const proto::Record& record) = nullptr;
  // Of which things the newest record each stands (LatestKey); null where the origin itself is the one thing.
  std::string (*latest_key)(const proto::Record& record) = nullptr;
  // Which of two records stands goes by this, then by key; null where by key alone.
  RecordVersion (*version)(const proto::Record& record) = nullptr;
};

// In the order of their numbers.
std::span<const DataTypeRow> DataTypeRows();

// Null for a type without a row: unknown or custom.
const DataTypeRow* FindDataType(DataType type);

}  // namespace moondb
