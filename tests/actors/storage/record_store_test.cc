#include "actors/storage/record_store.h"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "actors/storage/role_history.h"
#include "model/have_page.h"
#include "model/pose_graph.h"
#include "model/record_hash.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"
#include "tests/sample_record.h"

namespace moondb {
namespace {

constexpr std::uint64_t kEpoch = 77;

RecordKey Key(AgentId origin, DataType type, std::uint64_t seq, std::uint64_t epoch = kEpoch) {
  return RecordKey{StreamKey{origin, epoch, type}, seq};
}

std::int64_t Number(RecordStore& store, const std::string& sql) { return *store.database().Number(sql); }

// Returns what `store` would send to a destination with an empty have-set: records, and which records were dropped.
proto::MissingReply AllOf(RecordStore& store, const proto::RecordFilter& filter = {}) {
  proto::MissingRequest request;
  *request.mutable_filter() = filter;
  return *store.GetMissing(request);
}

proto::StreamHave Dropped(const StreamKey& stream, std::uint64_t first, std::uint64_t last) {
  proto::StreamHave dropped;
  dropped.set_origin_agent(stream.origin);
  dropped.set_epoch(stream.epoch);
  dropped.set_data_type(stream.type);
  dropped.add_dropped()->set_first(first);
  dropped.mutable_dropped(0)->set_last(last);
  return dropped;
}

proto::StoreReply StoreDropped(RecordStore& store, const proto::StreamHave& dropped) {
  proto::StoreRequest request;
  *request.add_dropped() = dropped;
  return store.Store(request).reply;
}

HaveSet HaveOf(const RecordStore& store) { return *FromProto(store.GetHave().have()); }

TEST(RecordStoreTest, NumbersRecordsWithoutGapsWithinEpochAndType) {
  auto store = OpenStore(StoreOptionsOf(2));
  const proto::RecordKey a = InsertOne(*store, NodeRecord(2, 10));
  const proto::RecordKey t = InsertOne(*store, TemperatureRecord(20));
  const proto::RecordKey b = InsertOne(*store, NodeRecord(2, 11));
  EXPECT_EQ(a.seq(), 1u);
  EXPECT_EQ(b.seq(), 2u);
  EXPECT_EQ(t.seq(), 1u);
  EXPECT_EQ(a.epoch() >> 48, 1u);
  EXPECT_EQ(a.epoch(), store->GetHave().epoch());
  EXPECT_EQ(a.origin_agent(), 2u);
}

TEST(RecordStoreTest, HasNoEpochBeforeTheFirstSharedInsert) {
  auto store = OpenStore(StoreOptionsOf(2));
  EXPECT_EQ(store->GetHave().epoch(), 0u);
  EXPECT_EQ(InsertOne(*store, NodeRecord(2, 1), /*is_local=*/true).seq(), 0u);
  EXPECT_EQ(store->GetHave().epoch(), 0u);
  EXPECT_TRUE(store->GetHave().have().streams().empty());
  EXPECT_EQ(Contents(*store).size(), 1u);
}

TEST(RecordStoreTest, KeepsEverythingAcrossARestartAndBeginsAHigherEpoch) {
  TemporaryFolder folder;
  const std::string path = folder.File("store.db");
  std::vector<proto::StoredRecord> before;
  proto::HaveSet have;
  std::uint64_t epoch = 0;
  {
    auto store = OpenStore(StoreOptionsOf(2, path, 1));
    InsertOne(*store, NodeRecord(2, 1));
    InsertOne(*store, TemperatureRecord(1));
    InsertOne(*store, TemperatureRecord(2));
    InsertOne(*store, NodeRecord(2, 2), /*is_local=*/true);
    StoreOne(*store, Packed(Key(3, proto::POSE_GRAPH_NODE, 4), NodeRecord(3, 4)));
    before = Contents(*store);
    have = store->GetHave().have();
    epoch = store->GetHave().epoch();
  }
  // Opens the store with the same random seed, as after restoring a disk image. Only the epoch's counter can then
  // differ.
  auto store = OpenStore(StoreOptionsOf(2, path, 1));
  EXPECT_EQ(store->GetHave().have().SerializeAsString(), have.SerializeAsString());
  const std::vector<proto::StoredRecord> after = Contents(*store);
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < after.size(); ++i) {
    EXPECT_EQ(after[i].SerializeAsString(), before[i].SerializeAsString());
  }
  const proto::RecordKey next = InsertOne(*store, NodeRecord(2, 3));
  EXPECT_GT(next.epoch() >> 48, epoch >> 48);
  EXPECT_EQ(next.seq(), 1u);
}

TEST(RecordStoreTest, NeverUsesARowNumberTwice) {
  TemporaryFolder folder;
  auto options = StoreOptionsOf(2, folder.File("store.db"));
  auto store = OpenStore(options);
  InsertOne(*store, TemperatureRecord(1));
  const std::int64_t last = Number(*store, "SELECT max(row_id) FROM temperature");
  ASSERT_TRUE(store->database().Execute("DELETE FROM temperature"));
  store.reset();
  store = OpenStore(options);
  InsertOne(*store, NodeRecord(2, 1));
  EXPECT_GT(Number(*store, "SELECT max(row_id) FROM pose_graph_node"), last);
}

proto::Record OdometryRecord(AgentId agent, std::uint64_t from, std::uint64_t to) {
  proto::Record record;
  proto::PoseGraphEdge& edge = *record.mutable_pose_graph_edge();
  edge.mutable_from()->set_agent_id(agent);
  edge.mutable_from()->set_index(from);
  edge.mutable_to()->set_agent_id(agent);
  edge.mutable_to()->set_index(to);
  edge.mutable_relative_pose()->mutable_from_from_to()->mutable_position_m()->set_x(1);
  edge.mutable_relative_pose()->mutable_from_from_to()->mutable_orientation()->set_w(1);
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) {
      edge.mutable_relative_pose()->add_covariance(row == column ? 0.01 : 0);
    }
  }
  return record;
}

TEST(RecordStoreTest, AFailedInsertLeavesNoNode) {
  auto store = OpenStore(StoreOptionsOf(2));
  proto::InsertRequest request;
  *request.add_records() = NodeRecord(2, 5);
  *request.add_records() = OdometryRecord(2, 1, 9);
  EXPECT_TRUE(IsError(store->Insert(request).reply.error()));
  InsertOne(*store, OdometryRecord(2, 1, 9));
}

TEST(RecordStoreTest, RefusesOwnOdometryThatSkipsANode) {
  auto store = OpenStore(StoreOptionsOf(2));
  const auto insert = [&store](const std::vector<proto::Record>& records) {
    proto::InsertRequest request;
    for (const proto::Record& record : records) *request.add_records() = record;
    return store->Insert(request).reply;
  };
  EXPECT_FALSE(
      IsError(insert({NodeRecord(2, 1), NodeRecord(2, 4), NodeRecord(2, 9), OdometryRecord(2, 1, 4)}).error()));
  EXPECT_FALSE(IsError(insert({OdometryRecord(2, 9, 4)}).error())) << "in either direction";
  const proto::InsertReply loop = insert({OdometryRecord(2, 9, 1)});
  EXPECT_EQ(loop.error().field(), "records[0].pose_graph_edge.to");
  EXPECT_NE(loop.error().text().find("node 2:4 lies between"), std::string::npos) << loop.error().text();
  EXPECT_TRUE(IsError(insert({NodeRecord(2, 12), OdometryRecord(2, 9, 15)}).error()))
      << "a node of the same insert lies between, too";
  EXPECT_FALSE(IsError(insert({OdometryRecord(2, 9, 12)}).error())) << "of which nothing was stored";
  EXPECT_EQ(StoreOne(*store, Packed(Key(1, proto::POSE_GRAPH_EDGE, 1, 7), OdometryRecord(1, 1, 50))).stored_count(), 1u)
      << "a peer's is kept";
}

