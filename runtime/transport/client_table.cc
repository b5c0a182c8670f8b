#include "runtime/transport/client_table.h"

namespace moondb {

std::string ClientTable::NameOf(const std::string& routing_id) {
  const std::lock_guard lock(mutex_);
  if (const auto known = by_routing_id_.find(routing_id); known != by_routing_id_.end()) {
    clients_.splice(clients_.begin(), clients_, known->second);
    return clients_.front().name;
  }
  if (clients_.size() >= clients_max_) {
    by_routing_id_.erase(clients_.back().routing_id);
    by_name_.erase(clients_.back().name);
    clients_.pop_back();
  }
  clients_.push_front({routing_id, prefix_ + std::to_string(++named_)});
  by_routing_id_[routing_id] = clients_.begin();
  by_name_[clients_.front().name] = clients_.begin();
  return clients_.front().name;
}

std::optional<std::string> ClientTable::RoutingIdOf(const std::string& name) const {
  const std::lock_guard lock(mutex_);
  const auto client = by_name_.find(name);
  return client == by_name_.end() ? std::nullopt : std::optional(client->second->routing_id);
}

void ClientTable::Forget(const std::string& routing_id) {
  const std::lock_guard lock(mutex_);
  const auto client = by_routing_id_.find(routing_id);
  if (client == by_routing_id_.end()) return;
  by_name_.erase(client->second->name);
  clients_.erase(client->second);
  by_routing_id_.erase(client);
}

}  // namespace moondb
