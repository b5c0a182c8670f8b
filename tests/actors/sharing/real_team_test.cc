// Tests sharing, roles and the real StorageActor together, in a team of three rovers and a base station with SQLite
// files.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <random>
#include <set>

#include "actors/role/role_actor.h"
#include "actors/storage/paper_sql.h"
#include "actors/storage/storage_actor.h"
#include "model/have_set.h"
#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;

constexpr AgentId kAgents = 4;
constexpr AgentId kBase = 4;

proto::Pose PoseAt(double x_m) {
  proto::Pose pose;
  pose.mutable_position_m()->set_x(x_m);
  pose.mutable_orientation()->set_w(1);
  return pose;
}

proto::NodeKey Node(AgentId agent, std::uint64_t index) {
  proto::NodeKey node;
  node.set_agent_id(agent);
  node.set_index(index);
  return node;
}

class RealTeam {
 public:
  using Records = std::map<RecordKey, std::string>;

  explicit RealTeam(std::uint64_t seed, proto::Codec codec = proto::CODEC_COMPACT,
                    proto::TeamConfig config = TestTeam(3))
      : config_(std::move(config)), team_(seed) {
    config_.mutable_radio()->set_codec(codec);
    static int count = 0;
    folder_ = std::filesystem::path(testing::TempDir()) /
              ("moondb_real_team_" + std::to_string(::getpid()) + "_" + std::to_string(count++));
    std::filesystem::create_directories(folder_);
    team_.SetBaseStation(kBase);
    for (AgentId agent = 1; agent <= kAgents; ++agent) team_.AddAgent(agent);
    for (AgentId agent = 1; agent <= kAgents; ++agent) SpawnActors(agent);
    team_.SetFilter([this](AgentId from, AgentId to, const proto::Message& message) {
      if (message.has_have()) claimed_[from].Merge(*FromProto(message.have().have()));
      if (message.has_have()) have_bytes_[{from, to}] += message.ByteSizeLong();
      if (message.has_batch()) records_to_[to] += message.batch().record_count();
      if (message.has_batch() && message.batch().codec() == proto::CODEC_PAPER_SQL) ++statements_;
      return true;
    });
  }