TEST(RecordStoreTest, BeginsAnEpochAboveThoseThatPeersKnow) {
  auto store = OpenStore(StoreOptionsOf(2));
  const std::uint64_t first = InsertOne(*store, TemperatureRecord(1)).epoch();
  // The agent lost its disk earlier. A peer returns a record from the ninth epoch of the lost disk.
  const std::uint64_t forgotten = (9ull << 48) | 5;
  StoreOne(*store, Packed(Key(2, proto::TEMPERATURE, 3, forgotten), TemperatureRecord(30)));
  const proto::RecordKey next = InsertOne(*store, TemperatureRecord(2));
  EXPECT_GT(next.epoch(), forgotten);
  EXPECT_GT(forgotten, first);
  // If the new epoch were lower than `forgotten`, the newest record would count as older than the forgotten one.
  EXPECT_EQ(Number(*store, "SELECT celsius FROM temperature"), 2);

  const std::uint64_t known = 9000ull << 48;
  proto::MissingRequest question;
  *question.mutable_destination_have()->add_streams() = Dropped({2, known, proto::TEMPERATURE}, 1, 1);
  ASSERT_TRUE(store->GetMissing(question));
  EXPECT_GT(InsertOne(*store, TemperatureRecord(3)).epoch(), known);
}

// An agent that accepted the forged epoch could not begin a higher epoch for its own records.
TEST(RecordStoreTest, IgnoresAnImpossibleEpochWhenItBeginsOne) {
  auto store = OpenStore(StoreOptionsOf(2));
  const std::uint64_t own = InsertOne(*store, TemperatureRecord(1)).epoch();
  const StreamKey forged{2, UINT64_MAX, proto::TEMPERATURE};
  EXPECT_EQ(StoreOne(*store, Packed({forged, 1}, TemperatureRecord(2))).rejected_count(), 1u);
  EXPECT_EQ(StoreDropped(*store, Dropped(forged, 1, 1)).rejected_count(), 1u);
  proto::MissingRequest question;
  *question.mutable_destination_have()->add_streams() = Dropped(forged, 1, 1);
  ASSERT_TRUE(store->GetMissing(question));
  proto::PeerHave note;
  note.set_peer(3);
  *note.mutable_acknowledged() = question.destination_have();
  ASSERT_TRUE(store->ObservePeerHave(note));
  EXPECT_EQ(InsertOne(*store, TemperatureRecord(3)).epoch(), own);
  EXPECT_EQ(store->GetStatus()->rejected_count(), 4);
}

TEST(RecordStoreTest, InsertsAllRecordsOrNone) {
  auto store = OpenStore(StoreOptionsOf(2));
  const proto::InsertReply bad =
      InsertAll(*store, {NodeRecord(2, 1), TemperatureRecord(std::nan("")), NodeRecord(2, 2)});
  EXPECT_EQ(bad.error().code(), proto::ERROR_CODE_INVALID);
  EXPECT_EQ(bad.error().field(), "records[1].temperature.celsius");
  EXPECT_EQ(bad.keys_size(), 0);
  // The store refuses the second node after it has written the first node's row in the same transaction.
  const proto::InsertReply twice = InsertAll(*store, {NodeRecord(2, 1, 0), NodeRecord(2, 1, 5)});
  EXPECT_EQ(twice.error().field(), "records[1].pose_graph_node");
  EXPECT_TRUE(Contents(*store).empty());
  EXPECT_TRUE(store->GetHave().have().streams().empty());
  EXPECT_EQ(store->GetHave().epoch(), 0u);
  EXPECT_EQ(InsertOne(*store, NodeRecord(2, 1)).seq(), 1u);
}

TEST(RecordStoreTest, RefusesNodesOfOtherAgentsAndAgentsOutsideTheTeam) {
  auto store = OpenStore(StoreOptionsOf(2));
  EXPECT_EQ(InsertAll(*store, {NodeRecord(3, 1)}).error().field(), "records[0].pose_graph_node.node.agent_id");
  EXPECT_EQ(InsertAll(*store, {MapRecord({3, 1})}).error().field(),
            "records[0].local_traversability_map.node.agent_id");
  EXPECT_EQ(InsertAll(*store, {RangeRecord({2, 1}, {5, 1}, 3)}).error().field(),
            "records[0].pose_graph_edge.to.agent_id");
  EXPECT_EQ(InsertAll(*store, {OptimizedPoseRecord({5, 1}, 1, 1, 0)}).error().field(),
            "records[0].optimized_pose.node.agent_id");
  EXPECT_EQ(InsertAll(*store, {proto::Record()}).error().code(), proto::ERROR_CODE_INVALID);
}

TEST(RecordStoreTest, ReturnsTheSameKeyWhenARobotRepeatsANode) {
  auto store = OpenStore(StoreOptionsOf(2));
  const proto::RecordKey first = InsertOne(*store, NodeRecord(2, 7, 1.0));
  EXPECT_EQ(InsertOne(*store, NodeRecord(2, 7, 1.0)).SerializeAsString(), first.SerializeAsString());
  EXPECT_EQ(Contents(*store).size(), 1u);
  EXPECT_EQ(InsertAll(*store, {NodeRecord(2, 7, 1.5)}).error().code(), proto::ERROR_CODE_INVALID);
  InsertOne(*store, RangeRecord({2, 7}, {3, 1}, 4));
  EXPECT_NE(InsertAll(*store, {RangeRecord({2, 7}, {3, 1}, 5)}).error().text().find("already exists"),
            std::string::npos);
  proto::InsertRequest local;
  *local.add_records() = NodeRecord(2, 7, 1.0);
  local.set_is_local(true);
  EXPECT_EQ(store->Insert(local).reply.error().text(), "2:7 already exists and is shared with other agents");
}

TEST(RecordStoreTest, PreservesUnknownFields) {
  auto origin = OpenStore(StoreOptionsOf(2));
  auto peer = OpenStore(StoreOptionsOf(1));
  proto::Record record = TemperatureRecord(20);
  record.GetReflection()->MutableUnknownFields(&record)->AddVarint(900, 42);
  InsertOne(*origin, record);
  while (Transfer(*origin, *peer)) {
  }
  ASSERT_EQ(Contents(*peer).size(), 1u);
  EXPECT_EQ(Contents(*peer)[0].content(), Contents(*origin)[0].content());
  proto::Record read;
  ASSERT_TRUE(read.ParseFromString(Contents(*peer)[0].content()));
  EXPECT_EQ(read.GetReflection()->GetUnknownFields(read).field_count(), 1);
}

TEST(RecordStoreTest, KeepsOnlyTheNewestOfALatestType) {
  auto store = OpenStore(StoreOptionsOf(2));
  for (int i = 1; i <= 3; ++i) InsertOne(*store, TemperatureRecord(i));
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM temperature"), 1);
  EXPECT_EQ(Number(*store, "SELECT seq FROM temperature"), 3);
  const StreamHave have = HaveOf(*store).Get({2, store->GetHave().epoch(), proto::TEMPERATURE});
  EXPECT_TRUE(have.dropped.Contains(1) && have.dropped.Contains(2) && !have.dropped.Contains(3));
  EXPECT_TRUE(have.held.Contains(3));

  InsertOne(*store, OptimizedPoseRecord({2, 1}, 1, 1, 0));
  InsertOne(*store, OptimizedPoseRecord({2, 2}, 1, 1, 0));
  InsertOne(*store, OptimizedPoseRecord({2, 1}, 1, 2, 0));
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM optimized_pose"), 2);
}

TEST(RecordStoreTest, ALocalRecordSupersedesOnlyLocalRecords) {
  auto store = OpenStore(StoreOptionsOf(2));
  InsertOne(*store, TemperatureRecord(1));
  InsertOne(*store, TemperatureRecord(2), /*is_local=*/true);
  InsertOne(*store, TemperatureRecord(3), /*is_local=*/true);
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM temperature"), 2);
  EXPECT_EQ(AllOf(*store).records_size(), 1);
  InsertOne(*store, TemperatureRecord(4));
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM temperature"), 1);
}

TEST(RecordStoreTest, OrdersAForeignLatestTypeByEpochAndSeqNotByArrival) {
  auto store = OpenStore(StoreOptionsOf(1));
  const auto newest = Packed(Key(2, proto::TEMPERATURE, 1, 5), TemperatureRecord(51));
  const auto older = Packed(Key(2, proto::TEMPERATURE, 9, 4), TemperatureRecord(49));
  EXPECT_EQ(StoreOne(*store, newest).stored_count(), 1u);
  const proto::StoreReply late = StoreOne(*store, older);
  EXPECT_EQ(late.stored_count(), 0u);
  EXPECT_EQ(late.rejected_count(), 0u);
  ASSERT_EQ(late.covered().streams_size(), 1);
  EXPECT_EQ(late.covered().streams(0).dropped(0).first(), 9u);
  EXPECT_EQ(Number(*store, "SELECT celsius FROM temperature"), 51);
  StoreOne(*store, Packed(Key(2, proto::TEMPERATURE, 2, 5), TemperatureRecord(52)));
  EXPECT_EQ(Number(*store, "SELECT celsius FROM temperature"), 52);
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM temperature"), 1);
  // A state of another origin does not supersede this state.
  StoreOne(*store, Packed(Key(3, proto::TEMPERATURE, 1, 1), TemperatureRecord(10)));
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM temperature"), 2);
}

