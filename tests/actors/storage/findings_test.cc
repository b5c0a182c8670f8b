// Tests how a store finds out at its start how the previous process ended, and which findings it then reports.
#include "actors/storage/findings.h"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>

#include "actors/storage/store_file.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr std::int64_t kNow_ns = 1'795'339'884'000'000'000;

class LastRunTest : public testing::Test {
 protected:
  RecordStore::Options Options() {
    ++seed_;
    return StoreOptionsOf(1, path_, seed_);
  }

  // Opens the store and logs how the previous process ended, as moondb_agent does before its actors run.
  std::unique_ptr<RecordStore> Start() {
    auto store = OpenStore(Options());
    const Result<void> written = store->LogLastRun(kNow_ns);
    EXPECT_TRUE(written) << ToString(written.error());
    return store;
  }

  static void Notify(RecordStore& store, proto::EventKind kind, const std::string& text) {
    InsertOne(store, MakeEvent(kind, text, "", kNow_ns));
  }

  static std::vector<std::string> Findings(RecordStore& store) {
    std::vector<std::string> texts;
    const std::vector<proto::HealthFinding> findings = *store.Findings();
    for (const proto::HealthFinding& finding : findings) texts.push_back(finding.text());
    return texts;
  }

  static std::vector<std::string> Story(RecordStore& store) {
    std::vector<std::string> texts;
    const std::vector<OwnEvent> events = *ReadOwnEvents(store.database(), 1, 100);
    for (const OwnEvent& event : events) texts.push_back(event.text);
    return texts;
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_.File("a.db");
  std::uint64_t seed_ = 0;
};

TEST_F(LastRunTest, FindsNothingAtTheVeryFirstStart) {
  auto store = Start();
  EXPECT_THAT(Findings(*store), IsEmpty());
  EXPECT_THAT(Story(*store), IsEmpty());
}

TEST_F(LastRunTest, ReportsAProcessThatEndedWithoutStoppingOnce) {
  {
    auto store = Start();
    Notify(*store, proto::EVENT_KIND_STARTED, "started");
  }
  // Two more processes start. The first process ends before it logs that it started, for example because its port is in
  // use.
  (void)Start();
  auto store = Start();
  Notify(*store, proto::EVENT_KIND_STARTED, "started");
  EXPECT_THAT(Story(*store), ElementsAre("started", kEndedWithoutStopping, "started"));
  EXPECT_THAT(Findings(*store), ElementsAre(kEndedWithoutStopping));
}

TEST_F(LastRunTest, FindsNothingIfTheProcessStopped) {
  {
    auto store = Start();
    Notify(*store, proto::EVENT_KIND_STARTED, "started");
    Notify(*store, proto::EVENT_KIND_COMMAND, "stop");
    ASSERT_TRUE(store->WriteDownStop(kNow_ns));
  }
  auto store = Start();
  EXPECT_THAT(Findings(*store), IsEmpty());
  EXPECT_EQ(Story(*store).back(), "stopped on request");
}

TEST_F(LastRunTest, FindsNothingInARestoredBackup) {
  const std::string backup = folder_.File("backup.db");
  {
    auto store = Start();
    Notify(*store, proto::EVENT_KIND_STARTED, "started");
    ASSERT_TRUE(BackUpStore(path_, backup));
    ASSERT_TRUE(store->WriteDownStop(kNow_ns));
  }
  std::filesystem::rename(backup, path_);
  auto store = Start();
  EXPECT_THAT(Findings(*store), IsEmpty());
}

// A peer returns this agent's events of epoch 5. These events are older than the events of the current epoch, although
// the second event is stored last.
TEST_F(LastRunTest, OrdersEventsByEpochAndNotByWhenTheyWereStored) {
  const std::vector<proto::StoredRecord> former = {
      Packed({{1, 5, proto::AGENT_EVENT}, 1}, MakeEvent(proto::EVENT_KIND_STARTED, "started long ago", "", kNow_ns)),
      Packed({{1, 5, proto::AGENT_EVENT}, 2}, MakeEvent(proto::EVENT_KIND_COMMAND, "sync now", "", kNow_ns))};
  {
    auto store = Start();
    // This record makes the process begin an epoch above 5 for its own records.
    StoreOne(*store, former[0]);
    Notify(*store, proto::EVENT_KIND_STARTED, "started");
    ASSERT_TRUE(store->WriteDownStop(kNow_ns));
    StoreOne(*store, former[1]);
  }
  auto store = Start();
  EXPECT_THAT(Findings(*store), IsEmpty());
}

TEST_F(LastRunTest, ADamagedFileThatWasSetAsideIsTheFirstEventOfTheNewFile) {
  {
    auto store = Start();
    Notify(*store, proto::EVENT_KIND_STARTED, "started");
  }
  std::filesystem::remove(path_ + "-wal");
  std::ofstream(path_, std::ios::binary) << std::string(8192, '\x5a');
  auto store = Start();
  Notify(*store, proto::EVENT_KIND_STARTED, "started");
  EXPECT_EQ(store->set_aside(), path_ + ".damaged-1");
  ASSERT_EQ(Findings(*store).size(), 1u);
  EXPECT_THAT(Findings(*store)[0], HasSubstr("set aside as " + path_ + ".damaged-1"));
  EXPECT_THAT(Story(*store), ElementsAre(HasSubstr("set aside"), "started"));
}

TEST_F(LastRunTest, AFileSetAsideByAStartThatLoggedNoEventIsReportedByTheNextStart) {
  std::ofstream(path_, std::ios::binary) << std::string(8192, '\x5a');
  // This process sets the damaged file aside, but is killed before it can log an event.
  (void)OpenStore(Options());
  {
    auto store = Start();
    ASSERT_EQ(Findings(*store).size(), 1u);
    EXPECT_THAT(Findings(*store)[0], HasSubstr(".damaged-1"));
    Notify(*store, proto::EVENT_KIND_STARTED, "started");
    ASSERT_TRUE(store->WriteDownStop(kNow_ns));
  }
  auto store = Start();
  EXPECT_EQ(Findings(*store).size(), 1u) << "once";
}

TEST_F(LastRunTest, DamagedRecordsAreAFinding) {
  {
    auto store = Start();
    InsertOne(*store, NodeRecord(1, 1, 0));
    InsertOne(*store, NodeRecord(1, 2, 0));
    ASSERT_TRUE(store->WriteDownStop(kNow_ns));
    ASSERT_TRUE(store->database().Execute("UPDATE pose_graph_node SET content = x'00' WHERE row_id = 1"));
  }
  auto store = Start();
  EXPECT_THAT(Findings(*store), ElementsAre(HasSubstr("1 records were wrong")));
  EXPECT_TRUE(store->set_aside().empty());
}

TEST_F(LastRunTest, AcknowledgedFindingsStayAcknowledged) {
  {
    auto store = Start();
    Notify(*store, proto::EVENT_KIND_STARTED, "started");
  }
  {
    auto store = Start();
    ASSERT_EQ(Findings(*store).size(), 1u);
    Notify(*store, proto::EVENT_KIND_ACKNOWLEDGED, AcknowledgedText((*store->Findings())[0].timestamp_ns(), 1));
    EXPECT_THAT(Findings(*store), IsEmpty());
    Notify(*store, proto::EVENT_KIND_STARTED, "started");
    ASSERT_TRUE(store->WriteDownStop(kNow_ns));
  }
  EXPECT_THAT(Findings(*Start()), IsEmpty());
}

TEST_F(LastRunTest, IgnoresEventsOfOtherAgents) {
  auto store = Start();
  StoreOne(*store, Packed({{2, 5, proto::AGENT_EVENT}, 1}, MakeEvent(proto::EVENT_KIND_DAMAGE, "theirs", "", kNow_ns)));
  EXPECT_THAT(Findings(*store), IsEmpty());
}

}  // namespace
}  // namespace moondb
