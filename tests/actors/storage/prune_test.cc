#include "actors/storage/prune.h"

#include <gtest/gtest.h>

#include <set>

#include "actors/storage/record_validator.h"
#include "actors/storage/verify.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

constexpr std::int64_t kDay_ns = 86'400'000'000'000;
constexpr std::int64_t kNow_ns = 20'000 * kDay_ns;

proto::Record Aged(proto::Record record, std::int64_t days) {
  record.set_timestamp_ns(kNow_ns - days * kDay_ns);
  return record;
}

proto::Record SoilOf(std::int64_t days, const std::string& payload = "dust") {
  return Aged(CustomRecordOf(1000, payload), days);
}

// The stores of a rover (agent 1), its leader (2) and the survivor (3). BringAll sends the rover's records to leader
// and survivor.
class PruneTest : public testing::Test {
 protected:
  void TransferAll() {
    while (Transfer(*store_, *leader_) || Transfer(*store_, *survivor_)) {
    }
  }

  proto::PruneRequest Acknowledged() {
    proto::PruneRequest request;
    proto::HaveRequest question;
    question.set_is_for_peer(true);
    *request.add_acknowledged() = leader_->GetHave(question).have();
    *request.add_acknowledged() = survivor_->GetHave(question).have();
    return request;
  }

  proto::PruneReply Prune(const proto::PruneRequest& request) {
    const Result<proto::PruneReply> reply = store_->Prune(request, kNow_ns);
    if (reply) return *reply;
    ADD_FAILURE() << ToString(reply.error());
    return {};
  }

  static double CountOf(const proto::PruneReply& reply) {
    double count = 0;
    for (const proto::PrunedType& pruned : reply.pruned()) count += pruned.record_count();
    return count;
  }

  static std::set<std::string> PayloadsIn(RecordStore& store) {
    std::set<std::string> payloads;
    for (const proto::StoredRecord& stored : Contents(store)) {
      proto::Record record;
      EXPECT_TRUE(record.ParseFromString(stored.content()));
      if (record.has_custom()) payloads.insert(record.custom().payload());
    }
    return payloads;
  }

  void ExpectSound() {
    for (const auto part : {proto::VERIFY_PART_FILE, proto::VERIFY_PART_ROWS, proto::VERIFY_PART_HELD}) {
      proto::VerifyRequest request;
      request.set_part(part);
      const Result<proto::VerifyReply> reply = store_->Verify(request);
      ASSERT_TRUE(reply) << ToString(reply.error());
      EXPECT_EQ(reply->findings_size(), 0) << reply->DebugString();
    }
  }

  void Reopen() {
    store_.reset();
    store_ = OpenStore(StoreOptionsOf(1, folder_.File("1.db"), 2));
  }

  TemporaryFolder folder_;
  std::unique_ptr<RecordStore> store_ = OpenStore(StoreOptionsOf(1, folder_.File("1.db")));
  std::unique_ptr<RecordStore> leader_ = OpenStore(StoreOptionsOf(2));
  std::unique_ptr<RecordStore> survivor_ = OpenStore(StoreOptionsOf(3));
};

TEST_F(PruneTest, RemovesRecordsThatLeaderAndSurvivorHavePermanently) {
  InsertOne(*store_, SoilOf(3, "a"));
  InsertOne(*store_, Aged(MapRecord({1, 1}), 2));
  TransferAll();
  const proto::PruneReply reply = Prune(Acknowledged());
  EXPECT_TRUE(reply.is_complete());
  EXPECT_EQ(CountOf(reply), 2);
  ASSERT_EQ(reply.pruned_size(), 2);
  EXPECT_EQ(reply.pruned(0).data_type(), proto::LOCAL_TRAVERSABILITY_MAP);
  EXPECT_EQ(reply.pruned(0).content_bytes(), static_cast<double>(SerializeRecord(MapRecord({1, 1})).size() + 9));
  EXPECT_TRUE(Contents(*store_).empty());
  EXPECT_EQ(store_->GetStatus()->pruned_count(), 2);
  ExpectSound();
  Reopen();
  EXPECT_TRUE(Contents(*store_).empty());
  EXPECT_FALSE(Transfer(*leader_, *store_)) << "it asks for them again";
  ExpectSound();
}

