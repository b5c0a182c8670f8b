#include "actors/merge/merge_actor.h"

#include <gtest/gtest.h>
#include <zstd.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <set>

#include "model/control_message.h"
#include "proto/types.pb.h"
#include "runtime/simulation/simulated_team.h"
#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

using Rows = std::vector<std::string>;
using simulation::SimulatedTeam;
using std::chrono::seconds;

constexpr AgentId kSelf = 1;
constexpr std::uint32_t kCell_um = 100'000;

// The records that FakeStorageActor returns, and settings for its answers.
struct FakeStore {
  std::vector<proto::StoredRecord> records;  // Record i has row id i + 1.
  std::vector<proto::ReadRequest> reads;
  std::map<AgentId, double> without_room;  // Counts of the last report.
  int page_records_max = 2;
  bool is_silent = false;
  Error error{};
  bool has_error = false;
};

class FakeStorageActor final : public Actor {
 public:
  explicit FakeStorageActor(std::shared_ptr<FakeStore> store) : store_(std::move(store)) {}

  void OnMessage(Context& context, const proto::Message& message) override {
    if (message.has_left_out_report()) {
      const auto& counts = message.left_out_report().without_room();
      store_->without_room = {counts.begin(), counts.end()};
    }
    if (!message.has_read_request()) return;
    store_->reads.push_back(message.read_request());
    if (store_->is_silent) return;
    proto::Message answer;
    proto::ReadReply& reply = *answer.mutable_read_reply();
    reply.set_is_complete(true);
    if (store_->has_error) *reply.mutable_error() = ToProto(store_->error);
    for (std::uint64_t row = message.read_request().after_row_id() + 1; row <= store_->records.size(); ++row) {
      if (reply.records_size() == store_->page_records_max) {
        reply.set_is_complete(false);
        break;
      }
      *reply.add_records() = store_->records[row - 1];
      reply.add_row_ids(row);
    }
    (void)context.Reply(std::move(answer));
  }

 private:
  std::shared_ptr<FakeStore> store_;
};

Rows Decode(const proto::MergeReply& reply) {
  MergedMap merged;
  merged.grid = Grid(static_cast<std::int32_t>(reply.width_cells()), static_cast<std::int32_t>(reply.height_cells()));
  const std::size_t size = ZSTD_decompress(merged.grid.cells.data(), merged.grid.cells.size(),
                                           reply.zstd_cells().data(), reply.zstd_cells().size());
  EXPECT_EQ(size, merged.grid.cells.size());
  return Print(merged);
}

class MergeActorTest : public testing::Test {
 protected:
  MergeActorTest() : team_(/*seed=*/1) {
    options_.self = kSelf;
    options_.backend = MergeBackend::kCpu;
    options_.team.mutable_map()->set_resolution_m(0.1);
    options_.team.mutable_map()->add_footprint_m(0.12);
    options_.team.mutable_map()->add_footprint_m(0.12);
    for (const AgentId agent : {1u, 2u, 4u, 3u}) {
      options_.team.add_agents()->set_id(agent);
      if (agent != 4) options_.team.mutable_agents()->rbegin()->mutable_start()->set_x(agent * 5);
    }
    options_.team.mutable_agents(2)->set_kind(proto::AGENT_KIND_BASE_STATION);
    team_.AddAgent(kSelf);
  }

  void Start() {
    team_.Spawn(kSelf, actor_name::kStorage, [store = store_] { return std::make_unique<FakeStorageActor>(store); });
    team_.Spawn(kSelf, actor_name::kMerge, [options = options_] { return std::make_unique<MergeActor>(options); },
                {.placement = Placement::kOwnThread});
  }

  void Store(AgentId origin, DataType type, const proto::Record& record) {
    proto::StoredRecord stored;
    const std::uint64_t seq = store_->records.size() + 1;
    *stored.mutable_key() = ToProto(RecordKey{{origin, 7, type}, seq});
    record.SerializeToString(stored.mutable_content());
    store_->records.push_back(stored);
  }

  void StoreNode(AgentId agent, double x_m, double y_m = 0, std::uint64_t index = 1) {
    proto::Record record;
    *record.mutable_pose_graph_node()->mutable_node() = ToProto(NodeKey{agent, index});
    *record.mutable_pose_graph_node()->mutable_map_from_node() = ToProto(Pose::FromPlanar(x_m, y_m, 0));
    Store(agent, proto::POSE_GRAPH_NODE, record);
  }

  void StoreOptimizedPose(AgentId agent, double x_m, std::uint64_t run) {
    proto::Record record;
    *record.mutable_optimized_pose()->mutable_node() = ToProto(NodeKey{agent, 1});
    *record.mutable_optimized_pose()->mutable_map_from_node() = ToProto(Pose::FromPlanar(x_m, 0, 0));
    record.mutable_optimized_pose()->mutable_term()->set_number(1);
    record.mutable_optimized_pose()->set_run(run);
    Store(agent, proto::OPTIMIZED_POSE, record);
  }

