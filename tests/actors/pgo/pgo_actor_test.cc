#include "actors/pgo/pgo_actor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "actors/storage/storage_actor.h"
#include "model/record_check.h"
#include "model/record_hash.h"
#include "model/record_key.h"
#include "proto/types.pb.h"
#include "runtime/simulation/simulated_team.h"
#include "tests/actors/pgo/scenario.h"

namespace moondb {
namespace {

using std::chrono::seconds;

proto::Term TermOf(std::uint64_t number) {
  proto::Term term;
  term.set_number(number);
  term.set_issuer(1);
  return term;
}

// Agent 1 runs PgoActor. Agents 2 and 3 are rovers, agent 4 is the base station. Some tests spawn a real StorageActor
// on agent 1; the other tests answer in storage's place.
class PgoActorTest : public testing::Test {
 protected:
  PgoActorTest() : scenario_(simulation::MakeScenario({.seed = 3, .node_count = 24, .outlier_ratio = 0.1})) {
    RecordProperty("seed", 3);
    for (const auto& [id, facts] : scenario_.agents) AddAgent(id, facts);
    (*team_config_.mutable_share())["pose_graph_node"] = proto::POLICY_ALL;
    (*team_config_.mutable_share())["pose_graph_edge"] = proto::POLICY_ALL;
    (*team_config_.mutable_share())["optimized_pose"] = proto::POLICY_LATEST;
    (*team_config_.mutable_share())["edge_verdict"] = proto::POLICY_LATEST;
    (*team_config_.mutable_share())["map_match"] = proto::POLICY_LATEST;
    team_.AddAgent(1);
    options_.self = 1;
    options_.team = team_config_;
    options_.solver.thread_count = 1;
    options_.read_records_max = 50;
    options_.insert_records_max = 20;
  }

  void AddAgent(AgentId id, const AgentFacts& facts) {
    proto::AgentConfig& agent = *team_config_.add_agents();
    agent.set_id(id);
    agent.set_name("agent-" + std::to_string(id));
    for (int i = 0; i < 3; ++i) agent.add_antenna_m(facts.antenna_m[i]);
    if (facts.is_base_station) {
      agent.set_kind(proto::AGENT_KIND_BASE_STATION);
      for (int i = 0; i < 3; ++i) agent.add_position_m(facts.start->position_m[i]);
      return;
    }
    agent.mutable_start()->set_x(facts.start->position_m.x());
    agent.mutable_start()->set_y(facts.start->position_m.y());
    agent.mutable_start()->set_z(facts.start->position_m.z());
    agent.mutable_start()->set_yaw(facts.start->Yaw());
    agent.mutable_start()->set_sigma_m(0.05);
    agent.mutable_start()->set_sigma_rad(0.01);
  }

  void SpawnPgo() {
    team_.Spawn(1, actor_name::kPgo, [this] { return std::make_unique<PgoActor>(options_); });
    team_.RunUntilIdle();
  }

  void SpawnStorage() {
    StorageActor::Options storage;
    storage.path = ":memory:";
    storage.self = 1;
    storage.team = team_config_;
    team_.Spawn(1, actor_name::kStorage, [storage] { return std::make_unique<StorageActor>(storage); });
  }

