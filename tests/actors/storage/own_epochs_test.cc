#include "actors/storage/own_epochs.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <iostream>
#include <map>
#include <vector>

#include "actors/storage/schema.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::uint32_t kOurs = 100;     // Incarnation of the file under test.
constexpr std::uint32_t kLost = 200;     // Incarnation of a disk that was lost.
constexpr std::uint32_t kAnother = 300;  // Incarnation of the disk that replaced the lost disk.

// An epoch that no other agent ever heard of.
constexpr std::uint64_t kNeverShared = 12345;

// Returns an epoch that is based on `base` and follows `previous`, the last epoch of the same file. `base` and
// `previous` are 0 if there is no earlier epoch.
std::uint64_t Epoch(std::uint64_t counter, std::uint32_t tag, std::uint64_t base, std::uint64_t previous,
                    std::uint64_t random = 7) {
  return EpochOf({counter, tag, BaseMarkOf(base), MarkOf(previous)}, random);
}
// Returns an epoch whose predecessor is also its base.
std::uint64_t Epoch(std::uint64_t counter, std::uint32_t tag, std::uint64_t base) {
  return Epoch(counter, tag, base, base);
}

// Returns the OwnEpochs of a file that began `epochs` in its present incarnation.
OwnEpochs Began(const std::vector<std::uint64_t>& epochs) {
  OwnEpochs own;
  for (const std::uint64_t epoch : epochs) own.ObserveBegun({epoch, kOurs});
  return own;
}

TEST(OwnEpochsTest, AnEpochEncodesItsDiskBaseAndPredecessor) {
  std::mt19937_64 random(1);
  OwnEpochs own;
  const OwnEpochs::Next first = *own.Draw(random);
  EXPECT_EQ(PartsOf(first.epoch), (EpochParts{1, first.tag, 0, 0}));
  EXPECT_NE(first.tag, 0u);
  own.ObserveBegun(first);
  const OwnEpochs::Next second = *own.Draw(random);
  EXPECT_EQ(PartsOf(second.epoch), (EpochParts{2, first.tag, BaseMarkOf(first.epoch), MarkOf(first.epoch)}));
  own.ObserveBegun(second);
  const std::uint64_t foreign = Epoch(9, kLost, 0);
  own.Learn(foreign);
  EXPECT_EQ(PartsOf(own.Draw(random)->epoch), (EpochParts{10, first.tag, BaseMarkOf(foreign), MarkOf(second.epoch)}));
  EXPECT_NE(MarkOf(foreign), MarkOf(foreign + 1)) << "all bits of it count";
}

TEST(OwnEpochsTest, DrawsNoTagThatAKnownEpochUses) {
  OwnEpochs own;
  for (std::uint32_t tag = 1; tag <= 500; ++tag) own.Learn(Epoch(tag, tag, 0));
  std::mt19937_64 random(1);
  for (int i = 0; i < 100; ++i) EXPECT_GT(own.Draw(random)->tag, 500u);
}

TEST(OwnEpochsTest, IsLoadedAsItWasWritten) {
  auto database = *Database::Open(":memory:");
  ASSERT_TRUE(MakeSchema(*database));
  std::mt19937_64 random(1);
  OwnEpochs own;
  std::vector<OwnEpochs::Next> begun;
  for (int i = 0; i < 3; ++i) {
    begun.push_back(*own.Draw(random));
    ASSERT_TRUE(own.Write(*database, begun.back()));
    own.ObserveBegun(begun.back());
  }
  ASSERT_TRUE(database->Execute("UPDATE own_epoch SET hash = hash + 1 WHERE epoch >> 48 = 2"));
  OwnEpochs loaded;
  ASSERT_TRUE(loaded.Load(*database));
  EXPECT_TRUE(loaded.IsKnown(begun[0].epoch));
  EXPECT_FALSE(loaded.IsKnown(begun[1].epoch)) << "its row is damaged";
  EXPECT_EQ(loaded.highest(), begun[2].epoch);
  EXPECT_EQ(loaded.Draw(random)->tag, begun[0].tag);

  ASSERT_TRUE(database->Execute(kForgetIncarnationSql));
  ASSERT_TRUE(loaded.Load(*database));
  EXPECT_NE(loaded.Draw(random)->tag, begun[0].tag);
  EXPECT_EQ(PartsOf(loaded.Draw(random)->epoch).previous_mark, MarkOf(begun[2].epoch));
}

