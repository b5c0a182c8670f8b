#include "tests/actors/team/mission.h"

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "actors/gateway/gateway_actor.h"
#include "actors/merge/merge_actor.h"
#include "actors/pgo/pgo_actor.h"
#include "actors/role/role_actor.h"
#include "actors/storage/storage_actor.h"
#include "model/have_set.h"
#include "model/record_key.h"
#include "tests/actors/pgo/scenario.h"
#include "tests/actors/sharing/sharing_team.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using simulation::Fault;
using simulation::SimulatedTeam;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Records = std::map<RecordKey, std::string>;

constexpr AgentId kAgents = 4;
constexpr AgentId kBase = 4;
constexpr int kNodesOfARover = 6;
constexpr int kTriesMax = 12;
constexpr Duration kClientPatience = seconds(6);
constexpr Duration kDownTime = seconds(3);  // Of an agent that was killed.

// Commits wait for the disk; in memory they do not, and survive a crash of the simulated agent just as well.
std::filesystem::path FolderOfFolders() {
  const std::filesystem::path memory("/dev/shm");
  std::error_code ignored;
  return std::filesystem::is_directory(memory, ignored) ? memory : std::filesystem::temp_directory_path();
}

// An actor in whose handlers its agent's process can end: `after_handler` is called as each returns or throws.
class MortalActor final : public Actor {
 public:
  MortalActor(std::unique_ptr<Actor> actor, std::function<void()> after_handler)
      : actor_(std::move(actor)), after_handler_(std::move(after_handler)) {}

  void OnStart(Context& context) override { actor_->OnStart(context); }
  void OnMessage(Context& context, const proto::Message& message) override {
    try {
      actor_->OnMessage(context, message);
    } catch (...) {
      after_handler_();
      throw;
    }
    after_handler_();
  }

 private:
  const std::unique_ptr<Actor> actor_;
  const std::function<void()> after_handler_;
};

proto::TeamConfig MissionTeam(const simulation::Scenario& scenario) {
  proto::TeamConfig team = TestTeam(3);
  for (proto::AgentConfig& agent : *team.mutable_agents()) {
    const AgentFacts& facts = scenario.agents.at(agent.id());
    for (int i = 0; i < 3; ++i) agent.add_antenna_m(facts.antenna_m[i]);
    if (facts.is_base_station) {
      for (int i = 0; i < 3; ++i) agent.add_position_m(facts.start->position_m[i]);
      continue;
    }
    agent.mutable_start()->set_x(facts.start->position_m.x());
    agent.mutable_start()->set_y(facts.start->position_m.y());
    agent.mutable_start()->set_z(facts.start->position_m.z());
    agent.mutable_start()->set_yaw(facts.start->Yaw());
    agent.mutable_start()->set_sigma_m(0.05);
    agent.mutable_start()->set_sigma_rad(0.01);
  }
  team.mutable_map()->set_resolution_m(0.1);
  team.mutable_map()->add_footprint_m(0.2);
  team.mutable_map()->add_footprint_m(0.2);
  return team;
}

std::string BodyName(const proto::Message& message) {
  const auto* field = proto::Message::descriptor()->FindFieldByNumber(message.body_case());
  return field == nullptr ? "nothing" : field->name();
}

class Mission {
 public:
  Mission(std::uint64_t seed, const Strike& strike)
      : scenario_(simulation::MakeScenario({.seed = seed, .node_count = kNodesOfARover, .range_every = 2})),
        config_(MissionTeam(scenario_)),
        strike_(strike),
        folder_(FolderOfFolders()),
        team_(seed) {
    team_.SetBaseStation(kBase);
    team_.SetFault([this](const Address& actor, const proto::Message& message) { return OnHandle(actor, message); });
    team_.SetFilter([this](AgentId from, AgentId, const proto::Message& message) {
      if (message.has_have()) claimed_[from].Merge(*FromProto(message.have().have()));
      return true;
    });
    for (AgentId agent = 1; agent <= kAgents; ++agent) team_.AddAgent(agent);
    for (AgentId agent = 1; agent <= kAgents; ++agent) SpawnActors(agent);
  }

