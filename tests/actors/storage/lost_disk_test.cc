// Tests an agent whose disk was lost, replaced or restored from a backup. The agent stores new records before it learns
// which epochs it began on its former disk. The state that the agent stored last must win at all agents.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "actors/storage/own_epochs.h"
#include "actors/storage/store_file.h"
#include "model/record_hash.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::UnorderedElementsAre;

constexpr AgentId kSelf = 2;
constexpr AgentId kPeer = 1;
constexpr DataType kBeacon = 1001;

std::int64_t Number(RecordStore& store, const std::string& sql) { return *store.database().Number(sql); }

double Celsius(RecordStore& store) { return static_cast<double>(Number(store, "SELECT celsius FROM temperature")); }

HaveSet HaveOf(const RecordStore& store) { return *FromProto(store.GetHave().have()); }

// Exchanges records until each store covers all records of the other.
void Exchange(RecordStore& a, RecordStore& b) {
  for (int round = 0; round < 100; ++round) {
    const bool is_moving = Transfer(a, b);
    if (!Transfer(b, a) && !is_moving) return;
  }
  ADD_FAILURE() << "there is no end";
}

// Returns the records of type beacon as "key=payload", for example "a=2".
std::vector<std::string> Beacons(RecordStore& store) {
  std::vector<std::string> beacons;
  for (const proto::StoredRecord& stored : Contents(store)) {
    proto::Record record;
    EXPECT_TRUE(record.ParseFromString(stored.content()));
    if (record.has_custom()) beacons.push_back(record.custom().latest_key() + "=" + record.custom().payload());
  }
  return beacons;
}

// `store_` is the store of the agent whose disk is lost or replaced. `peer_` is the store of a peer that keeps its
// disk.
class LostDiskTest : public testing::Test {
 protected:
  // Restarts the agent with the file at `path_`. Creates a new file if there is none.
  void Restart() {
    store_.reset();
    store_ = OpenStore(StoreOptionsOf(kSelf, path_, ++seed_));
  }
  void Remove() {
    store_.reset();
    for (const char* ending : {"", "-wal", "-shm"}) std::filesystem::remove(path_ + ending);
  }
  void Wipe() {
    Remove();
    Restart();
  }
  // Stops the agent, copies its file to `name`, and restarts the agent.
  void CopyAside(const std::string& name) {
    store_.reset();
    std::filesystem::copy_file(path_, folder_.File(name));
    Restart();
  }
  void PutBack(const std::string& name) {
    Remove();
    std::filesystem::copy_file(folder_.File(name), path_);
    Restart();
  }
  void BackUp(const std::string& name) {
    const Result<void> done = BackUpStore(path_, folder_.File(name));
    ASSERT_TRUE(done) << ToString(done.error());
  }

  // Restarts the agent `lives` times. After each restart the agent stores a new state, and both stores exchange all
  // records.
  void Live(int lives) {
    for (int i = 0; i < lives; ++i) {
      Restart();
      InsertOne(*store_, TemperatureRecord(++celsius_));
      Exchange(*store_, *peer_);
    }
  }

  TemporaryFolder folder_;
  const std::string path_ = folder_.File("store.db");
  std::uint64_t seed_ = 0;
  double celsius_ = 0;
  std::unique_ptr<RecordStore> store_ = OpenStore(StoreOptionsOf(kSelf, path_, ++seed_));
  std::unique_ptr<RecordStore> peer_ = OpenStore(StoreOptionsOf(1));
};

TEST_F(LostDiskTest, AStateFromAnEmptyDiskWinsOverOlderStatesThatPeersReturn) {
  Live(3);
  Wipe();
  const proto::RecordKey key = InsertOne(*store_, TemperatureRecord(50));
  ASSERT_EQ(key.epoch() >> 48, 1u) << "it does not know its earlier epochs";
  const std::string content = Contents(*store_)[0].content();
  // The peer returns the agent's own earlier records.
  Transfer(*peer_, *store_);
  EXPECT_EQ(Celsius(*store_), 50);
  Exchange(*store_, *peer_);
  EXPECT_EQ(Celsius(*store_), 50);
  EXPECT_EQ(Celsius(*peer_), 50);
  EXPECT_EQ(Contents(*peer_)[0].content(), content) << "with its timestamp";
  EXPECT_GT(Contents(*store_)[0].key().epoch() >> 48, 3u);
  EXPECT_EQ(HaveOf(*store_), HaveOf(*peer_));
  EXPECT_GT(InsertOne(*store_, TemperatureRecord(51)).epoch(), key.epoch());
}

