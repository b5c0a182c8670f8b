// RecordAuthority: decides which records a reader may use, depending on the agent that wrote the record and on its
// roles.
//
// CheckSpeaker applies the rules that need only the record and its origin (DataTypeRow::speaker in model/data_types.h).
// A record that breaks such a rule can never become valid, so no store accepts it. RecordAuthority also applies the
// rules that depend on roles. Records that break only these rules are stored and shared, but not used. A team without
// keys has no role rules.
//
// The result depends only on the set of records, not on their order. If a record arrives before the role assignment
// that makes it valid, the record is left out at first, and TakeOutdated later reports that all records must be read
// again. Not thread-safe.
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

// Fails with kInvalid if `origin` may not write this record in any role. The error's field is the path of the first
// agent that the record names. Requires: CheckRecord(record) succeeds.
Result<void> CheckSpeaker(const proto::Record& record, AgentId origin);

class RecordAuthority {
 public:
  explicit RecordAuthority(RoleChain::Options options);

  // Returns whether the reader may use this record. Call it for role assignments too, because they decide about other
  // records.
  bool Counts(const RecordKey& key, const proto::Record& record);
  // Returns true if a record that was left out has become valid since the last call. The reader must then call Restart
  // and read all records again.
  bool TakeOutdated();
  // Forgets which records were left out. Call it before all records are read again.
  void Restart();

  // Returns a LeftOutReport for storage. The report holds, per origin, the number of records left out since the last
  // Restart, and the number of records for which the reader had no room (`without_room`). Returns nullopt if both are
  // unchanged since the last call.
  std::optional<proto::Message> TakeReport(std::map<AgentId, std::uint64_t> without_room);

 private:
  // Maximum size of left_out_. At this size, any new assignment is assumed to make a left-out record valid.
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
  std::map<AgentId, std::uint64_t> reported_;  // Value of uncounted_ in the last report.
  std::map<AgentId, std::uint64_t> reported_without_room_;
  bool is_outdated_ = false;
};

}  // namespace moondb
