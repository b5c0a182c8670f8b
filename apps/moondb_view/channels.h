// Channels: what viewers with Foxglove's protocol can subscribe to. A channel holds its newest message, or for a log
// its last messages. A viewer takes what is newer than the last one that it got, so that the server holds no queue for
// it. Thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace moondb {

struct Channel {
  std::uint32_t id = 0;
  std::string topic;
  std::string encoding;  // "protobuf" or "json".
  std::string schema_name;
  std::string schema;    // A serialized FileDescriptorSet, or a JSON schema.
  bool is_bulk = false;  // One of many channels with large messages, which take turns with the others.
};

class Channels {
 public:
  static constexpr std::size_t kLogMessagesMax = 256;
  static constexpr std::size_t kChannelsMax = 1200;  // 1,024 pages of map, and the others.

  struct Message {
    std::uint64_t version = 0;  // Counts the messages of all channels, ascending.
    std::int64_t log_time_ns = 0;
    std::shared_ptr<const std::string> payload;
  };

  // Returns the id of the channel with this topic, and makes it if there is none. 0: there are too many.
  std::uint32_t Open(Channel channel);
  // Removes the channels whose topics begin with `prefix`.
  void Close(const std::string& prefix);
  // Replaces the newest message. An equal one is no change.
  void Set(std::uint32_t id, std::int64_t log_time_ns, std::string payload);
  // Adds a message behind the earlier ones.
  void Append(std::uint32_t id, std::int64_t log_time_ns, std::string payload);

  // The channels, and their number of changes: it differs if a channel was made or removed.
  std::vector<Channel> List() const;
  std::uint64_t list_version() const;

  struct Next {
    Message message;
    bool has_skipped = false;  // Messages of a log were dropped before this one.
  };
  // Returns the first message of the channel after version `after`, if there is one.
  std::optional<Next> FindNext(std::uint32_t id, std::uint64_t after) const;

  // Calls `wake` after each change, on any thread, until the returned handle is destroyed.
  using Subscription = std::shared_ptr<void>;
  [[nodiscard]] Subscription OnChange(std::function<void()> wake);
  std::size_t CountSubscriptions();

 private:
  struct Entry {
    Channel channel;
    std::deque<Message> messages;
    std::uint64_t dropped_up_to = 0;  // The version of the last dropped message of a log.
  };
  void Notify();

  mutable std::mutex mutex_;
  std::map<std::uint32_t, Entry> entries_;
  std::map<std::string, std::uint32_t> ids_;  // By topic.
  std::uint32_t last_id_ = 0;
  std::uint64_t version_ = 0;
  std::uint64_t list_version_ = 0;
  std::mutex wakes_mutex_;
  std::map<std::uint64_t, std::function<void()>> wakes_;
  std::uint64_t last_wake_ = 0;
};

}  // namespace moondb
