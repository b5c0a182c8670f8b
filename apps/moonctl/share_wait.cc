#include "apps/moonctl/share_wait.h"

#include <algorithm>
#include <thread>

#include "apps/common/progress.h"
#include "apps/common/table.h"
#include "apps/moonctl/share_status.h"
#include "model/order_number.h"
#include "model/term.h"

namespace moondb {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kSharePollPeriod(50);
constexpr std::chrono::milliseconds kRelayedSharePollPeriod(1000);  // Over the radio, whose time the sharing needs.
constexpr std::chrono::minutes kLeaseMargin(2);                     // For what waited for the end of a lease.
// How long an agent that answers moonctl may be without a connection to the leader before it counts as away.
constexpr std::chrono::seconds kReconnectMax(5);
constexpr int kLooksDone = 2;
// An agent's two sharing actors hear of new roles one after the other: only a session that stays closed is an error.
constexpr int kLooksClosed = 3;

// Of the order that `agent` took of moonctl.
proto::SessionOrder OrderOfAgent(const proto::ShareSession& session, AgentId agent) {
  for (const proto::SessionOrder& order : session.orders()) {
    if (order.agent() == agent) return order;
  }
  return {};
}

}  // namespace

WaitLimit::WaitLimit(const CommandContext& context)
    : is_explicit_(context.has_timeout()), end_(Clock::now() + context.WaitTimeout()) {}

void WaitLimit::OnLease(double seconds) {
  if (is_explicit_ || seconds <= 0) return;
  const auto left = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
  end_ = std::max(end_, Clock::now() + left + kLeaseMargin);
}

ShareWait::ShareWait(CommandContext& context, Options options) : context_(context), options_(std::move(options)) {
  std::set<AgentId> involved = {options_.target};
  for (const SharePair& pair : options_.pairs) involved.insert({pair.sender, pair.destination});
  for (const AgentId agent : involved) {
    const std::string name = AgentName(team(), agent);
    if (auto connected = context_.Connect(name)) {
      clients_[agent] = std::move(connected->client);
    } else {
      unreachable_.push_back(name);
    }
  }
  for (const SharePair& pair : options_.pairs) {
    if (clients_.contains(pair.sender) && clients_.contains(pair.destination)) pairs_[pair];
  }
  for (const auto& [agent, client] : clients_) {
    if (Poll(agent, /*is_baseline=*/true, nullptr)) continue;
    unreachable_.push_back(AgentName(team(), agent));
    std::erase_if(pairs_, [lost = agent](const auto& pair) {
      return pair.first.sender == lost || pair.first.destination == lost;
    });
  }
}

bool ShareWait::Poll(AgentId agent, bool is_baseline, WaitLimit* limit) {
  const auto status = clients_.at(agent)->ShareStatus();
  if (!status) return false;
  if (IsNewer(status->roles().term(), options_.roles.term())) newer_roles_ = status->roles();
  if (agent == options_.target) PollTarget(*status);
  for (const proto::ShareSession& session : status->sessions()) {
    const auto found = pairs_.find({agent, static_cast<AgentId>(session.destination()), session.kind()});
    if (found == pairs_.end()) continue;
    Progressing& pair = found->second;
    if (is_baseline) pair.coded_before = session.coded_bytes();
    pair.remaining = session.remaining();
    pair.coded_bytes = session.coded_bytes() - pair.coded_before;
    pair.eta_s = session.is_open() ? PaceOf(session).eta_s : std::nullopt;
    pair.waits_for = session.waits_for();
    pair.last_error = session.last_error();
    if (limit != nullptr) limit->OnLease(session.waits_for_s());
    const proto::SessionOrder order = OrderOfAgent(session, options_.target);
    const bool is_open = session.is_open() && !session.is_unasked();
    pair.is_limited = !is_open && HasReached(order.limited(), order_);
    pair.is_done = pair.is_limited || (!is_open && HasReached(order.completed(), order_));
    pair.is_closed = !is_open && !pair.is_done && HasReached(order.closed(), order_);
  }
  return true;
}

void ShareWait::PollTarget(const proto::ShareStatus& status) {
  is_target_in_term_ = OrderOf(status.roles().term()) == OrderOf(options_.roles.term());
  if (!is_target_in_term_ || !options_.is_gathering_meant) return;
  std::set<AgentId> to_gather;
  for (const AgentId agent : status.gathers_from()) {
    if (options_.is_gathering_meant(agent)) to_gather.insert(agent);
  }
  // Whatever it gathered since the order was given may have come too late for that order's sessions.
  if (!to_gather_ || !std::includes(to_gather.begin(), to_gather.end(), to_gather_->begin(), to_gather_->end())) {
    is_order_stale_ = true;
  }
  to_gather_ = to_gather;
  not_gathered_.clear();
  std::set<AgentId> can_be_asked = to_gather;
  for (const proto::LaterGathering& later : status.gathers_later()) {
    const auto agent = static_cast<AgentId>(later.agent());
    if (!later.is_away()) away_since_.erase(agent);
    if (!to_gather.contains(agent) || (later.is_away() && IsJustAway(agent))) continue;
    can_be_asked.erase(agent);
    not_gathered_.push_back({AgentName(team(), agent), later.why()});
  }
  left_to_gather_ = can_be_asked.size();
  const auto now_from = static_cast<AgentId>(status.gathers_now_from());
  const AgentId shown = can_be_asked.contains(now_from) ? now_from : can_be_asked.empty() ? 0 : *can_be_asked.begin();
  gathers_from_ = shown == 0 ? "" : AgentName(team(), shown);
}