  void SetLeader(AgentId leader, std::uint64_t term = 1) {
    proto::Message message;
    proto::RoleAssignment& roles = *message.mutable_roles_changed()->mutable_roles();
    *roles.mutable_term() = TermOf(term);
    roles.set_leader(leader);
    ASSERT_EQ(team_.Post({1, actor_name::kRole}, pgo_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
  }

  // Stores the records of scenario_. A record's origin is the agent of its node, or of its edge's first node.
  void StoreGraph() {
    for (const GraphNode& node : scenario_.graph.nodes) StoreRecord(ToRecord(node), node.key.agent);
    for (const OdometryEdge& edge : scenario_.graph.odometry) StoreRecord(ToRecord(edge), edge.from.agent);
    for (const RangeEdge& edge : scenario_.graph.ranges) StoreRecord(ToRecord(edge), edge.from.agent);
  }

  // Returns a match of term 1 that measured the true relative pose of two nodes.
  proto::Record MatchOf(const NodeKey& from, const NodeKey& to) {
    std::mt19937_64 rng(1);
    const LoopClosure closure = simulation::LoopClosureOf(scenario_, from, to, std::string(kRegistrationSource), rng);
    proto::Record record;
    proto::MapMatch& match = *record.mutable_map_match();
    *match.mutable_from() = ToProto(from);
    *match.mutable_to() = ToProto(to);
    *match.mutable_relative_pose()->mutable_from_from_to() = ToProto(closure.from_from_to);
    AddUpperTriangle(closure.covariance, *match.mutable_relative_pose()->mutable_covariance());
    *match.mutable_from_map() = ToProto(RecordKey{{from.agent, 7, proto::LOCAL_TRAVERSABILITY_MAP}, 1});
    *match.mutable_to_map() = ToProto(RecordKey{{to.agent, 7, proto::LOCAL_TRAVERSABILITY_MAP}, 1});
    match.set_from_timestamp_ns(100);
    match.set_to_timestamp_ns(200);
    *match.mutable_term() = TermOf(1);
    match.set_run(1);
    return record;
  }

  void StoreRecord(const proto::Record& record, AgentId origin) {
    proto::Message message;
    if (origin == 1) {
      *message.mutable_insert_request()->add_records() = record;
    } else {
      const StreamKey stream{origin, 7, TypeOf(record)};
      const RecordKey key{stream, ++seqs_[stream]};
      proto::StoredRecord& stored = *message.mutable_store_request()->add_records();
      *stored.mutable_key() = ToProto(key);
      stored.set_content(record.SerializeAsString());
      stored.set_hash(HashRecord(key, stored.content()));
      message.mutable_store_request()->set_sender(origin);
    }
    ASSERT_EQ(team_.Post({1, "test"}, storage_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
    for (const proto::Message& reply : team_.TakeMessages({1, "test"})) {
      ASSERT_FALSE(IsError(reply.insert_reply().error())) << reply.ShortDebugString();
      ASSERT_EQ(reply.store_reply().rejected_count(), 0u) << reply.ShortDebugString();
    }
  }

  void Request(std::uint64_t id = 1, const proto::OptimizeRequest& request = {}) {
    proto::Message message;
    *message.mutable_optimize_request() = request;
    message.set_request_id(id);
    ASSERT_EQ(team_.Post(client_, pgo_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
  }

  std::vector<proto::Message> Answers() { return team_.TakeMessages(client_); }

  proto::GraphStatsReply GraphStats() {
    proto::Message question;
    question.mutable_graph_stats_request();
    EXPECT_EQ(team_.Post(client_, pgo_, std::move(question)), SendResult::kAccepted);
    team_.RunUntilIdle();
    const std::vector<proto::Message> answers = Answers();
    return answers.empty() ? proto::GraphStatsReply() : answers.back().graph_stats_reply();
  }

  proto::OptimizeReply Optimize(const proto::OptimizeRequest& request = {}) {
    Request(1, request);
    const std::vector<proto::Message> answers = Answers();
    EXPECT_EQ(answers.size(), 1u);
    return answers.empty() ? proto::OptimizeReply() : answers[0].optimize_reply();
  }

  // Returns all records of this type in storage.
  std::vector<proto::Record> Read(proto::DataType type) {
    proto::Message message;
    message.mutable_read_request()->add_data_types(type);
    message.mutable_read_request()->set_records_max(10'000);
    EXPECT_EQ(team_.Post({1, "test"}, storage_, message), SendResult::kAccepted);
    team_.RunUntilIdle();
    std::vector<proto::Record> records;
    for (const proto::Message& reply : team_.TakeMessages({1, "test"})) {
      for (const proto::StoredRecord& stored : reply.read_reply().records()) {
        EXPECT_TRUE(records.emplace_back().ParseFromString(stored.content()));
      }
    }
    return records;
  }

  // Returns the last message that PgoActor sent to storage. Requires: SpawnStorage was not called.
  proto::Message AskedStorage() {
    const std::vector<proto::Message> asked = team_.TakeMessages(storage_);
    EXPECT_FALSE(asked.empty());
    return asked.empty() ? proto::Message() : asked.back();
  }

  void AnswerAsStorage(const proto::Message& question, proto::Message answer) {
    answer.set_request_id(question.request_id());
    ASSERT_EQ(team_.Post(storage_, pgo_, std::move(answer)), SendResult::kAccepted);
    team_.RunUntilIdle();
  }

  // Returns storage's answer to a read request: a page with only agent 1's node 0.
  static proto::Message PageWithOneNode() {
    proto::Message answer;
    proto::ReadReply& page = *answer.mutable_read_reply();
    const proto::Record record = ToRecord(GraphNode{{1, 0}, 0, Pose{}});
    proto::StoredRecord& stored = *page.add_records();
    *stored.mutable_key() = ToProto(RecordKey{{1, 7, proto::POSE_GRAPH_NODE}, 1});
    stored.set_content(record.SerializeAsString());
    page.add_row_ids(1);
    page.set_is_complete(true);
    return answer;
  }

  const Address client_{1, "client"};
  const Address pgo_{1, actor_name::kPgo};
  const Address storage_{1, actor_name::kStorage};
  simulation::Scenario scenario_;
  proto::TeamConfig team_config_;
  PgoActor::Options options_;
  std::map<StreamKey, std::uint64_t> seqs_;
  simulation::SimulatedTeam team_{/*seed=*/1};
};

TEST_F(PgoActorTest, IgnoresRequestsFromAnotherAgent) {
  SpawnPgo();
  SetLeader(1);
  team_.RecordSent(pgo_);
  const Address peer{2, actor_name::kGateway};
  proto::Message message;
  message.mutable_graph_stats_request();
  ASSERT_EQ(team_.Post(peer, pgo_, message), SendResult::kAccepted);
  message.mutable_optimize_request();
  ASSERT_EQ(team_.Post(peer, pgo_, message), SendResult::kAccepted);
  team_.RunUntilIdle();
  EXPECT_THAT(team_.TakeSent(pgo_), ::testing::IsEmpty());
}

TEST_F(PgoActorTest, SolvesTheStoredGraphAndPublishesPoses) {
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  const proto::OptimizeReply reply = Optimize();
  ASSERT_FALSE(IsError(reply.error())) << reply.ShortDebugString();
  EXPECT_EQ(reply.node_count(), 73);
  EXPECT_EQ(reply.range_count(), static_cast<double>(scenario_.graph.ranges.size()));
  EXPECT_EQ(reply.updated_pose_count(), 72);
  EXPECT_EQ(reply.rovers_size(), 3);
  EXPECT_TRUE(reply.rovers(0).anchoring() == proto::ANCHORING_ANCHORED);

  const std::vector<proto::Record> poses = Read(proto::OPTIMIZED_POSE);
  ASSERT_EQ(poses.size(), 72u);
  std::map<NodeKey, Pose> published;
  for (const proto::Record& record : poses) {
    const proto::OptimizedPose& body = record.optimized_pose();
    EXPECT_EQ(body.run(), 1u);
    EXPECT_EQ(body.term().number(), 1u);
    published[FromProto(body.node())] = *FromProto(body.map_from_node());
  }
  EXPECT_LT(TrajectoryErrorM(scenario_, published), 0.4);

  std::size_t rejected = 0;
  for (const proto::Record& record : Read(proto::EDGE_VERDICT)) rejected += !record.edge_verdict().is_inlier();
  EXPECT_EQ(rejected, static_cast<std::size_t>(reply.rejected_range_count()));
  EXPECT_GT(rejected, 0u);
}

TEST_F(PgoActorTest, SolvesWithMapMatchesThatNoQuarantineLeavesOut) {
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  StoreRecord(MatchOf({2, 12}, {3, 12}), 1);
  EXPECT_EQ(Optimize().closure_count(), 1);
  const auto verdicts = [this] {
    std::vector<bool> inliers;
    for (const proto::Record& record : Read(proto::EDGE_VERDICT)) {
      if (record.edge_verdict().source() == kRegistrationSource) inliers.push_back(record.edge_verdict().is_inlier());
    }
    return inliers;
  };
  EXPECT_EQ(verdicts(), std::vector<bool>{true});
  proto::Record quarantine;
  quarantine.mutable_map_quarantine()->set_agent_id(3);
  quarantine.mutable_map_quarantine()->set_from_ns(200);
  quarantine.mutable_map_quarantine()->set_to_ns(200);
  StoreRecord(quarantine, 3);
  EXPECT_EQ(Optimize().closure_count(), 0);
}

TEST_F(PgoActorTest, PublishesNothingWhenNothingMoved) {
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  const proto::OptimizeReply first = Optimize();
  const std::size_t verdicts = Read(proto::EDGE_VERDICT).size();
  const proto::OptimizeReply second = Optimize();
  EXPECT_EQ(second.updated_pose_count(), 0);
  EXPECT_NEAR(second.final_cost(), first.final_cost(), 1e-3);
  EXPECT_EQ(Read(proto::EDGE_VERDICT).size(), verdicts);
}

TEST_F(PgoActorTest, ContinuesAsANewLeaderFromTheLastSolution) {
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  // Agent 2 led in term 1 and published its own pose for one node.
  proto::Record record;
  proto::OptimizedPose& pose = *record.mutable_optimized_pose();
  *pose.mutable_node() = ToProto(NodeKey{1, 5});
  *pose.mutable_map_from_node() = ToProto(scenario_.truth.at({1, 5}));
  *pose.mutable_term() = TermOf(1);
  pose.set_run(41);
  StoreRecord(record, 2);
  (void)Optimize();
  std::uint64_t run = 0;
  for (const proto::Record& r : Read(proto::OPTIMIZED_POSE))
    run = std::max<std::uint64_t>(run, r.optimized_pose().run());
  EXPECT_EQ(run, 42u);

  SetLeader(1, /*term=*/2);
  pose.mutable_map_from_node()->mutable_position_m()->set_x(1e3);
  *pose.mutable_term() = TermOf(2);
  pose.set_run(1);
  StoreRecord(record, 2);
  const proto::OptimizeReply reply = Optimize();
  // The solve replaces the wrong pose of run 1 with the pose of a newer run.
  EXPECT_EQ(reply.updated_pose_count(), 1) << reply.ShortDebugString();
}

TEST_F(PgoActorTest, RefusesWhenAnotherAgentLeads) {
  SpawnPgo();
  EXPECT_EQ(Optimize().error().code(), proto::ERROR_CODE_REFUSED);  // PgoActor does not know the roles yet.
  SetLeader(2);
  const proto::OptimizeReply reply = Optimize();
  EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_REFUSED);
  EXPECT_THAT(reply.error().text(), testing::HasSubstr("agent-2 leads"));
  EXPECT_TRUE(team_.TakeMessages(storage_).empty());
}

TEST_F(PgoActorTest, IgnoresRolesAndRecordsThatAnotherAgentSends) {
  team_.AddAgent(2);
  SpawnPgo();
  proto::Message roles;
  roles.mutable_roles_changed()->mutable_roles()->set_leader(1);
  ASSERT_EQ(team_.Post({2, actor_name::kRole}, pgo_, roles), SendResult::kAccepted);
  team_.AdvanceTime(seconds(1));
  EXPECT_EQ(Optimize().error().code(), proto::ERROR_CODE_REFUSED);
}

TEST_F(PgoActorTest, GivesEveryRequesterTheSameAnswerAndRefusesTooMany) {
  options_.requesters_max = 2;
  SpawnPgo();
  SetLeader(1);
  for (const std::uint64_t id : {1, 2, 3}) Request(id);
  std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].request_id(), 3u);
  EXPECT_EQ(answers[0].optimize_reply().error().code(), proto::ERROR_CODE_FULL);

  AnswerAsStorage(AskedStorage(), PageWithOneNode());
  EXPECT_TRUE(Answers().empty());  // PgoActor sends no answer before storage has committed the pose.
  const proto::Message insert = AskedStorage();
  ASSERT_EQ(insert.insert_request().records_size(), 1);
  proto::Message inserted;
  inserted.mutable_insert_reply();
  AnswerAsStorage(insert, inserted);
  answers = Answers();
  ASSERT_EQ(answers.size(), 2u);
  EXPECT_EQ(answers[0].request_id(), 1u);
  EXPECT_EQ(answers[1].request_id(), 2u);
  for (const proto::Message& answer : answers) EXPECT_EQ(answer.optimize_reply().updated_pose_count(), 1);
}

TEST_F(PgoActorTest, AnswersADifferentRequestAfterThePresentOne) {
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  proto::OptimizeRequest other;
  other.set_with_covariance(true);
  const auto post = [this](std::uint64_t id, const proto::OptimizeRequest& request) {
    proto::Message message;
    *message.mutable_optimize_request() = request;
    message.set_request_id(id);
    ASSERT_EQ(team_.Post(client_, pgo_, message), SendResult::kAccepted);
  };
  post(1, {});
  post(2, other);
  post(3, {});
  team_.RunUntilIdle();
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 3u);
  EXPECT_EQ(answers[0].request_id(), 1u);
  EXPECT_EQ(answers[1].request_id(), 3u);
  EXPECT_EQ(answers[2].request_id(), 2u);
  EXPECT_EQ(answers[1].optimize_reply().covariances_size(), 0);
  const auto& covariances = answers[2].optimize_reply().covariances();
  ASSERT_GE(covariances.size(), 3);
  EXPECT_EQ(covariances[0].node().agent_id(), 1u);
  EXPECT_EQ(covariances[0].node().index(), 23u);
  ASSERT_TRUE(FromUpperTriangle(covariances[0].covariance()).has_value());
  EXPECT_GT(covariances[0].covariance(0), 0);
}

TEST_F(PgoActorTest, StartsFromTheLastSolutionUnlessRequestedOtherwise) {
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  EXPECT_EQ(Optimize().initial_values(), "odometry");
  EXPECT_EQ(Optimize().initial_values(), "warm");
  proto::OptimizeRequest scratch;
  scratch.set_from_scratch(true);
  const proto::OptimizeReply again = Optimize(scratch);
  EXPECT_EQ(again.initial_values(), "odometry");
  EXPECT_EQ(again.updated_pose_count(), 0);
}

TEST_F(PgoActorTest, PublishesNothingIfRolesChangeDuringTheSolve) {
  SpawnPgo();
  SetLeader(1);
  Request();
  proto::Message page = PageWithOneNode();
  page.set_request_id(AskedStorage().request_id());
  proto::Message change;
  *change.mutable_roles_changed()->mutable_roles()->mutable_term() = TermOf(2);
  change.mutable_roles_changed()->mutable_roles()->set_leader(2);
  ASSERT_EQ(team_.Post(storage_, pgo_, page), SendResult::kAccepted);
  ASSERT_EQ(team_.Post({1, actor_name::kRole}, pgo_, change), SendResult::kAccepted);
  team_.RunUntilIdle();
  team_.AdvanceTime(seconds(1));
  EXPECT_TRUE(team_.TakeMessages(storage_).empty());
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].optimize_reply().error().code(), proto::ERROR_CODE_REFUSED);
}

TEST_F(PgoActorTest, GivesUpWhenStorageIsSilentAndAcceptsANewRequest) {
  SpawnPgo();
  SetLeader(1);
  Request();
  const proto::Message late = AskedStorage();
  team_.AdvanceTime(seconds(29));
  EXPECT_TRUE(Answers().empty());
  team_.AdvanceTime(seconds(2));
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].optimize_reply().error().code(), proto::ERROR_CODE_TIMED_OUT);