TEST(RecordStoreTest, StoresADuplicateOnceAndRejectsOtherContentUnderTheSameKey) {
  auto store = OpenStore(StoreOptionsOf(1));
  const RecordKey key = Key(2, proto::POSE_GRAPH_NODE, 1);
  EXPECT_EQ(StoreOne(*store, Packed(key, NodeRecord(2, 1, 1))).stored_count(), 1u);
  const proto::StoreReply again = StoreOne(*store, Packed(key, NodeRecord(2, 1, 1)));
  EXPECT_EQ(again.stored_count(), 0u);
  EXPECT_EQ(again.rejected_count(), 0u);
  EXPECT_EQ(again.covered().streams_size(), 1);
  const proto::StoreReply other = StoreOne(*store, Packed(key, NodeRecord(2, 1, 2)));
  EXPECT_EQ(other.rejected_count(), 1u);
  EXPECT_EQ(Number(*store, "SELECT x FROM pose_graph_node"), 1);
  EXPECT_EQ(store->GetStatus()->rejected_count(), 1);
}

TEST(RecordStoreTest, RejectsInvalidRecordsOfPeers) {
  auto store = OpenStore(StoreOptionsOf(1));
  const RecordKey key = Key(2, proto::TEMPERATURE, 1);
  std::vector<proto::StoredRecord> bad;
  bad.push_back(Packed(key, TemperatureRecord(std::numeric_limits<double>::infinity())));
  bad.push_back(Packed(Key(4, proto::TEMPERATURE, 1), TemperatureRecord(1)));  // Origin 4 is not in the team.
  bad.push_back(Packed(Key(2, proto::POWER, 1), TemperatureRecord(1)));        // The content is of another type.
  bad.push_back(Packed(Key(2, 1500, 1), TemperatureRecord(1)));                // No table exists for the type.
  bad.push_back(Packed(Key(2, proto::TEMPERATURE, 0), TemperatureRecord(1)));  // Seqs begin with 1.
  bad.push_back(Packed(Key(2, proto::TEMPERATURE, UINT64_MAX), TemperatureRecord(1)));
  bad.push_back(Packed(Key(2, proto::TEMPERATURE, 1, 0), TemperatureRecord(1)));  // Epoch 0 is not valid.
  bad.push_back(Packed(Key(2, proto::POSE_GRAPH_NODE, 1), NodeRecord(3, 1)));     // A node of another agent.
  bad.push_back(Packed(Key(2, proto::POSE_GRAPH_EDGE, 1), RangeRecord({2, 1}, {7, 1}, 1)));
  bad.push_back(Packed(key, TemperatureRecord(1)));
  bad.back().set_hash(bad.back().hash() ^ 1);
  bad.push_back(Packed(key, TemperatureRecord(1)));
  bad.back().set_content("no record");
  bad.back().set_hash(HashRecord(key, "no record"));
  proto::StoreRequest request;
  for (const proto::StoredRecord& record : bad) *request.add_records() = record;
  *request.add_records() = Packed(Key(2, proto::TEMPERATURE, 2), TemperatureRecord(2));
  const RecordStore::Stored stored = store->Store(request);
  EXPECT_EQ(stored.reply.rejected_count(), bad.size());
  EXPECT_EQ(stored.reply.stored_count(), 1u);
  EXPECT_FALSE(stored.rejections.empty());
  EXPECT_EQ(Contents(*store).size(), 1u);
  EXPECT_EQ(HaveOf(*store).streams().size(), 1u);
}

TEST(RecordStoreTest, AcceptsItsOwnEarlierRecordsButNoForgedOnes) {
  auto store = OpenStore(StoreOptionsOf(2));
  const proto::RecordKey own = InsertOne(*store, NodeRecord(2, 1));
  const proto::StoreReply forged =
      StoreOne(*store, Packed(Key(2, proto::POSE_GRAPH_NODE, 2, own.epoch()), NodeRecord(2, 2)));
  EXPECT_EQ(forged.rejected_count(), 1u);
  const proto::StoreReply drop = StoreDropped(*store, Dropped({2, own.epoch(), proto::TEMPERATURE}, 1, 5));
  EXPECT_EQ(drop.rejected_count(), 1u);
  const proto::StoreReply refill = StoreOne(*store, Packed(Key(2, proto::POSE_GRAPH_NODE, 8, 3), NodeRecord(2, 8)));
  EXPECT_EQ(refill.stored_count(), 1u);
}

TEST(RecordStoreTest, NeverDropsRecordsThatThePolicyKeeps) {
  auto store = OpenStore(StoreOptionsOf(1));
  const RecordKey key = Key(2, proto::POSE_GRAPH_NODE, 1);
  StoreOne(*store, Packed(key, NodeRecord(2, 1)));
  EXPECT_EQ(StoreDropped(*store, Dropped(key.stream, 1, 10)).rejected_count(), 0u) << "the peer keeps the latest";
  EXPECT_EQ(Contents(*store).size(), 1u);
  proto::StreamHave reversed = Dropped({2, kEpoch, proto::TEMPERATURE}, 5, 2);
  EXPECT_EQ(StoreDropped(*store, reversed).rejected_count(), 1u);
}

TEST(RecordStoreTest, KeepsTheNewestRowUntilItsSupersederArrives) {
  auto store = OpenStore(StoreOptionsOf(1));
  const StreamKey stream{2, kEpoch, proto::TEMPERATURE};
  StoreOne(*store, Packed({stream, 2}, TemperatureRecord(2)));
  // A report that seqs 1 to 3 were dropped arrives before seq 4, which supersedes them.
  const proto::StoreReply early = StoreDropped(*store, Dropped(stream, 1, 3));
  EXPECT_EQ(early.rejected_count(), 0u);
  EXPECT_EQ(Number(*store, "SELECT celsius FROM temperature"), 2);
  EXPECT_TRUE(HaveOf(*store).Get(stream).dropped.Contains(1));
  EXPECT_TRUE(HaveOf(*store).Get(stream).held.Contains(2));
  // Seq 1 was dropped before it arrived, so the store does not store it.
  EXPECT_EQ(StoreOne(*store, Packed({stream, 1}, TemperatureRecord(1))).stored_count(), 0u);
  // The store holds nothing newer than seq 3, so seq 3 is not covered. If seq 4 is lost, seq 3 is the newest state.
  EXPECT_FALSE(HaveOf(*store).Get(stream).Covered().Contains(3));
  EXPECT_EQ(StoreOne(*store, Packed({stream, 3}, TemperatureRecord(3))).stored_count(), 1u);
  StoreOne(*store, Packed({stream, 4}, TemperatureRecord(4)));
  EXPECT_EQ(Number(*store, "SELECT celsius FROM temperature"), 4);
  EXPECT_TRUE(HaveOf(*store).Get(stream).dropped.Contains(2));
}

TEST(RecordStoreTest, DropsASupersededRowThatAnEarlierPolicyKept) {
  TemporaryFolder folder;
  auto options = StoreOptionsOf(1, folder.File("store.db"));
  options.policies[proto::TEMPERATURE] = proto::POLICY_ALL;
  auto store = OpenStore(options);
  const StreamKey stream{2, kEpoch, proto::TEMPERATURE};
  for (std::uint64_t seq = 1; seq <= 3; ++seq) StoreOne(*store, Packed({stream, seq}, TemperatureRecord(1.0 * seq)));
  store.reset();
  options.policies[proto::TEMPERATURE] = proto::POLICY_LATEST;
  store = OpenStore(options);
  StoreDropped(*store, Dropped(stream, 1, 3));
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM temperature"), 1);
  EXPECT_EQ(Number(*store, "SELECT celsius FROM temperature"), 3);
}

