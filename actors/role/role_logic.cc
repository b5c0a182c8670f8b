#include "actors/role/role_logic.h"

#include <algorithm>
#include <utility>

#include "model/check.h"
#include "model/term.h"

namespace moondb {

RoleLogic::RoleLogic(Options options)
    : options_(std::move(options)), chain_({options_.initial, options_.may_command, options_.sign != nullptr}) {}

RoleLogic::Actions RoleLogic::OnLoaded(std::vector<proto::RoleAssignment> history, std::uint64_t own_epoch,
                                       std::int64_t now_ns, const std::vector<proto::RoleAssignment>& known) {
  Check(!is_loaded_ && own_epoch != 0, "roles are loaded once, in an epoch");
  is_loaded_ = true;
  own_epoch_ = own_epoch;
  started_ns_ = now_ns;
  history_ = std::move(history);
  for (const proto::RoleAssignment& roles : history_) {
    highest_number_ = std::max(highest_number_, roles.term().number());
  }
  for (const proto::RoleAssignment& roles : history_) ObserveStored(roles);
  for (const proto::RoleAssignment& roles : known) ObserveStored(roles);
  const proto::RoleAssignment stored = has_keys() || history_.empty() ? chain_.newest() : history_.back();
  current_ = options_.check(stored) ? stored : options_.initial;
  confirmed_ = {options_.self};

  Actions actions;
  if (current_.leader() == options_.self) {
    is_waiting_to_lead_ = true;
    actions.leader_timer = options_.leader_wait;
    if (IsConfirmedByAll()) TakeNewTerm(/*is_start=*/true, actions);  // A team of one agent.
  } else {
    actions.apply = current_;
  }
  announce_delay_ = options_.announce_after;
  NotifyUnconfirmed(actions);
  return actions;
}

Result<proto::RoleAssignment> RoleLogic::Propose(const proto::RoleSetRequest& request, std::int64_t now_ns) const {
  if (!is_loaded_) return Fail(ErrorCode::kUnavailable, "the stored roles are still being read; try again");
  if (unstored_) {
    return Fail(ErrorCode::kRefused,
                "term " + TermText(unstored_->term()) +
                    " is known but this agent cannot store it; send the command to another agent with -a");
  }
  if (saving_) return Fail(ErrorCode::kUnavailable, "another change is being stored; try again");
  if (request.reason().size() > kRoleReasonBytesMax) {
    return Fail(ErrorCode::kInvalid, "is longer than " + std::to_string(kRoleReasonBytesMax) + " bytes", "reason");
  }
  if (Result<void> checked = CheckExpected(request); !checked) return tl::unexpected(checked.error());
  if (Result<void> checked = CheckMayDecide(); !checked) return tl::unexpected(checked.error());
  proto::RoleAssignment roles;
  if (request.is_swap()) {
    if (request.leader() != 0 || request.survivor() != 0) {
      return Fail(ErrorCode::kInvalid, "exchanges leader and survivor: do not name either of them", "is_swap");
    }
    if (current_.survivor() == 0) {
      return Fail(ErrorCode::kRefused, "needs a designated survivor, and none is assigned", "is_swap");
    }
    roles.set_leader(current_.survivor());
    roles.set_survivor(current_.leader());
  } else {
    if (request.leader() == 0 && request.survivor() == 0) {
      return Fail(ErrorCode::kInvalid, "names neither a leader nor a survivor", "leader");
    }
    roles.set_leader(request.leader() != 0 ? request.leader() : current_.leader());
    roles.set_survivor(request.survivor() != 0 ? request.survivor() : current_.survivor());
  }
  if (Result<void> checked = CheckNew(roles); !checked) return tl::unexpected(checked.error());
  roles.set_timestamp_ns(now_ns);
  roles.set_reason(request.reason());
  return Issue(std::move(roles), /*is_command=*/true);
}

Result<proto::RoleAssignment> RoleLogic::ProposeStepDown(const std::set<AgentId>& connected, const std::string& reason,
                                                         std::int64_t now_ns) const {
  if (unstored_) return Fail(ErrorCode::kNotFound, "this agent has already given up its role");
  if (!is_loaded_ || saving_) return Fail(ErrorCode::kUnavailable, "the roles are being read or stored");
  if (current_.leader() != options_.self && current_.survivor() != options_.self) {
    return Fail(ErrorCode::kNotFound, "this agent has no role to give up");
  }
  std::optional<proto::RoleAssignment> roles = WithoutOwnRole(connected);
  if (!roles) return Fail(ErrorCode::kUnavailable, "no connected agent can take the role");
  roles->set_timestamp_ns(now_ns);
  roles->set_reason(reason.substr(0, kRoleReasonBytesMax));
  return Issue(*std::move(roles), /*is_command=*/false);
}

std::optional<proto::RoleAssignment> RoleLogic::WithoutOwnRole(const std::set<AgentId>& connected) const {
  // Prefer the survivor, which holds the most records. This agent is the last choice.
  std::vector<AgentId> candidates = {current_.survivor()};
  candidates.insert(candidates.end(), options_.agents.begin(), options_.agents.end());
  std::erase_if(candidates, [&](AgentId agent) { return !connected.contains(agent); });
  candidates.push_back(options_.self);
  const bool is_leader = current_.leader() == options_.self;
  for (const AgentId leader : is_leader ? candidates : std::vector<AgentId>{current_.leader()}) {
    for (const AgentId survivor : candidates) {
      proto::RoleAssignment roles;
      roles.set_leader(leader);
      roles.set_survivor(survivor);
      const bool is_change = leader != current_.leader() || survivor != current_.survivor();
      if ((is_leader ? leader : survivor) != options_.self && is_change && CheckNew(roles)) return roles;
    }
  }
  return std::nullopt;
}

RoleLogic::Actions RoleLogic::Adopt(proto::RoleAssignment roles) {
  Check(is_loaded_ && !saving_, "one assignment is stored at a time");
  highest_number_ = std::max(highest_number_, roles.term().number());  // The number is used up even if storing fails.
  Actions actions;
  actions.save = roles;
  saving_ = Saving{.roles = std::move(roles), .holders = {options_.self}};
  return actions;
}

Result<RoleLogic::Actions> RoleLogic::OnAnnounce(AgentId from, const proto::RoleAnnounce& announce) {
  Actions actions;
  if (!is_loaded_) return actions;  // The sender will repeat the announcement.
  if (!IsMember(from) || HasLeft(from) || from == options_.self) {
    return Fail(ErrorCode::kRefused, "is not in this team", "sender");
  }
  if (Result<void> checked = CheckAnnounced(announce.roles()); !checked) return tl::unexpected(checked.error());
  const proto::RoleAssignment& theirs = announce.roles();
  if (OrderOf(theirs.term()) == OrderOf(current_.term())) {
    if (theirs.leader() != current_.leader() || theirs.survivor() != current_.survivor() ||
        theirs.signature() != current_.signature()) {
      return Fail(ErrorCode::kRefused, "this agent has a different assignment for the same term", "roles");
    }
    if (!announce.is_reply()) Notify(from, /*is_reply=*/true, actions);
    Confirm(from, actions);
  } else if (IsNewer(current_.term(), theirs.term())) {
    confirmed_.erase(from);
    Notify(from, /*is_reply=*/true, actions);
  } else if (unstored_ && IsNewer(unstored_->term(), theirs.term())) {
    return actions;  // An agent that holds the newer assignment will announce it to the sender.
  } else if (!saving_) {
    switch (chain_.StandingOf(theirs)) {
      case RoleChain::Standing::kCounts:
        AdoptAnnounced(from, theirs, actions);
        break;
      case RoleChain::Standing::kLacksPredecessor:
        RequestChain(from, theirs, actions);
        break;
      case RoleChain::Standing::kNever:
        return Fail(ErrorCode::kRefused, "is invalid: " + WhyNever(theirs), "roles");
    }
  }
  return actions;
}

void RoleLogic::AdoptAnnounced(AgentId from, const proto::RoleAssignment& theirs, Actions& actions) {
  const AgentId issuer = theirs.term().issuer();
  if (!TakeChange(issuer)) return;
  actions.save = Adopt(theirs).save;
  saving_->holders.insert(from);
  if (issuer != 0) saving_->holders.insert(issuer);
  saving_->answer_to = from;
}

// --- Chains ---

void RoleLogic::RequestChain(AgentId from, const proto::RoleAssignment& theirs, Actions& actions) {
  // Request only one chain at a time; other agents will repeat their announcements. A newer announcement of the same
  // agent replaces the request.
  if (chain_asked_ && chain_asked_->from != from) return;
  const bool goes_on = chain_asked_ && chain_asked_->announced.signature() == theirs.signature();
  if (!goes_on) chain_asked_ = ChainAsked{from, theirs, {}};
  const auto& chain = chain_asked_->chain;
  actions.question = ChainQuestion{from, {}};
  actions.question->request.set_signature(chain.empty() ? theirs.follows() : chain.back().follows());
}

proto::RoleChainReply RoleLogic::OnChainRequest(const proto::RoleChainRequest& request) const {
  proto::RoleChainReply reply;
  for (proto::RoleAssignment& roles : chain_.ChainOf(request.signature(), kChainPageBytesMax)) {
    *reply.add_chain() = std::move(roles);
  }
  return reply;
}

Result<RoleLogic::Actions> RoleLogic::OnChainReply(AgentId from, const proto::RoleChainReply& reply) {
  Actions actions;
  if (!chain_asked_ || chain_asked_->from != from) return actions;
  ChainAsked asked = *std::exchange(chain_asked_, std::nullopt);
  const bool is_passed = !IsNewer(asked.announced.term(), current_.term()) ||
                         (unstored_ && IsNewer(unstored_->term(), asked.announced.term()));
  if (saving_ || is_passed) return actions;
  if (reply.chain().empty())
    return Fail(ErrorCode::kRefused, "lacks the predecessor of the announced assignment", "chain");
  const proto::RoleAssignment* later = asked.chain.empty() ? &asked.announced : &asked.chain.back();
  std::string follows = later->follows();
  bool is_joined = false;
  for (const proto::RoleAssignment& roles : reply.chain()) {
    if (roles.signature() != follows)
      return Fail(ErrorCode::kRefused, "contains an assignment that was not requested", "chain");
    if (Result<void> checked = CheckIssued(roles); !checked) return tl::unexpected(checked.error());
    is_joined = chain_.StandingOf(roles) == RoleChain::Standing::kCounts;
    if (chain_.Find(roles.signature()) == nullptr) asked.chain.push_back(roles);
    if (is_joined) break;
    follows = roles.follows();
  }
  if (!is_joined && asked.chain.size() >= kChainLengthMax) {
    return Fail(ErrorCode::kRefused, "is longer than " + std::to_string(kChainLengthMax) + " assignments", "chain");
  }
  if (!is_joined) {
    actions.question = ChainQuestion{from, {}};
    actions.question->request.set_signature(follows);
    chain_asked_ = std::move(asked);
    return actions;
  }
  // Add the oldest first: an assignment is valid only if its predecessor is valid.
  std::for_each(asked.chain.rbegin(), asked.chain.rend(),
                [this](const proto::RoleAssignment& roles) { (void)chain_.Add(roles); });
  if (chain_.StandingOf(asked.announced) != RoleChain::Standing::kCounts) {
    return Fail(ErrorCode::kRefused, "is invalid: " + WhyNever(asked.announced), "roles");
  }
  AdoptAnnounced(from, asked.announced, actions);
  return actions;
}

RoleLogic::Actions RoleLogic::OnRecord(const proto::RoleAssignment& roles) {
  Actions actions;
  ObserveStored(roles);
  AdoptNewestKnown(actions);
  return actions;
}

void RoleLogic::AdoptNewestKnown(Actions& actions) {
  const proto::RoleAssignment& newest = chain_.newest();
  const bool is_newer =
      IsNewer(newest.term(), current_.term()) && (!unstored_ || IsNewer(newest.term(), unstored_->term()));
  if (!is_loaded_ || saving_ || !is_newer || !CheckAnnounced(newest)) return;
  if (TakeChange(newest.term().issuer())) {
    actions.save = Adopt(newest).save;
  } else if (!std::exchange(awaits_budget_, true)) {
    // Set the timer only once. Otherwise a stream of records could postpone the announcements.
    actions.announce_timer = announce_delay_;
  }
}

bool RoleLogic::TakeChange(AgentId issuer) {
  return !has_keys() || issuer == options_.self || changes_.Takes(issuer, now_);
}

void RoleLogic::ObserveStored(const proto::RoleAssignment& roles) {
  if (chain_.Add(roles) != RoleChain::Standing::kNever) stored_.insert(roles.signature());
}

std::vector<proto::RoleAssignment> RoleLogic::SavingChain() const {
  std::vector<proto::RoleAssignment> oldest_first;
  if (!saving_ || !has_keys()) return oldest_first;
  const proto::RoleAssignment* at = nullptr;
  if (RevisionOf(saving_->roles.term()) != 0) at = chain_.Find(saving_->roles.follows());
  while (at != nullptr && !at->signature().empty() && !stored_.contains(at->signature())) {
    oldest_first.push_back(*at);
    at = RevisionOf(at->term()) == 0 ? nullptr : chain_.Find(at->follows());
  }
  std::reverse(oldest_first.begin(), oldest_first.end());
  return oldest_first;
}

std::string RoleLogic::WhyNever(const proto::RoleAssignment& roles) const {
  return options_.name_of(roles.term().issuer()) +
         " is neither leader nor survivor in the assignment before it, nor named in command_from of the team file";
}

RoleLogic::Actions RoleLogic::OnSaved() {
  Actions actions;
  if (!saving_) return actions;
  for (const proto::RoleAssignment& roles : SavingChain()) ObserveStored(roles);
  Saving saved = *std::exchange(saving_, std::nullopt);
  current_ = std::move(saved.roles);
  ObserveStored(current_);
  history_.push_back(current_);
  if (history_.size() > kHistoryMax) history_.erase(history_.begin());
  confirmed_ = std::move(saved.holders);
  if (unstored_ && !IsNewer(unstored_->term(), current_.term())) unstored_.reset();
  own_unstored_.reset();
  is_waiting_to_lead_ = IsFromBeforeRestart(current_);
  if (is_waiting_to_lead_) {
    TakeNewTerm(/*is_start=*/current_.term().issuer() == options_.self, actions);
    return actions;
  }
  actions.apply = InForce();
  if (saved.answer_to != 0) Notify(saved.answer_to, /*is_reply=*/true, actions);
  announce_delay_ = options_.announce_after;
  NotifyUnconfirmed(actions);
  AdoptNewestKnown(actions);  // A record with a newer assignment may have arrived.
  return actions;
}

RoleLogic::Actions RoleLogic::OnSaveFailed() {
  Actions actions;
  if (!saving_) return actions;
  const proto::RoleAssignment failed = std::exchange(saving_, std::nullopt)->roles;
  if (!IsOwnTerm(failed)) {
    ActWithoutOwnRole(failed, actions);
    actions.store_timer = options_.store_after;
  } else if (is_waiting_to_lead_) {
    // This agent may still lead in an earlier term. The agent must stop leading, because that term is superseded.
    const bool is_first = !std::exchange(own_unstored_, failed).has_value();
    if (is_first) actions.apply = InForce();
    actions.leader_timer = options_.leader_wait;
  }
  return actions;
}

RoleLogic::Actions RoleLogic::OnSaveLate() {
  Actions actions;
  if (saving_ && !IsOwnTerm(saving_->roles)) ActWithoutOwnRole(saving_->roles, actions);
  return actions;
}

RoleLogic::Actions RoleLogic::OnStoreTimer() {
  Actions actions;
  if (!unstored_) return actions;
  if (saving_) {
    actions.store_timer = options_.store_after;
  } else {
    actions.save = Adopt(*unstored_).save;
  }
  return actions;
}

void RoleLogic::ActWithoutOwnRole(const proto::RoleAssignment& unstored, Actions& actions) {
  const bool is_known = unstored_ && OrderOf(unstored_->term()) == OrderOf(unstored.term());
  unstored_ = unstored;
  is_waiting_to_lead_ = false;
  if (!is_known) actions.apply = InForce();
}

proto::RoleAssignment RoleLogic::InForce() const {
  proto::RoleAssignment roles = unstored_ ? *unstored_ : current_;
  const bool may_not_lead = unstored_ || (is_waiting_to_lead_ && own_unstored_);
  if (may_not_lead && roles.leader() == options_.self) roles.set_leader(0);
  if (unstored_ && roles.survivor() == options_.self) roles.set_survivor(0);
  return roles;
}

bool RoleLogic::IsOwnTerm(const proto::RoleAssignment& roles) const {
  return roles.term().issuer() == options_.self && roles.term().issuer_epoch() == own_epoch_;
}

RoleLogic::Actions RoleLogic::OnAnnounceTimer() {
  Actions actions;
  announce_delay_ = std::min(2 * announce_delay_, options_.announce_after_max);
  NotifyUnconfirmed(actions);
  awaits_budget_ = false;
  AdoptNewestKnown(actions);
  return actions;
}

RoleLogic::Actions RoleLogic::OnLeaderTimer(std::int64_t now_ns) {
  Actions actions;
  if (!is_waiting_to_lead_) return actions;
  started_ns_ = now_ns;  // If an assignment is being stored now, OnSaved will issue the new term.
  if (!saving_) TakeNewTerm(/*is_start=*/true, actions);
  return actions;
}

RoleLogic::Actions RoleLogic::OnPeerConnected(AgentId peer) {
  Actions actions;
  if (!is_loaded_ || !IsMember(peer) || HasLeft(peer) || confirmed_.count(peer)) return actions;
  announce_delay_ = options_.announce_after;
  Notify(peer, /*is_reply=*/false, actions);
  actions.announce_timer = announce_delay_;
  return actions;
}

proto::RoleShowReply RoleLogic::Show(bool with_history) const {
  proto::RoleShowReply reply;
  *reply.mutable_roles() = InForce();
  if (unstored_ || own_unstored_) *reply.mutable_unstored() = unstored_ ? *unstored_ : *own_unstored_;
  if (!unstored_) {
    for (const AgentId agent : confirmed_) reply.add_confirmed_by(agent);
  }
  if (with_history) *reply.mutable_history() = {history_.begin(), history_.end()};
  return reply;
}

Result<void> RoleLogic::CheckExpected(const proto::RoleSetRequest& request) const {
  const proto::RoleAssignment& expected = request.expected();
  const bool is_met = OrderOf(expected.term()) == OrderOf(current_.term()) && expected.leader() == current_.leader() &&
                      expected.survivor() == current_.survivor();
  if (!request.has_expected() || is_met) return {};
  const auto& name = options_.name_of;
  const auto term = [&name](const proto::Term& of) {
    return "term " + TermText(of) + (of.issuer() == 0 ? "" : " by " + name(of.issuer()));
  };
  return Fail(ErrorCode::kRefused,
              name(options_.self) + " holds " + term(current_.term()) + ": " + name(current_.leader()) + " leads, " +
                  name(current_.survivor()) + " is the designated survivor; the request expects " +
                  term(expected.term()),
              "expected");
}

Result<void> RoleLogic::CheckMayDecide() const {
  const bool has_role = current_.leader() == options_.self || current_.survivor() == options_.self;
  if (!has_keys() || has_role || options_.may_command(options_.self)) return {};
  return Fail(ErrorCode::kRefused,
              options_.name_of(options_.self) + " may not change roles: send the command to the leader (" +
                  options_.name_of(current_.leader()) + "), to the survivor (" + options_.name_of(current_.survivor()) +
                  ") or to an agent that command_from of the team file names");
}

Result<void> RoleLogic::CheckIssued(const proto::RoleAssignment& roles) const {
  const proto::Term& term = roles.term();
  if (term.number() > 0 && !IsMember(term.issuer())) {
    return Fail(ErrorCode::kRefused, "is not in this team", "roles.term.issuer");
  }
  if (term.number() == 0 && (term.issuer() != 0 || term.issuer_epoch() != 0)) {
    return Fail(ErrorCode::kRefused, "number 0 is reserved for the initial roles in the team file", "roles.term");
  }
  const std::uint64_t number_max =
      has_keys() ? kTermNumberMax : std::min(highest_number_ + kTermJumpMax, kTermNumberMax);
  if (term.number() > number_max) {
    return Fail(ErrorCode::kRefused, "is too far above the highest known term number", "roles.term.number");
  }
  if (roles.reason().size() > kRoleReasonBytesMax) {
    return Fail(ErrorCode::kRefused, "is longer than " + std::to_string(kRoleReasonBytesMax) + " bytes",
                "roles.reason");
  }
  if (has_keys() && term.number() > 0 && !options_.is_signed(roles)) {
    return Fail(ErrorCode::kRefused, "does not match its issuer's signing key", "roles.signature");
  }
  return {};
}

Result<void> RoleLogic::CheckAnnounced(const proto::RoleAssignment& roles) const {
  if (Result<void> checked = CheckIssued(roles); !checked) return checked;
  // A team that starts with a survivor always has one. Only InForce() may return roles without a survivor, and agents
  // never announce the result of InForce().
  if (roles.survivor() == 0 && options_.initial.survivor() != 0) {
    return Fail(ErrorCode::kRefused, "is missing", "roles.survivor");
  }
  return options_.check(roles);
}

proto::RoleAssignment RoleLogic::Issue(proto::RoleAssignment roles, bool is_command) const {
  if (has_keys()) {
    const bool begins_era = is_command && options_.may_command(options_.self);
    const proto::RoleAssignment next = RoleChain::Next(current_, begins_era);
    *roles.mutable_term() = next.term();
    roles.set_follows(next.follows());
  } else {
    roles.mutable_term()->set_number(std::max(highest_number_, current_.term().number()) + 1);
  }
  roles.mutable_term()->set_issuer(options_.self);
  roles.mutable_term()->set_issuer_epoch(own_epoch_);
  if (has_keys()) roles.set_signature(options_.sign(roles));
  return roles;
}

Result<void> RoleLogic::CheckNew(const proto::RoleAssignment& roles) const {
  if (Result<void> checked = options_.check(roles); !checked) return checked;
  const auto left = [this](AgentId agent, const char* field) {
    return Fail(ErrorCode::kRefused, options_.name_of(agent) + " has left the team", field);
  };
  if (HasLeft(roles.leader())) return left(roles.leader(), "leader");
  if (HasLeft(roles.survivor())) return left(roles.survivor(), "survivor");
  return {};
}

bool RoleLogic::IsConfirmedByAll() const {
  return std::all_of(options_.agents.begin(), options_.agents.end(),
                     [this](AgentId agent) { return HasLeft(agent) || confirmed_.contains(agent); });
}

bool RoleLogic::IsMember(AgentId agent) const {
  return std::find(options_.agents.begin(), options_.agents.end(), agent) != options_.agents.end();
}

bool RoleLogic::IsFromBeforeRestart(const proto::RoleAssignment& roles) const {
  return roles.leader() == options_.self && roles.term().issuer_epoch() != own_epoch_;
}

void RoleLogic::Notify(AgentId to, bool is_reply, Actions& actions) const {
  Announcement announcement;
  announcement.to = to;
  *announcement.announce.mutable_roles() = current_;
  announcement.announce.set_is_reply(is_reply);
  actions.announcements.push_back(std::move(announcement));
}

void RoleLogic::NotifyUnconfirmed(Actions& actions) {
  for (const AgentId agent : options_.agents) {
    if (!HasLeft(agent) && !confirmed_.count(agent)) Notify(agent, /*is_reply=*/false, actions);
  }
  if (!IsConfirmedByAll()) actions.announce_timer = announce_delay_;
}

void RoleLogic::Confirm(AgentId agent, Actions& actions) {
  confirmed_.insert(agent);
  if (is_waiting_to_lead_ && IsConfirmedByAll() && !saving_) TakeNewTerm(/*is_start=*/true, actions);
}

void RoleLogic::TakeNewTerm(bool is_start, Actions& actions) {
  proto::RoleAssignment roles = current_;
  if (is_start) {
    roles.set_timestamp_ns(started_ns_);
    roles.set_reason(current_.term().number() == 0 ? "start of the leader" : "restart of the leader");
  }
  actions.save = Adopt(Issue(std::move(roles), /*is_command=*/false)).save;
}

}  // namespace moondb
