#include "apps/moondb_ros/dds/ros_graph.h"

#include <dds/dds.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <utility>

#include "apps/moondb_ros/dds/network_interfaces.h"
#include "apps/moondb_ros/dds/ros_conversion.h"

namespace moondb {
namespace {

constexpr int kInputDepth = 10;     // Messages of an input that wait for Spin.
constexpr int kTfDepth = 100;       // As ROS 2 publishes /tf.
constexpr std::size_t kTaken = 16;  // Messages that are taken at once.
constexpr dds_duration_t kWriteMax = DDS_MSECS(100);
constexpr auto kMapRetry = std::chrono::seconds(1);  // The pause between two writes of the same map.

struct TypeInfo {
  const dds_topic_descriptor_t* descriptor;
  // ROS 2's hash of the type (REP 2016), by which ROS 2's tools recognize the type.
  const char* hash;
};

TypeInfo InfoOf(RosGraph::Type type) {
  switch (type) {
    case RosGraph::Type::kOdometry:
      return {&nav_msgs_msg_dds__Odometry__desc, "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"};
    case RosGraph::Type::kScan:
      return {&sensor_msgs_msg_dds__LaserScan__desc,
              "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"};
    case RosGraph::Type::kGrid:
      return {&nav_msgs_msg_dds__OccupancyGrid__desc,
              "8d348150c12913a31ee0ec170fbf25089e4745d17035792a1ba94d6f0bc0cfc7"};
    case RosGraph::Type::kTransforms:
      break;
  }
  return {&tf2_msgs_msg_dds__TFMessage__desc, "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"};
}

std::string DdsTopic(const std::string& topic) { return "rt/" + (topic.starts_with('/') ? topic.substr(1) : topic); }

using Qos = std::unique_ptr<dds_qos_t, void (*)(dds_qos_t*)>;

// The settings that all endpoints share. XCDR1 is the encoding of ROS 2.
Qos MakeQos(RosGraph::Type type, int depth, bool is_reliable, bool is_transient_local) {
  Qos qos(dds_create_qos(), dds_delete_qos);
  const std::string user_data = std::string("typehash=RIHS01_") + InfoOf(type).hash + ";";
  dds_qset_userdata(qos.get(), user_data.data(), user_data.size());
  const dds_data_representation_id_t xcdr1 = DDS_DATA_REPRESENTATION_XCDR1;
  dds_qset_data_representation(qos.get(), 1, &xcdr1);
  // This participant does not hear its own transforms and maps.
  dds_qset_ignorelocal(qos.get(), DDS_IGNORELOCAL_PARTICIPANT);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, depth);
  dds_qset_reliability(qos.get(), is_reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, kWriteMax);
  dds_qset_durability(qos.get(), is_transient_local ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  if (is_transient_local) {
    dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, depth, DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED);
  }
  return qos;
}

RosGraph::Publisher PublisherOf(const dds_builtintopic_endpoint_t& endpoint) {
  RosGraph::Publisher publisher{endpoint.type_name, false, false};
  dds_reliability_kind_t reliability = DDS_RELIABILITY_BEST_EFFORT;
  if (dds_qget_reliability(endpoint.qos, &reliability, nullptr)) {
    publisher.is_reliable = reliability == DDS_RELIABILITY_RELIABLE;
  }
  dds_durability_kind_t durability = DDS_DURABILITY_VOLATILE;
  if (dds_qget_durability(endpoint.qos, &durability)) {
    publisher.is_transient_local = durability != DDS_DURABILITY_VOLATILE;
  }
  return publisher;
}

Error ErrorOf(dds_return_t code, const std::string& what) {
  if (code == DDS_RETCODE_TIMEOUT) return {ErrorCode::kTimedOut, what + ": a reader does not read", ""};
  return {ErrorCode::kInternal, what + ": " + dds_strretcode(-code), ""};
}

}  // namespace

class RosGraph::Dds {
 public:
  Dds(Options options, Handlers handlers) : options_(std::move(options)), handlers_(std::move(handlers)) {}
  ~Dds() {
    if (domain_ > 0) (void)dds_delete(domain_);
  }
  Dds(const Dds&) = delete;
  Dds& operator=(const Dds&) = delete;

