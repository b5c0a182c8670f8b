// OrderWatch: the orders to share that clients gave this agent, how far each is, and which requests wait for them.
//
// A request waits for the end of its order (ShareRequest.wait_s) or for news of it (ShareProgressRequest). The actor
// says how far an order is (RowsOf) and looks at the waiting requests: after a message, but at most once in
// kLookPeriod, and when deadline() has come. An order of a role ends with the term that it was given in.
//
// Bounded: so many orders, and so many requests; the oldest order that no request waits for is forgotten first. A plain
// state machine; time comes in with each input. Not thread-safe.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <list>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "model/error.h"
#include "model/ids.h"
#include "proto/sharing.pb.h"

namespace moondb {

class OrderWatch {
 public:
  using Duration = std::chrono::nanoseconds;
  using Time = std::chrono::time_point<std::chrono::steady_clock, Duration>;

  static constexpr Duration kLookPeriod = std::chrono::milliseconds(50);
  static constexpr Duration kNewsPeriod = std::chrono::milliseconds(500);  // Between two answers with news.
  static constexpr Duration kRelayedNewsPeriod = std::chrono::seconds(5);  // Between two that cross the radio.
  static constexpr Duration kCountdownPeriod = std::chrono::seconds(5);    // Reasons that only time changes.
  static constexpr std::size_t kOrdersMax = 32;
  static constexpr std::size_t kRequestsMax = 64;

  // One direction of the order: between this agent and a peer.
  struct Pair {
    AgentId peer = 0;
    bool is_incoming = false;  // From the peer to this agent.
    double coded_bytes_before = 0;
    std::uint64_t batches_before = 0;  // What had come in of an incoming pair.
    int refusals_before = 0;           // How often this agent had refused an incoming pair's batches.
  };

  struct Order {
    std::uint64_t number = 0;
    proto::Term term;         // In which it was given.
    bool is_by_role = false;  // Ends with the term.
    std::vector<Pair> pairs;
    bool is_gathering_meant = false;  // The order also waits for what the leader still has to gather.
    std::set<AgentId> gathering_of;   // Only from these agents; empty: from all.
    std::set<AgentId> gathers_from;   // Agents on the list to gather from at any look since the order was given.
  };

  // How far an order is. `is_open_ended`: more pairs may come.
  struct Rows {
    std::vector<proto::PairProgress> pairs;
    bool is_open_ended = false;
  };
  using RowsOf = std::function<Rows(Order&)>;

  struct Request {
    AgentId agent = 0;  // The address that asks, with `actor`.
    std::string actor;
    std::uint64_t request_id = 0;
    std::uint64_t order = 0;
    Time until{};
    bool is_for_end = false;  // Else for news after this version:
    std::uint64_t after_version = 0;
    Duration news_period{};  // At least, since the last news of this order.
  };

  struct Answer {
    Request request;
    proto::ShareProgress progress;  // With an error where the order ended with its term.
  };

  void Add(Order order);
  // kFull where too many requests wait. kNotFound for an order that is not known.
  Result<void> Wait(Request request);
  // Orders by role of another term than this end, with this error.
  void EndTerm(const proto::Term& term, const Error& error);
  bool is_waiting() const { return !requests_.empty(); }
  // Gives the answers that are due. None where the last look was a moment ago: then deadline() says when to look.
  std::vector<Answer> Look(Time now, const RowsOf& rows_of);
  // When the next look is due; none while no request waits.
  std::optional<Time> deadline() const;

 private:
  struct Watched {
    Order order;
    proto::ShareProgress progress;  // As of the last look.
    bool is_settled = false;        // Complete or failed: it changes no more.
    std::optional<Time> reported;   // The last answer with news.
  };

  Watched* Find(std::uint64_t number);
  bool IsWaitedFor(std::uint64_t number) const;
  static void Update(Watched& watched, const RowsOf& rows_of);

  std::list<Watched> orders_;  // Oldest first.
  std::vector<Request> requests_;
  Time last_look_{};
  bool is_look_due_ = false;
};

}  // namespace moondb
