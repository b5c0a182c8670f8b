#include "actors/storage/peer_authority.h"

#include <algorithm>
#include <utility>

#include "actors/storage/role_history.h"
#include "model/have_set.h"
#include "model/record_authority.h"
#include "model/term.h"
#include "proto/status.pb.h"

namespace moondb {
namespace {

proto::RefusalCause ToProto(PeerAuthority::Cause cause) {
  switch (cause) {
    case PeerAuthority::Cause::kOrigin:
      return proto::REFUSAL_CAUSE_ORIGIN;
    case PeerAuthority::Cause::kStreams:
      return proto::REFUSAL_CAUSE_STREAMS;
    case PeerAuthority::Cause::kStatement:
      return proto::REFUSAL_CAUSE_STATEMENT;
    case PeerAuthority::Cause::kDiskRoom:
      return proto::REFUSAL_CAUSE_DISK_ROOM;
  }
  return proto::REFUSAL_CAUSE_UNSPECIFIED;
}

// Returns true if `origin` may use more of `room`. Half of the room is divided equally among the agents of the team.
// The agents that exceed their part share the other half.
template <typename UsedBy>
bool HasRoom(AgentId origin, const std::set<AgentId>& team, std::uint64_t room, const UsedBy& used_by) {
  const std::uint64_t half = room / 2;
  const std::uint64_t part = half / std::max<std::size_t>(team.size(), 1);
  if (used_by(origin) < part) return true;
  std::uint64_t beyond_parts = 0;
  for (const AgentId agent : team) {
    const std::uint64_t used = used_by(agent);
    beyond_parts += used > part ? used - part : 0;
  }
  return beyond_parts < half;
}

}  // namespace

PeerAuthority::PeerAuthority(Options options) : options_(std::move(options)), chain_(options_.roles) {}

Result<void> PeerAuthority::Load(Database& database) {
  if (!options_.roles.has_keys) return {};
  const Result<proto::LoadRolesReply> acted_on = LoadRoles(database);
  if (!acted_on) return tl::unexpected(acted_on.error());
  for (const proto::RoleAssignment& roles : acted_on->history()) ObserveAssignment(roles, /*is_record=*/false);
  const Result<std::vector<proto::RoleAssignment>> records = LoadRoleRecords(database);
  if (!records) return tl::unexpected(records.error());
  for (const proto::RoleAssignment& roles : *records) ObserveAssignment(roles, /*is_record=*/true);
  return {};
}

void PeerAuthority::ObserveAssignment(const proto::RoleAssignment& roles, bool is_record) {
  (void)chain_.Add(roles);
  if (is_record) held_as_records_.insert(roles.signature());
}

void PeerAuthority::ObserveIfSigned(const proto::RoleAssignment& roles) {
  if (options_.roles.has_keys && options_.is_signed(roles)) ObserveAssignment(roles, /*is_record=*/false);
}

std::vector<proto::RoleAssignment> PeerAuthority::NotHeldAsRecords(const proto::RoleAssignment& roles) const {
  std::vector<proto::RoleAssignment> missing;
  for (const proto::RoleAssignment* at = &roles; at != nullptr && !at->signature().empty();) {
    if (held_as_records_.contains(at->signature())) break;
    missing.push_back(*at);
    at = RevisionOf(at->term()) == 0 ? nullptr : chain_.Find(at->follows());
  }
  return missing;
}

bool PeerAuthority::IsBelieved(AgentId sender) const {
  return !options_.roles.has_keys || sender == 0 || (options_.base != 0 && sender == options_.base) ||
         chain_.HasHadRole(sender);
}

Result<void> PeerAuthority::CheckRecord(AgentId sender, const RecordKey& key, const proto::Record& record) {
  if (IsSignedType(key.stream.type) && options_.roles.has_keys && options_.is_record_signed(key, record)) return {};
  return CheckOrigin(sender, key.stream);
}

Result<void> PeerAuthority::CheckOrigin(AgentId sender, const StreamKey& stream) {
  if (sender == stream.origin || IsBelieved(sender)) return {};
  CountRefused(sender, Cause::kOrigin, stream.origin);
  return Fail(ErrorCode::kRefused,
              "is agent " + std::to_string(stream.origin) + "'s, and agent " + std::to_string(sender) +
                  " was never leader or survivor, so it may send only its own records",
              "key.origin_agent");
}

Result<void> PeerAuthority::CheckRoom(AgentId sender, const StreamKey& stream, const HaveLedger& ledger) {
  const auto used_by = [&ledger](AgentId agent) { return std::uint64_t{ledger.StreamsOf(agent)}; };
  const bool is_known = !ledger.Get(stream).Covered().is_empty();
  if (is_known || HasRoom(stream.origin, options_.team, kHaveStreamsMax, used_by)) return {};
  CountRefused(sender, Cause::kStreams, stream.origin);
  return Fail(ErrorCode::kRefused,
              "agent " + std::to_string(stream.origin) + " has reached its limit of record streams", "key.epoch");
}

Result<void> PeerAuthority::CheckDiskRoom(AgentId origin, const std::map<AgentId, std::uint64_t>& used_bytes,
                                          std::uint64_t room_bytes) {
  const auto used_by = [this, &used_bytes](AgentId agent) {
    const auto used = used_bytes.find(agent);
    return used == used_bytes.end() || agent == options_.self ? 0 : used->second;
  };
  if (origin == options_.self || HasRoom(origin, options_.team, room_bytes, used_by)) return {};
  CountRefused(origin, Cause::kDiskRoom, 0);
  return Fail(ErrorCode::kRefused,
              "agent " + std::to_string(origin) + "'s records have reached their share of this agent's disk",
              "content");
}

Result<void> PeerAuthority::CheckAssignment(AgentId sender, const proto::RoleAssignment& roles) {
  if (!options_.roles.has_keys || options_.is_signed(roles)) return {};
  CountRefused(sender, Cause::kOrigin, roles.term().issuer());
  return Fail(ErrorCode::kRefused, "does not match its issuer's signing key", "role_assignment.signature");
}

Result<void> PeerAuthority::CheckOwnQuarantine(const proto::Record& record) const {
  const bool has_role = !options_.roles.has_keys || chain_.newest().leader() == options_.self ||
                        options_.roles.may_command(options_.self);
  if (has_role || IsNamedIn(record, options_.self)) return {};
  return Fail(
      ErrorCode::kRefused,
      "names another agent, and this agent is neither leader nor in command_from of the team file: insert it at "
      "the leader or at an agent of command_from",
      record.map_quarantine().has_lifts() ? "map_quarantine.lifts" : "map_quarantine.agent_id");
}

Result<void> PeerAuthority::CheckOwnPrior(const proto::Record& record) const {
  const bool may_command = !options_.roles.has_keys || options_.roles.may_command(options_.self);
  if (may_command || IsNamedIn(record, options_.self)) return {};
  return Fail(ErrorCode::kRefused,
              "names another agent's node, and this agent is not in command_from of the team file: insert it at that "
              "agent or at an agent of command_from",
              "pose_prior.node.agent_id");
}

void PeerAuthority::AddExcluded(const std::string& reader, const proto::LeftOutReport& report) {
  left_out_[reader] = report;
}

void PeerAuthority::CountRefused(AgentId sender, Cause cause, AgentId origin) { ++refused_[{sender, cause, origin}]; }

void PeerAuthority::ObserveOwnBeyond(AgentId peer, const std::vector<RecordKey>& beyond, bool is_all) {
  std::map<StreamKey, std::uint64_t>& noted = own_beyond_[peer];
  if (is_all) noted.clear();
  for (const RecordKey& key : beyond) {
    if (noted.size() >= kOwnBeyondMax && !noted.contains(key.stream)) continue;
    std::uint64_t& last = noted[key.stream];
    last = std::max(last, key.seq);
  }
}

void PeerAuthority::Describe(const HaveSet& have, proto::AgentStatus& status) const {
  std::map<std::pair<AgentId, proto::RefusalCause>, double> left_out;
  for (const auto& [reader, report] : left_out_) {
    const auto add = [&left_out](const auto& counts, proto::RefusalCause cause) {
      for (const auto& [origin, count] : counts) {
        double& shown = left_out[{origin, cause}];
        shown = std::max(shown, count);  // The maximum, not the sum: two readers may count the same records.
      }
    };
    add(report.without_role(), proto::REFUSAL_CAUSE_UNCOUNTED);
    add(report.without_room(), proto::REFUSAL_CAUSE_NO_ROOM);
  }
  for (const auto& [what, count] : left_out) {
    proto::RefusedFrom& shown = *status.add_refused();
    shown.set_agent_id(what.first);
    shown.set_cause(what.second);
    shown.set_count(count);
  }
  for (const auto& [peer, beyond] : own_beyond_) {
    const auto count = std::count_if(beyond.begin(), beyond.end(), [&have](const auto& named) {
      const auto& [stream, last] = named;
      if (last != 0) return have.Get(stream).Covered().Max() < last;
      const auto of_epoch = have.streams().lower_bound(stream);
      return of_epoch == have.streams().end() || of_epoch->first.origin != stream.origin ||
             of_epoch->first.epoch != stream.epoch;
    });
    if (count == 0) continue;
    proto::RefusedFrom& shown = *status.add_refused();
    shown.set_agent_id(peer);
    shown.set_cause(proto::REFUSAL_CAUSE_OWN_EPOCH);
    shown.set_count(static_cast<double>(count));
  }
  for (const auto& [key, count] : refused_) {
    // The sender's role assignment had not arrived yet when its records were refused. The sender will retry, so this is
    // not reported as misbehaviour.
    if (std::get<1>(key) == Cause::kOrigin && IsBelieved(std::get<0>(key))) continue;
    proto::RefusedFrom& refused = *status.add_refused();
    refused.set_agent_id(std::get<0>(key));
    refused.set_cause(ToProto(std::get<1>(key)));
    refused.set_origin_agent(std::get<2>(key));
    refused.set_count(static_cast<double>(count));
  }
}

}  // namespace moondb
