// RoleLogic: who leads and who survives, decided by terms (paper, Section 4: leader and designated survivor).
//
// At most one assignment belongs to a term; terms are ordered by number, issuer and the issuer's epoch, and the newest
// one that an agent knows stands. An assignment is stored durably before it is acted on or announced to anyone. It is
// announced to every other agent, again and again with a growing delay, until each is known to hold it; whoever holds
// an older one learns the newer by the answer to its own. So agents that can talk agree, and two leaders can only stand
// in two parts of a team that cannot.
//
// In a team with keys an assignment is signed by its issuer and stands only where it counts (model/role_chain.h): one
// who never led nor survived, and through whom nobody may command the team, moves nobody. Who hears of one whose
// forerunner it lacks asks the announcer for the chain that it ends, page by page, and stores the chain with it; until
// then its own stands. Who may not decide roles is refused as it asks for others.
//
// An agent that its stored roles name leader waits after its start: it announces what it has, and unless it hears of
// a newer term within `leader_wait` (or everyone agrees before) it takes a new term with the same roles before it
// acts, so that nothing of an earlier life of it shares a term with this one. So does one that lost its disk and hears
// from the others that it leads. Term 0 is the team file's.
//
// Durable before it is acted on holds for taking a role, not for giving one up: where an assignment that another agent
// decided cannot be stored, this agent acts on it without the roles that it would have there itself, neither leads nor
// survives, confirms nothing, and stores it as soon as the disk takes it. After a restart before that it begins with
// the assignment that its disk has, as ever. A new term of its own that cannot be stored is nobody's: it does not lead.
//
// A plain state machine: inputs return what is to be done. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "actors/role/change_budget.h"
#include "model/error.h"
#include "model/ids.h"
#include "model/role_chain.h"
#include "proto/role.pb.h"

namespace moondb {

class RoleLogic {
 public:
  using Duration = std::chrono::nanoseconds;
  using Time = std::chrono::time_point<std::chrono::steady_clock, Duration>;

  struct Options {
    AgentId self = 0;
    std::vector<AgentId> agents;  // Of the team, this one too.
    std::set<AgentId> left;  // Of these, who has left: what they decided stays history, and no new roles name them.
    proto::RoleAssignment initial;                                    // Of the team file, term 0.
    std::function<Result<void>(const proto::RoleAssignment&)> check;  // Whether the team can have these roles.
    // In a team with keys: this agent's signature, and whether an assignment has its issuer's. Null in one without.
    std::function<std::string(const proto::RoleAssignment&)> sign;
    std::function<bool(const proto::RoleAssignment&)> is_signed;
    std::function<bool(AgentId)> may_command = [](AgentId) { return true; };  // As command_from has it.
    // How errors name an agent; "nobody" for 0.
    std::function<std::string(AgentId)> name_of = [](AgentId agent) { return "agent " + std::to_string(agent); };
    Duration leader_wait = std::chrono::seconds(2);
    Duration announce_after = std::chrono::seconds(5);       // To agents that have not confirmed; doubles
    Duration announce_after_max = std::chrono::seconds(60);  // up to this.
    Duration store_after = std::chrono::seconds(5);  // An assignment of others that could not be stored, once more.
  };

  static constexpr std::size_t kHistoryMax = 1000;
  // In a team without keys a term number that far ahead of the present one is a mistake or an attack, not a change.
  static constexpr std::uint64_t kTermJumpMax = 1'000'000;
  // A page of a chain. As a control message it delays others by 128 ms at 1 Mbit/s.
  static constexpr std::size_t kChainPageBytesMax = 16 * 1024;
  // What is asked for of one chain; a longer one is not followed, and one word of command_from ends it.
  static constexpr std::size_t kChainLengthMax = kAssignmentsOfIssuerMax;

  struct Announcement {
    AgentId to = 0;
    proto::RoleAnnounce announce;
  };