TEST(OwnEpochsTest, EndangersEpochsThatALostDiskCannotHaveKnown) {
  const std::uint64_t first = Epoch(1, kOurs, 0);
  const std::uint64_t second = Epoch(2, kOurs, first);
  OwnEpochs own = Began({first, second});
  EXPECT_THAT(own.Endangered().certain, IsEmpty());
  const std::uint64_t lost = Epoch(9, kLost, 0);
  own.Learn(lost);
  EXPECT_THAT(own.Endangered().certain, ElementsAre(first, second));
  own.ObserveBegun({Epoch(10, kOurs, lost), kOurs});
  own.Learn(Epoch(8, kLost, 0));
  EXPECT_THAT(own.Endangered().certain, ElementsAre(first, second)) << "none below the tenth";
  own.Learn(Epoch(12, kLost, 0));
  EXPECT_EQ(own.Endangered().certain.size(), 3u) << "nor did a still later one";
}

TEST(OwnEpochsTest, EndangersNoEpochThatTheBaseKnew) {
  const std::uint64_t first = Epoch(1, kOurs, 0);
  const std::uint64_t fifth = Epoch(5, kOurs, 0);
  OwnEpochs own = Began({first, fifth});
  // A replacement disk that knew `first` and `fifth` began this epoch.
  own.Learn(Epoch(6, kLost, fifth));
  EXPECT_THAT(own.Endangered().certain, IsEmpty());
  const std::uint64_t sixth = Epoch(6, kOurs, fifth);
  own.ObserveBegun({sixth, kOurs});
  EXPECT_THAT(own.Endangered().certain, ElementsAre(sixth)) << "a base's counter is lower";
}

TEST(OwnEpochsTest, FollowsAChainOfBases) {
  const std::uint64_t third = Epoch(3, kOurs, 0);
  const std::uint64_t fifth = Epoch(5, kOurs, 0);
  OwnEpochs own = Began({third, fifth});
  const std::uint64_t knew_third = Epoch(4, kLost, third);
  const std::uint64_t the_same_disk = Epoch(5, kLost, knew_third);
  const std::uint64_t its_replacement = Epoch(6, kAnother, the_same_disk);
  for (const std::uint64_t epoch : {knew_third, the_same_disk, its_replacement}) own.Learn(epoch);
  // A later epoch of the replacement disk, based on an epoch that this file does not know.
  own.Learn(Epoch(8, kAnother, kNeverShared));
  EXPECT_THAT(own.Endangered().certain, ElementsAre(fifth));
  // The lost disk returns, hears of the fifth epoch, and begins an epoch based on it.
  own.Learn(Epoch(6, kLost, fifth));
  EXPECT_THAT(own.Endangered().certain, ElementsAre(fifth)) << "but its replacement had not";
}

TEST(OwnEpochsTest, FindsWhereAnOlderCopyDiverged) {
  const std::uint64_t first = Epoch(1, kOurs, 0);
  const std::uint64_t second = Epoch(2, kOurs, first);
  OwnEpochs own = Began({first, second});
  const std::uint64_t others_third = Epoch(3, kOurs, second, second, 0);
  // `own` tracks the epochs of an older copy of the file. The original file, not this copy, began the epoch
  // `others_third`.
  own.Learn(others_third);
  own.Learn(Epoch(4, kOurs, others_third));
  EXPECT_THAT(own.Endangered().certain, IsEmpty());
  const std::uint64_t third = Epoch(3, kOurs, second, second, 1);
  OwnEpochs inserted = Began({first, second, third});
  inserted.Learn(others_third);
  inserted.Learn(Epoch(4, kOurs, others_third));
  EXPECT_THAT(inserted.Endangered().certain, ElementsAre(third));
}