TEST_F(LostDiskTest, LearnsItsLaterEpochsFromAReportAHaveSetOrANoteOfAnAcknowledgment) {
  Live(2);
  for (int way = 0; way < 3; ++way) {
    SCOPED_TRACE(way);
    Wipe();
    const proto::RecordKey before = InsertOne(*store_, TemperatureRecord(60 + way));
    proto::MissingRequest question;
    *question.mutable_destination_have() = peer_->GetHave().have();
    proto::PeerHave note;
    note.set_peer(1);
    *note.mutable_acknowledged() = peer_->GetHave().have();
    if (way == 0) {
      ASSERT_TRUE(store_->ObserveEpochReport(kPeer, peer_->ReportEpochs(kSelf)));
    } else if (way == 1) {
      ASSERT_TRUE(store_->GetMissing(question));
    } else {
      ASSERT_TRUE(store_->ObservePeerHave(note));
    }
    ASSERT_EQ(Contents(*store_).size(), 1u);
    const std::uint64_t after = Contents(*store_)[0].key().epoch();
    const proto::EpochReport report = peer_->ReportEpochs(kSelf);
    EXPECT_GT(after, report.epochs(report.epochs_size() - 1));
    EXPECT_TRUE(HaveOf(*store_).Get(FromProto(before).stream).dropped.Contains(1)) << "in the same transaction";
    EXPECT_GT(store_->TakeReissued().last_row_id(), 0u) << "readers of this agent hear of it";
    EXPECT_EQ(store_->TakeReissued().last_row_id(), 0u);
    Exchange(*store_, *peer_);
    EXPECT_EQ(Celsius(*peer_), 60 + way);
  }
}

TEST_F(LostDiskTest, AStateWinsTwoRestartsAfterABackupWasRestored) {
  Live(2);
  BackUp("backup.db");
  // The backup does not contain the states of these three restarts. Only the peer still has the newest of these states.
  Live(3);
  PutBack("backup.db");
  InsertOne(*store_, CustomRecordOf(kBeacon, "1", "a"));
  Restart();
  InsertOne(*store_, CustomRecordOf(kBeacon, "2", "b"));
  Exchange(*store_, *peer_);
  EXPECT_THAT(Beacons(*peer_), UnorderedElementsAre("a=1", "b=2"));
  // The temperature in the backup is older than the temperatures that the lost disk stored after the backup.
  EXPECT_EQ(Celsius(*store_), celsius_);
  EXPECT_EQ(Celsius(*peer_), celsius_);

  PutBack("backup.db");
  InsertOne(*store_, TemperatureRecord(70));
  Restart();
  Restart();
  InsertOne(*store_, NodeRecord(kSelf, 1));
  Exchange(*store_, *peer_);
  EXPECT_EQ(Celsius(*store_), 70);
  EXPECT_EQ(Celsius(*peer_), 70);
}

// The copy was not made by BackUpStore, so nothing marks it as a copy. The original file knew all records in the copy.
TEST_F(LostDiskTest, AStateWinsAfterAnUnmarkedCopyWasRestored) {
  Live(2);
  CopyAside("copy.db");
  Live(3);
  PutBack("copy.db");
  InsertOne(*store_, CustomRecordOf(kBeacon, "1", "a"));
  Restart();
  Exchange(*store_, *peer_);
  EXPECT_EQ(Celsius(*store_), celsius_) << "the copy's own is older";
  PutBack("copy.db");
  Restart();
  InsertOne(*store_, TemperatureRecord(80));
  Exchange(*store_, *peer_);
  EXPECT_EQ(Celsius(*store_), 80);
  EXPECT_EQ(Celsius(*peer_), 80);
  EXPECT_THAT(Beacons(*peer_), ElementsAre("a=1"));
}

TEST_F(LostDiskTest, TheReplacementDisksStatesWinWhenTheOldDiskReturns) {
  Live(3);
  CopyAside("old.db");
  Wipe();
  ASSERT_TRUE(store_->ObserveEpochReport(kPeer, peer_->ReportEpochs(kSelf)));
  Live(2);
  InsertOne(*store_, CustomRecordOf(kBeacon, "new", "a"));
  Exchange(*store_, *peer_);
  PutBack("old.db");
  Exchange(*store_, *peer_);
  EXPECT_EQ(Celsius(*store_), celsius_);
  EXPECT_EQ(Celsius(*peer_), celsius_);
  EXPECT_THAT(Beacons(*store_), ElementsAre("a=new"));
}

