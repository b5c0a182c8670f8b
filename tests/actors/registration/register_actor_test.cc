#include "actors/registration/register_actor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "actors/pgo/pgo_actor.h"
#include "actors/storage/storage_actor.h"
#include "model/record_check.h"
#include "model/record_hash.h"
#include "model/record_key.h"
#include "proto/types.pb.h"
#include "runtime/simulation/simulated_team.h"
#include "tests/actors/registration/hazard_world.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

constexpr int kNodes = 8;

proto::Term TermOf(std::uint64_t number) {
  proto::Term term;
  term.set_number(number);
  term.set_issuer(1);
  return term;
}

// A StorageActor whose disk can be full.
class FillableStorage final : public Actor {
 public:
  FillableStorage(const StorageActor::Options& options, const bool& is_full) : storage_(options), is_full_(is_full) {}
  void OnStart(Context& context) override { storage_.OnStart(context); }
  void OnMessage(Context& context, const proto::Message& message) override {
    if (!is_full_ || !message.has_insert_request()) return storage_.OnMessage(context, message);
    proto::Message reply;
    reply.set_request_id(message.request_id());
    *reply.mutable_insert_reply()->mutable_error() = ToProto(Error{ErrorCode::kFull, "the disk is full", {}});
    EXPECT_EQ(context.Send(context.sender(), std::move(reply)), SendResult::kAccepted);
  }

 private:
  StorageActor storage_;
  const bool& is_full_;
};

// Agent 1 leads and runs RegisterActor and a real StorageActor. The rovers 1 and 2 drive side by side through a field
// of rocks, from west to east. Rover 2's odometry drifts to the side.
class RegisterActorTest : public testing::Test {
 protected:
  RegisterActorTest() : world_(HazardWorld::OfRocks(5, 90, 18)) {
    for (const AgentId id : {1, 2, 3}) {
      proto::AgentConfig& agent = *config_.add_agents();
      agent.set_id(id);
      agent.set_name("agent-" + std::to_string(id));
      agent.mutable_start()->set_sigma_m(0.05);
      agent.mutable_start()->set_sigma_rad(0.01);
      agent.mutable_start()->set_x(TrueAt({id, 0}).position_m.x());
      agent.mutable_start()->set_y(TrueAt({id, 0}).position_m.y());
    }
    config_.mutable_map()->set_resolution_m(0.05);
    config_.mutable_registration()->set_enabled(true);
    config_.mutable_registration()->set_window_m(3);
    config_.mutable_registration()->set_budget_ms(50);
    for (const char* type : {"pose_graph_node", "pose_graph_edge", "local_traversability_map", "map_quarantine"}) {
      (*config_.mutable_share())[type] = proto::POLICY_ALL;
    }
    for (const char* type : {"optimized_pose", "edge_verdict", "map_match"}) {
      (*config_.mutable_share())[type] = proto::POLICY_LATEST;
    }
    team_.AddAgent(1);
    stats_.set_solve_count(1);
    for (const AgentId id : {1, 2}) Solve(id, proto::ANCHORING_NO_RANGES);
  }

  static Pose TrueAt(const NodeKey& node) {
    return Pose::FromPlanar(-3.5 + static_cast<double>(node.index), node.agent == 1 ? 0 : 1.2, 0);
  }
  Pose RawAt(const NodeKey& node) const {
    const double drift_m = node.agent == 2 ? drift_m_ * static_cast<double>(node.index) : 0;
    return Pose::FromPlanar(0, drift_m, 0) * TrueAt(node);
  }

  void Solve(AgentId agent, proto::Anchoring anchoring) {
    proto::RoverSolution& rover = *stats_.mutable_last_solve()->add_rovers();
    rover.set_agent_id(agent);
    rover.set_anchoring(anchoring);
  }

  void SpawnStorage() {
    StorageActor::Options storage;
    storage.path = ":memory:";
    storage.self = 1;
    storage.team = config_;
    team_.Spawn(1, actor_name::kStorage,
                [this, storage] { return std::make_unique<FillableStorage>(storage, is_disk_full_); });
  }
  void SpawnRegister() {
    RegisterActor::Options options;
    options.self = 1;
    options.team = config_;
    options.turn_pairs_max = turn_pairs_max_;
    options.insert_records_max = 5;
    team_.Spawn(1, actor_name::kRegister, [options] { return std::make_unique<RegisterActor>(options); });
    team_.RunUntilIdle();
  }
  void SpawnPgo() {
    PgoActor::Options options;
    options.self = 1;
    options.team = config_;
    options.solver.thread_count = 1;
    team_.Spawn(1, actor_name::kPgo, [options] { return std::make_unique<PgoActor>(options); });
    team_.RunUntilIdle();
  }

