// StateChecker: checks that agents store the last state that a robot gave to its agent.
//
// Keys do not prove the order of states: a state that is stored again gets another key, and keys may be wrong. So this
// class numbers the states in the order in which robots give them. It recognises a state by its content, which is
// unique.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>

#include "model/data_types.h"
#include "model/record_key.h"
#include "proto/record.pb.h"
#include "proto/types.pb.h"

namespace moondb::simulation {

using Records = std::map<RecordKey, std::string>;  // Contents of records by key.

// Custom type of the simulated team with latest keys, shared with the policy `latest`.
inline constexpr DataType kBeacon = 1000;

// Custom type whose policy changes from `latest` to `all`, agent by agent (fault `policy`).
inline constexpr DataType kNote = 1002;

// Returns whether records of the type are states: only the newest record of each origin and latest key, by epoch and
// seq, is kept.
inline bool IsState(DataType type) { return type == proto::POWER || type == kBeacon; }

// Returns whether an agent may drop records of the type without a prune.
inline bool MayBeSuperseded(DataType type) { return IsState(type) || type == kNote || IsDerived(type); }

class StateChecker {
 public:
  // Call when the robot of `origin` gives `record` to its agent, which may or may not store the record. Ignores records
  // that are not states.
  void OnGiven(AgentId origin, const proto::Record& record);
  // Call when the record of `key` was seen at any agent, with the hash of its content.
  void OnContent(const RecordKey& key, std::uint64_t content_hash);
  // Call when the state of `key` is on the agent's disk. From then on, WhyOld expects this state or a later one.
  void OnHeld(AgentId agent, const RecordKey& key);
  // Call when the agent's disk was replaced, or lost some records.
  void ForgetDisk(AgentId agent) { last_on_.erase(agent); }
  // Call when another disk was put into the agent, perhaps an old one. A state on it that no other agent ever held may
  // rank above all states given so far (docs/SHARING.md, limits), so WhyOld allows it in their place.
  void OnDiskReplaced(AgentId agent);

  // `records` must be all records of `agent`. Returns a description if, for some type and latest key of `origin`, any
  // agent's disk held a newer state than `records` contains; null otherwise. `origin` 0 means all origins. Requires:
  // the team is quiescent.
  std::optional<std::string> WhyOld(AgentId agent, AgentId origin, const Records& records) const;

 private:
  using Series = std::tuple<AgentId, DataType, std::string>;  // Origin, type, and latest key.
  struct Given {
    Series series;
    std::uint64_t number = 0;
  };
  struct Replaced {
    std::uint64_t given = 0;         // Number of the last state given before.
    std::set<std::uint64_t> shared;  // Numbers of the agent's states that another agent had held before.
  };
  const Given* Find(const RecordKey& key) const;
  bool MayReplace(AgentId origin, std::uint64_t held, std::uint64_t last) const;

  std::uint64_t given_ = 0;
  std::map<std::uint64_t, Given> given_by_content_;             // States that robots gave, by hash of the content.
  std::map<RecordKey, std::uint64_t> content_of_;               // Content hash of each state.
  std::map<AgentId, std::map<Series, std::uint64_t>> last_on_;  // Number of the last state on each agent's disk.
  std::map<AgentId, std::set<std::uint64_t>> shared_;           // Numbers of each origin's states that others held.
  std::map<AgentId, Replaced> replaced_;                        // The last time that a disk was put into the agent.
};

std::uint64_t ContentHash(const std::string& content);
// Returns the hashes of all contents with which storage may store `given`: with is_clock_suspect false or true, and
// with is_state false or true.
std::set<std::uint64_t> StatementHashes(const proto::Record& given);

}  // namespace moondb::simulation
