// StateChecker: whether the state that a robot's software gave last is the one that stands.
//
// Records tell nothing of it: what an agent stores once more has another name, and names are what may be wrong. So this
// counts what robots give, in their order, and knows a state again by its content, which is never the same twice.
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

using Records = std::map<RecordKey, std::string>;  // Contents.

// A custom type of the simulated team, shared as `latest`, with keys.
inline constexpr DataType kBeacon = 1000;

// A custom type whose policy changes from `latest` to `all`, agent by agent (fault `policy`).
inline constexpr DataType kNote = 1002;

// Types of which only the newest of an agent (and of a key) is kept, by epoch and seq.
inline bool IsState(DataType type) { return type == proto::POWER || type == kBeacon; }

// Types of which an agent may drop records that no prune removed.
inline bool MayBeSuperseded(DataType type) {
  return IsState(type) || type == kNote || type == proto::OPTIMIZED_POSE || type == proto::EDGE_VERDICT;
}

class StateChecker {
 public:
  // The robot of `origin` gives it to its agent, which may or may not store it. Nothing if it is no state.
  void OnGiven(AgentId origin, const proto::Record& record);
  // The content of a record that was seen anywhere, as its hash.
  void OnContent(const RecordKey& key, std::uint64_t content_hash);
  // `agent` holds it on its disk, and from now on that or a later one.
  void OnHeld(AgentId agent, const RecordKey& key);
  // Its disk holds other things from now on.
  void ForgetDisk(AgentId agent) { last_on_.erase(agent); }

  // What `agent`, at rest, holds of states of `origin` (0: of all) in place of later ones that some disk had.
  std::optional<std::string> WhyOld(AgentId agent, AgentId origin, const Records& records) const;

 private:
  using Series = std::tuple<AgentId, DataType, std::string>;  // Origin, type, key.
  struct Given {
    Series series;
    std::uint64_t number = 0;
  };
  const Given* Find(const RecordKey& key) const;

  std::uint64_t given_ = 0;
  std::map<std::uint64_t, Given> given_by_content_;             // By hash.
  std::map<RecordKey, std::uint64_t> content_of_;               // Of states.
  std::map<AgentId, std::map<Series, std::uint64_t>> last_on_;  // The number of the last one, by disk.
};

std::uint64_t ContentHash(const std::string& content);
// Returns the hashes of the contents that storage may make of what a robot gives: with and without the mark of a
// suspect clock, and the one of the policy `latest`.
std::set<std::uint64_t> StatementHashes(const proto::Record& given);

}  // namespace moondb::simulation
