#include "actors/storage/storage_actor.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "actors/storage/verify.h"
#include "model/control_message.h"
#include "proto/control.pb.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "runtime/simulation/simulated_team.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

class StorageActorTest : public testing::Test {
 protected:
  StorageActorTest() {
    for (const AgentId id : {1u, 2u}) {
      proto::AgentConfig& agent = *options_.team.add_agents();
      agent.set_id(id);
      agent.set_name("agent-" + std::to_string(id));
    }
    (*options_.team.mutable_share())["temperature"] = proto::POLICY_LATEST;
    (*options_.team.mutable_share())["pose_graph_node"] = proto::POLICY_ALL;
    options_.self = 2;
    options_.path = folder_.File("agent.db");
    team_.AddAgent(2);
    for (const char* actor : {"merge", "pgo"}) team_.Watch({2, actor}, Topic::kStored);
  }

  void Start() {
    team_.Spawn(2, "storage", [this] { return std::make_unique<StorageActor>(options_); });
    team_.RunUntilIdle();
    started_ = team_.TakeMessages({2, "merge"});
    (void)team_.TakeMessages({2, "pgo"});
  }

  proto::Message Ask(proto::Message question) {
    question.set_request_id(++request_id_);
    EXPECT_EQ(team_.Post({2, "test"}, {2, "storage"}, std::move(question)), SendResult::kAccepted);
    team_.RunUntilIdle();
    const std::vector<proto::Message> replies = team_.TakeMessages({2, "test"});
    EXPECT_EQ(replies.size(), 1u);
    if (replies.empty()) return {};
    EXPECT_EQ(replies[0].request_id(), request_id_);
    return replies[0];
  }

  proto::InsertReply Insert(const proto::Record& record) {
    proto::Message question;
    *question.mutable_insert_request()->add_records() = record;
    return Ask(std::move(question)).insert_reply();
  }

  proto::ReadReply ReadAll() {
    proto::Message question;
    question.mutable_read_request();
    return Ask(std::move(question)).read_reply();
  }

  proto::StorageStatus Status() {
    proto::ControlRequest question;
    question.mutable_status();
    const auto answer = ControlReplyOf(Ask(MessageOf(question)));
    EXPECT_TRUE(answer);
    return answer ? answer->status().storage() : proto::StorageStatus();
  }

  TemporaryFolder folder_;
  StorageActor::Options options_;
  std::uint64_t request_id_ = 0;
  // Messages that the actor published at its start.
  std::vector<proto::Message> started_;
  simulation::SimulatedTeam team_{/*seed=*/1};
};

TEST_F(StorageActorTest, PublishesAtItsStartThatAnEarlierProcessMayHavePruned) {
  Start();
  ASSERT_EQ(started_.size(), 1u);
  EXPECT_TRUE(started_[0].records_stored().is_pruned());
  EXPECT_EQ(started_[0].records_stored().last_row_id(), 0u);
}

TEST_F(StorageActorTest, AnswersInsertsAndNotifiesOtherActorsOfNewRows) {
  Start();
  const proto::InsertReply reply = Insert(NodeRecord(2, 1));
  ASSERT_EQ(reply.keys_size(), 1);
  for (const char* actor : {"merge", "pgo"}) {
    const std::vector<proto::Message> reported = team_.TakeMessages({2, actor});
    ASSERT_EQ(reported.size(), 1u) << actor;
    EXPECT_EQ(reported[0].records_stored().last_row_id(), 1u);
    ASSERT_EQ(reported[0].records_stored().data_types_size(), 1);
    EXPECT_EQ(reported[0].records_stored().data_types(0), static_cast<DataType>(proto::POSE_GRAPH_NODE));
  }
  // The next inserts add no row, so nothing is published.
  Insert(NodeRecord(2, 1));
  EXPECT_TRUE(IsError(Insert(NodeRecord(1, 1)).error()));
  EXPECT_TRUE(team_.TakeMessages({2, "merge"}).empty());
}