  // What another agent's RoleActor is asked for.
  struct ChainQuestion {
    AgentId to = 0;
    proto::RoleChainRequest request;
  };

  // What is to be done, in this order.
  struct Actions {
    std::optional<proto::RoleAssignment> save;  // To storage; then OnSaved.
    std::optional<ChainQuestion> question;
    std::optional<proto::RoleAssignment> apply;  // Act on it: it is durable, or without roles of this agent's own.
    std::vector<Announcement> announcements;
    std::optional<Duration> announce_timer;  // Then OnAnnounceTimer; replaces an earlier one.
    std::optional<Duration> leader_timer;    // Then OnLeaderTimer.
    std::optional<Duration> store_timer;     // Then OnStoreTimer.
  };

  explicit RoleLogic(Options options);

  // What storage has, oldest first; in a team without keys the last one stands, in one with keys the newest that
  // counts, also of those that are `known` from records alone. `own_epoch` is random and not 0. A stored assignment
  // that the team file no longer allows gives way to the file's; its number stays taken.
  Actions OnLoaded(std::vector<proto::RoleAssignment> history, std::uint64_t own_epoch, std::int64_t now_ns,
                   const std::vector<proto::RoleAssignment>& known = {});
  bool is_loaded() const { return is_loaded_; }
  // The monotonic time of what comes next.
  void SetNow(Time now) { now_ = now; }

  // The assignment that `request` means, not stored yet. kUnavailable before OnLoaded and while another one is being
  // stored, kInvalid for a contradictory request, kRefused for roles that cannot be, with the field named, for a
  // request that relies on another term, leader or survivor than the present ones (`expected`), and while a newer
  // assignment is known that cannot be stored here.
  Result<proto::RoleAssignment> Propose(const proto::RoleSetRequest& request, std::int64_t now_ns) const;
  // The assignment by which this agent gives up its role to those that are `connected`: a leader to the designated
  // survivor, else to another that may lead; it becomes the survivor itself only where nobody else can. kNotFound if
  // it has no role, kUnavailable as above and while nobody fit is connected.
  Result<proto::RoleAssignment> ProposeStepDown(const std::set<AgentId>& connected, const std::string& reason,
                                                std::int64_t now_ns) const;
  // Begins to store what one of these returned.
  Actions Adopt(proto::RoleAssignment roles);

  // From another agent, or forwarded for it. kRefused, with nothing done, where it does not pass the door.
  Result<Actions> OnAnnounce(AgentId from, const proto::RoleAnnounce& announce);
  // From another agent that lacks what an assignment follows, and its answer to this agent's question. kRefused as
  // above: a page that is not what was asked for ends the question.
  proto::RoleChainReply OnChainRequest(const proto::RoleChainRequest& request) const;
  Result<Actions> OnChainReply(AgentId from, const proto::RoleChainReply& reply);
  // That is stored as a record: it is history, unless it makes one count that is newer than what stands.
  Actions OnRecord(const proto::RoleAssignment& roles);

  // Storage's answer for the assignment being stored.
  Actions OnSaved();
  Actions OnSaveFailed();
  // Storage has not answered the request to save for a while: it is asked again, and may still say either.
  Actions OnSaveLate();
  Actions OnStoreTimer();
  // Null while none is.
  const proto::RoleAssignment* saving() const { return saving_ ? &saving_->roles : nullptr; }
  // What that one follows and is to be stored with it, oldest first.
  std::vector<proto::RoleAssignment> SavingChain() const;

  Actions OnAnnounceTimer();
  Actions OnLeaderTimer(std::int64_t now_ns);
  Actions OnPeerConnected(AgentId peer);

  const proto::RoleAssignment& current() const { return current_; }  // Durable.
  proto::RoleShowReply Show(bool with_history) const;

