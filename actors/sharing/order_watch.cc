#include "actors/sharing/order_watch.h"

#include <algorithm>
#include <utility>

#include "model/term.h"

namespace moondb {
namespace {

bool HasChanged(const proto::ShareProgress& before, const proto::ShareProgress& after) {
  return before.version() == 0 || before.SerializeAsString() != after.SerializeAsString();
}

}  // namespace

void OrderWatch::Add(Order order) {
  while (orders_.size() >= kOrdersMax) {
    const auto oldest = std::find_if(orders_.begin(), orders_.end(),
                                     [this](const Watched& watched) { return !IsWaitedFor(watched.order.number); });
    if (oldest == orders_.end()) break;  // A request waits for each order, so kRequestsMax bounds the number of orders.
    orders_.erase(oldest);
  }
  Watched& watched = orders_.emplace_back();
  watched.progress.set_order(order.number);
  *watched.progress.mutable_term() = order.term;
  watched.order = std::move(order);
}

Result<void> OrderWatch::Wait(Request request) {
  if (Find(request.order) == nullptr) return Fail(ErrorCode::kNotFound, "this agent knows no such order", "order");
  if (requests_.size() >= kRequestsMax) {
    return Fail(ErrorCode::kFull, "too many requests wait for orders at this agent; try again later");
  }
  requests_.push_back(std::move(request));
  return {};
}

void OrderWatch::EndTerm(const proto::Term& term, const Error& error) {
  for (Watched& watched : orders_) {
    const Order& order = watched.order;
    if (watched.is_settled || !order.is_by_role || OrderOf(order.term) == OrderOf(term)) continue;
    *watched.progress.mutable_error() = ToProto(error);
    watched.is_settled = true;
  }
}

std::vector<OrderWatch::Answer> OrderWatch::CollectAnswers(Time now, const RowsOf& rows_of) {
  if (requests_.empty()) return {};
  is_look_due_ = now < last_look_ + kLookPeriod;
  if (is_look_due_) return {};
  last_look_ = now;
  for (Watched& watched : orders_) {
    if (!watched.is_settled && IsWaitedFor(watched.order.number)) Update(watched, rows_of);
  }
  std::vector<Answer> answers;
  std::vector<Request> waiting;
  for (Request& request : requests_) {
    Watched& watched = *Find(request.order);
    const bool is_news = watched.progress.version() > request.after_version &&
                         (!watched.reported || now >= *watched.reported + request.news_period);
    const bool is_due = request.is_for_end ? watched.progress.is_over() : is_news || watched.progress.is_over();
    if (is_due || watched.progress.has_error() || now >= request.until) {
      if (!request.is_for_end) watched.reported = now;
      answers.push_back({std::move(request), watched.progress});
    } else {
      waiting.push_back(std::move(request));
    }
  }
  requests_ = std::move(waiting);
  return answers;
}

std::optional<OrderWatch::Time> OrderWatch::deadline() const {
  if (requests_.empty()) return std::nullopt;
  Time first = last_look_ + (is_look_due_ ? kLookPeriod : kCountdownPeriod);
  for (const Request& request : requests_) {
    first = std::min(first, request.until);
    const auto watched = std::find_if(orders_.begin(), orders_.end(),
                                      [&](const Watched& one) { return one.order.number == request.order; });
    if (request.is_for_end || watched == orders_.end() || !watched->reported) continue;
    if (watched->progress.version() > request.after_version)
      first = std::min(first, *watched->reported + request.news_period);
  }
  return std::max(first, last_look_ + kLookPeriod);
}

OrderWatch::Watched* OrderWatch::Find(std::uint64_t number) {
  const auto found = std::find_if(orders_.begin(), orders_.end(),
                                  [number](const Watched& watched) { return watched.order.number == number; });
  return found == orders_.end() ? nullptr : &*found;
}

bool OrderWatch::IsWaitedFor(std::uint64_t number) const {
  return std::any_of(requests_.begin(), requests_.end(),
                     [number](const Request& request) { return request.order == number; });
}

void OrderWatch::Update(Watched& watched, const RowsOf& rows_of) {
  Rows rows = rows_of(watched.order);
  proto::ShareProgress progress = watched.progress;
  *progress.mutable_pairs() = {rows.pairs.begin(), rows.pairs.end()};
  const auto is_complete = [](const proto::PairProgress& pair) { return pair.is_complete(); };
  const auto is_over = [](const proto::PairProgress& pair) { return pair.is_complete() || pair.is_stopped(); };
  progress.set_is_complete(!rows.is_open_ended && std::all_of(rows.pairs.begin(), rows.pairs.end(), is_complete));
  progress.set_is_over(!rows.is_open_ended && std::all_of(rows.pairs.begin(), rows.pairs.end(), is_over));
  if (!HasChanged(watched.progress, progress)) return;
  progress.set_version(progress.version() + 1);
  watched.is_settled = progress.is_complete();
  watched.progress = std::move(progress);
}

}  // namespace moondb