TEST_F(StorageActorTest, KeepsItsRecordsAndRolesAcrossAKill) {
  Start();
  const proto::RecordKey before = Insert(NodeRecord(2, 1)).keys(0);
  proto::Message save;
  save.mutable_save_roles_request()->mutable_roles()->set_leader(1);
  EXPECT_FALSE(IsError(Ask(save).save_roles_reply().error()));
  team_.Crash(2);
  team_.Restart(2);
  EXPECT_EQ(ReadAll().records_size(), 1);
  proto::Message load;
  load.mutable_load_roles_request();
  const proto::LoadRolesReply loaded = Ask(load).load_roles_reply();
  ASSERT_EQ(loaded.history_size(), 1);
  EXPECT_EQ(loaded.history(0).leader(), 1u);
  const proto::RecordKey after = Insert(NodeRecord(2, 2)).keys(0);
  EXPECT_GT(after.epoch(), before.epoch());
}

TEST_F(StorageActorTest, AcknowledgesAPeersRecordsWithItsNewHaveSet) {
  Start();
  proto::Message question;
  *question.mutable_store_request()->add_records() =
      Packed(RecordKey{StreamKey{1, 9, proto::POSE_GRAPH_NODE}, 2}, NodeRecord(1, 1));
  const proto::StoreReply reply = Ask(question).store_reply();
  EXPECT_EQ(reply.stored_count(), 1u);
  ASSERT_EQ(reply.covered().streams_size(), 1);
  EXPECT_EQ(reply.covered().streams(0).held(0).first(), 2u);
  proto::Message have;
  have.mutable_have_request();
  EXPECT_EQ(Ask(have).have_reply().have().SerializeAsString(), reply.covered().SerializeAsString());
  proto::Message missing;
  missing.mutable_missing_request();
  EXPECT_EQ(Ask(missing).missing_reply().records_size(), 1);
}

// --- Epochs that peers know ---

class EpochReportTest : public StorageActorTest {
 protected:
  EpochReportTest() {
    team_.AddAgent(1);
    team_.AddAgent(7);  // Agent 7 is not in the team.
    Start();
    team_.RunUntilIdle();
  }

  void Report(AgentId from, std::uint64_t epoch) {
    proto::Message report;
    report.mutable_epoch_report()->add_epochs(epoch);
    (void)team_.Post({from, "storage"}, {2, "storage"}, std::move(report));
    team_.AdvanceTime(std::chrono::seconds(1));
  }
  // Returns an epoch of another disk, with a counter that is 5 higher than the counter of `epoch`.
  static std::uint64_t OfAnotherDisk(std::uint64_t epoch) {
    const EpochParts parts = PartsOf(epoch);
    return EpochOf({parts.counter + 5, parts.tag ^ 1, 0, 0}, epoch);
  }
  std::uint64_t EpochOfTheState() {
    proto::Message question;
    question.mutable_read_request()->add_data_types(proto::TEMPERATURE);
    const proto::ReadReply reply = Ask(std::move(question)).read_reply();
    return reply.records_size() == 1 ? reply.records(0).key().epoch() : 0;
  }
};

TEST_F(EpochReportTest, ReportsEpochsToAPeerWhenALinkComesUp) {
  proto::Message question;
  for (const std::uint64_t epoch : {9, 4}) {
    *question.mutable_store_request()->add_records() =
        Packed(RecordKey{StreamKey{1, epoch, proto::POSE_GRAPH_NODE}, 2}, NodeRecord(1, epoch));
  }
  Ask(question);
  EXPECT_TRUE(team_.TakeMessages({1, "storage"}).empty());
  for (int i = 0; i < 2; ++i) {
    team_.SetLink(1, 2, false);
    team_.SetLink(1, 2, true);
    team_.AdvanceTime(std::chrono::seconds(1));
    const std::vector<proto::Message> reported = team_.TakeMessages({1, "storage"});
    ASSERT_EQ(reported.size(), 1u);
    EXPECT_EQ(reported[0].ms_type(), proto::CONTROL);
    EXPECT_EQ(reported[0].epoch_report().ShortDebugString(), "epochs: 4 epochs: 9");
  }
  team_.SetLink(2, 7, false);
  team_.SetLink(2, 7, true);
  team_.AdvanceTime(std::chrono::seconds(1));
  EXPECT_TRUE(team_.TakeMessages({7, "storage"}).empty()) << "of which it knows none";
}

