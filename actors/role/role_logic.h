// RoleLogic: the agreement of a team on its leader and designated survivor (paper, Section 4), as a state machine.
//
// Each term has at most one assignment. Terms are ordered by number, issuer and the issuer's epoch. An agent stores the
// newest assignment that it knows before it acts on the assignment. It then announces the assignment to the other
// agents, repeatedly, until all agents are known to hold it. An agent that announces an older assignment receives the
// newer one in reply. Agents that can communicate therefore agree, and two leaders can only exist in two partitions of
// a team.
//
// In a team with keys, the issuer signs its assignments, and agents adopt only valid assignments (model/role_chain.h).
// An agent that lacks the predecessor of an announced assignment requests the chain of predecessors from the announcer,
// page by page. Until the chain is complete, the agent keeps its current assignment.
//
// After a start, the leader first waits for `leader_wait`, or until all agents agree. Unless the leader learns of a
// newer term, it then issues the same roles in a new term, so data from before and after a restart never have the same
// term. The team file's roles have term 0.
//
// If an assignment of another agent cannot be stored, this agent acts on the assignment, but without any role of its
// own, until the disk accepts writes. If this agent cannot store a new term that it issued itself, it does not lead.
//
// Each input returns the actions to take. Not thread-safe.
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
    std::vector<AgentId> agents;  // All agents of the team, including this one.
    // Agents that have left the team. Their earlier decisions stay valid, but new roles must not name these agents.
    std::set<AgentId> left;
    proto::RoleAssignment initial;                                    // The team file's roles, in term 0.
    std::function<Result<void>(const proto::RoleAssignment&)> check;  // Fails if the team file forbids these roles.
    // `sign` returns this agent's signature of an assignment. `is_signed` returns whether an assignment has a valid
    // signature of its issuer. Both are null in a team without keys.
    std::function<std::string(const proto::RoleAssignment&)> sign;
    std::function<bool(const proto::RoleAssignment&)> is_signed;
    std::function<bool(AgentId)> may_command = [](AgentId) { return true; };  // True if command_from names the agent.
    // Returns the name of an agent for error texts; "nobody" for 0.
    std::function<std::string(AgentId)> name_of = [](AgentId agent) { return "agent " + std::to_string(agent); };
    Duration leader_wait = std::chrono::seconds(2);
    Duration announce_after = std::chrono::seconds(5);       // First delay between repeated announcements; doubles.
    Duration announce_after_max = std::chrono::seconds(60);  // Longest delay between repeated announcements.
    Duration store_after = std::chrono::seconds(5);          // Delay before storing is tried again.
  };

  static constexpr std::size_t kHistoryMax = 1000;
  // In a team without keys, a term number that exceeds the highest known number by more than this is a mistake or an
  // attack, and is rejected.
  static constexpr std::uint64_t kTermJumpMax = 1'000'000;
  // Size limit of one page of a chain. A page is a control message, and delays other control messages by 128 ms at 1
  // Mbit/s.
  static constexpr std::size_t kChainPageBytesMax = 16 * 1024;
  // Longest chain that is requested; an assignment with a longer chain is refused. An operator can then assign the
  // roles again at an agent in command_from, because such an assignment needs no chain.
  static constexpr std::size_t kChainLengthMax = kAssignmentsOfIssuerMax;

  struct Announcement {
    AgentId to = 0;
    proto::RoleAnnounce announce;
  };

  // A request to another agent's RoleActor for a chain.
  struct ChainQuestion {
    AgentId to = 0;
    proto::RoleChainRequest request;
  };

  // The actions that the caller must take, in the order of the members.
  struct Actions {
    std::optional<proto::RoleAssignment> save;  // Assignment to store; then call OnSaved or OnSaveFailed.
    std::optional<ChainQuestion> question;
    std::optional<proto::RoleAssignment> apply;  // Roles to act on. If storing them failed, this agent has no role.
    std::vector<Announcement> announcements;
    std::optional<Duration> announce_timer;  // Delay until OnAnnounceTimer; replaces a running timer.
    std::optional<Duration> leader_timer;    // Delay until OnLeaderTimer.
    std::optional<Duration> store_timer;     // Delay until OnStoreTimer.
  };

  explicit RoleLogic(Options options);

  // Starts with the stored assignments. `history`: assignments that this agent acted on, oldest first. `known`:
  // assignments known only from records. In a team without keys, the last assignment in `history` becomes current; in a
  // team with keys, the newest valid assignment in both lists. If the team file no longer allows that assignment, the
  // file's roles become current, but the assignment's term number is not used again. Requires: `own_epoch` is random
  // and not 0.
  Actions OnLoaded(std::vector<proto::RoleAssignment> history, std::uint64_t own_epoch, std::int64_t now_ns,
                   const std::vector<proto::RoleAssignment>& known = {});
  bool is_loaded() const { return is_loaded_; }
  // Sets the monotonic time of the following calls.
  void SetNow(Time now) { now_ = now; }

  // Returns the assignment that fulfils `request`; the caller passes it to Adopt, which stores it. Fails with
  // kUnavailable before OnLoaded and while another assignment is being stored. Fails with kInvalid for a contradictory
  // request. Fails with kRefused for impossible roles, if `expected` differs from the current assignment, if this agent
  // may not decide roles, and while this agent cannot store a newer assignment.
  Result<proto::RoleAssignment> Propose(const proto::RoleSetRequest& request, std::int64_t now_ns) const;
  // Returns the assignment by which this agent hands its role to one of the `connected` agents. A leader hands over to
  // the designated survivor if possible, otherwise to another agent that may lead. This agent becomes the survivor only
  // if no other agent can. Fails with kNotFound if this agent has no role. Fails with kUnavailable in the same cases as
  // Propose, and while no suitable agent is connected.
  Result<proto::RoleAssignment> ProposeStepDown(const std::set<AgentId>& connected, const std::string& reason,
                                                std::int64_t now_ns) const;
  // Starts to store an assignment returned by Propose or ProposeStepDown.
  Actions Adopt(proto::RoleAssignment roles);

  // Handles an announcement from another agent. Fails with kRefused, without any effect, if the assignment is not
  // acceptable.
  Result<Actions> OnAnnounce(AgentId from, const proto::RoleAnnounce& announce);
  // OnChainRequest returns one page of the chain that another agent requests. OnChainReply handles a page of the chain
  // that this agent requested. If the page is not the requested one, or an assignment in the chain is not acceptable,
  // OnChainReply fails with kRefused and the request ends.
  proto::RoleChainReply OnChainRequest(const proto::RoleChainRequest& request) const;
  Result<Actions> OnChainReply(AgentId from, const proto::RoleChainReply& reply);
  // Adds an assignment that is stored as a record. If the newest valid assignment is then newer than the current one,
  // starts to adopt the newest one.
  Actions OnRecord(const proto::RoleAssignment& roles);

  // Call OnSaved or OnSaveFailed when storage has answered the request to store saving().
  Actions OnSaved();
  Actions OnSaveFailed();
  // Call if storage has not answered in time. Unless this agent issued saving() since its start, the agent then acts on
  // saving() without its own role. The caller repeats the request, and storage may still report success or failure.
  Actions OnSaveLate();
  Actions OnStoreTimer();
  // Returns the assignment being stored; null if there is none.
  const proto::RoleAssignment* saving() const { return saving_ ? &saving_->roles : nullptr; }
  // Returns the predecessors of saving() that the caller must store with saving(), oldest first.
  std::vector<proto::RoleAssignment> SavingChain() const;

  Actions OnAnnounceTimer();
  Actions OnLeaderTimer(std::int64_t now_ns);
  Actions OnPeerConnected(AgentId peer);

  const proto::RoleAssignment& current() const { return current_; }  // The newest durable assignment.
  proto::RoleShowReply Show(bool with_history) const;

 private:
  std::optional<proto::RoleAssignment> WithoutOwnRole(const std::set<AgentId>& connected) const;
  Result<void> CheckExpected(const proto::RoleSetRequest& request) const;
  // Checks the issuer, the term number, the length of the reason and the signature.
  Result<void> CheckIssued(const proto::RoleAssignment& roles) const;
  Result<void> CheckAnnounced(const proto::RoleAssignment& roles) const;
  Result<void> CheckMayDecide() const;
  std::string WhyNever(const proto::RoleAssignment& roles) const;
  bool has_keys() const { return options_.sign != nullptr; }
  // Returns `roles` with the term, predecessor and signature of this agent's next assignment. `is_command`: an operator
  // decided the roles. If this agent is in command_from, the assignment then begins a new era (RoleChain).
  proto::RoleAssignment Issue(proto::RoleAssignment roles, bool is_command) const;
  // Starts to store an announced assignment that is valid, if the issuer's budget allows it.
  void AdoptAnnounced(AgentId from, const proto::RoleAssignment& theirs, Actions& actions);
  // Adopts the newest valid assignment if it is newer than the current one. If the issuer's budget is used up,
  // OnAnnounceTimer retries.
  void AdoptNewestKnown(Actions& actions);
  // Takes one change from the issuer's budget. Returns false if the budget is used up.
  bool TakeChange(AgentId issuer);
  void ObserveStored(const proto::RoleAssignment& roles);
  void RequestChain(AgentId from, const proto::RoleAssignment& theirs, Actions& actions);
  // Fails if options_.check refuses the roles, or if the new leader or survivor has left the team.
  Result<void> CheckNew(const proto::RoleAssignment& roles) const;
  bool IsMember(AgentId agent) const;  // Returns whether the team file names the agent, even if it has left.
  bool HasLeft(AgentId agent) const { return options_.left.contains(agent); }
  // Returns whether `roles` name this agent leader in a term that this agent has not issued since its start. The agent
  // may have led in that term before its restart, even if its disk does not show this.
  bool IsFromBeforeRestart(const proto::RoleAssignment& roles) const;
  bool IsConfirmedByAll() const;                             // Ignores agents that have left.
  bool IsOwnTerm(const proto::RoleAssignment& roles) const;  // True if this agent issued the term since its start.
  // Returns the roles that this agent acts on: the newest known roles. If these roles could not be stored, this agent's
  // own role in them is cleared.
  proto::RoleAssignment InForce() const;
  void ActWithoutOwnRole(const proto::RoleAssignment& unstored, Actions& actions);
  void Notify(AgentId to, bool is_reply, Actions& actions) const;
  void NotifyUnconfirmed(Actions& actions);
  void Confirm(AgentId agent, Actions& actions);
  // Issues the current roles in a new term. `is_start`: true if the reason is a start of this agent, false if another
  // agent made this agent leader.
  void TakeNewTerm(bool is_start, Actions& actions);

  // A request for a chain: the announced assignment, and its predecessors received so far, newest first.
  struct ChainAsked {
    AgentId from = 0;
    proto::RoleAssignment announced;
    std::vector<proto::RoleAssignment> chain;
  };

  struct Saving {
    proto::RoleAssignment roles;
    std::set<AgentId> holders;  // Agents known to hold `roles`.
    AgentId answer_to = 0;      // Agent to notify once `roles` is stored; 0: none.
  };

  Options options_;
  Time now_{};
  ChangeBudget changes_;        // Used only in a team with keys.
  bool awaits_budget_ = false;  // True if OnAnnounceTimer must retry an assignment whose issuer had no budget left.
  RoleChain chain_;
  std::set<std::string> stored_;  // Signatures of the stored assignments that are or may become valid.
  std::optional<ChainAsked> chain_asked_;
  bool is_loaded_ = false;
  bool is_waiting_to_lead_ = false;
  std::uint64_t own_epoch_ = 0;
  std::uint64_t highest_number_ = 0;  // Highest term number ever seen.
  std::int64_t started_ns_ = 0;
  proto::RoleAssignment current_;
  std::vector<proto::RoleAssignment> history_;
  std::set<AgentId> confirmed_;  // Agents known to hold current_.
  std::optional<Saving> saving_;
  std::optional<proto::RoleAssignment> unstored_;      // Newer assignment of another issuer that could not be stored.
  std::optional<proto::RoleAssignment> own_unstored_;  // This agent's own new term that could not be stored.
  Duration announce_delay_{};
};

}  // namespace moondb
