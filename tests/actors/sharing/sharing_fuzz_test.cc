// Tests sharing with input that no correct agent sends. Sessions, receivers and stores first receive damaged, forged,
// repeated and invented messages among the correct ones, then only correct messages. Each test prints its first seed,
// which MOONDB_FUZZ_SEED sets. MOONDB_FUZZ_RUNS sets the number of conversations (default 100).
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <deque>
#include <iostream>
#include <map>
#include <random>

#include "actors/lease/lease_actor.h"
#include "actors/role/role_actor.h"
#include "actors/sharing/codec.h"
#include "actors/sharing/sharing_receiver.h"
#include "actors/sharing/sharing_session.h"
#include "actors/storage/record_store.h"
#include "actors/storage/record_validator.h"
#include "actors/storage/storage_actor.h"
#include "model/record_hash.h"
#include "model/wire_version.h"
#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/mutator.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

constexpr AgentId kReceiver = 1;
constexpr AgentId kSender = 2;
// One message may cause at most kActionsMax actions. A reply from storage may have at most kHaveBytesMax bytes.
constexpr std::size_t kActionsMax = 32;
constexpr std::size_t kHaveBytesMax = 64 * 1024;

std::uint64_t NumberOf(const char* variable, std::uint64_t standard) {
  const char* asked = std::getenv(variable);
  return asked == nullptr ? standard : std::strtoull(asked, nullptr, 10);
}

std::uint64_t RunCount() { return NumberOf("MOONDB_FUZZ_RUNS", 100); }

std::uint64_t FirstSeed() {
  const std::uint64_t seed = NumberOf("MOONDB_FUZZ_SEED", std::random_device()());
  std::cout << "first seed " << seed << "\n";
  return seed;
}

std::unique_ptr<RecordStore> MemoryStoreOf(AgentId self, std::uint64_t seed) {
  StorageActor::Options options;
  options.path = ":memory:";
  options.self = self;
  options.team = TestTeam(3);
  RecordStore::Options store = StorageActor::StoreOptions(options);
  store.seed = seed;
  return *RecordStore::Open(std::move(store));
}

proto::Record NodeOf(AgentId agent, std::uint64_t index) {
  proto::Record record;
  record.set_timestamp_ns(1);
  record.mutable_pose_graph_node()->mutable_node()->set_agent_id(agent);
  record.mutable_pose_graph_node()->mutable_node()->set_index(index);
  record.mutable_pose_graph_node()->mutable_map_from_node()->mutable_position_m();
  record.mutable_pose_graph_node()->mutable_map_from_node()->mutable_orientation()->set_w(1);
  return record;
}

proto::Record PowerOf(double ratio) {
  proto::Record record;
  record.set_timestamp_ns(1);
  record.mutable_power()->set_battery_ratio(ratio);
  return record;
}

