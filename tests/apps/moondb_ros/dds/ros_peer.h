// RosPeer: another participant in a ROS 2 graph, by the plain API of Cyclone, for the tests of moondb_ros. It uses the
// settings of ROS 2's own programs. Not thread-safe.
#pragma once

#include <dds/dds.h>

#include <cstdint>
#include <functional>
#include <string>

#include "apps/moondb_ros/dds/ros.h"

namespace moondb {

// The limit of a test's wait, in steps of 50 ms: a minute.
inline constexpr int kStepsMax = 1200;

// Calls `set` with each pair `--name value` of a command line.
inline void ForEachOption(int argc, char** argv, const std::function<void(const std::string&, const char*)>& set) {
  for (int i = 1; i + 1 < argc; i += 2) set(argv[i], argv[i + 1]);
}

class RosPeer {
 public:
  struct Quality {
    bool is_reliable = true;
    bool is_transient_local = false;
    int depth = 10;
  };

  explicit RosPeer(std::uint32_t domain_id) : participant_(dds_create_participant(domain_id, nullptr, nullptr)) {}
  ~RosPeer() { (void)dds_delete(participant_); }
  RosPeer(const RosPeer&) = delete;
  RosPeer& operator=(const RosPeer&) = delete;

  // `topic` is the name on DDS: "rt/odom".
  dds_entity_t Writer(const dds_topic_descriptor_t& type, const std::string& topic, const Quality& quality) {
    return Endpoint(type, topic, quality, dds_create_writer);
  }
  dds_entity_t Reader(const dds_topic_descriptor_t& type, const std::string& topic, const Quality& quality) {
    return Endpoint(type, topic, quality, dds_create_reader);
  }

  // Takes the next message and passes it to `see`. Returns whether there was one.
  template <typename Message>
  static bool Take(dds_entity_t reader, const std::function<void(const Message&)>& see) {
    void* sample = nullptr;
    dds_sample_info_t info;
    const dds_return_t count = dds_take(reader, &sample, &info, 1, 1);
    const bool is_message = count == 1 && info.valid_data;
    if (is_message) see(*static_cast<const Message*>(sample));
    if (count > 0) (void)dds_return_loan(reader, &sample, count);
    return is_message;
  }

 private:
  template <typename Create>
  dds_entity_t Endpoint(const dds_topic_descriptor_t& type, const std::string& topic, const Quality& quality,
                        const Create& create) {
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, quality.is_reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                         DDS_MSECS(100));
    dds_qset_durability(qos, quality.is_transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, quality.depth);
    const dds_entity_t made = dds_create_topic(participant_, &type, topic.c_str(), nullptr, nullptr);
    const dds_entity_t endpoint = create(participant_, made, qos, nullptr);
    dds_delete_qos(qos);
    return endpoint;
  }

  dds_entity_t participant_;
};

}  // namespace moondb
