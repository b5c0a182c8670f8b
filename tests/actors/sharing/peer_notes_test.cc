#include "actors/sharing/peer_notes.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "proto/types.pb.h"
#include "tests/actors/sharing/session_fixture.h"

namespace moondb {
namespace {

constexpr std::uint64_t kEpochs = 300;
constexpr std::uint64_t kLater = UINT64_MAX;  // Higher than the number of any note that the session sends.

class PeerNotesTest : public SessionFixture {
 protected:
  // Inserts records of this agent's earlier epochs into both stores. Each epoch has a gap.
  void StoreOldEpochs() {
    for (std::uint64_t epoch = 1; epoch <= kEpochs; ++epoch) {
      for (MemoryStore* store : {&source_, &destination_}) {
        store->Insert(kSelf, proto::TEMPERATURE, "a", epoch);
        store->Drop(store->Insert(kSelf, proto::TEMPERATURE, "b", epoch));
        store->Insert(kSelf, proto::TEMPERATURE, "c", epoch);
      }
    }
  }

  std::vector<proto::PeerHave> TakeNotes() { return std::exchange(peer_haves_, {}); }
};

TEST_F(PeerNotesTest, NotesTheWholeHaveSetOnceAndThenOnlyDifferences) {
  StoreOldEpochs();
  for (int i = 0; i < 600; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(60));
  Order();
  AnswerHello();
  const std::vector<proto::Message> batches = RunToEnd();
  ASSERT_GT(batches.size(), 5u);
  const std::vector<proto::PeerHave> notes = TakeNotes();
  EXPECT_FALSE(notes[0].is_difference());
  EXPECT_EQ(notes[0].acknowledged().streams_size(), int(kEpochs));
  HaveSet noted = *FromProto(notes[0].acknowledged());
  std::uint64_t number = notes[0].number();
  for (std::size_t i = 1; i < notes.size(); ++i) {
    if (!notes[i].has_acknowledged()) continue;
    EXPECT_TRUE(notes[i].is_difference());
    EXPECT_EQ(notes[i].number(), ++number);
    EXPECT_LE(notes[i].acknowledged().streams_size(), 2) << "nodes, and the dropped in the last batch";
    noted.Merge(*FromProto(notes[i].acknowledged()));
  }
  for (const auto& [stream, have] : destination_.have().streams()) {
    EXPECT_EQ(noted.Get(stream).Covered(), have.Covered()) << ToString(RecordKey{stream, 0});
  }
  EXPECT_LE(notes.size(), 2 * batches.size() + 1);
  EXPECT_TRUE(notes.back().is_session_closed());
}

TEST_F(PeerNotesTest, EachStepOfTheSessionIsOneNote) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(60));
  Order();
  AnswerHello();
  TakeNotes();
  const proto::Message batch = TakeSent().front();
  const SharingActions actions = session_.OnHave(Store(batch), now_);
  const auto is_note = [](const SharingAction& action) { return action.message.has_peer_have(); };
  ASSERT_EQ(std::count_if(actions.begin(), actions.end(), is_note), 1);
  const proto::PeerHave& note = std::find_if(actions.begin(), actions.end(), is_note)->message.peer_have();
  EXPECT_TRUE(note.is_difference());
  EXPECT_GT(note.handed_over_size(), 0) << "the batch that the acknowledgment made room for";
}

TEST_F(PeerNotesTest, AnAcknowledgmentWithoutNewRecordsIsNotNoted) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(60));
  Order();
  AnswerHello();
  const proto::Have have = Store(TakeSent().front());
  Take(session_.OnHave(have, now_));
  TakeNotes();
  Take(session_.OnHave(have, now_));  // The radio delivers the acknowledgment twice.
  for (const proto::PeerHave& note : TakeNotes()) EXPECT_FALSE(note.has_acknowledged());
}

TEST_F(PeerNotesTest, NotesTheWholeHaveSetAgainWhenStorageRequestsIt) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(60));
  Order();
  AnswerHello();
  const proto::Message first = TakeSent().front();
  Acknowledge(first);
  const std::vector<proto::PeerHave> before = TakeNotes();
  Take(session_.OnPeerHaveRequest(kLater));
  const std::vector<proto::PeerHave> notes = TakeNotes();
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_FALSE(notes[0].is_difference());
  EXPECT_EQ(notes[0].kind(), proto::SHARING_KIND_SYNC);
  const StreamKey nodes{kSelf, 7, proto::POSE_GRAPH_NODE};
  EXPECT_EQ(FromProto(notes[0].acknowledged())->Get(nodes).Covered(), destination_.have().Get(nodes).Covered());
  std::uint64_t last_number = 0;
  int handed_over = 0;
  for (const proto::PeerHave& note : before) {
    last_number = std::max(last_number, note.number());
    handed_over += note.handed_over_size();
  }
  EXPECT_EQ(notes[0].number(), last_number + 1);
  EXPECT_EQ(notes[0].handed_over_size(), handed_over - int(first.batch().record_count())) << "the records in flight";
}

// If storage cannot use a note, it requests the whole have-set and names the note. The session ignores the request
// if it has sent the whole have-set after that note.
TEST_F(PeerNotesTest, IgnoresRequestsThatAnEarlierAnswerAlreadyCovers) {
  for (int i = 0; i < 300; ++i) source_.Insert(kSelf, proto::POSE_GRAPH_NODE, Noise(60));
  Order();
  AnswerHello();
  Acknowledge(TakeSent().front());
  const std::uint64_t unused = TakeNotes().back().number();
  Take(session_.OnPeerHaveRequest(unused));
  ASSERT_EQ(TakeNotes().size(), 1u);
  Take(session_.OnPeerHaveRequest(unused));
  EXPECT_TRUE(TakeNotes().empty());
  // Storage could not use a note that followed the reply, so storage did not receive the reply.
  Take(session_.OnPeerHaveRequest(unused + 2));
  EXPECT_EQ(TakeNotes().size(), 1u);
}

TEST_F(PeerNotesTest, NotesNothingBeforeTheDestinationAnswers) {
  Take(session_.OnPeerHaveRequest(kLater));
  Order();
  Take(session_.OnPeerHaveRequest(kLater));
  EXPECT_TRUE(TakeNotes().empty());
  AnswerHello();
  EXPECT_FALSE(TakeNotes().empty());
  // The session starts over, and does not know the destination's have-set until the destination answers.
  Take(session_.OnConnected(now_));
  Take(session_.OnPeerHaveRequest(kLater));
  EXPECT_TRUE(TakeNotes().empty());
}

TEST_F(PeerNotesTest, AClosedSessionStillNotesTheLastHaveSet) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  AnswerHello();
  RunToEnd();
  ASSERT_FALSE(session_.is_open());
  TakeNotes();
  Take(session_.OnPeerHaveRequest(kLater));
  const std::vector<proto::PeerHave> notes = TakeNotes();
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_TRUE(FromProto(notes[0].acknowledged())->Get({kSelf, 7, proto::POWER}).Covered().Contains(1));
}

TEST_F(PeerNotesTest, EachAnswerToAHelloIsNotedInFull) {
  source_.Insert(kSelf, proto::POWER, "p");
  Order();
  AnswerHello();
  Take(session_.OnConnected(now_));
  TakeNotes();
  AnswerHello();
  EXPECT_FALSE(TakeNotes().at(0).is_difference());
}

}  // namespace
}  // namespace moondb
