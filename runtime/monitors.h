// Monitors: remembers which actors of one agent watch peers, actors and topics, and makes the messages that they
// receive.
//
// Each call returns the notices that the caller (ActorSystem or SimulatedTeam) must deliver to actors of this agent.
// Their envelopes are set. Not thread-safe.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "runtime/actor.h"

namespace moondb {

class Monitors {
 public:
  struct Notice {
    std::string watcher;     // An actor of this agent.
    proto::Message message;  // A PeerEvent, a Down, or a published message.
  };
  using Notices = std::vector<Notice>;

  // Limit of monitored addresses per watcher. Exceeding it is a bug in the actor and fails a Check.
  static constexpr std::size_t kTargetsMax = 1024;

  explicit Monitors(AgentId self) : self_(self) {}

  // These functions implement the Context functions with the same names, for the actor `watcher` or `publisher`.
  // `is_lost`: the target is an actor of this agent that does not run.
  Notices WatchPeers(const std::string& watcher);
  Notices Watch(const std::string& watcher, Topic topic);
  // Requires: IsOfTopic(message). Otherwise a Check fails.
  Notices Publish(const std::string& publisher, const proto::Message& message);
  Notices Monitor(const std::string& watcher, const Address& target, bool is_lost);
  void Demonitor(const std::string& watcher, const Address& target);

  // Call when the incarnation of `actor` ended. Removes its subscriptions, and returns the notices for the actors that
  // monitor `actor`.
  Notices OnActorDown(const std::string& actor, const std::string& reason, bool is_final);
  // Call when a peer connected or disconnected. Returns the notices for the actors that watch peers or monitor this
  // peer; none if the peer's state did not change.
  Notices OnPeerChanged(AgentId peer, bool is_connected);

 private:
  Notice MakeNews(const std::string& watcher, const proto::Message& message) const;
  Notice MakePeerEvent(const std::string& watcher, AgentId peer, bool is_connected) const;
  Notice MakeDown(const std::string& watcher, const Address& target, const std::string& reason, bool is_final) const;

  AgentId self_;
  std::set<AgentId> connected_;
  std::set<std::string> peer_watchers_;
  std::map<Topic, std::set<std::string>> topic_watchers_;
  std::map<Topic, proto::Message> published_;            // Current roles and leases, with the publisher's name.
  std::map<std::string, std::set<Address>> targets_of_;  // Monitored addresses by watcher.
};

}  // namespace moondb