TEST(RecordStoreTest, LeavesEverythingAsItWasWhenTheDiskIsFull) {
  TemporaryFolder folder;
  auto options = StoreOptionsOf(1, folder.File("store.db"));
  options.bytes_max = 400'000;
  auto store = OpenStore(options);
  InsertOne(*store, NodeRecord(1, 1));
  const std::string have = store->GetHave().SerializeAsString();

  proto::StoreRequest request;
  *request.add_records() = Packed(Key(2, proto::POSE_GRAPH_NODE, 1), NodeRecord(2, 1));
  proto::Record large = MapRecord({2, 1});
  proto::MapLayer& layer = *large.mutable_local_traversability_map()->mutable_layers(0);
  layer.set_width_cells(2000);
  layer.set_height_cells(2000);
  layer.set_cells(std::string(1'000'000, '\0'));
  *request.add_records() = Packed(Key(2, proto::LOCAL_TRAVERSABILITY_MAP, 1), large);
  const RecordStore::Stored stored = store->Store(request);
  EXPECT_EQ(stored.reply.error().code(), proto::ERROR_CODE_FULL) << stored.reply.error().DebugString();
  EXPECT_EQ(stored.reply.covered().streams_size(), 0);
  EXPECT_EQ(stored.stored.last_row_id(), 0u);
  EXPECT_EQ(store->GetHave().SerializeAsString(), have);
  EXPECT_EQ(Contents(*store).size(), 1u);

  large.mutable_local_traversability_map()->mutable_node()->set_agent_id(1);
  EXPECT_EQ(InsertAll(*store, {NodeRecord(1, 2), large}).error().code(), proto::ERROR_CODE_FULL);
  EXPECT_EQ(store->GetHave().SerializeAsString(), have);
  // The store still accepts a small record.
  EXPECT_EQ(InsertOne(*store, NodeRecord(1, 2)).seq(), 2u);
  store.reset();
  EXPECT_EQ(Contents(*OpenStore(options)).size(), 2u);
}

TEST(RecordStoreTest, LeavesEverythingAsItWasWhenTheCommitItselfFails) {
  auto store = OpenStore(StoreOptionsOf(1));
  InsertOne(*store, NodeRecord(1, 1));
  const std::string have = store->GetHave().SerializeAsString();
  // Prepares a commit that fails: SQLite checks a deferred constraint only at commit.
  ASSERT_TRUE(store->database().Execute(
      "PRAGMA foreign_keys=ON; CREATE TABLE parent(id INTEGER PRIMARY KEY);"
      "CREATE TABLE child(id INTEGER REFERENCES parent(id) DEFERRABLE INITIALLY DEFERRED);"
      "CREATE TEMP TRIGGER orphan AFTER INSERT ON temperature BEGIN INSERT INTO child VALUES(1); END;"));
  const auto packed = Packed(Key(2, proto::TEMPERATURE, 1), TemperatureRecord(1));
  EXPECT_EQ(StoreOne(*store, packed).error().code(), proto::ERROR_CODE_INTERNAL);
  EXPECT_EQ(InsertAll(*store, {TemperatureRecord(1)}).error().code(), proto::ERROR_CODE_INTERNAL);
  EXPECT_EQ(store->GetHave().SerializeAsString(), have);
  EXPECT_EQ(Contents(*store).size(), 1u);
  ASSERT_TRUE(store->database().Execute("DROP TRIGGER orphan"));
  EXPECT_EQ(StoreOne(*store, packed).stored_count(), 1u);
}

// An attacker who can write the file might add a trigger to it.
TEST(RecordStoreTest, RunsNoTriggersOfItsFile) {
  TemporaryFolder folder;
  const RecordStore::Options options = StoreOptionsOf(1, folder.File("store.db"));
  auto store = OpenStore(options);
  InsertOne(*store, NodeRecord(1, 1));
  ASSERT_TRUE(store->database().Execute(
      "CREATE TRIGGER wipe AFTER INSERT ON temperature BEGIN DELETE FROM pose_graph_node; END;"));
  InsertOne(*store, TemperatureRecord(1));
  EXPECT_EQ(Contents(*store).size(), 2u);
  store.reset();
  store = OpenStore(options);
  InsertOne(*store, TemperatureRecord(2));
  EXPECT_EQ(Contents(*store).size(), 2u) << "the node, and the newer temperature";
}

TEST(RecordStoreTest, SetsADamagedFileAsideAndRefusesAnotherAgentsFile) {
  TemporaryFolder folder;
  const std::string path = folder.File("store.db");
  {
    auto store = OpenStore(StoreOptionsOf(2, path));
    for (int i = 0; i < 200; ++i) InsertOne(*store, NodeRecord(2, i));
    ASSERT_TRUE(store->database().Execute("PRAGMA wal_checkpoint(TRUNCATE)"));
  }
  const auto other = RecordStore::Open(StoreOptionsOf(3, path));
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().code, ErrorCode::kRefused);
  EXPECT_NE(other.error().text.find("belongs to agent 2"), std::string::npos);

  // Overwrites the root page of the table of nodes.
  std::int64_t page = 0;
  {
    auto store = OpenStore(StoreOptionsOf(2, path));
    page = Number(*store, "SELECT rootpage FROM sqlite_master WHERE name = 'pose_graph_node'");
  }
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp((page - 1) * 4096);
  file << std::string(4096, '\x5a');
  file.close();
  RecordStore::Options checked = StoreOptionsOf(2, path);
  checked.is_checked = true;
  EXPECT_EQ((*RecordStore::Open(checked))->set_aside(), "") << "not read through a second time";

  auto store = OpenStore(StoreOptionsOf(2, path));
  EXPECT_EQ(store->set_aside(), path + ".damaged-1");
  EXPECT_TRUE(std::filesystem::exists(store->set_aside()));
  EXPECT_EQ(store->GetHave().have().streams_size(), 0);
  EXPECT_EQ(InsertOne(*store, NodeRecord(2, 0)).seq(), 1u);
  store.reset();
  EXPECT_EQ(OpenStore(StoreOptionsOf(2, path))->set_aside(), "");
}

// One row has a changed content, and another row is missing.
TEST(RecordStoreTest, DoesNotClaimDamagedOrMissingRows) {
  TemporaryFolder folder;
  const std::string path = folder.File("store.db");
  {
    auto store = OpenStore(StoreOptionsOf(2, path));
    for (int i = 0; i < 10; ++i) InsertOne(*store, NodeRecord(2, i));
    ASSERT_TRUE(
        store->database().Execute("UPDATE pose_graph_node SET content = CAST(content || x'00' AS BLOB) WHERE seq = 4"));
    ASSERT_TRUE(store->database().Execute("DELETE FROM pose_graph_node WHERE seq = 7"));
  }
  RecordStore::Options checked = StoreOptionsOf(2, path);
  checked.is_checked = true;
  EXPECT_EQ((*RecordStore::Open(checked))->GetHave().have().streams(0).held_size(), 1) << "not read through";
  for (int i = 0; i < 2; ++i) {
    auto store = OpenStore(StoreOptionsOf(2, path));
    const proto::HaveReply have = store->GetHave();
    const proto::StreamHave& stream = have.have().streams(0);
    ASSERT_EQ(stream.held_size(), 3);
    EXPECT_EQ(stream.held(0).last(), 3u);
    EXPECT_EQ(stream.held(1).first(), 5u);
    EXPECT_EQ(stream.held(2).first(), 8u);
    EXPECT_EQ(Contents(*store).size(), 8u);
  }
}

// Takes entries out of the index of the nodes' keys: the rows are stored again while the schema has no such index.
TEST(RecordStoreTest, BuildsAnIndexAgainThatDisagreesWithItsTable) {
  TemporaryFolder folder;
  const std::string path = folder.File("store.db");
  const std::string table = "name = 'pose_graph_node'";
  const std::string index = "name = 'sqlite_autoindex_pose_graph_node_1'";
  HaveSet held;
  {
    auto store = OpenStore(StoreOptionsOf(2, path));
    for (int i = 0; i < 10; ++i) InsertOne(*store, NodeRecord(2, i));
    held = HaveOf(*store);
  }
  RunSql(path,
         "CREATE TABLE moved AS SELECT * FROM pose_graph_node WHERE seq > 7;"
         "DELETE FROM pose_graph_node WHERE seq > 7;"
         "CREATE TABLE kept AS SELECT name, sql, rootpage FROM sqlite_schema WHERE " +
             table + " OR " + index + "; PRAGMA writable_schema = ON; DELETE FROM sqlite_schema WHERE " + index +
             "; UPDATE sqlite_schema SET sql = replace(sql, ', UNIQUE(origin, epoch, seq)', '') WHERE " + table);
  RunSql(path,
         "INSERT INTO pose_graph_node SELECT * FROM moved; DROP TABLE moved; PRAGMA writable_schema = ON;"
         "UPDATE sqlite_schema SET sql = (SELECT sql FROM kept WHERE " +
             table + ") WHERE " + table +
             "; INSERT INTO sqlite_schema SELECT 'index', name, 'pose_graph_node', rootpage, sql FROM kept"
             " WHERE " +
             index);
  RunSql(path, "DROP TABLE kept");
  {
    auto database = *Database::Open(path);
    ASSERT_TRUE(database->QuickCheck());
    ASSERT_FALSE(database->FullCheck());
  }
  auto store = OpenStore(StoreOptionsOf(2, path));
  EXPECT_EQ(store->set_aside(), "");
  ASSERT_EQ(store->damage().size(), 1u);
  EXPECT_NE(store->damage()[0].find("an index of the store was damaged"), std::string::npos);
  EXPECT_EQ(HaveOf(*store), held);
  EXPECT_TRUE(store->database().FullCheck());
  store.reset();
  EXPECT_TRUE(OpenStore(StoreOptionsOf(2, path))->damage().empty());
}

