// RecordAuthority: which agents may state what about whom, and so which of the held records a reader uses.
//
// DataTypeRow::speaker (model/data_types.h) has one entry for each data type. CheckSpeaker applies the rules that need
// only the record and its origin; a record that breaks one can never be valid, and no store takes it. RecordAuthority
// also applies the rules that depend on roles. Those are applied by readers alone: a record is stored and shared
// whether or not its origin had the role. A team without keys has no role rules.
//
// The result depends on the set of records alone, not on their order. A record that came before the role assignment by
// which it counts is left out at first; TakeOutdated then says that all records have to be read again. Not copied, not
// thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "model/error.h"
#include "model/record_key.h"
#include "model/role_chain.h"
#include "model/term.h"
#include "proto/message.pb.h"
#include "proto/record.pb.h"

namespace moondb {

// Returns whether the record names this agent (DataTypeRow::agents).
bool IsNamedIn(const proto::Record& record, AgentId agent);

// kInvalid, with the field that names the other agent, if `origin` may not state this in any role. Requires:
// CheckRecord(record) succeeds.
Result<void> CheckSpeaker(const proto::Record& record, AgentId origin);

class RecordAuthority {
 public:
  explicit RecordAuthority(RoleChain::Options options);

  // Returns whether a reader uses this record. Call it for role assignments too: they decide about the others.
  bool Counts(const RecordKey& key, const proto::Record& record);
  // Returns, once, whether a record that was left out counts by now, so that all have to be read again.
  bool TakeOutdated();
  // All records are read again.
  void Restart();

  // Returns a LeftOutReport for storage, of the records that did not count since the last Restart and of those for
  // which the reader had no room, by origin; none if nothing changed since the last call.
  std::optional<proto::Message> TakeReport(std::map<AgentId, std::uint64_t> without_room);

 private:
  // Left-out (origin, term) pairs are remembered up to this many. Beyond, any new assignment may concern one.
  static constexpr std::size_t kLeftOutMax = 4096;
  using LeftOut = std::tuple<AgentId, decltype(OrderOf(proto::Term()))>;

  void AddAssignment(const proto::RoleAssignment& roles);
  bool MayState(AgentId origin, const proto::Record& record);
  bool HasLedIn(AgentId origin, const proto::Term& term);

  const bool has_keys_;
  const std::function<bool(AgentId)> may_command_;
  RoleChain chain_;
  std::set<LeftOut> left_out_;
  std::map<AgentId, std::uint64_t> uncounted_;
  std::map<AgentId, std::uint64_t> reported_;  // Of uncounted_.
  std::map<AgentId, std::uint64_t> reported_without_room_;
  bool is_outdated_ = false;
};

}  // namespace moondb
