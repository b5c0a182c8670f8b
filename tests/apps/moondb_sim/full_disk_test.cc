// Tests a store on a simulated disk that is nearly full, full or failing: which operations fail, and which still
// succeed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/spdlog.h>

#include "actors/storage/record_validator.h"
#include "actors/storage/storage_actor.h"
#include "apps/moondb_sim/simulated_disk.h"
#include "model/control_message.h"
#include "model/have_set.h"
#include "model/record_check.h"
#include "model/record_hash.h"
#include "proto/control.pb.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "runtime/simulation/simulated_team.h"

namespace moondb::simulation {
namespace {

using std::chrono::seconds;
using testing::HasSubstr;

constexpr AgentId kSelf = 2;
constexpr char kFolder[] = "agent2/";
constexpr char kFullDiskPath[] = "agent2/moondb.sqlite";

class FullDiskTest : public testing::Test {
 protected:
  FullDiskTest() {
    for (const AgentId id : {1u, 2u, 3u}) {
      proto::AgentConfig& agent = *options_.team.add_agents();
      agent.set_id(id);
      agent.set_name("rover" + std::to_string(id));
    }
    (*options_.team.mutable_share())["pose_graph_node"] = proto::POLICY_ALL;
    (*options_.team.mutable_share())["local_traversability_map"] = proto::POLICY_ALL;
    options_.self = kSelf;
    options_.path = kFullDiskPath;
    options_.vfs = disk_.name();
    team_.AddAgent(kSelf);
    team_.Spawn(kSelf, "storage", [this] { return std::make_unique<StorageActor>(options_); });
    team_.AdvanceTime(seconds(30));
  }
  ~FullDiskTest() override { team_.Crash(kSelf); }

  proto::Message Ask(proto::Message question) {
    (void)team_.TakeMessages({kSelf, "test"});
    (void)team_.Post({kSelf, "test"}, {kSelf, "storage"}, std::move(question));
    team_.RunUntilIdle();
    const std::vector<proto::Message> replies = team_.TakeMessages({kSelf, "test"});
    EXPECT_EQ(replies.size(), 1u);
    return replies.empty() ? proto::Message() : replies[0];
  }

  static proto::Record Node(AgentId agent, std::uint64_t index) {
    proto::Record record;
    record.mutable_pose_graph_node()->mutable_node()->set_agent_id(agent);
    record.mutable_pose_graph_node()->mutable_node()->set_index(index);
    record.mutable_pose_graph_node()->mutable_map_from_node()->mutable_position_m();
    record.mutable_pose_graph_node()->mutable_map_from_node()->mutable_orientation()->set_w(1);
    return record;
  }

