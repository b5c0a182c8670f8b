#include "actors/storage/copy_watch.h"

#include <gtest/gtest.h>

#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

using std::chrono::seconds;

proto::TeamConfig TeamOf(double keep_days) {
  proto::TeamConfig team;
  for (const AgentId id : {1, 2, 3, 9}) team.add_agents()->set_id(id);
  team.mutable_agents(3)->set_kind(proto::AGENT_KIND_BASE_STATION);
  team.mutable_retention()->set_keep_days(keep_days);
  return team;
}

class CopyWatchTest : public testing::Test {
 protected:
  void SetUp() override {
    watch_.ObserveTime(At(0), store_->next_row_id());
    for (std::uint64_t i = 0; i < 4; ++i) keys_.push_back(InsertOne(*store_, NodeRecord(2, i)));
  }

  static CopyWatch::Time At(int s) { return CopyWatch::Time(seconds(s)); }

  // Notes that the peer covers the first `count` nodes.
  void Acknowledge(AgentId peer, std::uint64_t count) {
    proto::PeerHave note;
    note.set_peer(peer);
    note.set_kind(proto::SHARING_KIND_SYNC);
    note.set_number(++number_);
    proto::StreamHave& stream = *note.mutable_acknowledged()->add_streams();
    stream.set_origin_agent(2);
    stream.set_epoch(keys_[0].epoch());
    stream.set_data_type(proto::POSE_GRAPH_NODE);
    stream.add_held()->set_first(1);
    stream.mutable_held(0)->set_last(count);
    const auto noted = store_->ObservePeerHave(note);
    ASSERT_TRUE(noted) << ToString(noted.error());
  }

  proto::StorageStatus Status(const CopyWatch& watch, int s = 0) {
    proto::StorageStatus status;
    const auto done = watch.Describe(*store_, At(s), status);
    EXPECT_TRUE(done) << ToString(done.error());
    return status;
  }

  std::unique_ptr<RecordStore> store_ = OpenStore(StoreOptionsOf(2));
  CopyWatch watch_{2, TeamOf(0)};
  std::vector<proto::RecordKey> keys_;
  std::uint64_t number_ = 0;
};

TEST_F(CopyWatchTest, CountsRecordsThatNobodyAcknowledged) {
  EXPECT_EQ(Status(watch_).one_copy().count(), 4);
  Acknowledge(1, 3);
  EXPECT_EQ(Status(watch_).one_copy().count(), 1);
  Acknowledge(3, 4);
  EXPECT_EQ(Status(watch_).one_copy().count(), 0);
}

TEST_F(CopyWatchTest, CountsAgainWhenThePeerHasLostItsDisk) {
  Acknowledge(1, 4);
  EXPECT_EQ(Status(watch_).one_copy().count(), 0);
  proto::PeerHave empty;
  empty.set_peer(1);
  empty.set_kind(proto::SHARING_KIND_SYNC);
  empty.set_number(++number_);
  empty.mutable_acknowledged();
  ASSERT_TRUE(store_->ObservePeerHave(empty));
  EXPECT_EQ(Status(watch_).one_copy().count(), 4);
}

TEST_F(CopyWatchTest, NamesWhatEachPeerLacks) {
  Acknowledge(1, 3);
  const proto::StorageStatus status = Status(watch_);
  ASSERT_EQ(status.backlogs_size(), 3);
  EXPECT_EQ(status.backlogs(0).agent_id(), 1u);
  EXPECT_EQ(status.backlogs(0).own_count(), 1);
  EXPECT_EQ(status.backlogs(1).all_count(), 4);
}

TEST_F(CopyWatchTest, SaysForHowLongTheOldestRecordHasOneCopy) {
  watch_.ObserveTime(At(10), store_->next_row_id());
  InsertOne(*store_, NodeRecord(2, 4));
  watch_.ObserveTime(At(70), store_->next_row_id());
  EXPECT_EQ(Status(watch_, 100).one_copy().age_s(), 100);
  Acknowledge(1, 4);
  EXPECT_EQ(Status(watch_, 100).one_copy().age_s(), 90);
}

TEST_F(CopyWatchTest, RecordsFromBeforeTheStartAreAtLeastAsOldAsTheProcess) {
  CopyWatch restarted(2, TeamOf(0));
  restarted.ObserveTime(At(1000), store_->next_row_id());
  EXPECT_EQ(Status(restarted, 1060).one_copy().age_s(), 60);
}

// Under limits, a rover may have removed what it acknowledged, once leader and survivor had it.
TEST_F(CopyWatchTest, CountsOnlyAgentsThatKeepRecordsIfTheTeamHasLimits) {
  CopyWatch limited(2, TeamOf(1));
  proto::RoleAssignment roles;
  roles.set_leader(1);
  limited.ObserveRoles(roles);
  Acknowledge(3, 4);
  EXPECT_EQ(Status(limited).one_copy().count(), 4);
  Acknowledge(1, 4);
  EXPECT_EQ(Status(limited).one_copy().count(), 0);
  roles.set_leader(3);
  roles.set_survivor(2);
  limited.ObserveRoles(roles);
  EXPECT_EQ(Status(limited).one_copy().count(), 0) << "3 leads now";
}

// Others' records came from an agent that has them. With limits, a leader's survivor may be the only other holder.
TEST_F(CopyWatchTest, CountsOthersRecordsAtALeaderUnderLimitsAlone) {
  Acknowledge(1, 4);
  StoreOne(*store_, Packed({{3, 8, proto::POSE_GRAPH_NODE}, 1}, NodeRecord(3, 1)));
  proto::RoleAssignment roles;
  roles.set_leader(2);
  roles.set_survivor(1);
  CopyWatch limited(2, TeamOf(1));
  EXPECT_EQ(Status(limited).one_copy().count(), 4) << "nobody has a role yet";
  limited.ObserveRoles(roles);
  watch_.ObserveRoles(roles);
  EXPECT_EQ(Status(limited).one_copy().count(), 1);
  EXPECT_EQ(Status(watch_).one_copy().count(), 0) << "its origin keeps it";
}

TEST_F(CopyWatchTest, KnowsAgesOfALongMissionWithinAFewPerCent) {
  Acknowledge(1, 4);
  const auto note = [this](int s) { watch_.ObserveTime(At(s), store_->next_row_id() + static_cast<std::uint64_t>(s)); };
  watch_.ObserveTime(At(500'000), store_->next_row_id());
  InsertOne(*store_, NodeRecord(2, 10));
  for (int s = 500'010; s <= 1'000'000; s += 10) note(s);
  const double age_s = Status(watch_, 1'000'000).one_copy().age_s();
  EXPECT_GE(age_s, 500'000);
  EXPECT_LE(age_s, 520'000);
}

}  // namespace
}  // namespace moondb