  void StoreMap(AgentId agent, const Rows& rows, std::uint32_t resolution_um = kCell_um,
                bool is_clock_suspect = false) {
    proto::Record record;
    record.set_timestamp_ns(static_cast<std::int64_t>(store_->records.size()));
    record.set_is_clock_suspect(is_clock_suspect);
    *record.mutable_local_traversability_map() = ToProto(DrawMap(rows, resolution_um, agent));
    Store(agent, proto::LOCAL_TRAVERSABILITY_MAP, record);
  }

  void Ask(std::uint64_t request_id, const proto::MergeRequest& request = {}) {
    proto::Message message;
    message.set_request_id(request_id);
    *message.mutable_merge_request() = request;
    ASSERT_EQ(team_.Post(kRequester, {kSelf, actor_name::kMerge}, std::move(message)), SendResult::kAccepted);
  }

  void StoreQuarantine(const proto::MapQuarantine& quarantine) {
    proto::Record record;
    *record.mutable_map_quarantine() = quarantine;
    Store(4, proto::MAP_QUARANTINE, record);
  }

  static proto::MapQuarantine Quarantine(AgentId agent, std::int64_t from_ns, std::int64_t to_ns) {
    proto::MapQuarantine quarantine;
    quarantine.set_agent_id(agent);
    quarantine.set_from_ns(from_ns);
    quarantine.set_to_ns(to_ns);
    return quarantine;
  }

  proto::RecordKey LastKey() const { return store_->records.back().key(); }

  // Sends `question` to MergeActor. Returns the answer, or nullopt if the actor has not answered yet.
  std::optional<proto::Message> RequestAnything(proto::Message question) {
    question.set_request_id(78);
    EXPECT_EQ(team_.Post(kRequester, {kSelf, actor_name::kMerge}, std::move(question)), SendResult::kAccepted);
    team_.RunUntilIdle();
    return TakeAnswer();
  }

  std::optional<proto::Message> TakeAnswer() {
    std::vector<proto::Message> replies = TakeReplies();
    EXPECT_LE(replies.size(), 1u);
    if (replies.empty()) return std::nullopt;
    EXPECT_EQ(replies[0].request_id(), 78u);
    return std::move(replies[0]);
  }

  proto::MapWhyReply Why(double x_m, double y_m) {
    proto::Message question;
    question.mutable_map_why_request()->set_x_m(x_m);
    question.mutable_map_why_request()->set_y_m(y_m);
    return RequestAnything(std::move(question))->map_why_reply();
  }

  proto::MapStatsReply Stats() {
    proto::Message question;
    question.mutable_map_stats_request();
    return RequestAnything(std::move(question))->map_stats_reply();
  }

  // Returns the tiles that changed since the last call, or nullopt if the actor has not answered yet.
  std::optional<proto::MapTilesReply> Tiles(double wait_s = 0) {
    tiles_request_.set_wait_s(wait_s);
    proto::Message question;
    *question.mutable_map_tiles_request() = tiles_request_;
    const auto answer = RequestAnything(std::move(question));
    if (!answer) return std::nullopt;
    return Note(answer->map_tiles_reply());
  }

  proto::MapTilesReply Note(const proto::MapTilesReply& reply) {
    EXPECT_FALSE(IsError(reply.error())) << reply.error().text();
    tiles_request_.set_merger_id(reply.merger_id());
    tiles_request_.set_since_version(reply.version());
    return reply;
  }

  void ReportRecords(DataType type) {
    proto::Message reported;
    reported.mutable_records_stored()->add_data_types(type);
    EXPECT_EQ(team_.Post({kSelf, actor_name::kStorage}, {kSelf, actor_name::kMerge}, std::move(reported)),
              SendResult::kAccepted);
    team_.RunUntilIdle();
  }

  std::vector<proto::Message> TakeReplies() { return team_.TakeMessages(kRequester); }

  proto::MergeReply Merge(const proto::MergeRequest& request = {}) {
    Ask(77, request);
    team_.RunUntilIdle();
    const std::vector<proto::Message> replies = TakeReplies();
    EXPECT_EQ(replies.size(), 1u);
    if (replies.size() != 1) return {};
    EXPECT_EQ(replies[0].request_id(), 77u);
    return replies[0].merge_reply();
  }

  const Address kRequester{kSelf, "test"};
  SimulatedTeam team_;
  std::shared_ptr<FakeStore> store_ = std::make_shared<FakeStore>();
  MergeActor::Options options_;
  proto::MapTilesRequest tiles_request_;
};

TEST_F(MergeActorTest, ReportsTheBackendAtTheStart) {
  std::string reported;
  options_.on_backend = [&reported](const std::string& backend) { reported = backend; };
  Start();
  team_.RunUntilIdle();
  EXPECT_EQ(reported, "cpu");
}

