#include "actors/sharing/have_collector.h"

#include <gtest/gtest.h>

#include "model/have_page.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

using Taken = HaveCollector::Taken;

RecordKey KeyOf(std::uint64_t epoch, std::uint64_t seq = 1) { return {{3, epoch, proto::POWER}, seq}; }

proto::Have Page(const RecordKey& from, const RecordKey& next, const HaveSet& have) {
  proto::Have page;
  if (from != RecordKey()) *page.mutable_have_from() = ToProto(from);
  if (next != RecordKey()) *page.mutable_have_next() = ToProto(next);
  *page.mutable_have() = ToProto(have);
  return page;
}

HaveSet OneRecord(const RecordKey& key) {
  HaveSet have;
  have[key.stream].held.Add(key.seq);
  return have;
}

HaveSet Streams(std::uint64_t first_epoch, int count) {
  HaveSet have;
  for (int i = 0; i < count; ++i) have[KeyOf(first_epoch + static_cast<std::uint64_t>(i)).stream].held.Add(1);
  return have;
}

class HaveCollectorTest : public testing::Test {
 protected:
  ErrorCode RefusalOf(const proto::Have& page) {
    const auto taken = collector_.Take(page);
    return taken ? ErrorCode::kInternal : taken.error().code;
  }

  HaveCollector collector_;
  const proto::Have first_ = Page({}, KeyOf(5), OneRecord(KeyOf(1)));
  const proto::Have second_ = Page(KeyOf(5), KeyOf(7, 10), OneRecord(KeyOf(7, 9)));
  const proto::Have last_ = Page(KeyOf(7, 10), {}, OneRecord(KeyOf(7, 10)));
};

TEST_F(HaveCollectorTest, AcceptsOnePageAsTheWholeSet) {
  EXPECT_EQ(*collector_.Take(Page({}, {}, OneRecord(KeyOf(1)))), Taken::kLastPage);
  EXPECT_EQ(collector_.TakeWhole(), OneRecord(KeyOf(1)));
  EXPECT_FALSE(collector_.is_begun());
}

TEST_F(HaveCollectorTest, AcceptsEachPageOnceInOrder) {
  EXPECT_EQ(*collector_.Take(second_), Taken::kNothing);
  EXPECT_EQ(*collector_.Take(first_), Taken::kPage);
  EXPECT_EQ(*collector_.Take(first_), Taken::kNothing);
  EXPECT_EQ(*collector_.Take(last_), Taken::kNothing);
  EXPECT_EQ(collector_.next(), KeyOf(5));
  EXPECT_EQ(*collector_.Take(second_), Taken::kPage);
  EXPECT_EQ(*collector_.Take(first_), Taken::kNothing);
  EXPECT_EQ(*collector_.Take(last_), Taken::kLastPage);
  HaveSet whole = OneRecord(KeyOf(1));
  whole[KeyOf(7).stream].held.Add({9, 10});
  EXPECT_EQ(collector_.TakeWhole(), whole);
}

TEST_F(HaveCollectorTest, RefusesAPageWithStreamsOutsideItsRange) {
  for (const proto::Have& page :
       {Page(KeyOf(5), {}, OneRecord(KeyOf(4))), Page(KeyOf(5), {}, OneRecord(KeyOf(1))),
        Page(KeyOf(5), KeyOf(7), OneRecord(KeyOf(7))), Page(KeyOf(5), KeyOf(7), OneRecord(KeyOf(8))),
        Page(KeyOf(5), KeyOf(7, 10), OneRecord(KeyOf(7, 10)))}) {
    EXPECT_EQ(*collector_.Take(first_), Taken::kPage);
    EXPECT_EQ(RefusalOf(page), ErrorCode::kInvalid) << page.ShortDebugString();
    EXPECT_FALSE(collector_.is_begun()) << "it restarted";
  }
}

TEST_F(HaveCollectorTest, RefusesPagesThatMakeNoProgress) {
  for (const proto::Have& page : {Page(KeyOf(5), KeyOf(5), OneRecord(KeyOf(5))),
                                  Page(KeyOf(5), KeyOf(4), OneRecord(KeyOf(5))), Page(KeyOf(5), KeyOf(9), HaveSet())}) {
    EXPECT_EQ(*collector_.Take(first_), Taken::kPage);
    EXPECT_EQ(RefusalOf(page), ErrorCode::kInvalid) << page.ShortDebugString();
  }
}

TEST_F(HaveCollectorTest, RefusesPagesWithoutEnd) {
  int pages = 0;
  RecordKey from;
  for (std::uint64_t epoch = 1; pages < 10'000; ++epoch, ++pages) {
    const auto taken = collector_.Take(Page(from, KeyOf(epoch + 1), OneRecord(KeyOf(epoch))));
    if (!taken) break;
    from = KeyOf(epoch + 1);
  }
  EXPECT_EQ(pages, kHavePagesMax - 1);
}

TEST_F(HaveCollectorTest, RefusesMoreThanAHaveSetMayHold) {
  constexpr int kOfAPage = kHaveStreamsMax / 4;
  std::uint64_t epoch = 1;
  RecordKey from;
  for (int i = 0; i < 4; ++i, epoch += kOfAPage) {
    ASSERT_EQ(*collector_.Take(Page(from, KeyOf(epoch + kOfAPage), Streams(epoch, kOfAPage))), Taken::kPage);
    from = KeyOf(epoch + kOfAPage);
  }
  HaveCollector full = collector_;
  EXPECT_EQ(*full.Take(Page(from, {}, HaveSet())), Taken::kLastPage) << "so many may be";
  EXPECT_EQ(full.TakeWhole().streams().size(), static_cast<std::size_t>(kHaveStreamsMax));
  EXPECT_EQ(RefusalOf(Page(from, {}, Streams(epoch, 1))), ErrorCode::kInvalid);
}

TEST_F(HaveCollectorTest, CountsAStreamSplitAcrossPagesOnce) {
  HaveSet all_but_one = Streams(1, kHaveStreamsMax);
  const std::uint64_t last = kHaveStreamsMax;
  ASSERT_EQ(*collector_.Take(Page({}, KeyOf(last, 2), all_but_one)), Taken::kPage);
  EXPECT_EQ(*collector_.Take(Page(KeyOf(last, 2), {}, OneRecord(KeyOf(last, 5)))), Taken::kLastPage);
}

}  // namespace
}  // namespace moondb