TEST_F(PruneTest, KeepsRecordsForTheGroundStationThatAreInNoBundleYet) {
  RecordStore::Options options = StoreOptionsOf(1);
  options.for_ground = {1000, proto::AGENT_EVENT};
  store_ = OpenStore(options);
  InsertOne(*store_, SoilOf(3, "in a bundle"));
  proto::SaveBundleRequest bundle;
  bundle.mutable_bundle()->set_number(1);
  bundle.set_file("file");
  *bundle.mutable_have() = store_->GetHave().have();
  ASSERT_TRUE(store_->SaveBundle(bundle));
  InsertOne(*store_, SoilOf(3, "in none"));
  proto::Record event;
  event.mutable_agent_event()->set_kind(proto::EVENT_KIND_STARTED);
  event.mutable_agent_event()->set_text("of a type that no bundle has held yet");
  InsertOne(*store_, Aged(event, 3));
  // The ground station does not request maps.
  InsertOne(*store_, Aged(MapRecord({1, 1}), 3));
  TransferAll();
  const proto::PruneReply reply = Prune(Acknowledged());
  EXPECT_EQ(CountOf(reply), 2);
  EXPECT_EQ(reply.unacknowledged_count(), 2);
  EXPECT_EQ(PayloadsIn(*store_), std::set<std::string>{"in none"});
}

TEST_F(PruneTest, KeepsRecordsThatLeaderOrSurvivorLacks) {
  InsertOne(*store_, SoilOf(3, "both"));
  TransferAll();
  InsertOne(*store_, SoilOf(2, "leader only"));
  while (Transfer(*store_, *leader_)) {
  }
  InsertOne(*store_, SoilOf(1, "nobody"));
  const proto::PruneReply reply = Prune(Acknowledged());
  EXPECT_EQ(CountOf(reply), 1);
  EXPECT_EQ(reply.unacknowledged_count(), 2);
  EXPECT_EQ(PayloadsIn(*store_), (std::set<std::string>{"leader only", "nobody"}));
}

TEST_F(PruneTest, CountsRecordsThatAPeerPrunedAsCovered) {
  InsertOne(*store_, SoilOf(3));
  TransferAll();
  proto::PruneRequest request;
  *request.add_acknowledged() = store_->GetHave().have();
  ASSERT_TRUE(leader_->Prune(request, kNow_ns));
  EXPECT_TRUE(Contents(*leader_).empty());
  EXPECT_EQ(CountOf(Prune(Acknowledged())), 1);
}

TEST_F(PruneTest, PeersKeepRecordsThatItPruned) {
  InsertOne(*store_, SoilOf(3, "a"));
  InsertOne(*store_, SoilOf(1, "b"));
  TransferAll();
  proto::PruneRequest request = Acknowledged();
  request.set_older_than_s(2 * 86400);
  EXPECT_EQ(CountOf(Prune(request)), 1);
  InsertOne(*store_, SoilOf(0, "c"));
  TransferAll();
  EXPECT_EQ(PayloadsIn(*leader_), (std::set<std::string>{"a", "b", "c"}));
  EXPECT_EQ(PayloadsIn(*survivor_), (std::set<std::string>{"a", "b", "c"}));
}

// The team file of `carrier` does not declare the type. `carrier` therefore accepts reports of dropped records of this
// type from any sender.
TEST_F(PruneTest, ACarrierKeepsRecordsThatAPeerPruned) {
  RecordStore::Options options = StoreOptionsOf(9);
  options.custom_types.Clear();
  const auto carrier = OpenStore(options);
  InsertOne(*store_, SoilOf(3, "a"));
  InsertOne(*store_, SoilOf(1, "b"));
  TransferAll();
  while (Transfer(*store_, *carrier)) {
  }
  proto::PruneRequest request = Acknowledged();
  request.set_older_than_s(2 * 86400);
  EXPECT_EQ(CountOf(Prune(request)), 1);
  InsertOne(*store_, SoilOf(0, "c"));
  while (Transfer(*store_, *carrier)) {
  }
  EXPECT_EQ(PayloadsIn(*carrier), (std::set<std::string>{"a", "b", "c"}));
}

