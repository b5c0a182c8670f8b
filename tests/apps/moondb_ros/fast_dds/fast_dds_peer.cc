// fast_dds_peer: a robot's ROS 2 programs with Fast DDS, ROS 2's default middleware, in its default settings. Publishes
// /odom (a robot that drives along x at 0.5 m/s), /scan (a wall at 2 m all around) and /tf_static, and reads /team_map
// and /tf. Ends with 0 once a late reader and a volatile reader have received the map, and transforms have come; with 1
// if that takes longer than SECONDS. Prints: map WIDTH HEIGHT KNOWN_CELLS MAPS VOLATILE_MAPS, and tf COUNT.
//
// Usage: fast_dds_peer DOMAIN SECONDS
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <string>
#include <thread>

#include "rosPubSubTypes.h"

namespace {

using namespace eprosima::fastdds::dds;
using nav_msgs::msg::dds_::OccupancyGrid_;
using nav_msgs::msg::dds_::Odometry_;
using sensor_msgs::msg::dds_::LaserScan_;
using tf2_msgs::msg::dds_::TFMessage_;

struct Quality {
  bool is_reliable = true;
  bool is_transient_local = false;
  int depth = 10;
};

template <typename Qos>
Qos With(Qos qos, const Quality& quality) {
  qos.reliability().kind = quality.is_reliable ? RELIABLE_RELIABILITY_QOS : BEST_EFFORT_RELIABILITY_QOS;
  qos.durability().kind = quality.is_transient_local ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
  qos.history().kind = KEEP_LAST_HISTORY_QOS;
  qos.history().depth = quality.depth;
  qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
  return qos;
}

class Peer {
 public:
  explicit Peer(unsigned domain)
      : participant_(DomainParticipantFactory::get_instance()->create_participant(domain, PARTICIPANT_QOS_DEFAULT)),
        publisher_(participant_->create_publisher(PUBLISHER_QOS_DEFAULT)),
        subscriber_(participant_->create_subscriber(SUBSCRIBER_QOS_DEFAULT)) {}

  template <typename Support>
  Topic* TopicOf(const std::string& name) {
    TypeSupport type(new Support());
    type.register_type(participant_);
    if (auto* known = participant_->lookup_topicdescription(name)) return static_cast<Topic*>(known);
    return participant_->create_topic(name, type.get_type_name(), TOPIC_QOS_DEFAULT);
  }
  template <typename Support>
  DataWriter* Writer(const std::string& name, const Quality& quality) {
    return publisher_->create_datawriter(TopicOf<Support>(name), With(DATAWRITER_QOS_DEFAULT, quality));
  }
  template <typename Support>
  DataReader* Reader(const std::string& name, const Quality& quality) {
    return subscriber_->create_datareader(TopicOf<Support>(name), With(DATAREADER_QOS_DEFAULT, quality));
  }

 private:
  DomainParticipant* participant_;
  Publisher* publisher_;
  Subscriber* subscriber_;
};

std_msgs::msg::dds_::Header_ HeaderNow(const std::string& frame) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  std_msgs::msg::dds_::Header_ header;
  header.stamp().sec(static_cast<std::int32_t>(std::chrono::duration_cast<std::chrono::seconds>(now).count()));
  header.stamp().nanosec(
      static_cast<std::uint32_t>(std::chrono::duration_cast<std::chrono::nanoseconds>(now).count() % 1'000'000'000));
  header.frame_id(frame);
  return header;
}

template <typename Message, typename See>
int TakeAll(DataReader* reader, const See& see) {
  int count = 0;
  Message message;
  SampleInfo info;
  while (reader->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK) {
    if (!info.valid_data) continue;
    ++count;
    see(message);
  }
  return count;
}

int Run(unsigned domain, double seconds) {
  Peer peer(domain);
  DataWriter* odometry = peer.Writer<nav_msgs::msg::dds_::Odometry_PubSubType>("rt/odom", {});
  DataWriter* scan = peer.Writer<sensor_msgs::msg::dds_::LaserScan_PubSubType>("rt/scan", {false, false, 5});
  DataWriter* frames = peer.Writer<tf2_msgs::msg::dds_::TFMessage_PubSubType>("rt/tf_static", {true, true, 1});
  DataReader* map = peer.Reader<nav_msgs::msg::dds_::OccupancyGrid_PubSubType>("rt/team_map", {true, true, 1});
  DataReader* volatile_map =
      peer.Reader<nav_msgs::msg::dds_::OccupancyGrid_PubSubType>("rt/team_map", {true, false, 5});
  DataReader* tf = peer.Reader<tf2_msgs::msg::dds_::TFMessage_PubSubType>("rt/tf", {true, false, 100});

  geometry_msgs::msg::dds_::TransformStamped_ stamped;
  stamped.header(HeaderNow("base_link"));
  stamped.child_frame_id("laser");
  stamped.transform().rotation().w(1);
  TFMessage_ transforms;
  transforms.transforms().push_back(stamped);
  frames->write(&transforms);

  int maps = 0;
  int volatile_maps = 0;
  int tf_count = 0;
  unsigned width = 0;
  unsigned height = 0;
  long known = 0;
  const auto start = std::chrono::steady_clock::now();
  const auto is_done = [&] { return maps > 0 && volatile_maps > 0 && tf_count > 10; };
  for (int i = 0; i * 0.05 < seconds && !is_done(); ++i) {
    std::this_thread::sleep_until(start + i * std::chrono::milliseconds(50));
    Odometry_ message;
    message.header(HeaderNow("odom"));
    message.child_frame_id("base_link");
    message.pose().pose().position().x(0.025 * i);
    message.pose().pose().orientation().w(1);
    odometry->write(&message);
    LaserScan_ ranges;
    ranges.header(HeaderNow("laser"));
    ranges.angle_min(-3.14159F);
    ranges.angle_increment(0.01745F);
    ranges.range_min(0.1F);
    ranges.range_max(10);
    ranges.ranges().assign(360, 2);
    if (i % 2 == 0) scan->write(&ranges);
    maps += TakeAll<OccupancyGrid_>(map, [&](const OccupancyGrid_& seen) {
      width = seen.info().width();
      height = seen.info().height();
      known = 0;
      for (const auto cell : seen.data()) known += static_cast<std::int8_t>(cell) >= 0 ? 1 : 0;
    });
    volatile_maps += TakeAll<OccupancyGrid_>(volatile_map, [](const OccupancyGrid_&) {});
    tf_count += TakeAll<TFMessage_>(tf, [](const TFMessage_&) {});
  }
  std::printf("map %u %u %ld %d %d\ntf %d\n", width, height, known, maps, volatile_maps, tf_count);
  return is_done() ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  return Run(static_cast<unsigned>(std::atoi(argv[1])), std::atof(argv[2]));
}
