#include "apps/moondb_ros/topic_check.h"

#include <cstdio>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "apps/common/table.h"
#include "apps/moondb_ros/dds/network_interfaces.h"
#include "apps/moondb_ros/ros_inputs.h"
#include "model/text.h"

namespace moondb {
namespace {

// Returns the purpose of an input, for people.
std::string UseOf(std::size_t input, const RosSettings& settings) {
  if (input == kOdometry) return "nodes and odometry";
  if (input == kTf) return "places maps, finds the root frame";
  if (input == kTfStatic) return "places the scanner";
  return settings.grid_topics.empty() ? "local maps of 5 m to 40 m" : "a layer of local maps";
}

std::string QualityOf(const RosGraph::Publisher& publisher) {
  return std::string(publisher.is_reliable ? "reliable" : "best effort") +
         (publisher.is_transient_local ? ", transient local" : ", volatile");
}

std::string Joined(const std::set<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text.empty() ? "-" : text;
}

// Counts what is heard, and makes nodes as RosBridge does, but stores nothing.
class Listener {
 public:
  explicit Listener(const RosSettings& settings)
      : settings_(settings),
        inputs_(InputsOf(settings)),
        log_([](const std::string&) {}, std::chrono::seconds(3)),
        mapper_(MapperOptionsOf(settings), std::nullopt, log_) {}

  Result<void> Listen(std::chrono::seconds duration) {
    RosGraph::Options options;
    options.domain_id = settings_.domain_id;
    options.inputs = inputs_;
    options.epoch_ns = settings_.EpochNs();
    const auto graph = RosGraph::Join(std::move(options), MakeHandlers());
    if (!graph) return tl::unexpected(graph.error());
    const auto end = std::chrono::steady_clock::now() + duration;
    while (std::chrono::steady_clock::now() < end) (*graph)->Spin(std::chrono::milliseconds(50));
    ended_ = std::chrono::steady_clock::now();
    log_.CheckSilence(ended_);
    for (std::size_t input = 0; input < inputs_.size(); ++input) publishers_[input] = (*graph)->PublishersOf(input);
    return {};
  }

  void Print(std::chrono::seconds duration) {
    Table table({"TOPIC", "RATE", "FRAMES", "QUALITY OF SERVICE", "BECOMES"});
    for (std::size_t input = 0; input < inputs_.size(); ++input) {
      const std::string& topic = inputs_[input].topic;
      const auto heard = log_.topics().find(topic);
      const double count = heard == log_.topics().end() ? 0 : static_cast<double>(heard->second.heard_count);
      char rate[32];
      std::snprintf(rate, sizeof rate, "%.1f Hz", count / static_cast<double>(duration.count()));
      const bool is_static = input == kTfStatic;
      const std::string rate_text = is_static && count > 0 ? "static" : rate;
      const auto& publishers = publishers_[input];
      table.Add({topic, count == 0 ? "silent" : rate_text, Joined(frames_[input]),
                 !publishers.empty() ? QualityOf(publishers.front())
                 : count > 0         ? "publisher has left"
                                     : "no publisher",
                 UseOf(input, settings_)});
    }
    std::fputs(table.Text().c_str(), stdout);
    for (const auto& [topic, heard] : log_.topics()) {
      for (const auto& [reason, count] : heard.reasons) {
        std::printf("%s: %s (%llu times)\n", topic.c_str(), OneLine(reason).c_str(),
                    static_cast<unsigned long long>(count));
      }
      const bool is_static = topic == inputs_[kTfStatic].topic;
      if (!heard.is_silent || is_static) continue;
      const auto seconds = std::chrono::duration_cast<std::chrono::seconds>(ended_ - heard.last_heard).count();
      std::printf("%s: last heard %lld s ago\n", topic.c_str(), static_cast<long long>(seconds));
    }
    PrintMissing();
  }

  // Nodes with maps would be made, and odometry has not fallen silent since.
  bool works() const { return has_map_ && !log_.topics().at(inputs_[kOdometry].topic).is_silent; }

 private:
  RosGraph::Handlers MakeHandlers() {
    const auto hear = [this](std::size_t input, const std::string& frames) { Hear(input, frames); };
    return HandlersFor(inputs_, mapper_, log_, hear, [this](const RosOdometry& message) {
      const auto made = mapper_.OnOdometry(message, /*has_room=*/true);
      if (!made) return;
      has_node_ = true;
      has_map_ = has_map_ || made->records.back().has_local_traversability_map();
    });
  }

  void Hear(std::size_t input, const std::string& frames) {
    constexpr std::size_t kFramesShown = 4;
    log_.Hear(inputs_[input].topic, std::chrono::steady_clock::now());
    if (frames_[input].size() < kFramesShown) frames_[input].insert(frames);
  }

  void PrintMissing() const {
    const std::string& odometry = inputs_[kOdometry].topic;
    if (publishers_.at(kOdometry).empty() && !log_.topics().contains(odometry)) {
      std::printf(
          "%s: no publisher was found in domain %u: name the topic (--odom, --namespace) and the domain (--domain-id, "
          "ROS_DOMAIN_ID). Programs with rmw_cyclonedds of ROS 2 Humble need ROS_LOCALHOST_ONLY=1; those with "
          "rmw_zenoh are not reached\n",
          odometry.c_str(), settings_.domain_id);
    } else if (!has_node_) {
      std::printf("%s: no node was made: see above\n", odometry.c_str());
    } else if (!has_map_) {
      std::printf("nodes would have no maps: publish %s, or name another topic (--scan, --grid)\n",
                  inputs_[kMapSource].topic.c_str());
    }
    const RosInterfaces interfaces = FindRosInterfaces();
    for (const std::string& name : interfaces.left_out) {
      std::printf("the network interface %s is not used: moondb_ros can use at most %zu\n", name.c_str(),
                  kRosInterfacesMax);
    }
    if (works()) std::printf("odometry and maps work\n");
  }

  const RosSettings settings_;
  const std::vector<RosGraph::Input> inputs_;
  TopicLog log_;
  RobotMapper mapper_;
  std::map<std::size_t, std::set<std::string>> frames_;
  std::map<std::size_t, std::vector<RosGraph::Publisher>> publishers_;
  std::chrono::steady_clock::time_point ended_;
  bool has_node_ = false;
  bool has_map_ = false;
};

}  // namespace

Result<bool> CheckTopics(const RosSettings& settings, std::chrono::seconds duration) {
  Listener listener(settings);
  if (const Result<void> listened = listener.Listen(duration); !listened) return tl::unexpected(listened.error());
  listener.Print(duration);
  return listener.works();
}

}  // namespace moondb
