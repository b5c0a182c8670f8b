#include "apps/moondb_sim/answer_check.h"

#include <algorithm>

#include "model/record_key.h"
#include "model/term.h"

namespace moondb::simulation {
namespace {

using Wrong = std::optional<std::string>;

bool IsHeld(const HaveSet& have, const RecordKey& key) { return have.Get(key.stream).held.Contains(key.seq); }

Wrong CheckInserted(const proto::InsertRequest& request, const proto::InsertReply& reply, const AgentFacts& facts) {
  if (reply.keys_size() != request.records_size()) return "it names " + std::to_string(reply.keys_size()) + " records";
  for (const proto::RecordKey& name : reply.keys()) {
    const RecordKey key = FromProto(name);
    if (key.stream.origin != facts.self) return ToString(key) + " is another agent's";
    // The agent need not hold the record: if it is a state, a later record of the same insert may have superseded it.
    if (!facts.after.Get(key.stream).Covered().Contains(key.seq)) return ToString(key) + " is not there";
  }
  return std::nullopt;
}

// Checks a page of one data type that starts at the first row. The page may contain only records that the agent holds.
// If the page is complete and begins with the oldest row, it must contain all held records of the type.
Wrong CheckPage(const proto::ReadRequest& request, const proto::ReadReply& reply, const AgentFacts& facts) {
  if (request.is_history() || request.after_row_id() != 0 || request.data_types_size() != 1) return std::nullopt;
  if (facts.before != facts.after) return std::nullopt;
  std::uint64_t held = 0;
  for (const auto& [key, stream] : facts.after.streams()) {
    if (key.type == request.data_types(0)) held += stream.held.Count();
  }
  for (const proto::StoredRecord& record : reply.records()) {
    const RecordKey key = FromProto(record.key());
    if (key.seq != 0 && !IsHeld(facts.after, key)) return ToString(key) + " is not held";
  }
  const auto count = static_cast<std::uint64_t>(reply.records_size());
  if (count > held || (reply.is_complete() && !request.is_newest_first() && count < held)) {
    return std::to_string(count) + " records of type " + std::to_string(request.data_types(0)) + ", of which " +
           std::to_string(held) + " are held";
  }
  return std::nullopt;
}

Wrong CheckRoles(const proto::RoleAssignment& roles, const AgentFacts& facts) {
  if (!IsNewer(facts.durable_term, roles.term())) return std::nullopt;
  return "term " + std::to_string(roles.term().number()) + ", and term " + std::to_string(facts.durable_term.number()) +
         " is on its disk";
}

Wrong CheckRoleSet(const proto::RoleSetRequest& request, const proto::RoleAssignment& roles, const AgentFacts& facts) {
  if (request.is_dry_run()) return std::nullopt;
  if (IsNewer(roles.term(), facts.durable_term)) return "the new roles are not on its disk";
  if (request.leader() != 0 && roles.leader() != request.leader()) return "another agent leads";
  if (request.survivor() != 0 && roles.survivor() != request.survivor()) return "another agent is the survivor";
  return std::nullopt;
}

Wrong CheckStatus(const proto::AgentStatus& status, const AgentFacts& facts) {
  if (status.agent_id() != facts.self) return "the status of agent " + std::to_string(status.agent_id());
  return CheckRoles(status.roles(), facts);
}

Wrong CheckLease(const proto::LeaseRequest& request, const proto::LeaseReply& reply, const AgentFacts& facts) {
  double held_s = 0;
  for (const proto::AgentLease& lease : reply.leases()) {
    if (lease.agent_id() != facts.self) continue;
    if (request.kind() == proto::LEASE_KIND_DRIVING) held_s = lease.driving_s();
    if (request.kind() == proto::LEASE_KIND_SLEEPING) held_s = lease.sleeping_s();
    if (request.kind() == proto::LEASE_KIND_PAUSED) held_s = lease.paused_s();
  }
  constexpr double kRounding_s = 0.001;
  if (std::abs(held_s - request.seconds()) < kRounding_s) return std::nullopt;
  return "a lease of " + std::to_string(held_s) + " s in place of " + std::to_string(request.seconds());
}

Wrong CheckHave(const proto::HaveReply& reply, const AgentFacts& facts) {
  const Result<HaveSet> have = FromProto(reply.have());
  if (have && (*have == facts.before || *have == facts.after)) return std::nullopt;
  return "a have-set that it does not have";
}

Wrong CheckSolve(const AgentFacts& facts) {
  if (facts.roles.leader() == facts.self) return std::nullopt;
  return "it solves, and agent " + std::to_string(facts.roles.leader()) + " leads";
}

Wrong CheckDryPrune(const proto::PruneOrder& order, const AgentFacts& facts) {
  if (!order.is_dry_run() || facts.before == facts.after) return std::nullopt;
  return "what was only to be tried changed what is held";
}

}  // namespace

std::optional<std::string> WhyUntrue(const proto::ControlRequest& request, const proto::ControlReply& reply,
                                     const AgentFacts& facts) {
  switch (request.request_case()) {
    case proto::ControlRequest::kInsert:
      return CheckInserted(request.insert(), reply.insert(), facts);
    case proto::ControlRequest::kRead:
      return CheckPage(request.read(), reply.read(), facts);
    case proto::ControlRequest::kRoleShow:
      return CheckRoles(reply.roles().roles(), facts);
    case proto::ControlRequest::kRoleSet:
      return CheckRoleSet(request.role_set(), reply.roles().roles(), facts);
    case proto::ControlRequest::kStatus:
      return CheckStatus(reply.status(), facts);
    case proto::ControlRequest::kLease:
      return CheckLease(request.lease(), reply.lease(), facts);
    case proto::ControlRequest::kHave:
      return CheckHave(reply.have(), facts);
    case proto::ControlRequest::kOptimize:
      return CheckSolve(facts);
    case proto::ControlRequest::kPrune:
      return CheckDryPrune(request.prune(), facts);
    default:
      return std::nullopt;
  }
}

}  // namespace moondb::simulation
