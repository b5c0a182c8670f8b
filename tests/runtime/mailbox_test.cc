#include "runtime/mailbox.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <iostream>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "tests/runtime/scripted_actor.h"

namespace moondb {
namespace {

using testing::ElementsAre;

Mailbox::Item Data(std::uint64_t number, std::size_t bytes = 0) {
  Mailbox::Item item;
  item.message = std::make_shared<proto::Message>(Numbered(number));
  item.bytes = bytes;
  return item;
}

Mailbox::Item Timer(std::uint64_t number, std::uint64_t incarnation = 1) {
  Mailbox::Item item = Data(number);
  item.is_timer = true;
  item.incarnation = incarnation;
  return item;
}

Mailbox::Item PeerEvent(std::uint64_t number) {
  proto::Message message = Numbered(number);
  message.mutable_peer_event();
  Mailbox::Item item;
  item.message = std::make_shared<proto::Message>(std::move(message));
  return item;
}

// "7/old": the key is what comes before the slash, in record_id.
Mailbox::Item Keyed(const std::string& key, std::uint64_t number, std::size_t bytes = 0) {
  proto::Message message = Numbered(number);
  message.set_record_id(key);
  Mailbox::Item item;
  item.message = std::make_shared<proto::Message>(std::move(message));
  item.bytes = bytes;
  return item;
}

SpawnOptions LatestByKey(std::size_t messages_max) {
  SpawnOptions options;
  options.messages_max = messages_max;
  options.overflow = Overflow::kLatestByKey;
  options.key = [](const proto::Message& message) { return message.record_id(); };
  return options;
}

std::vector<std::uint64_t> PopAll(Mailbox& mailbox) {
  std::vector<std::uint64_t> numbers;
  while (const auto item = mailbox.Pop()) numbers.push_back(item->message->request_id());
  return numbers;
}

std::vector<std::uint64_t> NumbersOf(const std::vector<Mailbox::Item>& items) {
  std::vector<std::uint64_t> numbers;
  for (const Mailbox::Item& item : items) numbers.push_back(item.message->request_id());
  return numbers;
}

TEST(MailboxTest, FirstInFirstOut) {
  Mailbox mailbox({});
  EXPECT_EQ(mailbox.Push(Data(1, 10)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Timer(2, 7)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Data(3, 10)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Pop()->message->request_id(), 1u);
  const Mailbox::Item timer = *mailbox.Pop();
  EXPECT_EQ(timer.message->request_id(), 2u);
  EXPECT_EQ(timer.incarnation, 7u);
  EXPECT_EQ(mailbox.Pop()->message->request_id(), 3u);
  EXPECT_FALSE(mailbox.Pop());
  EXPECT_EQ(mailbox.size_max(), 3u);
  EXPECT_EQ(mailbox.bytes_max(), 20u);
}

TEST(MailboxTest, CountIsBoundedAndRefusalsCounted) {
  Mailbox mailbox({.messages_max = 2});
  EXPECT_EQ(mailbox.Push(Data(1)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Data(2)), SendResult::kAccepted);
  EXPECT_FALSE(mailbox.HasRoom(0));
  EXPECT_EQ(mailbox.Push(Data(3)), SendResult::kFull);
  EXPECT_EQ(mailbox.dropped(), 1u);
  mailbox.Pop();
  EXPECT_TRUE(mailbox.HasRoom(0));
  EXPECT_EQ(mailbox.Push(Data(4)), SendResult::kAccepted);
}

TEST(MailboxTest, BytesAreBoundedAndGivenBack) {
  Mailbox mailbox({.bytes_max = 100});
  EXPECT_EQ(mailbox.Push(Data(1, 60)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Data(2, 41)), SendResult::kFull);
  EXPECT_EQ(mailbox.Push(Data(3, 40)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.bytes(), 100u);
  mailbox.Pop();
  EXPECT_EQ(mailbox.bytes(), 40u);
  EXPECT_EQ(mailbox.Push(Data(4, 60)), SendResult::kAccepted);
}

TEST(MailboxTest, OneMessageLargerThanTheBoundFitsAlone) {
  Mailbox mailbox({.bytes_max = 100});
  EXPECT_EQ(mailbox.Push(Data(1, 5000)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Data(2, 1)), SendResult::kFull);
  mailbox.Pop();
  EXPECT_EQ(mailbox.Push(Data(3, 1)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Data(4, 5000)), SendResult::kFull);
}

TEST(MailboxTest, TimersPassTheBoundsAndTakeNoRoom) {
  Mailbox mailbox({.messages_max = 1, .bytes_max = 1});
  for (int i = 0; i < 10; ++i) EXPECT_EQ(mailbox.Push(Timer(i)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Data(10, 1)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Timer(11)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.size(), 12u);
  EXPECT_EQ(mailbox.dropped(), 0u);
}

TEST(MailboxTest, ControlGoesBeforeDataAndTakesNoRoom) {
  Mailbox mailbox({.messages_max = 1});
  EXPECT_EQ(mailbox.Push(Data(1)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(PeerEvent(2)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(PeerEvent(3)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Data(4)), SendResult::kFull);
  std::vector<Mailbox::Item> batch;
  mailbox.Take(/*one_by_one=*/false, &batch);
  EXPECT_THAT(NumbersOf(batch), ElementsAre(2, 3));
  EXPECT_THAT(PopAll(mailbox), ElementsAre(1));
}

TEST(MailboxTest, FullControlLaneKeepsTheNewestOfAKind) {
  Mailbox mailbox({});
  for (std::size_t i = 0; i < kControlMessagesMax; ++i) ASSERT_EQ(mailbox.Push(PeerEvent(i)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(PeerEvent(1000)), SendResult::kAccepted);
  proto::Message ping;
  ping.mutable_ping();
  Mailbox::Item other;
  other.message = std::make_shared<proto::Message>(ping);
  EXPECT_EQ(mailbox.Push(other), SendResult::kFull);
  EXPECT_EQ(mailbox.dropped(), 2u);
  const auto numbers = PopAll(mailbox);
  ASSERT_EQ(numbers.size(), kControlMessagesMax);
  EXPECT_EQ(numbers.front(), 0u);
  EXPECT_EQ(numbers[kControlMessagesMax - 2], kControlMessagesMax - 2);
  EXPECT_EQ(numbers.back(), 1000u);
}

TEST(MailboxTest, LatestOfAKeyTakesThePlaceOfTheWaitingOne) {
  Mailbox mailbox(LatestByKey(2));
  EXPECT_EQ(mailbox.Push(Keyed("a", 1, 10)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Keyed("b", 2, 10)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Keyed("a", 3, 15)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Keyed("c", 4, 10)), SendResult::kFull);
  EXPECT_EQ(mailbox.replaced(), 1u);
  EXPECT_EQ(mailbox.dropped(), 1u);
  EXPECT_EQ(mailbox.bytes(), 25u);
  EXPECT_THAT(PopAll(mailbox), ElementsAre(3, 2));
  EXPECT_EQ(mailbox.Push(Keyed("a", 5)), SendResult::kAccepted);  // What left is replaced no more.
  EXPECT_THAT(PopAll(mailbox), ElementsAre(5));
}

TEST(MailboxTest, WithoutAKeyNothingIsReplaced) {
  Mailbox mailbox(LatestByKey(3));
  EXPECT_EQ(mailbox.Push(Keyed("", 1)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Push(Keyed("", 2)), SendResult::kAccepted);
  EXPECT_THAT(PopAll(mailbox), ElementsAre(1, 2));
}

TEST(MailboxTest, BatchesEndAtABoundAndALargeMessageGoesAlone) {
  Mailbox mailbox({});
  for (std::size_t i = 0; i < Mailbox::kBatchMessages + 1; ++i) (void)mailbox.Push(Data(i, 1));
  std::vector<Mailbox::Item> batch;
  mailbox.Take(/*one_by_one=*/false, &batch);
  EXPECT_EQ(batch.size(), Mailbox::kBatchMessages);
  mailbox.Clear();
  (void)mailbox.Push(Data(1, 2 * Mailbox::kBatchBytes));
  (void)mailbox.Push(Data(2, 1));
  batch.clear();
  mailbox.Take(/*one_by_one=*/false, &batch);
  EXPECT_THAT(NumbersOf(batch), ElementsAre(1));
  batch.clear();
  (void)mailbox.Push(Data(3, 1));
  mailbox.Take(/*one_by_one=*/true, &batch);
  EXPECT_THAT(NumbersOf(batch), ElementsAre(2));
}

TEST(MailboxTest, WhatIsPutBackComesFirstAgain) {
  Mailbox mailbox({.messages_max = 4});
  for (int i = 1; i <= 3; ++i) (void)mailbox.Push(Data(i, 10));
  (void)mailbox.Push(Timer(4));
  std::vector<Mailbox::Item> batch;
  mailbox.Take(/*one_by_one=*/false, &batch);
  (void)mailbox.Push(Data(5, 10));
  mailbox.PutBack(&batch, 1);
  EXPECT_EQ(mailbox.bytes(), 30u);
  EXPECT_THAT(NumbersOf(batch), testing::SizeIs(1));
  EXPECT_THAT(PopAll(mailbox), ElementsAre(2, 3, 4, 5));
  EXPECT_EQ(mailbox.bytes(), 0u);
}

TEST(MailboxTest, ClearLeavesRoomForAll) {
  Mailbox mailbox(LatestByKey(1));
  (void)mailbox.Push(Timer(1));
  ASSERT_EQ(mailbox.Push(Keyed("a", 2, 10)), SendResult::kAccepted);
  mailbox.Clear();
  EXPECT_TRUE(mailbox.empty());
  EXPECT_EQ(mailbox.bytes(), 0u);
  EXPECT_EQ(mailbox.Push(Keyed("a", 3, 10)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.dropped(), 0u);
  EXPECT_EQ(mailbox.replaced(), 0u);
}

// Against a plain model: a list in which the newest of a key stands where the oldest waiting one did.
TEST(MailboxTest, RandomUseAgreesWithAModel) {
  const auto seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 rng(seed);
  Mailbox mailbox(LatestByKey(8));
  std::vector<std::pair<std::string, std::uint64_t>> model;
  std::vector<Mailbox::Item> batch;
  for (std::uint64_t number = 1; number <= 20'000; ++number) {
    if (rng() % 3 != 0) {
      const std::string key = rng() % 4 == 0 ? "" : std::string(1, static_cast<char>('a' + rng() % 12));
      const auto same =
          std::find_if(model.begin(), model.end(), [&](const auto& item) { return !key.empty() && item.first == key; });
      const bool has_room = model.size() < 8;
      const SendResult result = mailbox.Push(Keyed(key, number, 1));
      if (same != model.end()) {
        same->second = number;
      } else if (has_room) {
        model.emplace_back(key, number);
      }
      ASSERT_EQ(result, same != model.end() || has_room ? SendResult::kAccepted : SendResult::kFull);
    } else if (!model.empty()) {
      batch.clear();
      mailbox.Take(/*one_by_one=*/false, &batch);
      ASSERT_THAT(NumbersOf(batch), ElementsAre(model.front().second));
      model.erase(model.begin());
    }
    ASSERT_EQ(mailbox.size(), model.size());
    ASSERT_EQ(mailbox.bytes(), model.size());
  }
}

}  // namespace
}  // namespace moondb