TEST(OwnEpochsTest, FindsWhereEachOfSeveralOlderCopiesDiverged) {
  const std::uint64_t first = Epoch(1, kOurs, 0);
  const std::uint64_t second = Epoch(2, kOurs, first, first, 1);
  const std::uint64_t third = Epoch(3, kOurs, second);
  OwnEpochs own = Began({first, second, third});
  own.Learn(Epoch(2, kOurs, first, first, 0));
  // Another copy of this file began an epoch based on `third`, the last epoch of this file.
  own.Learn(Epoch(4, kOurs, third));
  EXPECT_THAT(own.Endangered().certain, IsEmpty());
}

// The highest epoch was begun by a copy of this file that contained `second`. That copy had already reissued
// the states of `second`, so `second` is no longer endangered.
TEST(OwnEpochsTest, EndangersNoEpochThatTheHighestEpochKnew) {
  const std::uint64_t first = Epoch(1, kOurs, 0);
  const std::uint64_t second = Epoch(2, kOurs, first, first, 0);
  OwnEpochs own = Began({first, second});
  const std::uint64_t of_another_copy = Epoch(2, kOurs, first, first, 1);
  own.Learn(of_another_copy);
  EXPECT_THAT(own.Endangered().certain, ElementsAre(second));
  own.Learn(Epoch(3, kOurs, of_another_copy, second));
  EXPECT_THAT(own.Endangered().certain, IsEmpty()) << "it was begun by a copy of this very file";
  own.Learn(Epoch(4, kLost, 0));
  EXPECT_THAT(own.Endangered().certain, ElementsAre(first, second)) << "a disk that knew nothing";
}

TEST(OwnEpochsTest, ReportsPossibleDangerIfTheBaseOfTheHighestEpochIsUnknown) {
  const std::uint64_t first = Epoch(1, kOurs, 0);
  OwnEpochs own = Began({first});
  const std::uint64_t later = Epoch(9, kLost, kNeverShared);
  own.Learn(later);
  EXPECT_THAT(own.Endangered().certain, IsEmpty());
  EXPECT_THAT(own.Endangered().possible, ElementsAre(first));
  own.Learn(Epoch(10, kLost, later));
  EXPECT_THAT(own.Endangered().possible, ElementsAre(first)) << "nor of what its base was begun upon";
  own.Learn(Epoch(2, kLost, 0));
  EXPECT_THAT(own.Endangered().possible, IsEmpty());
  EXPECT_THAT(own.Endangered().certain, ElementsAre(first)) << "an earlier one of that disk, which was empty";
}

TEST(OwnEpochsTest, ReportsPossibleDangerIfSeveralEpochsShareAMark) {
  const std::uint64_t first = Epoch(1, kOurs, 0);
  std::uint64_t lost = Epoch(1, kLost, 0);
  while (BaseMarkOf(lost) != BaseMarkOf(first)) ++lost;
  OwnEpochs own = Began({first});
  own.Learn(lost);
  own.Learn(Epoch(2, kLost, lost));
  EXPECT_THAT(own.Endangered().possible, ElementsAre(first)) << "it may have been begun upon either";
  const std::uint64_t second = Epoch(2, kOurs, first);
  own.ObserveBegun({second, kOurs});
  own.Learn(Epoch(3, kLost, Epoch(2, kLost, lost)));
  EXPECT_THAT(own.Endangered().possible, ElementsAre(first));
  EXPECT_THAT(own.Endangered().certain, ElementsAre(second)) << "neither knew it";
}

TEST(OwnEpochsTest, FindsThatACopyDivergedThoughItsFirstEpochIsUnknown) {
  const std::uint64_t first = Epoch(1, kOurs, 0);
  const std::uint64_t second = Epoch(2, kOurs, first);
  OwnEpochs own = Began({first, second});
  const std::uint64_t never_shared = Epoch(2, kOurs, first, first, 1);
  own.Learn(Epoch(3, kOurs, never_shared));
  EXPECT_THAT(own.Endangered().certain, ElementsAre(second));
}

