// Stored records for the tests of the row and batch codecs.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <string>

#include "model/record_hash.h"
#include "model/record_key.h"
#include "model/traversability_map.h"
#include "proto/record.pb.h"
#include "proto/storage.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/coding/drawn_maps.h"

namespace moondb {

inline constexpr std::int64_t kFirstTimestamp_ns = 1'700'000'000'000'000'000;

inline proto::Record TemperatureRecord(int index) {
  proto::Record record;
  record.set_timestamp_ns(kFirstTimestamp_ns + index * std::int64_t{1'000'000'000});
  record.mutable_temperature()->set_celsius(-20 + std::floor(100 * std::sin(index * 0.01)) / 10);
  return record;
}

inline proto::Record NodeRecord(int index, std::mt19937_64& rng) {
  proto::Record record;
  record.set_timestamp_ns(kFirstTimestamp_ns + index * std::int64_t{10'000'000'000});
  proto::PoseGraphNode& node = *record.mutable_pose_graph_node();
  node.mutable_node()->set_agent_id(2);
  node.mutable_node()->set_index(static_cast<std::uint64_t>(index));
  proto::Pose& pose = *node.mutable_map_from_node();
  pose.mutable_position_m()->set_x(index * 0.5 + static_cast<double>(rng()) * 1e-20);
  pose.mutable_position_m()->set_y(index * 0.1 + static_cast<double>(rng()) * 1e-20);
  pose.mutable_orientation()->set_z(std::sin(index * 0.01));
  pose.mutable_orientation()->set_w(std::cos(index * 0.01));
  return record;
}

// Returns a record of agent 2 with this content and type, a matching hash, and the seq `index` + 1.
inline proto::StoredRecord Store(std::string content, std::uint32_t type, int index) {
  const RecordKey key{{2, 0x5F3C9A1E0B7D4C21u, type}, static_cast<std::uint64_t>(index) + 1};
  proto::StoredRecord stored;
  *stored.mutable_key() = ToProto(key);
  stored.set_hash(HashRecord(key, content));
  stored.set_content(std::move(content));
  return stored;
}

inline proto::StoredRecord MapOf(const Layers& layers, int index) {
  proto::Record record;
  record.set_timestamp_ns(kFirstTimestamp_ns + index);
  *record.mutable_local_traversability_map() =
      ToProto(TraversabilityMap{{2, static_cast<std::uint64_t>(index)}, Pose::FromPlanar(0.2, 0, 0), layers});
  return Store(record.SerializeAsString(), proto::LOCAL_TRAVERSABILITY_MAP, index);
}

// Returns `count` maps of a robot that drives through a room and turns. `first` is the index of the first map.
inline proto::RecordBatch MapBatch(int first, int count) {
  proto::RecordBatch batch;
  for (int i = first; i < first + count; ++i) *batch.add_records() = MapOf(RoomMap(7, -2 + 0.3 * i, 0, 0.4 * i), i);
  return batch;
}

inline proto::RecordBatch RowBatch(int count) {
  proto::RecordBatch batch;
  for (int i = 0; i < count; ++i) {
    *batch.add_records() = Store(TemperatureRecord(i).SerializeAsString(), proto::TEMPERATURE, i);
  }
  return batch;
}

}  // namespace moondb
