#include "apps/moondb_sim/simulated_mission.h"

#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <deque>
#include <memory>
#include <optional>
#include <random>
#include <set>
#include <tuple>
#include <utility>

#include "actors/clock/clock_actor.h"
#include "actors/role/role_actor.h"
#include "actors/sharing/replica_actor.h"
#include "actors/sharing/sync_actor.h"
#include "actors/storage/have_ledger.h"
#include "actors/storage/storage_actor.h"
#include "apps/moondb_sim/disk_damage.h"
#include "apps/moondb_sim/session_watch.h"
#include "apps/moondb_sim/simulated_disk.h"
#include "model/check.h"
#include "runtime/simulation/simulated_team.h"
#include "runtime/team_config.h"

namespace moondb::simulation {
namespace {

using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;

constexpr std::size_t kViolationsMax = 10;
constexpr std::size_t kLastEvents = 60;
constexpr double kMessagesMaxPerHour = 50'000;  // Of each agent; a hundredth of it is usual.
constexpr Duration kInsertPeriod = seconds(10);
constexpr int kInsertsPerMap = 6;
constexpr std::uint64_t kLargeMapEvery = 30;  // About 15 kB coded, where the others have 0.2 kB.
constexpr Duration kSharePeriod = seconds(60);
constexpr Duration kOptimizePeriod = minutes(5);
constexpr std::uint64_t kOptimizedNodes = 60;  // The last ones of each rover: each node is optimized twice.
constexpr std::uint64_t kOptimizedStep = 6;
constexpr Duration kInspectPeriod = minutes(1);
constexpr double kMailboxMax = 48;       // And four for each agent. Ten is usual in a team of four.
constexpr double kQuietRatio = 1.0 / 6;  // Of the hours, at the end.

proto::TeamConfig MakeTeam(int rovers) {
  proto::TeamConfig team;
  team.set_team("simulated");
  for (int id = 1; id <= rovers + 1; ++id) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(static_cast<std::uint32_t>(id));
    const bool is_base = id == rovers + 1;
    agent.set_name(is_base ? "base" : "rover" + std::to_string(id));
    agent.set_kind(is_base ? proto::AGENT_KIND_BASE_STATION : proto::AGENT_KIND_ROVER);
  }
  team.mutable_roles()->set_leader("rover1");
  team.mutable_roles()->set_survivor("rover2");
  proto::SharePolicies& share = *team.mutable_share();
  share.set_power(proto::POLICY_LATEST);
  share.set_pose_graph_node(proto::POLICY_ALL);
  share.set_optimized_pose(proto::POLICY_LATEST);
  share.set_local_traversability_map(proto::POLICY_ALL);
  team.mutable_ground()->set_power(proto::POLICY_LATEST);
  team.mutable_ground()->set_pose_graph_node(proto::POLICY_ALL);
  team.mutable_ground()->set_local_traversability_map(proto::POLICY_ALL);
  return team;
}

class Mission {
 public:
  explicit Mission(const SimOptions& options)
      : options_(options),
        config_(MakeTeam(options.rovers)),
        base_(static_cast<AgentId>(options.rovers + 1)),
        messages_max_(static_cast<std::uint64_t>(kMessagesMaxPerHour * options.hours * base_)),
        rng_(options.seed),
        disk_(options.seed),
        rules_([this](const std::string& rule, std::string text) { Violate(rule, std::move(text)); }),
        team_(options.seed) {
    disk_.on_cut = [this](const std::string& prefix) { OnPowerCut(prefix); };
    team_.SetBaseStation(base_);
    team_.SetFault([this](const Address& actor, const proto::Message& message) { return OnHandle(actor, message); });
    team_.SetFilter(
        [this](AgentId from, AgentId to, const proto::Message& message) { return OnRadio(from, to, message); });
    for (AgentId agent = 1; agent <= base_; ++agent) {
      team_.AddAgent(agent);
    }
    for (AgentId agent = 1; agent <= base_; ++agent) {
      Check(CheckStore(agent), "an empty disk can be written");
      SpawnActors(agent);
    }
  }

  ~Mission() {
    is_over_ = true;
    for (AgentId agent = 1; agent <= base_; ++agent) disk_.CutPower(Prefix(agent));
    for (AgentId agent = 1; agent <= base_; ++agent) team_.Crash(agent);
  }

