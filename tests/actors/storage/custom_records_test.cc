// Tests records of custom data types. The store's team file declares some of these types. If a type is not declared,
// the store only passes on other agents' records of the type.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/record_check.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

constexpr DataType kSoil = 1000;
constexpr DataType kBeacon = 1001;
constexpr DataType kUndeclared = 1500;

std::int64_t Number(RecordStore& store, const std::string& sql) { return *store.database().Number(sql); }

std::string Text(RecordStore& store, const std::string& sql) {
  Query query = store.database().Prepare(sql);
  const Result<bool> row = query.Step();
  return row && *row ? std::string(query.Bytes(0)) : "no row";
}

std::string InsertError(RecordStore& store, const proto::Record& record) {
  return ToString(FromProto(InsertAll(store, {record}).error()));
}

std::vector<std::string> PayloadsOf(const google::protobuf::RepeatedPtrField<proto::StoredRecord>& records) {
  std::vector<std::string> payloads;
  for (const proto::StoredRecord& stored : records) {
    proto::Record record;
    EXPECT_TRUE(record.ParseFromString(stored.content()));
    payloads.push_back(record.custom().payload());
  }
  return payloads;
}

std::vector<std::string> PayloadsOf(RecordStore& store, DataType type) {
  proto::ReadRequest request;
  request.add_data_types(type);
  return PayloadsOf(store.Read(request)->records());
}

void TransferAll(RecordStore& from, RecordStore& to) {
  while (Transfer(from, to)) {
  }
}

// Returns options of a store whose team file declares no custom type.
RecordStore::Options WithoutTypes(AgentId self, const std::string& path = ":memory:") {
  RecordStore::Options options = StoreOptionsOf(self, path);
  options.custom_types.Clear();
  return options;
}

TEST(CustomRecordsTest, StoresAndReadsRecordsByType) {
  auto store = OpenStore(StoreOptionsOf(2));
  const std::string bytes("\0\xFF\x01", 3);
  const proto::RecordKey first = InsertOne(*store, CustomRecordOf(kSoil, bytes, std::string("k\0", 2)));
  InsertOne(*store, TemperatureRecord(1));
  InsertOne(*store, CustomRecordOf(kBeacon, "b"));
  const proto::RecordKey second = InsertOne(*store, CustomRecordOf(kSoil, ""));
  EXPECT_EQ(first.data_type(), kSoil);
  EXPECT_EQ(first.seq(), 1u);
  EXPECT_EQ(second.seq(), 2u);
  EXPECT_THAT(PayloadsOf(*store, kSoil), testing::ElementsAre(bytes, ""));
  EXPECT_THAT(PayloadsOf(*store, kBeacon), testing::ElementsAre("b"));
  EXPECT_TRUE(PayloadsOf(*store, kUndeclared).empty());
  EXPECT_EQ(Contents(*store).size(), 4u);
}

TEST(CustomRecordsTest, SerialisesToTheBytesThatPeersExpect) {
  proto::Record record = CustomRecordOf(kSoil, "wet", "k");
  record.mutable_custom()->set_metadata("m");
  const proto::StoredRecord stored = Packed({{2, 77, kSoil}, 1}, record);
  EXPECT_EQ(stored.content(), std::string("\x09\x05\0\0\0\0\0\0\0"                      // timestamp_ns 5
                                          "\xA2\x06\x0E"                                // custom
                                          "\x08\xE8\x07\x12\x01k\x1A\x03wet\x22\x01m",  // its four fields
                                          26));
}

TEST(CustomRecordsTest, ShowsRecordsToSql) {
  auto store = OpenStore(StoreOptionsOf(2));
  proto::Record record = CustomRecordOf(kSoil, "wet", "hole 3");
  record.mutable_custom()->set_metadata("percent");
  const proto::RecordKey key = InsertOne(*store, record);
  InsertOne(*store, CustomRecordOf(kSoil, "local"), /*is_local=*/true);
  const std::string one = " FROM v_custom_record WHERE type = 'soil' AND latest_key = CAST('hole 3' AS BLOB)";
  EXPECT_EQ(Text(*store, "SELECT payload" + one), "wet");
  EXPECT_EQ(Text(*store, "SELECT metadata" + one), "percent");
  EXPECT_EQ(Text(*store, "SELECT record_id" + one), ToString(FromProto(key)));
  EXPECT_EQ(Number(*store, "SELECT agent_id" + one), 2);
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM v_custom_record WHERE record_id IS NULL"), 1);
  EXPECT_EQ(Text(*store, "SELECT replica_id FROM replica"), ToString(FromProto(key)));
}

