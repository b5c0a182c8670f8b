#include "apps/moondb_view/channels.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace moondb {
namespace {

Channel Named(const std::string& topic) { return {0, topic, "json", "any", "{}"}; }

TEST(ChannelsTest, AStateKeepsItsNewestMessage) {
  Channels channels;
  const std::uint32_t id = channels.Open(Named("/state"));
  EXPECT_EQ(channels.Open(Named("/state")), id);
  EXPECT_FALSE(channels.FindNext(id, 0));
  channels.Set(id, 10, "one");
  channels.Set(id, 20, "two");
  const auto next = channels.FindNext(id, 0);
  ASSERT_TRUE(next);
  EXPECT_EQ(*next->message.payload, "two");
  EXPECT_EQ(next->message.log_time_ns, 20);
  EXPECT_FALSE(next->has_skipped);
  EXPECT_FALSE(channels.FindNext(id, next->message.version));
  channels.Set(id, 30, "two");
  EXPECT_FALSE(channels.FindNext(id, next->message.version)) << "equal content is no change";
}

TEST(ChannelsTest, ALogKeepsItsLastMessagesAndSaysIfSomeAreGone) {
  Channels channels;
  const std::uint32_t id = channels.Open(Named("/log"));
  channels.Append(id, 0, "first");
  const std::uint64_t first = channels.FindNext(id, 0)->message.version;
  for (std::size_t i = 0; i < Channels::kLogMessagesMax; ++i) channels.Append(id, 0, std::to_string(i));
  EXPECT_EQ(*channels.FindNext(id, first)->message.payload, "0");
  EXPECT_FALSE(channels.FindNext(id, first)->has_skipped);
  channels.Append(id, 0, "one more");
  EXPECT_EQ(*channels.FindNext(id, first)->message.payload, "1");
  EXPECT_TRUE(channels.FindNext(id, first)->has_skipped);
  EXPECT_FALSE(channels.FindNext(id, 0)->has_skipped) << "a new viewer asked for none of them";
}

TEST(ChannelsTest, ClosesTheChannelsOfAPrefix) {
  Channels channels;
  const std::uint32_t map = channels.Open(Named("/map/0_0"));
  channels.Open(Named("/map/1_0"));
  const std::uint32_t log = channels.Open(Named("/log"));
  channels.Set(map, 0, "cells");
  const std::uint64_t before = channels.list_version();
  channels.Close("/map/");
  EXPECT_NE(channels.list_version(), before);
  ASSERT_EQ(channels.List().size(), 1u);
  EXPECT_EQ(channels.List()[0].id, log);
  EXPECT_FALSE(channels.FindNext(map, 0));
  channels.Set(map, 0, "late cells");  // Ignored.
  EXPECT_NE(channels.Open(Named("/map/0_0")), map) << "an id is never used again";
}

TEST(ChannelsTest, HasALimit) {
  Channels channels;
  for (std::size_t i = 0; i < Channels::kChannelsMax; ++i) EXPECT_NE(channels.Open(Named(std::to_string(i))), 0u);
  EXPECT_EQ(channels.Open(Named("one more")), 0u);
  channels.Set(0, 0, "ignored");
}

TEST(ChannelsTest, WakesUntilTheSubscriptionEnds) {
  Channels channels;
  int count = 0;
  auto subscription = channels.OnChange([&count] { ++count; });
  const std::uint32_t id = channels.Open(Named("/state"));
  channels.Set(id, 0, "one");
  channels.Append(id, 0, "two");
  EXPECT_EQ(count, 3);
  EXPECT_EQ(channels.CountSubscriptions(), 1u);
  subscription.reset();
  EXPECT_EQ(channels.CountSubscriptions(), 0u);
  channels.Set(id, 0, "three");
  EXPECT_EQ(count, 3);
}

}  // namespace
}  // namespace moondb