// The agent learns of one later epoch of a replacement disk. No agent has the epochs on which that epoch is based, so
// the agent cannot find out which states the replacement disk knew.
TEST_F(LostDiskTest, AnOldDiskThatLearnsOnlyALaterEpochAssumesThatItsSharedStatesWereKnown) {
  Live(2);
  InsertOne(*store_, CustomRecordOf(kBeacon, "1", "a"));
  Exchange(*store_, *peer_);
  proto::PeerHave acknowledged;
  acknowledged.set_peer(1);
  *acknowledged.mutable_acknowledged() = peer_->GetHave().have();
  ASSERT_TRUE(store_->ObservePeerHave(acknowledged));
  InsertOne(*store_, CustomRecordOf(kBeacon, "2", "b"));
  proto::EpochReport report;
  report.add_epochs(EpochOf({PartsOf(Contents(*store_)[0].key().epoch()).counter + 5, 1, 1, 1}, 0));
  ASSERT_TRUE(store_->ObserveEpochReport(kPeer, report));
  // Epoch of each beacon, by the beacon's latest_key.
  std::map<std::string, std::uint64_t> epochs;
  for (const proto::StoredRecord& record : Contents(*store_)) {
    proto::Record beacon;
    if (record.key().data_type() != kBeacon || !beacon.ParseFromString(record.content())) continue;
    epochs[beacon.custom().latest_key()] = record.key().epoch();
  }
  EXPECT_LT(epochs.at("a"), report.epochs(0)) << "known to some agent";
  EXPECT_GT(epochs.at("b"), report.epochs(0)) << "nobody else has it";
}

TEST_F(LostDiskTest, StatesWinThoughTwoPeersReportLaterEpochsInTurn) {
  Live(2);
  auto late = OpenStore(StoreOptionsOf(3));
  Live(3);
  Exchange(*store_, *late);
  auto early = OpenStore(StoreOptionsOf(9));
  for (const proto::StoredRecord& record : Contents(*late)) {
    proto::StoredRecord earlier = record;
    earlier.mutable_key()->set_epoch(record.key().epoch() - (2ull << 48));
    earlier.set_hash(HashRecord(FromProto(earlier.key()), earlier.content()));
    EXPECT_EQ(StoreOne(*early, earlier).stored_count(), 1u);
  }
  Wipe();
  InsertOne(*store_, TemperatureRecord(90));
  InsertOne(*store_, CustomRecordOf(kBeacon, "1", "a"));
  InsertOne(*store_, CustomRecordOf(kBeacon, "2", "b"));
  InsertOne(*store_, CustomRecordOf(kBeacon, "3", "a"));
  Exchange(*store_, *early);
  const std::uint64_t between = Contents(*store_)[0].key().epoch();
  EXPECT_LT(between, late->ReportEpochs(kSelf).epochs(late->ReportEpochs(kSelf).epochs_size() - 1));
  InsertOne(*store_, CustomRecordOf(kBeacon, "4", "c"));
  Exchange(*store_, *late);
  Exchange(*store_, *early);
  for (RecordStore* store : {store_.get(), late.get(), early.get()}) {
    EXPECT_EQ(Celsius(*store), 90);
    EXPECT_THAT(Beacons(*store), UnorderedElementsAre("a=3", "b=2", "c=4"));
  }
}

TEST_F(LostDiskTest, StoresNoRecordOfALaterEpochBeforeReissuingItsStates) {
  Live(3);
  Wipe();
  InsertOne(*store_, TemperatureRecord(55));
  InsertOne(*store_, CustomRecordOf(kBeacon, "1", "a"));
  const std::string have = store_->GetHave().have().SerializeAsString();
  // Prepares commits that fail: SQLite checks a deferred constraint only at commit.
  ASSERT_TRUE(store_->database().Execute(
      "PRAGMA foreign_keys=ON; CREATE TABLE parent(id INTEGER PRIMARY KEY);"
      "CREATE TABLE child(id INTEGER REFERENCES parent(id) DEFERRABLE INITIALLY DEFERRED);"));
  const auto fail_commits = [this] {
    ASSERT_TRUE(store_->database().Execute(
        "PRAGMA foreign_keys=ON;"
        "CREATE TEMP TRIGGER orphan AFTER INSERT ON custom_record BEGIN INSERT INTO child VALUES(1); END;"));
  };
  fail_commits();
  proto::MissingRequest question;
  *question.mutable_destination_have() = peer_->GetHave().have();
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(StoreOne(*store_, Contents(*peer_)[0]).error().code(), proto::ERROR_CODE_INTERNAL);
    EXPECT_FALSE(store_->ObserveEpochReport(kPeer, peer_->ReportEpochs(kSelf)));
    EXPECT_TRUE(store_->GetMissing(question)) << "what is there is shared meanwhile";
    EXPECT_EQ(store_->TakeReissued().last_row_id(), 0u);
    EXPECT_EQ(store_->GetHave().have().SerializeAsString(), have);
    EXPECT_EQ(Celsius(*store_), 55);
    // The agent is killed before it could reissue its states.
    Restart();
    fail_commits();
  }
  ASSERT_TRUE(store_->database().Execute("DROP TRIGGER orphan"));
  Exchange(*store_, *peer_);
  EXPECT_EQ(Celsius(*store_), 55);
  EXPECT_EQ(Celsius(*peer_), 55);
  EXPECT_THAT(Beacons(*peer_), ElementsAre("a=1"));
}