  AnswerAsStorage(late, PageWithOneNode());  // This page comes too late and matches no pending request.
  EXPECT_TRUE(team_.TakeMessages(storage_).empty());
  Request();
  EXPECT_EQ(AskedStorage().read_request().after_row_id(), 0u);
}

TEST_F(PgoActorTest, ForwardsStoragesErrors) {
  SpawnPgo();
  SetLeader(1);
  Request();
  proto::Message failed;
  failed.mutable_read_reply()->mutable_error()->set_code(proto::ERROR_CODE_FULL);
  AnswerAsStorage(AskedStorage(), failed);
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].optimize_reply().error().code(), proto::ERROR_CODE_FULL);
}

TEST_F(PgoActorTest, StopsWritingWhenItLosesTheLead) {
  SpawnPgo();
  SetLeader(1);
  Request();
  AnswerAsStorage(AskedStorage(), PageWithOneNode());
  const proto::Message insert = AskedStorage();
  SetLeader(2, /*term=*/2);
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].optimize_reply().error().code(), proto::ERROR_CODE_REFUSED);
  proto::Message inserted;
  inserted.mutable_insert_reply();
  AnswerAsStorage(insert, inserted);
  EXPECT_TRUE(team_.TakeMessages(storage_).empty());
  EXPECT_TRUE(Answers().empty());
}

