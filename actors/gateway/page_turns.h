// PageTurns: lets each client have one page request at a time in an actor's mailbox. Its further requests wait in
// order.
//
// A page is an answer of up to several megabytes. Without turns, one client could fill the mailboxes of StorageActor
// and GatewayActor with pages, and delay all other clients.
//
// Not thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>

namespace moondb {

class PageTurns {
 public:
  // Adds the request `id` at the end of `queue`, the name of a client and an actor. Returns true if its turn begins
  // now. Requires: the queue does not contain the request.
  bool Add(const std::string& queue, std::uint64_t id);
  // Removes the request. Returns the request whose turn begins, or nothing if no turn ended or no request waits.
  std::optional<std::uint64_t> Remove(const std::string& queue, std::uint64_t id);

  std::size_t queues() const { return queues_.size(); }

 private:
  std::map<std::string, std::deque<std::uint64_t>> queues_;  // Never empty queues. The front of each has its turn.
};

}  // namespace moondb
