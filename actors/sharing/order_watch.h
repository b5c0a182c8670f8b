// OrderWatch: tracks the progress of the sharing orders that clients gave this agent, and answers the requests that
// wait for an order.
//
// A request waits for the end of its order (ShareRequest.wait_s) or for the next change of its progress
// (ShareProgressRequest). The actor supplies the progress of an order (RowsOf). The actor calls CollectAnswers after
// each message and when deadline() is reached. CollectAnswers updates the progress at most once per kLookPeriod.
//
// Holds at most kRequestsMax requests. If there are kOrdersMax orders, forgets the oldest order for which no request
// waits. A state machine: the caller passes the time with each input. Not thread-safe.
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
  // Shortest time between two answers about changed progress of one order. kRelayedNewsPeriod is for clients whose
  // requests another agent relayed over the radio.
  static constexpr Duration kNewsPeriod = std::chrono::milliseconds(500);
  static constexpr Duration kRelayedNewsPeriod = std::chrono::seconds(5);
  // While a request waits, progress is updated at least once per period, since a countdown such as "drives for 40 s
  // more" changes even if no message arrives.
  static constexpr Duration kCountdownPeriod = std::chrono::seconds(5);
  static constexpr std::size_t kOrdersMax = 32;
  static constexpr std::size_t kRequestsMax = 64;

  // One direction of an order: records from this agent to a peer, or from the peer to this agent.
  struct Pair {
    AgentId peer = 0;
    bool is_incoming = false;  // Records travel from the peer to this agent.
    // Values of the pair's counters when the order began. Progress counts only the increase since then.
    double coded_bytes_before = 0;
    std::uint64_t batches_before = 0;  // Batches received from the peer; used for an incoming pair.
    int refusals_before = 0;           // Batches of the peer that were refused; used for an incoming pair.
  };

  struct Order {
    std::uint64_t number = 0;
    proto::Term term;         // The term in which the order was given.
    bool is_by_role = false;  // The order ends with the term in which it was given.
    std::vector<Pair> pairs;
    bool is_gathering_meant = false;  // The order also waits until the leader has gathered records from other agents.
    // If is_gathering_meant, agents from which records are gathered for the order; empty: all agents.
    std::set<AgentId> gathering_of;
    // Agents from which the leader had to gather records at any time since the order began, including agents from which
    // the leader has gathered all records since then.
    std::set<AgentId> gathers_from;
  };

  // The progress of an order, by pair. `is_open_ended`: further pairs may be added, so the order is not complete yet.
  struct Rows {
    std::vector<proto::PairProgress> pairs;
    bool is_open_ended = false;
  };
  using RowsOf = std::function<Rows(Order&)>;

  struct Request {
    AgentId agent = 0;  // With `actor`: the requester's address.
    std::string actor;
    std::uint64_t request_id = 0;
    std::uint64_t order = 0;
    Time until{};
    bool is_for_end = false;          // Waits for the end of the order; false: waits for a change of its progress.
    std::uint64_t after_version = 0;  // Used if is_for_end is false: waits until ShareProgress.version exceeds this.
    Duration news_period{};  // Shortest time from the last answer about changed progress of this order to the next.
  };

  struct Answer {
    Request request;
    proto::ShareProgress progress;  // Contains an error if EndTerm ended the order.
  };

  void Add(Order order);
  // Adds a waiting request. Fails with kFull if too many requests wait, and with kNotFound if the order is unknown.
  Result<void> Wait(Request request);
  // Ends all orders with is_by_role that were given in another term than `term`. Requests for these orders are answered
  // with `error`.
  void EndTerm(const proto::Term& term, const Error& error);
  bool is_waiting() const { return !requests_.empty(); }
  // Updates the progress of the orders and returns the answers that are due. Returns none if the last update was less
  // than kLookPeriod ago; deadline() then returns when to call again.
  std::vector<Answer> CollectAnswers(Time now, const RowsOf& rows_of);
  // When to call CollectAnswers next; nullopt while no request waits.
  std::optional<Time> deadline() const;

 private:
  struct Watched {
    Order order;
    proto::ShareProgress progress;  // Progress at its last update by CollectAnswers.
    bool is_settled = false;        // The order is complete or has failed, so its progress is final.
    std::optional<Time> reported;   // Time of the last answer about changed progress.
  };

  Watched* Find(std::uint64_t number);
  bool IsWaitedFor(std::uint64_t number) const;
  static void Update(Watched& watched, const RowsOf& rows_of);

  std::list<Watched> orders_;  // All tracked orders, oldest first.
  std::vector<Request> requests_;
  Time last_look_{};
  bool is_look_due_ = false;
};

}  // namespace moondb