TEST_F(PgoActorTest, ReportsThatThereIsNothingToSolve) {
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  EXPECT_EQ(Optimize().error().code(), proto::ERROR_CODE_NOT_FOUND);
}

TEST_F(PgoActorTest, ReportsTheLastSolve) {
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  const proto::OptimizeReply reply = Optimize();
  proto::Message question;
  question.mutable_graph_stats_request();
  question.set_request_id(9);
  ASSERT_EQ(team_.Post(client_, pgo_, question), SendResult::kAccepted);
  team_.RunUntilIdle();
  const std::vector<proto::Message> answers = Answers();
  ASSERT_EQ(answers.size(), 1u);
  EXPECT_EQ(answers[0].request_id(), 9u);
  EXPECT_EQ(answers[0].graph_stats_reply().solve_count(), 1);
  EXPECT_EQ(answers[0].graph_stats_reply().last_solve().SerializeAsString(), reply.SerializeAsString());
}

TEST_F(PgoActorTest, SolvesPeriodicallyOnceRecordsStopArriving) {
  options_.solve_when_quiet = seconds(3);
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  team_.AdvanceTime(seconds(2));
  EXPECT_TRUE(Read(proto::OPTIMIZED_POSE).empty());
  team_.AdvanceTime(seconds(2));
  EXPECT_EQ(Read(proto::OPTIMIZED_POSE).size(), 72u);
  EXPECT_TRUE(Answers().empty());
}