TEST(CustomRecordsTest, ReportsTypesOfNewRowsAndCountsThem) {
  auto store = OpenStore(StoreOptionsOf(2));
  proto::InsertRequest request;
  *request.add_records() = CustomRecordOf(kBeacon, "x");
  const proto::RecordsStored stored = store->Insert(request).stored;
  EXPECT_THAT(stored.data_types(), testing::ElementsAre(kBeacon));
  InsertOne(*store, CustomRecordOf(kSoil, "a"), /*is_local=*/true);
  InsertOne(*store, CustomRecordOf(kSoil, "b"));
  std::map<DataType, double> counts;
  const proto::StorageStatus status = *store->GetStatus();
  for (const proto::RecordCount& count : status.counts()) counts[count.data_type()] += count.count();
  EXPECT_THAT(counts, testing::ElementsAre(testing::Pair(kSoil, 2), testing::Pair(kBeacon, 1)));
}

TEST(CustomRecordsTest, RefusesOwnRecordsOfAnUndeclaredTypeOrSize) {
  auto store = OpenStore(StoreOptionsOf(2));
  EXPECT_EQ(InsertError(*store, CustomRecordOf(kUndeclared, "x")),
            "records[0].custom.data_type: no custom type 1500; known are soil (1000), beacon (1001)");
  EXPECT_EQ(InsertError(*store, CustomRecordOf(kSoil, std::string(65, 'x'))),
            "records[0].custom.payload: has 65 bytes; soil allows 64");
  EXPECT_EQ(InsertError(*store, CustomRecordOf(kSoil, "x", std::string(257, 'k'))),
            "records[0].custom.latest_key: is longer than 256 bytes");
  EXPECT_EQ(InsertError(*store, CustomRecordOf(proto::POWER, "x")),
            "records[0].custom.data_type: must be 1000 to 1999");
  EXPECT_TRUE(Contents(*store).empty());
}

TEST(CustomRecordsTest, RejectsAKeyWhoseTypeDiffersFromTheContents) {
  auto store = OpenStore(StoreOptionsOf(1));
  for (const DataType type : {kBeacon, static_cast<DataType>(proto::POWER), DataType{2000}}) {
    const RecordKey key{StreamKey{2, 77, type}, 1};
    EXPECT_EQ(StoreOne(*store, Packed(key, CustomRecordOf(kSoil, "x"))).rejected_count(), 1u) << type;
  }
  EXPECT_TRUE(Contents(*store).empty());
}

TEST(CustomRecordsTest, KeepsTheNewestOfEachKeyOfALatestType) {
  auto origin = OpenStore(StoreOptionsOf(2));
  auto leader = OpenStore(StoreOptionsOf(1));
  InsertOne(*origin, CustomRecordOf(kBeacon, "a1", "a"));
  InsertOne(*origin, CustomRecordOf(kBeacon, "b1", "b"));
  // A soil record with the same latest_key supersedes no beacon record.
  InsertOne(*origin, CustomRecordOf(kSoil, "soil", "a"));
  TransferAll(*origin, *leader);
  InsertOne(*origin, CustomRecordOf(kBeacon, "a2", "a"));
  TransferAll(*origin, *leader);
  for (RecordStore* store : {origin.get(), leader.get()}) {
    EXPECT_THAT(PayloadsOf(*store, kBeacon), testing::ElementsAre("b1", "a2"));
    EXPECT_THAT(PayloadsOf(*store, kSoil), testing::ElementsAre("soil"));
  }
  EXPECT_EQ(leader->GetHave().have().SerializeAsString(), origin->GetHave().have().SerializeAsString());
}

TEST(CustomRecordsTest, SendsRecordsByPriorityBetweenPosesAndMaps) {
  RecordStore::Options options = StoreOptionsOf(2);
  options.custom_types.Mutable(1)->set_priority(1);
  auto store = OpenStore(options);
  InsertOne(*store, MapRecord({2, 0}));
  InsertOne(*store, CustomRecordOf(kSoil, "x"));
  InsertOne(*store, CustomRecordOf(kBeacon, "x"));
  InsertOne(*store, OptimizedPoseRecord({2, 0}, 1, 1, 0));
  std::vector<DataType> order;
  const proto::MissingReply missing = *store->GetMissing({});
  for (const proto::StoredRecord& record : missing.records()) order.push_back(record.key().data_type());
  EXPECT_THAT(order, testing::ElementsAre(proto::OPTIMIZED_POSE, kBeacon, kSoil, proto::LOCAL_TRAVERSABILITY_MAP));
}

