#include "runtime/mailbox.h"

#include <gtest/gtest.h>

#include <memory>

namespace moondb {
namespace {

MessagePtr Numbered(std::uint64_t number) {
  auto message = std::make_shared<proto::Message>();
  message->set_request_id(number);
  return message;
}

TEST(MailboxTest, FirstInFirstOut) {
  Mailbox mailbox({});
  EXPECT_TRUE(mailbox.Push(Numbered(1), 10));
  mailbox.PushSystem(Numbered(2), 7);
  EXPECT_TRUE(mailbox.Push(Numbered(3), 10));
  EXPECT_EQ(mailbox.Pop()->message->request_id(), 1u);
  const Mailbox::Item timer = *mailbox.Pop();
  EXPECT_EQ(timer.message->request_id(), 2u);
  EXPECT_EQ(timer.incarnation, 7u);
  EXPECT_EQ(mailbox.Pop()->message->request_id(), 3u);
  EXPECT_FALSE(mailbox.Pop());
  EXPECT_EQ(mailbox.size_max(), 3u);
}

TEST(MailboxTest, CountIsBoundedAndRefusalsCounted) {
  Mailbox mailbox({.messages_max = 2});
  EXPECT_TRUE(mailbox.Push(Numbered(1), 0));
  EXPECT_TRUE(mailbox.Push(Numbered(2), 0));
  EXPECT_FALSE(mailbox.Push(Numbered(3), 0));
  EXPECT_EQ(mailbox.dropped(), 1u);
  mailbox.Pop();
  EXPECT_TRUE(mailbox.Push(Numbered(4), 0));
}

TEST(MailboxTest, BytesAreBoundedAndGivenBack) {
  Mailbox mailbox({.bytes_max = 100});
  EXPECT_TRUE(mailbox.Push(Numbered(1), 60));
  EXPECT_FALSE(mailbox.Push(Numbered(2), 41));
  EXPECT_TRUE(mailbox.Push(Numbered(3), 40));
  EXPECT_EQ(mailbox.bytes(), 100u);
  mailbox.Pop();
  EXPECT_EQ(mailbox.bytes(), 40u);
  EXPECT_TRUE(mailbox.Push(Numbered(4), 60));
}

TEST(MailboxTest, OneMessageLargerThanTheBoundFitsAlone) {
  Mailbox mailbox({.bytes_max = 100});
  EXPECT_TRUE(mailbox.Push(Numbered(1), 5000));
  EXPECT_FALSE(mailbox.Push(Numbered(2), 1));
  mailbox.Pop();
  EXPECT_TRUE(mailbox.Push(Numbered(3), 1));
  EXPECT_FALSE(mailbox.Push(Numbered(4), 5000));
}

TEST(MailboxTest, SystemMessagesPassTheBoundsAndTakeNoRoom) {
  Mailbox mailbox({.messages_max = 1, .bytes_max = 1});
  for (int i = 0; i < 10; ++i) mailbox.PushSystem(Numbered(i));
  EXPECT_TRUE(mailbox.Push(Numbered(10), 1));
  mailbox.PushSystem(Numbered(11));
  EXPECT_EQ(mailbox.size(), 12u);
  EXPECT_EQ(mailbox.dropped(), 0u);
}

TEST(MailboxTest, ClearLeavesRoomForAll) {
  Mailbox mailbox({.messages_max = 1, .bytes_max = 10});
  mailbox.PushSystem(Numbered(1));
  ASSERT_TRUE(mailbox.Push(Numbered(2), 10));
  mailbox.Clear();
  EXPECT_TRUE(mailbox.empty());
  EXPECT_EQ(mailbox.bytes(), 0u);
  EXPECT_TRUE(mailbox.Push(Numbered(3), 10));
  EXPECT_EQ(mailbox.dropped(), 0u);
}

}  // namespace
}  // namespace moondb