  ~RealTeam() {
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      if (team_.is_running(agent)) team_.Crash(agent);
    }
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }

  std::size_t statements() const { return statements_; }

  void Settle() { team_.AdvanceTime(seconds(10)); }

  void InsertNodes(AgentId agent, int count) {
    proto::InsertRequest request;
    for (int i = 0; i < count; ++i) {
      proto::PoseGraphNode& node = *AddRecord(request).mutable_pose_graph_node();
      *node.mutable_node() = Node(agent, next_index_[agent]++);
      *node.mutable_map_from_node() = PoseAt(static_cast<double>(next_index_[agent]) * 0.7312345);
    }
    Insert(agent, request);
  }

  void InsertMap(AgentId agent, std::uint64_t pattern) {
    proto::InsertRequest request;
    proto::LocalTraversabilityMap& map = *AddRecord(request).mutable_local_traversability_map();
    *map.mutable_node() = Node(agent, 0);
    *map.mutable_node_from_map() = PoseAt(0);
    proto::MapLayer& layer = *map.add_layers();
    layer.set_width_cells(128);
    layer.set_height_cells(128);
    layer.set_resolution_um(100'000);
    std::mt19937_64 rng(pattern);
    for (int i = 0; i < 128 * 128 / 4; ++i) layer.mutable_cells()->push_back(rng() % 8 == 0 ? '\x19' : '\x55');
    Insert(agent, request);
  }

  void InsertPower(AgentId agent, double ratio) {
    proto::InsertRequest request;
    AddRecord(request).mutable_power()->set_battery_ratio(ratio);
    Insert(agent, request);
  }

  void InsertOptimizedPoses(AgentId leader, AgentId of_agent, int count, std::uint64_t run) {
    proto::InsertRequest request;
    for (int i = 0; i < count; ++i) {
      proto::OptimizedPose& pose = *AddRecord(request).mutable_optimized_pose();
      *pose.mutable_node() = Node(of_agent, static_cast<std::uint64_t>(i));
      *pose.mutable_map_from_node() = PoseAt(static_cast<double>(run) + i);
      pose.mutable_term()->set_number(1);
      pose.mutable_term()->set_issuer(leader);
      pose.set_run(run);
    }
    Insert(leader, request);
  }

  // Inserts nodes and a map of each rover, and poses of all nodes at the leader, agent 1.
  void InsertMission() {
    for (const AgentId agent : {1u, 2u, 3u}) {
      InsertNodes(agent, 5);
      InsertMap(agent, agent);
      InsertOptimizedPoses(/*leader=*/1, agent, 5, /*run=*/1);
    }
  }

  void InsertQuarantine(AgentId at, AgentId maps_of) {
    proto::InsertRequest request;
    AddRecord(request).mutable_map_quarantine()->set_agent_id(maps_of);
    Insert(at, request);
  }

  std::size_t QuarantinesAt(AgentId agent) {
    const Records records = ReadAll(agent);
    return static_cast<std::size_t>(std::count_if(records.begin(), records.end(), [](const auto& record) {
      return record.first.stream.type == proto::MAP_QUARANTINE;
    }));
  }

  Records ReadAll(AgentId agent) {
    Records records;
    for (std::uint64_t after = 0;;) {
      proto::Message question;
      question.mutable_read_request()->set_after_row_id(after);
      const proto::Message answer = Ask(agent, actor_name::kStorage, question);
      const proto::ReadReply& reply = answer.read_reply();
      for (const proto::StoredRecord& record : reply.records()) {
        if (record.key().seq() != 0) records[FromProto(record.key())] = record.content();
      }
      if (reply.is_complete() || reply.row_ids().empty()) return records;
      after = *reply.row_ids().rbegin();
    }
  }

  HaveSet HaveOf(AgentId agent) {
    proto::Message question;
    question.mutable_have_request();
    return *FromProto(Ask(agent, actor_name::kStorage, question).have_reply().have());
  }

  // Returns the only stream of the agent's nodes. Requires: the agent has not restarted.
  StreamKey NodesOf(AgentId agent) {
    for (const auto& [stream, have] : HaveOf(agent).streams()) {
      if (stream.origin == agent && stream.type == proto::POSE_GRAPH_NODE) return stream;
    }
    return {};
  }

  proto::RoleAssignment RolesAt(AgentId agent) {
    proto::Message question;
    question.mutable_role_show_request();
    return Ask(agent, actor_name::kRole, question).role_show_reply().roles();
  }

  void SetRoles(AgentId agent, AgentId leader, AgentId survivor) {
    proto::Message question;
    question.mutable_role_set_request()->set_leader(leader);
    question.mutable_role_set_request()->set_survivor(survivor);
    Ask(agent, actor_name::kRole, question);
  }

  void Swap(AgentId agent) {
    proto::Message question;
    question.mutable_role_set_request()->set_is_swap(true);
    Ask(agent, actor_name::kRole, question);
  }

  double SentRecords() {
    double sent = 0;
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      for (const char* actor : {actor_name::kSync, actor_name::kReplica}) {
        const proto::ShareStatus status = ShareStatusOf(team_, agent, actor);
        for (const proto::ShareSession& session : status.sessions()) {
          sent += session.sent_records();
          EXPECT_FALSE(session.is_open()) << session.ShortDebugString();
          EXPECT_EQ(session.remaining(), 0) << session.ShortDebugString();
        }
      }
    }
    return sent;
  }

  // Returns the bytes of the have-sets sent since the last call, by sender and receiver.
  std::map<std::pair<AgentId, AgentId>, std::size_t> TakeHaveBytes() { return std::exchange(have_bytes_, {}); }
  // Returns the number of records in batches sent since the last call, by receiver.
  std::map<AgentId, std::uint64_t> TakeRecordsTo() { return std::exchange(records_to_, {}); }

  // Begins a term of agent 1, so that an order waits for records that it gathers.
  void BeginTerm() {
    SetRoles(1, /*leader=*/1, /*survivor=*/2);
    Settle();
    (void)TakeRecordsTo();
  }

  // Orders a sync at agent 1 and returns when agent 1 says that it is over, or after an hour. Requires: BeginTerm.
  proto::ShareProgress SyncAndWait() {
    proto::Message order = ShareOrder(proto::SHARING_KIND_SYNC);
    order.mutable_share_request()->set_wait_s(3600);
    (void)team_.Post({1, "client"}, {1, actor_name::kSync}, std::move(order));
    for (int i = 0; i < 72'000; ++i) {
      team_.AdvanceTime(milliseconds(50));
      for (const proto::Message& answer : team_.TakeMessages({1, "client"})) {
        if (answer.has_share_reply()) return answer.share_reply().progress();
      }
    }
    return {};
  }

  // Returns the records of the types in `rovers` that agent 1 holds and the agent does not cover.
  std::vector<RecordKey> LackingAt(AgentId agent) {
    std::vector<RecordKey> lacking;
    const HaveSet have = HaveOf(agent);
    for (const auto& [key, content] : ReadAll(1)) {
      const bool is_due = RoversPolicyOf(config_, key.stream.type) != proto::POLICY_NONE;
      if (is_due && !have.Get(key.stream).Covered().Contains(key.seq)) lacking.push_back(key);
    }
    return lacking;
  }

  // Orders a sync and then a replication at the leader. Waits two minutes after each order, which is enough on an idle
  // radio.
  void SyncAndReplicate() {
    const AgentId leader = RolesAt(1).leader();
    EXPECT_EQ(Share(team_, leader, ShareOrder(proto::SHARING_KIND_SYNC)).error().code(), proto::ERROR_CODE_NONE);
    team_.AdvanceTime(minutes(2));
    EXPECT_EQ(Share(team_, leader, ShareOrder(proto::SHARING_KIND_REPLICATION)).error().code(), proto::ERROR_CODE_NONE);
    team_.AdvanceTime(minutes(2));
  }

  // Expects that every running agent still covers all records that it ever acknowledged.
  void ExpectNothingAcknowledgedIsLost() {
    for (const auto& [agent, claimed] : claimed_) {
      if (!team_.is_running(agent)) continue;
      const HaveSet have = HaveOf(agent);
      for (const auto& [key, stream] : claimed.streams()) {
        EXPECT_TRUE(stream.Covered().Minus(have.Get(key).Covered()).is_empty()) << "agent " << agent;
      }
    }
  }

  void ExpectConverged() {
    const proto::RoleAssignment roles = RolesAt(1);
    for (AgentId agent = 2; agent <= kAgents; ++agent) EXPECT_EQ(RolesAt(agent).leader(), roles.leader());
    const Records leader = ReadAll(roles.leader());
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      for (const auto& [key, content] : ReadAll(agent)) {
        if (key.stream.origin != agent) continue;
        const auto found = leader.find(key);
        ASSERT_NE(found, leader.end()) << ToString(key) << " of agent " << agent;
        EXPECT_EQ(found->second, content);
      }
    }
    EXPECT_EQ(ReadAll(roles.survivor()), leader) << "the survivor has what the leader has";
    EXPECT_EQ(HaveOf(roles.survivor()), HaveOf(roles.leader()));
    // The base station has all of the leader's records whose type has a policy in `ground` other than `none`.
    const Records base = ReadAll(kBase);
    for (const auto& [key, content] : leader) {
      if (GroundPolicyOf(config_, key.stream.type) != proto::POLICY_NONE) {
        EXPECT_EQ(base.count(key), 1u) << ToString(key);
      }
    }
    ExpectNothingAcknowledgedIsLost();
  }

  void ExpectNothingIsSentTwice() {
    const double sent = SentRecords();
    SyncAndReplicate();
    EXPECT_EQ(SentRecords(), sent);
    const std::uint64_t bytes = team_.radio_bytes();
    team_.AdvanceTime(minutes(10));
    EXPECT_EQ(team_.radio_bytes(), bytes) << "no byte is sent permanently";
  }

  simulation::SimulatedTeam& team() { return team_; }

 private:
  void SpawnActors(AgentId agent) {
    StorageActor::Options storage;
    storage.path = (folder_ / ("agent" + std::to_string(agent) + ".db")).string();
    storage.self = agent;
    storage.team = config_;
    team_.Spawn(agent, actor_name::kStorage, [storage] { return std::make_unique<StorageActor>(storage); });
    RoleActor::Options role;
    role.self = agent;
    role.team = config_;
    team_.Spawn(agent, actor_name::kRole, [role] { return std::make_unique<RoleActor>(role); });
    SpawnSharing(team_, agent, config_, {SqlOf, RecordOf});
  }

  static proto::Record& AddRecord(proto::InsertRequest& request) {
    proto::Record& record = *request.add_records();
    record.set_timestamp_ns(1);
    return record;
  }

  void Insert(AgentId agent, const proto::InsertRequest& request) {
    proto::Message question;
    *question.mutable_insert_request() = request;
    const proto::Message answer = Ask(agent, actor_name::kStorage, question);
    if (team_.is_running(agent)) {
      ASSERT_TRUE(answer.has_insert_reply());
      ASSERT_FALSE(IsError(answer.insert_reply().error())) << answer.insert_reply().error().ShortDebugString();
    }
  }

  // Sends `question` from a client of `agent`. Returns the answer, or an empty message if there is no answer.
  proto::Message Ask(AgentId agent, const char* actor, const proto::Message& question) {
    (void)team_.Post({agent, "client"}, {agent, actor}, question);
    team_.RunUntilIdle();
    const auto answers = team_.TakeMessages({agent, "client"});
    return answers.empty() ? proto::Message() : answers.back();
  }

  proto::TeamConfig config_;
  std::size_t statements_ = 0;
  std::filesystem::path folder_;
  simulation::SimulatedTeam team_;
  std::map<AgentId, std::uint64_t> next_index_;
  std::map<AgentId, HaveSet> claimed_;  // By agent: all records that the agent has claimed to have in its have-sets.
  std::map<std::pair<AgentId, AgentId>, std::size_t> have_bytes_;
  std::map<AgentId, std::uint64_t> records_to_;
};