TEST(CustomRecordsTest, CarriesRecordsOfTypesThatItsTeamFileDoesNotDeclare) {
  auto origin = OpenStore(StoreOptionsOf(2));
  auto carrier = OpenStore(WithoutTypes(1));
  auto survivor = OpenStore(StoreOptionsOf(3));
  InsertOne(*origin, CustomRecordOf(kBeacon, "old", "a"));
  InsertOne(*origin, CustomRecordOf(kSoil, "s"));
  TransferAll(*origin, *carrier);
  InsertOne(*origin, CustomRecordOf(kBeacon, "new", "a"));
  TransferAll(*origin, *carrier);
  TransferAll(*carrier, *survivor);
  for (RecordStore* store : {carrier.get(), survivor.get()}) {
    EXPECT_THAT(PayloadsOf(*store, kBeacon), testing::ElementsAre("new"));
    EXPECT_THAT(PayloadsOf(*store, kSoil), testing::ElementsAre("s"));
    EXPECT_EQ(store->GetHave().have().SerializeAsString(), origin->GetHave().have().SerializeAsString());
  }
  EXPECT_EQ(Text(*carrier, "SELECT type FROM v_custom_record WHERE data_type = 1001"), "type_1001");
}

TEST(CustomRecordsTest, AcceptsLargerPayloadsFromPeersThanFromItsOwnRobot) {
  // The payload is one byte larger than the type's limit. The peer may have stored it before the team file lowered the
  // limit, so the record must not be lost.
  auto store = OpenStore(StoreOptionsOf(1));
  const RecordKey key{StreamKey{2, 77, kSoil}, 1};
  EXPECT_EQ(StoreOne(*store, Packed(key, CustomRecordOf(kSoil, std::string(65, 'x')))).stored_count(), 1u);
}

TEST(CustomRecordsTest, KeepsTheRowsOfATypeThatIsNoLongerDeclared) {
  TemporaryFolder folder;
  const std::string path = folder.File("store.db");
  auto peer = OpenStore(StoreOptionsOf(3));
  InsertOne(*peer, CustomRecordOf(kSoil, "of a peer"));
  {
    auto store = OpenStore(StoreOptionsOf(2, path));
    InsertOne(*store, CustomRecordOf(kSoil, "own"));
    TransferAll(*peer, *store);
  }
  auto store = OpenStore(WithoutTypes(2, path));
  EXPECT_THAT(PayloadsOf(*store, kSoil), testing::ElementsAre("own", "of a peer"));
  // The store still sends peers' records of this type. The store does not send its own records of this type, because
  // its team file has no policy for the type.
  EXPECT_THAT(PayloadsOf(store->GetMissing({})->records()), testing::ElementsAre("of a peer"));
  store.reset();
  store = OpenStore(StoreOptionsOf(2, path));
  EXPECT_EQ(store->GetMissing({})->records_size(), 2);
}

TEST(CustomRecordsTest, SendsOnlyTheNewestOfEachKeyIfTheFilterSaysSo) {
  auto store = OpenStore(StoreOptionsOf(1));
  auto base = OpenStore(StoreOptionsOf(9));
  InsertOne(*store, CustomRecordOf(kSoil, "a1", "a"));
  InsertOne(*store, CustomRecordOf(kSoil, "b1", "b"));
  InsertOne(*store, CustomRecordOf(kSoil, "a2", "a"));
  StoreOne(*store, Packed({{2, 9, kSoil}, 4}, CustomRecordOf(kSoil, "of 2, earlier epoch", "a")));
  StoreOne(*store, Packed({{2, 1ULL << 63, kSoil}, 1}, CustomRecordOf(kSoil, "of 2", "a")));
  proto::MissingRequest request;
  request.mutable_filter()->add_newest_only_types(kSoil);
  const proto::MissingReply missing = *store->GetMissing(request);
  EXPECT_THAT(PayloadsOf(missing.records()), testing::UnorderedElementsAre("b1", "a2", "of 2"));
  EXPECT_EQ(missing.remaining(), 0u);
  EXPECT_TRUE(missing.dropped().empty());

  // With pages of one record, the remaining count is also exact, and no record is left out.
  request.set_records_max(1);
  for (const std::uint64_t remaining : {2, 1, 0}) {
    *request.mutable_destination_have() = base->GetHave().have();
    const proto::MissingReply page = *store->GetMissing(request);
    ASSERT_EQ(page.records_size(), 1);
    EXPECT_EQ(page.remaining(), remaining);
    StoreOne(*base, page.records(0));
  }
  *request.mutable_destination_have() = base->GetHave().have();
  EXPECT_TRUE(store->GetMissing(request)->records().empty());
}

}  // namespace
}  // namespace moondb