// The peer reports the same epochs three times.
TEST_F(LostDiskTest, ReissuesAStateOnlyOnce) {
  Live(3);
  Wipe();
  InsertOne(*store_, TemperatureRecord(55));
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(store_->ObserveEpochReport(kPeer, peer_->ReportEpochs(kSelf)));
    Exchange(*store_, *peer_);
    Restart();
  }
  int epochs = 0;
  const HaveSet have_set = HaveOf(*store_);
  for (const auto& [stream, have] : have_set.streams()) epochs += stream.epoch >> 48 > 3 ? 1 : 0;
  EXPECT_EQ(epochs, 1);
}

TEST_F(LostDiskTest, DoesNotReissueLocalStatesOrRecordsUnderAnotherPolicy) {
  Live(3);
  Wipe();
  InsertOne(*store_, NodeRecord(kSelf, 1));
  InsertOne(*store_, CustomRecordOf(1000, "soil"));
  InsertOne(*store_, TemperatureRecord(55));
  InsertOne(*store_, TemperatureRecord(56), /*is_local=*/true);
  Exchange(*store_, *peer_);
  EXPECT_EQ(Number(*store_, "SELECT count(*) FROM temperature"), 2);
  EXPECT_EQ(Number(*store_, "SELECT epoch >> 48 FROM pose_graph_node"), 1);
  EXPECT_EQ(Number(*store_, "SELECT epoch >> 48 FROM custom_record"), 1);
  EXPECT_EQ(Celsius(*peer_), 55);
}

TEST_F(LostDiskTest, RefusesAMalformedEpochReport) {
  InsertOne(*store_, TemperatureRecord(1));
  const std::uint64_t own = store_->GetHave().epoch();
  const auto note = [this](const std::vector<std::uint64_t>& epochs) {
    proto::EpochReport report;
    for (const std::uint64_t epoch : epochs) report.add_epochs(epoch);
    const Result<void> noted = store_->ObserveEpochReport(kPeer, report);
    return noted ? std::string() : ToString(noted.error());
  };
  EXPECT_EQ(note({}), "");
  EXPECT_EQ(note({own + 5, own + 4}), "epochs: must be at least 1 and in rising order");
  EXPECT_EQ(note({own + 5, own + 5}), "epochs: must be at least 1 and in rising order");
  EXPECT_EQ(note({0, own + 5}), "epochs: must be at least 1 and in rising order");
  std::vector<std::uint64_t> many;
  for (std::uint64_t i = 1; i <= 65; ++i) many.push_back(own + i);
  EXPECT_EQ(note(many), "epochs: has more than 64 entries");
  EXPECT_EQ(store_->GetHave().epoch(), own);
  EXPECT_EQ(note({UINT64_MAX}), "");
  EXPECT_EQ(store_->GetHave().epoch(), own);
  EXPECT_EQ(store_->GetStatus()->rejected_count(), 1);
  many.pop_back();
  EXPECT_EQ(note(many), "");
  EXPECT_GT(store_->GetHave().epoch(), many.back());
}

TEST_F(LostDiskTest, ReportsTheHighestEpochsOfAnOrigin) {
  for (std::uint64_t epoch = 1; epoch <= 70; ++epoch) {
    StoreOne(*peer_, Packed({{kSelf, epoch, proto::TEMPERATURE}, 1}, TemperatureRecord(1)));
    StoreOne(*peer_, Packed({{3, epoch + 100, proto::TEMPERATURE}, 1}, TemperatureRecord(1)));
  }
  const proto::EpochReport report = peer_->ReportEpochs(kSelf);
  ASSERT_EQ(report.epochs_size(), 64);
  EXPECT_EQ(report.epochs(0), 7u);
  EXPECT_EQ(report.epochs(63), 70u);
  EXPECT_EQ(peer_->ReportEpochs(9).epochs_size(), 0);
}

// --- Poses and verdicts, which are ordered by term and run ---

double PoseX(RecordStore& store, std::uint64_t node) {
  return static_cast<double>(Number(store, "SELECT x FROM optimized_pose WHERE node_index = " + std::to_string(node)));
}

