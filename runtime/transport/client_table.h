// ClientTable: gives each client connection a name, and maps the name to the routing id for replies. Thread-safe.
//
// libzmq does not report when a client leaves, so the table keeps only the connections that were heard most recently.
// An owner is a client's key. The number of connections per owner is limited, so that one owner cannot displace all
// others.
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
  // `prefix` is prepended to each name.
  ClientTable(std::size_t clients_max, std::size_t clients_of_owner_max, std::string prefix = {})
      : clients_max_(clients_max), clients_of_owner_max_(clients_of_owner_max), prefix_(std::move(prefix)) {}

  // Returns the name of the connection with this routing id. An unknown connection gets a new name ("1", "2", ...).
  std::string NameOf(const std::string& routing_id, const std::string& owner);

  std::optional<std::string> RoutingIdOf(const std::string& name) const;

  // Returns the owner of the connection with this name, or "" if the name is unknown.
  std::string OwnerOf(const std::string& name) const;

  // Removes the connection with this routing id, if there is one.
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
  Clients clients_;  // Clients, most recently heard first.
  std::map<std::string, Clients::iterator> by_routing_id_;
  std::map<std::string, Clients::iterator> by_name_;
  std::map<std::string, std::size_t> counts_;  // Number of clients by owner.
};

}  // namespace moondb