TEST_F(EpochReportTest, ReportsEpochsAgainBeforeItReturnsAPeersOwnRecords) {
  proto::Message question;
  for (const std::uint64_t epoch : {9, 4}) {
    *question.mutable_store_request()->add_records() =
        Packed(RecordKey{StreamKey{1, epoch, proto::POSE_GRAPH_NODE}, 2}, NodeRecord(1, epoch));
  }
  Ask(question);
  for (const AgentId destination : {1u, 7u}) {
    proto::Message missing;
    missing.mutable_missing_request()->set_destination(destination);
    missing.mutable_missing_request()->set_records_max(1);
    ASSERT_EQ(Ask(missing).missing_reply().records_size(), 1);
    team_.AdvanceTime(std::chrono::seconds(1));
    const std::vector<proto::Message> reported = team_.TakeMessages({destination, "storage"});
    ASSERT_EQ(reported.size(), destination == 1 ? 1u : 0u);
    for (const proto::Message& report : reported) {
      EXPECT_EQ(report.epoch_report().ShortDebugString(), "epochs: 4 epochs: 9");
    }
  }
}

TEST_F(EpochReportTest, ReissuesEndangeredStatesAndNotifiesReaders) {
  const std::uint64_t epoch = Insert(TemperatureRecord(20)).keys(0).epoch();
  (void)team_.TakeMessages({2, "merge"});
  const std::uint64_t later = OfAnotherDisk(epoch);
  Report(1, later);
  EXPECT_GT(EpochOfTheState(), later);
  const std::vector<proto::Message> reported = team_.TakeMessages({2, "merge"});
  ASSERT_EQ(reported.size(), 2u);
  EXPECT_EQ(reported[0].records_stored().data_types(0), static_cast<DataType>(proto::AGENT_EVENT));
  EXPECT_EQ(reported[1].records_stored().data_types(0), static_cast<DataType>(proto::TEMPERATURE));
}

TEST_F(EpochReportTest, IsAFindingIfTheDiskWasReplacedOrRestored) {
  const std::uint64_t epoch = Insert(TemperatureRecord(20)).keys(0).epoch();
  Report(1, epoch);
  const auto findings = [this] {
    proto::Message question;
    question.mutable_findings_request();
    const auto reply = ControlReplyOf(Ask(std::move(question)));
    return reply ? reply->status().findings() : proto::AgentStatus().findings();
  };
  EXPECT_TRUE(findings().empty()) << "peers know what this disk has";
  Report(1, OfAnotherDisk(epoch));
  Report(3, OfAnotherDisk(OfAnotherDisk(epoch)));
  ASSERT_EQ(findings().size(), 1) << "once, however many agents know more";
  EXPECT_EQ(findings()[0].text().find("times"), std::string::npos);
  EXPECT_NE(findings()[0].text().find("its disk does not have"), std::string::npos) << findings()[0].text();
}

TEST_F(EpochReportTest, AcceptsOnlyEpochReportsFromPeersAndNothingFromOutsideTheTeam) {
  const std::uint64_t epoch = Insert(TemperatureRecord(20)).keys(0).epoch();
  Report(7, OfAnotherDisk(epoch));
  EXPECT_EQ(EpochOfTheState(), epoch);
  proto::Message insert;
  *insert.mutable_insert_request()->add_records() = TemperatureRecord(21);
  proto::Message roles;
  roles.mutable_save_roles_request()->mutable_roles()->set_leader(1);
  proto::Message read;
  read.mutable_read_request();
  for (const proto::Message& message : {insert, roles, read}) {
    (void)team_.Post({1, "sync"}, {2, "storage"}, message);
    team_.AdvanceTime(std::chrono::seconds(1));
    EXPECT_TRUE(team_.TakeMessages({1, "sync"}).empty());
  }
  EXPECT_EQ(EpochOfTheState(), epoch);
  proto::Message load;
  load.mutable_load_roles_request();
  EXPECT_EQ(Ask(load).load_roles_reply().history_size(), 0);
}