TEST(RealTeamTest, LeaderThenSurvivorHaveEverythingAndNothingIsSentTwice) {
  RealTeam team(/*seed=*/1);
  team.Settle();
  for (AgentId agent = 1; agent <= 3; ++agent) {
    team.InsertNodes(agent, 200);
    for (std::uint64_t i = 0; i < 10; ++i) team.InsertMap(agent, 100 * agent + i);
    for (int i = 0; i < 5; ++i) team.InsertPower(agent, 0.1 * i);
  }
  team.InsertOptimizedPoses(1, 2, 50, 1);
  team.InsertOptimizedPoses(1, 2, 50, 2);
  team.SyncAndReplicate();
  team.ExpectConverged();
  // Agent 2 holds only the newest power state of each rover and only the optimised poses of the newest run.
  std::map<DataType, int> counts;
  for (const auto& [key, content] : team.ReadAll(2)) ++counts[key.stream.type];
  EXPECT_EQ(counts[proto::POWER], 3);
  EXPECT_EQ(counts[proto::OPTIMIZED_POSE], 50);
  EXPECT_EQ(counts[proto::POSE_GRAPH_NODE], 600);
  EXPECT_EQ(counts[proto::LOCAL_TRAVERSABILITY_MAP], 30);
  team.ExpectNothingIsSentTwice();
}