// A peer may still hold the previous state, which is then the newest state that is left.
TEST(RecordStoreTest, AcceptsThePreviousStateAgainIfTheNewestIsDamaged) {
  TemporaryFolder folder;
  const RecordStore::Options options = StoreOptionsOf(2, folder.File("store.db"));
  auto other = OpenStore(StoreOptionsOf(3));
  auto store = OpenStore(options);
  for (const double celsius : {1.0, 2.0}) {
    InsertOne(*store, TemperatureRecord(celsius));
    if (celsius == 1.0) {
      for (const proto::StoredRecord& record : Contents(*store)) StoreOne(*other, record);
    }
  }
  ASSERT_TRUE(store->database().Execute("UPDATE temperature SET content = CAST(content || x'00' AS BLOB)"));
  store.reset();
  store = OpenStore(options);
  EXPECT_TRUE(Contents(*store).empty());
  for (const proto::StoredRecord& record : Contents(*other)) StoreOne(*store, record);
  ASSERT_EQ(Contents(*store).size(), 1u);
  EXPECT_EQ(Contents(*store)[0].key().seq(), 1u);
}

// Each statement damages the have-set on disk. The reopened store must claim the records in its rows, and no others.
TEST(RecordStoreTest, RebuildsADamagedHaveSetFromItsRows) {
  for (const char* damage : {
           "UPDATE have_interval SET last = last + 1 WHERE data_type = 20",
           "UPDATE have_interval SET last = 4 WHERE data_type = 20",
           "UPDATE have_interval SET first = 4611686018427387904, last = 5 WHERE data_type = 20",
           "UPDATE have_interval SET last = -1 WHERE data_type = 20",
           "UPDATE have_interval SET last = 4611686018427387904 WHERE data_type = 20",
           "UPDATE have_interval SET is_dropped = 1 WHERE data_type = 20",
           "UPDATE have_interval SET origin = 3 WHERE data_type = 20",
           "UPDATE have_interval SET epoch = epoch + 1 WHERE data_type = 20",
           "UPDATE have_interval SET last = 4611686018427387904 WHERE data_type = 1 AND is_dropped = 1",
           "UPDATE have_interval SET first = 3 WHERE data_type = 1 AND is_dropped = 1",
           "DELETE FROM have_interval",
           "UPDATE meta SET value = 3 WHERE name = 'next_row_id'",
           "UPDATE meta SET value = -1 WHERE name = 'next_row_id'",
       }) {
    SCOPED_TRACE(damage);
    TemporaryFolder folder;
    const std::string path = folder.File("store.db");
    HaveSet covered;
    std::size_t count = 0;
    {
      auto store = OpenStore(StoreOptionsOf(2, path));
      for (int i = 0; i < 10; ++i) InsertOne(*store, NodeRecord(2, i));
      for (int i = 0; i < 5; ++i) InsertOne(*store, TemperatureRecord(i));
      covered = HaveOf(*store);
      count = Contents(*store).size();
      ASSERT_TRUE(store->database().Execute(damage));
    }
    auto store = OpenStore(StoreOptionsOf(2, path));
    EXPECT_EQ(store->set_aside(), "");
    EXPECT_EQ(Contents(*store).size(), count);
    const HaveSet covered_after = HaveOf(*store);
    for (const auto& [stream, have] : covered.streams()) {
      EXPECT_EQ(covered_after.Get(stream).held, have.held);
      EXPECT_TRUE(covered_after.Get(stream).dropped.Minus(have.dropped).is_empty()) << "what never was is not had";
    }
    const proto::RecordKey next = InsertOne(*store, NodeRecord(2, 10));
    EXPECT_GT(next.epoch(), covered.streams().begin()->first.epoch);
    store.reset();
    store = OpenStore(StoreOptionsOf(2, path));
    const HaveSet once_more = HaveOf(*store);
    for (const auto& [stream, have] : covered_after.streams()) EXPECT_EQ(once_more.Get(stream), have);
  }
}

TEST(RecordStoreTest, ReportsALatestTypeToPeersAsOneInterval) {
  auto store = OpenStore(StoreOptionsOf(2));
  for (std::uint64_t run = 1; run <= 3; ++run) {
    for (std::uint64_t node = run; node <= 60; node += run) {
      InsertOne(*store, OptimizedPoseRecord({2, node}, /*term=*/1, run, 0.5));
    }
  }
  EXPECT_GT(store->GetHave().have().streams(0).held_size(), 20);
  proto::HaveRequest request;
  request.set_is_for_peer(true);
  const proto::HaveReply reported = store->GetHave(request);
  ASSERT_EQ(reported.have().streams_size(), 1);
  EXPECT_EQ(reported.have().streams(0).held_size(), 0);
  ASSERT_EQ(reported.have().streams(0).dropped_size(), 1);
  EXPECT_EQ(reported.have().streams(0).dropped(0).last(), 60u + 30 + 20);

  // To a peer that already has this interval, the store sends no records and reports no dropped records.
  proto::MissingRequest missing;
  *missing.mutable_destination_have() = reported.have();
  const proto::MissingReply reply = *store->GetMissing(missing);
  EXPECT_EQ(reply.records_size() + reply.dropped_size(), 0);
}

TEST(RecordStoreTest, ReturnsOnlyTheRequestedStreams) {
  auto store = OpenStore(StoreOptionsOf(2));
  auto other = OpenStore(StoreOptionsOf(3));
  InsertOne(*store, NodeRecord(2, 1));
  InsertOne(*other, NodeRecord(3, 1));
  InsertOne(*other, TemperatureRecord(1));
  while (Transfer(*other, *store)) {
  }
  proto::HaveRequest request;
  EXPECT_EQ(store->GetHave(request).have().streams_size(), 3);
  request.add_origin_agents(2);
  EXPECT_EQ(store->GetHave(request).have().streams_size(), 1);
  request.add_everyones_types(proto::POSE_GRAPH_NODE);
  EXPECT_EQ(store->GetHave(request).have().streams_size(), 2);
}

// Requests with the same mark return only records that the store held at the first of these requests. A session can
// then end although the robot goes on inserting records.
TEST(RecordStoreTest, RecordsInsertedAfterAMarkAreNotMissing) {
  auto store = OpenStore(StoreOptionsOf(2));
  InsertOne(*store, NodeRecord(2, 1));
  InsertOne(*store, TemperatureRecord(1));
  proto::MissingRequest request;
  request.set_destination(1);
  request.set_kind(proto::SHARING_KIND_SYNC);
  request.set_mark(5);
  EXPECT_EQ(store->GetMissing(request)->records_size(), 2);
  InsertOne(*store, NodeRecord(2, 2));
  EXPECT_EQ(store->GetMissing(request)->records_size(), 2);
  proto::MissingRequest other = request;
  other.set_destination(3);
  EXPECT_EQ(store->GetMissing(other)->records_size(), 3) << "another destination has a mark of its own";
  other = request;
  other.set_kind(proto::SHARING_KIND_REPLICATION);
  EXPECT_EQ(store->GetMissing(other)->records_size(), 3) << "another kind, too";
  request.set_mark(6);
  EXPECT_EQ(store->GetMissing(request)->records_size(), 3);
  request.set_mark(0);
  InsertOne(*store, NodeRecord(2, 3));
  EXPECT_EQ(store->GetMissing(request)->records_size(), 4) << "no mark";
}