  SimReport Run() {
    const Duration length =
        std::chrono::duration_cast<Duration>(std::chrono::duration<double, std::ratio<3600>>(options_.hours));
    end_ = start_ + length;
    quiet_from_ = end_ - Duration(static_cast<Duration::rep>(kQuietRatio * static_cast<double>(length.count())));
    for (AgentId rover = 1; rover < base_; ++rover) {
      At(start_ + DrawDuration(kInsertPeriod), [this, rover] { Drive(rover); });
    }
    At(start_ + seconds(30), [this] { Operate(); });
    At(start_ + kOptimizePeriod, [this] { Optimize(); });
    At(start_ + kInspectPeriod, [this] { Inspect(); });
    for (const FaultKind& kind : FaultKinds()) ScheduleFault(kind);
    At(quiet_from_, [this] { BecomeQuiet(); });
    while (!schedule_.empty() && report_.violations.size() < kViolationsMax && !is_stormy_) {
      const auto next = schedule_.begin();
      if (next->first > end_) break;
      const auto action = std::move(next->second);
      AdvanceTo(next->first);
      schedule_.erase(next);
      action();
    }
    if (report_.violations.empty()) {
      AdvanceTo(end_);
      CheckRest();
    }
    report_.radio_bytes = team_.radio_bytes();
    report_.trace_hash = XXH64(&hash_, sizeof hash_, team_.trace_hash());
    if (options_.measures_refill && report_.violations.empty()) MeasureRefill();
    return std::move(report_);
  }

 private:
  using Action = std::function<void()>;

  // --- Time and chance ---

  void At(MonotonicTime time, Action action) { schedule_.emplace(time, std::move(action)); }
  void In(Duration delay, Action action) { At(team_.now() + delay, std::move(action)); }
  void AdvanceTo(MonotonicTime time) {
    if (time > team_.now()) team_.AdvanceTime(time - team_.now());
  }
  double Draw() { return static_cast<double>(rng_() >> 11) * 0x1.0p-53; }
  Duration DrawDuration(Duration limit) {
    return Duration(static_cast<Duration::rep>(Draw() * static_cast<double>(limit.count())));
  }
  AgentId DrawAgent() { return 1 + static_cast<AgentId>(rng_() % base_); }
  AgentId DrawOther(AgentId agent) { return 1 + (agent + static_cast<AgentId>(rng_() % (base_ - 1))) % base_; }
  double NowS() const { return std::chrono::duration<double>(team_.now() - start_).count(); }

  // --- The team ---

  static std::string Prefix(AgentId agent) { return "agent" + std::to_string(agent) + "/"; }

  template <typename ActorType, typename Options>
  void Spawn(AgentId agent, const char* name, Options options) {
    options.self = agent;
    options.team = config_;
    team_.Spawn(agent, name, [this, agent, name, options = std::move(options)]() -> std::unique_ptr<Actor> {
      std::unique_ptr<Actor> actor = std::make_unique<ActorType>(options);
      return options_.wrap ? options_.wrap(agent, name, std::move(actor)) : std::move(actor);
    });
  }

  static std::string PathOf(AgentId agent) { return Prefix(agent) + "moondb.sqlite"; }

  // What moondb_agent does before it makes its actors. False: the power was cut meanwhile.
  bool CheckStore(AgentId agent) {
    if (!options_.is_store_checked) return true;
    StorageActor::Options storage;
    storage.path = PathOf(agent);
    storage.vfs = disk_.name();
    storage.self = agent;
    storage.team = config_;
    was_cut_ = false;
    const Result<std::unique_ptr<RecordStore>> store = RecordStore::Open(StorageActor::StoreOptions(storage));
    if (!store && !was_cut_) {
      Violate("starts", "agent " + std::to_string(agent) + " does not start: " + ToString(store.error()));
    }
    if (store && !(*store)->set_aside().empty()) damaged_.erase(agent);
    return store.has_value() && !was_cut_;
  }

  void SpawnActors(AgentId agent) {
    StorageActor::Options storage;
    storage.path = PathOf(agent);
    storage.vfs = disk_.name();
    storage.is_checked = true;  // By CheckStore.
    Spawn<StorageActor>(agent, actor_name::kStorage, storage);
    Spawn<ClockActor>(agent, actor_name::kClock, ClockActor::Options());
    Spawn<RoleActor>(agent, actor_name::kRole, RoleActor::Options());
    SharingActor::Options sharing;
    sharing.config_hash = 1;
    sharing.session = options_.session;
    Spawn<SyncActor>(agent, actor_name::kSync, sharing);
    Spawn<ReplicaActor>(agent, actor_name::kReplica, sharing);
  }

  // --- What is seen ---

  struct Event {
    double time_s;
    std::string actor;
    AgentId agent;
    int body;
    AgentId from;
  };