TEST_F(MergeActorTest, MergesTheRecordsInStorage) {
  StoreNode(1, 1, 1);
  StoreNode(2, 1.2, 1);
  StoreMap(1, {"##", ".."});
  StoreMap(2, {"..", "##"});
  Start();
  const proto::MergeReply reply = Merge();
  ASSERT_FALSE(IsError(reply.error())) << reply.error().text();
  EXPECT_EQ(reply.resolution_um(), kCell_um);
  EXPECT_EQ(reply.origin_cell_x(), 9);
  EXPECT_EQ(reply.origin_cell_y(), 9);
  // The footprint of each rover frees 2 x 2 cells around the lower left corner of its map.
  EXPECT_EQ(Decode(reply), (Rows{" ##..", "....#", ".... "}));
  EXPECT_EQ(reply.map_count(), 2);
  EXPECT_EQ(reply.waiting_map_count(), 0);
  EXPECT_EQ(reply.node_count(), 2);
  EXPECT_EQ(reply.backend(), "cpu");
  EXPECT_GE(reply.seconds(), 0);
}

TEST_F(MergeActorTest, AMapDoesNotWinByASuspectTimestamp) {
  StoreNode(1, 0);
  StoreNode(2, 0);
  StoreMap(1, {"###", "###", "###"});
  // This map is newer, but its timestamp is suspect.
  StoreMap(2, {"...", "...", "..."}, kCell_um, /*is_clock_suspect=*/true);
  Start();
  EXPECT_NE(Decode(Merge()).front().find('#'), std::string::npos);
}

TEST_F(MergeActorTest, ReadsPageByPageAndOnlyNewRecords) {
  for (int i = 0; i < 5; ++i) StoreMap(1, {"#"});
  StoreNode(1, 1);
  Start();
  EXPECT_EQ(Merge().map_count(), 5);
  EXPECT_EQ(store_->reads.size(), 3u);
  StoreMap(1, {"."});
  EXPECT_EQ(Merge().map_count(), 6);
  ASSERT_EQ(store_->reads.size(), 4u);
  EXPECT_EQ(store_->reads[3].after_row_id(), 6u);
  EXPECT_GT(store_->reads[3].records_max(), 0u);
  EXPECT_GT(store_->reads[3].content_bytes_max(), 0u);
  EXPECT_EQ(store_->reads[3].data_types_size(), 5);
}

TEST_F(MergeActorTest, MapsWaitForTheirNodes) {
  StoreMap(1, {"#"});
  Start();
  proto::MergeReply reply = Merge();
  EXPECT_FALSE(IsError(reply.error()));
  EXPECT_EQ(reply.map_count(), 0);
  EXPECT_EQ(reply.waiting_map_count(), 1);
  EXPECT_EQ(reply.width_cells(), 0u);
  StoreNode(1, 1);
  reply = Merge();
  EXPECT_EQ(reply.map_count(), 1);
  EXPECT_EQ(reply.waiting_map_count(), 0);
}

TEST_F(MergeActorTest, AMapThatArrivesTwiceCountsOnce) {
  StoreNode(1, 1);
  StoreMap(1, {"#"});
  store_->records.push_back(store_->records.back());
  Start();
  EXPECT_EQ(Merge().map_count(), 1);
}

TEST_F(MergeActorTest, TheNewestOptimizedPosePlacesTheMap) {
  StoreNode(4, 0);  // Agent 4 is a base station. It has no footprint that would free cells.
  StoreMap(4, {"##"});
  StoreOptimizedPose(4, 2, /*run=*/2);
  StoreOptimizedPose(4, 1, /*run=*/1);
  Start();
  proto::MergeReply reply = Merge();
  EXPECT_EQ(reply.origin_cell_x(), 20);
  EXPECT_EQ(Decode(reply), (Rows{"##"}));
  EXPECT_EQ(reply.node_count(), 0);
  proto::MergeRequest raw;
  raw.set_use_raw_poses(true);
  EXPECT_EQ(Merge(raw).origin_cell_x(), 0);
}

TEST_F(MergeActorTest, MergesMapsOfTheNamedAgentsOnly) {
  StoreNode(1, 0);
  StoreNode(2, 1);
  StoreMap(1, {"#"});
  StoreMap(2, {"#"});
  Start();
  proto::MergeRequest request;
  request.add_agents(2);
  const proto::MergeReply reply = Merge(request);
  EXPECT_EQ(reply.map_count(), 1);
  EXPECT_EQ(reply.node_count(), 1);
  EXPECT_GE(reply.origin_cell_x(), 9);
}

TEST_F(MergeActorTest, AMapThatDoesNotFitTheGridIsLeftOut) {
  StoreNode(1, 1);
  StoreMap(1, {"#"}, /*resolution_um=*/1);
  StoreMap(1, {"#"});
  Start();
  EXPECT_EQ(Merge().map_count(), 1);
  EXPECT_EQ(Stats().refused_map_count(), 1);
}

