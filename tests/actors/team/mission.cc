#include "tests/actors/team/mission.h"

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <tuple>
#include <utility>

#include "apps/moondb_agent/standard_actors.h"
#include "model/control_message.h"
#include "model/have_set.h"
#include "model/record_key.h"
#include "model/term.h"
#include "proto/control.pb.h"
#include "proto/types.pb.h"
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
constexpr std::int64_t kTimestamp_ns = 1'767'225'600'000'000'000;  // 2026-01-01; earlier ones are not trusted.
// Maximum number of tries of a request. A restarted agent may be killed again, so several tries may fail.
constexpr int kTriesMax = 30;
constexpr Duration kClientPatience = seconds(6);
constexpr Duration kDownTime = seconds(3);  // Time until a killed agent restarts.

// Returns the parent of the mission's temporary folder: /dev/shm, or the system's temporary folder if there is no
// /dev/shm. Files in memory are fast, and survive a crash of the simulated agent.
std::filesystem::path FolderOfFolders() {
  const std::filesystem::path memory("/dev/shm");
  std::error_code ignored;
  return std::filesystem::is_directory(memory, ignored) ? memory : std::filesystem::temp_directory_path();
}

// Takes the place of EventActor and reports no findings. A real EventActor would store records at times that differ
// between the agents, and the test compares the agents' records.
class NoFindings final : public Actor {
 public:
  void OnMessage(Context& context, const proto::Message& message) override {
    if (message.body_case() != proto::Message::kControlRequest) return;
    proto::ControlReply reply;
    reply.mutable_status();
    (void)context.Reply(MessageOf(reply));
  }
};