TEST_F(LostDiskTest, ALeadersPosesOfANewerTermWinInALowerEpoch) {
  for (std::uint64_t run = 1; run <= 3; ++run) {
    Restart();
    for (std::uint64_t node = 1; node <= 3; ++node) {
      InsertOne(*store_, OptimizedPoseRecord({kSelf, node}, /*term=*/5, run, 1.0 * static_cast<double>(run)));
    }
    if (run > 1) Exchange(*store_, *peer_);
  }
  Wipe();
  InsertOne(*store_, OptimizedPoseRecord({kSelf, 1}, /*term=*/6, 1, 60));
  // The peer has a newer pose of this node, from term 5.
  InsertOne(*store_, OptimizedPoseRecord({kSelf, 2}, /*term=*/4, 9, 49));
  const std::uint64_t low = store_->GetHave().epoch();
  Exchange(*store_, *peer_);
  for (RecordStore* store : {store_.get(), peer_.get()}) {
    EXPECT_EQ(Number(*store, "SELECT count(*) FROM optimized_pose"), 3);
    EXPECT_EQ(PoseX(*store, 1), 60);
    EXPECT_EQ(PoseX(*store, 2), 3);
    EXPECT_EQ(PoseX(*store, 3), 3);
  }
  EXPECT_EQ(HaveOf(*store_), HaveOf(*peer_)) << "both become idle";
  EXPECT_EQ(Number(*store_, "SELECT epoch FROM optimized_pose WHERE node_index = 1"), static_cast<std::int64_t>(low));

  // A third agent, which has no poses yet, receives the current poses. It then also accepts that the older poses were
  // dropped.
  auto third = OpenStore(StoreOptionsOf(3));
  Exchange(*peer_, *third);
  EXPECT_EQ(HaveOf(*third), HaveOf(*peer_));
}

TEST_F(LostDiskTest, IgnoresADropOfAPoseIfItHoldsNone) {
  const proto::RecordKey key = InsertOne(*store_, OptimizedPoseRecord({kSelf, 1}, 5, 1, 1));
  InsertOne(*store_, OptimizedPoseRecord({kSelf, 1}, 5, 2, 2));
  proto::StoreRequest reported;
  *reported.mutable_dropped() = store_->GetMissing({})->dropped();
  ASSERT_EQ(reported.dropped_size(), 1);
  EXPECT_EQ(peer_->Store(reported).reply.rejected_count(), 0u);
  EXPECT_TRUE(HaveOf(*peer_).Get(FromProto(key).stream).Covered().is_empty());
}

TEST_F(LostDiskTest, DropsAPoseOfAnOlderRunAtItsInsertion) {
  InsertOne(*store_, OptimizedPoseRecord({kSelf, 1}, 5, 7, 57));
  const proto::RecordKey older = InsertOne(*store_, OptimizedPoseRecord({kSelf, 1}, 5, 6, 56));
  EXPECT_EQ(older.seq(), 2u) << "acknowledged, and named";
  EXPECT_EQ(PoseX(*store_, 1), 57);
  EXPECT_TRUE(HaveOf(*store_).Get(FromProto(older).stream).dropped.Contains(2));
  InsertOne(*store_, OptimizedPoseRecord({kSelf, 1}, 5, 7, 58));
  EXPECT_EQ(PoseX(*store_, 1), 58) << "of one run the later one";
  Exchange(*store_, *peer_);
  EXPECT_EQ(HaveOf(*store_), HaveOf(*peer_));
}

TEST_F(LostDiskTest, SendsThePoseOfTheNewestTermIfOnlyTheNewestAreRequested) {
  auto options = StoreOptionsOf(1);
  options.policies[proto::OPTIMIZED_POSE] = proto::POLICY_ALL;
  auto all = OpenStore(options);
  const StreamKey low{kSelf, 4, proto::OPTIMIZED_POSE};
  const StreamKey high{kSelf, 9, proto::OPTIMIZED_POSE};
  StoreOne(*all, Packed({low, 1}, OptimizedPoseRecord({kSelf, 1}, 6, 1, 61)));
  StoreOne(*all, Packed({high, 1}, OptimizedPoseRecord({kSelf, 1}, 5, 8, 58)));
  proto::MissingRequest question;
  question.mutable_filter()->add_newest_only_types(proto::OPTIMIZED_POSE);
  const proto::MissingReply reply = *all->GetMissing(question);
  ASSERT_EQ(reply.records_size(), 1);
  EXPECT_EQ(reply.records(0).key().epoch(), 4u);
}

}  // namespace
}  // namespace moondb