  static proto::Record Map(AgentId agent, std::uint32_t side_cells = 128) {
    proto::Record record;
    proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
    map.mutable_node()->set_agent_id(agent);
    map.mutable_node_from_map()->mutable_position_m();
    map.mutable_node_from_map()->mutable_orientation()->set_w(1);
    proto::MapLayer& layer = *map.add_layers();
    layer.set_width_cells(side_cells);
    layer.set_height_cells(side_cells);
    layer.set_resolution_um(50'000);
    layer.set_cells(std::string(side_cells * side_cells / 4, 'U'));
    return record;
  }

  proto::InsertReply Insert(const proto::Record& record) {
    proto::Message question;
    *question.mutable_insert_request()->add_records() = record;
    return Ask(std::move(question)).insert_reply();
  }

  proto::StoreReply Store(const std::vector<proto::Record>& records) {
    proto::Message question;
    question.mutable_store_request()->set_sender(1);
    for (const proto::Record& record : records) {
      const RecordKey key{{1, 1, TypeOf(record)}, ++seq_};
      proto::StoredRecord& stored = *question.mutable_store_request()->add_records();
      *stored.mutable_key() = ToProto(key);
      stored.set_content(SerializeRecord(record));
      stored.set_hash(HashRecord(key, stored.content()));
    }
    return Ask(std::move(question)).store_reply();
  }

  proto::StorageStatus Status() {
    proto::ControlRequest question;
    question.mutable_status();
    const auto answer = ControlReplyOf(Ask(MessageOf(question)));
    EXPECT_TRUE(answer);
    return answer ? answer->status().storage() : proto::StorageStatus();
  }

  HaveSet Have() {
    proto::Message question;
    question.mutable_have_request();
    return *FromProto(Ask(std::move(question)).have_reply().have());
  }

  proto::SaveRolesReply SaveRoles(std::uint64_t term) {
    proto::Message question;
    question.mutable_save_roles_request()->mutable_roles()->set_leader(1);
    question.mutable_save_roles_request()->mutable_roles()->set_reason(std::string(256, 'r'));
    question.mutable_save_roles_request()->mutable_roles()->mutable_term()->set_number(term);
    return Ask(std::move(question)).save_roles_reply();
  }

  proto::PruneReply Prune() {
    proto::Message question;
    question.mutable_prune_request()->add_data_types(proto::LOCAL_TRAVERSABILITY_MAP);
    *question.mutable_prune_request()->add_acknowledged() = ToProto(Have());
    return Ask(std::move(question)).prune_reply();
  }

  SimulatedDisk disk_{1};
  StorageActor::Options options_;
  std::uint64_t seq_ = 0;
  SimulatedTeam team_{/*seed=*/1};
};

TEST_F(FullDiskTest, MakesAReserveOfIncompressibleBytes) {
  EXPECT_GE(Status().reserve_bytes(), 512 * 1024);
  const std::string reserve = disk_.Save(kFolder).at("agent2/moondb.reserve");
  std::map<char, int> counts;
  for (const char byte : reserve) ++counts[byte];
  EXPECT_EQ(counts.size(), 256u);
  for (const auto& [byte, count] : counts) EXPECT_LT(count, static_cast<int>(reserve.size()) / 200);
}

TEST_F(FullDiskTest, RefusesMapsBeforeTheLastMegabytesThenEveryRecord) {
  disk_.SetRoom(kFolder, 900 * 1024);
  EXPECT_THAT(Insert(Map(kSelf)).error().text(), HasSubstr("no more maps are accepted"));
  EXPECT_THAT(Insert(Map(kSelf)).error().text(), HasSubstr("moonctl -a rover2 db prune"));
  EXPECT_EQ(Insert(Map(kSelf)).error().code(), proto::ERROR_CODE_FULL);
  EXPECT_FALSE(IsError(Insert(Node(kSelf, 1)).error()));
  EXPECT_THAT(Status().refused_inserts(), HasSubstr("no more maps"));
  EXPECT_TRUE(Status().write_trouble().empty());

  disk_.SetRoom(kFolder, 100 * 1024);
  EXPECT_EQ(Insert(Node(kSelf, 2)).error().code(), proto::ERROR_CODE_FULL);
  EXPECT_THAT(Status().refused_inserts(), HasSubstr("no records are accepted"));
  EXPECT_FALSE(IsError(SaveRoles(1).error()));

  disk_.SetRoom(kFolder, std::nullopt);
  EXPECT_FALSE(IsError(Insert(Map(kSelf)).error()));
  EXPECT_TRUE(Status().refused_inserts().empty());
}

TEST_F(FullDiskTest, RefusesMapsOfOtherAgentsBeforeOwnOnes) {
  disk_.SetRoom(kFolder, 1300 * 1024);
  const proto::StoreReply reply = Store({Node(1, 1), Map(1)});
  EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_FULL);
  EXPECT_THAT(reply.error().text(), HasSubstr("no more maps of other agents are accepted"));
  EXPECT_FALSE(Have().Get({1, 1, proto::POSE_GRAPH_NODE}).held.is_empty());
  EXPECT_TRUE(Have().Get({1, 1, proto::LOCAL_TRAVERSABILITY_MAP}).held.is_empty());
  EXPECT_FALSE(IsError(Insert(Map(kSelf)).error()));
  EXPECT_THAT(Status().refused_inserts(), HasSubstr("no more maps of other agents"));

