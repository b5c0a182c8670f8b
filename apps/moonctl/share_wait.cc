#include "apps/moonctl/share_wait.h"

#include <algorithm>
#include <set>
#include <thread>

#include "apps/common/progress.h"
#include "apps/common/table.h"
#include "apps/moonctl/share_status.h"

namespace moondb {
namespace {

constexpr std::chrono::milliseconds kPollPeriod(50);
constexpr std::chrono::milliseconds kRelayedPollPeriod(1000);  // Over the radio, whose time the sharing needs.

}  // namespace

ShareWait::ShareWait(CommandContext& context, std::vector<SharePair> pairs) : context_(context) {
  const proto::TeamConfig& team = (*context_.Team())->config;
  std::set<AgentId> involved;
  for (const SharePair& pair : pairs) involved.insert({pair.sender, pair.destination});
  for (const AgentId agent : involved) {
    const std::string name = AgentName(team, agent);
    if (auto connected = context_.Connect(name)) {
      clients_[agent] = std::move(connected->client);
    } else {
      unreachable_.push_back(name);
    }
  }
  for (const SharePair& pair : pairs) {
    if (clients_.contains(pair.sender) && clients_.contains(pair.destination)) pairs_[pair];
  }
  for (const auto& [agent, client] : clients_) {
    if (Poll(agent, /*is_baseline=*/true)) continue;
    // Without it an earlier session would count as the one that is waited for.
    unreachable_.push_back(AgentName(team, agent));
    std::erase_if(pairs_, [lost = agent](const auto& pair) {
      return pair.first.sender == lost || pair.first.destination == lost;
    });
  }
}

bool ShareWait::Poll(AgentId sender, bool is_baseline) {
  const auto status = clients_.at(sender)->ShareStatus();
  if (!status) return false;
  for (const proto::ShareSession& session : status->sessions()) {
    const auto found = pairs_.find({sender, session.destination(), session.kind()});
    if (found == pairs_.end()) continue;
    Progressing& pair = found->second;
    if (is_baseline) {
      pair.completed_before = session.completed_sessions();
      pair.closed_before = session.closed_sessions();
      pair.limited_before = session.limited_sessions();
      pair.coded_before = session.coded_bytes();
    }
    pair.remaining = session.remaining();
    pair.coded_bytes = session.coded_bytes() - pair.coded_before;
    pair.eta_s = session.is_open() ? PaceOf(session).eta_s : std::nullopt;
    pair.last_error = session.waits_for().empty() ? session.last_error() : session.waits_for();
    if (is_baseline) continue;
    const bool is_open = session.is_open() && !session.is_unasked();
    pair.is_limited = !is_open && session.limited_sessions() > pair.limited_before;
    pair.is_done = pair.is_limited || (!is_open && session.completed_sessions() > pair.completed_before);
    pair.is_closed = !is_open && !pair.is_done && session.closed_sessions() > pair.closed_before;
  }
  return true;
}

std::string ShareWait::Missing() const {
  const proto::TeamConfig& team = (*context_.Team())->config;
  std::string text;
  for (const auto& [pair, state] : pairs_) {
    if (state.is_done) continue;
    text += (text.empty() ? "" : ", ") + AgentName(team, pair.sender) + " to " + AgentName(team, pair.destination);
    if (!state.last_error.empty()) text += " (" + state.last_error + ")";
  }
  return text;
}

std::string ShareWait::ProgressText(double remaining, std::size_t done) const {
  double coded_bytes = 0;
  double eta_s = 0;
  for (const auto& [pair, state] : pairs_) {
    coded_bytes += state.coded_bytes;
    eta_s = std::max(eta_s, state.eta_s.value_or(0));
  }
  const std::string eta = eta_s >= 1 ? ", about " + FormatSeconds(eta_s) + " to go" : "";
  return FormatCount(remaining) + " records left, " + FormatBytes(coded_bytes) + " sent" + eta + ", " +
         std::to_string(done) + " of " + std::to_string(pairs_.size()) + " sessions complete";
}

bool ShareWait::is_any_limited() const {
  return std::any_of(pairs_.begin(), pairs_.end(), [](const auto& pair) { return pair.second.is_limited; });
}

Result<void> ShareWait::Wait(std::chrono::milliseconds timeout) {
  const auto deadline = std::chrono::steady_clock::now() + timeout;
  std::set<AgentId> senders;
  for (const auto& [pair, state] : pairs_) senders.insert(pair.sender);
  Progress progress("sharing");
  double most_remaining = 0;
  int looks_done = 0;
  while (true) {
    for (const AgentId sender : senders) (void)Poll(sender, /*is_baseline=*/false);
    double remaining = 0;
    std::size_t done = 0;
    bool is_any_closed = false;
    for (const auto& [pair, state] : pairs_) {
      remaining += state.is_done ? 0 : state.remaining;
      done += state.is_done ? 1 : 0;
      is_any_closed = is_any_closed || state.is_closed;
    }
    most_remaining = std::max(most_remaining, remaining);
    const double total = most_remaining + static_cast<double>(pairs_.size());
    progress.Show(most_remaining - remaining + static_cast<double>(done), total, ProgressText(remaining, done));
    looks_done = done == pairs_.size() ? looks_done + 1 : 0;
    if (looks_done == 2) return {};
    if (is_any_closed) {
      return Fail(ErrorCode::kUnavailable, "ended before all was acknowledged: " + Missing() + "; order it again");
    }
    if (std::chrono::steady_clock::now() >= deadline) {
      return Fail(ErrorCode::kTimedOut, "not acknowledged in time: " + Missing());
    }
    std::this_thread::sleep_for(context_.via.empty() ? kPollPeriod : kRelayedPollPeriod);
  }
}

}  // namespace moondb
