// Monitors: who on one agent wants to hear when peers come and go, when actors die and what other actors publish, and
// the messages that they then get.
//
// Plain bookkeeping for ActorSystem and SimulatedTeam: each call returns the notices to be delivered, complete with
// their envelope, to actors of this agent. Not thread-safe.
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
    proto::Message message;  // A PeerEvent, a Down, or what was published.
  };
  using Notices = std::vector<Notice>;

  static constexpr std::size_t kTargetsMax = 1024;  // Of one actor; more is one that has lost count: a broken claim.

  explicit Monitors(AgentId self) : self_(self) {}

  // As Context's of the same name, called by `watcher`. `is_lost`: the target, one of this agent's actors, is not
  // there.
  Notices WatchPeers(const std::string& watcher);
  Notices Watch(const std::string& watcher, Topic topic);
  // `message` is of a Topic; anything else is a broken claim of the actor's.
  Notices Publish(const std::string& publisher, const proto::Message& message);
  Notices Monitor(const std::string& watcher, const Address& target, bool is_lost);
  void Demonitor(const std::string& watcher, const Address& target);

  // `actor`'s incarnation ended: so did what it watched.
  Notices OnActorDown(const std::string& actor, const std::string& reason, bool is_final);
  // Of a change that is none, nobody hears.
  Notices OnPeerChanged(AgentId peer, bool is_connected);

 private:
  Notice MakeNews(const std::string& watcher, const proto::Message& message) const;
  Notice MakePeerEvent(const std::string& watcher, AgentId peer, bool is_connected) const;
  Notice MakeDown(const std::string& watcher, const Address& target, const std::string& reason, bool is_final) const;

  AgentId self_;
  std::set<AgentId> connected_;
  std::set<std::string> peer_watchers_;
  std::map<Topic, std::set<std::string>> topic_watchers_;
  std::map<Topic, proto::Message> published_;            // What stands: roles and leases, with their publishers.
  std::map<std::string, std::set<Address>> targets_of_;  // By watcher.
};

}  // namespace moondb
