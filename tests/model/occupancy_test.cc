#include "model/occupancy.h"

#include <gmock/gmock.h>

namespace moondb {
namespace {

using testing::ElementsAre;

TEST(OccupancyTest, ConvertsAnOccupancyGrid) {
  EXPECT_THAT(*CellsOfOccupancy(std::vector<int>{-1, 0, 64, 65, 100}),
              ElementsAre(Cell::kUnknown, Cell::kFree, Cell::kFree, Cell::kHazard, Cell::kHazard));
}

TEST(OccupancyTest, ConvertsTheCostsOfACostmap) {
  EXPECT_THAT(*CellsOfOccupancy(std::vector<int>{255, 0, 253, 254}, {{255}, 254}),
              ElementsAre(Cell::kUnknown, Cell::kFree, Cell::kFree, Cell::kHazard));
}

TEST(OccupancyTest, RefusesOtherValuesAndNamesTheCell) {
  EXPECT_EQ(CellsOfOccupancy(std::vector<int>{0, -2}).error().field, "grid[1]");
  EXPECT_EQ(CellsOfOccupancy(std::vector<int>{256}).error().field, "grid[0]");
  EXPECT_EQ(CellsOfOccupancy(std::vector<int>{0, -1}, {{255}, 254}).error().field, "grid[1]");
}

}  // namespace
}  // namespace moondb