TEST_F(PgoActorTest, ACommandedSolveLeavesNoPeriodicOneDue) {
  options_.solve_when_quiet = seconds(3);
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  EXPECT_TRUE(GraphStats().is_due());
  EXPECT_GT(Optimize().updated_pose_count(), 0);
  EXPECT_FALSE(GraphStats().is_due());
  team_.AdvanceTime(seconds(100));
  EXPECT_EQ(GraphStats().solve_count(), 1);
}

TEST_F(PgoActorTest, SolvesPeriodicallyAfterAMapMatch) {
  options_.solve_when_quiet = seconds(3);
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  team_.AdvanceTime(seconds(100));
  const auto has_verdict = [this] {
    const std::vector<proto::Record> verdicts = Read(proto::EDGE_VERDICT);
    return std::any_of(verdicts.begin(), verdicts.end(), [](const proto::Record& record) {
      return record.edge_verdict().source() == kRegistrationSource;
    });
  };
  EXPECT_FALSE(has_verdict());
  StoreRecord(MatchOf({2, 12}, {3, 12}), 1);
  team_.AdvanceTime(seconds(4));
  EXPECT_TRUE(has_verdict());
}

TEST_F(PgoActorTest, PausesBetweenPeriodicSolves) {
  options_.solve_when_quiet = seconds(3);
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  StoreGraph();
  team_.AdvanceTime(seconds(4));
  StoreRecord(ToRecord(GraphNode{{2, 100}, 0, Pose{}}), 2);
  team_.AdvanceTime(seconds(50));
  EXPECT_EQ(GraphStats().solve_count(), 1);
  team_.AdvanceTime(seconds(10));
  EXPECT_EQ(GraphStats().solve_count(), 2);
}

