#include "runtime/transport/outbox.h"

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

namespace moondb {
namespace {

Outbox::Options Bounds(std::size_t bytes_max, std::size_t messages_max) {
  return {.bytes_max = bytes_max, .messages_max = messages_max, .reserve_bytes = 4, .reserve_messages = 2};
}

constexpr std::size_t kMapClass = kOutboundClasses - 1;

Outbox::Entry Entry(std::string_view text, std::size_t outbound_class = kMapClass, std::string key = "") {
  return {std::string(text), /*messages=*/1, outbound_class, std::move(key)};
}

std::vector<std::string> TakeAll(Outbox& outbox) {
  std::vector<std::string> taken;
  for (; !outbox.empty(); outbox.PopFront()) taken.push_back(outbox.Front()->frame);
  return taken;
}

TEST(OutboxTest, BoundsBytesAndMessages) {
  Outbox outbox(Bounds(/*bytes_max=*/10, /*messages_max=*/3));
  EXPECT_EQ(outbox.Push(Entry("123456")), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push(Entry("12345")), SendResult::kFull);
  EXPECT_EQ(outbox.Push(Entry("1234")), SendResult::kAccepted);
  outbox.PopFront();
  EXPECT_EQ(outbox.Push(Entry("1")), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push(Entry("2")), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push(Entry("3")), SendResult::kFull);
  EXPECT_EQ(outbox.bytes(), 6u);
  EXPECT_EQ(TakeAll(outbox), (std::vector<std::string>{"1234", "1", "2"}));
  EXPECT_EQ(outbox.bytes(), 0u);
  EXPECT_EQ(outbox.Front(), nullptr);
}

TEST(OutboxTest, AcceptsAnOversizedMessageIfEmpty) {
  Outbox outbox(Bounds(/*bytes_max=*/2, /*messages_max=*/3));
  EXPECT_EQ(outbox.Push(Entry("large")), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push(Entry("1")), SendResult::kFull);
  outbox.PopFront();
  EXPECT_EQ(outbox.Push(Entry("1")), SendResult::kAccepted);
}

TEST(OutboxTest, ReturnsControlFirstAndMapsLastInOrderWithinAClass) {
  Outbox outbox(Bounds(/*bytes_max=*/100, /*messages_max=*/100));
  (void)outbox.Push(Entry("map 1", kMapClass));
  (void)outbox.Push(Entry("state 1", 1));
  (void)outbox.Push(Entry("map 2", kMapClass));
  (void)outbox.Push(Entry("control 1", kControlClass));
  (void)outbox.Push(Entry("state 2", 1));
  (void)outbox.Push(Entry("control 2", kControlClass));
  EXPECT_EQ(TakeAll(outbox),
            (std::vector<std::string>{"control 1", "control 2", "state 1", "state 2", "map 1", "map 2"}));
}

TEST(OutboxTest, ReplacesAMessageByANewerOneWithTheSameKey) {
  Outbox outbox(Bounds(/*bytes_max=*/10, /*messages_max=*/3));
  (void)outbox.Push(Entry("old", kControlClass, "roles"));
  (void)outbox.Push(Entry("other", kControlClass));
  // The full outbox accepts this message, because it replaces a message of the same size.
  EXPECT_EQ(outbox.Push(Entry("newer", kControlClass, "roles")), SendResult::kAccepted);
  EXPECT_EQ(outbox.replaced(), 1u);
  EXPECT_EQ(outbox.messages(), 2u);
  EXPECT_EQ(outbox.bytes(), 10u);
  EXPECT_EQ(TakeAll(outbox), (std::vector<std::string>{"newer", "other"}));
  // A message that was taken out cannot be replaced.
  (void)outbox.Push(Entry("next", kControlClass, "roles"));
  EXPECT_EQ(outbox.replaced(), 1u);
}

TEST(OutboxTest, PacksConsecutiveMessagesOfAClassIntoAFrame) {
  Outbox outbox({});
  outbox.ShareFrames(/*bytes_max=*/5);
  (void)outbox.Push(Entry("12"));
  (void)outbox.Push(Entry("state", 1));
  (void)outbox.Push(Entry("34"));
  (void)outbox.Push(Entry("56"));
  (void)outbox.Push(Entry("k", kMapClass, "key"));
  (void)outbox.Push(Entry("7"));
  (void)outbox.Push(Entry("K", kMapClass, "key"));
  (void)outbox.Push(Entry("8"));
  EXPECT_EQ(outbox.messages(), 7u);
  EXPECT_EQ(outbox.bytes(), 14u);
  outbox.PopFront();
  EXPECT_EQ(outbox.Front()->messages, 2u);
  EXPECT_EQ(TakeAll(outbox), (std::vector<std::string>{"1234", "56", "K", "78"}));
  EXPECT_EQ(outbox.messages(), 0u);
  (void)outbox.Push(Entry("1"));
  (void)outbox.Push(Entry("2"));
  EXPECT_EQ(outbox.Clear(), 2u);
}

TEST(OutboxTest, KeepsAReserveForControlWhenFullOfBulkData) {
  Outbox outbox(Bounds(/*bytes_max=*/10, /*messages_max=*/2));
  (void)outbox.Push(Entry("far more than its bound"));
  EXPECT_EQ(outbox.Push(Entry("bulk")), SendResult::kFull);
  EXPECT_EQ(outbox.Push(Entry("1234", kControlClass)), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push(Entry("5", kControlClass)), SendResult::kFull) << "more bytes than the reserve has";
  outbox.PopFront();
  EXPECT_EQ(outbox.Push(Entry("1", kControlClass)), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push(Entry("2", kControlClass)), SendResult::kAccepted);
  EXPECT_EQ(outbox.Push(Entry("3", kControlClass)), SendResult::kFull) << "more messages than the reserve has";
}

TEST(OutboxTest, DropsWaitingMessages) {
  Outbox outbox(Bounds(/*bytes_max=*/10, /*messages_max=*/3));
  (void)outbox.Push(Entry("1"));
  (void)outbox.Push(Entry("2", kControlClass));
  EXPECT_EQ(outbox.Clear(), 2u);
  EXPECT_TRUE(outbox.empty());
  EXPECT_EQ(outbox.bytes(), 0u);
  EXPECT_EQ(outbox.Push(Entry("1234", kControlClass)), SendResult::kAccepted);
}

}  // namespace
}  // namespace moondb
