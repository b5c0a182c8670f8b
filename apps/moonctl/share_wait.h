// Waiting for what an order of sync or replication brings, until all of it is acknowledged.
//
// Sessions open a little later than the order is given, maybe at another agent, and sessions of earlier orders may end
// in between. So a pair of agents is done when its session has completed this very order (SessionOrder), and is not
// open. A leader in a new term also gathers from each agent what it holds (ReplicaActor): that has to end too, as far
// as the agents can be asked now; what it brought is shared by an order that is given after it.
//
// All of it counts in the term that the order was given in. Where any of the agents acts on a newer one the wait ends.
#pragma once

#include <chrono>
#include <compare>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "apps/moonctl/command_context.h"

namespace moondb {

// One direction between two agents.
struct SharePair {
  AgentId sender = 0;
  AgentId destination = 0;
  proto::SharingKind kind = proto::SHARING_KIND_SYNC;
  auto operator<=>(const SharePair&) const = default;
};

// Until when a command waits: --timeout from its beginning; else 10 min, and 2 min beyond each lease that it waits for.
class WaitLimit {
 public:
  explicit WaitLimit(const CommandContext& context);
  // Somebody says that it drives, sleeps or is paused for so long.
  void OnLease(double seconds);
  bool is_over() const { return std::chrono::steady_clock::now() >= end_; }

 private:
  bool is_explicit_;
  std::chrono::steady_clock::time_point end_;
};

class ShareWait {
 public:
  struct Options {
    std::vector<SharePair> pairs;
    AgentId target = 0;           // The agent that takes the order.
    proto::RoleAssignment roles;  // On which it acts.
    // Of the agents from which the target gathers, those whose records are waited for; nothing: for none of them.
    std::function<bool(AgentId)> is_gathering_meant;
  };

  // The order's number, or why it was not taken.
  using GiveOrder = std::function<Result<std::uint64_t>()>;

  struct NotGathered {
    std::string agent;
    std::string why;
  };

  // Notes what stood before the order; to be made before it. Agents that do not answer are left out and named by
  // unreachable().
  ShareWait(CommandContext& context, Options options);

  // Gives the order, and shows progress on stderr until all is done, in two looks one after the other: what one session
  // brings may open another one. Given again where what was gathered came after it. False: other roles stand now, see
  // newer_roles(). kTimedOut with what was still missing; kUnavailable where a session ended before all was
  // acknowledged although the roles stand, but for one that ended with its order's bytes; an error of `give_order`.
  Result<bool> Wait(const GiveOrder& give_order, WaitLimit& limit);

  bool is_any_limited() const;
  const std::vector<std::string>& unreachable() const { return unreachable_; }
  // What the leader has yet to gather from agents that cannot be asked now.
  const std::vector<NotGathered>& not_gathered() const { return not_gathered_; }
  const std::optional<proto::RoleAssignment>& newer_roles() const { return newer_roles_; }

 private:
  struct Progressing {
    double remaining = 0;
    double coded_before = 0;
    double coded_bytes = 0;       // Sent since.
    std::optional<double> eta_s;  // At its pace so far.
    bool is_done = false;
    bool is_limited = false;  // Done, as its order's bytes were used up.
    bool is_closed = false;   // Without being done.
    std::string waits_for;
    std::string last_error;
  };

  // Asks one agent for its sessions and updates its pairs; one that went away keeps what was known. False: it did not
  // answer.
  bool Poll(AgentId agent, bool is_baseline, WaitLimit* limit);
  void PollTarget(const proto::ShareStatus& status);
  void Look(WaitLimit& limit);
  // Whether an agent without a connection to the leader is likely to be back in a moment.
  bool IsJustAway(AgentId agent);
  std::size_t CountDone() const;
  std::string Missing() const;
  std::string WaitsFor() const;  // "rover2 drives for 40 s more"; empty: for nothing but time.
  // "408 records left, 12.3 kB sent, about 4 s to go, 0 of 6 sessions complete".
  std::string ProgressText(double remaining) const;
  const proto::TeamConfig& team() const { return (*context_.Team())->config; }

  CommandContext& context_;
  const Options options_;
  std::map<AgentId, std::unique_ptr<Client>> clients_;
  std::map<SharePair, Progressing> pairs_;
  std::vector<std::string> unreachable_;
  std::uint64_t order_ = 0;
  std::optional<proto::RoleAssignment> newer_roles_;
  bool is_target_in_term_ = false;              // As it said in this look.
  std::optional<std::set<AgentId>> to_gather_;  // As the target said last, in the order's term.
  bool is_order_stale_ = false;                 // Something was gathered after it was given.
  std::size_t left_to_gather_ = 0;              // Agents that can be asked.
  std::string gathers_from_;  // The agent whose turn it is, of those that can be asked; empty: none is left.
  std::vector<NotGathered> not_gathered_;
  std::map<AgentId, std::chrono::steady_clock::time_point> away_since_;
  std::map<AgentId, bool> answers_;  // The answers of agents that are away from the leader.
};

}  // namespace moondb
