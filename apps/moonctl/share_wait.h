// Waiting for sessions of sync and replication to be acknowledged to the last record.
//
// A session that was asked for opens a little later, maybe at another agent, so "nothing remains" alone would be true
// too early: a pair is done when its count of completed sessions has grown beyond what it was before the request.
#pragma once

#include <chrono>
#include <compare>
#include <map>
#include <optional>
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

class ShareWait {
 public:
  // Notes what each pair had completed so far; to be made before the request. Agents that do not answer are left out
  // and named by unreachable().
  ShareWait(CommandContext& context, std::vector<SharePair> pairs);

  // Shows progress on stderr until all pairs are done, in two looks one after the other: what one session brings may
  // open another one. kTimedOut with what was still missing; kUnavailable where a session ended before all was
  // acknowledged, but for one that ended with its order's bytes.
  Result<void> Wait(std::chrono::milliseconds timeout);

  bool is_any_limited() const;

  const std::vector<std::string>& unreachable() const { return unreachable_; }

 private:
  struct Progressing {
    double completed_before = 0;
    double closed_before = 0;
    double limited_before = 0;
    double remaining = 0;
    double coded_before = 0;
    double coded_bytes = 0;       // Sent since.
    std::optional<double> eta_s;  // At its pace so far.
    bool is_done = false;
    bool is_limited = false;  // Done, as its order's bytes were used up.
    bool is_closed = false;   // Without being done.
    std::string last_error;
  };

  // Asks one sender for its sessions and updates its pairs; a sender that went away keeps what was known.
  // False: it did not answer.
  bool Poll(AgentId sender, bool is_baseline);
  std::string Missing() const;
  // "408 records left, 12.3 kB sent, about 4 s to go, 0 of 6 sessions complete".
  std::string ProgressText(double remaining, std::size_t done) const;

  CommandContext& context_;
  std::map<AgentId, std::unique_ptr<Client>> clients_;
  std::map<SharePair, Progressing> pairs_;
  std::vector<std::string> unreachable_;
};

}  // namespace moondb
