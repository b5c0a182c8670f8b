#include "actors/sharing/standing_order.h"

#include <algorithm>
#include <utility>

#include "model/order_number.h"
#include "proto/share_status.pb.h"

namespace moondb {

void StandingOrder::Set(proto::RecordFilter filter, std::uint64_t bytes_max, ShareOrderId id, bool is_added) {
  // The new filter may exclude records that earlier orders asked for, so end these orders.
  if (is_added && filter.SerializeAsString() != filter_.SerializeAsString()) End(Ending::kClosed);
  Note(id);
  if (++mark_ == 0) ++mark_;
  const bool is_limited = bytes_max != 0 && (!is_added || bytes_left_);
  bytes_left_ = is_limited ? std::optional(bytes_max) : std::nullopt;
  filter_ = std::move(filter);
  is_periodic_ = false;
}

void StandingOrder::SetPeriodic(const proto::RecordFilter& filter, bool is_for_states) {
  bytes_left_.reset();
  filter_ = filter;
  is_periodic_ = true;
  scope_ = is_for_states ? Scope::kStates : Scope::kAll;
}

void StandingOrder::Note(ShareOrderId id) {
  if (id.number == 0) return;
  KnownOrder& known = orders_[id.agent];
  known.is_open = true;
  known.order.set_agent(id.agent);
  // Ignore the number of a late copy of an earlier order.
  if (!HasReached(known.order.ordered(), id.number)) known.order.set_ordered(id.number);
}

StandingOrder::Reached StandingOrder::StateOf(ShareOrderId id) const {
  const auto known = orders_.find(id.agent);
  if (known == orders_.end() || !HasReached(known->second.order.ordered(), id.number)) return Reached::kUnknown;
  const KnownOrder& newest = known->second;
  if (newest.order.ordered() != id.number && HasReached(newest.order.completed(), id.number))
    return Reached::kCompleted;
  return newest.is_open ? Reached::kOpen : newest.ended;
}

std::uint64_t StandingOrder::NumberFor(AgentId destination) const {
  const auto known = orders_.find(destination);
  return known == orders_.end() || !known->second.is_open ? 0 : known->second.order.ordered();
}

void StandingOrder::End(Ending ending) {
  for (auto& [agent, known] : orders_) {
    if (!std::exchange(known.is_open, false)) continue;
    const std::uint64_t number = known.order.ordered();
    switch (ending) {
      case Ending::kCompleted:
        known.order.set_completed(number);
        known.ended = Reached::kCompleted;
        break;
      case Ending::kClosed:
        known.order.set_closed(number);
        known.ended = Reached::kClosed;
        break;
      case Ending::kLimited:
        known.order.set_limited(number);
        known.ended = Reached::kLimited;
        break;
    }
  }
}

bool StandingOrder::SetWindow(Window window) {
  if (window == window_) return false;
  window_ = window;
  is_waiting_ = window != Window::kOpen;
  return true;
}

void StandingOrder::EvaluateAgain() {
  if (window_ != Window::kStatesOnly) return;
  const bool is_for_more = is_periodic_ && scope_ == Scope::kAll;
  is_waiting_ = is_for_more || StatesMeant().data_types().empty();
}

void StandingOrder::StartOver() {
  if (is_periodic()) return;
  scope_ = window_ == Window::kStatesOnly ? Scope::kStates : Scope::kAll;
}

void StandingOrder::FillRequest(proto::Hello& hello) {
  asked_origins_ = OriginsMeant();
  asked_types_ = {filter_.everyones_types().begin(), filter_.everyones_types().end()};
  *hello.mutable_origin_agents() = {asked_origins_.begin(), asked_origins_.end()};
  *hello.mutable_everyones_types() = filter_.everyones_types();
}

bool StandingOrder::NeedsNewStart() const {
  const bool may_more_pass = scope_ == Scope::kStates && window_ != Window::kStatesOnly;
  return may_more_pass || !IsAllAsked();
}

bool StandingOrder::IsAllAsked() const {
  if (asked_origins_.empty()) return true;
  const auto is_asked = [this](DataType type) { return asked_types_.contains(type); };
  const std::set<AgentId> origins = OriginsMeant();
  return !origins.empty() &&
         std::includes(asked_origins_.begin(), asked_origins_.end(), origins.begin(), origins.end()) &&
         std::all_of(filter_.everyones_types().begin(), filter_.everyones_types().end(), is_asked);
}

std::set<AgentId> StandingOrder::OriginsMeant() const {
  std::set<AgentId> origins(filter_.origin_agents().begin(), filter_.origin_agents().end());
  if (!origins.empty() && filter_.own_records_of() != 0) origins.insert(filter_.own_records_of());
  return origins;
}

proto::RecordFilter StandingOrder::Meant() const {
  proto::RecordFilter meant = is_for_states() ? StatesMeant() : filter_;
  *meant.mutable_not_data_types() = {other_schema_types_.begin(), other_schema_types_.end()};
  return meant;
}

proto::RecordFilter StandingOrder::StatesMeant() const {
  proto::RecordFilter states = filter_;
  states.clear_data_types();
  states.clear_own_records_of();
  states.clear_everyones_types();
  for (const DataType type : state_types_) {
    const auto& meant = filter_.data_types();
    if (meant.empty() || std::find(meant.begin(), meant.end(), type) != meant.end()) states.add_data_types(type);
  }
  return states;
}

void StandingOrder::SpendBytes(std::size_t coded_bytes) {
  if (bytes_left_) *bytes_left_ -= std::min<std::uint64_t>(*bytes_left_, coded_bytes);
}

void StandingOrder::AddTo(proto::ShareSession& status) const {
  *status.mutable_other_schema_types() = {other_schema_types_.begin(), other_schema_types_.end()};
  for (const auto& [agent, known] : orders_) *status.add_orders() = known.order;
}

}  // namespace moondb