TEST(RealTeamTest, ThePapersSqlCodecTransfersEverythingToo) {
  RealTeam team(/*seed=*/7, proto::CODEC_PAPER_SQL);
  team.Settle();
  for (AgentId agent = 1; agent <= 3; ++agent) {
    team.InsertNodes(agent, 20);
    team.InsertMap(agent, agent);
    team.InsertPower(agent, 0.1);
  }
  team.SyncAndReplicate();
  team.ExpectConverged();
  EXPECT_GT(team.statements(), 100u);
}

TEST(RealTeamTest, ANewLeaderIsSentOnlyMissingRecords) {
  RealTeam team(/*seed=*/2);
  team.Settle();
  for (AgentId agent = 1; agent <= 3; ++agent) team.InsertNodes(agent, 100);
  team.SyncAndReplicate();
  const double sent = team.SentRecords();
  team.Swap(1);
  team.team().AdvanceTime(seconds(10));
  ASSERT_EQ(team.RolesAt(3).leader(), 2u);
  team.InsertNodes(3, 7);
  team.SyncAndReplicate();
  team.ExpectConverged();
  // The new leader, the new survivor and the base station each receive the 7 records.
  EXPECT_EQ(team.SentRecords(), sent + 7 * 3);
}

// In the paper, each destination has a log of its own. The rovers would then send their whole history to the new leader
// again.
TEST(RealTeamTest, NothingIsSentAgainAfterTheLeadersDeath) {
  RealTeam team(/*seed=*/4);
  team.Settle();
  for (AgentId agent = 1; agent <= 3; ++agent) {
    team.InsertNodes(agent, 100);
    for (std::uint64_t i = 0; i < 100; ++i) team.InsertMap(agent, 1000 * agent + i);
    team.InsertPower(agent, 0.5);
  }
  team.SyncAndReplicate();
  team.ExpectConverged();
  const RealTeam::Records before = team.ReadAll(2);
  // Size of the remaining agents' own records. With a log per destination, these agents would send all these records to
  // the new leader.
  std::size_t log_bytes = 0;
  for (const AgentId agent : {3u, kBase}) {
    for (const auto& [key, content] : before) log_bytes += key.stream.origin == agent ? content.size() : 0;
  }
  (void)team.TakeRecordsTo();
  (void)team.TakeHaveBytes();

  team.team().Crash(1);
  for (AgentId agent = 2; agent <= kAgents; ++agent) team.team().SetLink(1, agent, false);
  team.SetRoles(2, /*leader=*/2, /*survivor=*/3);
  team.team().AdvanceTime(minutes(2));
  EXPECT_EQ(Share(team.team(), 2, ShareOrder(proto::SHARING_KIND_SYNC)).error().code(), proto::ERROR_CODE_NONE);
  team.team().AdvanceTime(minutes(2));
  EXPECT_EQ(team.TakeRecordsTo()[2], 0u);
  std::size_t have_bytes_max = 0;
  for (const auto& [pair, bytes] : team.TakeHaveBytes()) {
    EXPECT_LT(bytes, 1000u) << pair.first << " to " << pair.second;
    have_bytes_max = std::max(have_bytes_max, bytes);
  }
  EXPECT_EQ(Share(team.team(), 2, ShareOrder(proto::SHARING_KIND_REPLICATION)).error().code(), proto::ERROR_CODE_NONE);
  team.team().AdvanceTime(minutes(2));
  EXPECT_EQ(team.ReadAll(2), before);
  EXPECT_EQ(team.ReadAll(3), before);
  std::cout << "sent again: 0 records, at most " << have_bytes_max
            << " bytes of have-sets a pair; by a log per destination " << log_bytes << " bytes of contents\n";
}

