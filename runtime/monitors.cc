#include "runtime/monitors.h"

#include <memory>
#include <utility>

#include "model/check.h"
#include "runtime/envelope.h"

namespace moondb {
namespace {

constexpr char kRuntime[] = "runtime";

Monitors::Notice MakeNotice(AgentId self, const std::string& watcher, proto::Message message) {
  WriteEnvelope({self, kRuntime}, {self, watcher}, message);
  return {watcher, std::move(message)};
}

}  // namespace

Monitors::Notices Monitors::WatchPeers(const std::string& watcher) {
  peer_watchers_.insert(watcher);
  Notices notices;
  for (const AgentId peer : connected_) notices.push_back(MakePeerEvent(watcher, peer, true));
  return notices;
}

Monitors::Notices Monitors::Watch(const std::string& watcher, Topic topic) {
  topic_watchers_[topic].insert(watcher);
  const auto last = published_.find(topic);
  if (last == published_.end()) return {};
  return {MakeNews(watcher, last->second)};
}

Monitors::Notices Monitors::Publish(const std::string& publisher, const proto::Message& message) {
  Check(IsOfTopic(message), "what is published is of a topic");
  const auto topic = static_cast<Topic>(message.body_case());
  proto::Message news = message;
  news.set_source_actor(publisher);
  Notices notices;
  for (const std::string& watcher : topic_watchers_[topic]) notices.push_back(MakeNews(watcher, news));
  // RecordsStored is an event and not state, so it is not kept for later watchers. An actor that fails on it would
  // otherwise receive it again after its restart.
  if (topic != Topic::kStored) published_[topic] = std::move(news);
  return notices;
}

Monitors::Notices Monitors::Monitor(const std::string& watcher, const Address& target, bool is_lost) {
  std::set<Address>& targets = targets_of_[watcher];
  targets.insert(target);
  Check(targets.size() <= kTargetsMax, "an actor monitors no more than a thousand others");
  if (target.agent == self_) {
    if (!is_lost) return {};
    return {MakeDown(watcher, target, "there is no such actor", /*is_final=*/true)};
  }
  if (connected_.contains(target.agent)) return {};
  return {MakeDown(watcher, target, "not connected", /*is_final=*/false)};
}

void Monitors::Demonitor(const std::string& watcher, const Address& target) {
  const auto targets = targets_of_.find(watcher);
  if (targets != targets_of_.end()) targets->second.erase(target);
}

Monitors::Notices Monitors::OnActorDown(const std::string& actor, const std::string& reason, bool is_final) {
  targets_of_.erase(actor);
  peer_watchers_.erase(actor);
  for (auto& [topic, watchers] : topic_watchers_) watchers.erase(actor);
  const Address target{self_, actor};
  Notices notices;
  for (const auto& [watcher, targets] : targets_of_) {
    if (targets.contains(target)) notices.push_back(MakeDown(watcher, target, reason, is_final));
  }
  return notices;
}

Monitors::Notices Monitors::OnPeerChanged(AgentId peer, bool is_connected) {
  const bool is_change = is_connected ? connected_.insert(peer).second : connected_.erase(peer) > 0;
  if (!is_change) return {};
  Notices notices;
  for (const std::string& watcher : peer_watchers_) notices.push_back(MakePeerEvent(watcher, peer, is_connected));
  if (is_connected) return notices;
  for (const auto& [watcher, targets] : targets_of_) {
    for (auto target = targets.lower_bound({peer, ""}); target != targets.end() && target->agent == peer; ++target) {
      notices.push_back(MakeDown(watcher, *target, "the connection was lost", /*is_final=*/false));
    }
  }
  return notices;
}

Monitors::Notice Monitors::MakeNews(const std::string& watcher, const proto::Message& message) const {
  Notice notice{watcher, message};
  WriteEnvelope({self_, message.source_actor()}, {self_, watcher}, notice.message);
  return notice;
}

Monitors::Notice Monitors::MakePeerEvent(const std::string& watcher, AgentId peer, bool is_connected) const {
  proto::Message message;
  message.mutable_peer_event()->set_peer(peer);
  message.mutable_peer_event()->set_is_connected(is_connected);
  return MakeNotice(self_, watcher, std::move(message));
}

Monitors::Notice Monitors::MakeDown(const std::string& watcher, const Address& target, const std::string& reason,
                                    bool is_final) const {
  proto::Message message;
  proto::Down& down = *message.mutable_down();
  down.set_agent(target.agent);
  down.set_actor(target.actor);
  down.set_reason(reason);
  down.set_is_final(is_final);
  return MakeNotice(self_, watcher, std::move(message));
}

}  // namespace moondb
