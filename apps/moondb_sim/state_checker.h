// StateChecker: checks that the stored state is the last one that a robot's software gave.
//
// Records do not show this: a state that is stored again gets another key, and keys may be wrong. So this class numbers
// the states that robots give, in their order. It recognises a state by its content, which is always unique.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <tuple>

#include "model/record_key.h"
#include "proto/record.pb.h"
#include "proto/types.pb.h"

namespace moondb::simulation {

using Records = std::map<RecordKey, std::string>;  // Contents by key.

// Custom type of the simulated team with latest keys, shared with the policy `latest`.
inline constexpr DataType kBeacon = 1000;

// Custom type whose policy changes from `latest` to `all`, agent by agent (fault `policy`).
inline constexpr DataType kNote = 1002;

// Returns whether only an origin's newest record of the type (and latest key) is kept, by epoch and seq.
inline bool IsState(DataType type) { return type == proto::POWER || type == kBeacon; }

// Returns whether an agent may drop records of the type without a prune.
inline bool MayBeSuperseded(DataType type) {
  return IsState(type) || type == kNote || type == proto::OPTIMIZED_POSE || type == proto::EDGE_VERDICT;
}

class StateChecker {
 public:
  // The robot of `origin` gives `record` to its agent, which may or may not store it. Ignores types that are no states.
  void OnGiven(AgentId origin, const proto::Record& record);
  // A record was seen anywhere with this hash of its content.
  void OnContent(const RecordKey& key, std::uint64_t content_hash);
  // `agent` holds the state on its disk, and must hold it or a later one from now on.
  void OnHeld(AgentId agent, const RecordKey& key);
  // The agent's disk was replaced.
  void ForgetDisk(AgentId agent) { last_on_.erase(agent); }

  // Returns a text if a quiescent `agent` holds an older state of `origin` than some disk held; null otherwise.
  // `origin` 0 means all origins.
  std::optional<std::string> WhyOld(AgentId agent, AgentId origin, const Records& records) const;

 private:
  using Series = std::tuple<AgentId, DataType, std::string>;  // Origin, type, and latest key.
  struct Given {
    Series series;
    std::uint64_t number = 0;
  };
  const Given* Find(const RecordKey& key) const;

  std::uint64_t given_ = 0;
  std::map<std::uint64_t, Given> given_by_content_;             // States that robots gave, by hash of the content.
  std::map<RecordKey, std::uint64_t> content_of_;               // Hashes of the contents of states.
  std::map<AgentId, std::map<Series, std::uint64_t>> last_on_;  // Number of the last state on each agent's disk.
};

std::uint64_t ContentHash(const std::string& content);
// Returns the hashes of the contents that storage may make of a robot's record: with and without the flag of a suspect
// clock, and with and without the flag of the policy `latest`.
std::set<std::uint64_t> StatementHashes(const proto::Record& given);

}  // namespace moondb::simulation