TEST(RealTeamTest, LinkFailureAndLeaderCrashLoseNothing) {
  RealTeam team(/*seed=*/3);
  team.Settle();
  for (AgentId agent = 1; agent <= 3; ++agent) {
    team.InsertNodes(agent, 300);
    for (std::uint64_t i = 0; i < 10; ++i) team.InsertMap(agent, 100 * agent + i);
  }
  team.team().radio().bytes_per_second = 50'000;
  Share(team.team(), 1, ShareOrder(proto::SHARING_KIND_SYNC));
  team.team().AdvanceTime(milliseconds(200));
  team.team().SetLink(1, 3, false);
  team.team().AdvanceTime(milliseconds(100));
  team.team().Crash(1);
  team.team().AdvanceTime(seconds(20));
  team.team().Restart(1);
  team.team().SetLink(1, 3, true);
  team.team().AdvanceTime(seconds(60));
  team.ExpectNothingAcknowledgedIsLost();
  team.SyncAndReplicate();
  team.ExpectConverged();
  team.ExpectNothingIsSentTwice();
}

proto::TeamConfig TeamWithRoversPolicies() {
  proto::TeamConfig config = TestTeam(3);
  (*config.mutable_rovers())["pose_graph_node"] = proto::POLICY_ALL;
  (*config.mutable_rovers())["optimized_pose"] = proto::POLICY_LATEST;
  (*config.mutable_rovers())["local_traversability_map"] = proto::POLICY_ALL;
  return config;
}

