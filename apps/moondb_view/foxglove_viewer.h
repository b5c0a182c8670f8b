// FoxgloveViewer: the server's side of one connection with Foxglove's WebSocket protocol, over Channels. It sends the
// newest message of each subscribed channel in turn, so a slow viewer gets fewer messages, not older ones. Not
// thread-safe.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "apps/moondb_view/channels.h"
#include "apps/moondb_view/http_server.h"

namespace moondb {

class FoxgloveViewer : public SocketPeer {
 public:
  static constexpr std::size_t kSubscriptionsMax = 2 * Channels::kChannelsMax;
  static constexpr std::size_t kStatusesMax = 16;  // Statuses that wait; more are dropped.

  // `session_id` names the run of the server. Requires: `channels` outlives the viewer.
  FoxgloveViewer(Channels& channels, std::string name, std::string session_id, std::function<void()> wake);

  void OnMessage(const Frame& frame) override;
  std::optional<Frame> Next() override;

 private:
  enum class Level { kInfo, kWarning, kError };
  struct Subscription {
    std::uint32_t channel = 0;
    bool is_bulk = false;
    std::uint64_t after = 0;  // The version of the last message that was sent.
  };

  void Subscribe(std::uint32_t id, std::uint32_t channel);
  void Say(Level level, const std::string& text);
  // Returns a message about some channels that were made or removed; nullopt if the viewer knows all.
  std::optional<Frame> NextList();
  std::optional<Frame> NextMessage();
  // Returns the next message of the bulk channels, or of the others.
  std::optional<Frame> NextMessageOf(bool is_bulk);

  Channels& channels_;
  const std::string name_;
  const std::string session_id_;
  bool has_info_ = false;
  std::deque<std::string> statuses_;
  std::uint64_t list_version_ = 0;
  std::map<std::uint32_t, bool> known_;  // Channels that were advertised, each with its is_bulk.
  std::map<std::uint32_t, Subscription> subscriptions_;
  std::map<bool, std::uint32_t> last_sent_;  // By is_bulk: the subscription that was served last.
  bool was_bulk_ = false;                    // The last message was one of a bulk channel.
  Channels::Subscription change_;
};

}  // namespace moondb