  Fault OnHandle(const Address& actor, const proto::Message& message) {
    if (++report_.messages == messages_max_) {
      Violate("comes_to_rest", std::to_string(messages_max_) + " messages and no end");
      is_stormy_ = true;
    }
    const std::array<std::uint64_t, 4> step = {actor.agent, static_cast<std::uint64_t>(message.body_case()),
                                               message.request_id(),
                                               static_cast<std::uint64_t>(team_.now().time_since_epoch().count())};
    hash_ = XXH64(step.data(), sizeof step, hash_);
    events_.push_back({NowS(), actor.actor, actor.agent, message.body_case(), message.hop_sender()});
    if (events_.size() > kLastEvents) events_.pop_front();
    switch (message.body_case()) {
      case proto::Message::kStoreRequest:
        for (const proto::StoredRecord& record : message.store_request().records()) SeeRecord(record, actor.agent);
        break;
      case proto::Message::kStoreReply:
        if (message.store_reply().rejected_count() == 0) break;
        Violate("nothing_refused", "agent " + std::to_string(actor.agent) + " refuses " +
                                       std::to_string(message.store_reply().rejected_count()) + " records of a peer");
        break;
      case proto::Message::kHave:
        watches_[{actor.agent, actor.actor, message.hop_sender()}].OnHave(message.have());
        break;
      case proto::Message::kRolesChanged:
        roles_[actor.agent] = message.roles_changed().roles();
        rules_.SeeRoles(actor.agent, message.roles_changed().roles());
        break;
      default:
        break;
    }
    if (fail_next_ != actor.agent || is_asking_) return Fault::kNone;
    fail_next_ = 0;
    ++failures_[actor.agent];
    constexpr Fault kFaults[] = {Fault::kBeforeHandler, Fault::kAtFirstSend, Fault::kAfterFirstSend,
                                 Fault::kAfterHandler};
    return kFaults[rng_() % std::size(kFaults)];
  }

  bool OnRadio(AgentId from, AgentId to, const proto::Message& message) {
    const std::string who = "agent " + std::to_string(from) + " to " + std::to_string(to) + ": ";
    if (message.has_hello()) watches_[{from, message.source_actor(), to}].OnHello(message.hello());
    if (message.has_batch()) {
      report_.batch_bytes += message.ByteSizeLong();
      for (const auto& [rule, text] : watches_[{from, message.source_actor(), to}].OnBatch(message)) {
        Violate(rule, who + text);
      }
    }
    if (message.has_refusal()) {
      const Error error = FromProto(message.refusal().error());
      // A session that its receiver does not know any more; a store that failed.
      const bool is_usual =
          error.code == ErrorCode::kNotFound || (error.code == ErrorCode::kUnavailable && damaged_.contains(from));
      if (!is_usual) Violate("nothing_refused", who + ToString(error));
    }
    if (message.has_have()) {
      report_.have_bytes += message.ByteSizeLong();
      const Result<HaveSet> have = FromProto(message.have().have());
      if (have) rules_.SeeHave(from, *have);
      if (!have) Violate("nothing_refused", who + "a malformed have-set");
    }
    return !is_stormy_ && !deaf_.contains({from, to});
  }

  void SeeRecord(const proto::StoredRecord& record, AgentId where) {
    rules_.SeeRecord(FromProto(record.key()), record.content(), where);
  }

  void Violate(const std::string& rule, std::string text) {
    if (report_.violations.empty()) {
      for (const Event& event : events_) {
        const auto* field = proto::Message::descriptor()->FindFieldByNumber(event.body);
        char line[160];
        std::snprintf(line, sizeof line, "%10.3f s  agent %u %s  %s  from agent %u", event.time_s, event.agent,
                      event.actor.c_str(), field == nullptr ? "nothing" : field->name().c_str(), event.from);
        report_.last_events.push_back(line);
      }
    }
    if (report_.violations.size() >= kViolationsMax) return;
    report_.violations.push_back({rule, NowS(), report_.messages, std::move(text)});
  }

  // --- Robots, planner, operator ---

  void Drive(AgentId rover) {
    TakeInsertReplies(rover);
    if (!is_quiet_) In(kInsertPeriod, [this, rover] { Drive(rover); });
    if (is_quiet_) return;
    Robot& robot = robots_[rover];
    proto::Record state;
    state.set_stamp_ns(ClockOf(rover));
    state.mutable_power()->set_battery_ratio(0.5 + 0.5 * Draw());
    Insert(rover, {std::move(state)});
    proto::Record node;
    node.set_stamp_ns(ClockOf(rover));
    *node.mutable_pose_graph_node()->mutable_node() = Node(rover, robot.next_node);
    SetPose(*node.mutable_pose_graph_node()->mutable_map_from_node());
    robot.open.push_back({std::move(node)});
    if (robot.next_node % kInsertsPerMap == 0) robot.open.push_back({MapAt(rover, robot.next_node)});
    ++robot.next_node;
    // What was not answered is inserted again: storage knows a node by its name. A map might come twice.
    while (robot.open.size() > kOpenMax) robot.open.pop_front();
    for (const proto::Record& record : robot.open) Insert(rover, {record});
    robot.open.clear();
  }