 private:
  std::optional<proto::RoleAssignment> WithoutOwnRole(const std::set<AgentId>& connected) const;
  Result<void> CheckExpected(const proto::RoleSetRequest& request) const;
  // Whoever decided it, and whatever the team file says now.
  Result<void> CheckIssued(const proto::RoleAssignment& roles) const;
  Result<void> CheckAnnounced(const proto::RoleAssignment& roles) const;
  Result<void> CheckMayDecide() const;
  std::string WhyNever(const proto::RoleAssignment& roles) const;
  bool has_keys() const { return options_.sign != nullptr; }
  // What the roles are issued as by this agent now: with term, what they follow and signature. `is_command`: by an
  // operator's word, where one may be given through this agent.
  proto::RoleAssignment Issue(proto::RoleAssignment roles, bool is_command) const;
  // What was announced and counts.
  void AdoptAnnounced(AgentId from, const proto::RoleAssignment& theirs, Actions& actions);
  // The newest of those that count, if it is newer than what stands and its issuer has made few enough changes; else
  // the announce timer looks again.
  void AdoptNewestKnown(Actions& actions);
  // Takes one change of this issuer from its budget, if it has one left.
  bool TakeChange(AgentId issuer);
  void NoteStored(const proto::RoleAssignment& roles);
  void AskForChain(AgentId from, const proto::RoleAssignment& theirs, Actions& actions);
  // Whether the team can have these roles from now on.
  Result<void> CheckNew(const proto::RoleAssignment& roles) const;
  bool IsMember(AgentId agent) const;  // Of the team file, though it may have left.
  bool HasLeft(AgentId agent) const { return options_.left.contains(agent); }
  // Names this agent leader in a term in which it may have led before it started: any that it did not issue since. It
  // need not remember, if its disk was lost or is an old copy.
  bool IsFromBeforeRestart(const proto::RoleAssignment& roles) const;
  bool IsConfirmedByAll() const;                             // Who has left aside.
  bool IsOwnTerm(const proto::RoleAssignment& roles) const;  // This agent issued it, in its present life.
  // What this agent acts on.
  proto::RoleAssignment InForce() const;
  void ActWithoutOwnRole(const proto::RoleAssignment& unstored, Actions& actions);
  void Notify(AgentId to, bool is_reply, Actions& actions) const;
  void NotifyUnconfirmed(Actions& actions);
  void Confirm(AgentId agent, Actions& actions);
  // Of the present assignment; `is_start`: for this agent's start, else for what another agent decided.
  void TakeNewTerm(bool is_start, Actions& actions);

  // A chain that is being asked for: what was announced, and its forerunners that came so far, newest first.
  struct ChainAsked {
    AgentId from = 0;
    proto::RoleAssignment announced;
    std::vector<proto::RoleAssignment> chain;
  };

  struct Saving {
    proto::RoleAssignment roles;
    std::set<AgentId> holders;  // Known to hold it.
    AgentId answer_to = 0;      // Waits for our word that it is held here too.
  };

  Options options_;
  Time now_{};
  ChangeBudget changes_;        // In a team with keys.
  bool awaits_budget_ = false;  // The announce timer was started to look at an assignment whose issuer has no budget.
  RoleChain chain_;
  std::set<std::string> stored_;  // Signatures of those that count and that storage has.
  std::optional<ChainAsked> chain_asked_;
  bool is_loaded_ = false;
  bool is_waiting_to_lead_ = false;
  std::uint64_t own_epoch_ = 0;
  std::uint64_t highest_number_ = 0;  // Ever seen: a new term goes above it.
  std::int64_t started_ns_ = 0;
  proto::RoleAssignment current_;
  std::vector<proto::RoleAssignment> history_;
  std::set<AgentId> confirmed_;  // Known to hold current_.
  std::optional<Saving> saving_;
  std::optional<proto::RoleAssignment> unstored_;      // What others decided: newer than current_, not durable here.
  std::optional<proto::RoleAssignment> own_unstored_;  // The last one by which this agent wanted to lead.
  Duration announce_delay_{};
};

}  // namespace moondb