// After the mark, temperature 2 supersedes temperature 1. The store must send temperature 2. Otherwise the destination
// would have no temperature.
TEST(RecordStoreTest, ANewerStateThanTheMarkedOneIsMissing) {
  auto store = OpenStore(StoreOptionsOf(2));
  InsertOne(*store, TemperatureRecord(1));
  proto::MissingRequest request;
  request.set_destination(1);
  request.set_mark(5);
  ASSERT_EQ(store->GetMissing(request)->records_size(), 1);
  InsertOne(*store, TemperatureRecord(2));
  const proto::MissingReply reply = *store->GetMissing(request);
  ASSERT_EQ(reply.records_size(), 1);
  EXPECT_EQ(reply.records(0).key().seq(), 2u);
  EXPECT_EQ(reply.dropped_size(), 1);
}

// Records stored after the first request with a mark are normally skipped. But this destination requests only the
// newest temperature, so the store must send temperature 2, although it was stored later.
TEST(RecordStoreTest, ANewerRecordThanTheMarkedOneIsMissingUnderPolicyAll) {
  RecordStore::Options options = StoreOptionsOf(2);
  options.policies[proto::TEMPERATURE] = proto::POLICY_ALL;
  auto store = OpenStore(options);
  InsertOne(*store, TemperatureRecord(1));
  proto::MissingRequest request;
  request.set_destination(4);
  request.set_mark(5);
  request.mutable_filter()->add_newest_only_types(proto::TEMPERATURE);
  ASSERT_EQ(store->GetMissing(request)->records_size(), 1);
  InsertOne(*store, TemperatureRecord(2));
  const proto::MissingReply reply = *store->GetMissing(request);
  ASSERT_EQ(reply.records_size(), 1);
  EXPECT_EQ(reply.records(0).key().seq(), 2u);
}

TEST(RecordStoreTest, ReturnsItsHaveSetInPages) {
  auto store = OpenStore(StoreOptionsOf(2));
  for (std::uint64_t epoch = 1; epoch <= 20; ++epoch) {
    (void)StoreOne(*store, Packed(Key(3, proto::TEMPERATURE, 1, epoch), TemperatureRecord(20)));
  }
  InsertOne(*store, NodeRecord(2, 1));
  proto::HaveRequest request;
  request.set_is_for_peer(true);
  const HaveSet whole = *FromProto(store->GetHave(request).have());
  request.set_bytes_max(100);
  HaveSet joined;
  int pages = 0;
  for (bool is_last = false; !is_last; ++pages) {
    const proto::HaveReply reply = store->GetHave(request);
    EXPECT_LE(reply.have().ByteSizeLong(), 100u);
    joined.Merge(*FromProto(reply.have()));
    *request.mutable_from() = reply.next();
    is_last = !reply.has_next();
  }
  EXPECT_EQ(joined, whole);
  EXPECT_GT(pages, 4);
}

// The stream has about 4,000 gaps. An acknowledgment must list only the intervals of its batch.
TEST(RecordStoreTest, AcknowledgesOnlyTheBatchsIntervalsOfALargeStream) {
  auto store = OpenStore(StoreOptionsOf(2));
  const auto store_each_second = [&](std::uint64_t first, std::uint64_t last) {
    proto::StoreRequest request;
    for (std::uint64_t seq = first; seq <= last; seq += 2) {
      *request.add_records() = Packed(Key(3, proto::POSE_GRAPH_NODE, seq), NodeRecord(3, seq));
    }
    return store->Store(request).reply;
  };
  EXPECT_EQ(store_each_second(1, 8000).stored_count(), 4000u);
  EXPECT_GT(store->GetHave().have().ByteSizeLong(), kHavePageBytesMax);
  const proto::StoreReply last = store_each_second(8001, 8100);
  ASSERT_EQ(last.covered().streams_size(), 1);
  EXPECT_EQ(last.covered().streams(0).held_size(), 50);
  EXPECT_EQ(last.covered().streams(0).held(0).first(), 8001u);
}

TEST(RecordStoreTest, ReportsADamagedHaveSetAndLeavesItToANewProcess) {
  TemporaryFolder folder;
  RecordStore::Options options = StoreOptionsOf(2, folder.File("store.db"));
  {
    auto store = OpenStore(StoreOptionsOf(2, options.path));
    InsertOne(*store, NodeRecord(2, 1));
    ASSERT_TRUE(store->database().Execute("UPDATE have_interval SET last = 7"));
  }
  options.is_checked = true;
  const auto opened = RecordStore::Open(options);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::kCorrupt);
  EXPECT_FALSE(std::filesystem::exists(options.path + ".damaged-1"));
}

TEST(RecordStoreTest, SendsUrgentClassesFirstAndCountsTheRest) {
  auto store = OpenStore(StoreOptionsOf(2));
  InsertOne(*store, MapRecord({2, 1}));
  InsertOne(*store, RangeRecord({2, 1}, {3, 1}, 5));
  InsertOne(*store, NodeRecord(2, 1));
  InsertOne(*store, NodeRecord(2, 2));
  InsertOne(*store, TemperatureRecord(1));
  proto::Record mode;
  mode.mutable_mode()->set_activity(proto::ACTIVITY_EXPLORING);
  // MODE has policy `none`, so this record is not sent.
  InsertOne(*store, mode);

  proto::MissingRequest request;
  request.set_records_max(2);
  std::vector<DataType> types;
  HaveSet destination;
  for (std::uint64_t remaining : {3u, 1u, 0u}) {
    *request.mutable_destination_have() = ToProto(destination);
    const proto::MissingReply reply = *store->GetMissing(request);
    EXPECT_EQ(reply.remaining(), remaining);
    for (const proto::StoredRecord& record : reply.records()) {
      types.push_back(record.key().data_type());
      destination[FromProto(record.key()).stream].held.Add(record.key().seq());
    }
  }
  EXPECT_EQ(types, (std::vector<DataType>{proto::TEMPERATURE, proto::POSE_GRAPH_NODE, proto::POSE_GRAPH_NODE,
                                          proto::POSE_GRAPH_EDGE, proto::LOCAL_TRAVERSABILITY_MAP}));
  // Even with a limit of one byte, a page holds one record.
  proto::MissingRequest tiny;
  tiny.set_content_bytes_max(1);
  const proto::MissingReply one = *store->GetMissing(tiny);
  EXPECT_EQ(one.records_size(), 1);
  EXPECT_EQ(one.remaining(), 4u);
  std::vector<std::pair<DataType, double>> backlog;
  for (const proto::TypeBacklog& type : one.backlog()) backlog.emplace_back(type.data_type(), type.records());
  const std::vector<std::pair<DataType, double>> expected = {
      {proto::POSE_GRAPH_NODE, 2}, {proto::POSE_GRAPH_EDGE, 1}, {proto::LOCAL_TRAVERSABILITY_MAP, 1}};
  EXPECT_EQ(backlog, expected);
}

TEST(RecordStoreTest, ReportsDropsOnlyWhenNothingRemains) {
  auto store = OpenStore(StoreOptionsOf(2));
  InsertOne(*store, TemperatureRecord(1));
  InsertOne(*store, TemperatureRecord(2));
  InsertOne(*store, NodeRecord(2, 1));
  proto::MissingRequest request;
  request.set_records_max(1);
  const proto::MissingReply part = *store->GetMissing(request);
  EXPECT_EQ(part.remaining(), 1u);
  EXPECT_EQ(part.dropped_size(), 0);
  request.set_records_max(2);
  const proto::MissingReply all = *store->GetMissing(request);
  EXPECT_EQ(all.remaining(), 0u);
  ASSERT_EQ(all.dropped_size(), 1);
  EXPECT_EQ(all.dropped(0).data_type(), static_cast<DataType>(proto::TEMPERATURE));
  *request.mutable_destination_have() = store->GetHave().have();
  EXPECT_EQ(store->GetMissing(request)->dropped_size(), 0);
}

