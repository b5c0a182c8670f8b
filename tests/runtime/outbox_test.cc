#include "runtime/outbox.h"

#include <gtest/gtest.h>

#include "runtime/client_table.h"

namespace moondb {
namespace {

TEST(OutboxTest, BoundsBytesAndFrames) {
  Outbox outbox(/*bytes_max=*/10, /*frames_max=*/3, /*is_open=*/true);
  EXPECT_EQ(outbox.Push({"", "123456"}), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push({"", "12345"}), SendResult::kFull);
  EXPECT_EQ(outbox.Push({"", "1234"}), SendResult::kAccepted);
  outbox.PopFront();
  EXPECT_EQ(outbox.Push({"", "1"}), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push({"", "2"}), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push({"", "3"}), SendResult::kFull);
  EXPECT_EQ(outbox.Front()->frame, "1234");
}

TEST(OutboxTest, TakesOneThatIsTooLargeAlone) {
  Outbox outbox(/*bytes_max=*/2, /*frames_max=*/3, /*is_open=*/true);
  EXPECT_EQ(outbox.Push({"", "large"}), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push({"", "1"}), SendResult::kFull);
  outbox.PopFront();
  EXPECT_EQ(outbox.Push({"", "1"}), SendResult::kAccepted);
}

TEST(OutboxTest, ClosedTakesNothingAndForgets) {
  Outbox outbox(/*bytes_max=*/10, /*frames_max=*/3, /*is_open=*/false);
  EXPECT_EQ(outbox.Push({"", "1"}), SendResult::kUnreachable);
  outbox.Open();
  EXPECT_EQ(outbox.Push({"", "1"}), SendResult::kAccepted);
  EXPECT_EQ(outbox.Close(), 1u);
  EXPECT_EQ(outbox.Front(), nullptr);
  EXPECT_EQ(outbox.Push({"", "1"}), SendResult::kUnreachable);
}

TEST(ClientTableTest, KeepsThoseHeardFromMostRecently) {
  ClientTable table(/*clients_max=*/2);
  const std::string first = table.NameOf("a");
  const std::string second = table.NameOf("b");
  EXPECT_NE(first, second);
  EXPECT_EQ(table.NameOf("a"), first);
  const std::string third = table.NameOf("c");
  EXPECT_EQ(table.RoutingIdOf(first), "a");
  EXPECT_EQ(table.RoutingIdOf(second), std::nullopt);
  EXPECT_EQ(table.RoutingIdOf(third), "c");
  table.Forget("a");
  EXPECT_EQ(table.RoutingIdOf(first), std::nullopt);
}

}  // namespace
}  // namespace moondb
