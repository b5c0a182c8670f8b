#include "model/leases.h"

#include <algorithm>
#include <cmath>

namespace moondb {
namespace {

Leases::Duration FromSeconds(double seconds) {
  return std::chrono::duration_cast<Leases::Duration>(std::chrono::duration<double>(seconds));
}

double SecondsUntil(Leases::Time end, Leases::Time now) {
  return end > now ? std::chrono::duration<double>(end - now).count() : 0;
}

std::string WholeSeconds(double seconds) { return std::to_string(static_cast<int>(std::ceil(seconds))) + " s"; }

}  // namespace

Result<void> CheckLeaseSeconds(double seconds, const std::string& field) {
  if (seconds >= 0 && seconds <= kLeaseSecondsMax) return {};  // False for NaN, which therefore fails.
  return Fail(ErrorCode::kInvalid, "expected 0 to 86400 seconds", field);
}

std::string ToString(const proto::AgentLease& lease) {
  std::string text;
  const auto add = [&text](const char* what, double seconds) {
    if (seconds > 0) text += (text.empty() ? "" : " and ") + (what + WholeSeconds(seconds));
  };
  add("drives for ", lease.driving_s());
  add("sleeps for ", lease.sleeping_s());
  add("is paused for ", lease.paused_s());
  return text.empty() ? "" : text + " more";
}

void Leases::Set(const proto::AgentLease& lease, Time now) {
  until_[lease.agent_id()] = {now + FromSeconds(lease.driving_s()), now + FromSeconds(lease.sleeping_s()),
                              now + FromSeconds(lease.paused_s())};
}

void Leases::SetAll(const proto::LeasesChanged& changed) {
  until_.clear();
  for (const proto::AgentLease& lease : changed.leases()) Set(lease, Time(Duration(changed.as_of_ns())));
}

proto::AgentLease Leases::LeftOf(AgentId agent, Time now) const {
  proto::AgentLease left;
  left.set_agent_id(agent);
  if (const auto found = until_.find(agent); found != until_.end()) {
    left.set_driving_s(SecondsUntil(found->second.driving, now));
    left.set_sleeping_s(SecondsUntil(found->second.sleeping, now));
    left.set_paused_s(SecondsUntil(found->second.paused, now));
  }
  return left;
}

proto::LeasesChanged Leases::Left(Time now) const {
  proto::LeasesChanged left;
  left.set_as_of_ns(now.time_since_epoch().count());
  for (const auto& [agent, until] : until_) {
    if (std::max({until.driving, until.sleeping, until.paused}) > now) *left.add_leases() = LeftOf(agent, now);
  }
  return left;
}

std::optional<Leases::Time> Leases::NextExpiry(Time now) const {
  std::optional<Time> next;
  for (const auto& [agent, until] : until_) {
    for (const Time end : {until.driving, until.sleeping, until.paused}) {
      if (end > now) next = std::min(next.value_or(end), end);
    }
  }
  return next;
}

bool Leases::MayBeSilent(AgentId agent, Time now) const {
  const auto found = until_.find(agent);
  if (found == until_.end()) return false;
  return found->second.sleeping > now || (is_quiet_while_driving_ && found->second.driving > now);
}

bool Leases::IsQuiet(AgentId agent, Time now) const {
  const auto found = until_.find(agent);
  return MayBeSilent(agent, now) || (found != until_.end() && found->second.paused > now);
}

}  // namespace moondb