  disk_.SetRoom(kFolder, 3000 * 1024);
  EXPECT_FALSE(IsError(Store({Map(1)}).error()));
  EXPECT_TRUE(Status().refused_inserts().empty());
}

TEST_F(FullDiskTest, StoresAPeersBatchWithoutItsMapsAndAnswersWithAnError) {
  disk_.SetRoom(kFolder, 900 * 1024);
  const proto::StoreReply reply = Store({Node(1, 1), Map(1)});
  EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_FULL);
  EXPECT_FALSE(Have().Get({1, 1, proto::POSE_GRAPH_NODE}).held.is_empty());
  EXPECT_TRUE(Have().Get({1, 1, proto::LOCAL_TRAVERSABILITY_MAP}).held.is_empty());
  EXPECT_FALSE(IsError(Store({Node(1, 2)}).error()));
  disk_.SetRoom(kFolder, 0);
  EXPECT_EQ(Store({Node(1, 3)}).error().code(), proto::ERROR_CODE_FULL);
}

TEST_F(FullDiskTest, StartsReadsAndPrunesOnAFullDisk) {
  for (int i = 0; i < 40; ++i) ASSERT_FALSE(IsError(Insert(Map(kSelf)).error()));
  disk_.SetRoom(kFolder, 0);
  EXPECT_EQ(Insert(Node(kSelf, 1)).error().code(), proto::ERROR_CODE_FULL);
  team_.CrashActor({kSelf, "storage"});
  EXPECT_EQ(Have().Get({kSelf, Have().streams().begin()->first.epoch, proto::LOCAL_TRAVERSABILITY_MAP}).held.Count(),
            40u);
  const proto::PruneReply pruned = Prune();
  EXPECT_FALSE(IsError(pruned.error())) << pruned.error().text();
  ASSERT_EQ(pruned.pruned_size(), 1);
  EXPECT_GT(pruned.pruned(0).record_count(), 0);
}

TEST_F(FullDiskTest, TakesInsertsAfterAPrune) {
  for (int i = 0; i < 400; ++i) ASSERT_FALSE(IsError(Insert(Map(kSelf)).error()));
  disk_.SetRoom(kFolder, 0);
  EXPECT_EQ(Insert(Node(kSelf, 1)).error().code(), proto::ERROR_CODE_FULL);
  for (proto::PruneReply pruned = Prune(); !pruned.is_complete(); pruned = Prune()) {
    ASSERT_FALSE(IsError(pruned.error())) << pruned.error().text();
  }
  for (std::uint64_t index = 1; index <= 500; ++index) {
    const proto::InsertReply inserted = Insert(Node(kSelf, index));
    ASSERT_FALSE(IsError(inserted.error())) << index << ": " << inserted.error().text();
  }
}

TEST_F(FullDiskTest, TakesInsertsAfterAPruneThoughTheDiskFillsAgain) {
  for (int i = 0; i < 400; ++i) ASSERT_FALSE(IsError(Insert(Map(kSelf)).error()));
  disk_.SetRoom(kFolder, 0);
  for (proto::PruneReply pruned = Prune(); !pruned.is_complete(); pruned = Prune()) {
    ASSERT_FALSE(IsError(pruned.error())) << pruned.error().text();
  }
  disk_.SetRoom(kFolder, 0);
  // The file has free pages, and the log can be overwritten.
  EXPECT_GT(Status().wal_bytes(), 128 * 1024);
  const proto::InsertReply inserted = Insert(Node(kSelf, 1));
  EXPECT_FALSE(IsError(inserted.error())) << inserted.error().text();
}

TEST_F(FullDiskTest, UsesTheReserveForRolesAndRebuildsItWhenThereIsRoom) {
  disk_.SetRoom(kFolder, 0);
  for (std::uint64_t term = 1; Status().reserve_bytes() > 0; ++term) {
    ASSERT_FALSE(IsError(SaveRoles(term).error())) << "term " << term;
    ASSERT_LT(term, 1000u) << "all of it fits into the log that was there";
  }
  EXPECT_TRUE(Status().write_trouble().empty());
  team_.AdvanceTime(seconds(30));
  EXPECT_EQ(Status().reserve_bytes(), 0);
  disk_.SetRoom(kFolder, std::nullopt);
  team_.AdvanceTime(seconds(30));
  EXPECT_GE(Status().reserve_bytes(), 512 * 1024);
}

TEST_F(FullDiskTest, AFailingDiskIsReadableAndAcceptsInsertsWhenItWorksAgain) {
  ASSERT_FALSE(IsError(Insert(Node(kSelf, 1)).error()));
  disk_.SetFailing(kFolder, true);
  EXPECT_TRUE(IsError(Insert(Node(kSelf, 2)).error()));
  EXPECT_TRUE(IsError(SaveRoles(1).error()));
  EXPECT_THAT(Status().write_trouble(), HasSubstr("I/O error"));
  team_.CrashActor({kSelf, "storage"});
  EXPECT_EQ(Have().streams().size(), 1u);
  EXPECT_TRUE(IsError(Insert(Node(kSelf, 2)).error()));
  disk_.SetFailing(kFolder, false);
  team_.AdvanceTime(seconds(20));
  EXPECT_TRUE(Status().write_trouble().empty()) << "it looks by itself";
  EXPECT_FALSE(IsError(Insert(Node(kSelf, 2)).error()));
}

}  // namespace
}  // namespace moondb::simulation