  MissionReport Run() {
    Advance(seconds(1));
    for (AgentId rover = 1; rover <= 3; ++rover) InsertDrive(rover, 0, kNodesOfARover / 2);
    Insert(kBase, {Power(0.9)});
    Share(proto::SHARING_KIND_SYNC);
    Advance(milliseconds(3));
    InsertDrive(2, kNodesOfARover / 2, kNodesOfARover);  // While the leader collects.
    Advance(seconds(2));
    Share(proto::SHARING_KIND_REPLICATION);
    Advance(milliseconds(3));
    Optimize();
    Advance(seconds(1));
    Merge(Leader());
    SwapRoles();
    InsertDrive(1, kNodesOfARover / 2, kNodesOfARover);
    InsertDrive(3, kNodesOfARover / 2, kNodesOfARover);
    Share(proto::SHARING_KIND_SYNC);
    Advance(seconds(2));
    Optimize();
    Share(proto::SHARING_KIND_REPLICATION);
    Advance(seconds(1));
    is_quiet_ = true;
    if (strike_.message > report_.message_count) Complain("no such message came");
    Settle();
    CheckAll();
    return std::move(report_);
  }

 private:
  // --- The team ---

  template <typename ActorType, typename Options>
  void Spawn(AgentId agent, const char* name, Options options) {
    options.self = agent;
    options.team = config_;
    team_.Spawn(agent, name, [this, agent, options = std::move(options)] {
      return std::make_unique<MortalActor>(std::make_unique<ActorType>(options), [this, agent] {
        if (is_killing_ && agent == killed_) Kill();
      });
    });
  }

  void SpawnActors(AgentId agent) {
    StorageActor::Options storage;
    storage.path = folder_.File("agent" + std::to_string(agent) + ".db");
    Spawn<StorageActor>(agent, actor_name::kStorage, storage);
    RoleActor::Options role;
    role.storage_timeout = seconds(1);
    Spawn<RoleActor>(agent, actor_name::kRole, role);
    SharingActor::Options sharing;
    sharing.config_hash = 1;
    sharing.session.resend_after = seconds(1);
    sharing.session.resend_after_max = seconds(4);
    Spawn<SyncActor>(agent, actor_name::kSync, sharing);
    Spawn<ReplicaActor>(agent, actor_name::kReplica, sharing);
    PgoActor::Options pgo;
    pgo.solver.thread_count = 1;
    pgo.storage_timeout = seconds(2);
    pgo.read_records_max = 20;
    pgo.insert_records_max = 8;
    Spawn<PgoActor>(agent, actor_name::kPgo, pgo);
    MergeActor::Options merge;
    merge.backend = MergeBackend::kCpu;
    merge.storage_timeout = seconds(2);
    merge.page_records_max = 16;
    Spawn<MergeActor>(agent, actor_name::kMerge, merge);
    GatewayActor::Options gateway;
    gateway.timeout = seconds(4);
    gateway.long_timeout = seconds(5);
    Spawn<GatewayActor>(agent, actor_name::kGateway, gateway);
  }

  Fault OnHandle(const Address& actor, const proto::Message& message) {
    if (is_quiet_) return Fault::kNone;
    ++report_.message_count;
    ++report_.by_actor[actor.actor];
    if (report_.message_count != strike_.message) return Fault::kNone;
    report_.struck = ToString(actor) + " at " + BodyName(message) + ", " +
                     std::to_string(std::chrono::duration<double>(team_.now().time_since_epoch()).count() - 1000) +
                     " s";
    if (strike_.kills_agent) {
      killed_ = actor.agent;
      is_killing_ = true;
      if (strike_.fault == Fault::kBeforeHandler) Kill();
    }
    return strike_.fault;
  }

  void Kill() {
    is_killing_ = false;
    team_.Crash(killed_);
    restart_at_ = team_.now() + kDownTime;
  }

  // Half of the times the others notice, as the transport tells them; else their own timers have to do.
  void Restart() {
    team_.Restart(killed_);
    for (AgentId other = 1; other <= kAgents && strike_.message % 2 == 0; ++other) {
      if (other == killed_) continue;
      team_.SetLink(killed_, other, false);
      team_.SetLink(killed_, other, true);
    }
  }

  // --- Time ---

  // Until `condition`; false if `limit` passes first. Starts a killed agent again when its time has come.
  bool RunUntil(const std::function<bool()>& condition, Duration limit) {
    const MonotonicTime end = team_.now() + limit;
    while (true) {
      const MonotonicTime stop = std::min(end, restart_at_.value_or(end));
      const auto is_restart_nearer = [&] { return restart_at_ && *restart_at_ < stop; };
      (void)team_.RunUntil([&] { return condition() || is_restart_nearer(); }, stop - team_.now());
      if (condition()) return true;
      if (is_restart_nearer()) continue;
      if (team_.now() < stop) team_.AdvanceTime(stop - team_.now());
      if (restart_at_ && team_.now() >= *restart_at_) {
        restart_at_.reset();
        Restart();
      } else if (team_.now() >= end) {
        return condition();
      }
    }
  }

