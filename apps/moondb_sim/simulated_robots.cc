#include "apps/moondb_sim/simulated_robots.h"

#include <algorithm>
#include <utility>

#include "apps/moondb_sim/client_message.h"
#include "runtime/team/role_signature.h"

namespace moondb::simulation {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

constexpr Duration kInsertPeriod = seconds(10);
constexpr int kInsertsPerMap = 6;
constexpr std::uint64_t kQuarantineEvery = 60;  // A robot inserts one quarantine on average in this number of turns.
constexpr std::uint64_t kLargeMapEvery = 30;    // One map in 30 takes about 15 kB coded; other maps take 0.2 kB.
constexpr std::size_t kOpenMax = 32;
constexpr std::uint64_t kSilentEvery = 4;  // In one seed of four, robots report states rarely.
constexpr Duration kSilence = std::chrono::hours(1);
constexpr std::uint64_t kBeacons = 5;  // Number of latest keys that beacons use.
constexpr int kPlainMaps = 16;
constexpr std::uint32_t kPlainSide_cells = 512;
constexpr std::uint64_t kNotes = 2;         // Number of latest keys that notes use.
constexpr std::uint64_t kTurnsPerNote = 3;  // A rover inserts a note every third turn.
constexpr Duration kOptimizedAfterStart = seconds(2);
constexpr Duration kOptimizePeriod = minutes(5);
// Each call of Optimize optimizes every sixth of the last 60 nodes of each rover. A rover adds 30 nodes between two
// calls.
constexpr std::uint64_t kOptimizedNodes = 60;
constexpr std::uint64_t kOptimizedStep = 6;
// A driving robot inserts a node every sixth turn. More nodes would make solving and merging too slow.
constexpr std::uint64_t kTurnsPerNode = 6;
constexpr std::uint64_t kLiftedEvery = 3;  // One quarantine record in three lifts an earlier one.
// A quarantined interval starts at most this long ago, and is at most this long.
constexpr Duration kQuarantinedAt = minutes(30);

proto::NodeKey Node(AgentId agent, std::uint64_t index) {
  proto::NodeKey key;
  key.set_agent_id(agent);
  key.set_index(index);
  return key;
}

// Returns whether storage recognises a repeated insert of the record by its node or edge.
bool HasName(const proto::Record& record) { return record.has_pose_graph_node() || record.has_pose_graph_edge(); }

// Returns the answer to an insert that `message` holds. Null for other messages, and for errors after which the record
// may or may not be stored.
std::optional<proto::InsertReply> InsertReplyIn(const proto::Message& message) {
  if (message.has_insert_reply()) return message.insert_reply();
  const std::optional<proto::ControlReply> reply = ClientReplyIn(message);
  if (!reply) return std::nullopt;
  const auto code = reply->error().code();
  if (code == proto::ERROR_CODE_TIMED_OUT || code == proto::ERROR_CODE_UNAVAILABLE) return std::nullopt;
  proto::InsertReply insert = reply->insert();
  if (IsError(reply->error())) *insert.mutable_error() = reply->error();
  return insert;
}

}  // namespace

void SimulatedRobots::Start() {
  for (AgentId rover = 1; rover < world_.base; ++rover) {
    world_.At(world_.start + world_.DrawDuration(kInsertPeriod), [this, rover] { Work(rover); });
  }
  if (!world_.options.has_all_actors()) return world_.At(world_.start + kOptimizePeriod, [this] { Optimize(); });
  world_.At(world_.start + kInsertPeriod, [this] { Work(world_.base); });
}

Address SimulatedRobots::ListenerOf(AgentId agent) const {
  return {agent, world_.options.has_all_actors() ? actor_name::kGateway : actor_name::kStorage};
}

Address SimulatedRobots::RobotOf(AgentId agent) const {
  if (world_.options.has_all_actors()) return {kClients, "robot" + std::to_string(agent)};
  return ActorOf(agent);
}

Address SimulatedRobots::ActorOf(AgentId agent) { return {agent, "robot"}; }

