// ClientTable: names for the connections of clients, so that a reply finds its way back. Thread-safe.
//
// libzmq does not say when a client leaves, so only the connections heard from most recently are kept.
#pragma once

#include <cstdint>
#include <list>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

namespace moondb {

class ClientTable {
 public:
  // `prefix` begins each name.
  explicit ClientTable(std::size_t clients_max, std::string prefix = {})
      : clients_max_(clients_max), prefix_(std::move(prefix)) {}

  // The name of the connection with this routing id, a new one ("1", "2", ...) if it is unknown.
  std::string NameOf(const std::string& routing_id);

  std::optional<std::string> RoutingIdOf(const std::string& name) const;

  // It is gone.
  void Forget(const std::string& routing_id);

 private:
  struct Client {
    std::string routing_id;
    std::string name;
  };
  using Clients = std::list<Client>;

  const std::size_t clients_max_;
  const std::string prefix_;
  mutable std::mutex mutex_;
  std::uint64_t named_ = 0;
  Clients clients_;  // The last heard first.
  std::map<std::string, Clients::iterator> by_routing_id_;
  std::map<std::string, Clients::iterator> by_name_;
};

}  // namespace moondb