  std::int64_t ClockOf(AgentId agent) { return team_.utc_now_ns() + clock_offset_[agent].count(); }

  static proto::NodeKey Node(AgentId agent, std::uint64_t index) {
    proto::NodeKey key;
    key.set_agent_id(agent);
    key.set_index(index);
    return key;
  }

  void SetPose(proto::Pose& pose) {
    pose.mutable_position_m()->set_x(Draw() * 100);
    pose.mutable_position_m()->set_y(Draw() * 100);
    pose.mutable_orientation()->set_w(1);
  }

  proto::Record MapAt(AgentId rover, std::uint64_t index) {
    proto::Record record;
    record.set_stamp_ns(ClockOf(rover));
    proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
    *map.mutable_node() = Node(rover, index);
    map.mutable_node_from_map()->mutable_position_m();
    map.mutable_node_from_map()->mutable_orientation()->set_w(1);
    // Every so often one that does not fit into a message, whatever codes it.
    const bool is_large = rng_() % kLargeMapEvery == 0;
    const std::uint32_t side_cells = is_large ? 192 : 16;
    for (int i = 0; i < 2; ++i) {
      proto::MapLayer& layer = *map.add_layers();
      layer.set_width_cells(side_cells);
      layer.set_height_cells(side_cells);
      layer.set_resolution_um(i == 0 ? 100'000 : 200'000);
      for (std::uint32_t j = 0; j < side_cells * side_cells / 4; ++j) layer.mutable_cells()->push_back(DrawCells());
    }
    return record;
  }

  // Four cells, each unknown, free or hazard.
  char DrawCells() {
    std::uint64_t random = rng_();
    int cells = 0;
    for (int i = 0; i < 4; ++i, random /= 3) cells = 4 * cells + static_cast<int>(random % 3);
    return static_cast<char>(cells);
  }

  void Insert(AgentId agent, std::vector<proto::Record> records) {
    proto::Message message;
    message.set_request_id(++request_id_);
    for (const proto::Record& record : records) *message.mutable_insert_request()->add_records() = record;
    const SendResult sent = team_.Post({agent, "robot"}, {agent, actor_name::kStorage}, std::move(message));
    if (sent == SendResult::kAccepted) robots_[agent].asked[request_id_] = std::move(records);
  }

  void TakeInsertReplies(AgentId agent) {
    Robot& robot = robots_[agent];
    for (const proto::Message& message : team_.Take({agent, "robot"})) {
      const auto asked = robot.asked.find(message.request_id());
      if (!message.has_insert_reply() || asked == robot.asked.end()) continue;
      NoteInserted(agent, asked->second, message.insert_reply());
      robot.asked.erase(asked);
    }
    // No answer: nodes are asked for again.
    for (auto& [id, records] : robot.asked) {
      for (proto::Record& record : records) {
        if (record.has_pose_graph_node()) robot.open.push_back(std::move(record));
      }
    }
    robot.asked.clear();
  }

  void NoteInserted(AgentId agent, const std::vector<proto::Record>& records, const proto::InsertReply& reply) {
    if (IsError(reply.error())) {
      return Violate("starts", "an insert failed: " + reply.error().text());
    }
    for (int i = 0; i < reply.keys_size(); ++i) {
      const RecordKey key = FromProto(reply.keys(i));
      if (key.stream.origin != agent)
        Violate("one_content", "agent " + std::to_string(agent) + " names " + ToString(key));
      rules_.SeeInserted(agent, key, records[static_cast<std::size_t>(i)]);
      ++report_.records;
    }
  }

  std::set<AgentId> Leaders() const {
    std::set<AgentId> leaders;
    for (const auto& [agent, roles] : roles_) {
      if (roles.leader() == agent && team_.is_running(agent)) leaders.insert(agent);
    }
    return leaders;
  }

  void Operate() {
    In(kSharePeriod, [this] { Operate(); });
    for (const AgentId leader : Leaders()) {
      Order(leader, proto::SHARING_KIND_SYNC);
      In(kSharePeriod / 2, [this, leader] { Order(leader, proto::SHARING_KIND_REPLICATION); });
    }
  }

  void Order(AgentId leader, proto::SharingKind kind) {
    proto::Message message;
    message.mutable_share_request()->set_kind(kind);
    const bool is_sync = kind == proto::SHARING_KIND_SYNC;
    (void)team_.Post({leader, "operator"}, {leader, is_sync ? actor_name::kSync : actor_name::kReplica},
                     std::move(message));
    (void)team_.Take({leader, "operator"});
  }

