#include "actors/merge/fallback_gather.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/actors/merge/merge_worlds.h"

namespace moondb {
namespace {

// A backend that gathers on the CPU while `works` is true. While it is false, Gather does half of the work and fails.
class FragileGather final : public GatherBackend {
 public:
  FragileGather(const bool& works, int& gathers) : works_(works), gathers_(gathers) {}
  Result<void> Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works,
                      const StopPredicate& stop) override {
    ++gathers_;
    if (!works_) {
      (void)cpu_.Gather(blocks, works.first(works.size() / 2), stop);
      return Fail(ErrorCode::kUnavailable, "the driver is gone");
    }
    return cpu_.Gather(blocks, works, stop);
  }
  std::string name() const override { return "fragile"; }
  std::string description() const override { return "fragile"; }

 private:
  const bool& works_;
  int& gathers_;
  CpuGather cpu_{{}};
};

class FallbackGatherTest : public testing::Test {
 protected:
  // Adds the first map of world_ to merger_, or withdraws the map if the last call added it. Then merges, and expects
  // the same cells as brute force.
  void Merge() {
    has_map_ = !has_map_;
    if (has_map_) {
      ASSERT_TRUE(merger_.Put(world_.maps[0]));
    } else {
      merger_.Withdraw(world_.maps[0].map->key);
    }
    ASSERT_TRUE(merger_.Merge({}).has_value());
    World now = world_;
    now.maps.clear();
    now.footprints.clear();
    if (has_map_) now.maps.push_back(world_.maps[0]);
    EXPECT_EQ(CountDifferences(ReadAll(merger_), MergeByBruteForce(now)), 0u);
  }

  static World MakeWorld() {
    std::mt19937_64 rng(1);
    return MakeRandomWorld(rng);
  }

  bool works_ = true;
  int gathers_ = 0;
  int made_ = 0;
  bool can_be_made_ = true;
  bool has_map_ = false;
  const World world_ = MakeWorld();
  std::shared_ptr<FallbackGather> backend_ = std::make_shared<FallbackGather>(
      std::make_unique<FragileGather>(works_, gathers_),
      [this]() -> Result<std::unique_ptr<GatherBackend>> {
        ++made_;
        if (!can_be_made_) return Fail(ErrorCode::kUnavailable, "no driver");
        return std::make_unique<FragileGather>(works_, gathers_);
      },
      1);
  Merger merger_{world_.grid, backend_};
};

TEST_F(FallbackGatherTest, TheCpuRepeatsAFailedMergeAndTheBackendIsTriedAgain) {
  Merge();
  EXPECT_EQ(backend_->name(), "fragile");
  works_ = false;
  Merge();
  EXPECT_EQ(backend_->name(), "cpu");
  EXPECT_NE(backend_->description().find("the driver is gone"), std::string::npos);
  works_ = true;
  Merge();
  EXPECT_EQ(backend_->name(), "fragile");
  EXPECT_EQ(made_, 1);
  EXPECT_EQ(gathers_, 3);
}

TEST_F(FallbackGatherTest, RetriesABackendThatStaysAwayLessAndLessOften) {
  works_ = false;
  can_be_made_ = false;
  for (int i = 0; i < 16; ++i) Merge();
  EXPECT_EQ(made_, 4) << "after 1, 2, 4 and 8 merges";
  can_be_made_ = works_ = true;
  for (int i = 0; i < 16; ++i) Merge();
  EXPECT_EQ(made_, 5);
  EXPECT_EQ(backend_->name(), "fragile");
}

TEST_F(FallbackGatherTest, AStoppedMergeDoesNotCountAsAFailure) {
  works_ = false;
  ASSERT_TRUE(merger_.Put(world_.maps[0]));
  EXPECT_FALSE(merger_.Merge([] { return true; }).has_value());
  EXPECT_EQ(backend_->name(), "fragile");
}

}  // namespace
}  // namespace moondb
