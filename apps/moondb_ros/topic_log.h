// TopicLog: what was heard on each topic, and why messages were not used.
//
// Each reason is printed once per topic, with its remedy, and counted after that. A topic that falls silent is printed
// once, and again when it is heard again. Not thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <string>

namespace moondb {

class TopicLog {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::size_t kReasonsMax = 64;  // Further reasons of a topic are counted together.

  struct Topic {
    std::uint64_t heard_count = 0;
    std::uint64_t dropped_count = 0;
    Time last_heard{};
    bool is_silent = false;
    std::map<std::string, std::uint64_t> reasons;  // Why messages were not used, or used only in part, and how often.
  };

  // `silent_after`: a topic is silent after this long without a message.
  TopicLog(std::function<void(const std::string&)> print, Time::duration silent_after)
      : print_(std::move(print)), silent_after_(silent_after) {}

  void Hear(const std::string& topic, Time now);
  // The message was not used. `reason` reads on from "TOPIC: ".
  void Drop(const std::string& topic, const std::string& reason);
  // Something is missing, though no message was dropped.
  void Note(const std::string& topic, const std::string& reason);
  // Call periodically.
  void CheckSilence(Time now);

  const std::map<std::string, Topic>& topics() const { return topics_; }

 private:
  const std::function<void(const std::string&)> print_;
  const Time::duration silent_after_;
  std::map<std::string, Topic> topics_;
};

}  // namespace moondb