  void Advance(Duration duration) {
    (void)RunUntil([] { return false; }, duration);
  }

  // --- Robots and the operator ---

  // One call of a client; nothing if no answer comes in time.
  std::optional<proto::ControlReply> Call(AgentId agent, const proto::ControlRequest& request) {
    // A connection of its own each, as an answer that comes too late reaches nobody.
    const Address client{kClients, std::to_string(++call_count_)};
    proto::Message message;
    *message.mutable_control_request() = request;
    if (team_.Post(client, {agent, actor_name::kGateway}, std::move(message)) != SendResult::kAccepted) {
      return std::nullopt;
    }
    std::vector<proto::Message> answers;
    const auto is_answered = [&] { return !(answers = team_.Take(client)).empty(); };
    if (!RunUntil([&] { return !answers.empty() || is_answered(); }, kClientPatience)) return std::nullopt;
    return answers.front().control_reply();
  }

  // Calls until the answer is no error.
  std::optional<proto::ControlReply> Ask(AgentId agent, const proto::ControlRequest& request) {
    std::string last = "no answer";
    for (int i = 0; i < kTriesMax; ++i) {
      const auto reply = Call(agent, request);
      if (reply && !IsError(reply->error())) return reply;
      if (reply) last = reply->error().text();
      Advance(seconds(1));
    }
    Complain("agent " + std::to_string(agent) + " does not help with " + request.ShortDebugString().substr(0, 80) +
             ": " + last);
    return std::nullopt;
  }

  void Insert(AgentId agent, const std::vector<proto::Record>& records) {
    proto::ControlRequest request;
    for (const proto::Record& record : records) *request.mutable_insert()->add_records() = record;
    const auto reply = Ask(agent, request);
    if (!reply) return;
    if (reply->insert().keys_size() != static_cast<int>(records.size())) return Complain("an insert without keys");
    for (std::size_t i = 0; i < records.size(); ++i) {
      acknowledged_[FromProto(reply->insert().keys(static_cast<int>(i)))] = records[i].SerializeAsString();
    }
  }

  static proto::Record Power(double ratio) {
    proto::Record record;
    record.set_stamp_ns(1);
    record.mutable_power()->set_battery_ratio(ratio);
    return record;
  }