TEST_F(MergeActorTest, AnExportLeavesOutAMapThatLiesFarFromTheOthersAndNamesItsAgent) {
  StoreNode(1, 0);
  StoreMap(1, {"#"});
  Start();
  const proto::MergeReply alone = Merge();
  StoreNode(2, 5000);
  StoreMap(2, {"#"});
  const proto::MergeReply reply = Merge();
  EXPECT_FALSE(IsError(reply.error())) << reply.error().text();
  EXPECT_EQ(reply.zstd_cells(), alone.zstd_cells());
  EXPECT_EQ(reply.origin_cell_x(), alone.origin_cell_x());
  ASSERT_EQ(reply.left_out_size(), 1);
  EXPECT_EQ(reply.left_out(0).agent_id(), 2u);
  EXPECT_EQ(reply.left_out(0).far_count(), 2) << "the map and the footprint";
  EXPECT_NEAR(reply.left_out(0).distance_m(), 5000, 1);
  EXPECT_EQ(alone.left_out_size(), 0);
  EXPECT_EQ(Stats().hazard_cell_count(), 0) << "the footprints cover both maps";
  EXPECT_EQ(Why(5000, 0).observations_size(), 2) << "other requests do not crop";
  proto::MergeRequest request;
  request.add_agents(2);
  EXPECT_EQ(Merge(request).origin_cell_x(), 49'999) << "alone";
}

TEST_F(MergeActorTest, NodesFarApartAreLeftOutAndReportedToStorageUntilAQuarantine) {
  StoreNode(1, 0);
  StoreMap(1, {"#"});
  store_->page_records_max = 4096;
  Start();
  const std::string cells = Merge().zstd_cells();
  EXPECT_EQ(store_->without_room, (std::map<AgentId, double>{}));
  for (std::uint64_t i = 0; i < 17'000; ++i) StoreNode(2, 60 + 26 * static_cast<double>(i), 0, i);
  EXPECT_FALSE(IsError(Stats().error())) << Stats().error().text();
  EXPECT_EQ(Stats().agents(0).map_count(), 1);
  ASSERT_EQ(store_->without_room.count(2), 1u);
  EXPECT_GT(store_->without_room.at(2), 15'000);
  const proto::MergeReply reply = Merge();
  EXPECT_FALSE(IsError(reply.error())) << reply.error().text();
  ASSERT_EQ(reply.left_out_size(), 1);
  EXPECT_EQ(reply.left_out(0).agent_id(), 2u);
  EXPECT_EQ(reply.left_out(0).without_room_count(), store_->without_room.at(2));
  StoreQuarantine(Quarantine(2, INT64_MIN, INT64_MAX));
  EXPECT_EQ(Merge().zstd_cells(), cells);
  EXPECT_EQ(Merge().left_out_size(), 0);
  EXPECT_EQ(store_->without_room.count(2), 0u) << "health names rover 2 no longer";
}

TEST_F(MergeActorTest, AnInvalidFootprintIsAnError) {
  options_.team.mutable_map()->set_footprint_m(0, 100);
  Start();
  const proto::MergeReply reply = Merge();
  EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_INVALID);
  EXPECT_EQ(reply.error().field(), "map.footprint_m");
}

TEST_F(MergeActorTest, AMergeOfSomeAgentsDoesNotChangeTheMapOfAll) {
  StoreNode(1, 0);
  StoreNode(2, 1);
  StoreMap(1, {"###"});
  StoreMap(2, {"###"});
  Start();
  const std::string before = Merge().zstd_cells();
  proto::MergeRequest request;
  request.add_agents(2);
  EXPECT_EQ(Merge(request).map_count(), 1);
  EXPECT_EQ(Merge().zstd_cells(), before);
  StoreMap(2, {"..."});
  EXPECT_NE(Merge().zstd_cells(), before);
}

TEST_F(MergeActorTest, RequestsQueueUpToABound) {
  store_->is_silent = true;
  options_.requests_max = 16;
  Start();
  for (std::uint64_t id = 1; id <= 17; ++id) Ask(id);
  team_.RunUntilIdle();
  const std::vector<proto::Message> replies = TakeReplies();
  ASSERT_EQ(replies.size(), 1u);
  EXPECT_EQ(replies[0].request_id(), 17u);
  EXPECT_EQ(replies[0].merge_reply().error().code(), proto::ERROR_CODE_FULL);
}

TEST_F(MergeActorTest, EachAnswerIncludesRecordsStoredBeforeItsRequest) {
  StoreNode(1, 1);
  StoreMap(1, {"#"});
  Start();
  for (std::uint64_t id = 1; id <= 3; ++id) Ask(id);
  team_.RunUntilIdle();
  const std::vector<proto::Message> replies = TakeReplies();
  ASSERT_EQ(replies.size(), 3u);
  for (std::uint64_t id = 1; id <= 3; ++id) {
    EXPECT_EQ(replies[id - 1].request_id(), id);
    EXPECT_EQ(replies[id - 1].merge_reply().map_count(), 1);
  }
  EXPECT_EQ(store_->reads.size(), 2u) << "one for the first, one for those that came meanwhile";
}

TEST_F(MergeActorTest, ASilentStorageCausesATimeoutAndTheNextRequestReadsAgain) {
  store_->is_silent = true;
  StoreNode(1, 1);
  StoreMap(1, {"#"});
  Start();
  Ask(1);
  Ask(2);
  team_.AdvanceTime(std::chrono::seconds(29));
  EXPECT_TRUE(TakeReplies().empty());
  team_.AdvanceTime(std::chrono::seconds(2));
  const std::vector<proto::Message> replies = TakeReplies();
  ASSERT_EQ(replies.size(), 2u);
  EXPECT_EQ(replies[0].merge_reply().error().code(), proto::ERROR_CODE_TIMED_OUT);
  store_->is_silent = false;
  EXPECT_EQ(Merge().map_count(), 1);
}

TEST_F(MergeActorTest, ForwardsStoragesError) {
  store_->has_error = true;
  store_->error = {ErrorCode::kInternal, "disk", {}};
  Start();
  EXPECT_EQ(Merge().error().code(), proto::ERROR_CODE_INTERNAL);
}

TEST_F(MergeActorTest, ALargeReplyIsRefused) {
  options_.reply_bytes_max = 8;
  StoreNode(1, 1);
  StoreMap(1, {"#.#", ".#.", "#.#"});
  Start();
  EXPECT_EQ(Merge().error().code(), proto::ERROR_CODE_FULL);
}

TEST_F(MergeActorTest, ARestartedActorReadsEverythingAgain) {
  StoreNode(1, 1);
  StoreMap(1, {"#"});
  Start();
  const proto::MergeReply before = Merge();
  team_.Crash(kSelf);
  team_.Restart(kSelf);
  const proto::MergeReply after = Merge();
  EXPECT_EQ(after.map_count(), 1);
  EXPECT_EQ(after.zstd_cells(), before.zstd_cells());
}

// This test answers in storage's place.
TEST_F(MergeActorTest, AcceptsOnlyItsOwnStoragesAnswerToItsPresentQuestion) {
  const Address storage{kSelf, actor_name::kStorage};
  const Address merge{kSelf, actor_name::kMerge};
  team_.AddAgent(2);
  team_.Spawn(kSelf, merge.actor, [options = options_] { return std::make_unique<MergeActor>(options); });
  proto::Message answer;
  answer.mutable_read_reply()->set_is_complete(true);
  const auto ask = [&](std::uint64_t request_id) {
    Ask(request_id);
    team_.RunUntilIdle();
    const std::vector<proto::Message> reads = team_.TakeMessages(storage);
    ASSERT_EQ(reads.size(), 1u);
    answer.set_request_id(reads[0].request_id());
  };
  ask(1);
  team_.CrashActor(merge);
  const proto::Message stale = answer;
  ask(2);
  ASSERT_EQ(team_.Post(storage, merge, stale), SendResult::kAccepted);
  ASSERT_EQ(team_.Post({2, actor_name::kStorage}, merge, answer), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(TakeReplies().empty());
  ASSERT_EQ(team_.Post(storage, merge, answer), SendResult::kAccepted);
  team_.RunUntilIdle();
  const std::vector<proto::Message> replies = TakeReplies();
  ASSERT_EQ(replies.size(), 1u);
  EXPECT_EQ(replies[0].request_id(), 2u);
}

TEST_F(MergeActorTest, ExplainsTheValueOfACell) {
  for (const AgentId agent : {1u, 2u, 4u}) StoreNode(agent, 0);
  StoreMap(1, {"###", "###", "###"});
  StoreMap(2, {"...", "...", "..."}, 2 * kCell_um);  // This map is coarser.
  // This map is newer, but its timestamp is suspect.
  StoreMap(4, {"...", "...", "..."}, kCell_um, /*is_clock_suspect=*/true);
  StoreOptimizedPose(2, 0.1, /*run=*/1);
  Start();
  const proto::MapWhyReply why = Why(0.22, 0.17);
  ASSERT_FALSE(IsError(why.error())) << why.error().text();
  EXPECT_EQ(why.value(), 2u);
  EXPECT_NEAR(why.cell_x_m(), 0.25, 1e-9);
  EXPECT_NEAR(why.cell_y_m(), 0.15, 1e-9);
  ASSERT_EQ(why.observations_size(), 3);
  EXPECT_EQ(why.observations(0).record().origin_agent(), 1u);
  EXPECT_EQ(why.observations(0).value(), 2u);
  EXPECT_EQ(why.observations(0).timestamp_ns(), 3);
  EXPECT_EQ(why.observations(0).resolution_um(), kCell_um);
  EXPECT_FALSE(why.observations(0).is_pose_optimized());
  EXPECT_EQ(why.observations(1).record().origin_agent(), 4u);
  EXPECT_TRUE(why.observations(1).is_clock_suspect());
  EXPECT_EQ(why.observations(1).timestamp_ns(), 5) << "as it was stamped";
  EXPECT_EQ(why.observations(2).record().origin_agent(), 2u);
  EXPECT_TRUE(why.observations(2).is_pose_optimized());
  EXPECT_EQ(why.observations(2).map_from_node().position_m().x(), 0.1);

  const proto::MapWhyReply footprint = Why(0.01, 0.01);
  EXPECT_EQ(footprint.value(), 1u);
  ASSERT_GE(footprint.observations_size(), 2);
  EXPECT_TRUE(footprint.observations(0).is_footprint());
  EXPECT_EQ(footprint.observations(0).node().agent_id(), 1u);
  const proto::MapWhyReply nothing = Why(-1000, 1000);
  EXPECT_EQ(nothing.value(), 0u);
  EXPECT_TRUE(nothing.observations().empty());
}

TEST_F(MergeActorTest, LeavesQuarantinedMapsOutUntilTheyAreLifted) {
  StoreNode(4, 0);  // Agent 4 is a base station. It has no footprint that would free cells.
  StoreMap(4, {"#"});
  StoreMap(4, {"."});
  Start();
  EXPECT_EQ(Decode(Merge()), (Rows{"."}));
  StoreQuarantine(Quarantine(4, 2, 2));
  const proto::RecordKey given = LastKey();
  EXPECT_EQ(Decode(Merge()), (Rows{"#"}));
  const proto::MapWhyReply why = Why(0.05, 0.05);
  EXPECT_EQ(why.value(), 2u);
  ASSERT_EQ(why.observations_size(), 2);
  EXPECT_TRUE(why.observations(1).is_quarantined());
  EXPECT_EQ(why.observations(1).value(), 1u);
  const proto::MapStatsReply stats = Stats();
  ASSERT_EQ(stats.quarantines_size(), 1);
  EXPECT_EQ(stats.quarantines(0).map_count(), 1);
  EXPECT_EQ(stats.quarantines(0).record().seq(), given.seq());
  StoreQuarantine(Quarantine(4, 3, 1000));  // This quarantine matches no map.
  StoreQuarantine(Quarantine(1, INT64_MIN, INT64_MAX));
  EXPECT_EQ(Decode(Merge()), (Rows{"#"}));

  proto::MapQuarantine lift;
  *lift.mutable_lifts() = given;
  StoreQuarantine(lift);
  EXPECT_EQ(Decode(Merge()), (Rows{"."}));
  EXPECT_EQ(Stats().quarantines_size(), 2);
}

TEST_F(MergeActorTest, NamesSharedMapsThatWinNoCell) {
  StoreNode(4, 0);
  StoreMap(4, {"#"});
  const proto::RecordKey occluded = LastKey();
  StoreMap(4, {"#"});
  // Seq 0 marks a record that is not shared. Such a record cannot be pruned.
  store_->records.back().mutable_key()->set_seq(0);
  StoreMap(4, {"."});
  StoreOptimizedPose(4, 0, 1);
  Start();
  proto::Message question;
  question.mutable_occluded_maps_request()->set_records_max(10);
  const proto::OccludedMapsReply reply = RequestAnything(question)->occluded_maps_reply();
  ASSERT_EQ(reply.records_size(), 1) << reply.DebugString();
  EXPECT_EQ(reply.records(0).seq(), occluded.seq());
  question.mutable_occluded_maps_request()->set_records_max(0);
  EXPECT_TRUE(RequestAnything(question)->occluded_maps_reply().records().empty());
}

// A map at a raw pose moves with the next solve: nothing is removed for a guess.
TEST_F(MergeActorTest, NamesNoOccludedMapWhereAMapLiesAtARawPose) {
  StoreNode(4, 0);
  StoreMap(4, {"#"});
  StoreMap(4, {"."});
  StoreOptimizedPose(4, 0, 1);
  StoreNode(1, 1);
  StoreMap(1, {"....."});
  Start();
  proto::Message question;
  question.mutable_occluded_maps_request()->set_records_max(10);
  EXPECT_TRUE(RequestAnything(question)->occluded_maps_reply().records().empty());
  StoreOptimizedPose(1, 1, 2);
  EXPECT_EQ(RequestAnything(question)->occluded_maps_reply().records_size(), 1);
}

TEST_F(MergeActorTest, ReportsAnErrorOfTheRequestForFullyOccludedMaps) {
  store_->has_error = true;
  store_->error = {ErrorCode::kInternal, "no disk", {}};
  Start();
  proto::Message question;
  question.mutable_occluded_maps_request()->set_records_max(10);
  const Result<void> answered = CheckControlReply(*RequestAnything(question));
  ASSERT_FALSE(answered);
  EXPECT_EQ(answered.error().text, "no disk");
}

TEST_F(MergeActorTest, MergesTheRemainingMapsAfterAPrune) {
  StoreNode(4, 0);
  StoreMap(4, {"#."});
  StoreMap(4, {".?"});
  Start();
  EXPECT_EQ(Decode(Merge()), (Rows{".."}));
  // Prunes the first map. MergeActor keeps the map until storage reports the prune.
  store_->records.erase(store_->records.begin() + 1);
  EXPECT_EQ(Decode(Merge()), (Rows{".."}));
  proto::Message pruned;
  pruned.mutable_records_stored()->set_is_pruned(true);
  EXPECT_EQ(team_.Post({kSelf, "impostor"}, {kSelf, actor_name::kMerge}, proto::Message(pruned)),
            SendResult::kAccepted);
  EXPECT_EQ(Decode(Merge()), (Rows{".."}));
  EXPECT_EQ(team_.Post({kSelf, actor_name::kStorage}, {kSelf, actor_name::kMerge}, std::move(pruned)),
            SendResult::kAccepted);
  EXPECT_EQ(Decode(Merge()), (Rows{". "}));
}

TEST_F(MergeActorTest, AQuarantineMayBeLiftedBeforeItArrives) {
  StoreNode(4, 0);
  StoreMap(4, {"#"});
  proto::MapQuarantine lift;
  *lift.mutable_lifts() = ToProto(RecordKey{{4, 7, proto::MAP_QUARANTINE}, 4});
  StoreQuarantine(lift);
  StoreQuarantine(Quarantine(4, INT64_MIN, INT64_MAX));
  ASSERT_EQ(LastKey().seq(), 4u);
  Start();
  EXPECT_EQ(Decode(Merge()), (Rows{"#"}));
}

TEST_F(MergeActorTest, ReportsTheMapsAndWonCellsOfEachAgent) {
  StoreNode(1, 0);
  StoreNode(2, 5);
  StoreMap(1, {"###", "###", "###"});
  StoreMap(1, {"...", "...", "..."});
  StoreMap(2, {"#"});
  StoreMap(4, {"#"});  // This map is placed only when its node arrives.
  StoreMap(1, {"."});
  StoreQuarantine(Quarantine(1, 6, 6));
  Start();
  const proto::MapStatsReply stats = Stats();
  ASSERT_EQ(stats.agents_size(), 3);
  EXPECT_EQ(stats.agents(0).agent_id(), 1u);
  EXPECT_EQ(stats.agents(0).map_count(), 2);
  EXPECT_EQ(stats.agents(0).winning_map_count(), 1);
  EXPECT_EQ(stats.agents(0).quarantined_map_count(), 1);
  EXPECT_EQ(stats.agents(2).waiting_map_count(), 1);
  EXPECT_EQ(stats.agents(0).won_cell_count() + stats.agents(1).won_cell_count() +
                stats.agents(0).footprint_cell_count() + stats.agents(1).footprint_cell_count(),
            stats.free_cell_count() + stats.hazard_cell_count());
  EXPECT_EQ(stats.agents(0).footprint_cell_count(), 4);
  EXPECT_EQ(stats.hazard_cell_count(), 0) << "rover 2 stands on it";
  EXPECT_GT(stats.memory_bytes(), 0);
  EXPECT_EQ(stats.backend().substr(0, 3), "cpu");
}

TEST_F(MergeActorTest, TheCellsHashDependsOnTheCellsAlone) {
  StoreNode(4, 0.05, 0.05);
  StoreMap(4, {"#"});
  Start();
  const std::uint64_t first = Stats().cells_hash();
  StoreMap(4, {"."});
  EXPECT_NE(Stats().cells_hash(), first);
  StoreMap(4, {"#"});
  EXPECT_EQ(Stats().cells_hash(), first) << "the newest map makes the same cells";
  StoreNode(1, 100);
  StoreMap(1, {"."});
  const std::uint64_t with_another = Stats().cells_hash();
  EXPECT_NE(with_another, first);
  StoreQuarantine(Quarantine(1, INT64_MIN, INT64_MAX));
  EXPECT_EQ(Stats().cells_hash(), first) << "the tile of the other map is unknown again";
}

TEST_F(MergeActorTest, ReportsTheTilesThatChangedSinceAVersion) {
  StoreNode(4, 0.05, 0.05);
  StoreNode(1, 100);
  StoreMap(4, {"#"});
  StoreMap(1, {"#"});
  Start();
  const proto::MapTilesReply first = *Tiles();
  EXPECT_TRUE(first.is_complete());
  EXPECT_EQ(first.tile_cells(), 64u);
  EXPECT_EQ(first.resolution_um(), kCell_um);
  ASSERT_GE(first.tiles_size(), 2);
  EXPECT_EQ(Tiles()->tiles_size(), 0);
  StoreMap(4, {"."});
  const proto::MapTilesReply second = *Tiles();
  ASSERT_EQ(second.tiles_size(), 1);
  EXPECT_EQ(second.tiles(0).x(), 0);
  EXPECT_EQ(second.tiles(0).y(), 0);
  EXPECT_GT(second.version(), first.version());

  StoreQuarantine(Quarantine(4, INT64_MIN, INT64_MAX));
  const proto::MapTilesReply third = *Tiles();
  ASSERT_EQ(third.tiles_size(), 1);
  EXPECT_TRUE(third.tiles(0).zstd_cells().empty()) << "nothing is known there any more";

  // The merger_id differs, as it does after a restart of MergeActor.
  tiles_request_.set_merger_id(tiles_request_.merger_id() + 1);
  EXPECT_EQ(Tiles()->tiles_size(), first.tiles_size() - 1);
  tiles_request_.clear_merger_id();
  tiles_request_.mutable_region()->set_x_min_m(99);
  tiles_request_.mutable_region()->set_x_max_m(101);
  tiles_request_.mutable_region()->set_y_max_m(0.5);
  const proto::MapTilesReply region = *Tiles();
  ASSERT_GE(region.tiles_size(), 1);
  for (const proto::MapTile& tile : region.tiles()) EXPECT_EQ(tile.x(), 15);
}

TEST_F(MergeActorTest, SendsManyTilesInParts) {
  options_.reply_bytes_max = 1;
  StoreNode(4, -0.1, -0.1);
  StoreMap(4, {"####", "####", "####", "####"});  // This map covers four tiles.
  Start();
  proto::MapTilesReply part = *Tiles();
  std::set<std::pair<std::int64_t, std::int64_t>> seen;
  tiles_request_.clear_merger_id();
  for (int i = 0; i < 4; ++i) {
    ASSERT_EQ(part.tiles_size(), 1) << i;
    EXPECT_EQ(part.is_complete(), i == 3);
    seen.insert({part.tiles(0).x(), part.tiles(0).y()});
    if (i == 3) break;
    *tiles_request_.mutable_after() = part.tiles(0);
    tiles_request_.clear_merger_id();
    part = *Tiles();
  }
  EXPECT_EQ(seen.size(), 4u);
}

TEST_F(MergeActorTest, ASubscriptionIsAnsweredWhenSomethingChanges) {
  StoreNode(4, 0);
  StoreMap(4, {"#"});
  Start();
  EXPECT_EQ(Tiles(/*wait_s=*/30)->tiles_size(), 1) << "it knows nothing yet";
  EXPECT_FALSE(Tiles(/*wait_s=*/30));
  ReportRecords(proto::POWER);
  team_.AdvanceTime(seconds(2));
  EXPECT_FALSE(TakeAnswer());
  StoreMap(4, {"#"});  // This map changes no cell.
  ReportRecords(proto::LOCAL_TRAVERSABILITY_MAP);
  team_.AdvanceTime(seconds(2));
  EXPECT_FALSE(TakeAnswer());
  StoreMap(4, {"."});
  const std::size_t reads = store_->reads.size();
  for (int i = 0; i < 100; ++i) ReportRecords(proto::LOCAL_TRAVERSABILITY_MAP);
  team_.AdvanceTime(seconds(2));
  EXPECT_LE(store_->reads.size(), reads + 1) << "once in a second";
  const auto answer = TakeAnswer();
  ASSERT_TRUE(answer);
  EXPECT_EQ(Note(answer->map_tiles_reply()).tiles_size(), 1);
}

TEST_F(MergeActorTest, ASubscriptionEndsWithItsTime) {
  StoreNode(4, 0);
  StoreMap(4, {"#"});
  Start();
  const std::uint64_t version = Tiles()->version();
  EXPECT_FALSE(Tiles(/*wait_s=*/30));
  team_.AdvanceTime(seconds(29));
  EXPECT_FALSE(TakeAnswer());
  team_.AdvanceTime(seconds(2));
  const auto answer = TakeAnswer();
  ASSERT_TRUE(answer);
  EXPECT_TRUE(answer->map_tiles_reply().tiles().empty());
  EXPECT_TRUE(answer->map_tiles_reply().is_complete());
  EXPECT_EQ(answer->map_tiles_reply().version(), version);
}

TEST_F(MergeActorTest, GlReturnsTheSameReply) {
  if (const auto gl = CreateGatherBackend(MergeBackend::kGl); !gl) GTEST_SKIP() << ToString(gl.error());
  for (const AgentId agent : {1u, 2u}) {
    StoreNode(agent, agent * 0.11);
    StoreMap(agent, {"#.#", ".#.", "#.#"});
  }
  Start();
  const std::string cells = Merge().zstd_cells();
  team_.AddAgent(2);
  team_.Spawn(2, actor_name::kStorage, [store = store_] { return std::make_unique<FakeStorageActor>(store); });
  options_.self = 2;
  options_.backend = MergeBackend::kGl;
  std::string reported;
  options_.on_backend = [&reported](const std::string& backend) { reported = backend; };
  team_.Spawn(2, actor_name::kMerge, [options = options_] { return std::make_unique<MergeActor>(options); });
  proto::Message message;
  message.mutable_merge_request();
  ASSERT_EQ(team_.Post({2, "test"}, {2, actor_name::kMerge}, std::move(message)), SendResult::kAccepted);
  team_.RunUntilIdle();
  const std::vector<proto::Message> replies = team_.TakeMessages({2, "test"});
  ASSERT_EQ(replies.size(), 1u);
  EXPECT_EQ(replies[0].merge_reply().backend(), "gl");
  EXPECT_EQ(reported, "gl");
  EXPECT_EQ(replies[0].merge_reply().zstd_cells(), cells);
}

}  // namespace
}  // namespace moondb
