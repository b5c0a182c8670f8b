#include "tests/actors/storage/store_fixtures.h"

#include <gtest/gtest.h>
#include <sqlite3.h>
#include <stdlib.h>

#include "actors/storage/record_validator.h"
#include "model/record_hash.h"
#include "proto/types.pb.h"

namespace moondb {

namespace {

constexpr DataType kBeacon = 1001;

bool IsOfLatest(DataType type) {
  return type < proto::POSE_GRAPH_NODE || type == proto::OPTIMIZED_POSE || type == proto::EDGE_VERDICT ||
         type == proto::MAP_MATCH || type == kBeacon;
}

void SetPose(double x, proto::Pose& pose) {
  pose.mutable_position_m()->set_x(x);
  pose.mutable_position_m()->set_y(0);
  pose.mutable_orientation()->set_w(1);
}

}  // namespace

proto::CustomType CustomTypeOf(DataType id, const std::string& name, proto::Policy share) {
  proto::CustomType type;
  type.set_id(id);
  type.set_name(name);
  type.set_share(share);
  type.set_ground(proto::POLICY_NONE);
  type.set_priority(5);
  type.set_bytes_max(64);
  return type;
}

RecordStore::Options StoreOptionsOf(AgentId self, const std::string& path, std::uint64_t seed) {
  RecordStore::Options options;
  options.path = path;
  options.self = self;
  options.team = {1, 2, 3, 9};
  options.seed = seed * 1000 + self;
  for (const DataType type : BuiltInDataTypes()) {
    options.policies[type] = IsOfLatest(type) ? proto::POLICY_LATEST : proto::POLICY_ALL;
  }
  options.policies[proto::MODE] = proto::POLICY_NONE;
  *options.custom_types.Add() = CustomTypeOf(1000, "soil", proto::POLICY_ALL);
  *options.custom_types.Add() = CustomTypeOf(kBeacon, "beacon", proto::POLICY_LATEST);
  return options;
}

std::unique_ptr<RecordStore> OpenStore(const RecordStore::Options& options) {
  Result<std::unique_ptr<RecordStore>> store = RecordStore::Open(options);
  if (!store) {
    ADD_FAILURE() << ToString(store.error());
    return nullptr;
  }
  return *std::move(store);
}

void RunSql(const std::string& path, const std::string& sql) {
  sqlite3* file = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &file), SQLITE_OK);
  char* error = nullptr;
  EXPECT_EQ(sqlite3_exec(file, sql.c_str(), nullptr, nullptr, &error), SQLITE_OK) << (error == nullptr ? "" : error);
  sqlite3_free(error);
  sqlite3_close(file);
}

proto::Record TemperatureRecord(double celsius) {
  proto::Record record;
  record.set_timestamp_ns(1);
  record.mutable_temperature()->set_celsius(celsius);
  return record;
}

proto::Record NodeRecord(AgentId agent, std::uint64_t index, double x) {
  proto::Record record;
  record.set_timestamp_ns(static_cast<std::int64_t>(index));
  *record.mutable_pose_graph_node()->mutable_node() = ToProto(NodeKey{agent, index});
  SetPose(x, *record.mutable_pose_graph_node()->mutable_map_from_node());
  return record;
}

proto::Record RangeRecord(NodeKey from, NodeKey to, double range_m) {
  proto::Record record;
  proto::PoseGraphEdge& edge = *record.mutable_pose_graph_edge();
  *edge.mutable_from() = ToProto(from);
  *edge.mutable_to() = ToProto(to);
  edge.mutable_range()->set_range_m(range_m);
  edge.mutable_range()->set_variance_m2(0.01);
  return record;
}

proto::Record OptimizedPoseRecord(NodeKey node, std::uint64_t term, std::uint64_t run, double x) {
  proto::Record record;
  proto::OptimizedPose& pose = *record.mutable_optimized_pose();
  *pose.mutable_node() = ToProto(node);
  SetPose(x, *pose.mutable_map_from_node());
  pose.mutable_term()->set_number(term);
  pose.mutable_term()->set_issuer(1);
  pose.set_run(run);
  return record;
}

proto::Record MapRecord(NodeKey node) {
  proto::Record record;
  proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
  *map.mutable_node() = ToProto(node);
  SetPose(0, *map.mutable_node_from_map());
  proto::MapLayer& layer = *map.add_layers();
  layer.set_width_cells(4);
  layer.set_height_cells(2);
  layer.set_resolution_um(50'000);
  layer.set_cells(std::string("\x12\x24", 2));
  return record;
}

proto::Record CustomRecordOf(DataType type, const std::string& payload, const std::string& latest_key) {
  proto::Record record;
  record.set_timestamp_ns(5);
  record.mutable_custom()->set_data_type(type);
  record.mutable_custom()->set_payload(payload);
  record.mutable_custom()->set_latest_key(latest_key);
  return record;
}

proto::RecordKey InsertOne(RecordStore& store, const proto::Record& record, bool is_local) {
  proto::InsertRequest request;
  *request.add_records() = record;
  request.set_is_local(is_local);
  const proto::InsertReply reply = store.Insert(request).reply;
  EXPECT_FALSE(IsError(reply.error())) << reply.error().DebugString();
  return reply.keys_size() == 1 ? reply.keys(0) : proto::RecordKey();
}

proto::InsertReply InsertAll(RecordStore& store, const std::vector<proto::Record>& records) {
  proto::InsertRequest request;
  for (const proto::Record& record : records) *request.add_records() = record;
  return store.Insert(request).reply;
}

proto::StoredRecord Packed(const RecordKey& key, proto::Record record) {
  proto::StoredRecord stored;
  *stored.mutable_key() = ToProto(key);
  record.set_is_state(IsOfLatest(key.stream.type));
  stored.set_content(SerializeRecord(record));
  stored.set_hash(HashRecord(key, stored.content()));
  return stored;
}

proto::StoreReply StoreOne(RecordStore& store, const proto::StoredRecord& record) {
  proto::StoreRequest request;
  *request.add_records() = record;
  return store.Store(request).reply;
}

std::vector<proto::StoredRecord> Contents(RecordStore& store) {
  std::vector<proto::StoredRecord> all;
  proto::ReadRequest request;
  request.set_records_max(7);
  while (true) {
    const Result<proto::ReadReply> page = store.Read(request);
    if (!page) {
      ADD_FAILURE() << ToString(page.error());
      return all;
    }
    all.insert(all.end(), page->records().begin(), page->records().end());
    if (page->is_complete()) return all;
    request.set_after_row_id(page->row_ids(page->row_ids_size() - 1));
  }
}

bool Transfer(RecordStore& from, RecordStore& to, std::uint32_t records_max) {
  proto::MissingRequest question;
  *question.mutable_destination_have() = to.GetHave().have();
  question.set_records_max(records_max);
  const Result<proto::MissingReply> missing = from.GetMissing(question);
  if (!missing) {
    ADD_FAILURE() << ToString(missing.error());
    return false;
  }
  proto::StoreRequest store;
  *store.mutable_records() = missing->records();
  *store.mutable_dropped() = missing->dropped();
  const proto::StoreReply reply = to.Store(store).reply;
  EXPECT_FALSE(IsError(reply.error())) << reply.error().DebugString();
  EXPECT_EQ(reply.rejected_count(), 0u);
  return !missing->records().empty() || !missing->dropped().empty();
}

}  // namespace moondb