  static proto::Record MapAt(NodeKey node) {
    proto::Record record;
    record.set_stamp_ns(1);
    proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
    *map.mutable_node() = ToProto(node);
    map.mutable_node_from_map()->mutable_position_m();
    map.mutable_node_from_map()->mutable_orientation()->set_w(1);
    proto::MapLayer& layer = *map.add_layers();
    layer.set_width_cells(4);
    layer.set_height_cells(4);
    layer.set_resolution_um(100'000);
    layer.set_cells(std::string("\x55\x59\x65", 3) + static_cast<char>(node.index % 3));
    return record;
  }

  // What a rover's robot inserts while it drives from its first-th node to before its end-th.
  void InsertDrive(AgentId rover, std::uint64_t first, std::uint64_t end) {
    std::vector<proto::Record> graph;
    std::vector<proto::Record> maps;
    const auto is_due = [&](NodeKey node) { return node.agent == rover && node.index >= first && node.index < end; };
    for (const GraphNode& node : scenario_.graph.nodes) {
      if (!is_due(node.key)) continue;
      graph.push_back(ToRecord(node));
      if (node.key.index % 2 == 0) maps.push_back(MapAt(node.key));
    }
    for (const OdometryEdge& edge : scenario_.graph.odometry) {
      if (is_due(edge.to)) graph.push_back(ToRecord(edge));
    }
    for (const RangeEdge& edge : scenario_.graph.ranges) {
      if (is_due(edge.from)) graph.push_back(ToRecord(edge));
    }
    Insert(rover, {Power(0.5 + static_cast<double>(first) / 100)});
    Insert(rover, graph);
    Insert(rover, maps);
  }

  proto::RoleAssignment RolesAt(AgentId agent) {
    proto::ControlRequest request;
    request.mutable_role_show();
    const auto reply = Ask(agent, request);
    return reply ? reply->roles().roles() : proto::RoleAssignment();
  }

  AgentId Leader() { return RolesAt(1).leader(); }

  void Share(proto::SharingKind kind) {
    proto::ControlRequest request;
    request.mutable_share()->set_kind(kind);
    (void)Ask(Leader(), request);
  }

  std::optional<proto::OptimizeReply> OptimizeOnce() {
    proto::ControlRequest request;
    request.mutable_optimize();
    const auto reply = Ask(Leader(), request);
    return reply ? std::optional(reply->optimize()) : std::nullopt;
  }

  // What was published is stored: solving the same again moves nothing.
  void Optimize() {
    const auto first = OptimizeOnce();
    const auto second = OptimizeOnce();
    if (!first || !second) return;
    if (first->node_count() == 0) Complain("a pose graph of no nodes was solved");
    const auto size = [](const proto::OptimizeReply& reply) {
      return std::tuple(reply.node_count(), reply.odometry_count(), reply.range_count());
    };
    if (size(*first) == size(*second) && second->updated_pose_count() > 0) {
      Complain("optimized poses are not stored that were said to be");
    }
  }

  // The merged map shows at least what robots of `agent` were told is stored.
  proto::MergeReply Merge(AgentId agent) {
    std::set<NodeKey> nodes;
    for (const auto& [key, content] : acknowledged_) {
      proto::Record record;
      if (key.stream.origin != agent || !record.ParseFromString(content)) continue;
      if (record.has_local_traversability_map()) nodes.insert(FromProto(record.local_traversability_map().node()));
    }
    proto::ControlRequest request;
    request.mutable_merge();
    auto reply = Ask(agent, request);
    if (!reply) return {};
    if (reply->merge().map_count() < static_cast<double>(nodes.size())) Complain("a merged map without stored maps");
    return std::move(*reply->mutable_merge());
  }

  // The operator looks whether it is done before asking again: a second swap would undo the first.
  void SwapRoles() {
    proto::ControlRequest request;
    request.mutable_role_set()->set_is_swap(true);
    for (int i = 0; i < kTriesMax && Leader() != 2; ++i) {
      (void)Call(1, request);
      Advance(milliseconds(100));
    }
  }

  // --- What must hold ---

  void Settle() {
    Advance(seconds(20));
    for (int i = 0; i < 2; ++i) {
      for (const auto kind : {proto::SHARING_KIND_SYNC, proto::SHARING_KIND_REPLICATION}) {
        Share(kind);
        Advance(seconds(10));
      }
    }
  }

  void Complain(std::string text) { report_.faults.push_back(std::move(text)); }

  proto::Message AskStorage(AgentId agent, proto::Message question) {
    const Address asker{agent, "checker"};
    (void)team_.Post(asker, {agent, actor_name::kStorage}, std::move(question));
    team_.RunUntilIdle();
    std::vector<proto::Message> answers = team_.Take(asker);
    return answers.empty() ? proto::Message() : std::move(answers.back());
  }

  Records ReadAll(AgentId agent) {
    Records records;
    for (std::uint64_t after = 0;;) {
      proto::Message question;
      question.mutable_read_request()->set_after_row_id(after);
      const proto::Message answer = AskStorage(agent, std::move(question));
      const proto::ReadReply& reply = answer.read_reply();
      for (const proto::StoredRecord& record : reply.records()) {
        records[FromProto(record.key())] = record.content();
      }
      if (reply.is_complete() || reply.row_ids().empty()) return records;
      after = *reply.row_ids().rbegin();
    }
  }

  HaveSet HaveOf(AgentId agent) {
    proto::Message question;
    question.mutable_have_request();
    return *FromProto(AskStorage(agent, std::move(question)).have_reply().have());
  }

  void CheckAll() {
    const proto::RoleAssignment roles = RolesAt(1);
    for (AgentId agent = 2; agent <= kAgents; ++agent) {
      if (RolesAt(agent).SerializeAsString() != roles.SerializeAsString()) {
        Complain("agent " + std::to_string(agent) + " has other roles than agent 1");
      }
    }
    if (roles.leader() != 2 || roles.survivor() != 1) Complain("the swap of roles is undone");

    std::map<AgentId, Records> records;
    std::map<AgentId, HaveSet> have;
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      records[agent] = ReadAll(agent);
      have[agent] = HaveOf(agent);
    }
    CheckContents(records);
    for (const AgentId agent : {roles.leader(), roles.survivor()}) CheckAcknowledged(agent, records, have);
    for (AgentId origin = 1; origin <= kAgents; ++origin) CheckOrigin(origin, records, have);
    if (records[roles.leader()] != records[roles.survivor()] || !(have[roles.leader()] == have[roles.survivor()])) {
      Complain("the survivor has not what the leader has");
    }
    for (const auto& [key, content] : records[roles.leader()]) {
      if (GroundPolicyOf(config_, key.stream.type) != proto::POLICY_NONE && !records[kBase].contains(key)) {
        Complain("the base station lacks " + ToString(key));
      }
    }
    CheckQuiet();
    CheckServices(roles);
  }