  // Each that leads optimizes what it has; two leaders may.
  void Optimize() {
    if (is_quiet_) return;
    In(kOptimizePeriod, [this] { Optimize(); });
    for (const AgentId leader : Leaders()) {
      TakeInsertReplies(leader);
      std::vector<proto::Record> poses;
      const std::uint64_t run = ++run_[{leader, roles_[leader].term().number()}];
      for (AgentId rover = 1; rover < base_; ++rover) {
        const std::uint64_t nodes = robots_[rover].next_node;
        std::uint64_t index = nodes - std::min(nodes, kOptimizedNodes);
        for (index += kOptimizedStep - 1; index < nodes; index += kOptimizedStep) {
          proto::Record& record = poses.emplace_back();
          record.set_stamp_ns(ClockOf(leader));
          proto::OptimizedPose& pose = *record.mutable_optimized_pose();
          *pose.mutable_node() = Node(rover, index);
          SetPose(*pose.mutable_map_from_node());
          *pose.mutable_term() = roles_[leader].term();
          pose.set_run(run);
        }
      }
      if (!poses.empty()) Insert(leader, std::move(poses));
    }
  }

  void SetRoles(AgentId agent, proto::RoleSetRequest request) {
    proto::Message message;
    *message.mutable_role_set_request() = std::move(request);
    (void)team_.Post({agent, "operator"}, {agent, actor_name::kRole}, std::move(message));
  }

  // --- Faults ---

  void ScheduleFault(const FaultKind& kind) {
    const double per_hour = options_.FaultsPerHour(kind);
    if (per_hour <= 0) return;
    const double wait_s = -std::log(1 - Draw()) * 3600 / per_hour;
    In(std::chrono::duration_cast<Duration>(std::chrono::duration<double>(wait_s)), [this, &kind] {
      if (is_quiet_) return;
      ++report_.faults[kind.name];
      Strike(kind.name);
      ScheduleFault(kind);
    });
  }

  void Strike(const std::string& fault) {
    if (fault == "weather") return ChangeWeather();
    if (fault == "late_copy") return RepeatLate();
    if (fault == "cut") return Cut();
    if (fault == "one_way") return Deafen();
    if (fault == "partition") return Divide();
    if (fault == "kill") return Kill(DrawAgent());
    if (fault == "kill_in_write") return disk_.CutPowerAfter(Prefix(DrawAgent()), 1 + static_cast<int>(rng_() % 60));
    if (fault == "fail") {
      fail_next_ = DrawAgent();
      return;
    }
    if (fault == "wipe" || fault == "old_disk" || fault.starts_with("damage")) {
      const AgentId agent = DrawAgent();
      Kill(agent);
      disk_fault_[agent] = fault;
      return;
    }
    if (fault == "clock") {
      const AgentId agent = DrawAgent();
      clock_offset_[agent] = rng_() % 2 == 0 ? std::chrono::hours(6) : -std::chrono::hours(24 * 365 * 56);
      return team_.SetUtcOffset(agent, clock_offset_[agent]);
    }
    if (fault == "swap") {
      proto::RoleSetRequest request;
      request.set_is_swap(true);
      return SetRoles(DrawAgent(), request);
    }
    if (fault == "reassign") {
      proto::RoleSetRequest request;
      request.set_leader(1 + static_cast<AgentId>(rng_() % (base_ - 1)));
      request.set_survivor(request.leader() % (base_ - 1) + 1);
      return SetRoles(DrawAgent(), request);
    }
  }

  void ChangeWeather() {
    RadioOptions& radio = team_.radio();
    radio.loss_ratio = rng_() % 3 == 0 ? 0 : 0.3 * Draw();
    radio.duplicate_ratio = rng_() % 2 == 0 ? 0 : 0.1 * Draw();
    radio.latency = milliseconds(1) + DrawDuration(milliseconds(50));
    radio.latency_jitter = rng_() % 2 == 0 ? Duration::zero() : DrawDuration(milliseconds(200));
    radio.bytes_per_second = rng_() % 4 == 0 ? 0 : 125'000 / (1 + 3 * Draw());
  }

  void RepeatLate() {
    team_.radio().duplicate_ratio = 0.1;
    team_.radio().duplicate_delay_max = minutes(10);
    In(minutes(1) + DrawDuration(minutes(10)), [this] {
      team_.radio().duplicate_ratio = 0;
      team_.radio().duplicate_delay_max = RadioOptions().duplicate_delay_max;
    });
  }

  void Cut() {
    const AgentId a = DrawAgent();
    const AgentId b = DrawOther(a);
    team_.SetLink(a, b, false, rng_() % 2 == 0);
    In(seconds(5) + DrawDuration(minutes(5)), [this, a, b] { team_.SetLink(a, b, true); });
  }

  void Deafen() {
    const AgentId from = DrawAgent();
    const AgentId to = DrawOther(from);
    deaf_.insert({from, to});
    In(seconds(5) + DrawDuration(minutes(3)), [this, from, to] { deaf_.erase({from, to}); });
  }