TEST(RecordStoreTest, FiltersByOriginTypeAndAgentOfPoses) {
  auto store = OpenStore(StoreOptionsOf(1));
  InsertOne(*store, NodeRecord(1, 1));
  StoreOne(*store, Packed(Key(2, proto::POSE_GRAPH_NODE, 1), NodeRecord(2, 1)));
  InsertOne(*store, OptimizedPoseRecord({2, 1}, 1, 1, 0));
  InsertOne(*store, OptimizedPoseRecord({3, 1}, 1, 1, 0));
  InsertOne(*store, OptimizedPoseRecord({3, 1}, 1, 2, 0));
  InsertOne(*store, OptimizedPoseRecord({2, 2}, 1, 1, 0));
  EXPECT_EQ(AllOf(*store).records_size(), 5);
  EXPECT_EQ(AllOf(*store).dropped_size(), 1);

  proto::RecordFilter filter;
  filter.add_origin_agents(1);
  EXPECT_EQ(AllOf(*store, filter).records_size(), 4);
  filter.add_data_types(proto::POSE_GRAPH_NODE);
  EXPECT_EQ(AllOf(*store, filter).records_size(), 1);

  proto::RecordFilter not_one;
  not_one.add_not_origin_agents(1);
  EXPECT_EQ(AllOf(*store, not_one).records_size(), 1);

  proto::RecordFilter poses;
  poses.add_data_types(proto::OPTIMIZED_POSE);
  poses.set_optimized_poses_of_agent(2);
  EXPECT_EQ(AllOf(*store, poses).records_size(), 2);
  // The filter might exclude the record that superseded a dropped pose, so the store reports no dropped poses.
  EXPECT_EQ(AllOf(*store, poses).dropped_size(), 0);
  proto::MissingRequest first;
  *first.mutable_filter() = poses;
  first.set_records_max(1);
  EXPECT_EQ(store->GetMissing(first)->remaining(), 1u);
}

TEST(RecordStoreTest, ReturnsPagesInTheOrderOfStoring) {
  auto store = OpenStore(StoreOptionsOf(2));
  InsertOne(*store, NodeRecord(2, 1));
  InsertOne(*store, MapRecord({2, 1}));
  StoreOne(*store, Packed(Key(3, proto::POSE_GRAPH_NODE, 1), NodeRecord(3, 1)));
  InsertOne(*store, NodeRecord(2, 2));
  proto::ReadRequest request;
  request.set_records_max(3);
  const proto::ReadReply first = *store->Read(request);
  ASSERT_EQ(first.records_size(), 3);
  EXPECT_FALSE(first.is_complete());
  EXPECT_EQ(first.records(1).key().data_type(), static_cast<DataType>(proto::LOCAL_TRAVERSABILITY_MAP));
  EXPECT_LT(first.row_ids(0), first.row_ids(1));
  request.set_after_row_id(first.row_ids(2));
  EXPECT_TRUE(store->Read(request)->is_complete());
  EXPECT_EQ(store->Read(request)->records_size(), 1);

  proto::ReadRequest newest;
  newest.set_is_newest_first(true);
  newest.add_data_types(proto::POSE_GRAPH_NODE);
  newest.add_origin_agents(2);
  const proto::ReadReply reply = *store->Read(newest);
  ASSERT_EQ(reply.records_size(), 2);
  EXPECT_GT(reply.row_ids(0), reply.row_ids(1));
  EXPECT_TRUE(reply.is_complete());
}

TEST(RecordStoreTest, ShowsReplicaAndReplicationLogAsThePaperDefinesThem) {
  auto store = OpenStore(StoreOptionsOf(2));
  const proto::RecordKey first = InsertOne(*store, NodeRecord(2, 1));
  const proto::RecordKey second = InsertOne(*store, NodeRecord(2, 2));
  InsertOne(*store, NodeRecord(2, 3));
  InsertOne(*store, NodeRecord(2, 4), /*is_local=*/true);
  StoreOne(*store, Packed(Key(3, proto::POSE_GRAPH_NODE, 1, UINT64_MAX), NodeRecord(3, 1)));

  const auto in_replica = [&store](const std::string& id, AgentId agent) {
    return Number(
        *store, "SELECT count(*) FROM replica WHERE replica_id = '" + id + "' AND agent_id = " + std::to_string(agent));
  };
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM replica"), 4);
  EXPECT_EQ(in_replica(ToString(FromProto(first)), 2), 1);
  EXPECT_EQ(in_replica(ToString(Key(3, proto::POSE_GRAPH_NODE, 1, UINT64_MAX)), 3), 1);

  proto::PeerHave note;
  note.set_peer(1);
  HaveSet acknowledged;
  acknowledged[FromProto(first).stream].held.Add(first.seq());
  *note.mutable_acknowledged() = ToProto(acknowledged);
  *note.add_handed_over() = second;
  ASSERT_TRUE(store->ObservePeerHave(note));
  const auto in_log = [&store](const proto::RecordKey& key, int sent_status, int ack) {
    return Number(*store, "SELECT count(*) FROM replication_log WHERE replica_id = '" + ToString(FromProto(key)) +
                              "' AND agent_id = 2 AND destination_id = 1 AND sent_status = " +
                              std::to_string(sent_status) + " AND ack = " + std::to_string(ack));
  };
  EXPECT_EQ(in_log(first, 0, 1), 1);
  EXPECT_EQ(in_log(second, 1, 0), 1);
  // The third record has no row, because it was neither sent nor acknowledged. The record of agent 3 has a row with
  // this agent (2) as its destination.
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM replication_log"), 3);
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM replication_log WHERE destination_id = 2 AND ack"), 1);

  acknowledged[FromProto(second).stream].held.Add(second.seq());
  *note.mutable_acknowledged() = ToProto(acknowledged);
  note.clear_handed_over();
  note.set_is_session_closed(true);
  ASSERT_TRUE(store->ObservePeerHave(note));
  EXPECT_EQ(in_log(first, 0, 1), 1);
  EXPECT_EQ(in_log(second, 0, 1), 1);
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM peer_have"), 1);

  // The next have-set covers only streams of origin 3. It must not change the rows of this agent's records.
  acknowledged = HaveSet();
  acknowledged[Key(3, proto::POSE_GRAPH_NODE, 1).stream].held.Add(1);
  *note.mutable_acknowledged() = ToProto(acknowledged);
  note.add_origin_agents(3);
  ASSERT_TRUE(store->ObservePeerHave(note));
  EXPECT_EQ(in_log(first, 0, 1), 1);
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM peer_have"), 2);
}

TEST(RecordStoreTest, ShowsANodeAtItsNewestOptimizedPose) {
  auto store = OpenStore(StoreOptionsOf(1));
  InsertOne(*store, NodeRecord(1, 1, 1.0));
  InsertOne(*store, NodeRecord(1, 2, 2.0));
  // The pose of the lower term arrives last, from another origin.
  InsertOne(*store, OptimizedPoseRecord({1, 1}, 5, 1, 10.0));
  StoreOne(*store, Packed(Key(3, proto::OPTIMIZED_POSE, 1), OptimizedPoseRecord({1, 1}, 4, 9, 20.0)));
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM v_node_pose"), 2);
  EXPECT_EQ(Number(*store, "SELECT x FROM v_node_pose WHERE node_index = 1"), 10);
  EXPECT_EQ(Number(*store, "SELECT x FROM v_node_pose WHERE node_index = 2"), 2);
  EXPECT_EQ(Number(*store, "SELECT is_optimized FROM v_node_pose WHERE node_index = 2"), 0);
  // If two records describe one node, the view shows the one with the smaller record key.
  StoreOne(*store, Packed(Key(2, proto::POSE_GRAPH_NODE, 2, 9), NodeRecord(2, 1, 7.0)));
  StoreOne(*store, Packed(Key(2, proto::POSE_GRAPH_NODE, 1, 8), NodeRecord(2, 1, 8.0)));
  EXPECT_EQ(Number(*store, "SELECT x FROM v_node_pose WHERE node_agent = 2"), 8);
}

TEST(RecordStoreTest, DerivesTypedColumnsOfMapsAndRanges) {
  auto store = OpenStore(StoreOptionsOf(2));
  InsertOne(*store, MapRecord({2, 4}));
  InsertOne(*store, RangeRecord({2, 4}, {3, 1}, 5));
  EXPECT_EQ(Number(*store,
                   "SELECT count(*) FROM local_traversability_map WHERE node_agent = 2 AND node_index = 4 AND "
                   "layer_count = 1 AND finest_resolution_um = 50000 AND finest_width_cells = 4 AND qw = 1"),
            1);
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM pose_graph_edge WHERE is_range AND range_m = 5 AND to_agent = 3"), 1);
}

