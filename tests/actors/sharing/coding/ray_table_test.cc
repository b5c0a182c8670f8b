#include "actors/sharing/coding/ray_table.h"

#include <gtest/gtest.h>

#include <cmath>

namespace moondb {
namespace {

TEST(RayTableTest, RaysLeadInwards) {
  const RayTable table(100, 100);
  const RayTable::Ray& diagonal = table.RowAt(30)[30];
  const RayTable::Ray& sideways = table.RowAt(0)[30];
  for (std::size_t i = 0; i < RayTable::kSteps; ++i) {
    EXPECT_EQ(diagonal.cells_in[i], (i + 1) + 4 * (i + 1));
    EXPECT_EQ(sideways.cells_in[i], i + 1);
  }
}

TEST(RayTableTest, KeepsItsClassesWithinBoundsForAnySize) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 57}, {57, 1}, {2, 3}, {100, 100}, {101, 33}, {400, 3}}) {
    const RayTable table(width, height);
    EXPECT_TRUE(table.IsFor(width, height));
    EXPECT_FALSE(table.IsFor(height + 1, width));
    for (int row = 0; row < (height + 1) / 2; ++row) {
      for (int column = 0; column < (width + 1) / 2; ++column) {
        const RayTable::Ray& ray = table.RowAt(row)[column];
        ASSERT_LT(ray.bearing, 8);
        ASSERT_LT(ray.distance, 8);
        for (std::size_t i = 0; i < RayTable::kSteps; ++i)
          ASSERT_LE(std::max(ray.cells_in[i] % 4, ray.cells_in[i] / 4), static_cast<int>(i) + 1);
      }
    }
  }
}

TEST(RayTableTest, DistinguishesBearingsAndDistances) {
  const RayTable table(100, 100);
  EXPECT_NE(table.RowAt(2)[40].bearing, table.RowAt(40)[2].bearing);
  EXPECT_LT(table.RowAt(1)[1].distance, table.RowAt(1)[20].distance);
  EXPECT_LT(table.RowAt(1)[20].distance, table.RowAt(49)[49].distance);
}

}  // namespace
}  // namespace moondb