TEST_F(StorageActorTest, AnswersVerifyAndFingerprintRequests) {
  Start();
  const proto::RecordKey key = Insert(NodeRecord(2, 1)).keys(0);
  proto::Message verify;
  verify.mutable_verify_request()->set_part(proto::VERIFY_PART_ROWS);
  EXPECT_EQ(Ask(verify).verify_reply().checked_count(), 1);
  verify.mutable_verify_request()->clear_part();
  EXPECT_EQ(Ask(verify).verify_reply().error().field(), "part");
  proto::Message fingerprint;
  proto::StreamHave& stream = *fingerprint.mutable_fingerprint_request()->mutable_stream();
  EXPECT_EQ(Ask(fingerprint).fingerprint_reply().error().field(), "stream.data_type");
  stream.set_origin_agent(key.origin_agent());
  stream.set_epoch(key.epoch());
  stream.set_data_type(key.data_type());
  stream.add_held()->set_first(1);
  stream.mutable_held(0)->set_last(1);
  EXPECT_EQ(Ask(fingerprint).fingerprint_reply().record_count(), 1);
}

TEST_F(StorageActorTest, ReportsAFullDiskAndContinues) {
  options_.bytes_max = 300'000;
  Start();
  proto::Message question;
  for (int i = 0; i < 5000; ++i) *question.mutable_insert_request()->add_records() = NodeRecord(2, i);
  EXPECT_EQ(Ask(question).insert_reply().error().code(), proto::ERROR_CODE_FULL);
  EXPECT_TRUE(team_.TakeMessages({2, "merge"}).empty());
  EXPECT_EQ(Insert(NodeRecord(2, 1)).keys_size(), 1);
  const proto::StorageStatus shown = Status();
  ASSERT_EQ(shown.counts_size(), 1);
  EXPECT_EQ(shown.counts(0).count(), 1);
  EXPECT_EQ(team_.restarts(2), 0u);
}

TEST_F(StorageActorTest, StoresPeersHaveSetsWithoutAReply) {
  Start();
  const proto::RecordKey key = Insert(NodeRecord(2, 1)).keys(0);
  proto::Message note;
  note.mutable_peer_have()->set_peer(1);
  *note.mutable_peer_have()->add_handed_over() = key;
  EXPECT_EQ(team_.Post({2, "test"}, {2, "storage"}, note), SendResult::kAccepted);
  team_.RunUntilIdle();
  EXPECT_TRUE(team_.TakeMessages({2, "test"}).empty());
}