TEST(RecordStoreTest, AcceptsLoopClosuresBySourceAndPriors) {
  auto store = OpenStore(StoreOptionsOf(2));
  for (const std::uint64_t index : {0, 1, 2}) InsertOne(*store, NodeRecord(2, index));
  proto::Record edge = ToRecord(OdometryEdge{{2, 0}, {2, 2}, 1, Pose(), Matrix6d::Identity()});
  const auto insert = [&store](const proto::Record& record) {
    proto::InsertRequest request;
    *request.add_records() = record;
    return store->Insert(request).reply;
  };
  EXPECT_EQ(insert(edge).error().field(), "records[0].pose_graph_edge.to") << "it skips a node";
  for (const char* const source : {"apriltag", "slam_toolbox"}) {
    edge.mutable_pose_graph_edge()->set_source(source);
    EXPECT_FALSE(IsError(insert(edge).error())) << source;
  }
  edge.set_timestamp_ns(2);
  EXPECT_EQ(insert(edge).error().text(), "loop closure 2:0 2:2 slam_toolbox already exists with other content");
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM pose_graph_edge WHERE source = 'apriltag' AND NOT is_range"), 1);
  const NodePrior prior{
      {2, 1}, 1, PriorExtent::kPositionYaw, Pose::FromPlanar(3, 4, 0.5), Matrix6d::Identity(), Eigen::Vector3d::Zero(),
      "gnss"};
  EXPECT_FALSE(IsError(insert(ToRecord(prior)).error()));
  EXPECT_EQ(Number(*store,
                   "SELECT count(*) FROM pose_prior WHERE node_index = 1 AND x = 3 AND abs(yaw - 0.5) < 1e-9 "
                   "AND source = 'gnss'"),
            1);
}

TEST(RecordStoreTest, ShowsWhichQuarantineARecordLifts) {
  auto store = OpenStore(StoreOptionsOf(2));
  InsertOne(*store, SampleRecord(proto::MAP_QUARANTINE, 2));
  proto::Record lift;
  *lift.mutable_map_quarantine()->mutable_lifts() = ToProto(RecordKey{{2, 0xa5, proto::MAP_QUARANTINE}, 1});
  InsertOne(*store, lift);
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM map_quarantine WHERE lifts = '2.00000000000000a5.31.1'"), 1);
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM map_quarantine WHERE lifts = ''"), 1);
}

TEST(RecordStoreTest, KeepsTheMapMatchOfTheHighestTermAndRun) {
  auto store = OpenStore(StoreOptionsOf(2));
  const auto match_of = [](std::uint64_t term, std::uint64_t run, double overlap) {
    proto::Record record = SampleRecord(proto::MAP_MATCH, 2);
    record.mutable_map_match()->mutable_term()->set_number(term);
    record.mutable_map_match()->set_run(run);
    record.mutable_map_match()->set_overlap(overlap);
    return record;
  };
  InsertOne(*store, match_of(2, 1, 0.25));
  InsertOne(*store, match_of(2, 2, 0.75));
  InsertOne(*store, match_of(1, 9, 0.5));
  EXPECT_EQ(Number(*store, "SELECT count(*) FROM map_match"), 1);
  EXPECT_EQ(
      Number(*store,
             "SELECT count(*) FROM map_match WHERE from_agent = 2 AND from_index = 1 AND to_index = 2 AND x = 0.5 "
             "AND overlap = 0.75 AND from_timestamp_ns = 1 AND to_map = '2.0000000000000001.30.1' "
             "AND term_number = 2 AND run = 2 AND seq = 2"),
      1);
  proto::ReadRequest request;
  request.add_data_types(proto::MAP_MATCH);
  const Result<proto::ReadReply> read = store->Read(request);
  ASSERT_TRUE(read);
  ASSERT_EQ(read->records_size(), 1);
  proto::Record record;
  ASSERT_TRUE(record.ParseFromString(read->records(0).content()));
  record.clear_is_state();
  EXPECT_EQ(record.SerializeAsString(), match_of(2, 2, 0.75).SerializeAsString());
}

proto::SaveRolesRequest Saving(const proto::RoleAssignment& roles) {
  proto::SaveRolesRequest request;
  *request.mutable_roles() = roles;
  return request;
}

TEST(RecordStoreTest, KeepsTheNewestRoleAssignments) {
  TemporaryFolder folder;
  const auto options = StoreOptionsOf(2, folder.File("store.db"));
  {
    auto store = OpenStore(StoreOptionsOf(2));
    for (int i = 1; i <= kRoleHistoryMax + 3; ++i) {
      proto::RoleAssignment roles;
      roles.mutable_term()->set_number(i);
      ASSERT_TRUE(store->SaveRoles(Saving(roles)));
      ASSERT_TRUE(store->SaveRoles(Saving(roles)));
    }
    const proto::LoadRolesReply loaded = *store->LoadRoles();
    ASSERT_EQ(loaded.history_size(), kRoleHistoryMax);
    EXPECT_EQ(loaded.history(0).term().number(), 4u);
    EXPECT_EQ(loaded.history(kRoleHistoryMax - 1).term().number(), kRoleHistoryMax + 3u);
  }
  proto::RoleAssignment roles;
  roles.set_leader(1);
  ASSERT_TRUE(OpenStore(options)->SaveRoles(Saving(roles)));
  EXPECT_EQ(OpenStore(options)->LoadRoles()->history(0).leader(), 1u);
}

TEST(RecordStoreTest, LeavesOutADamagedRoleAssignment) {
  auto store = OpenStore(StoreOptionsOf(2));
  for (int number = 1; number <= 3; ++number) {
    proto::RoleAssignment roles;
    roles.mutable_term()->set_number(number);
    ASSERT_TRUE(store->SaveRoles(Saving(roles)));
  }
  ASSERT_TRUE(store->database().Execute("UPDATE role_history SET content = x'0a02087f' WHERE row_id = 2"));
  const proto::LoadRolesReply loaded = *store->LoadRoles();
  ASSERT_EQ(loaded.history_size(), 2);
  EXPECT_EQ(loaded.history(1).term().number(), 3u);
}

TEST(RecordStoreTest, ReportsTheTimesOfTheFirstAndTheLastMapOfEachOrigin) {
  TemporaryFolder folder;
  const RecordStore::Options options = StoreOptionsOf(2, folder.File("store.db"));
  auto store = OpenStore(options);
  EXPECT_EQ(store->GetStatus(0)->map_times_size(), 0);
  constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;
  const auto insert = [&store](std::uint64_t index, std::int64_t timestamp_ns) {
    proto::Record record = MapRecord({2, index});
    record.set_timestamp_ns(timestamp_ns);
    InsertOne(*store, record);
  };
  insert(1, kStart_ns + 30);
  insert(2, kStart_ns + 20);
  const auto times = [&store] { return store->GetStatus(0)->map_times(0); };
  EXPECT_EQ(times().origin_agent(), 2u);
  EXPECT_EQ(times().first_ns(), kStart_ns + 30) << "in the order of the inserts";
  EXPECT_EQ(times().last_ns(), kStart_ns + 20);
  store.reset();
  store = OpenStore(options);  // The next insert begins a new epoch.
  insert(3, 40);
  EXPECT_EQ(times().first_ns(), kStart_ns + 30);
  EXPECT_EQ(times().last_ns(), 0) << "its clock was never set";
  insert(4, kStart_ns + 50);
  EXPECT_EQ(times().last_ns(), kStart_ns + 50);
}

TEST(RecordStoreTest, CountsByOriginAndType) {
  TemporaryFolder folder;
  auto store = OpenStore(StoreOptionsOf(2, folder.File("store.db")));
  InsertOne(*store, NodeRecord(2, 1));
  InsertOne(*store, NodeRecord(2, 2), /*is_local=*/true);
  InsertOne(*store, TemperatureRecord(1));
  InsertOne(*store, TemperatureRecord(2));
  StoreOne(*store, Packed(Key(3, proto::POSE_GRAPH_NODE, 1), NodeRecord(3, 1)));
  const proto::StorageStatus status = *store->GetStatus();
  std::map<std::pair<AgentId, DataType>, double> counts;
  for (const proto::RecordCount& count : status.counts())
    counts[{count.origin_agent(), count.data_type()}] = count.count();
  EXPECT_EQ(counts,
            (std::map<std::pair<AgentId, DataType>, double>{
                {{2, proto::TEMPERATURE}, 1}, {{2, proto::POSE_GRAPH_NODE}, 2}, {{3, proto::POSE_GRAPH_NODE}, 1}}));
  EXPECT_GT(status.database_bytes(), 0);
  EXPECT_GT(status.disk_free_bytes(), 0);
}

}  // namespace
}  // namespace moondb