TEST(RealTeamTest, OneSyncBringsEachRoverTheOthersRecordsOfThePolicyRovers) {
  RealTeam real(/*seed=*/1, proto::CODEC_COMPACT, TeamWithRoversPolicies());
  real.BeginTerm();
  real.InsertMission();
  for (const AgentId agent : {1u, 2u, 3u}) real.InsertPower(agent, 0.5);
  EXPECT_TRUE(real.SyncAndWait().is_complete());
  for (const AgentId agent : {2u, 3u}) {
    EXPECT_TRUE(real.LackingAt(agent).empty()) << "agent " << agent;
    const RealTeam::Records records = real.ReadAll(agent);
    const auto foreign_powers = std::ranges::count_if(records, [agent](const auto& record) {
      return record.first.stream.type == proto::POWER && record.first.stream.origin != agent;
    });
    EXPECT_EQ(foreign_powers, 0) << "a type without the policy";
  }
  EXPECT_EQ(real.TakeRecordsTo()[2], 5u + 1 + 15 + 5 + 1) << "of agent 1: nodes, map, poses; of agent 3: nodes, map";
  real.InsertOptimizedPoses(/*leader=*/1, /*of_agent=*/3, 5, /*run=*/2);
  EXPECT_TRUE(real.SyncAndWait().is_complete());
  EXPECT_TRUE(real.LackingAt(2).empty());
  EXPECT_EQ(real.TakeRecordsTo()[2], 5u);
  real.SyncAndReplicate();
  real.ExpectNothingIsSentTwice();
}

TEST(RealTeamTest, ASyncIsOverOnlyWhenRoversHaveWhatOthersBroughtIn) {
  RealTeam real(/*seed=*/1, proto::CODEC_COMPACT, TeamWithRoversPolicies());
  real.BeginTerm();
  for (std::uint64_t pattern = 0; pattern < 20; ++pattern) real.InsertMap(3, pattern);
  real.team().SetLink(1, kBase, /*is_up=*/false);  // Its order stays open.
  const proto::ShareProgress progress = real.SyncAndWait();
  EXPECT_TRUE(progress.is_over());
  EXPECT_FALSE(progress.is_complete());
  EXPECT_TRUE(real.LackingAt(2).empty());
}

proto::TeamConfig TeamWithFlow(double period_s = 5) {
  proto::TeamConfig config = TeamWithRoversPolicies();
  config.mutable_radio()->set_sync_period_s(period_s);
  return config;
}

TEST(RealTeamTest, RecordsFlowWithoutAnOrder) {
  RealTeam real(/*seed=*/1, proto::CODEC_COMPACT, TeamWithFlow());
  real.Settle();
  real.InsertMission();
  real.Settle();  // Two periods.
  real.ExpectConverged();
  for (const AgentId agent : {2u, 3u}) EXPECT_TRUE(real.LackingAt(agent).empty()) << "agent " << agent;
  std::map<AgentId, std::uint64_t> records_to = real.TakeRecordsTo();
  EXPECT_EQ(records_to[1], 12u) << "each record once";
  EXPECT_EQ(records_to[2], 27u) << "by replication alone";
  EXPECT_EQ(records_to[3], 27u);
}

TEST(RealTeamTest, AnIdleTeamIsAlmostSilentAlthoughRecordsFlow) {
  RealTeam real(/*seed=*/1, proto::CODEC_COMPACT, TeamWithFlow(/*period_s=*/1));
  real.InsertNodes(2, 5);
  real.team().AdvanceTime(minutes(2));
  const std::uint64_t bytes = real.team().radio_bytes();
  real.team().AdvanceTime(minutes(10));
  EXPECT_LT((real.team().radio_bytes() - bytes) / 600.0, 200) << "bytes a second of all agents together";
}