void SimulatedRobots::SetLease(AgentId agent, proto::LeaseKind kind, Duration length) {
  proto::Message message;
  message.mutable_lease_request()->set_kind(kind);
  message.mutable_lease_request()->set_seconds(std::chrono::duration<double>(length).count());
  (void)world_.team.Post({agent, "driver"}, {agent, actor_name::kLease}, std::move(message));
  (void)world_.team.TakeMessages({agent, "driver"});  // Drop the answers to earlier lease requests.
}

bool SimulatedRobots::IsSilent() const { return world_.options.seed % kSilentEvery == kSilentEvery - 1; }

void SimulatedRobots::OnAgentStarted(AgentId agent) {
  if (!IsSilent() || agent == world_.base || world_.is_quiet) return;
  robots_[agent].silent_until = MonotonicTime();
  // Report the state now or at the next turn.
  if (world_.rng() % 2 == 0) ReportState(agent);
  world_.In(world_.DrawDuration(kOptimizedAfterStart), [this, agent] {
    if (!world_.is_quiet && world_.Leaders().contains(agent)) OptimizeAt(agent);
  });
}

void SimulatedRobots::OnAgentEnded(AgentId agent) {
  robots_[agent].asked.clear();
  (void)world_.team.TakeMessages(RobotOf(agent));
  (void)world_.team.TakeMessages(ActorOf(agent));
  std::erase_if(run_, [agent](const auto& entry) { return entry.first.first == agent; });
}

void SimulatedRobots::Work(AgentId rover) {
  TakeInsertReplies(rover);
  if (!world_.is_quiet) world_.In(kInsertPeriod, [this, rover] { Work(rover); });
  if (world_.is_quiet) return;
  Robot& robot = robots_[rover];
  const bool is_base = rover == world_.base;
  if (!is_base && world_.team.now() >= robot.silent_until) ReportState(rover);
  if (!is_base && world_.options.ChangesPolicy() && robot.turns % kTurnsPerNote == 0)
    ReportCustom(rover, kNote, kNotes);
  if (world_.options.has_all_actors()) {
    Drive(rover, robot);
  } else {
    Learn(rover, robot);
  }
  ++robot.turns;
  InsertOpen(rover, robot);
}

void SimulatedRobots::Learn(AgentId rover, Robot& robot) {
  proto::Record node;
  node.set_timestamp_ns(world_.ClockOf(rover));
  *node.mutable_pose_graph_node()->mutable_node() = Node(rover, robot.turns);
  SetPose(*node.mutable_pose_graph_node()->mutable_map_from_node());
  robot.open.push_back({std::move(node)});
  if (robot.turns % kInsertsPerMap == 0) robot.open.push_back({MapAt(rover, robot.turns)});
  if (world_.rng() % kQuarantineEvery == 0) robot.open.push_back({Quarantine()});
}

void SimulatedRobots::Drive(AgentId agent, Robot& robot) {
  const bool is_base = agent == world_.base;
  if (robot.turns % kTurnsPerNode == 0 && (!is_base || robot.turns == 0)) {
    for (proto::Record& record : drive_.NextNode(agent)) robot.open.push_back(std::move(record));
    if (!is_base) robot.open.push_back(drive_.MapHere(agent));
  }
  if (world_.rng() % kQuarantineEvery == 0) robot.open.push_back(QuarantineOfLate());
}

// Inserts the newest kOpenMax records of `robot.open`, and drops the older records.
void SimulatedRobots::InsertOpen(AgentId agent, Robot& robot) {
  while (robot.open.size() > kOpenMax) robot.open.pop_front();
  for (const proto::Record& record : robot.open) Insert(agent, {record});
  robot.open.clear();
}

void SimulatedRobots::ReportState(AgentId rover) {
  proto::Record state;
  state.set_timestamp_ns(world_.ClockOf(rover));
  state.mutable_power()->set_battery_ratio(0.5 + 0.5 * world_.Draw());
  Insert(rover, {std::move(state)});
  if (!IsSilent()) return;
  ReportCustom(rover, kBeacon, kBeacons);
  if (world_.team.is_running(rover)) robots_[rover].silent_until = world_.team.now() + kSilence;
}

void SimulatedRobots::ReportCustom(AgentId rover, DataType type, std::uint64_t key_count) {
  proto::Record record;
  record.set_timestamp_ns(world_.ClockOf(rover));
  record.mutable_custom()->set_data_type(type);
  record.mutable_custom()->set_latest_key(std::to_string(world_.rng() % key_count));
  record.mutable_custom()->set_payload(std::to_string(world_.rng()));
  Insert(rover, {std::move(record)});
}