  Result<void> Join();
  void Spin(std::chrono::milliseconds timeout);
  Result<void> WriteMap(const RosGrid& grid);
  Result<void> WriteTransform(const RosTransform& transform);
  std::vector<Publisher> PublishersOf(std::size_t input) const;
  bool IsPublishedByOthers(const std::string& topic) const;

 private:
  struct Reader {
    dds_entity_t entity = 0;  // 0 before a publisher was found.
    bool is_reliable = false;
    bool is_transient_local = false;
  };
  struct Found {
    std::string topic;  // Its name on DDS.
    Publisher publisher;
  };

  dds_entity_t TopicOf(const std::string& topic, Type type);
  void ObservePublishers();
  // Makes the reader of an input, or makes it again, if it does not fit the publishers.
  void FitReader(std::size_t input);
  void Take(std::size_t input);
  template <typename Message, typename Handle>
  void TakeAll(dds_entity_t reader, const Handle& handle);
  Result<void> RewriteMapForNewReaders();

  const Options options_;
  const Handlers handlers_;
  dds_entity_t domain_ = 0;
  dds_entity_t participant_ = 0;
  dds_entity_t waitset_ = 0;
  dds_entity_t publications_ = 0;
  dds_entity_t map_writer_ = 0;
  dds_entity_t tf_writer_ = 0;
  std::map<std::string, dds_entity_t> topics_;                // By name on DDS.
  std::vector<Reader> readers_;                               // One per input.
  std::map<std::array<std::uint8_t, 16>, Found> publishers_;  // Publishers of other participants, by GUID.
  bool is_map_due_ = false;                                   // A reader joined, or the last write failed.
  std::chrono::steady_clock::time_point map_retry_{};
  RosGrid map_;  // The last map written; without cells before the first.
};

Result<void> RosGraph::Dds::Join() {
  const std::string config = CycloneConfig(FindRosInterfaces());
  domain_ = dds_create_domain(options_.domain_id, config.c_str());
  if (domain_ > 0) participant_ = dds_create_participant(options_.domain_id, nullptr, nullptr);
  if (domain_ <= 0 || participant_ <= 0) {
    return Fail(ErrorCode::kUnavailable, "cannot take part in DDS domain " + std::to_string(options_.domain_id) +
                                             ": no network, or all 120 participants of this computer are in use");
  }
  waitset_ = dds_create_waitset(participant_);
  publications_ = dds_create_reader(participant_, DDS_BUILTIN_TOPIC_DCPSPUBLICATION, nullptr, nullptr);
  (void)dds_set_status_mask(publications_, DDS_DATA_AVAILABLE_STATUS);
  (void)dds_waitset_attach(waitset_, publications_, 0);
  readers_.resize(options_.inputs.size());
  if (!options_.map_topic.empty()) {
    const Qos qos = MakeQos(Type::kGrid, /*depth=*/1, /*is_reliable=*/true, /*is_transient_local=*/true);
    map_writer_ = dds_create_writer(participant_, TopicOf(options_.map_topic, Type::kGrid), qos.get(), nullptr);
    (void)dds_set_status_mask(map_writer_, DDS_PUBLICATION_MATCHED_STATUS);
    (void)dds_waitset_attach(waitset_, map_writer_, 0);
  }
  if (!options_.tf_topic.empty()) {
    const Qos qos = MakeQos(Type::kTransforms, kTfDepth, /*is_reliable=*/true, /*is_transient_local=*/false);
    tf_writer_ = dds_create_writer(participant_, TopicOf(options_.tf_topic, Type::kTransforms), qos.get(), nullptr);
  }
  if (waitset_ <= 0 || publications_ <= 0 || map_writer_ < 0 || tf_writer_ < 0) {
    return Fail(ErrorCode::kInternal, "cannot make the endpoints of DDS");
  }
  return {};
}

dds_entity_t RosGraph::Dds::TopicOf(const std::string& topic, Type type) {
  const std::string name = DdsTopic(topic);
  const auto known = topics_.find(name);
  if (known != topics_.end()) return known->second;
  const dds_entity_t made = dds_create_topic(participant_, InfoOf(type).descriptor, name.c_str(), nullptr, nullptr);
  if (made > 0) topics_[name] = made;
  return made;
}