TEST(RealTeamTest, AnAgentThatComesBackGetsTheRecordsThatItMissed) {
  RealTeam real(/*seed=*/1, proto::CODEC_COMPACT, TeamWithFlow());
  real.Settle();
  for (const AgentId agent : {1u, 2u, kBase}) real.team().SetLink(3, agent, /*is_up=*/false);
  real.InsertNodes(2, 5);
  real.InsertNodes(3, 5);
  real.Settle();
  EXPECT_EQ(real.LackingAt(3).size(), 5u);
  for (const AgentId agent : {1u, 2u, kBase}) real.team().SetLink(3, agent, /*is_up=*/true);
  real.team().AdvanceTime(seconds(12));
  EXPECT_TRUE(real.LackingAt(3).empty());
  EXPECT_TRUE(real.LackingAt(2).empty()) << "of agent 3 too";
}

TEST(RealTeamTest, RecordsFlowToTheNewLeader) {
  RealTeam real(/*seed=*/1, proto::CODEC_COMPACT, TeamWithFlow());
  real.InsertNodes(3, 5);
  real.Settle();
  real.Swap(1);
  real.InsertNodes(1, 5);
  real.InsertNodes(3, 5);
  real.team().AdvanceTime(minutes(2));
  real.ExpectConverged();
}

TEST(RealTeamTest, RecordsFlowAlthoughTheLeaderKeepsRestarting) {
  RealTeam real(/*seed=*/1, proto::CODEC_COMPACT, TeamWithFlow(/*period_s=*/2));
  for (int restart = 0; restart < 12; ++restart) {
    real.InsertNodes(3, 5);
    real.team().Crash(1);
    real.team().AdvanceTime(milliseconds(500));
    real.team().Restart(1);
    real.team().AdvanceTime(milliseconds(4500));
  }
  EXPECT_TRUE(real.LackingAt(2).empty()) << "between the restarts";
  real.Settle();
  real.ExpectConverged();
  for (const auto& [agent, count] : real.TakeRecordsTo()) EXPECT_LE(count, 2u * 60 + 60) << "agent " << agent;
}

TEST(RealTeamTest, RecordsFlowInBothPartsWhileTwoAgentsLead) {
  RealTeam real(/*seed=*/1, proto::CODEC_COMPACT, TeamWithFlow());
  real.Settle();
  for (const AgentId agent : {2u, 3u, kBase}) real.team().SetLink(1, agent, /*is_up=*/false);
  real.SetRoles(2, /*leader=*/2, /*survivor=*/3);
  for (const AgentId agent : {1u, 2u, 3u}) real.InsertNodes(agent, 5);
  real.Settle();
  EXPECT_EQ(real.RolesAt(1).leader(), 1u);
  EXPECT_EQ(real.HaveOf(2).Get(real.NodesOf(3)).held.Count(), 5u) << "in the part of the new leader";
  for (const AgentId agent : {2u, 3u, kBase}) real.team().SetLink(1, agent, /*is_up=*/true);
  real.team().AdvanceTime(minutes(2));
  EXPECT_EQ(real.RolesAt(1).leader(), 2u);
  real.ExpectConverged();
  EXPECT_EQ(real.HaveOf(3).Get(real.NodesOf(1)).held.Count(), 5u) << "also of the former leader";
}

TEST(RealTeamTest, ARoverThatJoinsAfterTenHoursGetsAllOfThem) {
  RealTeam real(/*seed=*/1, proto::CODEC_COMPACT, TeamWithFlow(/*period_s=*/60));
  real.Settle();
  real.team().Crash(3);
  for (int hour = 0; hour < 10; ++hour) {
    for (const AgentId agent : {1u, 2u}) {
      real.InsertNodes(agent, 20);
      real.InsertMap(agent, 100 * agent + static_cast<std::uint64_t>(hour));
    }
    real.team().AdvanceTime(std::chrono::hours(1));
  }
  real.team().Restart(3);
  real.team().AdvanceTime(minutes(2));
  EXPECT_TRUE(real.LackingAt(3).empty());
  EXPECT_EQ(real.ReadAll(3).size(), 2u * 10 * 21);
}

