#include "runtime/mailbox.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <iostream>
#include <map>
#include <memory>
#include <random>
#include <semaphore>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/runtime/scripted_actor.h"

namespace moondb {
namespace {

using testing::ElementsAre;

Mailbox::Item Data(std::uint64_t number, std::size_t bytes = 0) {
  Mailbox::Item item;
  item.message = Numbered(number);
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
  item.message = std::move(message);
  return item;
}

// Returns a message whose record_id is `key`. LatestByKey uses the record_id as the message's key.
Mailbox::Item Keyed(const std::string& key, std::uint64_t number, std::size_t bytes = 0) {
  proto::Message message = Numbered(number);
  message.set_record_id(key);
  Mailbox::Item item;
  item.message = std::move(message);
  item.bytes = bytes;
  return item;
}

Mailbox::Item Stored(std::uint64_t last_row_id, std::uint32_t type) {
  proto::Message message;
  message.mutable_records_stored()->set_last_row_id(last_row_id);
  message.mutable_records_stored()->add_data_types(type);
  Mailbox::Item item;
  item.message = std::move(message);
  item.bytes = 10;
  return item;
}

Mailbox::Item LeasesChanged(std::uint64_t number) {
  proto::Message message = Numbered(number);
  message.mutable_leases_changed();
  Mailbox::Item item;
  item.message = std::move(message);
  return item;
}

SpawnOptions LatestByKey(std::size_t messages_max) {
  SpawnOptions options;
  options.messages_max = messages_max;
  options.overflow = Overflow::kLatestByKey;
  options.key = [](const proto::Message& message) { return message.record_id(); };
  return options;
}

SendResult Push(Mailbox& mailbox, Mailbox::Item item) { return mailbox.Push(std::move(item)).result; }

std::vector<std::uint64_t> TakeAll(Mailbox& mailbox) {
  std::vector<std::uint64_t> numbers;
  while (const Mailbox::Item* item = mailbox.Take()) numbers.push_back(item->message->request_id());
  return numbers;
}

TEST(MailboxTest, IsFirstInFirstOut) {
  Mailbox mailbox({});
  EXPECT_EQ(Push(mailbox, Data(1, 10)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Timer(2, 7)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(3, 10)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Take()->message->request_id(), 1u);
  const Mailbox::Item& timer = *mailbox.Take();
  EXPECT_EQ(timer.message->request_id(), 2u);
  EXPECT_EQ(timer.incarnation, 7u);
  EXPECT_EQ(mailbox.Take()->message->request_id(), 3u);
  EXPECT_EQ(mailbox.Take(), nullptr);
  EXPECT_EQ(mailbox.counts().waiting_max, 3u);
  EXPECT_EQ(mailbox.counts().bytes_max, 20u);
}

TEST(MailboxTest, CountIsBoundedAndRefusalsAreCounted) {
  Mailbox mailbox({.messages_max = 2});
  EXPECT_EQ(Push(mailbox, Data(1)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(2)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(3)), SendResult::kFull);
  EXPECT_EQ(mailbox.counts().dropped, 1u);
  mailbox.Take();
  EXPECT_EQ(Push(mailbox, Data(4)), SendResult::kAccepted);
}

TEST(MailboxTest, BytesAreBoundedAndReleased) {
  Mailbox mailbox({.bytes_max = 100});
  EXPECT_EQ(Push(mailbox, Data(1, 60)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(2, 41)), SendResult::kFull);
  EXPECT_EQ(Push(mailbox, Data(3, 40)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.counts().bytes, 100u);
  mailbox.Take();
  EXPECT_EQ(mailbox.counts().bytes, 40u);
  EXPECT_EQ(Push(mailbox, Data(4, 60)), SendResult::kAccepted);
}

TEST(MailboxTest, OneMessageLargerThanTheLimitFitsIntoAnEmptyMailbox) {
  Mailbox mailbox({.bytes_max = 100});
  EXPECT_EQ(Push(mailbox, Data(1, 5000)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(2, 1)), SendResult::kFull);
  mailbox.Take();
  EXPECT_EQ(Push(mailbox, Data(3, 1)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(4, 5000)), SendResult::kFull);
}

TEST(MailboxTest, MessagesFromOutsideMayUseAQuarterOfTheBytes) {
  Mailbox mailbox({.bytes_max = 400});
  const auto push_from_outside = [&mailbox](std::uint64_t id, std::size_t bytes) {
    Mailbox::Item item = Data(id, bytes);
    item.is_from_outside = true;
    return mailbox.Push(std::move(item)).result;
  };
  EXPECT_EQ(push_from_outside(1, 60), SendResult::kAccepted);
  EXPECT_EQ(push_from_outside(2, 41), SendResult::kFull);
  EXPECT_EQ(Push(mailbox, Data(3, 300)), SendResult::kAccepted);
  EXPECT_EQ(push_from_outside(4, 1), SendResult::kFull);
  EXPECT_EQ(Push(mailbox, Data(5, 40)), SendResult::kAccepted);
}

TEST(MailboxTest, MessagesFromOutsideLeaveAQuarterOfThePlacesToOthers) {
  Mailbox mailbox({.messages_max = 8});
  const auto push_from_outside = [&mailbox](std::uint64_t id) {
    Mailbox::Item item = Data(id, 1);
    item.is_from_outside = true;
    return mailbox.Push(std::move(item)).result;
  };
  for (std::uint64_t id = 1; id <= 6; ++id) EXPECT_EQ(push_from_outside(id), SendResult::kAccepted) << id;
  EXPECT_EQ(push_from_outside(7), SendResult::kFull);
  EXPECT_EQ(Push(mailbox, Data(8, 1)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(9, 1)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(10, 1)), SendResult::kFull);
}

TEST(MailboxTest, TimersAreNotLimitedAndUseNoRoom) {
  Mailbox mailbox({.messages_max = 1, .bytes_max = 1});
  for (int i = 0; i < 10; ++i) EXPECT_EQ(Push(mailbox, Timer(i)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(10, 1)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Timer(11)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.counts().waiting, 12u);
  EXPECT_EQ(mailbox.counts().dropped, 0u);
}

TEST(MailboxTest, RecordsStoredIsMergedIntoOneMessageAndNotLimited) {
  for (const SpawnOptions& options : {SpawnOptions{.messages_max = 1, .bytes_max = 1}, LatestByKey(1)}) {
    SCOPED_TRACE(options.overflow == Overflow::kLatestByKey ? "by key" : "");
    Mailbox mailbox(options);
    EXPECT_EQ(Push(mailbox, Data(1, 1)), SendResult::kAccepted);
    for (const std::uint32_t type : {5, 6, 5}) {
      EXPECT_EQ(Push(mailbox, Stored(10 + type, type)), SendResult::kAccepted);
    }
    EXPECT_EQ(Push(mailbox, Timer(2)), SendResult::kAccepted);
    EXPECT_EQ(mailbox.counts().waiting, 3u);
    EXPECT_EQ(mailbox.counts().bytes, 1u);
    EXPECT_EQ(mailbox.Take()->message->request_id(), 1u);
    EXPECT_EQ(Push(mailbox, Stored(17, 7)), SendResult::kAccepted);
    std::vector<std::uint32_t> types;
    std::uint64_t last_row_id = 0;
    int taken = 0;
    while (const Mailbox::Item* item = mailbox.Take()) {
      if (!item->message->has_records_stored()) continue;
      const proto::RecordsStored& stored = item->message->records_stored();
      types.insert(types.end(), stored.data_types().begin(), stored.data_types().end());
      last_row_id = stored.last_row_id();
      ++taken;
    }
    EXPECT_THAT(types, ElementsAre(5, 6, 7));
    EXPECT_EQ(last_row_id, 17u);
    EXPECT_LE(taken, 2) << "one that the reader had taken over, and one";
    EXPECT_EQ(Push(mailbox, Stored(18, 5)), SendResult::kAccepted);
    EXPECT_EQ(mailbox.Take()->message->records_stored().last_row_id(), 18u);
    EXPECT_EQ(mailbox.counts().waiting, 0u);
  }
}

TEST(MailboxTest, PublishedMessagesEnterAFullControlLane) {
  Mailbox mailbox({});
  for (std::size_t i = 0; i < kControlMessagesMax; ++i) EXPECT_EQ(Push(mailbox, PeerEvent(1)), SendResult::kAccepted);
  for (int i = 2; i <= 4; ++i) EXPECT_EQ(Push(mailbox, LeasesChanged(i)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.counts().waiting, kControlMessagesMax + 1);
  EXPECT_EQ(TakeAll(mailbox).back(), 4u);
}

TEST(MailboxTest, ControlPrecedesDataAndUsesNoRoom) {
  Mailbox mailbox({.messages_max = 1});
  EXPECT_EQ(Push(mailbox, Data(1)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, PeerEvent(2)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, PeerEvent(3)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(4)), SendResult::kFull);
  EXPECT_THAT(TakeAll(mailbox), ElementsAre(2, 3, 1));
}

TEST(MailboxTest, ControlPrecedesDataThatTheReaderTookOver) {
  Mailbox mailbox({});
  for (int i = 1; i <= 3; ++i) EXPECT_EQ(Push(mailbox, Data(i)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.Take()->message->request_id(), 1u);
  EXPECT_EQ(Push(mailbox, Data(4)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, PeerEvent(5)), SendResult::kAccepted);
  EXPECT_EQ(mailbox.counts().waiting_max, 4u);
  EXPECT_THAT(TakeAll(mailbox), ElementsAre(5, 2, 3, 4));
}

TEST(MailboxTest, FullControlLaneKeepsTheNewestOfAKind) {
  Mailbox mailbox({});
  for (std::size_t i = 0; i < kControlMessagesMax; ++i) ASSERT_EQ(Push(mailbox, PeerEvent(i)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, PeerEvent(1000)), SendResult::kAccepted);
  proto::Message ping;
  ping.mutable_ping();
  Mailbox::Item other;
  other.message = std::move(ping);
  EXPECT_EQ(Push(mailbox, std::move(other)), SendResult::kFull);
  EXPECT_EQ(mailbox.counts().dropped, 2u);
  const auto numbers = TakeAll(mailbox);
  ASSERT_EQ(numbers.size(), kControlMessagesMax);
  EXPECT_EQ(numbers.front(), 0u);
  EXPECT_EQ(numbers[kControlMessagesMax - 2], kControlMessagesMax - 2);
  EXPECT_EQ(numbers.back(), 1000u);
}

TEST(MailboxTest, LatestOfAKeyReplacesTheWaitingOne) {
  Mailbox mailbox(LatestByKey(2));
  EXPECT_EQ(Push(mailbox, Keyed("a", 1, 10)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Keyed("b", 2, 10)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Keyed("a", 3, 15)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Keyed("c", 4, 10)), SendResult::kFull);
  EXPECT_EQ(mailbox.counts().replaced, 1u);
  EXPECT_EQ(mailbox.counts().dropped, 1u);
  EXPECT_EQ(mailbox.counts().bytes, 25u);
  EXPECT_THAT(TakeAll(mailbox), ElementsAre(3, 2));
  EXPECT_EQ(Push(mailbox, Keyed("a", 5)), SendResult::kAccepted);  // Message 3 was taken, so 5 cannot replace it.
  EXPECT_THAT(TakeAll(mailbox), ElementsAre(5));
}

TEST(MailboxTest, AReplacementMayNotExceedTheLimitInBytes) {
  SpawnOptions options = LatestByKey(4);
  options.bytes_max = 100;
  Mailbox mailbox(options);
  EXPECT_EQ(Push(mailbox, Keyed("a", 1, 40)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Keyed("b", 2, 40)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Keyed("a", 3, 61)), SendResult::kFull);
  EXPECT_EQ(Push(mailbox, Keyed("a", 4, 60)), SendResult::kAccepted);
  EXPECT_THAT(TakeAll(mailbox), ElementsAre(4, 2));
}

TEST(MailboxTest, AKeyFunctionThatThrowsGivesNoKey) {
  SpawnOptions options = LatestByKey(4);
  options.key = [](const proto::Message&) -> std::string { throw std::runtime_error("odd"); };
  Mailbox mailbox(options);
  EXPECT_EQ(Push(mailbox, Keyed("a", 1)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Keyed("a", 2)), SendResult::kAccepted);
  EXPECT_THAT(TakeAll(mailbox), ElementsAre(1, 2));
}

TEST(MailboxTest, MessagesWithoutAKeyAreNotReplaced) {
  Mailbox mailbox(LatestByKey(3));
  EXPECT_EQ(Push(mailbox, Keyed("", 1)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Keyed("", 2)), SendResult::kAccepted);
  EXPECT_THAT(TakeAll(mailbox), ElementsAre(1, 2));
}

TEST(MailboxTest, MessagesThatTheReaderTookOverCountUntilTheyAreTaken) {
  Mailbox mailbox({.messages_max = 3});
  for (int i = 1; i <= 3; ++i) EXPECT_EQ(Push(mailbox, Data(i, 10)), SendResult::kAccepted);
  (void)mailbox.Take();
  EXPECT_EQ(mailbox.counts().waiting, 2u);
  EXPECT_EQ(mailbox.counts().bytes, 20u);
  EXPECT_FALSE(mailbox.is_half_free());
  EXPECT_EQ(Push(mailbox, Data(4, 10)), SendResult::kAccepted);
  EXPECT_EQ(Push(mailbox, Data(5, 10)), SendResult::kFull);
  EXPECT_THAT(TakeAll(mailbox), ElementsAre(2, 3, 4));
  EXPECT_EQ(mailbox.counts().bytes, 0u);
  EXPECT_EQ(mailbox.counts().waiting_max, 3u);
  EXPECT_TRUE(mailbox.is_half_free());
}

TEST(MailboxTest, TryPushKeepsARefusedMessageAndDoesNotCountIt) {
  Mailbox mailbox({.messages_max = 1});
  Mailbox::Item item = Data(1);
  EXPECT_EQ(mailbox.TryPush(item).result, SendResult::kAccepted);
  EXPECT_FALSE(item.message);
  item = Data(2);
  EXPECT_EQ(mailbox.TryPush(item).result, SendResult::kFull);
  EXPECT_TRUE(item.message);
  EXPECT_EQ(mailbox.counts().dropped, 0u);
}

TEST(MailboxTest, AnAbsentReaderIsCalledOnce) {
  Mailbox mailbox({.messages_max = 2});
  EXPECT_TRUE(mailbox.Push(Data(1)).must_call_reader);
  EXPECT_FALSE(mailbox.Push(Data(2)).must_call_reader);
  EXPECT_FALSE(mailbox.Push(Data(3)).must_call_reader);  // The mailbox is full.
  EXPECT_FALSE(mailbox.GoAway(/*for_messages=*/true));   // Messages are waiting, so the reader must stay.
  EXPECT_THAT(TakeAll(mailbox), ElementsAre(1, 2));
  EXPECT_TRUE(mailbox.GoAway(/*for_messages=*/true));
  EXPECT_TRUE(mailbox.Push(PeerEvent(4)).must_call_reader);
  EXPECT_FALSE(mailbox.GoAway(/*for_messages=*/true));
  EXPECT_TRUE(mailbox.GoAway(/*for_messages=*/false));  // A reader that handles no messages may leave them waiting.
  EXPECT_TRUE(mailbox.Push(Data(5)).must_call_reader);
}

TEST(MailboxTest, NudgeIsNotMissed) {
  Mailbox mailbox({});
  EXPECT_TRUE(mailbox.Nudge());
  EXPECT_FALSE(mailbox.Nudge());
  // The reader was awake and may have missed the nudge, so it must look for work once more.
  EXPECT_FALSE(mailbox.GoAway(/*for_messages=*/false));
  EXPECT_TRUE(mailbox.GoAway(/*for_messages=*/false));
}

TEST(MailboxTest, AClosedMailboxIsEmptyAndRefuses) {
  Mailbox mailbox(LatestByKey(3));
  (void)Push(mailbox, Timer(1));
  ASSERT_EQ(Push(mailbox, Keyed("a", 2, 10)), SendResult::kAccepted);
  (void)Push(mailbox, PeerEvent(3));
  mailbox.Close();
  EXPECT_TRUE(mailbox.empty());
  EXPECT_EQ(mailbox.counts().bytes, 0u);
  EXPECT_EQ(mailbox.counts().dropped, 0u);
  EXPECT_EQ(mailbox.Take(), nullptr);
  EXPECT_EQ(Push(mailbox, Keyed("a", 4, 10)), SendResult::kUnreachable);
  EXPECT_EQ(Push(mailbox, PeerEvent(5)), SendResult::kUnreachable);
}

TEST(MailboxTest, ATakenMessageOutlivesTheClosingOfTheMailbox) {
  Mailbox mailbox({});
  for (int i = 1; i <= 2; ++i) ASSERT_EQ(Push(mailbox, Data(i)), SendResult::kAccepted);
  const Mailbox::Item* item = mailbox.Take();
  mailbox.Close();
  EXPECT_EQ(item->message->request_id(), 1u);
  EXPECT_EQ(mailbox.Take(), nullptr);
}

TEST(MailboxTest, LosesNoMessageWithManySendersAndASleepingReader) {
  constexpr std::uint64_t kSenders = 3;
  constexpr std::uint64_t kEach = 20'000;
  Mailbox mailbox({.messages_max = 50});
  std::counting_semaphore calls(0);
  std::vector<std::thread> senders;
  for (std::uint64_t sender = 0; sender < kSenders; ++sender) {
    senders.emplace_back([&, sender] {
      for (std::uint64_t i = 0; i < kEach; ++i) {
        Mailbox::Item item = Data(i * kSenders + sender, 1);
        Mailbox::Pushed pushed = mailbox.TryPush(item);
        for (; pushed.result == SendResult::kFull; pushed = mailbox.TryPush(item)) std::this_thread::yield();
        if (pushed.must_call_reader) calls.release();
      }
    });
  }
  std::vector<std::uint64_t> next(kSenders, 0);
  for (std::uint64_t taken = 0; taken < kSenders * kEach;) {
    const Mailbox::Item* item = mailbox.Take();
    if (item == nullptr) {
      if (mailbox.GoAway(/*for_messages=*/true)) calls.acquire();
      continue;
    }
    const std::uint64_t number = item->message->request_id();
    ASSERT_EQ(number / kSenders, next[number % kSenders]++);
    ++taken;
  }
  for (std::thread& sender : senders) sender.join();
  EXPECT_TRUE(mailbox.empty());
  EXPECT_LE(mailbox.counts().waiting_max, 50u);
}

// Compares the mailbox with a model: a list in which a new message replaces the waiting message with the same key.
TEST(MailboxTest, RandomUseAgreesWithAModel) {
  const auto seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 rng(seed);
  Mailbox mailbox(LatestByKey(8));
  std::vector<std::pair<std::string, std::uint64_t>> model;
  for (std::uint64_t number = 1; number <= 20'000; ++number) {
    if (rng() % 3 != 0) {
      const std::string key = rng() % 4 == 0 ? "" : std::string(1, static_cast<char>('a' + rng() % 12));
      const auto same =
          std::find_if(model.begin(), model.end(), [&](const auto& item) { return !key.empty() && item.first == key; });
      const bool has_room = model.size() < 8;
      const SendResult result = Push(mailbox, Keyed(key, number, 1));
      if (same != model.end()) {
        same->second = number;
      } else if (has_room) {
        model.emplace_back(key, number);
      }
      ASSERT_EQ(result, same != model.end() || has_room ? SendResult::kAccepted : SendResult::kFull);
    } else if (!model.empty()) {
      ASSERT_EQ(mailbox.Take()->message->request_id(), model.front().second);
      model.erase(model.begin());
    }
    ASSERT_EQ(mailbox.counts().waiting, model.size());
    ASSERT_EQ(mailbox.counts().bytes, model.size());
  }
}

}  // namespace
}  // namespace moondb
