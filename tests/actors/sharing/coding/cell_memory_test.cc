#include "actors/sharing/coding/cell_memory.h"

#include <gtest/gtest.h>

#include <set>
#include <vector>

namespace moondb {
namespace {

CellMemory After(const std::vector<int>& cells) {
  CellMemory memory = kNoMemory;
  for (const int cell : cells) memory = Remember(memory, static_cast<std::uint8_t>(cell));
  return memory;
}

int StateAfter(const std::vector<int>& cells) { return kMemoryStateOf[After(cells)]; }

TEST(CellMemoryTest, KnowsTheLastCell) {
  EXPECT_EQ(LastCell(kNoMemory), kNotCovered);
  EXPECT_EQ(LastOrUnknown(kNoMemory), 0u);
  for (const int cell : {0, 1, 2}) {
    EXPECT_EQ(LastCell(After({2, 1, 1, cell})), static_cast<std::uint32_t>(cell));
    EXPECT_EQ(LastOrUnknown(After({cell})), static_cast<std::uint32_t>(cell));
  }
}

TEST(CellMemoryTest, GainsConfidenceWithEachOfThreeConfirmations) {
  EXPECT_EQ(std::set<int>({StateAfter({1}), StateAfter({1, 1}), StateAfter({1, 1, 1})}).size(), 3u);
  EXPECT_EQ(StateAfter({1, 1, 1}), StateAfter({1, 1, 1, 1, 1, 1}));
}

TEST(CellMemoryTest, KeepsItsBeliefDespiteOneContradictingMap) {
  EXPECT_EQ(StateAfter({1, 1, 1, 2, 1}), StateAfter({1, 1, 1}));
  EXPECT_NE(StateAfter({1, 1, 1, 2}), StateAfter({2})) << "the belief shows";
  EXPECT_NE(StateAfter({1, 1, 1, 2}), StateAfter({0, 0, 0, 2})) << "and which one it is";
}

TEST(CellMemoryTest, ChangesItsBeliefAfterRepeatedContradiction) {
  EXPECT_EQ(StateAfter({1, 2}), StateAfter({2}));
  EXPECT_EQ(StateAfter({1, 1, 1, 1, 2, 2, 2, 2}), StateAfter({2}));
  EXPECT_NE(StateAfter({1, 1, 1, 1, 2, 2, 2}), StateAfter({2}));
}

TEST(CellMemoryTest, HasAStateForEveryMemory) {
  for (const std::uint8_t state : kMemoryStateOf) EXPECT_LT(state, kMemoryStates);
  EXPECT_EQ(kMemoryStateOf[kNoMemory], kMemoryStates - 1);
}

}  // namespace
}  // namespace moondb
