// Stores and records for the tests in this folder.
#pragma once

#include <memory>
#include <string>

#include "actors/storage/record_store.h"
#include "tests/temporary_folder.h"

namespace moondb {

// Returns the declaration of a custom type with priority 5 and payloads of at most 64 bytes.
proto::CustomType CustomTypeOf(DataType id, const std::string& name, proto::Policy share);

// Returns options for the store of `self` in a team of agents 1, 2, 3 and 9. States, optimized poses and verdicts have
// policy `latest`, mode has `none`, and all other types have `all`. Declares the custom types soil (1000, policy `all`)
// and beacon (1001, policy `latest`).
RecordStore::Options StoreOptionsOf(AgentId self, const std::string& path = ":memory:", std::uint64_t seed = 1);

// Opens a store. If that fails, returns null and fails the test.
std::unique_ptr<RecordStore> OpenStore(const RecordStore::Options& options);

// Runs SQL in a file without moondb, as another program would.
void RunSql(const std::string& path, const std::string& sql);

proto::Record TemperatureRecord(double celsius);
proto::Record NodeRecord(AgentId agent, std::uint64_t index, double x = 0);
proto::Record RangeRecord(NodeKey from, NodeKey to, double range_m);
proto::Record OptimizedPoseRecord(NodeKey node, std::uint64_t term, std::uint64_t run, double x);
proto::Record MapRecord(NodeKey node);
proto::Record CustomRecordOf(DataType type, const std::string& payload, const std::string& latest_key = {});

// InsertOne expects no error and returns the record's key. InsertAll returns the reply, also if it contains an error.
proto::RecordKey InsertOne(RecordStore& store, const proto::Record& record, bool is_local = false);
proto::InsertReply InsertAll(RecordStore& store, const std::vector<proto::Record>& records);

// Returns the record as a peer sends it under `key`. The record's origin has the policies of StoreOptionsOf.
proto::StoredRecord Packed(const RecordKey& key, proto::Record record);
proto::StoreReply StoreOne(RecordStore& store, const proto::StoredRecord& record);

// Returns all records in `store`, in the order of their row ids.
std::vector<proto::StoredRecord> Contents(RecordStore& store);

// Sends `to` one page of the records of `from` that `to` lacks, with reports of dropped records. Returns false if the
// page was empty.
bool Transfer(RecordStore& from, RecordStore& to, std::uint32_t records_max = 0);

}  // namespace moondb