  void Divide() {
    std::vector<AgentId> part;
    for (AgentId agent = 1; agent <= base_; ++agent) {
      if (rng_() % 2 == 0) part.push_back(agent);
    }
    team_.Partition({part});
    In(minutes(1) + DrawDuration(minutes(10)), [this] { team_.Heal(); });
  }

  void Kill(AgentId agent) {
    if (team_.is_running(agent)) disk_.CutPower(Prefix(agent));
  }

  // Also in the middle of a handler.
  void OnPowerCut(const std::string& prefix) {
    if (is_over_) return;
    was_cut_ = true;
    for (AgentId agent = 1; agent <= base_; ++agent) {
      if (Prefix(agent) != prefix || !team_.is_running(agent)) continue;
      CheckMailboxes(agent);
      team_.Crash(agent);
      OnEnded(agent);
    }
  }

  void OnEnded(AgentId agent) {
    robots_[agent].asked.clear();
    (void)team_.Take({agent, "robot"});
    roles_.erase(agent);
    std::erase_if(run_, [agent](const auto& entry) { return entry.first.first == agent; });
    if (rng_() % 2 == 0) TellOthers(agent, false);
    to_restart_.insert(agent);
    In(seconds(1) + DrawDuration(minutes(2)), [this, agent] { Restart(agent); });
  }

  // The others notice, as the transport's deadlines do; else their timers have to do.
  void TellOthers(AgentId agent, bool is_up) {
    for (AgentId other = 1; other <= base_; ++other) {
      if (other != agent) team_.SetLink(agent, other, is_up);
    }
  }

  void Restart(AgentId agent) {
    if (team_.is_running(agent)) return;
    const auto fault = disk_fault_.find(agent);
    if (fault != disk_fault_.end()) {
      BreakDisk(agent, fault->second);
      disk_fault_.erase(fault);
    } else if (rng_() % 4 == 0) {
      old_disks_[agent] = disk_.Save(Prefix(agent));
    }
    if (!CheckStore(agent)) return In(seconds(1), [this, agent] { Restart(agent); });
    to_restart_.erase(agent);
    failures_[agent] = team_.restarts(agent);
    team_.Restart(agent);
    TellOthers(agent, true);
    CheckHave(agent);
  }

  void BreakDisk(AgentId agent, const std::string& fault) {
    if (fault == "damage_record" || fault == "damage_interval") return BreakDatabase(agent, fault);
    const auto old = old_disks_.find(agent);
    if (fault == "damage") {
      disk_.Damage(Prefix(agent));
      damaged_.insert(agent);
    } else if (fault == "old_disk" && old != old_disks_.end()) {
      disk_.Restore(Prefix(agent), old->second);
    } else {
      disk_.Wipe(Prefix(agent));
    }
    rules_.ForgetDisk(agent);
    rules_.ForgetRoles(agent);
  }

  // All that the disk holds is held for certain, but for what is damaged.
  void BreakDatabase(AgentId agent, const std::string& fault) {
    disk_.CutPowerAfter(Prefix(agent), 0);
    Result<std::unique_ptr<Database>> database = Database::Open(PathOf(agent), 0, disk_.name());
    HaveLedger ledger;
    // It is damaged already, or its agent did not live to make it.
    if (!database || !(*database)->QuickCheck() || !ledger.Load(**database)) return;
    rules_.SeeHave(agent, ledger.have());
    if (fault == "damage_record") {
      const std::optional<RecordKey> key = DamageRecord(**database, rng_);
      if (key) rules_.ForgetRecord(agent, *key);
    } else {
      const std::optional<DamagedInterval> damaged = DamageInterval(**database, rng_);
      if (damaged) rules_.ForgetDropped(agent, damaged->stream.origin, damaged->stream.type);
    }
  }

  // As soon as its storage answers: it may have failed just now.
  void CheckHave(AgentId agent) {
    if (!team_.is_running(agent)) return;
    const std::optional<HaveSet> have = HaveOf(agent);
    if (have) return rules_.CheckHave(agent, *have);
    In(seconds(10), [this, agent] { CheckHave(agent); });
  }

  void Inspect() {
    In(kInspectPeriod / 2 + DrawDuration(kInspectPeriod), [this] { Inspect(); });
    for (AgentId agent = 1; agent <= base_; ++agent) {
      CheckFailures(agent);
      if (!team_.is_running(agent)) continue;
      CheckMailboxes(agent);
      if (const std::optional<HaveSet> have = HaveOf(agent)) rules_.CheckHave(agent, *have);
    }
  }

