// Stores and records for the tests of this folder.
#pragma once

#include <memory>
#include <string>

#include "actors/storage/record_store.h"
#include "tests/temporary_folder.h"

namespace moondb {

// A type as the team file declares it: priority 5, at most 64 bytes.
proto::CustomType CustomTypeOf(DataType id, const std::string& name, proto::Policy share);

// Agents 1, 2, 3 and 9; states, optimized poses and verdicts by `latest`, mode by `none`, the rest by `all`. The custom
// types soil (1000, all) and beacon (1001, latest).
RecordStore::Options StoreOptionsOf(AgentId self, const std::string& path = ":memory:", std::uint64_t seed = 1);

// A failure to open is a failed test.
std::unique_ptr<RecordStore> OpenStore(const RecordStore::Options& options);

proto::Record TemperatureRecord(double celsius);
proto::Record NodeRecord(AgentId agent, std::uint64_t index, double x = 0);
proto::Record RangeRecord(NodeKey from, NodeKey to, double range_m);
proto::Record OptimizedPoseRecord(NodeKey node, std::uint64_t term, std::uint64_t run, double x);
proto::Record MapRecord(NodeKey node);
proto::Record CustomRecordOf(DataType type, const std::string& payload, const std::string& latest_key = {});

// Inserts and expects no error.
proto::RecordKey InsertOne(RecordStore& store, const proto::Record& record, bool is_local = false);
proto::InsertReply InsertAll(RecordStore& store, const std::vector<proto::Record>& records);

// A record as a peer would send it whose origin has the policies of StoreOptionsOf.
proto::StoredRecord Packed(const RecordKey& key, proto::Record record);
proto::StoreReply StoreOne(RecordStore& store, const proto::StoredRecord& record);

// All that `store` holds, oldest first.
std::vector<proto::StoredRecord> Contents(RecordStore& store);

// One page of what `to` lacks goes from `from` to `to`; true when there was any.
bool Bring(RecordStore& from, RecordStore& to, std::uint32_t records_max = 0);

}  // namespace moondb
