#include "actors/gateway/page_turns.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(PageTurnsTest, GivesTheTurnsOfAQueueInOrder) {
  PageTurns turns;
  EXPECT_TRUE(turns.Add("anna storage", 1));
  EXPECT_FALSE(turns.Add("anna storage", 2));
  EXPECT_FALSE(turns.Add("anna storage", 3));
  EXPECT_EQ(turns.Remove("anna storage", 1), 2u);
  EXPECT_EQ(turns.Remove("anna storage", 2), 3u);
  EXPECT_EQ(turns.Remove("anna storage", 3), std::nullopt);
  EXPECT_EQ(turns.queues(), 0u);
}

TEST(PageTurnsTest, QueuesDoNotWaitForEachOther) {
  PageTurns turns;
  EXPECT_TRUE(turns.Add("anna storage", 1));
  EXPECT_TRUE(turns.Add("anna merge", 2));
  EXPECT_TRUE(turns.Add("bert storage", 3));
  EXPECT_EQ(turns.Remove("anna storage", 1), std::nullopt);
}

TEST(PageTurnsTest, TheEndOfAWaitingRequestBeginsNoTurn) {
  PageTurns turns;
  EXPECT_TRUE(turns.Add("anna storage", 1));
  EXPECT_FALSE(turns.Add("anna storage", 2));
  EXPECT_FALSE(turns.Add("anna storage", 3));
  EXPECT_EQ(turns.Remove("anna storage", 2), std::nullopt);
  EXPECT_EQ(turns.Remove("anna storage", 1), 3u);
  EXPECT_EQ(turns.Remove("nobody storage", 1), std::nullopt);
}

}  // namespace
}  // namespace moondb
