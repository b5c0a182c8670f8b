#include "apps/moondb_view/channels.h"

#include <utility>

namespace moondb {

std::uint32_t Channels::Open(Channel channel) {
  std::uint32_t id = 0;
  {
    const std::lock_guard lock(mutex_);
    if (const auto known = ids_.find(channel.topic); known != ids_.end()) return known->second;
    if (entries_.size() >= kChannelsMax) return 0;
    id = channel.id = ++last_id_;
    ids_[channel.topic] = id;
    entries_[id].channel = std::move(channel);
    ++list_version_;
  }
  Notify();
  return id;
}

void Channels::Close(const std::string& prefix) {
  {
    const std::lock_guard lock(mutex_);
    for (auto topic = ids_.lower_bound(prefix); topic != ids_.end() && topic->first.starts_with(prefix);) {
      entries_.erase(topic->second);
      topic = ids_.erase(topic);
      ++list_version_;
    }
  }
  Notify();
}

void Channels::Set(std::uint32_t id, std::int64_t log_time_ns, std::string payload) {
  {
    const std::lock_guard lock(mutex_);
    const auto entry = entries_.find(id);
    if (entry == entries_.end()) return;
    std::deque<Message>& messages = entry->second.messages;
    if (!messages.empty() && *messages.back().payload == payload) return;
    messages.assign(1, {++version_, log_time_ns, std::make_shared<const std::string>(std::move(payload))});
  }
  Notify();
}

void Channels::Append(std::uint32_t id, std::int64_t log_time_ns, std::string payload) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(id);
    if (found == entries_.end()) return;
    Entry& entry = found->second;
    entry.messages.push_back({++version_, log_time_ns, std::make_shared<const std::string>(std::move(payload))});
    if (entry.messages.size() > kLogMessagesMax) {
      entry.dropped_up_to = entry.messages.front().version;
      entry.messages.pop_front();
    }
  }
  Notify();
}

std::vector<Channel> Channels::List() const {
  const std::lock_guard lock(mutex_);
  std::vector<Channel> channels;
  for (const auto& [id, entry] : entries_) channels.push_back(entry.channel);
  return channels;
}

std::uint64_t Channels::list_version() const {
  const std::lock_guard lock(mutex_);
  return list_version_;
}

std::optional<Channels::Next> Channels::FindNext(std::uint32_t id, std::uint64_t after) const {
  const std::lock_guard lock(mutex_);
  const auto entry = entries_.find(id);
  if (entry == entries_.end()) return std::nullopt;
  for (const Message& message : entry->second.messages) {
    if (message.version <= after) continue;
    // A viewer that has had none of them misses nothing that it asked for.
    const bool has_skipped = after != 0 && after < entry->second.dropped_up_to;
    return Next{message, has_skipped};
  }
  return std::nullopt;
}

Channels::Subscription Channels::OnChange(std::function<void()> wake) {
  const std::lock_guard lock(wakes_mutex_);
  const std::uint64_t number = ++last_wake_;
  wakes_[number] = std::move(wake);
  return {nullptr, [this, number](void*) {
            const std::lock_guard unlock(wakes_mutex_);
            wakes_.erase(number);
          }};
}

std::size_t Channels::CountSubscriptions() {
  const std::lock_guard lock(wakes_mutex_);
  return wakes_.size();
}

void Channels::Notify() {
  const std::lock_guard lock(wakes_mutex_);
  for (const auto& [number, wake] : wakes_) wake();
}

}  // namespace moondb