// Damages a page of table pose_graph_node. The store does not read this page at its start if `is_checked` is true.
TEST_F(StorageActorTest, EndsItsProcessWhenTheFileTurnsOutToBeDamaged) {
  {
    auto store = OpenStore(StorageActor::StoreOptions(options_));
    for (int i = 0; i < 200; ++i) InsertOne(*store, NodeRecord(2, i));
    ASSERT_TRUE(store->database().Execute("PRAGMA wal_checkpoint(TRUNCATE)"));
    const std::int64_t page =
        *store->database().Number("SELECT rootpage FROM sqlite_master WHERE name = 'pose_graph_node'");
    store.reset();
    std::fstream file(options_.path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp((page - 1) * 4096);
    file << std::string(4096, '\x5a');
  }
  options_.is_checked = true;
  Start();
  ASSERT_TRUE(team_.is_running(2));
  proto::Message question;
  question.mutable_read_request();
  (void)team_.Post({2, "test"}, {2, "storage"}, std::move(question));
  team_.RunUntilIdle();
  EXPECT_FALSE(team_.is_running(2));
  EXPECT_EQ(team_.TakeMessages({2, "test"}).at(0).read_reply().error().code(), proto::ERROR_CODE_CORRUPT);
  EXPECT_FALSE(std::filesystem::exists(options_.path + ".damaged-1"));

  options_.is_checked = false;
  team_.Restart(2);
  EXPECT_EQ(ReadAll().records_size(), 0);
  EXPECT_TRUE(std::filesystem::exists(options_.path + ".damaged-1"));
}

TEST_F(StorageActorTest, ScrubsItsStoreEachDayAndEndsTheProcessIfARowIsDamaged) {
  // Checks the file and the disk once per hour instead of every 10 s, because the test covers three days of virtual
  // time.
  options_.tend_period = std::chrono::hours(1);
  options_.scrub_pause = std::chrono::minutes(1);
  Start();
  for (int i = 0; i < 3 * static_cast<int>(kVerifyRecordsMax) / 2; ++i) Insert(NodeRecord(2, i));
  team_.AdvanceTime(std::chrono::hours(49));
  ASSERT_TRUE(team_.is_running(2));
  team_.Crash(2);
  {
    const auto database = Database::Open(options_.path, 0, "");
    ASSERT_TRUE(database) << database.error().text;
    ASSERT_TRUE(
        (*database)->Execute("UPDATE pose_graph_node SET content = CAST(content || x'00' AS BLOB) WHERE seq = 2500"));
  }
  // Skips the check at the start, which would find the damage.
  options_.is_checked = true;
  team_.Restart(2);
  team_.AdvanceTime(std::chrono::hours(24));
  EXPECT_TRUE(team_.is_running(2)) << "the damaged row is not in the first part";
  team_.AdvanceTime(std::chrono::minutes(2));
  EXPECT_FALSE(team_.is_running(2));
  options_.is_checked = false;
  team_.Restart(2);
  ASSERT_TRUE(team_.is_running(2));
  proto::Message question;
  question.mutable_have_request();
  const HaveSet have = *FromProto(Ask(std::move(question)).have_reply().have());
  ASSERT_EQ(have.streams().size(), 1u);
  EXPECT_FALSE(have.streams().begin()->second.held.Contains(2500)) << "who has it sends it again";
}

TEST_F(StorageActorTest, ContinuesDespiteADamagedLocalRecord) {
  // Checks the file and the disk once per hour instead of every 10 s, because the test covers 49 hours of virtual time.
  options_.tend_period = std::chrono::hours(1);
  Start();
  proto::Message question;
  *question.mutable_insert_request()->add_records() = NodeRecord(2, 1);
  question.mutable_insert_request()->set_is_local(true);
  EXPECT_FALSE(IsError(Ask(std::move(question)).insert_reply().error()));
  team_.Crash(2);
  ASSERT_TRUE((*Database::Open(options_.path, 0, ""))
                  ->Execute("UPDATE pose_graph_node SET content = CAST(content || x'00' AS BLOB)"));
  team_.Restart(2);
  team_.AdvanceTime(std::chrono::hours(49));
  EXPECT_TRUE(team_.is_running(2));
}

TEST_F(StorageActorTest, FailsIfTheFileCannotBeOpened) {
  options_.path = "/nonexistent/folder/agent.db";
  EXPECT_FALSE(RecordStore::Open(StorageActor::StoreOptions(options_)));
  Start();
  EXPECT_GE(team_.restarts(2), 1u);
}

TEST_F(StorageActorTest, AcknowledgesNothingAndEndsTheProcessIfItsFileWasRemoved) {
  Start();
  Insert(NodeRecord(2, 1));
  std::filesystem::remove(options_.path);
  EXPECT_EQ(Insert(NodeRecord(2, 2)).error().code(), proto::ERROR_CODE_CORRUPT);
  team_.RunUntilIdle();
  EXPECT_FALSE(team_.is_running(2));
}

TEST_F(StorageActorTest, DetectsARemovedFileWhileIdle) {
  Start();
  Insert(NodeRecord(2, 1));
  std::filesystem::remove(options_.path);
  team_.AdvanceTime(std::chrono::seconds(11));
  EXPECT_FALSE(team_.is_running(2));
}

TEST_F(StorageActorTest, AStartWritesNothingIfNothingChanged) {
  Start();
  Insert(NodeRecord(2, 1));
  team_.CrashActor({2, "storage"});
  const double log_bytes = Status().wal_bytes();
  team_.AdvanceTime(std::chrono::seconds(1));
  team_.CrashActor({2, "storage"});
  team_.AdvanceTime(std::chrono::seconds(1));
  EXPECT_EQ(Status().wal_bytes(), log_bytes);
}

}  // namespace
}  // namespace moondb
