#include "runtime/transport/client_table.h"

#include <algorithm>
#include <iterator>

namespace moondb {

std::string ClientTable::NameOf(const std::string& routing_id, const std::string& owner) {
  const std::lock_guard lock(mutex_);
  if (const auto known = by_routing_id_.find(routing_id); known != by_routing_id_.end()) {
    clients_.splice(clients_.begin(), clients_, known->second);
    return clients_.front().name;
  }
  MakeRoomFor(owner);
  clients_.push_front({routing_id, prefix_ + std::to_string(++named_), owner});
  ++counts_[owner];
  by_routing_id_[routing_id] = clients_.begin();
  by_name_[clients_.front().name] = clients_.begin();
  return clients_.front().name;
}

// If `owner` is at its limit, removes the connection of `owner` that was silent for longest. Otherwise, if the table is
// full, removes the connection that was silent for longest among those of the owner with the most connections.
void ClientTable::MakeRoomFor(const std::string& owner) {
  const bool has_its_part = counts_[owner] >= clients_of_owner_max_;
  if (!has_its_part && clients_.size() < clients_max_) return;
  const auto most = std::max_element(counts_.begin(), counts_.end(),
                                     [](const auto& a, const auto& b) { return a.second < b.second; });
  const std::string gives_way = has_its_part ? owner : most->first;
  const auto oldest = std::find_if(clients_.rbegin(), clients_.rend(),
                                   [&gives_way](const Client& client) { return client.owner == gives_way; });
  Erase(std::prev(oldest.base()));
}

void ClientTable::Erase(Clients::iterator client) {
  const auto count = counts_.find(client->owner);
  if (--count->second == 0) counts_.erase(count);
  by_routing_id_.erase(client->routing_id);
  by_name_.erase(client->name);
  clients_.erase(client);
}

std::optional<std::string> ClientTable::RoutingIdOf(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto client = by_name_.find(name);
  return client == by_name_.end() ? std::nullopt : std::optional(client->second->routing_id);
}

std::string ClientTable::OwnerOf(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto client = by_name_.find(name);
  return client == by_name_.end() ? std::string() : client->second->owner;
}

void ClientTable::Forget(const std::string& routing_id) {
  const std::lock_guard lock(mutex_);
  const auto client = by_routing_id_.find(routing_id);
  if (client != by_routing_id_.end()) Erase(client->second);
}

}  // namespace moondb