  void CheckContents(const std::map<AgentId, Records>& records) {
    std::map<RecordKey, std::string> all = acknowledged_;
    for (const auto& [agent, held] : records) {
      for (const auto& [key, content] : held) {
        if (all.emplace(key, content).first->second != content) {
          Complain("agent " + std::to_string(agent) + " has another " + ToString(key));
        }
      }
    }
  }

  // `agent` has, or had until a newer one replaced it, all that robots were told is stored.
  void CheckAcknowledged(AgentId agent, const std::map<AgentId, Records>& records,
                         const std::map<AgentId, HaveSet>& have) {
    for (const auto& [key, content] : acknowledged_) CheckHas(agent, key, records, have);
  }

  void CheckHas(AgentId agent, const RecordKey& key, const std::map<AgentId, Records>& records,
                const std::map<AgentId, HaveSet>& have) {
    const bool is_replaceable = SharePolicyOf(config_, key.stream.type) == proto::POLICY_LATEST;
    const bool is_there =
        is_replaceable ? have.at(agent).Get(key.stream).Had().Contains(key.seq) : records.at(agent).contains(key);
    if (!is_there) Complain("agent " + std::to_string(agent) + " lost or never got " + ToString(key));
  }

  void CheckOrigin(AgentId origin, const std::map<AgentId, Records>& records, const std::map<AgentId, HaveSet>& have) {
    for (const auto& [key, content] : acknowledged_) {
      if (key.stream.origin == origin) CheckHas(origin, key, records, have);
    }
    for (const auto& [key, content] : records.at(origin)) {
      if (key.stream.origin == origin) CheckHas(2, key, records, have);  // Not only what was acknowledged.
    }
    for (const auto& [key, stream] : claimed_[origin].streams()) {
      if (!stream.Had().Minus(have.at(origin).Get(key).Had()).is_empty()) {
        Complain("agent " + std::to_string(origin) + " lacks what it acknowledged to a peer");
      }
    }
  }

  // Nothing stays open or goes on for ever, and no crash made a peer send what is wrong.
  void CheckQuiet() {
    const std::uint64_t bytes = team_.radio_bytes();
    Advance(seconds(120));
    if (team_.radio_bytes() != bytes) Complain("bytes go on for ever");
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      proto::ControlRequest request;
      request.mutable_share_status();
      const auto reply = Ask(agent, request);
      if (!reply) continue;
      const proto::ShareStatus& status = reply->share_status();
      for (const proto::ShareSession& session : status.sessions()) {
        if (session.is_open() || session.remaining() != 0) Complain("an open session: " + session.ShortDebugString());
      }
      if (status.rejected_records() + status.damaged_messages() > 0) Complain("refused: " + status.ShortDebugString());
    }
  }

  // All that is held at the leader and at the survivor makes one map.
  void CheckServices(const proto::RoleAssignment& roles) {
    Optimize();
    for (const auto kind : {proto::SHARING_KIND_SYNC, proto::SHARING_KIND_REPLICATION}) {
      Share(kind);
      Advance(seconds(10));
    }
    const proto::MergeReply at_leader = Merge(roles.leader());
    const proto::MergeReply at_survivor = Merge(roles.survivor());
    if (at_leader.map_count() < 9 || at_leader.waiting_map_count() > 0) Complain("maps are missing in the merged map");
    if (at_leader.zstd_cells() != at_survivor.zstd_cells()) Complain("leader and survivor merge differently");
  }

  const simulation::Scenario scenario_;
  const proto::TeamConfig config_;
  const Strike strike_;
  const TemporaryFolder folder_;
  MissionReport report_;
  bool is_quiet_ = false;
  AgentId killed_ = 0;
  bool is_killing_ = false;  // As soon as the handler that runs is left.
  std::optional<MonotonicTime> restart_at_;
  std::uint64_t call_count_ = 0;
  Records acknowledged_;                // To robots.
  std::map<AgentId, HaveSet> claimed_;  // By all have-sets that each agent ever sent.
  SimulatedTeam team_;
};

}  // namespace

MissionReport RunMission(std::uint64_t seed, const Strike& strike) { return Mission(seed, strike).Run(); }

std::string ToString(const Strike& strike) {
  static const std::map<Fault, std::string> kNames = {{Fault::kNone, "nothing"},
                                                      {Fault::kBeforeHandler, "before the handler"},
                                                      {Fault::kAtFirstSend, "at its first send"},
                                                      {Fault::kAfterFirstSend, "after its first send"},
                                                      {Fault::kAfterHandler, "after the handler"}};
  return std::string(strike.kills_agent ? "agent killed " : "actor fails ") + kNames.at(strike.fault) + " of message " +
         std::to_string(strike.message);
}

}  // namespace moondb