// The file was restored from a backup made on the disk kLost. kLost itself began `first` and `second`, so its later
// epochs know their states. Only `third`, begun after the restore, is endangered.
TEST(OwnEpochsTest, DoesNotEndangerEpochsFromARestoredBackup) {
  const std::uint64_t first = Epoch(1, kLost, 0);
  const std::uint64_t second = Epoch(2, kLost, first);
  const std::uint64_t third = Epoch(3, kOurs, second);
  OwnEpochs own;
  own.ObserveBegun({first, kLost});
  own.ObserveBegun({second, kLost});
  own.ObserveBegun({third, kOurs});
  own.Learn(Epoch(9, kLost, 0));
  EXPECT_THAT(own.Endangered().certain, ElementsAre(third));
}

TEST(OwnEpochsTest, RejectsClaimsThatAreTooHighAndKeepsABoundedNumber) {
  OwnEpochs own = Began({Epoch(2, kOurs, 0)});
  own.ObserveStart();
  EXPECT_FALSE(own.IsPossible(0));
  const std::uint64_t last = own.highest() + kOwnEpochJumpMax;
  EXPECT_TRUE(own.IsPossible(last));
  EXPECT_FALSE(own.IsPossible(last + 1));
  EXPECT_TRUE(own.IsPossible(1));
  for (std::uint64_t i = 1; i <= kForeignEpochsMax + 5; ++i) own.Learn(Epoch(3, kLost, 0, 0, i));
  EXPECT_FALSE(own.IsKnown(Epoch(3, kLost, 0, 0, 5)));
  EXPECT_TRUE(own.IsKnown(Epoch(3, kLost, 0, 0, 6)));
  own.Learn(last);
  EXPECT_FALSE(own.IsPossible(last + 1)) << "claims do not climb on each other's shoulders";
}

TEST(OwnEpochsTest, DrawsHigherEpochsUntilNoneIsLeft) {
  std::mt19937_64 random(1);
  OwnEpochs own;
  own.Learn(UINT64_MAX - 5);
  for (int i = 0; i < 5; ++i) {
    const Result<OwnEpochs::Next> next = own.Draw(random);
    if (!next) break;
    EXPECT_GT(next->epoch, own.highest());
    own.ObserveBegun(*next);
  }
  own.Learn(UINT64_MAX);
  EXPECT_EQ(own.Draw(random).error().code, ErrorCode::kInternal);
}

// Simulates a robot with several disks: new disks, restored backups and, if `has_copies`, older copies of a file. The
// robot learns of all its epochs only now and then. Check compares the conclusions that OwnEpochs draws from the epochs
// with the true history of each disk.
class Robot {
 public:
  Robot(std::uint64_t seed, bool has_copies) : random_(seed), has_copies_(has_copies) {}

  void Step() {
    switch (Draw(12)) {
      case 0:
        present_ = disks_.size();
        disks_.emplace_back();
        break;
      case 1:
        present_ = Draw(disks_.size());
        break;
      case 2:
        disks_.push_back(Backup());
        break;
      case 3:
        if (has_copies_) disks_.push_back(Disk(disk()));
        break;
      case 4:
      case 5:
        Hear();
        break;
      default:
        Begin();
    }
  }

  // Learns all epochs, and compares Endangered with the true history. An epoch E of the present incarnation is
  // endangered if the highest epoch that other disks began is higher than E and did not know E. Counts the endangered
  // epochs (right_), the endangered epochs that Endangered does not return (missed_), and the epochs in `certain` that
  // are not endangered (wrong_). `possible` must be empty unless two epochs have the same mark (MarkOf).
  void Check() {
    Hear();
    const auto highest = std::find_if(knew_.rbegin(), knew_.rend(),
                                      [this](const auto& later) { return !disk().begun.contains(later.first); });
    std::set<std::uint64_t> expected;
    for (const std::uint64_t own : disk().of_incarnation) {
      const bool is_below = highest != knew_.rend() && own < highest->first;
      if (is_below && !highest->second.contains(own)) expected.insert(own);
    }
    const OwnEpochs::Danger danger = disk().own.Endangered();
    if (!is_ambiguous_) {
      EXPECT_THAT(danger.possible, IsEmpty());
    }
    for (const std::uint64_t epoch : expected) {
      missed_ += danger.certain.contains(epoch) || danger.possible.contains(epoch) ? 0 : 1;
    }
    for (const std::uint64_t epoch : danger.certain) wrong_ += expected.contains(epoch) ? 0 : 1;
    right_ += expected.size();
  }

