// Tests the notes that sessions send to storage about their peers' have-sets. The real storage keeps the notes and
// shows them in a view.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <random>
#include <string>
#include <utility>

#include "actors/sharing/peer_notes.h"
#include "actors/storage/peer_log.h"
#include "actors/storage/storage_actor.h"
#include "model/record_hash.h"
#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/sharing_team.h"
#include "tests/actors/storage/peer_have_rows.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using simulation::Fault;
using std::chrono::minutes;

constexpr AgentId kLogSelf = 1;
constexpr AgentId kPeer = 2;

// Delivers a session's notes about a peer to a PeerLog. Some notes are lost, some writes fail, and the PeerLog restarts
// at random.
class NotesOverTime {
 public:
  explicit NotesOverTime(std::uint64_t seed) : rng_(seed) { Restart(); }

  void Step() {
    SharingActions actions;
    const auto what = rng_() % 16;
    // A session begins. In one of four cases its destination has lost its disk.
    if (what == 0) {
      if (rng_() % 4 == 0) have_ = HaveSet();
      notes_.ObserveAnswer(have_, {}, actions);
    } else if (what == 1) {
      Restart();
    } else {
      const HaveSet heard = AnyNews();
      notes_.ObserveAcknowledged(heard, have_, actions);
      have_.Merge(heard);
    }
    if (rng_() % 4 != 0) Deliver(actions);
    ExpectTruth();
  }

  // Sends a note and delivers it. The note is not lost, and the database is writable.
  void ObserveOnce() {
    SharingActions actions;
    HaveSet news;
    news[Any()].held.Add(++fresh_);
    notes_.ObserveAcknowledged(news, have_, actions);
    have_.Merge(news);
    is_writable_ = true;
    Deliver(actions);
    ExpectTruth();
  }

  const HaveSet& have() const { return have_; }
  Covered Shown() { return ShownIn(store_->database(), kPeer); }
  int requests() const { return requests_; }

 private:
  static std::unique_ptr<RecordStore> Store() {
    RecordStore::Options options;
    options.path = ":memory:";
    options.self = kLogSelf;
    options.team = {kLogSelf, kPeer, 3};
    return *RecordStore::Open(std::move(options));
  }

  // Replaces the PeerLog by one that reads the stored notes, as a restart does.
  void Restart() {
    log_ = PeerLog();
    ASSERT_TRUE(log_.Load(store_->database()));
  }

  StreamKey Any() { return {3, 1 + rng_() % 40, proto::POSE_GRAPH_NODE}; }

  // Returns the have-set of an acknowledgment: one to three random streams with new records. Each stream also contains
  // the records already known.
  HaveSet AnyNews() {
    HaveSet heard;
    for (auto streams = rng_() % 3 + 1; streams > 0; --streams) {
      const StreamKey stream = Any();
      heard[stream] = have_.Get(stream);
      const std::uint64_t first = 1 + rng_() % 60;
      HaveSet added;
      IntervalSet& set = rng_() % 3 == 0 ? added[stream].dropped : added[stream].held;
      set.Add({first, first + rng_() % 3});
      heard.Merge(added);
    }
    return heard;
  }

  void Deliver(const SharingActions& actions) {
    for (const SharingAction& action : actions) {
      is_writable_ = is_writable_ ? rng_() % 8 != 0 : rng_() % 2 == 0;
      ASSERT_TRUE(store_->database().Execute(is_writable_ ? "PRAGMA query_only = OFF" : "PRAGMA query_only = ON"));
      const Result<bool> noted = log_.Store(store_->database(), action.message.peer_have());
      ASSERT_TRUE(store_->database().Execute("PRAGMA query_only = OFF"));
      if (!noted) continue;
      if (*noted) {
        taken_ = HadOf(have_);
      } else {
        ++requests_;
        SharingActions again;
        notes_.ObserveAllAgain(action.message.request_id(), have_, {}, again);
        Deliver(again);
      }
    }
  }

  // Expects that the view shows the have-set as of the last note that the PeerLog accepted.
  void ExpectTruth() { EXPECT_EQ(Shown(), taken_); }

  std::mt19937_64 rng_;
  const std::unique_ptr<RecordStore> store_ = Store();
  PeerLog log_;
  PeerNotes notes_{proto::SHARING_KIND_SYNC, kPeer, rng_() >> 1};
  HaveSet have_;
  Covered taken_;
  std::uint64_t fresh_ = 1000;
  bool is_writable_ = true;
  int requests_ = 0;
};