bool ShareWait::IsJustAway(AgentId agent) {
  const auto since = away_since_.try_emplace(agent, Clock::now()).first->second;
  if (Clock::now() - since > kReconnectMax) return false;
  const auto known = answers_.find(agent);
  if (known != answers_.end()) return known->second;
  return answers_[agent] = clients_.contains(agent) || context_.Connect(AgentName(team(), agent)).has_value();
}

void ShareWait::Look(WaitLimit& limit) {
  is_target_in_term_ = false;
  std::set<AgentId> asked = {options_.target};
  for (const auto& [pair, state] : pairs_) asked.insert(pair.sender);
  for (const AgentId agent : asked) {
    if (clients_.contains(agent)) (void)Poll(agent, /*is_baseline=*/false, &limit);
  }
}

std::size_t ShareWait::CountDone() const {
  return static_cast<std::size_t>(
      std::count_if(pairs_.begin(), pairs_.end(), [](const auto& pair) { return pair.second.is_done; }));
}

std::string ShareWait::Missing() const {
  std::string text;
  for (const auto& [pair, state] : pairs_) {
    if (state.is_done) continue;
    text += (text.empty() ? "" : ", ") + AgentName(team(), pair.sender) + " to " + AgentName(team(), pair.destination);
    const std::string& why = state.waits_for.empty() ? state.last_error : state.waits_for;
    if (!why.empty()) text += " (" + why + ")";
  }
  if (!gathers_from_.empty()) {
    text += (text.empty() ? "" : ", ") + AgentName(team(), options_.target) + " gathers from " + gathers_from_;
  }
  return text;
}

std::string ShareWait::WaitsFor() const {
  for (const auto& [pair, state] : pairs_) {
    if (!state.is_done && !state.waits_for.empty()) return state.waits_for;
  }
  return gathers_from_.empty() ? "" : "gathers from " + gathers_from_;
}

std::string ShareWait::ProgressText(double remaining) const {
  double coded_bytes = 0;
  double eta_s = 0;
  for (const auto& [pair, state] : pairs_) {
    coded_bytes += state.coded_bytes;
    eta_s = std::max(eta_s, state.eta_s.value_or(0));
  }
  const std::string eta = eta_s >= 1 ? ", about " + FormatSeconds(eta_s) + " to go" : "";
  const std::string waits_for = WaitsFor();
  return FormatCount(remaining) + " records left, " + FormatBytes(coded_bytes) + " sent" + eta + ", " +
         std::to_string(CountDone()) + " of " + std::to_string(pairs_.size()) + " sessions complete" +
         (waits_for.empty() ? "" : ", " + waits_for);
}

bool ShareWait::is_any_limited() const {
  return std::any_of(pairs_.begin(), pairs_.end(), [](const auto& pair) { return pair.second.is_limited; });
}

Result<bool> ShareWait::Wait(const GiveOrder& give_order, WaitLimit& limit) {
  Progress progress("sharing");
  double most_remaining = 0;
  std::size_t most_to_gather = 0;
  int looks_done = 0;
  int looks_closed = 0;
  is_order_stale_ = true;
  while (true) {
    if (order_ == 0 || (looks_done >= kLooksDone && is_order_stale_)) {
      is_order_stale_ = !to_gather_ && options_.is_gathering_meant;
      Result<std::uint64_t> order = give_order();
      if (!order) return tl::unexpected(order.error());
      order_ = *order;
      looks_done = 0;
    }
    Look(limit);
    if (newer_roles_) return false;
    double remaining = 0;
    bool is_any_closed = false;
    for (const auto& [pair, state] : pairs_) {
      remaining += state.is_done ? 0 : state.remaining;
      is_any_closed = is_any_closed || state.is_closed;
    }
    const std::size_t done = CountDone();
    most_remaining = std::max(most_remaining, remaining);
    most_to_gather = std::max(most_to_gather, left_to_gather_);
    const double total = most_remaining + static_cast<double>(pairs_.size() + most_to_gather);
    const double left = remaining + static_cast<double>(pairs_.size() - done + left_to_gather_);
    progress.Show(total - left, total, ProgressText(remaining));
    const bool is_all_done = done == pairs_.size() && gathers_from_.empty() && is_target_in_term_;
    looks_done = is_all_done ? looks_done + 1 : 0;
    looks_closed = is_any_closed ? looks_closed + 1 : 0;
    if (looks_done >= kLooksDone && !is_order_stale_) return true;
    if (looks_closed == kLooksClosed) {
      return Fail(ErrorCode::kUnavailable, "ended before all was acknowledged: " + Missing() + "; order it again");
    }
    if (limit.is_over()) return Fail(ErrorCode::kTimedOut, "not acknowledged in time: " + Missing());
    std::this_thread::sleep_for(context_.is_relayed() ? kRelayedSharePollPeriod : kSharePollPeriod);
  }
}

}  // namespace moondb