  void SetLeader(AgentId leader, std::uint64_t term = 1) {
    for (const Address& actor : {register_, pgo_}) {
      proto::Message message;
      proto::RoleAssignment& roles = *message.mutable_roles_changed()->mutable_roles();
      *roles.mutable_term() = TermOf(term);
      roles.set_leader(leader);
      (void)team_.Post({1, actor_name::kRole}, actor, message);
    }
    team_.RunUntilIdle();
  }

  RecordKey Store(const proto::Record& record, AgentId origin) {
    proto::Message message;
    RecordKey key;
    if (origin == 1) {
      *message.mutable_insert_request()->add_records() = record;
    } else {
      const StreamKey stream{origin, 7, TypeOf(record)};
      key = {stream, ++seqs_[stream]};
      proto::StoredRecord& stored = *message.mutable_store_request()->add_records();
      *stored.mutable_key() = ToProto(key);
      stored.set_content(record.SerializeAsString());
      stored.set_hash(HashRecord(key, stored.content()));
      message.mutable_store_request()->set_sender(origin);
    }
    EXPECT_EQ(team_.Post({1, "test"}, storage_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
    for (const proto::Message& reply : team_.TakeMessages({1, "test"})) {
      EXPECT_FALSE(IsError(reply.insert_reply().error())) << reply.ShortDebugString();
      EXPECT_EQ(reply.store_reply().rejected_count(), 0u) << reply.ShortDebugString();
      if (reply.insert_reply().keys_size() == 1) key = FromProto(reply.insert_reply().keys(0));
    }
    return key;
  }

  static std::int64_t TimeOf(const NodeKey& node) { return 1'000'000'000 * static_cast<std::int64_t>(1 + node.index); }

  void StoreNode(const NodeKey& node) { StoreNode(node, RawAt(node)); }
  void StoreNode(const NodeKey& node, const Pose& raw) {
    proto::Record record = ToRecord(GraphNode{node, TimeOf(node), raw});
    (void)Store(record, node.agent);
    if (node.index == 0) return;
    OdometryEdge edge;
    edge.from = {node.agent, node.index - 1};
    edge.to = node;
    edge.timestamp_ns = TimeOf(node);
    edge.from_from_to = RawAt(edge.from).Inverse() * RawAt(node);
    edge.covariance.diagonal() << 0.01, 0.01, 1e-4, 1e-4, 1e-4, 1e-3;
    (void)Store(ToRecord(edge), node.agent);
  }
  RecordKey StoreMap(const NodeKey& node) {
    proto::Record record;
    record.set_timestamp_ns(TimeOf(node));
    *record.mutable_local_traversability_map() = ToProto(world_.MapAt(TrueAt(node), node));
    return Store(record, node.agent);
  }
  // Stores the pose that a solve of the leader published.
  void StorePose(const NodeKey& node, const Pose& pose, std::uint64_t run = 1, std::uint64_t term = 1) {
    proto::Record record;
    proto::OptimizedPose& body = *record.mutable_optimized_pose();
    *body.mutable_node() = ToProto(node);
    *body.mutable_map_from_node() = ToProto(pose);
    *body.mutable_term() = TermOf(term);
    body.set_run(run);
    (void)Store(record, 1);
  }
  // Stores both rovers' nodes, maps and poses. The solve's poses are the raw ones.
  void StoreDrive() {
    for (const AgentId agent : {1, 2}) {
      for (std::uint64_t i = 0; i < kNodes; ++i) {
        StoreNode({agent, i});
        (void)StoreMap({agent, i});
        StorePose({agent, i}, RawAt({agent, i}));
      }
    }
  }

  std::vector<proto::MapMatch> Matches() {
    proto::Message message;
    message.mutable_read_request()->add_data_types(proto::MAP_MATCH);
    message.mutable_read_request()->set_records_max(10'000);
    EXPECT_EQ(team_.Post({1, "test"}, storage_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
    std::vector<proto::MapMatch> matches;
    for (const proto::Message& reply : team_.TakeMessages({1, "test"})) {
      for (const proto::StoredRecord& stored : reply.read_reply().records()) {
        proto::Record record;
        EXPECT_TRUE(record.ParseFromString(stored.content()));
        matches.push_back(record.map_match());
      }
    }
    return matches;
  }

  // Answers RegisterActor's questions in PgoActor's place, until it asks no more.
  void AnswerAsPgo() {
    for (int i = 0; i < 1000; ++i) {
      if (!AnswerOnce()) return;
    }
    FAIL() << "RegisterActor asks without end";
  }
  // Answers `count` questions. RegisterActor must ask as many.
  void AnswerAsPgo(int count) {
    for (int i = 0; i < count; ++i) ASSERT_TRUE(AnswerOnce());
  }
  // Answers the newest question in PgoActor's place. Returns false if there is none.
  bool AnswerOnce() {
    const std::vector<proto::Message> asked = team_.TakeMessages(pgo_);
    if (asked.empty()) return false;
    proto::Message answer;
    *answer.mutable_graph_stats_reply() = stats_;
    answer.set_request_id(asked.back().request_id());
    EXPECT_EQ(team_.Post(pgo_, register_, answer), SendResult::kAccepted);
    team_.RunUntilIdle();
    return true;
  }
  void Pass() {
    team_.AdvanceTime(seconds(3));
    AnswerAsPgo();
  }

  void Ask(double wait_s, std::uint64_t id = 1) {
    proto::Message message;
    message.mutable_registration_request()->set_wait_s(wait_s);
    message.set_request_id(id);
    ASSERT_EQ(team_.Post(client_, register_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
  }
  std::vector<proto::Message> Answers() { return team_.TakeMessages(client_); }
  proto::RegistrationReply State() {
    Ask(0);
    const std::vector<proto::Message> answers = Answers();
    EXPECT_EQ(answers.size(), 1u);
    return answers.empty() ? proto::RegistrationReply() : answers[0].registration_reply();
  }

  void SpawnAll() {
    SpawnStorage();
    SpawnRegister();
    SetLeader(1);
  }

  const Address client_{1, "client"};
  const Address register_{1, actor_name::kRegister};
  const Address pgo_{1, actor_name::kPgo};
  const Address storage_{1, actor_name::kStorage};
  HazardWorld world_;
  double drift_m_ = 0.1;  // Drift of rover 2 to the side, from node to node.
  proto::TeamConfig config_;
  proto::GraphStatsReply stats_;
  std::size_t turn_pairs_max_ = 64;
  bool is_disk_full_ = false;
  std::map<StreamKey, std::uint64_t> seqs_;
  simulation::SimulatedTeam team_{/*seed=*/1};
};

TEST_F(RegisterActorTest, StoresMatchesAtTheTrueRelativePoses) {
  SpawnAll();
  StoreDrive();
  Pass();
  const std::vector<proto::MapMatch> matches = Matches();
  ASSERT_GE(matches.size(), 8u);
  for (const proto::MapMatch& match : matches) {
    const Pose truth = TrueAt(FromProto(match.from())).Inverse() * TrueAt(FromProto(match.to()));
    const Pose error = truth.Inverse() * *FromProto(match.relative_pose().from_from_to());
    EXPECT_LT(error.position_m.norm(), 0.05) << match.ShortDebugString();
    EXPECT_EQ(match.term().number(), 1u);
    EXPECT_EQ(match.run(), 1u);
    EXPECT_EQ(match.from_map().origin_agent(), match.from().agent_id());
    EXPECT_EQ(match.from_timestamp_ns(), TimeOf(FromProto(match.from())));
  }
  const proto::RegistrationReply state = State();
  EXPECT_TRUE(state.is_done());
  EXPECT_EQ(state.map_count(), 16);
  EXPECT_EQ(state.stored_count(), static_cast<double>(matches.size()));
  EXPECT_EQ(state.pass_count(), 1);
}

TEST_F(RegisterActorTest, WithPgoActorTheDriftGoesAndTheMatchingEnds) {
  SpawnStorage();
  SpawnPgo();
  SpawnRegister();
  SetLeader(1);
  for (const AgentId agent : {1, 2}) {
    for (std::uint64_t i = 0; i < kNodes; ++i) {
      StoreNode({agent, i});
      (void)StoreMap({agent, i});
    }
  }
  const auto optimize = [this] {
    proto::Message message;
    message.mutable_optimize_request();
    EXPECT_EQ(team_.Post(client_, pgo_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
    const std::vector<proto::Message> answers = Answers();
    EXPECT_EQ(answers.size(), 1u);
    return answers.at(0).optimize_reply();
  };
  EXPECT_EQ(optimize().closure_count(), 0);
  std::vector<std::size_t> counts;
  proto::OptimizeReply last;
  for (int i = 0; i < 5; ++i) {
    team_.AdvanceTime(seconds(10));
    counts.push_back(Matches().size());
    last = optimize();
  }
  EXPECT_GT(counts.front(), 8u);
  EXPECT_EQ(counts[3], counts[4]);
  EXPECT_EQ(last.closure_count(), static_cast<double>(counts.back()));
  EXPECT_EQ(last.rejected_closure_count(), 0);
  EXPECT_EQ(last.updated_pose_count(), 0);
  proto::Message message;
  message.mutable_read_request()->add_data_types(proto::OPTIMIZED_POSE);
  message.mutable_read_request()->set_records_max(1000);
  ASSERT_EQ(team_.Post({1, "test"}, storage_, message), SendResult::kAccepted);
  team_.RunUntilIdle();
  double worst_m = 0;
  for (const proto::Message& reply : team_.TakeMessages({1, "test"})) {
    for (const proto::StoredRecord& stored : reply.read_reply().records()) {
      proto::Record record;
      ASSERT_TRUE(record.ParseFromString(stored.content()));
      const proto::OptimizedPose& pose = record.optimized_pose();
      const Pose error = TrueAt(FromProto(pose.node())).Inverse() * *FromProto(pose.map_from_node());
      worst_m = std::max(worst_m, error.position_m.norm());
    }
  }
  EXPECT_LT(worst_m, 0.2);  // The drift was 0.7 m.
}

// Two rovers that drive 34 m through rooms. The raw poses of rover 2 are in a frame of its own.
class RoomsRegisterActorTest : public RegisterActorTest {
 protected:
  RoomsRegisterActorTest() {
    world_ = HazardWorld::OfRooms(2, 64, 0.08);
    drift_m_ = 0.01;
  }

  void StoreDriveInRooms() {
    const Pose own_from_map = Pose::FromPlanar(40, -7, 2.3);
    for (const AgentId agent : {1, 2}) {
      for (std::uint64_t i = 0; i < 34; ++i) {
        const NodeKey node{agent, i};
        const Pose raw = agent == 1 ? RawAt(node) : own_from_map * RawAt(node);
        StoreNode(node, raw);
        (void)StoreMap(node);
        if (!has_pgo_) StorePose(node, raw);
      }
    }
  }
  void SpawnAllWithPgo() {
    has_pgo_ = true;
    SpawnStorage();
    SpawnPgo();
    SpawnRegister();
    SetLeader(1);
  }
  proto::OptimizeReply Optimize() {
    proto::Message message;
    message.mutable_optimize_request();
    EXPECT_EQ(team_.Post(client_, pgo_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
    return Answers().at(0).optimize_reply();
  }
  void ExpectRightMatches() {
    EXPECT_GT(Matches().size(), 8u);
    for (const proto::MapMatch& match : Matches()) {
      const Pose truth = TrueAt(FromProto(match.from())).Inverse() * TrueAt(FromProto(match.to()));
      const Pose error = truth.Inverse() * *FromProto(match.relative_pose().from_from_to());
      EXPECT_LT(error.position_m.norm(), 0.1) << match.ShortDebugString();
    }
  }

  bool has_pgo_ = false;
};

TEST_F(RoomsRegisterActorTest, ARoverThatStartedAnywhereIsPlacedByItsSubmaps) {
  config_.mutable_agents(1)->clear_start();
  SpawnAllWithPgo();
  StoreDriveInRooms();
  proto::OptimizeReply reply;
  for (int i = 0; i < 4; ++i) {
    reply = Optimize();
    ASSERT_EQ(reply.rovers_size(), 2);
    if (i == 0) {
      EXPECT_EQ(reply.rovers(1).anchoring(), proto::ANCHORING_UNANCHORED);
    }
    team_.AdvanceTime(seconds(10));
  }
  EXPECT_EQ(reply.rovers(1).anchoring(), proto::ANCHORING_ANCHORED) << reply.ShortDebugString();
  ExpectRightMatches();
  const proto::RegistrationReply state = State();
  ASSERT_EQ(state.starts_size(), 1);
  EXPECT_TRUE(state.starts(0).is_accepted()) << state.ShortDebugString();
  EXPECT_EQ(state.starts(0).text(), "accepted");
  EXPECT_EQ(state.starts(0).remedy(), "");
  EXPECT_GE(state.starts(0).evidence(), 12);
  const proto::PlacedSubmaps& place = state.starts(0).place();
  EXPECT_LT(place.submap().first(), place.submap().last());
  const Pose truth = TrueAt({1, place.submap().middle()}).Inverse() * TrueAt({2, place.other_submap().middle()});
  EXPECT_LT((truth.position_m.head<2>() - Eigen::Vector2d(place.x_m(), place.y_m())).norm(), 0.2);
}

TEST_F(RoomsRegisterActorTest, AChangeOfLeaderDuringTheSearchEndsItAndTheNextTermSearchesAgain) {
  turn_pairs_max_ = 1;
  stats_.mutable_last_solve()->mutable_rovers(1)->set_anchoring(proto::ANCHORING_UNANCHORED);
  SpawnAll();
  StoreDriveInRooms();
  team_.AdvanceTime(seconds(3));
  for (int i = 0; i < 5; ++i) {
    const std::vector<proto::Message> asked = team_.TakeMessages(pgo_);
    ASSERT_FALSE(asked.empty()) << "the search is done after " << i << " turns";
    proto::Message answer;
    *answer.mutable_graph_stats_reply() = stats_;
    answer.set_request_id(asked.back().request_id());
    (void)team_.Post(pgo_, register_, answer);
    team_.RunUntilIdle();
  }
  SetLeader(2, 2);
  Pass();
  EXPECT_TRUE(Matches().empty());
  SetLeader(1, 3);
  Pass();
  ExpectRightMatches();
}

TEST_F(RoomsRegisterActorTest, AFalseStartIsNamedWithinOnePass) {
  config_.mutable_agents(1)->mutable_start()->set_x(1);
  config_.mutable_agents(1)->mutable_start()->set_y(4.5);
  config_.mutable_agents(1)->mutable_start()->set_yaw(0.1);
  SpawnAllWithPgo();
  StoreDriveInRooms();
  const proto::OptimizeReply reply = Optimize();
  ASSERT_EQ(reply.rovers_size(), 2);
  EXPECT_EQ(reply.rovers(1).anchoring(), proto::ANCHORING_NO_RANGES);
  team_.AdvanceTime(seconds(10));
  const proto::RegistrationReply state = State();
  EXPECT_EQ(state.pass_count(), 1);
  const auto between = std::ranges::find_if(state.agents(), [](const proto::MatchedAgents& agents) {
    return agents.agent_id() == 1 && agents.other_agent_id() == 2;
  });
  ASSERT_NE(between, state.agents().end());
  EXPECT_TRUE(between->places().is_contradicted()) << between->ShortDebugString();
}

TEST_F(RoomsRegisterActorTest, RightStartsAreNotDoubted) {
  SpawnAllWithPgo();
  StoreDriveInRooms();
  (void)Optimize();
  team_.AdvanceTime(seconds(10));
  const proto::RegistrationReply state = State();
  EXPECT_GT(state.agents_size(), 0);
  for (const proto::MatchedAgents& agents : state.agents()) {
    EXPECT_FALSE(agents.has_places()) << agents.ShortDebugString();
  }
  ExpectRightMatches();
}

// Runs one pass, and returns its matches without the epochs of the maps.
class OnePass : public RegisterActorTest {
 public:
  explicit OnePass(std::size_t turn_pairs_max) { turn_pairs_max_ = turn_pairs_max; }

  std::string Run() {
    SpawnAll();
    StoreDrive();
    Pass();
    std::string run;
    for (proto::MapMatch match : Matches()) {
      match.mutable_from_map()->clear_epoch();
      match.mutable_to_map()->clear_epoch();
      run += match.SerializeAsString();
    }
    return run;
  }

 private:
  void TestBody() override {}
};

TEST(RegisterActorRunsTest, MatchesDoNotDependOnTheTurns) {
  const std::string run = OnePass(64).Run();
  EXPECT_FALSE(run.empty());
  EXPECT_EQ(OnePass(64).Run(), run);
  EXPECT_EQ(OnePass(3).Run(), run);
}

TEST_F(RegisterActorTest, AtMostTwoPassesFollowNewMapsAndAPassAfterThatNeedsNews) {
  SpawnAll();
  StoreDrive();
  Pass();
  const auto solve = [this](std::uint64_t run) {
    for (std::uint64_t i = 0; i < kNodes; ++i) {
      StorePose({2, i}, Pose::FromPlanar(run % 2 == 0 ? 0.5 : -0.5, 0, 0) * TrueAt({2, i}), run);
    }
    Pass();
  };
  solve(2);
  const std::size_t count = Matches().size();
  for (std::uint64_t run = 3; run < 6; ++run) solve(run);
  EXPECT_EQ(State().pass_count(), 2);
  EXPECT_EQ(Matches().size(), count);
  StoreNode({1, kNodes});
  (void)StoreMap({1, kNodes});
  StorePose({1, kNodes}, RawAt({1, kNodes}), 6);
  Pass();
  EXPECT_GT(Matches().size(), count);
}

TEST_F(RegisterActorTest, NothingIsMatchedWhilePgoActorSolves) {
  SpawnAll();
  StoreDrive();
  stats_.set_is_solving(true);
  for (int i = 0; i < 10; ++i) Pass();
  EXPECT_TRUE(Matches().empty());
  EXPECT_FALSE(State().is_done());
  stats_.set_is_solving(false);
  Pass();
  EXPECT_FALSE(Matches().empty());
}

TEST_F(RegisterActorTest, AsksAgainWhenPgoActorWasRestarted) {
  SpawnStorage();
  // A PgoActor that does not answer.
  class Silent final : public Actor {
    void OnMessage(Context&, const proto::Message&) override {}
  };
  team_.Spawn(1, actor_name::kPgo, [] { return std::make_unique<Silent>(); });
  SpawnRegister();
  SetLeader(1);
  StoreDrive();
  team_.RecordSent(register_);
  const auto count_questions = [this] {
    std::size_t count = 0;
    for (const proto::Message& sent : team_.TakeSent(register_)) count += sent.has_graph_stats_request() ? 1 : 0;
    return count;
  };
  team_.AdvanceTime(seconds(20));
  EXPECT_EQ(count_questions(), 1u);
  team_.CrashActor(pgo_);
  team_.AdvanceTime(seconds(20));
  EXPECT_EQ(count_questions(), 1u);
}

TEST_F(RegisterActorTest, TheFirstSolveOfTheLeaderComesFirst) {
  SpawnAll();
  StoreDrive();
  stats_.set_solve_count(0);
  Pass();
  EXPECT_TRUE(Matches().empty());
  EXPECT_FALSE(State().is_done());
  EXPECT_THAT(State().text(), HasSubstr("has not solved"));
}

TEST_F(RegisterActorTest, MapsOfRoversThatAreNotPlacedAreNotMatchedWithEachOther) {
  SpawnAll();
  StoreDrive();
  for (auto& rover : *stats_.mutable_last_solve()->mutable_rovers()) rover.set_anchoring(proto::ANCHORING_UNANCHORED);
  Pass();
  for (const proto::MapMatch& match : Matches()) EXPECT_EQ(match.from().agent_id(), match.to().agent_id());
  EXPECT_TRUE(State().is_done());
}

TEST_F(RegisterActorTest, RefusesWhereItDoesNotLeadOrIsDisabled) {
  SpawnStorage();
  SpawnRegister();
  EXPECT_EQ(State().error().code(), proto::ERROR_CODE_REFUSED);
  SetLeader(2);
  StoreDrive();
  Pass();
  EXPECT_THAT(State().error().text(), HasSubstr("agent-2 leads"));
  EXPECT_TRUE(Matches().empty());
}

TEST_F(RegisterActorTest, ATeamFileCanDisableIt) {
  config_.mutable_registration()->set_enabled(false);
  SpawnAll();
  StoreDrive();
  Pass();
  EXPECT_THAT(State().error().text(), HasSubstr("disables"));
  EXPECT_TRUE(Matches().empty());
}

TEST_F(RegisterActorTest, AWaitEndsWhenNoPairIsLeft) {
  turn_pairs_max_ = 2;
  SpawnAll();
  StoreDrive();
  Ask(60);
  EXPECT_TRUE(Answers().empty());
  AnswerAsPgo();
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_TRUE(answers[0].registration_reply().is_done());
  EXPECT_EQ(answers[0].registration_reply().stored_count(), static_cast<double>(Matches().size()));
}

// A pass that had begun before the request may lack records that were stored before it.
TEST_F(RegisterActorTest, AWaitThatBeginsDuringAPassWaitsForTheNextOne) {
  turn_pairs_max_ = 1;
  SpawnAll();
  StoreDrive();
  team_.AdvanceTime(seconds(3));
  StoreNode({1, kNodes});
  const RecordKey late = StoreMap({1, kNodes});
  StorePose({1, kNodes}, RawAt({1, kNodes}));
  Ask(60);
  EXPECT_TRUE(Answers().empty());
  AnswerAsPgo();
  ASSERT_EQ(Answers().size(), 1u);
  bool has_late = false;
  for (const proto::MapMatch& match : Matches()) {
    has_late = has_late || FromProto(match.from_map()) == late || FromProto(match.to_map()) == late;
  }
  EXPECT_TRUE(has_late);
}

TEST_F(RegisterActorTest, AWaitEndsAtItsLimitAndSaysThatPairsAreLeft) {
  SpawnAll();
  StoreDrive();
  stats_.set_is_solving(true);
  Ask(5);
  AnswerAsPgo();
  for (int i = 0; i < 12; ++i) {
    team_.AdvanceTime(milliseconds(500));
    AnswerAsPgo();
  }
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_FALSE(answers[0].registration_reply().is_done());
}

TEST_F(RegisterActorTest, ALeaderThatChangesDuringAPassStoresNothingAndAnswersWhy) {
  turn_pairs_max_ = 2;
  SpawnAll();
  StoreDrive();
  Ask(60);
  SetLeader(2, 2);
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].registration_reply().error().code(), proto::ERROR_CODE_REFUSED);
  AnswerAsPgo();
  EXPECT_TRUE(Matches().empty());
  // The same agent leads again, and matches under its new term.
  SetLeader(1, 3);
  Pass();
  const std::vector<proto::MapMatch> matches = Matches();
  ASSERT_FALSE(matches.empty());
  EXPECT_EQ(matches[0].term().number(), 3u);
}

TEST_F(RegisterActorTest, MatchesOfAnEarlierLeaderAreNotStoredAgain) {
  SpawnAll();
  StoreDrive();
  Pass();
  const std::size_t count = Matches().size();
  SetLeader(1, 2);
  Pass();
  EXPECT_EQ(State().pass_count(), 1);
  EXPECT_EQ(State().stored_count(), 0);
  EXPECT_EQ(Matches().size(), count);
}

TEST_F(RegisterActorTest, QuarantinedMapsAndNodesAreNotMatched) {
  SpawnAll();
  proto::Record quarantine;
  quarantine.mutable_map_quarantine()->set_agent_id(2);
  quarantine.mutable_map_quarantine()->set_from_ns(TimeOf({2, 0}));
  quarantine.mutable_map_quarantine()->set_to_ns(TimeOf({2, 3}));
  (void)Store(quarantine, 2);
  quarantine.Clear();
  quarantine.mutable_map_quarantine()->set_agent_id(2);
  *quarantine.mutable_map_quarantine()->mutable_node() = ToProto(NodeKey{2, 5});
  (void)Store(quarantine, 2);
  StoreDrive();
  Pass();
  const std::vector<proto::MapMatch> matches = Matches();
  EXPECT_FALSE(matches.empty());
  for (const proto::MapMatch& match : matches) {
    EXPECT_TRUE(match.to().index() == 4 || match.to().index() > 5) << match.ShortDebugString();
  }
  EXPECT_EQ(State().map_count(), 11);
  EXPECT_EQ(State().other_map_count(), 5);
}

TEST_F(RegisterActorTest, AnotherRoverInAMapIsMasked) {
  // Rover 3 stands beside rover 1, which sees it as a rock. It carries no maps.
  const Pose body = Pose::FromPlanar(-1, -1.5, 0);
  HazardWorld seen = world_;
  seen.rocks.push_back({body.position_m.head<2>(), 0.4});
  RegisterActor::Options options;
  KnownMaps known({.rovers = {1, 3}, .body_radius_m = 0.75});
  const auto add = [&](const proto::Record& record, const RecordKey& key) { ASSERT_TRUE(known.Add(key, record)); };
  proto::Record map;
  map.set_timestamp_ns(5'000'000'000);
  *map.mutable_local_traversability_map() = ToProto(seen.MapAt({}, {1, 0}));
  add(map, {{1, 7, proto::LOCAL_TRAVERSABILITY_MAP}, 1});
  add(ToRecord(GraphNode{{3, 0}, 6'000'000'000, body}), {{3, 7, proto::POSE_GRAPH_NODE}, 1});
  add(ToRecord(GraphNode{{3, 1}, 90'000'000'000, Pose{}}), {{3, 7, proto::POSE_GRAPH_NODE}, 2});
  for (const auto& [node, pose] : {std::pair{NodeKey{1, 0}, Pose{}}, {NodeKey{3, 0}, body}}) {
    proto::Record record;
    *record.mutable_optimized_pose()->mutable_node() = ToProto(node);
    *record.mutable_optimized_pose()->mutable_map_from_node() = ToProto(pose);
    *record.mutable_optimized_pose()->mutable_term() = TermOf(1);
    add(record, {{1, 7, proto::OPTIMIZED_POSE}, node.agent});
  }
  const std::vector<RegisteredMap> maps = known.FindRegistered();
  ASSERT_EQ(maps.size(), 1u);
  const std::vector<MaskedDisc> discs = known.FindRovers(maps[0]);
  ASSERT_EQ(discs.size(), 1u);
  EXPECT_LT((discs[0].center_m - body.position_m.head<2>()).norm(), 1e-9);
  const HazardField field(*known.FindMap(maps[0].key), discs);
  for (const Eigen::Vector2d& point_m : field.points_m()) {
    EXPECT_GT((point_m - body.position_m.head<2>()).norm(), 0.75);
  }
}

TEST_F(RegisterActorTest, APassGoesOnAfterStorageHasFailed) {
  SpawnRegister();
  SetLeader(1);
  team_.AdvanceTime(seconds(3));  // Nobody answers as storage.
  Ask(100);
  team_.AdvanceTime(seconds(70));
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_FALSE(answers[0].registration_reply().is_done());
  EXPECT_FALSE(answers[0].registration_reply().text().empty());
  SpawnStorage();
  StoreDrive();
  for (int i = 0; i < 12; ++i) Pass();  // The actor may just have asked the storage that did not answer.
  EXPECT_FALSE(Matches().empty());
  EXPECT_TRUE(State().is_done());
}

TEST_F(RegisterActorTest, APassThatAFullDiskStoppedContinuesByItselfOnceThereIsSpace) {
  SpawnAll();
  StoreDrive();
  is_disk_full_ = true;
  Pass();
  Ask(60);
  for (int i = 0; i < 10; ++i) Pass();
  std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].registration_reply().text(), "the disk is full");
  EXPECT_FALSE(answers[0].registration_reply().is_done());
  const double matched = State().counts(0).count();
  EXPECT_TRUE(Matches().empty());
  is_disk_full_ = false;
  for (int i = 0; i < 20; ++i) Pass();  // 60 s.
  EXPECT_FALSE(Matches().empty());
  EXPECT_TRUE(State().is_done());
  EXPECT_EQ(State().text(), "");
  EXPECT_GT(State().counts(0).count(), matched) << "the pass ended where it stopped";
  EXPECT_EQ(State().pass_count(), 1) << "nothing was matched again";
}

TEST_F(RegisterActorTest, MatchesAreStoredDuringAPassAndOutliveAChangeOfLeader) {
  turn_pairs_max_ = 1;
  SpawnAll();
  StoreDrive();
  team_.AdvanceTime(seconds(3));
  AnswerAsPgo(20);
  ASSERT_GT(State().left_count(), 0);
  const std::size_t stored = Matches().size();
  EXPECT_GE(stored, 5u);
  SetLeader(2, 2);
  SetLeader(1, 3);
  const proto::RegistrationReply state = State();
  EXPECT_EQ(state.left_count(), 0);
  EXPECT_FALSE(state.is_done()) << "no pass has read the records in this term";
  Pass();
  EXPECT_TRUE(State().is_done());
  EXPECT_GT(Matches().size(), stored);
}

TEST_F(RegisterActorTest, ASteadyStreamOfRecordsDoesNotPostponeAPassWithoutLimit) {
  SpawnAll();
  StoreDrive();
  for (int i = 0; i < 80; ++i) {
    StorePose({1, 0}, RawAt({1, 0}), 2 + static_cast<std::uint64_t>(i));
    team_.AdvanceTime(milliseconds(500));
    AnswerAsPgo();
  }
  EXPECT_EQ(State().pass_count(), 1);
  EXPECT_FALSE(Matches().empty());
}

TEST_F(RegisterActorTest, RecordsThatArriveDuringAPassStartAnotherOne) {
  turn_pairs_max_ = 1;
  SpawnAll();
  StoreDrive();
  team_.AdvanceTime(seconds(3));
  StoreNode({1, kNodes});
  (void)StoreMap({1, kNodes});
  StorePose({1, kNodes}, RawAt({1, kNodes}));
  team_.AdvanceTime(seconds(3));  // Longer than `quiet`, while the pass waits for PgoActor.
  EXPECT_TRUE(State().is_due());
  AnswerAsPgo();
  const std::size_t first = Matches().size();
  Pass();
  EXPECT_FALSE(State().is_due());
  EXPECT_GT(Matches().size(), first);
}

TEST_F(RegisterActorTest, TheSecondPassWaitsForASolveThatUsesAllMatchesOfTheFirst) {
  turn_pairs_max_ = 1;
  SpawnAll();
  StoreDrive();
  team_.AdvanceTime(seconds(3));
  AnswerAsPgo(20);
  ASSERT_FALSE(Matches().empty());
  StorePose({1, 0}, RawAt({1, 0}), 2);  // A solve during the pass.
  AnswerAsPgo();
  for (int i = 0; i < 20; ++i) Pass();
  EXPECT_EQ(State().pass_count(), 1);
  StorePose({2, 0}, Pose::FromPlanar(0.4, 0, 0) * RawAt({2, 0}), 3);
  Pass();
  EXPECT_EQ(State().pass_count(), 2);
}

TEST_F(RegisterActorTest, CountsMapsWithoutAPoseAndMatchesOfRemovedMaps) {
  SpawnAll();
  StoreDrive();
  StoreNode({1, kNodes});
  (void)StoreMap({1, kNodes});
  Pass();
  EXPECT_EQ(State().unposed_map_count(), 1);
  EXPECT_EQ(State().removed_map_match_count(), 0);
  // A match of the previous term, of a map that nobody holds any more.
  proto::Record record;
  *record.mutable_map_match() = Matches()[0];
  record.mutable_map_match()->mutable_from()->set_index(kNodes);
  record.mutable_map_match()->mutable_from_map()->set_seq(999);
  (void)Store(record, 1);
  Ask(60);
  AnswerAsPgo();
  ASSERT_EQ(Answers().size(), 1u);
  EXPECT_EQ(State().removed_map_match_count(), 1);
}

TEST_F(RegisterActorTest, IgnoresMessagesOfOtherAgents) {
  team_.AddAgent(2);
  SpawnAll();
  team_.RecordSent(register_);
  proto::Message message;
  message.mutable_registration_request();
  ASSERT_EQ(team_.Post({2, actor_name::kGateway}, register_, message), SendResult::kAccepted);
  team_.RunUntilIdle();
  EXPECT_TRUE(team_.TakeSent(register_).empty());
}

TEST_F(RegisterActorTest, TooManyWaitsAreRefused) {
  SpawnAll();
  StoreDrive();
  for (std::uint64_t i = 1; i <= 65; ++i) Ask(60, i);
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].request_id(), 65u);
  EXPECT_EQ(answers[0].registration_reply().error().code(), proto::ERROR_CODE_FULL);
}

}  // namespace
}  // namespace moondb