void RosGraph::Dds::Spin(std::chrono::milliseconds timeout) {
  std::array<dds_attach_t, 1> triggered;
  (void)dds_waitset_wait(waitset_, triggered.data(), triggered.size(), DDS_MSECS(timeout.count()));
  ObservePublishers();
  for (std::size_t input = 0; input < readers_.size(); ++input) Take(input);
  (void)RewriteMapForNewReaders();  // If a reader does not read, the map is written again later.
}

void RosGraph::Dds::ObservePublishers() {
  dds_guid_t own{};
  (void)dds_get_guid(participant_, &own);
  std::array<void*, kTaken> samples{};
  std::array<dds_sample_info_t, kTaken> infos;
  while (true) {
    samples.fill(nullptr);
    const dds_return_t count = dds_take(publications_, samples.data(), infos.data(), kTaken, kTaken);
    if (count <= 0) break;
    for (dds_return_t i = 0; i < count; ++i) {
      const auto& endpoint = *static_cast<const dds_builtintopic_endpoint_t*>(samples[static_cast<std::size_t>(i)]);
      const dds_sample_info_t& info = infos[static_cast<std::size_t>(i)];
      if (std::memcmp(endpoint.participant_key.v, own.v, sizeof own.v) == 0) continue;
      std::array<std::uint8_t, 16> key;
      std::copy(std::begin(endpoint.key.v), std::end(endpoint.key.v), key.begin());
      if (info.instance_state != DDS_ALIVE_INSTANCE_STATE) {
        publishers_.erase(key);
      } else if (info.valid_data && endpoint.topic_name != nullptr && endpoint.type_name != nullptr) {
        publishers_[key] = {endpoint.topic_name, PublisherOf(endpoint)};
      }
    }
    (void)dds_return_loan(publications_, samples.data(), count);
    for (std::size_t input = 0; input < readers_.size(); ++input) FitReader(input);
  }
}

void RosGraph::Dds::FitReader(std::size_t input) {
  const Input& wanted = options_.inputs[input];
  const std::string expected = InfoOf(wanted.type).descriptor->m_typename;
  Reader fitting{0, true, !wanted.is_latched};
  bool is_any = false;
  for (const Publisher& publisher : PublishersOf(input)) {
    if (publisher.type != expected) {
      handlers_.on_other_type(input, publisher.type, expected);
      continue;
    }
    is_any = true;
    fitting.is_reliable = fitting.is_reliable && publisher.is_reliable;
    fitting.is_transient_local = wanted.is_latched ? fitting.is_transient_local || publisher.is_transient_local
                                                   : fitting.is_transient_local && publisher.is_transient_local;
  }
  Reader& reader = readers_[input];
  const bool is_fitting = reader.entity > 0 && reader.is_reliable == fitting.is_reliable &&
                          reader.is_transient_local == fitting.is_transient_local;
  if (!is_any || is_fitting) return;
  if (reader.entity > 0) (void)dds_delete(reader.entity);
  const int depth = wanted.type == Type::kTransforms ? kTfDepth : kInputDepth;
  const Qos qos = MakeQos(wanted.type, depth, fitting.is_reliable, fitting.is_transient_local);
  fitting.entity = dds_create_reader(participant_, TopicOf(wanted.topic, wanted.type), qos.get(), nullptr);
  (void)dds_set_status_mask(fitting.entity, DDS_DATA_AVAILABLE_STATUS);
  (void)dds_waitset_attach(waitset_, fitting.entity, 0);
  reader = fitting;
}

template <typename Message, typename Handle>
void RosGraph::Dds::TakeAll(dds_entity_t reader, const Handle& handle) {
  std::array<void*, kTaken> samples{};
  std::array<dds_sample_info_t, kTaken> infos;
  // At most as many as the history holds, so that a fast publisher does not keep this loop.
  for (std::size_t round = 0; round * kTaken < kTfDepth; ++round) {
    samples.fill(nullptr);
    const dds_return_t count = dds_take(reader, samples.data(), infos.data(), kTaken, kTaken);
    for (dds_return_t i = 0; i < count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (infos[at].valid_data) handle(FromDds(*static_cast<const Message*>(samples[at]), options_.epoch_ns));
    }
    if (count > 0) (void)dds_return_loan(reader, samples.data(), count);
    if (count < static_cast<dds_return_t>(kTaken)) break;
  }
}

