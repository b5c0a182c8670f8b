#include "actors/merge/crop.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace moondb {
namespace {

CropItem CropItemAt(AgentId origin, std::int64_t x, std::int64_t y = 0) { return {origin, {x, y, x + 9, y + 9}}; }

TEST(CropTest, ABoxThatFitsIsNotCropped) {
  const Crop crop = CropToFit({CropItemAt(1, 0), CropItemAt(2, 90, 40)}, 100, 5000);
  EXPECT_EQ(crop.box, (CellBox{0, 0, 99, 49}));
  EXPECT_TRUE(crop.left_out.empty());
  EXPECT_TRUE(CropToFit({}, 100, 5000).box.is_empty());
}

TEST(CropTest, OneItemFarAwayIsLeftOutAndAllOthersStay) {
  const std::vector<CropItem> items = {CropItemAt(1, -40), CropItemAt(1, 0), CropItemAt(2, 50), CropItemAt(3, 7),
                                       CropItemAt(3, 40'000)};
  const Crop crop = CropToFit(items, 100, 10'000);
  EXPECT_EQ(crop.box, (CellBox{-40, 0, 59, 9}));
  ASSERT_EQ(crop.left_out.size(), 1u);
  EXPECT_EQ(crop.left_out.at(3).count, 1u);
  EXPECT_NEAR(static_cast<double>(crop.left_out.at(3).distance_cells), 40'000, 60);
}

TEST(CropTest, ItemsNearTheCentreStayWhateverAnotherOriginHas) {
  std::vector<CropItem> items = {CropItemAt(1, 0, 0), CropItemAt(2, 10, 0), CropItemAt(1, -30), CropItemAt(2, 30, 0),
                                 CropItemAt(2, 5, -30)};
  const std::size_t honest = items.size();
  for (std::int64_t i = 0; i < 1000; ++i) items.push_back(CropItemAt(3, 13 * i, -7 * i));
  const Crop crop = CropToFit(items, 100, 10'000);
  EXPECT_LE(crop.box.width(), 100);
  EXPECT_LE(crop.box.height(), 100);
  for (std::size_t i = 0; i < honest; ++i) EXPECT_TRUE(crop.box.Touches(items[i].box)) << i;
  EXPECT_EQ(crop.left_out.size(), 1u);
  EXPECT_GT(crop.left_out.at(3).count, 900u);
}

TEST(CropTest, TheAreaIsLimitedToo) {
  const Crop crop = CropToFit({CropItemAt(1, 0), CropItemAt(2, 40, 40), CropItemAt(3, 80, 80)}, 100, 3000);
  EXPECT_EQ(crop.box, (CellBox{0, 0, 49, 49}));
  EXPECT_EQ(crop.left_out.at(3).count, 1u);
}

TEST(CropTest, DependsOnTheSetOfItemsAndNotOnTheirOrder) {
  std::mt19937_64 rng(7);
  std::vector<CropItem> items;
  for (AgentId origin = 1; origin <= 5; ++origin) {
    for (int i = 0; i < 20; ++i) {
      items.push_back(
          CropItemAt(origin, static_cast<std::int64_t>(rng() % 300), static_cast<std::int64_t>(rng() % 300)));
    }
  }
  const Crop expected = CropToFit(items, 100, 8000);
  for (int round = 0; round < 20; ++round) {
    std::shuffle(items.begin(), items.end(), rng);
    const Crop crop = CropToFit(items, 100, 8000);
    EXPECT_EQ(crop.box, expected.box);
    EXPECT_EQ(crop.left_out.size(), expected.left_out.size());
  }
}

}  // namespace
}  // namespace moondb
