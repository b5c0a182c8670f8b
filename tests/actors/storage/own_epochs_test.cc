#include "actors/storage/own_epochs.h"

#include <gmock/gmock.h>

#include <iostream>
#include <map>
#include <vector>

#include "actors/storage/schema.h"

namespace moondb {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::uint32_t kOurs = 100;     // This file's incarnation.
constexpr std::uint32_t kLost = 200;     // A disk that was lost.
constexpr std::uint32_t kAnother = 300;  // Another one.

std::uint64_t Epoch(std::uint64_t counter, std::uint32_t tag, std::uint32_t base_tag, std::uint64_t random = 7) {
  return EpochOf({counter, tag, base_tag}, random);
}

// This file's history began these, in its present incarnation.
OwnEpochs Began(const std::vector<std::uint64_t>& epochs) {
  OwnEpochs own;
  for (const std::uint64_t epoch : epochs) own.NoteBegun({epoch, kOurs});
  return own;
}

TEST(OwnEpochsTest, SaysInAnEpochWhereItComesFrom) {
  std::mt19937_64 random(1);
  OwnEpochs own;
  const OwnEpochs::Next first = *own.Draw(random);
  EXPECT_EQ(PartsOf(first.epoch), (EpochParts{1, first.tag, 0}));
  EXPECT_NE(first.tag, 0u);
  own.NoteBegun(first);
  const OwnEpochs::Next second = *own.Draw(random);
  EXPECT_EQ(PartsOf(second.epoch), (EpochParts{2, first.tag, first.tag}));
  own.NoteBegun(second);
  own.Learn(Epoch(9, kLost, kAnother));
  EXPECT_EQ(PartsOf(own.Draw(random)->epoch), (EpochParts{10, first.tag, kLost}));
}

TEST(OwnEpochsTest, DrawsNoTagThatIsKnownOfAnother) {
  OwnEpochs own;
  for (std::uint32_t tag = 1; tag <= 4000; ++tag) own.Learn(Epoch(tag, tag, 0));
  std::mt19937_64 random(1);
  for (int i = 0; i < 100; ++i) EXPECT_GT(own.Draw(random)->tag, 4000u);
}

TEST(OwnEpochsTest, IsLoadedAsItWasWritten) {
  auto database = *Database::Open(":memory:");
  ASSERT_TRUE(Migrate(*database));
  std::mt19937_64 random(1);
  OwnEpochs own;
  std::vector<OwnEpochs::Next> begun;
  for (int i = 0; i < 3; ++i) {
    begun.push_back(*own.Draw(random));
    ASSERT_TRUE(own.Write(*database, begun.back()));
    own.NoteBegun(begun.back());
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
  EXPECT_EQ(PartsOf(loaded.Draw(random)->epoch).base_tag, begun[0].tag);
}

TEST(OwnEpochsTest, EndangersWhatALostDisksEpochCannotHaveKnown) {
  OwnEpochs own = Began({Epoch(1, kOurs, 0), Epoch(2, kOurs, kOurs)});
  EXPECT_THAT(own.Endangered(), IsEmpty());
  own.Learn(Epoch(9, kLost, kLost));
  EXPECT_THAT(own.Endangered(), ElementsAre(Epoch(1, kOurs, 0), Epoch(2, kOurs, kOurs)));
  own.NoteBegun({Epoch(10, kOurs, kLost), kOurs});
  own.Learn(Epoch(8, kLost, kLost));
  EXPECT_THAT(own.Endangered(), ElementsAre(Epoch(1, kOurs, 0), Epoch(2, kOurs, kOurs))) << "none below the tenth";
  own.Learn(Epoch(12, kLost, kLost));
  EXPECT_EQ(own.Endangered().size(), 3u) << "nor did a still later one";
}

TEST(OwnEpochsTest, EndangersNothingThatTheBaseKnew) {
  OwnEpochs own = Began({Epoch(1, kOurs, 0), Epoch(5, kOurs, kOurs)});
  own.Learn(Epoch(6, kLost, kOurs));  // Our disk was away, and its replacement had heard of all that it had begun.
  EXPECT_THAT(own.Endangered(), IsEmpty());
  own.NoteBegun({Epoch(6, kOurs, kOurs, 1), kOurs});
  EXPECT_THAT(own.Endangered(), ElementsAre(Epoch(6, kOurs, kOurs, 1))) << "a base's counter is lower";
}

TEST(OwnEpochsTest, FollowsAChainOfBases) {
  OwnEpochs own = Began({Epoch(3, kOurs, 0), Epoch(5, kOurs, kOurs)});
  own.Learn(Epoch(5, kLost, kOurs, 9));     // Knew the third.
  own.Learn(Epoch(6, kLost, kLost));        // The same disk, later.
  own.Learn(Epoch(7, kAnother, kLost));     // Its replacement.
  own.Learn(Epoch(8, kAnother, kAnother));  // And later.
  EXPECT_THAT(own.Endangered(), ElementsAre(Epoch(5, kOurs, kOurs)));
  own.Learn(Epoch(7, kLost, kOurs));  // The lost disk was put back meanwhile, and had heard of the fifth.
  EXPECT_THAT(own.Endangered(), ElementsAre(Epoch(5, kOurs, kOurs))) << "but its replacement had not";
}

TEST(OwnEpochsTest, TakesTheLowestForeignEpochOfItsOwnTagAsTheFork) {
  OwnEpochs own = Began({Epoch(1, kOurs, 0), Epoch(2, kOurs, kOurs)});
  own.Learn(Epoch(3, kOurs, kOurs));  // This file is an older copy, and what it was copied from had gone on.
  own.Learn(Epoch(4, kOurs, kOurs));
  EXPECT_THAT(own.Endangered(), IsEmpty());
  OwnEpochs inserted = Began({Epoch(1, kOurs, 0), Epoch(2, kOurs, kOurs), Epoch(3, kOurs, kOurs, 1)});
  inserted.Learn(Epoch(3, kOurs, kOurs, 0));
  inserted.Learn(Epoch(4, kOurs, kOurs));
  EXPECT_THAT(inserted.Endangered(), ElementsAre(Epoch(3, kOurs, kOurs, 1)));
}

// The states of before the copy were known to what the store became.
TEST(OwnEpochsTest, SparesWhatABackupBroughtAlong) {
  OwnEpochs own;
  own.NoteBegun({Epoch(1, kLost, 0), kLost});
  own.NoteBegun({Epoch(2, kLost, kLost), kLost});
  own.NoteBegun({Epoch(3, kOurs, kLost), kOurs});
  own.Learn(Epoch(9, kLost, kLost));
  EXPECT_THAT(own.Endangered(), ElementsAre(Epoch(3, kOurs, kLost)));
}

TEST(OwnEpochsTest, BelievesNoClaimThatIsTooHighAndKeepsABoundedNumber) {
  OwnEpochs own = Began({Epoch(2, kOurs, kOurs)});
  EXPECT_FALSE(own.IsPossible(0));
  EXPECT_TRUE(own.IsPossible(own.highest() + kOwnEpochJumpMax));
  EXPECT_FALSE(own.IsPossible(own.highest() + kOwnEpochJumpMax + 1));
  EXPECT_TRUE(own.IsPossible(1));
  for (std::uint64_t i = 1; i <= kForeignEpochsMax + 5; ++i) own.Learn(Epoch(3, kLost, 0, i));
  EXPECT_FALSE(own.IsKnown(Epoch(3, kLost, 0, 5)));
  EXPECT_TRUE(own.IsKnown(Epoch(3, kLost, 0, 6)));
}

TEST(OwnEpochsTest, GoesOnWhereTheCounterIsUsedUp) {
  std::mt19937_64 random(1);
  OwnEpochs own;
  own.Learn(UINT64_MAX - 5);
  for (int i = 0; i < 5; ++i) {
    const Result<OwnEpochs::Next> next = own.Draw(random);
    if (!next) break;
    EXPECT_GT(next->epoch, own.highest());
    own.NoteBegun(*next);
  }
  own.Learn(UINT64_MAX);
  EXPECT_EQ(own.Draw(random).error().code, ErrorCode::kInternal);
}

// One robot with several disks: new ones, backups that were put on a disk of their own, and older copies of a file, as
// far as `has_copies`. It hears of all its epochs only now and then. What epochs say of each other is held against what
// each disk really knew.
class Robot {
 public:
  Robot(std::uint64_t seed, bool has_copies) : random_(seed), has_copies_(has_copies) {}

  void Step() {
    switch (Draw(12)) {
      case 0:
        present_ = disks_.size();
        disks_.emplace_back().incarnation = ++incarnations_;
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

  // It hears of all: in danger is what a later epoch did not know. Where two incarnations have drawn one tag, which
  // happens once in 16384 times, nobody can tell.
  void Check() {
    if (has_common_tag_) return;
    Hear();
    std::set<std::uint64_t> expected;
    for (const std::uint64_t own : disk().of_incarnation) {
      for (const auto& [later, knew] : knew_) {
        if (later > own && !disk().begun.contains(later) && !knew.contains(own)) expected.insert(own);
      }
    }
    const std::set<std::uint64_t> endangered = disk().own.Endangered();
    for (const std::uint64_t epoch : expected) missed_ += endangered.contains(epoch) ? 0 : 1;
    for (const std::uint64_t epoch : endangered) wrong_ += expected.contains(epoch) ? 0 : 1;
    right_ += expected.size();
  }

  int right_ = 0;
  int missed_ = 0;
  int wrong_ = 0;

 private:
  struct Disk {
    OwnEpochs own;
    int incarnation = 0;
    std::set<std::uint64_t> begun;           // By its history.
    std::set<std::uint64_t> of_incarnation;  // Of these, by its present incarnation.
    std::set<std::uint64_t> known;
  };

  std::uint64_t Draw(std::uint64_t count) { return random_() % count; }
  Disk& disk() { return disks_[present_]; }

  Disk Backup() {
    Disk backup;
    backup.incarnation = ++incarnations_;
    backup.begun = disk().begun;
    backup.known = disk().known;
    for (const std::uint64_t epoch : backup.begun) backup.own.NoteBegun({epoch, 0});
    for (const std::uint64_t epoch : backup.known) backup.own.Learn(epoch);
    return backup;
  }

  void Begin() {
    const OwnEpochs::Next next = *disk().own.Draw(random_);
    const auto tag = incarnation_of_.emplace(next.tag, disk().incarnation).first;
    has_common_tag_ = has_common_tag_ || tag->second != disk().incarnation;
    knew_[next.epoch] = disk().known;
    disk().own.NoteBegun(next);
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
  int incarnations_ = 0;                         // Of disks beside the first one.
  std::map<std::uint32_t, int> incarnation_of_;  // By tag.
  bool has_common_tag_ = false;
  std::map<std::uint64_t, std::set<std::uint64_t>> knew_;  // By every epoch that was ever begun.
};

Robot Lived(std::uint64_t seed, bool has_copies) {
  Robot robot(seed, has_copies);
  for (int i = 0; i < 60; ++i) {
    robot.Step();
    if (i % 10 == 9) robot.Check();
  }
  return robot;
}

TEST(OwnEpochsTest, KnowsOfAnyDisksAndBackupsWhatTheyKnewOfEachOther) {
  const std::uint64_t first_seed = std::random_device()();
  std::cout << "first seed " << first_seed << "\n";
  int right = 0;
  for (std::uint64_t seed = first_seed; seed < first_seed + 300; ++seed) {
    const Robot robot = Lived(seed, /*has_copies=*/false);
    EXPECT_EQ(robot.missed_, 0) << "seed " << seed;
    EXPECT_EQ(robot.wrong_, 0) << "seed " << seed;
    right += robot.right_;
  }
  EXPECT_GT(right, 300);
}

// Of several copies that went on under one tag not all can be told apart: now and then one that was in danger is missed.
TEST(OwnEpochsTest, MissesHardlyAnythingWhereSeveralOlderCopiesArePutBack) {
  const std::uint64_t first_seed = std::random_device()();
  std::cout << "first seed " << first_seed << "\n";
  int right = 0;
  int missed = 0;
  int wrong = 0;
  for (std::uint64_t seed = first_seed; seed < first_seed + 1000; ++seed) {
    const Robot robot = Lived(seed, /*has_copies=*/true);
    right += robot.right_;
    missed += robot.missed_;
    wrong += robot.wrong_;
  }
  std::cout << right << " in danger, " << missed << " of them missed, " << wrong << " more taken for it\n";
  EXPECT_LE(1000 * missed, right);
}

}  // namespace
}  // namespace moondb