  // Whatever made an actor fail was done to it on purpose, but for what a file that is damaged in many places does.
  void CheckFailures(AgentId agent) {
    const bool is_ended = !team_.is_running(agent) && !to_restart_.contains(agent);
    const bool is_failing = team_.restarts(agent) > failures_[agent];
    failures_[agent] = team_.restarts(agent);
    if ((is_ended || is_failing) && !damaged_.contains(agent)) {
      const proto::TraceReply trace = team_.GetTrace(agent);
      Violate("starts", "an actor of agent " + std::to_string(agent) + " failed by itself; the last that failed: " +
                            trace.dead_letters(trace.dead_letters_size() - 1).ShortDebugString());
    }
    if (is_ended) OnEnded(agent);  // As a service manager sees it.
  }

  void CheckMailboxes(AgentId agent) {
    for (const proto::ActorStatus& actor : team_.GetSystemStatus(agent).actors) {
      if (actor.queued_max() <= kMailboxMax + 4 * base_ && actor.dropped() == 0) continue;
      Violate("mailbox_bounded", "agent " + std::to_string(agent) + ": " + actor.ShortDebugString());
    }
  }

  void BecomeQuiet() {
    is_quiet_ = true;
    fail_next_ = 0;
    team_.radio() = RadioOptions();
    deaf_.clear();
    team_.Heal();
    for (AgentId agent = 1; agent <= base_; ++agent) {
      disk_.CutPowerAfter(Prefix(agent), 0);
      CheckFailures(agent);
      Restart(agent);
    }
    for (AgentId rover = 1; rover < base_; ++rover) TakeInsertReplies(rover);
  }

  // --- At rest ---

  proto::Message AskActor(AgentId agent, const char* actor, proto::Message question) {
    const Address asker{agent, "checker"};
    (void)team_.Take(asker);
    is_asking_ = true;
    (void)team_.Post(asker, {agent, actor}, std::move(question));
    team_.RunUntilIdle();
    is_asking_ = false;
    std::vector<proto::Message> answers = team_.Take(asker);
    return answers.empty() ? proto::Message() : std::move(answers.back());
  }

  std::optional<HaveSet> HaveOf(AgentId agent) {
    proto::Message question;
    question.mutable_have_request();
    const proto::Message answer = AskActor(agent, actor_name::kStorage, std::move(question));
    if (!answer.has_have_reply()) return std::nullopt;
    return *FromProto(answer.have_reply().have());
  }

  Records ReadAll(AgentId agent) {
    Records records;
    for (std::uint64_t after = 0;;) {
      proto::Message question;
      question.mutable_read_request()->set_after_row_id(after);
      const proto::Message answer = AskActor(agent, actor_name::kStorage, std::move(question));
      const proto::ReadReply& reply = answer.read_reply();
      for (const proto::StoredRecord& record : reply.records()) {
        SeeRecord(record, agent);
        if (record.key().seq() != 0) records[FromProto(record.key())] = record.content();
      }
      if (reply.is_complete() || reply.row_ids().empty()) return records;
      after = *reply.row_ids().rbegin();
    }
  }

  void CheckRest() {
    const std::optional<proto::RoleAssignment> roles = CheckRoles();
    if (!roles) return;
    TeamAtRest team{roles->leader(), roles->survivor(), base_, {}, {}};
    for (AgentId agent = 1; agent <= base_; ++agent) {
      CheckFailures(agent);
      const std::optional<HaveSet> have = HaveOf(agent);
      if (!have) return Violate("starts", "storage of agent " + std::to_string(agent) + " does not answer");
      team.have[agent] = *have;
      team.records[agent] = ReadAll(agent);
    }
    rules_.CheckRest(team);
    CheckBytesEnd();
    for (AgentId agent = 1; agent <= base_; ++agent) {
      CheckSessions(agent);
      CheckMailboxes(agent);
    }
  }

  // What all agents have, from their role actors and as their other actors heard it; nothing if a rule is broken.
  std::optional<proto::RoleAssignment> CheckRoles() {
    std::optional<proto::RoleAssignment> roles;
    for (AgentId agent = 1; agent <= base_; ++agent) {
      const std::string who = "agent " + std::to_string(agent);
      proto::Message question;
      question.mutable_role_show_request();
      const proto::Message answer =
          team_.is_running(agent) ? AskActor(agent, actor_name::kRole, std::move(question)) : proto::Message();
      if (!answer.has_role_show_reply() || !roles_.contains(agent)) {
        Violate(team_.is_running(agent) ? "one_leader" : "starts", who + " does not run, or does not know its roles");
        return std::nullopt;
      }
      const proto::RoleAssignment& shown = answer.role_show_reply().roles();
      if (!roles) roles = shown;
      for (const proto::RoleAssignment& its : {shown, roles_[agent]}) {
        if (its.SerializeAsString() == roles->SerializeAsString()) continue;
        Violate("one_leader",
                who + " has term " + its.term().ShortDebugString() + ", agent 1 " + roles->term().ShortDebugString());
        return std::nullopt;
      }
    }
    return roles;
  }