TEST_F(PgoActorTest, SolvesEventuallyIfRecordsNeverStopArriving) {
  options_.solve_when_quiet = seconds(3);
  options_.solve_apart = seconds(20);
  SpawnStorage();
  SpawnPgo();
  SetLeader(1);
  for (std::uint64_t i = 0; i < 9; ++i) {
    StoreRecord(ToRecord(GraphNode{{2, i}, 0, Pose{}}), 2);
    team_.AdvanceTime(seconds(2));
  }
  EXPECT_TRUE(Read(proto::OPTIMIZED_POSE).empty());
  for (std::uint64_t i = 9; i < 12; ++i) {
    StoreRecord(ToRecord(GraphNode{{2, i}, 0, Pose{}}), 2);
    team_.AdvanceTime(seconds(2));
  }
  EXPECT_FALSE(Read(proto::OPTIMIZED_POSE).empty());
}

TEST_F(PgoActorTest, DoesNotSolvePeriodicallyUnlessItLeads) {
  options_.solve_when_quiet = seconds(3);
  SpawnStorage();
  SpawnPgo();
  SetLeader(2);
  StoreGraph();
  team_.AdvanceTime(seconds(100));
  EXPECT_TRUE(Read(proto::OPTIMIZED_POSE).empty());
}

}  // namespace
}  // namespace moondb
