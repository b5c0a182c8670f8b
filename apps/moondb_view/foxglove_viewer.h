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
  static constexpr std::size_t kStatusesMax = 16;  // That wait; more are dropped.

  // `session_id` names the run of the server. Requires: `channels` outlives the viewer.
  FoxgloveViewer(Channels& channels, std::string name, std::string session_id, std::function<void()> wake);

  void OnMessage(const Frame& frame) override;
  std::optional<Frame> Next() override;

 private:
  enum class Level { kInfo, kWarning, kError };
  struct Subscription {
    std::uint32_t channel = 0;
    std::uint64_t after = 0;  // The version of the last message that was sent.
  };

  void Subscribe(std::uint32_t id, std::uint32_t channel);
  void Say(Level level, const std::string& text);
  // Returns a message about some channels that were made or removed; nullopt if the viewer knows all.
  std::optional<Frame> NextList();
  std::optional<Frame> NextMessage();

  Channels& channels_;
  const std::string name_;
  const std::string session_id_;
  bool has_info_ = false;
  std::deque<std::string> statuses_;
  std::uint64_t list_version_ = 0;
  std::set<std::uint32_t> known_;  // Channels that were advertised.
  std::map<std::uint32_t, Subscription> subscriptions_;
  std::uint32_t last_sent_ = 0;  // The subscription that was served last.
  Channels::Subscription change_;
};

}  // namespace moondb
