// ClientTable: names for the connections of clients, so that a reply finds its way back. Thread-safe.
//
// libzmq does not say when a client leaves, so only the connections heard from most recently are kept; of one owner
// (the client's key) so few that nobody's answers are lost by what another one opens.
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
  ClientTable(std::size_t clients_max, std::size_t clients_of_owner_max, std::string prefix = {})
      : clients_max_(clients_max), clients_of_owner_max_(clients_of_owner_max), prefix_(std::move(prefix)) {}

  // The name of the connection with this routing id, a new one ("1", "2", ...) if it is unknown.
  std::string NameOf(const std::string& routing_id, const std::string& owner);

  std::optional<std::string> RoutingIdOf(const std::string& name) const;

  // It is gone.
  void Forget(const std::string& routing_id);

 private:
  struct Client {
    std::string routing_id;
    std::string name;
    std::string owner;
  };
  using Clients = std::list<Client>;

  void MakeRoomFor(const std::string& owner);
  void Erase(Clients::iterator client);

  const std::size_t clients_max_;
  const std::size_t clients_of_owner_max_;
  const std::string prefix_;
  mutable std::mutex mutex_;
  std::uint64_t named_ = 0;
  Clients clients_;  // The last heard first.
  std::map<std::string, Clients::iterator> by_routing_id_;
  std::map<std::string, Clients::iterator> by_name_;
  std::map<std::string, std::size_t> counts_;  // By owner.
};

}  // namespace moondb