int SeedCount() {
  const char* text = std::getenv("MOONDB_SEEDS");
  return text == nullptr ? 6 : std::max(1, std::atoi(text));
}

// A rover and the base station quarantine the same maps.
TEST(RealTeamTest, AQuarantineOfMapsReachesEveryAgentFromAnyOrigin) {
  RealTeam real(/*seed=*/1);
  real.InsertNodes(3, 5);
  real.SyncAndReplicate();
  real.InsertQuarantine(/*at=*/3, /*maps_of=*/1);
  real.InsertQuarantine(/*at=*/kBase, /*maps_of=*/1);
  real.SyncAndReplicate();
  real.TakeHaveBytes();
  // The leader sends the quarantines to the agents that still lack them.
  real.SyncAndReplicate();
  for (AgentId agent = 1; agent <= kAgents; ++agent) EXPECT_EQ(real.QuarantinesAt(agent), 2u) << "agent " << agent;
  for (const auto& [pair, bytes] : real.TakeHaveBytes())
    EXPECT_LT(bytes, 1000u) << "only its streams are reported beside it";
  real.ExpectNothingIsSentTwice();
}

// Each run has random faults: a lossy radio that repeats and reorders, link failures, crashes at any moment, role
// changes and orders. Then the radio becomes reliable, and all agents must converge. MOONDB_SEEDS sets the number of
// runs.
TEST(RealTeamTest, ConvergesAfterRandomFaults) {
  const int seeds = SeedCount();
  std::cout << "seeds 1 to " << seeds << "\n";
  for (int seed = 1; seed <= seeds; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 rng(static_cast<std::uint64_t>(seed));
    RealTeam real(static_cast<std::uint64_t>(seed));
    simulation::SimulatedTeam& team = real.team();
    real.Settle();
    team.radio().loss_ratio = static_cast<double>(rng() % 30) / 100;
    team.radio().duplicate_ratio = static_cast<double>(rng() % 20) / 100;
    team.radio().latency_jitter = milliseconds(rng() % 400);
    team.radio().bytes_per_second = rng() % 2 == 0 ? 0 : 60'000;
    for (int step = 0; step < 40; ++step) {
      const auto agent = static_cast<AgentId>(1 + rng() % kAgents);
      const auto other = static_cast<AgentId>(1 + rng() % kAgents);
      const bool is_running = team.is_running(agent);
      switch (rng() % 9) {
        case 0:
        case 1:
          if (is_running && agent != kBase) real.InsertNodes(agent, 1 + static_cast<int>(rng() % 60));
          break;
        case 2:
          if (is_running && agent != kBase) real.InsertMap(agent, rng());
          if (is_running) real.InsertPower(agent, static_cast<double>(rng() % 100) / 100);
          break;
        case 3:
        case 4:
          if (is_running) Share(team, agent, ShareOrder(proto::SHARING_KIND_SYNC));
          break;
        case 5:
          if (is_running) Share(team, agent, ShareOrder(proto::SHARING_KIND_REPLICATION));
          break;
        case 6:
          is_running ? team.Crash(agent) : team.Restart(agent);
          break;
        case 7:
          if (agent != other) team.SetLink(agent, other, rng() % 3 != 0, rng() % 2 == 0);
          break;
        default:
          if (is_running && rng() % 3 == 0) real.Swap(agent);
          if (is_running && agent != kBase) real.InsertOptimizedPoses(agent, 1 + other % 3, 20, rng() % 1000);
          break;
      }
      team.AdvanceTime(milliseconds(rng() % 3000));
    }
    real.ExpectNothingAcknowledgedIsLost();
    team.radio() = simulation::RadioOptions();
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      if (!team.is_running(agent)) team.Restart(agent);
      for (AgentId other = 1; other < agent; ++other) team.SetLink(agent, other, true);
    }
    team.AdvanceTime(minutes(3));
    real.SyncAndReplicate();
    real.ExpectConverged();
    real.ExpectNothingIsSentTwice();
    if (testing::Test::HasFailure()) return;
  }
}

}  // namespace
}  // namespace moondb
