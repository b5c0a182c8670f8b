#include "apps/moondb_ros/topic_log.h"

#include <chrono>
#include <utility>

namespace moondb {

void TopicLog::Hear(const std::string& name, Time now) {
  Topic& topic = topics_[name];
  ++topic.heard_count;
  topic.last_heard = now;
  if (std::exchange(topic.is_silent, false)) print_(name + ": is heard again");
}

void TopicLog::Drop(const std::string& name, const std::string& reason) {
  ++topics_[name].dropped_count;
  Note(name, reason);
}

void TopicLog::Note(const std::string& name, const std::string& reason) {
  Topic& topic = topics_[name];
  const bool is_known = topic.reasons.contains(reason);
  const bool has_room = topic.reasons.size() < kReasonsMax;
  ++topic.reasons[is_known || has_room ? reason : "other reasons"];
  if (!is_known && has_room) print_(name + ": " + reason);
}

void TopicLog::CheckSilence(Time now) {
  for (auto& [name, topic] : topics_) {
    if (topic.heard_count == 0 || topic.is_silent || now - topic.last_heard < silent_after_) continue;
    topic.is_silent = true;
    const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(now - topic.last_heard).count();
    print_(name + ": last heard " + std::to_string(seconds) + " s ago");
  }
}

}  // namespace moondb
