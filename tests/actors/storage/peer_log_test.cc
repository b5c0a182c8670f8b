#include "actors/storage/peer_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <utility>

#include "proto/types.pb.h"
#include "tests/actors/storage/peer_have_rows.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

using testing::IsEmpty;

constexpr AgentId kSelf = 2;
constexpr AgentId kPeer = 1;
const StreamKey kStream{kSelf, 7, proto::POSE_GRAPH_NODE};
const StreamKey kOther{3, 9, proto::POWER};

class PeerLogTest : public testing::Test {
 protected:
  Result<bool> Note(const proto::PeerHave& note) { return store_->ObservePeerHave(note); }

  static proto::PeerHave All(std::uint64_t number, const HaveSet& have, AgentId peer = kPeer) {
    proto::PeerHave note;
    note.set_peer(peer);
    note.set_kind(proto::SHARING_KIND_SYNC);
    note.set_number(number);
    *note.mutable_acknowledged() = ToProto(have);
    return note;
  }

  static proto::PeerHave Difference(std::uint64_t number, const HaveSet& have, AgentId peer = kPeer) {
    proto::PeerHave note = All(number, have, peer);
    note.set_is_difference(true);
    return note;
  }

  static HaveSet Held(const StreamKey& stream, std::uint64_t first, std::uint64_t last) {
    HaveSet have;
    have[stream].held.Add({first, last});
    return have;
  }

  Covered Shown(AgentId peer = kPeer) { return ShownIn(store_->database(), peer); }

  std::int64_t HandedOverCount() { return *store_->database().Number("SELECT count(*) FROM handed_over"); }

  TemporaryFolder folder_;
  std::unique_ptr<RecordStore> store_ = OpenStore(StoreOptionsOf(kSelf, folder_.File("a.db")));
};

TEST_F(PeerLogTest, ADifferenceAddsToThePeersRecords) {
  HaveSet have = Held(kStream, 3, 9);
  have[kOther].dropped.Add({1, 2});
  ASSERT_TRUE(*Note(All(10, have)));
  HaveSet news = Held(kStream, 1, 1);
  news[kStream].dropped.Add(2);
  news[kStream].held.Add(12);
  ASSERT_TRUE(*Note(Difference(11, news)));
  have.Merge(news);
  EXPECT_EQ(Shown(), HadOf(have));
  ASSERT_TRUE(*Note(Difference(12, Held(kStream, 10, 11))));
  EXPECT_EQ(Shown()[kStream].intervals().size(), 1u);
}

TEST_F(PeerLogTest, ADifferenceThatDoesNotFollowTheLastNoteChangesNothingAndRequestsAFullNote) {
  EXPECT_FALSE(*Note(Difference(10, Held(kStream, 1, 5)))) << "nothing was noted before";
  EXPECT_THAT(Shown(), IsEmpty());
  ASSERT_TRUE(*Note(All(10, Held(kStream, 1, 5))));
  EXPECT_FALSE(*Note(Difference(12, Held(kStream, 7, 7)))) << "one is lost";
  EXPECT_FALSE(*Note(Difference(13, Held(kStream, 8, 8)))) << "still";
  EXPECT_FALSE(*Note(Difference(10, Held(kStream, 6, 6)))) << "twice the same number";
  EXPECT_EQ(Shown(), HadOf(Held(kStream, 1, 5)));
  ASSERT_TRUE(*Note(All(14, Held(kStream, 1, 8))));
  ASSERT_TRUE(*Note(Difference(15, Held(kStream, 9, 9))));
  EXPECT_EQ(Shown(), HadOf(Held(kStream, 1, 9)));
}

TEST_F(PeerLogTest, NumbersNotesPerPeerAndKindOfSession) {
  ASSERT_TRUE(*Note(All(10, Held(kStream, 1, 5))));
  EXPECT_FALSE(*Note(Difference(11, Held(kStream, 6, 6), /*peer=*/3)));
  proto::PeerHave of_replication = Difference(11, Held(kStream, 6, 6));
  of_replication.set_kind(proto::SHARING_KIND_REPLICATION);
  EXPECT_FALSE(*Note(of_replication));
  of_replication.set_is_difference(false);
  of_replication.set_number(500);
  ASSERT_TRUE(*Note(of_replication));
  EXPECT_TRUE(*Note(Difference(11, Held(kStream, 7, 7))));
}

