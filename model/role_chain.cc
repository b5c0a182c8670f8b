#include "model/role_chain.h"

#include <algorithm>
#include <utility>

#include "model/term.h"

namespace moondb {
namespace {

// Returns a map key: equal for equal terms, different for different terms.
std::string TermKey(const proto::Term& term) {
  return std::to_string(term.number()) + "." + std::to_string(term.issuer()) + "." +
         std::to_string(term.issuer_epoch());
}

}  // namespace

RoleChain::RoleChain(Options options) : options_(std::move(options)) { Keep(options_.initial); }

const proto::RoleAssignment& RoleChain::Keep(const proto::RoleAssignment& roles) {
  const std::string key = options_.has_keys || roles.term().number() == 0 ? roles.signature() : TermKey(roles.term());
  const auto [entry, is_new] = counting_.insert_or_assign(key, roles);
  const proto::RoleAssignment& kept = entry->second;
  if (!is_new) return kept;
  ++counting_of_issuer_[roles.term().issuer()];
  for (const AgentId agent : {roles.leader(), roles.survivor()}) {
    if (agent != 0) had_role_.insert(agent);
  }
  leaders_.emplace(TermKey(roles.term()), roles.leader());
  if (newest_ == nullptr || IsNewer(roles.term(), newest_->term())) newest_ = &kept;
  return kept;
}

RoleChain::Standing RoleChain::StandingOf(const proto::RoleAssignment& roles) const {
  if (!options_.has_keys) return Standing::kCounts;
  if (roles.signature().empty()) return Standing::kNever;
  if (counting_.contains(roles.signature())) return Standing::kCounts;
  const AgentId issuer = roles.term().issuer();
  const auto count = counting_of_issuer_.find(issuer);
  if (count != counting_of_issuer_.end() && count->second >= kAssignmentsOfIssuerMax) return Standing::kNever;
  // Revision 0 begins a new era, for which the issuer needs the right to command. The assignment is valid even if its
  // predecessor is unknown here, because the predecessor may never become known. A known predecessor must be of the
  // previous era.
  if (RevisionOf(roles.term()) == 0) {
    const bool begins_era = EraOf(roles.term()) > 0 && options_.may_command(issuer);
    if (!begins_era) return Standing::kNever;
    const proto::RoleAssignment* follows = Find(roles.follows());
    return follows == nullptr || EraOf(follows->term()) + 1 == EraOf(roles.term()) ? Standing::kCounts
                                                                                   : Standing::kNever;
  }
  const proto::RoleAssignment* follows = Find(roles.follows());
  if (follows == nullptr) return Standing::kLacksPredecessor;
  const bool is_next = roles.term().number() == follows->term().number() + 1;
  const bool had_role = issuer != 0 && (issuer == follows->leader() || issuer == follows->survivor());
  return is_next && had_role ? Standing::kCounts : Standing::kNever;
}

RoleChain::Standing RoleChain::Add(const proto::RoleAssignment& roles) {
  const Standing standing = StandingOf(roles);
  if (standing == Standing::kLacksPredecessor) {
    const auto [first, last] = waiting_.equal_range(roles.follows());
    const bool is_known = std::any_of(
        first, last, [&roles](const auto& waiting) { return waiting.second.signature() == roles.signature(); });
    if (!is_known && MakeRoomToWait(roles.term().issuer())) waiting_.emplace(roles.follows(), roles);
  }
  if (standing != Standing::kCounts) return standing;
  std::vector<proto::RoleAssignment> added = {roles};
  while (!added.empty()) {
    const proto::RoleAssignment next = std::move(added.back());
    added.pop_back();
    if (StandingOf(next) != Standing::kCounts) continue;
    Keep(next);
    const auto [first, last] = waiting_.equal_range(next.signature());
    for (auto waiting = first; waiting != last; ++waiting) added.push_back(std::move(waiting->second));
    waiting_.erase(first, last);
  }
  return standing;
}

bool RoleChain::MakeRoomToWait(AgentId issuer) {
  if (waiting_.size() < kWaitingAssignmentsMax) return true;
  std::map<AgentId, std::size_t> counts;
  for (const auto& [follows, roles] : waiting_) ++counts[roles.term().issuer()];
  const auto most =
      std::max_element(counts.begin(), counts.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  if (counts[issuer] + 1 >= most->second) return false;
  auto oldest = waiting_.end();
  for (auto waiting = waiting_.begin(); waiting != waiting_.end(); ++waiting) {
    if (waiting->second.term().issuer() != most->first) continue;
    if (oldest == waiting_.end() || IsNewer(oldest->second.term(), waiting->second.term())) oldest = waiting;
  }
  waiting_.erase(oldest);
  return true;
}

const proto::RoleAssignment* RoleChain::Find(const std::string& signature) const {
  const auto found = counting_.find(signature);
  return found == counting_.end() ? nullptr : &found->second;
}

bool RoleChain::HasLedIn(AgentId agent, const proto::Term& term) const {
  const auto [first, last] = leaders_.equal_range(TermKey(term));
  return std::any_of(first, last, [agent](const auto& leader) { return leader.second == agent; });
}

std::vector<proto::RoleAssignment> RoleChain::ChainOf(const std::string& signature, std::size_t bytes_max) const {
  std::vector<proto::RoleAssignment> chain;
  std::size_t bytes = 0;
  for (const proto::RoleAssignment* at = Find(signature); at != nullptr && !at->signature().empty();) {
    bytes += at->ByteSizeLong();
    if (!chain.empty() && bytes > bytes_max) break;
    chain.push_back(*at);
    if (RevisionOf(at->term()) == 0) break;  // The era begins with this assignment.
    at = Find(at->follows());
  }
  return chain;
}

proto::RoleAssignment RoleChain::Next(const proto::RoleAssignment& follows, bool is_command) {
  proto::RoleAssignment next;
  const std::uint64_t era = EraOf(follows.term());
  next.mutable_term()->set_number(is_command ? TermNumber(era + 1, 0) : follows.term().number() + 1);
  next.set_follows(follows.signature());
  return next;
}

}  // namespace moondb