void SimulatedRobots::SetPose(proto::Pose& pose) {
  pose.mutable_position_m()->set_x(world_.Draw() * 100);
  pose.mutable_position_m()->set_y(world_.Draw() * 100);
  pose.mutable_orientation()->set_w(1);
}

// Returns a quarantine of a random agent's maps. Used only without MergeActor, so the choice of maps does not matter.
proto::Record SimulatedRobots::Quarantine() {
  proto::Record record;
  record.mutable_map_quarantine()->set_agent_id(world_.DrawAgent());
  record.mutable_map_quarantine()->set_to_ns(static_cast<std::int64_t>(world_.rng() >> 1));
  return record;
}

// Returns a quarantine of the maps that a random agent made in a recent interval, or a record that lifts an earlier
// quarantine.
proto::Record SimulatedRobots::QuarantineOfLate() {
  proto::Record record;
  proto::MapQuarantine& quarantine = *record.mutable_map_quarantine();
  if (!quarantines_.empty() && world_.rng() % kLiftedEvery == 0) {
    *quarantine.mutable_lifts() = ToProto(quarantines_[world_.rng() % quarantines_.size()]);
    return record;
  }
  const AgentId agent = world_.DrawAgent();
  const std::int64_t from_ns = world_.ClockOf(agent) - world_.DrawDuration(kQuarantinedAt).count();
  quarantine.set_agent_id(agent);
  quarantine.set_from_ns(from_ns);
  quarantine.set_to_ns(from_ns + world_.DrawDuration(kQuarantinedAt).count());
  return record;
}

