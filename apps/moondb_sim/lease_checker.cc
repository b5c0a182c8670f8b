#include "apps/moondb_sim/lease_checker.h"

#include <algorithm>

#include "actors/sharing/codec.h"
#include "model/ids.h"
#include "model/record_key.h"

namespace moondb::simulation {
namespace {

// Tolerance for durations, which are sent as seconds in floating point.
constexpr Duration kRounding = std::chrono::milliseconds(1);
// An agent numbers its lease announcements upwards from a random number, which it draws when its process starts. A
// process sends fewer announcements than this.
constexpr std::uint64_t kNumbersOfOneBoot = 1 << 20;

MonotonicTime Until(double seconds, MonotonicTime now) {
  if (seconds <= 0) return MonotonicTime::min();
  return now + std::chrono::duration_cast<Duration>(std::chrono::duration<double>(seconds));
}

// Returns whether the batch may be sent while its sender or receiver drives or is paused: the batch has only states,
// and is not the last of its session.
bool IsOfStates(const proto::Message& message) {
  const proto::Batch& batch = message.batch();
  if (message.remaining() == 0 || !batch.dropped().empty() || batch.has_fragment()) return false;
  const Result<proto::RecordBatch> decoded = DecodeBatch(batch.codec(), batch.coded(), batch.record_count());
  if (!decoded) return false;
  const auto& records = decoded->records();
  return std::all_of(records.begin(), records.end(),
                     [](const proto::StoredRecord& record) { return IsState(FromProto(record.key()).stream.type); });
}

}  // namespace

void LeaseChecker::OnHandle(const std::string& actor, const proto::Message& message, MonotonicTime now) {
  if (message.has_leases_changed()) knows_since_.emplace(actor, now);
  if (actor != actor_name::kLease) return;
  if (message.has_lease_request()) OnRequest(message.lease_request(), now);
  if (message.has_lease_announce()) OnAnnounce(message.hop_sender(), message.lease_announce(), now);
}

void LeaseChecker::OnFailure(const std::string& actor) {
  knows_since_.erase(actor);
  if (actor == actor_name::kLease) leases_.clear();
}

MonotonicTime& LeaseChecker::UntilOf(Lease& lease, proto::LeaseKind kind) {
  if (kind == proto::LEASE_KIND_PAUSED) return lease.paused_until;
  return kind == proto::LEASE_KIND_DRIVING ? lease.driving_until : lease.sleeping_until;
}

void LeaseChecker::OnRequest(const proto::LeaseRequest& request, MonotonicTime now) {
  Lease& lease = leases_[self_];
  lease.ended = LastQuiet(self_, now);
  lease.reported = now;
  UntilOf(lease, request.kind()) = Until(request.seconds(), now);
}

void LeaseChecker::OnAnnounce(AgentId from, const proto::LeaseAnnounce& announce, MonotonicTime now) {
  Lease& lease = leases_[from];
  const std::uint64_t behind = lease.number.value_or(announce.number()) - announce.number();
  if (behind != 0 && behind <= kNumbersOfOneBoot) return;  // An older announcement that arrived late.
  if (lease.number == announce.number()) return;           // A repetition. The lease runs from the first announcement.
  lease.ended = LastQuiet(from, now);
  lease.number = announce.number();
  lease.reported = now;
  lease.driving_until = Until(announce.driving_s(), now);
  lease.sleeping_until = Until(announce.sleeping_s(), now);
  lease.paused_until = Until(announce.paused_s(), now);
}

std::optional<std::string> LeaseChecker::WhyQuiet(const std::string& actor, AgentId to, const proto::Message& message,
                                                  MonotonicTime now) const {
  if (!message.has_hello() && !message.has_batch()) return std::nullopt;
  const auto knows = knows_since_.find(actor);
  if (knows == knows_since_.end() || knows->second == now) return std::nullopt;
  for (const AgentId end : {self_, to}) {
    const auto found = leases_.find(end);
    if (found == leases_.end() || found->second.reported == now) continue;
    const Lease& lease = found->second;
    const std::string what =
        actor + (message.has_hello() ? " sends a Hello while agent " : " sends a batch while agent ");
    if (lease.sleeping_until > now + kRounding) return what + std::to_string(end) + " sleeps";
    const bool is_driving = lease.driving_until > now + kRounding;
    const bool is_paused = lease.paused_until > now + kRounding;
    if ((is_driving || is_paused) && message.has_batch() && !IsOfStates(message)) {
      return what + std::to_string(end) + (is_driving ? " drives" : " is paused");
    }
  }
  return std::nullopt;
}

MonotonicTime LeaseChecker::LastQuiet(AgentId agent, MonotonicTime now) const {
  const auto found = leases_.find(agent);
  if (found == leases_.end()) return MonotonicTime::min();
  const Lease& lease = found->second;
  return std::max({lease.ended, std::min(now, lease.driving_until), std::min(now, lease.sleeping_until)});
}

}  // namespace moondb::simulation
