// Tests sessions between two agents with the largest allowed have-set, at 1 Mbit/s: how long a session takes to start,
// and whether it completes over bad radios.
#include <gtest/gtest.h>

#include <algorithm>
#include <iostream>

#include "model/have_page.h"
#include "proto/share_status.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/sharing_team.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::minutes;
using std::chrono::seconds;

constexpr AgentId kLeader = 1;
constexpr AgentId kSurvivor = 2;

// Leader and survivor hold the same kHaveStreamsMax streams. The leader has one more record.
class LargeHaveSetTest : public testing::Test {
 protected:
  LargeHaveSetTest() {
    leader_ = AddMemoryAgent(team_, kLeader, config_);
    survivor_ = AddMemoryAgent(team_, kSurvivor, config_);
    team_.AddAgent(3);
    for (std::uint64_t epoch = 1; epoch <= kHaveStreamsMax; ++epoch) {
      leader_->Insert(kLeader, proto::POWER, "p", epoch << 48 | epoch);
      survivor_->Insert(kLeader, proto::POWER, "p", epoch << 48 | epoch);
    }
    leader_->Insert(kLeader, proto::POWER, "more", 1ull << 48 | 1);
    team_.radio().bytes_per_second = 125'000;
    team_.radio().latency = milliseconds(10);
    team_.SetFilter([this](AgentId, AgentId, const proto::Message& message) {
      longest_message_ = std::max(longest_message_, message.ByteSizeLong());
      pages_ += message.has_have() && message.have().is_whole() ? 1 : 0;
      return true;
    });
  }

  // Orders a replication. Returns true if the survivor has all records of the leader within `limit`, and the session
  // then completes within two minutes.
  bool ReplicateWithin(Duration limit) {
    const MonotonicTime begin = team_.now();
    Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_REPLICATION));
    const bool is_complete = team_.RunUntil([this] { return survivor_->have() == leader_->have(); }, limit);
    took_ = team_.now() - begin;
    team_.AdvanceTime(minutes(2));
    return is_complete && Session().completed_sessions() == 1;
  }

  proto::ShareSession Session() {
    const proto::ShareStatus status = ShareStatusOf(team_, kLeader, actor_name::kReplica);
    return status.sessions_size() == 1 ? status.sessions(0) : proto::ShareSession();
  }

  const proto::TeamConfig config_ = TestTeam(2);
  simulation::SimulatedTeam team_{/*seed=*/1};
  std::shared_ptr<MemoryStore> leader_;
  std::shared_ptr<MemoryStore> survivor_;
  std::size_t longest_message_ = 0;
  int pages_ = 0;
  Duration took_{};
};

TEST_F(LargeHaveSetTest, StartsASessionInTheTimeToTransmitItsBytes) {
  EXPECT_TRUE(ReplicateWithin(minutes(10)));
  const double have_bytes = static_cast<double>(ToProto(survivor_->have()).ByteSizeLong());
  const double took_s = std::chrono::duration<double>(took_).count();
  std::cout << "have-set of " << have_bytes << " bytes in " << pages_ << " pages: " << took_s << " s, "
            << team_.radio_bytes() << " bytes, the longest message " << longest_message_ << "\n";
  EXPECT_LT(took_s, 1.3 * have_bytes / 125'000);
  EXPECT_LT(static_cast<double>(team_.radio_bytes()), 1.02 * have_bytes);
  EXPECT_LE(longest_message_, kHavePageBytesMax + 1024);
  EXPECT_EQ(Session().resends(), 0);
}

TEST_F(LargeHaveSetTest, ArrivesOverARadioThatLosesRepeatsAndReorders) {
  team_.radio().loss_ratio = 0.1;
  team_.radio().duplicate_ratio = 0.2;
  team_.radio().latency_jitter = milliseconds(500);
  EXPECT_TRUE(ReplicateWithin(minutes(30)));
  EXPECT_GT(Session().resends(), 0);
  EXPECT_EQ(Session().refused_haves(), 0);
}

TEST_F(LargeHaveSetTest, ArrivesOverALinkThatIsNeverUpForLong) {
  int cuts = 0;
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_REPLICATION));
  for (; cuts < 100 && survivor_->have() != leader_->have(); ++cuts) {
    team_.AdvanceTime(seconds(1));
    team_.SetLink(kLeader, kSurvivor, /*is_up=*/false, /*tell=*/true);
    team_.AdvanceTime(seconds(10));
    team_.SetLink(kLeader, kSurvivor, /*is_up=*/true, /*tell=*/true);
  }
  EXPECT_GT(cuts, 5);
  EXPECT_LT(cuts, 30) << "what came between two cuts is kept";
  EXPECT_EQ(survivor_->have(), leader_->have());
}

TEST_F(LargeHaveSetTest, IsRequestedAgainFromARestartedSurvivor) {
  Share(team_, kLeader, ShareOrder(proto::SHARING_KIND_REPLICATION));
  team_.AdvanceTime(seconds(5));
  *survivor_ = MemoryStore();  // The survivor loses its disk.
  team_.Crash(kSurvivor);
  team_.Restart(kSurvivor);
  // The leader received the first page before the restart. The records named in that page are now missing at the
  // survivor.
  EXPECT_TRUE(team_.RunUntil([this] { return !survivor_->records().empty(); }, minutes(10)));
  EXPECT_EQ(survivor_->records().begin()->first, leader_->records().begin()->first);
}

}  // namespace
}  // namespace moondb
