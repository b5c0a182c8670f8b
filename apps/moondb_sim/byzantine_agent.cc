#include "apps/moondb_sim/byzantine_agent.h"

#include <algorithm>
#include <iterator>

#include "actors/sharing/codec.h"
#include "apps/moondb_sim/forged_message.h"
#include "apps/moondb_sim/simulated_config.h"
#include "model/control_message.h"
#include "model/data_types.h"
#include "model/record_hash.h"
#include "model/team_id.h"
#include "model/term.h"
#include "model/wire_version.h"
#include "proto/control.pb.h"
#include "proto/types.pb.h"
#include "runtime/team/role_signature.h"

namespace moondb::simulation {
namespace {

constexpr Duration kAttackPeriod = std::chrono::seconds(20);  // Average time between attacks.
constexpr std::size_t kSeenMax = 256;
constexpr std::uint64_t kReplayedMax = 8;
constexpr std::uint64_t kCounterShift = 48;  // Lowest bit of the counter in an epoch (actors/storage/own_epochs.h).
constexpr int kFloodMessages = 48;
constexpr int kHugeStreams = 2000;
constexpr std::uint64_t kDenseNodes = 10;  // Number of nodes of a dense graph. Edges connect each node with all others.
constexpr int kDenseMax = 3;  // Dense graphs per run. Solving more graphs would take longer than the rest of the run.
constexpr char kBy[] = "anna@hill (key)";

struct Kind {
  AttackKind kind;
  void (ByzantineAgent::*attack)(AgentId target);
};

const std::vector<Kind>& Kinds() {
  static const std::vector<Kind> kinds = {
      {{"forge", "brings a record in another's name: the next one, another content, of an old or a far epoch"},
       &ByzantineAgent::ForgeRecord},
      {{"event", "brings an event or a quarantine in another's name"}, &ByzantineAgent::ForgeEvent},
      {{"pose", "brings poses and verdicts of a high term, in its own or the leader's name"},
       &ByzantineAgent::ForgePose},
      {{"slander",
        "states odometry and ranges between others' nodes, and quarantines others' maps, as its own records"},
       &ByzantineAgent::Slander},
      {{"claim", "acknowledges in others' sessions what it never got, and vouches for all there is"},
       &ByzantineAgent::Claim},
      {{"epoch", "claims epochs of the receiver's own"}, &ByzantineAgent::ClaimEpochs},
      {{"drop", "says that records of others were dropped"}, &ByzantineAgent::Drop},
      {{"replay", "sends again what it heard or said, later and to others too"}, &ByzantineAgent::Replay},
      {{"announce", "announces roles of a high term that name it"}, &ByzantineAgent::Announce},
      {{"order", "relays commands in a forged name: roles, prune, stop, insert, lease, optimize"},
       &ByzantineAgent::Order},
      {{"share", "orders others to share"}, &ByzantineAgent::OrderToShare},
      {{"equivocate", "gives one record of its own two contents"}, &ByzantineAgent::Equivocate},
      {{"flood", "sends every actor many malformed and large messages at once"}, &ByzantineAgent::Flood},
      {{"dense", "states odometry between all of many nodes of its own"}, &ByzantineAgent::JoinAll},
  };
  return kinds;
}

const std::vector<DataType>& ForgedTypes() {
  static const std::vector<DataType> types = {proto::POWER,          proto::POSE_GRAPH_NODE, proto::OPTIMIZED_POSE,
                                              proto::MAP_QUARANTINE, proto::AGENT_EVENT,     kBeacon};
  return types;
}

proto::StoredRecord Stored(const RecordKey& key, proto::Record record) {
  record.set_is_state(IsState(key.stream.type) || key.stream.type == proto::OPTIMIZED_POSE);
  proto::StoredRecord stored;
  *stored.mutable_key() = ToProto(key);
  stored.set_content(record.SerializeAsString());
  stored.set_hash(HashRecord(key, stored.content()));
  return stored;
}

void SetRelativePose(double metres, double variance, proto::RelativePose& relative_pose) {
  relative_pose.mutable_from_from_to()->mutable_position_m()->set_x(metres);
  relative_pose.mutable_from_from_to()->mutable_orientation()->set_w(1);
  for (int row = 0; row < 6; ++row) {
    for (int column = row; column < 6; ++column) relative_pose.add_covariance(row == column ? variance : 0);
  }
}

// Returns a match that moves the node of `pose` by 100 m from the next node.
proto::MapMatch MatchLike(const proto::OptimizedPose& pose) {
  proto::MapMatch match;
  *match.mutable_from() = pose.node();
  *match.mutable_to() = pose.node();
  match.mutable_to()->set_index(pose.node().index() + 1);
  SetRelativePose(100, 1e-6, *match.mutable_relative_pose());
  const StreamKey maps{pose.node().agent_id(), 1, proto::LOCAL_TRAVERSABILITY_MAP};
  *match.mutable_from_map() = ToProto(RecordKey{maps, 1});
  *match.mutable_to_map() = ToProto(RecordKey{maps, 2});
  match.set_overlap(1);
  match.set_matched(1);
  *match.mutable_term() = pose.term();
  match.set_run(pose.run());
  return match;
}

proto::StreamHave StreamOf(const StreamKey& key, std::uint64_t first, std::uint64_t last, bool is_dropped) {
  HaveSet have;
  StreamHave& stream = have[key];
  (is_dropped ? stream.dropped : stream.held).Add({first, last});
  return ToProto(have).streams(0);
}

}  // namespace

const std::vector<AttackKind>& AttackKinds() {
  static const std::vector<AttackKind> kinds = [] {
    std::vector<AttackKind> all;
    for (const Kind& kind : Kinds()) all.push_back(kind.kind);
    return all;
  }();
  return kinds;
}

std::string RareStateOf(const AttackKind& kind) { return "attack_" + kind.name; }

ByzantineAgent::ByzantineAgent(SimulatedWorld& world, ByzantineChecker& checker)
    : world_(world), checker_(checker), rng_(~world.options.seed) {}

void ByzantineAgent::Start() {
  if (world_.byzantine != 0) world_.At(world_.start + kAttackPeriod, [this] { Attack(); });
}

void ByzantineAgent::Attack() {
  if (world_.is_quiet || checker_.is_trusted()) return;
  const double part = static_cast<double>(Draw(2000)) / 1000;
  world_.In(std::chrono::duration_cast<Duration>(part * kAttackPeriod), [this] { Attack(); });
  if (!world_.team.is_running(world_.byzantine)) return;
  const auto& chosen = world_.options.attacks;
  do {
    kind_ = Draw(Kinds().size());
  } while (!chosen.empty() && !chosen.contains(Kinds()[kind_].kind.name));
  (this->*Kinds()[kind_].attack)(DrawHonest());
}

// --- Received and sent messages ---

void ByzantineAgent::OnHandle(const Address& actor, const proto::Message& message) {
  if (world_.byzantine == 0) return;
  if (actor.agent == world_.byzantine && message.hop_sender() != world_.byzantine) {
    if (message.has_hello()) {
      sessions_[{static_cast<AgentId>(message.hop_sender()), actor.actor}] = message.hello().session_id();
    }
    return Remember({static_cast<AgentId>(message.hop_sender()), actor.actor}, message);
  }
  if (message.hop_sender() != world_.byzantine || actor.agent == world_.byzantine) return;
  const auto kind = in_flight_.find(ContentHash(message.SerializeAsString()));
  if (kind != in_flight_.end()) world_.rare_states.Count(RareStateOf(Kinds()[kind->second].kind));
}

bool ByzantineAgent::OnRadio(AgentId from, AgentId to, const proto::Message& message) {
  if (world_.byzantine == 0 || from != world_.byzantine) return false;
  if (is_attacking_) {
    in_flight_[ContentHash(message.SerializeAsString())] = kind_;
  } else {
    Remember({to, message.destination_actor()}, message);
  }
  return is_attacking_;
}

// Remembers a message for Replay. Skips requests of clients, because they never travel between agents.
void ByzantineAgent::Remember(const Address& to, const proto::Message& message) {
  if (message.hop_sender() == kClients || message.hop_sender() == 0) return;
  seen_.push_back({to, message});
  if (seen_.size() > kSeenMax) seen_.pop_front();
}

void ByzantineAgent::Send(const Address& to, const std::string& as_actor, proto::Message message) {
  is_attacking_ = true;
  (void)world_.team.Post({world_.byzantine, as_actor}, to, std::move(message));
  is_attacking_ = false;
}

proto::RoleAssignment ByzantineAgent::RolesOf(AgentId agent) const {
  const auto roles = world_.roles.find(agent);
  return roles == world_.roles.end() ? proto::RoleAssignment() : roles->second;
}

AgentId ByzantineAgent::DrawHonest() { return DrawHonestBut(world_.byzantine); }

AgentId ByzantineAgent::DrawHonestBut(AgentId agent) {
  for (;;) {
    const auto drawn = static_cast<AgentId>(1 + Draw(world_.base));
    if (drawn != world_.byzantine && drawn != agent) return drawn;
  }
}

// Returns the key of a random record that `holder` holds; null if there is none. Considers only records of `origin`
// with a type in ForgedTypes().
std::optional<RecordKey> ByzantineAgent::DrawKey(AgentId holder, AgentId origin) {
  const std::optional<HaveSet> have = world_.HaveOf(holder);
  if (!have) return std::nullopt;
  std::vector<RecordKey> keys;
  for (const auto& [key, stream] : have->streams()) {
    const bool is_forged = std::count(ForgedTypes().begin(), ForgedTypes().end(), key.type) > 0;
    if (key.origin == origin && is_forged && !stream.held.is_empty()) keys.push_back({key, stream.held.Max()});
  }
  if (keys.empty()) return std::nullopt;
  return keys[Draw(keys.size())];
}

// Opens a sharing session with the target and sends `batch` in it.
void ByzantineAgent::SendBatch(AgentId target, proto::Batch batch) {
  const bool is_sync = Draw(2) == 0;
  const char* actor = is_sync ? actor_name::kSync : actor_name::kReplica;
  proto::Message hello;
  hello.mutable_hello()->set_wire_version(kWireVersion);
  hello.mutable_hello()->set_team(world_.config.team());
  hello.mutable_hello()->set_team_id(TeamIdBytes(world_.config.team_id()));
  hello.mutable_hello()->set_session_id(rng_());
  hello.mutable_hello()->set_kind(is_sync ? proto::SHARING_KIND_SYNC : proto::SHARING_KIND_REPLICATION);
  batch.set_session_id(hello.hello().session_id());
  batch.set_batch_number(1);
  Send({target, actor}, actor, std::move(hello));
  proto::Message message;
  message.set_remaining(Draw(2));
  *message.mutable_batch() = std::move(batch);
  Send({target, actor}, actor, std::move(message));
}

void ByzantineAgent::SendRecord(AgentId target, const RecordKey& key, const proto::Record& record) {
  if (key.stream.origin != world_.byzantine) checker_.OnForged(record);
  SendRecords(target, {{key, record}});
}

void ByzantineAgent::SendRecords(AgentId target, const std::vector<std::pair<RecordKey, proto::Record>>& records) {
  proto::RecordBatch all;
  for (const auto& [key, record] : records) *all.add_records() = Stored(key, record);
  const CodedBatch coded = EncodeBatch(all);
  proto::Batch batch;
  batch.set_codec(coded.codec);
  batch.set_coded(coded.bytes);
  batch.set_record_count(static_cast<std::uint32_t>(records.size()));
  SendBatch(target, std::move(batch));
}

// --- Forged records ---

proto::Record ByzantineAgent::RecordLike(const RecordKey& key) {
  return ForgedRecord(key, DrawHonest(), RolesOf(key.stream.origin).term(), world_.ClockOf(key.stream.origin), rng_);
}

void ByzantineAgent::ForgeRecord(AgentId target) {
  const AgentId victim = DrawHonest();
  std::optional<RecordKey> key = DrawKey(Draw(2) == 0 ? victim : target, victim);
  if (!key) return;
  const std::uint64_t variant = Draw(4);
  if (variant == 0) ++key->seq;                                        // The next seq of the stream.
  if (variant == 1) key->seq = 1 + Draw(key->seq);                     // Another content for an existing key.
  if (variant == 2) key->stream.epoch -= 1 + Draw(key->stream.epoch);  // An older epoch.
  if (variant == 3) key->stream.epoch += (1ull << (kCounterShift + Draw(14))) + Draw(64);  // An epoch far ahead.
  if (key->stream.epoch == 0) return;
  if (variant >= 2) {
    key->seq = 1;
    checker_.OnImpossible(*key);
  }
  SendRecord(target, *key, RecordLike(*key));
}

void ByzantineAgent::ForgeEvent(AgentId target) {
  const AgentId victim = DrawHonestBut(target);
  std::optional<RecordKey> key = DrawKey(victim, victim);
  if (!key) return;
  key->stream.type = Draw(2) == 0 ? proto::AGENT_EVENT : proto::MAP_QUARANTINE;
  key->seq = kFarSeq + Draw(1000);
  checker_.OnImpossible(*key);
  SendRecord(target, *key, RecordLike(*key));
}

void ByzantineAgent::ForgePose(AgentId target) {
  RecordKey key{{world_.byzantine, rng_() >> 1, proto::OPTIMIZED_POSE}, 1 + Draw(4)};
  if (Draw(2) == 0) key.stream.origin = static_cast<AgentId>(RolesOf(target).leader());
  if (key.stream.origin == 0) return;
  if (key.stream.origin != world_.byzantine) checker_.OnImpossible(key);
  proto::Record record = RecordLike(key);
  proto::Term high = RolesOf(target).term();
  high.set_number(TermNumber(EraOf(high) + Draw(1000), RevisionOf(high) + 1));
  high.set_issuer(key.stream.origin);
  high.set_issuer_epoch(rng_());
  *record.mutable_optimized_pose()->mutable_term() = high;
  const proto::OptimizedPose pose = record.optimized_pose();
  const bool is_pose = Draw(4) != 0;
  if (!is_pose && pose.run() % 2 == 0) {
    *record.mutable_map_match() = MatchLike(pose);
    key.stream.type = proto::MAP_MATCH;
  } else if (!is_pose) {
    proto::EdgeVerdict& verdict = *record.mutable_edge_verdict();
    *verdict.mutable_from() = pose.node();
    *verdict.mutable_to() = pose.node();
    verdict.mutable_to()->set_index(pose.node().index() + 1);
    *verdict.mutable_term() = high;
    verdict.set_run(pose.run());
    key.stream.type = proto::EDGE_VERDICT;
  }
  if (!is_pose && key.stream.origin != world_.byzantine) checker_.OnImpossible(key);
  SendRecord(target, key, record);
}

// Sends an edge between nodes of honest agents, or a quarantine of their maps. Stores must reject the edge
// (ByzantineChecker). Readers must ignore the quarantine.
void ByzantineAgent::Slander(AgentId target) {
  RecordKey key{{world_.byzantine, rng_() >> 1, proto::POSE_GRAPH_EDGE}, 1 + Draw(4)};
  const AgentId victim = DrawHonest();
  proto::Record record;
  record.set_timestamp_ns(world_.ClockOf(victim));
  const std::uint64_t variant = Draw(4);
  if (variant >= 2) {
    key.stream.type = proto::MAP_QUARANTINE;
    const std::optional<RecordKey> given = DrawKey(target, victim);
    if (variant == 3 && given && given->stream.type == proto::MAP_QUARANTINE) {
      *record.mutable_map_quarantine()->mutable_lifts() = ToProto(*given);
    } else {
      record.mutable_map_quarantine()->set_agent_id(victim);
      record.mutable_map_quarantine()->set_to_ns(record.timestamp_ns());
    }
    *record.mutable_map_quarantine()->mutable_term() = RolesOf(target).term();
    return SendRecord(target, key, record);
  }
  proto::PoseGraphEdge& edge = *record.mutable_pose_graph_edge();
  edge.mutable_from()->set_agent_id(victim);
  edge.mutable_from()->set_index(Draw(200));
  edge.mutable_to()->set_agent_id(variant == 0 ? victim : DrawHonestBut(victim));
  edge.mutable_to()->set_index(edge.from().index() + 1 + Draw(200));
  if (variant == 0) {
    SetRelativePose(/*metres=*/5000, /*variance=*/1e-8, *edge.mutable_relative_pose());
  } else {
    edge.mutable_range()->set_range_m(9000);
    edge.mutable_range()->set_variance_m2(1e-8);
  }
  SendRecord(target, key, record);
}

void ByzantineAgent::Drop(AgentId target) {
  const AgentId victim = DrawHonest();
  const std::optional<RecordKey> key = DrawKey(target, victim);
  if (!key) return;
  const RecordKey far{key->stream, kFarSeq + Draw(1000)};
  checker_.OnImpossible(far);
  proto::Batch batch;
  batch.set_codec(EncodeBatch({}).codec);
  batch.set_coded(EncodeBatch({}).bytes);
  *batch.add_dropped() = StreamOf(key->stream, Draw(2) == 0 ? 1 : far.seq, far.seq, /*is_dropped=*/true);
  SendBatch(target, std::move(batch));
}

// Sends a record whose key may have another content at other agents. Uses the type POWER, on which no map depends,
// because MapChecker expects equal maps from agents that hold the same keys.
void ByzantineAgent::Equivocate(AgentId target) {
  std::optional<RecordKey> key = DrawKey(world_.byzantine, world_.byzantine);
  if (!key) return;
  key->stream.type = proto::POWER;
  key->seq = Draw(2) == 0 ? key->seq : key->seq + 1;
  SendRecord(target, *key, RecordLike(*key));
}

// --- False claims ---

void ByzantineAgent::Claim(AgentId target) {
  const std::optional<HaveSet> have = world_.HaveOf(target);
  if (!have) return;
  proto::HaveSet claimed;
  for (const auto& [key, stream] : have->streams()) {
    *claimed.add_streams() = StreamOf(key, 1, Draw(2) == 0 ? stream.Covered().Max() : kFarSeq, /*is_dropped=*/false);
  }
  const bool is_huge = Draw(4) == 0;
  for (int i = 0; i < (is_huge ? kHugeStreams : 1); ++i) {
    const StreamKey key{target, ~0ull - kHugeStreams + static_cast<std::uint64_t>(i), proto::POWER};
    *claimed.add_streams() = StreamOf(key, 1, kFarSeq, /*is_dropped=*/false);
  }
  for (const char* actor : {actor_name::kSync, actor_name::kReplica}) {
    proto::Message message;
    proto::Have& answer = *message.mutable_have();
    answer.set_session_id(sessions_[{target, actor}]);
    *answer.mutable_have() = claimed;
    answer.set_is_whole(Draw(2) == 0);
    answer.set_batch_number(static_cast<std::uint32_t>(Draw(4)));
    answer.set_unacked_bytes_max(8 * 1024);
    Send({target, actor}, actor, std::move(message));
  }
  proto::ControlReply reply;
  *reply.mutable_have()->mutable_have() = claimed;
  *reply.mutable_have()->mutable_roles() = RolesOf(target);
  proto::Message vouches = MessageOf(reply);
  vouches.set_request_id(rng_());
  Send({target, actor_name::kRetention}, actor_name::kRetention, std::move(vouches));
}

void ByzantineAgent::ClaimEpochs(AgentId target) {
  const std::optional<RecordKey> key = DrawKey(target, target);
  if (!key) return;
  const std::uint64_t highest = key->stream.epoch;
  proto::Message message;
  for (std::uint64_t shift = kCounterShift; shift < 64; ++shift) {
    const std::uint64_t epoch = highest + (1ull << shift) + 1;
    if (epoch > highest) message.mutable_epoch_report()->add_epochs(epoch);
  }
  message.mutable_epoch_report()->add_epochs(~0ull);
  Send({target, actor_name::kStorage}, actor_name::kStorage, std::move(message));
}

void ByzantineAgent::Replay(AgentId target) {
  for (std::uint64_t i = 0; i < 1 + Draw(kReplayedMax) && !seen_.empty(); ++i) {
    const Seen seen = seen_[Draw(seen_.size())];
    const AgentId to = Draw(2) == 0 || seen.to.agent == world_.byzantine ? target : seen.to.agent;
    proto::Message message = seen.message;
    const std::string actor = seen.to.actor;
    if (message.has_batch() && Draw(2) == 0) {
      SendBatch(to, message.batch());
    } else {
      Send({to, actor}, actor, std::move(message));
    }
  }
}

// --- Forged roles and commands ---

// Returns a forged role assignment, in which the Byzantine agent is leader or survivor. Its term is higher than the
// target's present term. In a team with keys, the Byzantine agent signs it.
proto::RoleAssignment ByzantineAgent::Assignment(AgentId target) {
  const proto::RoleAssignment present = RolesOf(target);
  const bool has_keys = HasSigningKeys(world_.config);
  const std::uint64_t number = present.term().number();
  proto::RoleAssignment roles;
  const bool begins_era = has_keys && Draw(2) == 0;
  roles.mutable_term()->set_number(begins_era ? TermNumber(EraOf(present.term()) + 1 + Draw(100), 0)
                                              : number + 1 + Draw(100));
  roles.mutable_term()->set_issuer(world_.byzantine);
  roles.mutable_term()->set_issuer_epoch(rng_() | 1);
  const AgentId other = DrawHonestBut(world_.base);
  const bool leads = Draw(2) == 0;
  roles.set_leader(leads ? world_.byzantine : other);
  roles.set_survivor(leads ? other : world_.byzantine);
  roles.set_reason(kByzantineReason);
  if (!has_keys) return roles;
  roles.set_follows(present.signature());
  if (Draw(4) == 0) roles.mutable_term()->set_issuer(present.leader());  // Wrong issuer: the Byzantine agent signs.
  roles.set_signature(SigningKeyOf(world_.byzantine).Sign(SignedBytes(world_.config, roles)));
  return roles;
}

void ByzantineAgent::Announce(AgentId target) {
  const proto::RoleAssignment roles = Assignment(target);
  if (Draw(3) == 0) {
    proto::Record record;
    *record.mutable_role_assignment() = roles;
    return SendRecord(target, {{world_.byzantine, rng_() >> 1, proto::ROLE_ASSIGNMENT}, 1}, record);
  }
  proto::Message message;
  if (Draw(4) == 0) {
    *message.mutable_role_chain_reply()->add_chain() = roles;
  } else {
    *message.mutable_role_announce()->mutable_roles() = roles;
    message.mutable_role_announce()->set_is_reply(Draw(2) == 0);
  }
  Send({target, actor_name::kRole}, actor_name::kRole, std::move(message));
}

proto::ControlRequest ByzantineAgent::DrawOrder(AgentId target) {
  proto::ControlRequest request;
  switch (Draw(7)) {
    case 0:
      request.mutable_role_set()->set_leader(world_.byzantine);
      request.mutable_role_set()->set_survivor(DrawHonestBut(world_.base));
      request.mutable_role_set()->set_reason(kByzantineReason);
      break;
    case 1:
      request.mutable_prune()->set_older_than_s(0);
      request.mutable_prune()->add_data_types(proto::POSE_GRAPH_NODE);
      break;
    case 2:
      request.mutable_stop();
      break;
    case 3:
      request.mutable_share()->set_kind(proto::SHARING_KIND_SYNC);
      request.mutable_share()->set_destination(world_.byzantine);
      break;
    case 4:
      *request.mutable_insert()->add_records() = RecordLike({{target, 1, proto::POWER}, 1});
      checker_.OnForged(request.insert().records(0));
      break;
    case 5:
      request.mutable_lease()->set_kind(proto::LEASE_KIND_SLEEPING);
      request.mutable_lease()->set_seconds(86'400);
      break;
    default:
      request.mutable_optimize();
  }
  return request;
}

void ByzantineAgent::Order(AgentId target) {
  proto::ControlRequest request = DrawOrder(target);
  request.set_for_agent(target);
  request.set_by(kBy);
  request.set_team_id(TeamIdBytes(world_.config.team_id()));
  proto::Message message = MessageOf(request);
  message.set_request_id(rng_());
  message.set_client_rights(proto::CLIENT_RIGHTS_NONE);
  Send({target, actor_name::kGateway}, actor_name::kGateway, std::move(message));
}

void ByzantineAgent::OrderToShare(AgentId target) {
  const bool is_sync = Draw(2) == 0;
  const char* actor = is_sync ? actor_name::kSync : actor_name::kReplica;
  proto::Message message;
  proto::ShareRequest& request = *message.mutable_share_request();
  request.set_kind(is_sync ? proto::SHARING_KIND_SYNC : proto::SHARING_KIND_REPLICATION);
  request.set_destination(Draw(2) == 0 ? world_.byzantine : DrawHonest());
  if (Draw(2) == 0) request.add_from_agents(DrawHonest());
  request.set_order(rng_());
  Send({target, actor}, actor, std::move(message));
}

// --- Floods and dense graphs ---

void ByzantineAgent::Flood(AgentId target) {
  static constexpr const char* kActors[] = {actor_name::kStorage, actor_name::kSync,     actor_name::kReplica,
                                            actor_name::kRole,    actor_name::kLease,    actor_name::kRetention,
                                            actor_name::kEvent,   actor_name::kPgo,      actor_name::kMerge,
                                            actor_name::kGateway, actor_name::kDownlink, "no such actor"};
  for (int i = 0; i < kFloodMessages; ++i) {
    const char* actor = kActors[Draw(std::size(kActors))];
    Send({target, actor}, Draw(2) == 0 ? actor : "flood", DrawGarbage(rng_));
  }
}

// Sends a dense graph: odometry between all pairs of kDenseNodes nodes. Stores accept the records, because all nodes
// belong to the sender.
void ByzantineAgent::JoinAll(AgentId target) {
  if (dense_count_ == kDenseMax) return;
  ++dense_count_;
  const std::uint64_t epoch = rng_() >> 1;
  const std::uint64_t first_index = kFarSeq + Draw(1000) * kDenseNodes;
  std::vector<std::pair<RecordKey, proto::Record>> records;
  std::uint64_t edge_count = 0;
  for (std::uint64_t i = 0; i < kDenseNodes; ++i) {
    proto::Record node;
    node.set_timestamp_ns(world_.ClockOf(target));
    node.mutable_pose_graph_node()->mutable_node()->set_agent_id(world_.byzantine);
    node.mutable_pose_graph_node()->mutable_node()->set_index(first_index + i);
    node.mutable_pose_graph_node()->mutable_map_from_node()->mutable_position_m()->set_x(static_cast<double>(i));
    node.mutable_pose_graph_node()->mutable_map_from_node()->mutable_orientation()->set_w(1);
    for (std::uint64_t j = 0; j < i; ++j) {
      proto::Record joins;
      joins.set_timestamp_ns(node.timestamp_ns());
      proto::PoseGraphEdge& edge = *joins.mutable_pose_graph_edge();
      *edge.mutable_from() = node.pose_graph_node().node();
      edge.mutable_from()->set_index(first_index + j);
      *edge.mutable_to() = node.pose_graph_node().node();
      SetRelativePose(static_cast<double>(i - j), /*variance=*/0.01, *edge.mutable_relative_pose());
      records.push_back({{{world_.byzantine, epoch, proto::POSE_GRAPH_EDGE}, ++edge_count}, joins});
    }
    records.push_back({{{world_.byzantine, epoch, proto::POSE_GRAPH_NODE}, i + 1}, node});
  }
  SendRecords(target, records);
}

}  // namespace moondb::simulation