// Wraps an actor. Calls `after_handler` when a handler returns or throws. `after_handler` may then end the agent's
// process.
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
  Mission(std::uint64_t seed, const std::vector<Strike>& strikes)
      : scenario_(simulation::MakeScenario({.seed = seed, .node_count = kNodesOfARover, .range_every = 2})),
        config_(MissionTeam(scenario_)),
        strikes_(strikes),
        folder_(FolderOfFolders()),
        team_(seed) {
    team_.SetBaseStation(kBase);
    team_.SetFault([this](const Address& actor, const proto::Message& message) { return OnHandle(actor, message); });
    team_.SetFilter([this](AgentId from, AgentId, const proto::Message& message) {
      if (message.has_have()) claimed_[from].Merge(*FromProto(message.have().have()));
      batches_[from] += message.has_batch() ? 1 : 0;
      answers_[from] += message.has_have() ? 1 : 0;
      return true;
    });
    for (AgentId agent = 1; agent <= kAgents; ++agent) team_.AddAgent(agent);
    for (AgentId agent = 1; agent <= kAgents; ++agent) SpawnActors(agent);
  }

  MissionReport RunLosses(int batches) {
    Advance(seconds(1));
    for (AgentId rover = 1; rover <= 3; ++rover) InsertDrive(rover, 0, kNodesOfARover);
    Share(proto::SHARING_KIND_SYNC);
    (void)RunUntil([&] { return batches_[3] >= batches; }, seconds(10));
    for (AgentId other = 1; other <= kAgents; ++other) {
      if (other != 3) team_.SetLink(3, other, false);
    }
    Advance(seconds(2));
    answers_[2] = 0;
    Share(proto::SHARING_KIND_REPLICATION);
    (void)RunUntil([&] { return answers_[2] >= batches; }, seconds(10));
    team_.Crash(1);
    for (AgentId other = 2; other <= kAgents; ++other) team_.SetLink(1, other, false);
    is_quiet_ = true;
    Advance(seconds(5));
    TakeTheLead(2);
    CheckKept(2);
    return std::move(report_);
  }

  MissionReport Run() {
    Advance(seconds(1));
    for (AgentId rover = 1; rover <= 3; ++rover) InsertDrive(rover, 0, kNodesOfARover / 2);
    Insert(kBase, {{Power(0.9)}, {Power(0.8)}});
    Share(proto::SHARING_KIND_SYNC);
    Advance(milliseconds(3));
    InsertDrive(2, kNodesOfARover / 2, kNodesOfARover);  // Rover 2 inserts records while the leader collects.
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
    Settle();
    CheckAll();
    return std::move(report_);
  }

 private:
  // --- The team ---

  void SpawnActors(AgentId agent) {
    StandardActorOptions options;
    options.storage.path = folder_.File("agent" + std::to_string(agent) + ".db");
    options.role.storage_timeout = seconds(1);
    options.sharing.session.resend_after = seconds(1);
    options.sharing.session.resend_after_max = seconds(4);
    options.sharing.session.batch_bytes_max = 256;  // A small limit gives many batches.
    options.sharing.session.unacked_bytes_max = 512;
    options.pgo.solver.thread_count = 1;
    options.pgo.storage_timeout = seconds(2);
    options.pgo.read_records_max = 20;
    options.pgo.insert_records_max = 8;
    options.merge.backend = MergeBackend::kCpu;
    options.merge.storage_timeout = seconds(2);
    options.merge.page_records_max = 16;
    options.gateway.timeout = seconds(4);
    options.gateway.long_timeout = seconds(5);
    for (const StandardActor& actor : StandardActors(config_, agent, /*config_hash=*/1, std::move(options))) {
      if (actor.name == actor_name::kEvent) {
        team_.Spawn(agent, actor.name, [] { return std::make_unique<NoFindings>(); });
        continue;
      }
      team_.Spawn(agent, actor.name, [this, agent, factory = actor.factory] {
        return std::make_unique<MortalActor>(factory(), [this, agent] {
          if (agent == dying_) Kill(agent);
        });
      });
    }
  }

  Fault OnHandle(const Address& actor, const proto::Message& message) {
    if (is_quiet_) return Fault::kNone;
    report_.handled.push_back(actor.actor + " " + BodyName(message));
    const auto strike = std::find_if(strikes_.begin(), strikes_.end(), [this](const Strike& candidate) {
      return candidate.message == report_.handled.size();
    });
    if (strike == strikes_.end()) return Fault::kNone;
    const double time_s = std::chrono::duration<double>(team_.now() - start_).count();
    report_.struck.push_back(ToString(actor) + " at " + BodyName(message) + ", " + std::to_string(time_s) + " s");
    if (strike->kills_agent) {
      dying_ = actor.agent;
      if (strike->fault == Fault::kBeforeHandler) Kill(actor.agent);
    }
    return strike->fault;
  }

  void Kill(AgentId agent) {
    dying_ = 0;
    team_.Crash(agent);
    restart_at_[agent] = team_.now() + kDownTime;
  }

  // If the number of handled messages is even, notifies the other agents of the restart, as the transport would do.
  // Otherwise the other agents must rely on their timers.
  void Restart(AgentId agent) {
    restart_at_.erase(agent);
    team_.Restart(agent);
    for (AgentId other = 1; other <= kAgents && report_.handled.size() % 2 == 0; ++other) {
      if (other == agent) continue;
      team_.SetLink(agent, other, false);
      team_.SetLink(agent, other, true);
    }
  }

  // --- Time ---

  // Runs until `condition` returns true. Returns false if `limit` passes first. Restarts killed agents when they are
  // due.
  bool RunUntil(const std::function<bool()>& condition, Duration limit) {
    const MonotonicTime end = team_.now() + limit;
    while (true) {
      const std::size_t down_count = restart_at_.size();
      MonotonicTime stop = end;
      for (const auto& [agent, time] : restart_at_) stop = std::min(stop, time);
      (void)team_.RunUntil([&] { return condition() || restart_at_.size() > down_count; }, stop - team_.now());
      if (condition()) return true;
      if (restart_at_.size() > down_count) continue;
      if (team_.now() < stop) team_.AdvanceTime(stop - team_.now());
      const auto due = std::find_if(restart_at_.begin(), restart_at_.end(),
                                    [this](const auto& entry) { return entry.second <= team_.now(); });
      if (due != restart_at_.end()) {
        Restart(due->first);
      } else if (team_.now() >= end) {
        return condition();
      }
    }
  }

  void Advance(Duration duration) {
    (void)RunUntil([] { return false; }, duration);
  }

  // --- Robots and the operator ---

  proto::ControlReply ReplyIn(const proto::Message& message) {
    const auto reply = ControlReplyOf(message);
    if (!reply) Complain("an answer that does not decode: " + ToString(reply.error()));
    return reply ? *reply : proto::ControlReply();
  }

  // Sends all requests at once, each from a client of its own. Returns the answer to each request, or nullopt if no
  // answer arrived within kClientPatience.
  std::vector<std::optional<proto::ControlReply>> Call(AgentId agent,
                                                       const std::vector<proto::ControlRequest>& requests) {
    std::vector<std::optional<proto::ControlReply>> replies(requests.size());
    std::map<std::size_t, Address> waiting;
    for (std::size_t i = 0; i < requests.size(); ++i) {
      // Each request has its own connection, because a late answer must not reach another request.
      const Address client{kClients, std::to_string(++call_count_)};
      proto::Message message = MessageOf(requests[i]);
      message.set_client_rights(proto::CLIENT_RIGHTS_COMMAND);
      const SendResult sent = team_.Post(client, {agent, actor_name::kGateway}, std::move(message));
      if (sent == SendResult::kAccepted) waiting[i] = client;
    }
    const auto take = [&] {
      std::erase_if(waiting, [&](const auto& entry) {
        const std::vector<proto::Message> answers = team_.TakeMessages(entry.second);
        if (answers.size() > 1) Complain("more than one answer to " + requests[entry.first].ShortDebugString());
        if (!answers.empty()) replies[entry.first] = ReplyIn(answers.front());
        return !answers.empty();
      });
      return waiting.empty();
    };
    (void)RunUntil(take, kClientPatience);
    return replies;
  }

  // Sends the requests, and repeats each request until it succeeds, at most kTriesMax times. Complains and returns
  // nullopt for a request that never succeeded.
  std::vector<std::optional<proto::ControlReply>> RequestAll(AgentId agent,
                                                             const std::vector<proto::ControlRequest>& requests) {
    std::vector<std::optional<proto::ControlReply>> replies(requests.size());
    for (int i = 0; i < kTriesMax; ++i) {
      std::vector<proto::ControlRequest> open;
      std::vector<std::size_t> places;
      for (std::size_t j = 0; j < requests.size(); ++j) {
        if (replies[j] && !IsError(replies[j]->error())) continue;
        open.push_back(requests[j]);
        places.push_back(j);
      }
      if (open.empty()) return replies;
      if (i > 0) Advance(seconds(1));
      std::vector<std::optional<proto::ControlReply>> more = Call(agent, open);
      for (std::size_t j = 0; j < open.size(); ++j) replies[places[j]] = std::move(more[j]);
    }
    for (std::size_t j = 0; j < requests.size(); ++j) {
      if (replies[j] && !IsError(replies[j]->error())) continue;
      Complain("agent " + std::to_string(agent) + " does not help with " +
               requests[j].ShortDebugString().substr(0, 80) + ": " +
               (replies[j] ? replies[j]->error().text() : "no answer"));
      replies[j].reset();
    }
    return replies;
  }

  std::optional<proto::ControlReply> Ask(AgentId agent, const proto::ControlRequest& request) {
    return RequestAll(agent, {request}).front();
  }

  // Inserts all batches at once, each from a client of its own, while another client requests the status.
  void Insert(AgentId agent, const std::vector<std::vector<proto::Record>>& batches) {
    std::vector<proto::ControlRequest> requests;
    for (const std::vector<proto::Record>& batch : batches) {
      requests.emplace_back();
      for (const proto::Record& record : batch) *requests.back().mutable_insert()->add_records() = record;
    }
    requests.emplace_back().mutable_status();
    const auto replies = RequestAll(agent, requests);
    for (std::size_t i = 0; i < batches.size(); ++i) {
      if (replies[i]) ObserveInserted(agent, batches[i], replies[i]->insert());
    }
  }

  void ObserveInserted(AgentId agent, const std::vector<proto::Record>& records, const proto::InsertReply& reply) {
    if (reply.keys_size() != static_cast<int>(records.size())) return Complain("an insert without keys");
    for (std::size_t i = 0; i < records.size(); ++i) {
      const RecordKey key = FromProto(reply.keys(static_cast<int>(i)));
      if (key.stream.origin != agent) Complain("a record of " + ToString(key) + " inserted at another agent");
      proto::Record stored = records[i];
      stored.set_is_state(SharePolicyOf(config_, key.stream.type) == proto::POLICY_LATEST);
      if (!acknowledged_.emplace(key, stored.SerializeAsString()).second) Complain("two have " + ToString(key));
    }
  }

  static proto::Record Power(double ratio) {
    proto::Record record;
    record.set_timestamp_ns(kTimestamp_ns);
    record.mutable_power()->set_battery_ratio(ratio);
    return record;
  }

  static proto::Record MapAt(NodeKey node) {
    proto::Record record;
    record.set_timestamp_ns(kTimestamp_ns);
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

  // Inserts the records of a drive of `rover` from node `first` to the node before `end`.
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
    for (proto::Record& record : graph) record.set_timestamp_ns(record.timestamp_ns() + kTimestamp_ns);
    Insert(rover, {{Power(0.5 + static_cast<double>(first) / 100)}, graph, maps});
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

  // Solves the pose graph. Complains if storage then contains fewer poses of the newest run than the reply reports.
  void Optimize() {
    const AgentId leader = Leader();
    proto::ControlRequest request;
    request.mutable_optimize();
    const auto reply = Ask(leader, request);
    if (!reply) return;
    if (reply->optimize().node_count() == 0) Complain("a pose graph of no nodes was solved");
    request.mutable_read()->add_data_types(proto::OPTIMIZED_POSE);
    const auto poses = Ask(leader, request);
    if (!poses) return;
    std::map<std::tuple<decltype(OrderOf(proto::Term())), std::uint64_t>, double> counts;
    for (const proto::StoredRecord& stored : poses->read().records()) {
      proto::Record record;
      if (!record.ParseFromString(stored.content())) continue;
      ++counts[{OrderOf(record.optimized_pose().term()), record.optimized_pose().run()}];
    }
    const double newest_count = counts.empty() ? 0 : counts.rbegin()->second;
    if (reply->optimize().updated_pose_count() > newest_count) Complain("optimized poses are not stored");
  }

  // Merges at `agent`. Complains if the merged map has fewer maps than were inserted at `agent` and acknowledged.
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

  // The operator checks who leads before each try, because a second swap would undo the first.
  void SwapRoles() {
    proto::ControlRequest request;
    request.mutable_role_set()->set_is_swap(true);
    for (int i = 0; i < kTriesMax && Leader() != 2; ++i) {
      (void)Call(1, {request});
      Advance(milliseconds(100));
    }
  }

  void TakeTheLead(AgentId agent) {
    proto::ControlRequest request;
    request.mutable_role_set()->set_leader(agent);
    request.mutable_role_set()->set_survivor(1);  // Agent 1 is lost, but may return.
    (void)Ask(agent, request);
    Advance(seconds(5));
    if (RolesAt(agent).leader() != agent) Complain("the survivor does not lead");
  }

  // --- Invariants ---

  // Checks that `agent` still has, solves and merges all records that it ever claimed to hold.
  void CheckKept(AgentId agent) {
    const HaveSet have = HaveOf(agent);
    for (const auto& [stream, claimed] : claimed_[agent].streams()) {
      if (!claimed.Covered().Minus(have.Get(stream).Covered()).is_empty())
        Complain("the survivor lacks what it acknowledged");
    }
    double nodes = 0;
    double maps = 0;
    for (const auto& [key, content] : ReadAll(agent)) {
      nodes += key.stream.type == proto::POSE_GRAPH_NODE ? 1 : 0;
      maps += key.stream.type == proto::LOCAL_TRAVERSABILITY_MAP ? 1 : 0;
      report_.kept_count +=
          key.stream.origin != agent && claimed_[agent].Get(key.stream).held.Contains(key.seq) ? 1 : 0;
    }
    proto::ControlRequest request;
    request.mutable_optimize();
    const auto solved = Ask(agent, request);
    if (!solved || solved->optimize().node_count() != nodes + 1) {  // The base station is one more node.
      Complain("of " + std::to_string(nodes) + " nodes are solved: " + (solved ? solved->ShortDebugString() : "none"));
    }
    request.mutable_merge();
    const auto merged = Ask(agent, request);
    if (!merged || merged->merge().map_count() + merged->merge().waiting_map_count() != maps) {
      Complain("of " + std::to_string(maps) +
               " maps are merged: " + (merged ? std::to_string(merged->merge().map_count()) : "none"));
    }
  }

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

  proto::Message RequestStorage(AgentId agent, proto::Message question) {
    const Address requester{agent, "checker"};
    (void)team_.Post(requester, {agent, actor_name::kStorage}, std::move(question));
    team_.RunUntilIdle();
    std::vector<proto::Message> answers = team_.TakeMessages(requester);
    return answers.empty() ? proto::Message() : std::move(answers.back());
  }

  Records ReadAll(AgentId agent) {
    Records records;
    for (std::uint64_t after = 0;;) {
      proto::Message question;
      question.mutable_read_request()->set_after_row_id(after);
      const proto::Message answer = RequestStorage(agent, std::move(question));
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
    return *FromProto(RequestStorage(agent, std::move(question)).have_reply().have());
  }

  void CheckAll() {
    const proto::RoleAssignment roles = RolesAt(1);
    for (AgentId agent = 2; agent <= kAgents; ++agent) {
      if (RolesAt(agent).SerializeAsString() != roles.SerializeAsString()) {
        Complain("agent " + std::to_string(agent) + " has other roles than agent 1");
      }
    }
    for (AgentId agent = 1; agent <= kAgents; ++agent) CheckStoredRoles(agent, roles);
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
    CheckPowerCut(records);
    CheckQuiet();
    CheckServices(RolesAt(1));
  }

  void CheckStoredRoles(AgentId agent, const proto::RoleAssignment& roles) {
    proto::Message question;
    question.mutable_load_roles_request();
    const proto::Message answer = RequestStorage(agent, std::move(question));
    const auto& history = answer.load_roles_reply().history();
    if (history.empty() || history.rbegin()->SerializeAsString() != roles.SerializeAsString()) {
      Complain("agent " + std::to_string(agent) + " acts on roles that it has not stored");
    }
  }

  // Cuts the power of all agents and restarts them. Complains unless each agent then has exactly its `records`.
  void CheckPowerCut(const std::map<AgentId, Records>& records) {
    for (AgentId agent = 1; agent <= kAgents; ++agent) team_.Crash(agent);
    for (AgentId agent = 1; agent <= kAgents; ++agent) team_.Restart(agent);
    Advance(seconds(20));
    for (AgentId agent = 1; agent <= kAgents; ++agent) {
      if (ReadAll(agent) != records.at(agent)) Complain("agent " + std::to_string(agent) + " holds other records");
    }
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

  // Checks that `agent` has all records whose insert was acknowledged to a robot. For a type with policy `latest`, it
  // is enough that the agent's have-set covers the record.
  void CheckAcknowledged(AgentId agent, const std::map<AgentId, Records>& records,
                         const std::map<AgentId, HaveSet>& have) {
    for (const auto& [key, content] : acknowledged_) CheckHas(agent, key, records, have);
  }

  void CheckHas(AgentId agent, const RecordKey& key, const std::map<AgentId, Records>& records,
                const std::map<AgentId, HaveSet>& have) {
    const bool is_replaceable = SharePolicyOf(config_, key.stream.type) == proto::POLICY_LATEST;
    const bool is_there =
        is_replaceable ? have.at(agent).Get(key.stream).Covered().Contains(key.seq) : records.at(agent).contains(key);
    if (!is_there) Complain("agent " + std::to_string(agent) + " lost or never got " + ToString(key));
  }

  void CheckOrigin(AgentId origin, const std::map<AgentId, Records>& records, const std::map<AgentId, HaveSet>& have) {
    for (const auto& [key, content] : acknowledged_) {
      if (key.stream.origin == origin) CheckHas(origin, key, records, have);
    }
    for (const auto& [key, content] : records.at(origin)) {
      // This loop also checks records whose insert was not acknowledged.
      if (key.stream.origin == origin) CheckHas(2, key, records, have);
    }
    for (const auto& [key, stream] : claimed_[origin].streams()) {
      if (!stream.Covered().Minus(have.at(origin).Get(key).Covered()).is_empty()) {
        Complain("agent " + std::to_string(origin) + " lacks what it acknowledged to a peer");
      }
    }
  }

  // Checks that no session stays open, that no message is repeated permanently, and that no crash made a peer send
  // invalid messages.
  void CheckQuiet() {
    const std::uint64_t bytes = team_.radio_bytes();
    Advance(seconds(120));
    if (team_.radio_bytes() != bytes) Complain("bytes are sent permanently");
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

  // Checks that leader and survivor merge their records into the same map.
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
  const std::vector<Strike> strikes_;
  const TemporaryFolder folder_;
  MissionReport report_;
  bool is_quiet_ = false;
  AgentId dying_ = 0;                            // The agent to kill when its present handler ends. 0: none.
  std::map<AgentId, MonotonicTime> restart_at_;  // Restart times of killed agents.
  std::uint64_t call_count_ = 0;
  Records acknowledged_;                // Records whose insert was acknowledged to a robot.
  std::map<AgentId, HaveSet> claimed_;  // Union of all have-sets that each agent sent.
  std::map<AgentId, int> batches_;      // Number of batches that each agent sent.
  std::map<AgentId, int> answers_;      // Number of have-sets that each agent sent.
  SimulatedTeam team_;
  const MonotonicTime start_ = team_.now();
};

}  // namespace

MissionReport RunMission(std::uint64_t seed, const std::vector<Strike>& strikes) {
  return Mission(seed, strikes).Run();
}

MissionReport RunLosses(std::uint64_t seed, int batches) { return Mission(seed, {}).RunLosses(batches); }

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