TEST(ReplicationLogTest, DifferencesAddUpToTheWholeHaveSetWhateverIsLost) {
  int requests = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    NotesOverTime time(seed);
    for (int i = 0; i < 300 && !testing::Test::HasFailure(); ++i) time.Step();
    for (int i = 0; i < 30 && time.Shown() != HadOf(time.have()); ++i) time.ObserveOnce();
    EXPECT_EQ(time.Shown(), HadOf(time.have()));
    requests += time.requests();
  }
  EXPECT_GT(requests, 100);
}

// Agent 1 leads and replicates to agent 2. In both stores, records of `epochs` earlier epochs of agent 3 are marked as
// dropped. The dropped seqs of each epoch have gaps.
class ReplicatingTeam {
 public:
  explicit ReplicatingTeam(std::uint64_t epochs) : team_(/*seed=*/1) {
    for (const AgentId agent : {kLogSelf, kPeer}) {
      team_.AddAgent(agent);
      StorageActor::Options storage;
      storage.path = PathOf(agent);
      storage.self = agent;
      storage.team = config_;
      team_.Spawn(agent, actor_name::kStorage, [storage] { return std::make_unique<StorageActor>(storage); });
      SpawnSharing(team_, agent, config_);
      StoreOldEpochs(agent, epochs);
    }
    team_.RecordSent({kLogSelf, actor_name::kReplica});
    team_.RecordSent({kLogSelf, actor_name::kStorage});
  }

  // Inserts nodes with random positions, which do not compress, into agent 1's store.
  void InsertNodes(int count) {
    proto::Message message;
    for (int i = 0; i < count; ++i) {
      proto::PoseGraphNode& node = *message.mutable_insert_request()->add_records()->mutable_pose_graph_node();
      node.mutable_node()->set_agent_id(kLogSelf);
      node.mutable_node()->set_index(next_index_++);
      proto::Pose& pose = *node.mutable_map_from_node();
      pose.mutable_position_m()->set_x(place_(rng_));
      pose.mutable_position_m()->set_y(place_(rng_));
      pose.mutable_position_m()->set_z(place_(rng_));
      pose.mutable_orientation()->set_w(1);
    }
    Post(kLogSelf, std::move(message));
  }

  void Replicate() {
    EXPECT_FALSE(IsError(Share(team_, kLogSelf, ShareOrder(proto::SHARING_KIND_REPLICATION, kPeer)).error()));
    team_.AdvanceTime(minutes(2));
    const proto::ShareStatus status = ShareStatusOf(team_, kLogSelf, actor_name::kReplica);
    EXPECT_FALSE(status.sessions(0).is_open()) << status.ShortDebugString();
  }

  HaveSet HaveOfPeer() {
    proto::Message question;
    question.mutable_have_request();
    (void)team_.Post({kPeer, "test"}, {kPeer, actor_name::kStorage}, question);
    team_.RunUntilIdle();
    return *FromProto(team_.TakeMessages({kPeer, "test"}).at(0).have_reply().have());
  }

  // Stops both agents. Returns the records that agent 2 covers according to agent 1's database.
  Covered EndAndShow() {
    for (const AgentId agent : {kLogSelf, kPeer}) team_.Crash(agent);
    const Result<std::unique_ptr<Database>> database = Database::Open(PathOf(kLogSelf));
    EXPECT_TRUE(database);
    return ShownIn(**database, kPeer);
  }

  simulation::SimulatedTeam& team() { return team_; }
  std::vector<proto::Message> TakeSentByReplica() { return team_.TakeSent({kLogSelf, actor_name::kReplica}); }
  std::vector<proto::Message> TakeSentByStorage() { return team_.TakeSent({kLogSelf, actor_name::kStorage}); }

 private:
  std::string PathOf(AgentId agent) const { return folder_.File("agent" + std::to_string(agent) + ".db"); }