TEST_F(PeerLogTest, AfterARestartItShowsItsLastStateAndRequestsAFullNote) {
  ASSERT_TRUE(*Note(All(10, Held(kStream, 1, 5))));
  store_.reset();
  store_ = OpenStore(StoreOptionsOf(kSelf, folder_.File("a.db")));
  EXPECT_EQ(Shown(), HadOf(Held(kStream, 1, 5)));
  EXPECT_FALSE(*Note(Difference(11, Held(kStream, 6, 6))));
  EXPECT_EQ(Shown(), HadOf(Held(kStream, 1, 5)));
}

TEST_F(PeerLogTest, AfterANoteThatCouldNotBeWrittenTheNextDifferenceIsRefused) {
  ASSERT_TRUE(*Note(All(10, Held(kStream, 1, 5))));
  ASSERT_TRUE(store_->database().Execute("PRAGMA query_only = ON"));
  EXPECT_FALSE(Note(Difference(11, Held(kStream, 6, 6))).has_value());
  ASSERT_TRUE(store_->database().Execute("PRAGMA query_only = OFF"));
  EXPECT_EQ(Shown(), HadOf(Held(kStream, 1, 5)));
  EXPECT_FALSE(*Note(Difference(12, Held(kStream, 7, 7))));
  ASSERT_TRUE(*Note(All(13, Held(kStream, 1, 7))));
  EXPECT_EQ(Shown(), HadOf(Held(kStream, 1, 7)));
}

TEST_F(PeerLogTest, AfterAMalformedNoteTheNextDifferenceIsRefused) {
  ASSERT_TRUE(*Note(All(10, Held(kStream, 1, 5))));
  proto::PeerHave malformed = Difference(11, Held(kStream, 6, 6));
  malformed.mutable_acknowledged()->mutable_streams(0)->mutable_held(0)->set_first(9);
  const Result<bool> refused = Note(malformed);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalid);
  EXPECT_FALSE(*Note(Difference(12, Held(kStream, 7, 7))));
  EXPECT_EQ(Shown(), HadOf(Held(kStream, 1, 5)));
}

TEST_F(PeerLogTest, AFullNoteRemovesRecordsThatThePeerLost) {
  HaveSet have = Held(kStream, 1, 5);
  have.Merge(Held(kOther, 1, 3));
  ASSERT_TRUE(*Note(All(10, have)));
  proto::PeerHave nothing_of_self = All(11, HaveSet());
  nothing_of_self.add_origin_agents(kSelf);
  ASSERT_TRUE(*Note(nothing_of_self));
  EXPECT_EQ(Shown(), HadOf(Held(kOther, 1, 3))) << "it was asked about one origin alone";
  ASSERT_TRUE(*Note(All(12, HaveSet())));
  EXPECT_THAT(Shown(), IsEmpty());
}

TEST_F(PeerLogTest, StoresHandedOverRecordsEvenOfARefusedNote) {
  proto::PeerHave note;
  note.set_peer(kPeer);
  *note.add_handed_over() = ToProto(RecordKey{kStream, 4});
  ASSERT_TRUE(*Note(note));
  EXPECT_EQ(HandedOverCount(), 1);
  proto::PeerHave unusable = Difference(11, Held(kStream, 6, 6));
  *unusable.add_handed_over() = ToProto(RecordKey{kStream, 5});
  ASSERT_FALSE(*Note(unusable));
  EXPECT_EQ(HandedOverCount(), 2);
  unusable.set_is_session_closed(true);
  ASSERT_FALSE(*Note(unusable));
  EXPECT_EQ(HandedOverCount(), 0);
}

}  // namespace
}  // namespace moondb