TEST_F(PruneTest, IgnoresAPrunedRecordThatArrivesAgain) {
  const RecordKey key = FromProto(InsertOne(*store_, SoilOf(3)));
  TransferAll();
  EXPECT_EQ(CountOf(Prune(Acknowledged())), 1);
  const proto::StoreReply reply = StoreOne(*store_, Packed(key, SoilOf(3)));
  EXPECT_EQ(reply.stored_count(), 0u);
  EXPECT_EQ(reply.rejected_count(), 0u);
  EXPECT_TRUE(FromProto(reply.covered())->Get(key.stream).Covered().Contains(key.seq)) << "it is sent permanently";
  EXPECT_TRUE(Contents(*store_).empty());
}

TEST_F(PruneTest, RestoresRecordsThatPeersHoldToAnEmptyDisk) {
  InsertOne(*store_, SoilOf(3, "a"));
  TransferAll();
  EXPECT_EQ(CountOf(Prune(Acknowledged())), 1);
  store_ = OpenStore(StoreOptionsOf(1, ":memory:", 3));
  while (Transfer(*leader_, *store_)) {
  }
  EXPECT_EQ(PayloadsIn(*store_), std::set<std::string>{"a"});
}

TEST_F(PruneTest, PrunesRecordsOlderThanTheGivenAge) {
  for (const int days : {40, 31, 29, 1}) InsertOne(*store_, SoilOf(days, std::to_string(days)));
  TransferAll();
  proto::PruneRequest request = Acknowledged();
  request.set_older_than_s(30 * 86400);
  const proto::PruneReply reply = Prune(request);
  EXPECT_EQ(CountOf(reply), 2);
  EXPECT_EQ(reply.unacknowledged_count(), 0);
  EXPECT_EQ(PayloadsIn(*store_), (std::set<std::string>{"1", "29"}));
}

TEST_F(PruneTest, CountsOnlyOldRecordsAsKept) {
  InsertOne(*store_, SoilOf(31));
  InsertOne(*store_, SoilOf(29));
  proto::PruneRequest request = Acknowledged();
  request.set_older_than_s(30 * 86400);
  EXPECT_EQ(Prune(request).unacknowledged_count(), 1);
}

TEST_F(PruneTest, KeepsRecordsTimestampedByASuspectClock) {
  proto::Record suspect = SoilOf(40, "suspect");
  suspect.set_is_clock_suspect(true);
  InsertOne(*store_, suspect);
  InsertOne(*store_, SoilOf(40, "sure"));
  TransferAll();
  proto::PruneRequest request = Acknowledged();
  request.set_older_than_s(30 * 86400);
  EXPECT_EQ(CountOf(Prune(request)), 1);
  EXPECT_EQ(PayloadsIn(*store_), std::set<std::string>{"suspect"});
}

TEST_F(PruneTest, PrunesTheOldestFirstUntilTheGivenSizeIsReached) {
  for (const int days : {1, 4, 2, 3}) InsertOne(*store_, SoilOf(days, std::to_string(days)));
  TransferAll();
  proto::PruneRequest request = Acknowledged();
  request.set_content_bytes_max(static_cast<double>(SerializeRecord(SoilOf(4, "4")).size()) + 1);
  const proto::PruneReply reply = Prune(request);
  EXPECT_TRUE(reply.is_complete());
  EXPECT_EQ(CountOf(reply), 2);
  EXPECT_EQ(PayloadsIn(*store_), (std::set<std::string>{"1", "2"}));
}

TEST_F(PruneTest, CountsWithoutRemovingInADryRun) {
  for (int i = 0; i < 3; ++i) InsertOne(*store_, SoilOf(i));
  TransferAll();
  const proto::HaveSet before = store_->GetHave().have();
  proto::PruneRequest request = Acknowledged();
  request.set_is_dry_run(true);
  EXPECT_EQ(CountOf(Prune(request)), 3);
  EXPECT_EQ(Contents(*store_).size(), 3u);
  EXPECT_EQ(store_->GetHave().have().SerializeAsString(), before.SerializeAsString());
  EXPECT_EQ(store_->GetStatus()->pruned_count(), 0);
}

TEST_F(PruneTest, ContinuesWhereABoundedRequestEnded) {
  std::vector<proto::Record> records;
  for (std::size_t i = 0; i < kPruneRowsMax + 10; ++i) records.push_back(SoilOf(1, std::to_string(i)));
  EXPECT_FALSE(IsError(InsertAll(*store_, records).error()));
  TransferAll();
  proto::PruneRequest dry = Acknowledged();
  dry.set_is_dry_run(true);
  EXPECT_EQ(CountOf(Prune(dry)), kPruneRowsMax + 10);
  const proto::PruneReply first = Prune(Acknowledged());
  EXPECT_EQ(CountOf(first), kPruneRowsMax);
  EXPECT_FALSE(first.is_complete());
  const proto::PruneReply second = Prune(Acknowledged());
  EXPECT_EQ(CountOf(second), 10);
  EXPECT_TRUE(second.is_complete());
}