  // Stores agent 3's newest state at `agent`, and marks the records of agent 3's earlier epochs as dropped, because
  // that state superseded them.
  void StoreOldEpochs(AgentId agent, std::uint64_t epochs) {
    proto::Message message;
    proto::StoreRequest& request = *message.mutable_store_request();
    request.set_sender(3);
    for (std::uint64_t epoch = 1; epoch <= epochs; ++epoch) {
      proto::StreamHave& stream = *request.add_dropped();
      stream.set_origin_agent(3);
      stream.set_epoch(epoch << 48 | 1);
      stream.set_data_type(proto::POWER);
      for (std::uint64_t first = 1; first < 100; first += 20) {
        proto::Interval& interval = *stream.add_dropped();
        interval.set_first(first);
        interval.set_last(first + 9);
      }
    }
    proto::Record state;
    state.mutable_power()->set_battery_ratio(0.5);
    const RecordKey key{{3, (epochs + 1) << 48 | 1, proto::POWER}, 1};
    proto::StoredRecord& stored = *request.add_records();
    *stored.mutable_key() = ToProto(key);
    stored.set_content(state.SerializeAsString());
    stored.set_hash(HashRecord(key, stored.content()));
    Post(agent, std::move(message));
  }

  void Post(AgentId agent, proto::Message message) {
    EXPECT_EQ(team_.Post({agent, "test"}, {agent, actor_name::kStorage}, std::move(message)), SendResult::kAccepted);
    team_.RunUntilIdle();
    for (const proto::Message& reply : team_.TakeMessages({agent, "test"})) {
      EXPECT_FALSE(IsError(reply.insert_reply().error())) << reply.ShortDebugString();
      EXPECT_EQ(reply.store_reply().rejected_count(), 0u);
      EXPECT_FALSE(IsError(reply.store_reply().error())) << reply.ShortDebugString();
    }
  }

  const TemporaryFolder folder_;
  const proto::TeamConfig config_ = TestTeam(3);
  std::uint64_t next_index_ = 0;
  std::mt19937_64 rng_{1};
  std::uniform_real_distribution<double> place_{-1000, 1000};
  simulation::SimulatedTeam team_;
};

TEST(ReplicationLogTest, ShowsThePeersHaveSetAfterStorageFailedAndRequestedIt) {
  ReplicatingTeam team(/*epochs=*/20);
  for (int i = 0; i < 10; ++i) team.InsertNodes(300);
  int notes = 0;
  team.team().SetFault([&notes](const Address& actor, const proto::Message& message) {
    if (actor != Address{kLogSelf, actor_name::kStorage} || !message.has_peer_have()) return Fault::kNone;
    ++notes;
    return notes == 4 ? Fault::kBeforeHandler : notes == 9 ? Fault::kAfterHandler : Fault::kNone;
  });
  team.Replicate();
  EXPECT_GT(notes, 12);
  EXPECT_EQ(team.team().restarts(kLogSelf), 2u);
  int requests = 0;
  for (const proto::Message& message : team.TakeSentByStorage()) requests += message.has_peer_have_request();
  EXPECT_GE(requests, 2);
  int wholes = 0;
  for (const proto::Message& message : team.TakeSentByReplica()) {
    wholes += message.peer_have().has_acknowledged() && !message.peer_have().is_difference();
  }
  EXPECT_EQ(wholes, 1 + 2) << "the answer to the Hello, and one for each restart that lacks it";
  const Covered covered = HadOf(team.HaveOfPeer());
  EXPECT_EQ(team.EndAndShow(), covered);
}

TEST(ReplicationLogTest, ANotesSizeDependsOnItsNewRecordsAndNotOnTheHaveSet) {
  ReplicatingTeam team(/*epochs=*/400);
  for (int i = 0; i < 10; ++i) team.InsertNodes(300);
  team.Replicate();
  std::size_t batches = 0;
  std::size_t note_bytes = 0;
  std::size_t largest = 0;
  for (const proto::Message& message : team.TakeSentByReplica()) {
    batches += message.has_batch();
    if (!message.has_peer_have()) continue;
    note_bytes += message.peer_have().ByteSizeLong();
    largest = std::max(largest, message.peer_have().ByteSizeLong());
  }
  ASSERT_GT(batches, 10u);
  ASSERT_GT(largest, 10'000u) << "the have-set itself";
  EXPECT_LT(note_bytes - largest, batches * 5000) << "the keys of a batch, and the seqs acknowledged";
  RecordProperty("note_bytes_per_batch", std::to_string(note_bytes / batches));
  std::printf("%zu batches, %zu bytes of notes, the largest %zu\n", batches, note_bytes, largest);
}

}  // namespace
}  // namespace moondb