proto::Record SimulatedRobots::MapAt(AgentId rover, std::uint64_t index) {
  proto::Record record;
  record.set_timestamp_ns(world_.ClockOf(rover));
  proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
  *map.mutable_node() = Node(rover, index);
  map.mutable_node_from_map()->mutable_position_m();
  map.mutable_node_from_map()->mutable_orientation()->set_w(1);
  // A large map does not fit into one message with any codec.
  const bool is_large = world_.rng() % kLargeMapEvery == 0;
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

void SimulatedRobots::LearnPlainMaps(AgentId rover) {
  proto::Record record = MapAt(rover, robots_[rover].turns);
  proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
  map.mutable_layers()->DeleteSubrange(1, 1);
  proto::MapLayer& layer = *map.mutable_layers(0);
  layer.set_width_cells(kPlainSide_cells);
  layer.set_height_cells(kPlainSide_cells);
  layer.set_cells(std::string(kPlainSide_cells * kPlainSide_cells / 4, 'U'));
  for (int i = 0; i < kPlainMaps; ++i) {
    record.set_timestamp_ns(record.timestamp_ns() + 1);
    Insert(rover, {record});
  }
}

// Returns one byte with four random cells, each unknown, free or hazard.
char SimulatedRobots::DrawCells() {
  std::uint64_t random = world_.rng();
  int cells = 0;
  for (int i = 0; i < 4; ++i, random /= 3) cells = 4 * cells + static_cast<int>(random % 3);
  return static_cast<char>(cells);
}

void SimulatedRobots::Insert(AgentId agent, std::vector<proto::Record> records) {
  proto::ControlRequest request;
  for (const proto::Record& record : records) *request.mutable_insert()->add_records() = record;
  proto::Message message;
  message.set_request_id(++request_id_);
  // Clients may not insert optimized poses.
  const bool is_by_client = world_.options.has_all_actors() && !records.front().has_optimized_pose();
  if (is_by_client) {
    message = ClientMessage(request_id_, request);
  } else {
    *message.mutable_insert_request() = std::move(*request.mutable_insert());
  }
  const SendResult sent = is_by_client ? world_.team.Post(RobotOf(agent), ListenerOf(agent), std::move(message))
                                       : world_.team.Post(ActorOf(agent), {agent, actor_name::kStorage}, message);
  for (const proto::Record& record : records) world_.invariants.ObserveGiven(agent, record);
  if (sent == SendResult::kAccepted) robots_[agent].asked[request_id_] = std::move(records);
}

void SimulatedRobots::TakeInsertReplies(AgentId agent) {
  Robot& robot = robots_[agent];
  std::vector<proto::Message> answers = world_.team.TakeMessages(RobotOf(agent));
  for (proto::Message& message : world_.team.TakeMessages(ActorOf(agent))) answers.push_back(std::move(message));
  for (const proto::Message& message : answers) {
    const auto asked = robot.asked.find(message.request_id());
    const std::optional<proto::InsertReply> reply = InsertReplyIn(message);
    if (!reply || asked == robot.asked.end()) continue;
    ObserveInserted(agent, asked->second, *reply);
    robot.asked.erase(asked);
  }
  // Insert unanswered nodes and edges again. Do not repeat other records, because storage might store them twice.
  for (auto& [id, records] : robot.asked) {
    for (proto::Record& record : records) {
      if (HasName(record)) robot.open.push_back(std::move(record));
    }
  }
  robot.asked.clear();
}

void SimulatedRobots::ObserveInserted(AgentId agent, const std::vector<proto::Record>& records,
                                      const proto::InsertReply& reply) {
  const bool is_map = records.front().has_local_traversability_map();
  if (reply.error().code() == proto::ERROR_CODE_FULL && !is_map && world_.MustStore(agent)) {
    world_.Violate("stores_after_prune", "agent " + std::to_string(agent) + ": " + reply.error().text());
  }
  if (IsError(reply.error()) && world_.HadDiskTrouble(agent)) {
    for (const proto::Record& record : records) {
      if (HasName(record)) robots_[agent].open.push_back({record});
    }
    return;
  }
  if (IsError(reply.error())) {
    if (agent == world_.byzantine) return;  // The Byzantine agent may lie to its own store.
    // A rover without a role may not quarantine other agents' maps, and robots do not check who leads.
    const bool is_refused = reply.error().code() == proto::ERROR_CODE_REFUSED && HasSigningKeys(world_.config);
    if (is_refused && records.front().has_map_quarantine()) return;
    return world_.Violate("starts", "an insert failed: " + reply.error().text());
  }
  for (int i = 0; i < reply.keys_size(); ++i) {
    const RecordKey key = FromProto(reply.keys(i));
    if (key.stream.origin != agent)
      world_.Violate("one_content", "agent " + std::to_string(agent) + " names " + ToString(key));
    const proto::Record& record = records[static_cast<std::size_t>(i)];
    world_.invariants.ObserveInserted(agent, key, record);
    if (key.stream.type == kNote && world_.keeps_all_notes.contains(agent)) world_.invariants.ObserveKept(key);
    ++world_.report.records;
    if (world_.options.has_all_actors() && record.map_quarantine().agent_id() != 0) quarantines_.push_back(key);
  }
}

// Inserts optimized poses at each leader, every kOptimizePeriod. There may be several leaders at a time.
void SimulatedRobots::Optimize() {
  if (world_.is_quiet) return;
  world_.In(kOptimizePeriod, [this] { Optimize(); });
  for (const AgentId leader : world_.Leaders()) OptimizeAt(leader);
}

void SimulatedRobots::OptimizeAt(AgentId leader) {
  TakeInsertReplies(leader);
  std::vector<proto::Record> poses;
  const std::uint64_t run = ++run_[{leader, world_.roles[leader].term().number()}];
  for (AgentId rover = 1; rover < world_.base; ++rover) {
    const std::uint64_t nodes = robots_[rover].turns;
    std::uint64_t index = nodes - std::min(nodes, kOptimizedNodes);
    for (index += kOptimizedStep - 1; index < nodes; index += kOptimizedStep) {
      proto::Record& record = poses.emplace_back();
      record.set_timestamp_ns(world_.ClockOf(leader));
      proto::OptimizedPose& pose = *record.mutable_optimized_pose();
      *pose.mutable_node() = Node(rover, index);
      SetPose(*pose.mutable_map_from_node());
      *pose.mutable_term() = world_.roles[leader].term();
      pose.set_run(run);
    }
  }
  if (!poses.empty()) Insert(leader, std::move(poses));
}

}  // namespace moondb::simulation