TEST_F(PruneTest, KeepsStatesLocalRecordsAndThePoseGraph) {
  InsertOne(*store_, Aged(TemperatureRecord(20), 50));
  InsertOne(*store_, SoilOf(50, "local"), /*is_local=*/true);
  InsertOne(*store_, Aged(NodeRecord(1, 1), 50));
  InsertOne(*store_, Aged(RangeRecord({1, 1}, {2, 1}, 3), 50));
  TransferAll();
  EXPECT_EQ(CountOf(Prune(Acknowledged())), 0);
  EXPECT_EQ(Contents(*store_).size(), 4u);
  proto::PruneRequest named = Acknowledged();
  named.add_data_types(proto::POSE_GRAPH_EDGE);
  named.add_data_types(proto::TEMPERATURE);
  const proto::PruneReply reply = Prune(named);
  ASSERT_EQ(reply.pruned_size(), 1);
  EXPECT_EQ(reply.pruned(0).data_type(), proto::POSE_GRAPH_EDGE);
}

TEST_F(PruneTest, PrunesOnlyNamedRecordsIfSomeAreNamed) {
  const proto::RecordKey first = InsertOne(*store_, SoilOf(3, "first"));
  InsertOne(*store_, SoilOf(3, "second"));
  TransferAll();
  proto::PruneRequest request = Acknowledged();
  *request.add_records() = first;
  proto::RecordKey never = first;
  never.set_seq(77);
  *request.add_records() = never;
  never.set_seq(0);
  *request.add_records() = never;
  EXPECT_EQ(CountOf(Prune(request)), 1);
  EXPECT_EQ(PayloadsIn(*store_), std::set<std::string>{"second"});
}