void RosGraph::Dds::Take(std::size_t input) {
  const dds_entity_t reader = readers_[input].entity;
  if (reader <= 0) return;
  switch (options_.inputs[input].type) {
    case Type::kOdometry:
      return TakeAll<nav_msgs_msg_dds__Odometry_>(
          reader, [&](const RosOdometry& message) { handlers_.on_odometry(input, message); });
    case Type::kScan:
      return TakeAll<sensor_msgs_msg_dds__LaserScan_>(
          reader, [&](RosScan message) { handlers_.on_scan(input, std::move(message)); });
    case Type::kGrid:
      return TakeAll<nav_msgs_msg_dds__OccupancyGrid_>(
          reader, [&](RosGrid message) { handlers_.on_grid(input, std::move(message)); });
    case Type::kTransforms:
      return TakeAll<tf2_msgs_msg_dds__TFMessage_>(reader, [&](const std::vector<RosTransform>& transforms) {
        for (const RosTransform& transform : transforms) handlers_.on_transform(input, transform);
      });
  }
}

Result<void> RosGraph::Dds::RewriteMapForNewReaders() {
  if (map_writer_ <= 0) return {};
  dds_publication_matched_status_t status{};
  if (dds_get_publication_matched_status(map_writer_, &status) != DDS_RETCODE_OK) return {};
  is_map_due_ = is_map_due_ || status.total_count_change > 0;
  const auto now = std::chrono::steady_clock::now();
  if (!is_map_due_ || map_.values.empty() || now < map_retry_) return {};
  return WriteMap(RosGrid(map_));
}

Result<void> RosGraph::Dds::WriteMap(const RosGrid& grid) {
  map_ = grid;
  const dds_return_t written =
      WithDds(map_, options_.epoch_ns, [this](const auto& message) { return dds_write(map_writer_, &message); });
  is_map_due_ = written != DDS_RETCODE_OK;
  map_retry_ = std::chrono::steady_clock::now() + kMapRetry;
  if (written == DDS_RETCODE_OK) return {};
  return tl::unexpected(ErrorOf(written, options_.map_topic));
}

Result<void> RosGraph::Dds::WriteTransform(const RosTransform& transform) {
  const dds_return_t written =
      WithDds(transform, options_.epoch_ns, [this](const auto& message) { return dds_write(tf_writer_, &message); });
  if (written == DDS_RETCODE_OK) return {};
  return tl::unexpected(ErrorOf(written, options_.tf_topic));
}

std::vector<RosGraph::Publisher> RosGraph::Dds::PublishersOf(std::size_t input) const {
  const std::string name = DdsTopic(options_.inputs[input].topic);
  std::vector<Publisher> found;
  for (const auto& [key, publisher] : publishers_) {
    if (publisher.topic == name) found.push_back(publisher.publisher);
  }
  return found;
}

bool RosGraph::Dds::IsPublishedByOthers(const std::string& topic) const {
  const std::string name = DdsTopic(topic);
  return std::ranges::any_of(publishers_, [&name](const auto& found) { return found.second.topic == name; });
}

Result<std::unique_ptr<RosGraph>> RosGraph::Join(Options options, Handlers handlers) {
  auto dds = std::make_unique<Dds>(std::move(options), std::move(handlers));
  if (const Result<void> joined = dds->Join(); !joined) return tl::unexpected(joined.error());
  return std::unique_ptr<RosGraph>(new RosGraph(std::move(dds)));
}

RosGraph::RosGraph(std::unique_ptr<Dds> dds) : dds_(std::move(dds)) {}
RosGraph::~RosGraph() = default;
void RosGraph::Spin(std::chrono::milliseconds timeout) { dds_->Spin(timeout); }
Result<void> RosGraph::WriteMap(const RosGrid& grid) { return dds_->WriteMap(grid); }
Result<void> RosGraph::WriteTransform(const RosTransform& transform) { return dds_->WriteTransform(transform); }
std::vector<RosGraph::Publisher> RosGraph::PublishersOf(std::size_t input) const { return dds_->PublishersOf(input); }
bool RosGraph::IsPublishedByOthers(const std::string& topic) const { return dds_->IsPublishedByOthers(topic); }

}  // namespace moondb