// Returns a map that is too large for one message and is sent in fragments.
proto::Record LargeMapOf(AgentId agent, std::uint64_t index, Mutator& mutator) {
  constexpr std::uint32_t kSide = 256;
  proto::Record record;
  record.set_timestamp_ns(1);
  proto::LocalTraversabilityMap& map = *record.mutable_local_traversability_map();
  map.mutable_node()->set_agent_id(agent);
  map.mutable_node()->set_index(index);
  map.mutable_node_from_map()->mutable_position_m();
  map.mutable_node_from_map()->mutable_orientation()->set_w(1);
  proto::MapLayer& layer = *map.add_layers();
  layer.set_width_cells(kSide);
  layer.set_height_cells(kSide);
  layer.set_resolution_um(100'000);
  for (std::uint32_t i = 0; i < kSide * kSide / 4; ++i)
    layer.mutable_cells()->push_back("\x04\x19\x26\x55"[mutator.Draw(4)]);
  return record;
}

std::map<RecordKey, std::string> SharedOf(RecordStore& store) {
  std::map<RecordKey, std::string> shared;
  proto::ReadRequest request;
  while (true) {
    const Result<proto::ReadReply> page = store.Read(request);
    for (const proto::StoredRecord& record : page->records()) {
      if (record.key().seq() != 0) shared[FromProto(record.key())] = record.content();
    }
    if (page->is_complete()) return shared;
    request.set_after_row_id(*page->row_ids().rbegin());
  }
}

// A session of agent 2 and a receiver of agent 1, each with a store. The class loses, changes or delivers the messages
// between them.
class Conversation {
 public:
  explicit Conversation(std::uint64_t seed)
      : mutator_(seed),
        source_(MemoryStoreOf(kSender, seed)),
        sink_(MemoryStoreOf(kReceiver, seed)),
        receiver_(ReceiverOptions(seed), 500) {
    for (const AgentId agent : {kReceiver, kSender}) {
      proto::InsertRequest request;
      for (std::uint64_t i = 0; i < 200; ++i) *request.add_records() = NodeOf(agent, i);
      for (int i = 0; i < 5; ++i) *request.add_records() = PowerOf(0.1 * i);
      for (std::uint64_t i = 0; i < 2; ++i) *request.add_records() = LargeMapOf(agent, i, mutator_);
      RecordStore& store = agent == kSender ? *source_ : *sink_;
      EXPECT_FALSE(IsError(store.Insert(request).reply.error()));
      genuine_.merge(SharedOf(store));
    }
  }

  void Order() { TakeOfSession(session_.Order(proto::RecordFilter(), now_)); }

  // Loses, delivers, repeats or damages a message that is in flight, or delivers an invented message.
  void BadStep() {
    now_ += std::chrono::milliseconds(50);
    TakeOfSession(session_.OnTimer(now_));
    if (air_.empty() || mutator_.Draw(4) == 0) return Deliver(Invent());
    Flying flying = TakeFromAir();
    switch (mutator_.Draw(8)) {
      case 0:
        return;  // The message is lost.
      case 1:
        Deliver(flying);
        return Deliver(flying);
      case 2:
        return Deliver(flying);
      case 3: {
        std::string bytes = flying.message.SerializeAsString();
        mutator_.Mutate(bytes);
        if (flying.message.ParseFromString(bytes)) Deliver(flying);
        return;
      }
      case 4:
        ForgeRecords(flying.message);
        return Deliver(flying);
      default:
        mutator_.Mutate(flying.message);
        return Deliver(flying);
    }
  }

  // Discards the messages in flight and gives the session a new order to share. Then delivers all messages unchanged.
  // Returns true if the session completes.
  bool GoodEnd() {
    air_.clear();
    TakeOfSession(session_.Close());
    air_.clear();
    Order();
    for (int i = 0; i < 10'000 && session_.is_open(); ++i) {
      now_ += std::chrono::milliseconds(10);
      if (air_.empty()) {
        TakeOfSession(session_.OnTimer(now_));
      } else {
        const Flying flying = std::move(air_.front());
        air_.pop_front();
        Deliver(flying);
      }
    }
    return !session_.is_open();
  }

  void ExpectOnlyGenuineRecords() {
    for (RecordStore* store : {source_.get(), sink_.get()}) {
      for (const auto& [key, content] : SharedOf(*store)) EXPECT_TRUE(IsGenuine(key, content)) << ToString(key);
    }
  }

  void ExpectAllThatTheSenderHolds() {
    const auto at_sink = SharedOf(*sink_);
    for (const auto& [key, content] : SharedOf(*source_)) EXPECT_TRUE(at_sink.contains(key)) << ToString(key);
  }

  double Refusals() const {
    const SharingReceiver::Counts& counts = receiver_.counts();
    return session_.Status(now_).refused_haves() + counts.refused_hellos + counts.damaged_messages +
           counts.rejected_records + counts.dropped_messages;
  }

 private:
  struct Flying {
    AgentId to;
    proto::Message message;
  };

  // Returns true if a correct agent wrote this content under this key. A POWER record may have another key of the same
  // origin, because an agent reissues its states under new keys when it learns of a higher epoch of its own.
  bool IsGenuine(const RecordKey& key, const std::string& content) const {
    const auto found = genuine_.find(key);
    if (found != genuine_.end()) return found->second == content;
    if (key.stream.type != proto::POWER) return false;
    return std::any_of(genuine_.begin(), genuine_.end(), [&](const auto& genuine) {
      return genuine.first.stream.origin == key.stream.origin && genuine.second == content;
    });
  }

  // With one seed in four, the receiver sends its have-set in pages of one or two streams.
  static SharingReceiver::Options ReceiverOptions(std::uint64_t seed) {
    SharingReceiver::Options options;
    options.team = "test";
    options.kind = proto::SHARING_KIND_REPLICATION;
    if (seed % 4 == 0) options.have_page_bytes_max = 40;
    return options;
  }

  Flying TakeFromAir() {
    const auto at = air_.begin() + static_cast<std::ptrdiff_t>(mutator_.Draw(air_.size()));
    Flying flying = std::move(*at);
    air_.erase(at);
    return flying;
  }

  // Returns a mutation of an earlier message, a mutated new message, or noise.
  Flying Invent() {
    Flying flying{mutator_.Draw(2) == 0 ? kReceiver : kSender, {}};
    if (mutator_.Draw(3) == 0) {
      (void)flying.message.ParseFromString(mutator_.Bytes(400));
      return flying;
    }
    if (!heard_.empty() && mutator_.Draw(3) > 0) {
      flying = heard_[mutator_.Draw(heard_.size())];
    } else if (flying.to == kReceiver) {
      mutator_.Draw(2) == 0 ? (void)flying.message.mutable_hello() : (void)flying.message.mutable_batch();
    } else if (mutator_.Draw(3) > 0) {
      flying.message.mutable_have()->set_session_id(session_id_);
      flying.message.mutable_have()->set_is_whole(mutator_.Draw(2) == 0);
    } else {
      flying.message.mutable_refusal()->set_session_id(session_id_);
      flying.message.mutable_refusal()->mutable_error()->set_text(mutator_.Bytes(2000));
    }
    mutator_.Mutate(flying.message);
    return flying;
  }

  // Forges each record of a batch: mutates its content or other fields, or replaces the record. The replacement has a
  // valid hash and claims to be the receiver's own, in its present epoch or in the highest possible epoch.
  void ForgeRecords(proto::Message& message) {
    proto::Batch& batch = *message.mutable_batch();
    Result<proto::RecordBatch> records = DecodeBatch(batch.codec(), batch.coded(), batch.record_count());
    if (!records) return;
    for (proto::StoredRecord& record : *records->mutable_records()) {
      switch (mutator_.Draw(4)) {
        case 0:
          mutator_.Mutate(*record.mutable_content());
          break;
        case 1:
          mutator_.Mutate(record);
          break;
        default: {
          const std::uint64_t index = 1000 + mutator_.Draw(1000);
          record.mutable_key()->set_origin_agent(kReceiver);
          record.mutable_key()->set_epoch(mutator_.Draw(2) == 0 ? sink_->GetHave().epoch() : UINT64_MAX);
          record.mutable_key()->set_seq(index);
          record.set_content(SerializeRecord(NodeOf(kReceiver, index)));
          record.mutable_key()->set_data_type(proto::POSE_GRAPH_NODE);
          record.set_hash(HashRecord(FromProto(record.key()), record.content()));
        }
      }
    }
    CodedBatch coded = EncodeBatch(*records);
    batch.set_codec(coded.codec);
    batch.set_coded(std::move(coded.bytes));
  }

  void Deliver(const Flying& flying) {
    if (heard_.size() < 100) heard_.push_back(flying);
    const proto::Message& message = flying.message;
    if (flying.to == kReceiver) {
      if (message.has_hello()) TakeOfReceiver(receiver_.OnHello(kSender, message.hello(), now_));
      if (message.has_batch()) {
        Result<SharingActions> actions = receiver_.OnBatch(kSender, message, now_);
        if (actions) TakeOfReceiver(*std::move(actions));
      }
    } else {
      if (message.has_have()) TakeOfSession(session_.OnHave(message.have(), now_));
      if (message.has_refusal()) TakeOfSession(session_.OnRefusal(message.refusal(), now_));
    }
    EXPECT_LT(session_.Status(now_).ByteSizeLong(), 1024u);
  }

  void TakeOfReceiver(SharingActions actions) {
    ASSERT_LE(actions.size(), kActionsMax);
    for (SharingAction& action : actions) {
      proto::Message& message = action.message;
      if (action.to != 0) {
        air_.push_back({action.to, std::move(message)});
      } else if (message.has_have_request()) {
        const proto::HaveReply reply = sink_->GetHave(message.have_request());
        ASSERT_LE(reply.ByteSizeLong(), kHaveBytesMax);
        TakeOfReceiver(receiver_.OnHaveReply(message.request_id(), reply));
      } else if (message.has_store_request()) {
        const proto::StoreReply reply = sink_->Store(message.store_request()).reply;
        EXPECT_FALSE(IsError(reply.error())) << reply.error().ShortDebugString();
        ASSERT_LE(reply.ByteSizeLong(), kHaveBytesMax);
        TakeOfReceiver(receiver_.OnStoreReply(message.request_id(), reply));
      }
    }
  }

  void TakeOfSession(SharingActions actions) {
    ASSERT_LE(actions.size(), kActionsMax);
    for (SharingAction& action : actions) {
      proto::Message& message = action.message;
      if (message.has_hello()) {  // Adds the fields that SharingActor sets.
        message.mutable_hello()->set_wire_version(kWireVersion);
        message.mutable_hello()->set_team("test");
        session_id_ = message.hello().session_id();
      }
      if (action.to != 0) {
        air_.push_back({action.to, std::move(message)});
      } else if (message.has_missing_request()) {
        const Result<proto::MissingReply> reply = source_->GetMissing(message.missing_request());
        ASSERT_TRUE(reply) << ToString(reply.error());
        TakeOfSession(session_.OnMissingReply(message.request_id(), *reply, now_));
      } else if (message.has_peer_have()) {
        const Result<bool> noted = source_->ObservePeerHave(message.peer_have());
        ASSERT_TRUE(noted) << ToString(noted.error());
        EXPECT_TRUE(*noted) << "no note was lost";
      }
    }
    while (air_.size() > 200) air_.pop_front();
  }

  Mutator mutator_;
  std::unique_ptr<RecordStore> source_;
  std::unique_ptr<RecordStore> sink_;
  std::map<RecordKey, std::string> genuine_;
  SharingSession session_{SharingSession::Options(), proto::SHARING_KIND_REPLICATION, kReceiver, 1000};
  SharingReceiver receiver_;
  SharingSession::Time now_{};
  std::uint64_t session_id_ = 0;  // Session id of the session's last Hello.
  std::deque<Flying> air_;
  std::vector<Flying> heard_;
};

TEST(SharingFuzzTest, AConversationSurvivesBadMessagesAndThenCompletes) {
  const std::uint64_t first_seed = FirstSeed();
  double refusals = 0;
  for (std::uint64_t seed = first_seed; seed < first_seed + RunCount(); ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Conversation conversation(seed);
    conversation.Order();
    for (int i = 0; i < 200; ++i) conversation.BadStep();
    ASSERT_TRUE(conversation.GoodEnd());
    conversation.ExpectOnlyGenuineRecords();
    conversation.ExpectAllThatTheSenderHolds();
    refusals += conversation.Refusals();
    if (testing::Test::HasFailure()) return;
  }
  // Six sets of 100 seeds had 10 to 29 refusals per conversation.
  EXPECT_GT(refusals, 3 * static_cast<double>(RunCount())) << "most messages were bad";
}

// Returns the bodies in proto/message.proto that agents send to each other.
std::vector<const google::protobuf::FieldDescriptor*> BodiesBetweenAgents() {
  std::vector<const google::protobuf::FieldDescriptor*> bodies;
  const google::protobuf::OneofDescriptor& all = *proto::Message::descriptor()->FindOneofByName("body");
  for (int i = 0; i < all.field_count(); ++i) {
    const int number = all.field(i)->number();
    if (number >= proto::Message::kHello && number <= proto::Message::kLeaderCheck) bodies.push_back(all.field(i));
  }
  return bodies;
}

// Agent 3 (kBad) sends mutated messages to agent 1. Afterwards agent 2 must still be able to sync to agent 1.
TEST(SharingFuzzTest, ActorsSurviveAPeerThatSendsAnything) {
  const std::uint64_t first_seed = FirstSeed();
  const proto::TeamConfig config = TestTeam(3);
  constexpr AgentId kBad = 3;
  constexpr const char* kActors[] = {actor_name::kSync, actor_name::kReplica, actor_name::kRole, actor_name::kLease};
  const std::vector<const google::protobuf::FieldDescriptor*> bodies = BodiesBetweenAgents();
  for (std::uint64_t seed = first_seed; seed < first_seed + RunCount() / 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Mutator mutator(seed);
    simulation::SimulatedTeam team(seed);
    for (AgentId agent = 1; agent <= 3; ++agent) team.AddAgent(agent);
    for (const AgentId agent : {kReceiver, kSender}) {
      StorageActor::Options storage;
      storage.path = ":memory:";
      storage.self = agent;
      storage.team = config;
      team.Spawn(agent, actor_name::kStorage, [storage] { return std::make_unique<StorageActor>(storage); });
      RoleActor::Options role;
      role.self = agent;
      role.team = config;
      team.Spawn(agent, actor_name::kRole, [role] { return std::make_unique<RoleActor>(role); });
      LeaseActor::Options lease;
      lease.self = agent;
      lease.team = config;
      team.Spawn(agent, actor_name::kLease, [lease] { return std::make_unique<LeaseActor>(lease); });
      SpawnSharing(team, agent, config);
    }
    team.AdvanceTime(minutes(1));
    for (int i = 0; i < 300; ++i) {
      proto::Message message;
      (void)message.GetReflection()->MutableMessage(&message, bodies[mutator.Draw(bodies.size())]);
      if (message.has_hello()) {
        message.mutable_hello()->set_wire_version(kWireVersion);
        message.mutable_hello()->set_team("test");
        message.mutable_hello()->set_kind(proto::SHARING_KIND_SYNC);
        message.mutable_hello()->set_session_id(1 + mutator.Draw(3));
      }
      mutator.Mutate(message);
      for (const char* actor : kActors) {
        (void)team.Post({kBad, actor}, {kReceiver, actor}, message);
      }
      team.AdvanceTime(std::chrono::milliseconds(20));
      for (const char* actor : kActors) {
        EXPECT_LE(team.TakeMessages({kBad, actor}).size(), 16u) << "many answers to one message";
      }
    }
    EXPECT_EQ(team.restarts(kReceiver), 0u);
    proto::Message insert;
    for (std::uint64_t i = 0; i < 50; ++i) *insert.mutable_insert_request()->add_records() = NodeOf(kSender, i);
    (void)team.Post({kSender, "robot"}, {kSender, actor_name::kStorage}, insert);
    Share(team, kSender, ShareOrder(proto::SHARING_KIND_SYNC, kReceiver));
    team.AdvanceTime(minutes(2));
    const proto::ShareStatus status = ShareStatusOf(team, kSender, actor_name::kSync);
    ASSERT_EQ(status.sessions_size(), 1);
    EXPECT_EQ(status.sessions(0).acknowledged_records(), 50) << status.ShortDebugString();
    EXPECT_FALSE(status.sessions(0).is_open());
    if (testing::Test::HasFailure()) return;
  }
}

}  // namespace
}  // namespace moondb