TEST_F(PruneTest, RefusesAnInvalidRequest) {
  const auto field_of = [&](const proto::PruneRequest& request) {
    const Result<proto::PruneReply> reply = store_->Prune(request, kNow_ns);
    EXPECT_FALSE(reply);
    return reply ? "" : reply.error().field;
  };
  EXPECT_EQ(field_of({}), "acknowledged");
  proto::PruneRequest request = Acknowledged();
  request.set_older_than_s(-1);
  EXPECT_EQ(field_of(request), "older_than_s");
  request = Acknowledged();
  request.set_content_bytes_max(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(field_of(request), "content_bytes_max");
  request = Acknowledged();
  for (int i = 0; i <= kPruneNamedMax; ++i) (void)request.add_records();
  EXPECT_EQ(field_of(request), "records");
  request = Acknowledged();
  (void)request.mutable_acknowledged(0)->add_streams();
  EXPECT_FALSE(store_->Prune(request, kNow_ns));
}

TEST_F(PruneTest, NumbersNewRecordsAfterPrunedOnes) {
  const proto::RecordKey pruned = InsertOne(*store_, SoilOf(3));
  TransferAll();
  EXPECT_EQ(CountOf(Prune(Acknowledged())), 1);
  const proto::RecordKey next = InsertOne(*store_, SoilOf(3));
  EXPECT_EQ(next.epoch(), pruned.epoch());
  EXPECT_EQ(next.seq(), pruned.seq() + 1);
}

TEST_F(PruneTest, StoresAPrunedNodeThatIsInsertedAgainAsANewRecord) {
  const proto::RecordKey pruned = InsertOne(*store_, NodeRecord(1, 7));
  TransferAll();
  proto::PruneRequest request = Acknowledged();
  request.add_data_types(proto::POSE_GRAPH_NODE);
  EXPECT_EQ(CountOf(Prune(request)), 1);
  const proto::RecordKey again = InsertOne(*store_, NodeRecord(1, 7));
  EXPECT_NE(again.seq(), pruned.seq());
  TransferAll();
}

// Prunes every second record of a stream, which leaves holes.
TEST_F(PruneTest, ReportsAStreamWithHolesToPeersAsOneInterval) {
  proto::PruneRequest named;
  for (int i = 0; i < 20; ++i) {
    const proto::RecordKey key = InsertOne(*store_, SoilOf(3));
    if (i % 2 == 0) *named.add_records() = key;
  }
  TransferAll();
  *named.mutable_acknowledged() = Acknowledged().acknowledged();
  EXPECT_EQ(CountOf(Prune(named)), 10);
  proto::HaveRequest question;
  question.set_is_for_peer(true);
  EXPECT_EQ(FromProto(store_->GetHave(question).have())->IntervalCount(), 1u);
}

TEST_F(PruneTest, RemembersPrunedRecordsWhenAnotherRowIsDamaged) {
  InsertOne(*store_, SoilOf(3, "pruned"));
  TransferAll();
  EXPECT_EQ(CountOf(Prune(Acknowledged())), 1);
  InsertOne(*store_, SoilOf(3, "damaged"));
  TransferAll();
  ASSERT_TRUE(
      store_->database().Execute("UPDATE custom_record SET content = x'00', payload_at = 0, payload_bytes = 0"));
  Reopen();
  EXPECT_TRUE(Contents(*store_).empty());
  while (Transfer(*leader_, *store_)) {
  }
  EXPECT_EQ(PayloadsIn(*store_), std::set<std::string>{"damaged"});
}

TEST_F(PruneTest, CountsTheBytesOfMaps) {
  const double bytes = static_cast<double>(SerializeRecord(MapRecord({1, 1})).size());
  const proto::RecordKey first = InsertOne(*store_, MapRecord({1, 1}));
  InsertOne(*store_, MapRecord({1, 1}), /*is_local=*/true);
  EXPECT_EQ(store_->GetStatus()->map_bytes(), 2 * bytes);
  TransferAll();
  EXPECT_EQ(leader_->GetStatus()->map_bytes(), bytes);
  proto::PruneRequest request = Acknowledged();
  *request.add_records() = first;
  EXPECT_EQ(CountOf(Prune(request)), 1);
  EXPECT_EQ(store_->GetStatus()->map_bytes(), bytes);
  Reopen();
  EXPECT_EQ(store_->GetStatus()->map_bytes(), bytes);
}

TEST_F(PruneTest, FreesSpaceThatNewRecordsReuse) {
  const std::string payload(60, 'x');
  std::vector<proto::Record> records(3000, SoilOf(3, payload));
  EXPECT_FALSE(IsError(InsertAll(*store_, records).error()));
  TransferAll();
  const auto used = [&] { return store_->GetStatus()->database_bytes() - store_->GetStatus()->wal_bytes(); };
  ASSERT_TRUE(store_->database().Execute("PRAGMA wal_checkpoint(TRUNCATE)"));
  const double before = used();
  while (!Prune(Acknowledged()).is_complete()) {
  }
  ASSERT_TRUE(store_->database().Execute("PRAGMA wal_checkpoint(TRUNCATE)"));
  EXPECT_LT(used(), before / 2);
}

TEST_F(PruneTest, BeyondTheBudgetRefusesOwnMapsButStoresStates) {
  RecordStore::Options options = StoreOptionsOf(1);
  options.path = folder_.File("budget.db");
  options.map_store_bytes_max = 1;
  const auto store = OpenStore(options);
  const proto::InsertReply map = InsertAll(*store, {MapRecord({1, 1})});
  EXPECT_EQ(map.error().code(), ToProto(Error{ErrorCode::kFull, "", ""}).code()) << map.DebugString();
  EXPECT_NE(map.error().text().find("retention.store_mb_max"), std::string::npos);
  EXPECT_FALSE(IsError(InsertAll(*store, {TemperatureRecord(1), NodeRecord(1, 1)}).error()));
}

TEST_F(PruneTest, OnlyLeaderAndSurvivorTakeOthersMapsBeyondTheBudget) {
  RecordStore::Options options = StoreOptionsOf(1);
  options.path = folder_.File("others.db");
  options.map_store_bytes_max = 1;
  EXPECT_EQ(OpenStore(options)->CheckRoomForOthersMaps().error().code, ErrorCode::kFull);
  options.authority.roles.initial.set_leader(1);
  EXPECT_TRUE(OpenStore(options)->CheckRoomForOthersMaps());
  options.authority.roles.initial.set_leader(2);
  options.map_store_bytes_max = 100 * 1000 * 1000;
  EXPECT_TRUE(OpenStore(options)->CheckRoomForOthersMaps());
}

}  // namespace
}  // namespace moondb