  int right_ = 0;
  int missed_ = 0;
  int wrong_ = 0;

 private:
  struct Disk {
    OwnEpochs own;
    std::set<std::uint64_t> begun;           // Epochs in the disk's history.
    std::set<std::uint64_t> of_incarnation;  // Epochs that the disk's present incarnation began.
    std::set<std::uint64_t> known;
  };

  std::uint64_t Draw(std::uint64_t count) { return random_() % count; }
  Disk& disk() { return disks_[present_]; }

  Disk Backup() {
    Disk backup;
    backup.begun = disk().begun;
    backup.known = disk().known;
    for (const std::uint64_t epoch : backup.begun) backup.own.ObserveBegun({epoch, 0});
    for (const std::uint64_t epoch : backup.known) backup.own.Learn(epoch);
    return backup;
  }

  void Begin() {
    const OwnEpochs::Next next = *disk().own.Draw(random_);
    is_ambiguous_ = is_ambiguous_ || !marks_.insert(MarkOf(next.epoch)).second ||
                    !base_marks_.emplace(PartsOf(next.epoch).counter, BaseMarkOf(next.epoch)).second;
    std::set<std::uint64_t>& knew = knew_[next.epoch];
    for (const std::uint64_t parent : {disk().own.highest(), disk().begun.empty() ? 0 : *disk().begun.rbegin()}) {
      if (parent == 0) continue;
      knew.insert(parent);
      knew.insert(knew_[parent].begin(), knew_[parent].end());
    }
    disk().own.ObserveBegun(next);
    disk().known.insert(next.epoch);
    disk().begun.insert(next.epoch);
    disk().of_incarnation.insert(next.epoch);
  }

  void Hear() {
    for (const auto& [epoch, knew] : knew_) {
      disk().own.Learn(epoch);
      disk().known.insert(epoch);
    }
  }

  std::mt19937_64 random_;
  const bool has_copies_;
  std::vector<Disk> disks_ = std::vector<Disk>(1);
  std::size_t present_ = 0;
  std::set<std::uint32_t> marks_;                                 // MarkOf(epoch) of each epoch.
  std::set<std::pair<std::uint64_t, std::uint32_t>> base_marks_;  // Counter and base mark of all epochs.
  bool is_ambiguous_ = false;
  // By epoch: the epoch on which it is based, its predecessor in the same file, and all epochs that these two knew.
  std::map<std::uint64_t, std::set<std::uint64_t>> knew_;
};

Robot Lived(std::uint64_t seed, bool has_copies) {
  Robot robot(seed, has_copies);
  for (int i = 0; i < 60; ++i) {
    robot.Step();
    if (i % 10 == 9) robot.Check();
  }
  return robot;
}

void ExpectNoneMissedOrWrong(bool has_copies) {
  const std::uint64_t first_seed = std::random_device()();
  std::cout << "first seed " << first_seed << "\n";
  int right = 0;
  for (std::uint64_t seed = first_seed; seed < first_seed + 1000; ++seed) {
    const Robot robot = Lived(seed, has_copies);
    EXPECT_EQ(robot.missed_, 0) << "seed " << seed;
    EXPECT_EQ(robot.wrong_, 0) << "seed " << seed;
    right += robot.right_;
  }
  EXPECT_GT(right, 1000);
}

TEST(OwnEpochsTest, DerivesWhatDisksAndBackupsKnewOfEachOther) { ExpectNoneMissedOrWrong(/*has_copies=*/false); }

TEST(OwnEpochsTest, DerivesWhatUnmarkedCopiesKnewOfEachOther) { ExpectNoneMissedOrWrong(/*has_copies=*/true); }

}  // namespace
}  // namespace moondb