  void MeasureRefill() {
    const SimReport run = report_;
    const AgentId leader = roles_[1].leader();
    const AgentId survivor = roles_[1].survivor();
    team_.radio().latency = milliseconds(5);
    team_.radio().bytes_per_second = 125'000;
    disk_fault_[survivor] = "wipe";
    disk_.CutPower(Prefix(survivor));
    Restart(survivor);
    const MonotonicTime start = team_.now();
    const std::uint64_t bytes = team_.radio_bytes();
    Order(leader, proto::SHARING_KIND_REPLICATION);
    while (HaveOf(survivor) != HaveOf(leader) && team_.now() - start < std::chrono::hours(24)) {
      team_.AdvanceTime(milliseconds(100));
    }
    report_.have_bytes = run.have_bytes;
    report_.batch_bytes = run.batch_bytes;
    const bool is_full = HaveOf(survivor) == HaveOf(leader);
    report_.refill_s = is_full ? std::chrono::duration<double>(team_.now() - start).count() : -1;
    report_.refill_bytes = team_.radio_bytes() - bytes;
  }

  void CheckBytesEnd() {
    team_.AdvanceTime(minutes(1));  // Nobody orders anything any more.
    const std::uint64_t bytes = team_.radio_bytes();
    team_.AdvanceTime(minutes(10));
    if (team_.radio_bytes() != bytes) {
      Violate("comes_to_rest", std::to_string(team_.radio_bytes() - bytes) + " bytes in ten minutes without orders");
    }
  }

  void CheckSessions(AgentId agent) {
    for (const char* actor : {actor_name::kSync, actor_name::kReplica}) {
      proto::Message question;
      question.mutable_share_status_request();
      const proto::Message answer = AskActor(agent, actor, std::move(question));
      const proto::ShareStatus& status = answer.share_status();
      for (const proto::ShareSession& session : status.sessions()) {
        if (!session.is_open() && session.remaining() == 0) continue;
        Violate("comes_to_rest", "agent " + std::to_string(agent) + ": " + session.ShortDebugString());
      }
      if (status.damaged_messages() > 0) {
        Violate("nothing_refused", "agent " + std::to_string(agent) + " could not decode messages");
      }
    }
  }

  struct Robot {
    std::uint64_t next_node = 0;
    std::map<std::uint64_t, std::vector<proto::Record>> asked;
    std::deque<proto::Record> open;  // To be inserted.
  };
  static constexpr std::size_t kOpenMax = 100;

  const SimOptions options_;
  const proto::TeamConfig config_;
  const AgentId base_;
  const std::uint64_t messages_max_;
  std::mt19937_64 rng_;
  SimReport report_;
  bool is_quiet_ = false;
  bool is_over_ = false;
  bool is_stormy_ = false;  // Nothing is heard any more, so that it ends.
  bool is_asking_ = false;  // Of the checks' own questions: no actor fails at them.
  bool was_cut_ = false;    // The power of some agent, since this was last set to false.
  MonotonicTime end_;
  MonotonicTime quiet_from_;
  std::multimap<MonotonicTime, Action> schedule_;
  std::uint64_t request_id_ = 0;
  std::map<std::pair<AgentId, std::uint64_t>, std::uint64_t> run_;  // Of a leader in a term, in its present life.
  std::uint64_t hash_ = 0;
  AgentId fail_next_ = 0;  // An actor of that agent, at its next message.
  std::map<AgentId, Robot> robots_;
  std::map<AgentId, Duration> clock_offset_;
  std::map<AgentId, proto::RoleAssignment> roles_;  // What each running agent acts on.
  std::set<std::pair<AgentId, AgentId>> deaf_;      // What the first sends, the second does not hear.
  std::map<AgentId, std::string> disk_fault_;       // At its next restart.
  std::map<AgentId, SimulatedDisk::Image> old_disks_;
  std::set<AgentId> to_restart_;               // They do not run, and will again.
  std::set<AgentId> damaged_;                  // Disks that were damaged in many places.
  std::map<AgentId, std::uint64_t> failures_;  // Of actors, which were meant to fail; as SimulatedTeam::restarts.
  std::map<std::tuple<AgentId, std::string, AgentId>, SessionWatch> watches_;  // By sender, actor, receiver.
  std::deque<Event> events_;
  SimulatedDisk disk_;
  Rules rules_;
  SimulatedTeam team_;
  const MonotonicTime start_ = team_.now();
};

}  // namespace

SimReport RunSimulatedMission(const SimOptions& options) { return Mission(options).Run(); }

}  // namespace moondb::simulation
