#include "runtime/transport/unread_replies.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

constexpr std::uint64_t kMiB = 1024 * 1024;

class UnreadRepliesTest : public testing::Test {
 protected:
  // Counts a reply of `bytes` bytes as sent. Returns false, and counts nothing, if there is no room.
  bool Give(const std::string& route, std::uint64_t bytes) {
    if (!replies_.HasRoom(route, bytes)) return false;
    replies_.Count(route, bytes);
    return true;
  }

  std::map<int, std::uint64_t> acked_;  // Bytes that the peer's kernel has acknowledged, by file descriptor.
  UnreadReplies replies_{[this](int file) -> std::optional<std::uint64_t> {
    const auto found = acked_.find(file);
    return found == acked_.end() ? std::nullopt : std::optional(found->second);
  }};
};

TEST_F(UnreadRepliesTest, LimitsUnreadRepliesOfAllConnectionsOfAKey) {
  for (const int file : {1, 2}) {
    acked_[file] = 1000;
    replies_.OnRequest("route" + std::to_string(file), "anna", file);
  }
  EXPECT_TRUE(Give("route1", 5 * kMiB));
  EXPECT_FALSE(Give("route2", 5 * kMiB)) << "8 MiB of one key";
  EXPECT_TRUE(Give("route2", 3 * kMiB));
  acked_[1] += 5 * kMiB;
  EXPECT_TRUE(Give("route2", 5 * kMiB)) << "the first one was read";
}

TEST_F(UnreadRepliesTest, AReplyLargerThanTheLimitHasRoomIfNoneIsUnread) {
  acked_[1] = 0;
  replies_.OnRequest("route", "anna", 1);
  EXPECT_TRUE(Give("route", 30 * kMiB));
  EXPECT_FALSE(Give("route", 1));
  acked_[1] += 29 * kMiB;
  EXPECT_TRUE(Give("route", kMiB));
}

TEST_F(UnreadRepliesTest, LimitsUnreadRepliesOfAllKeys) {
  for (int file = 1; file <= 5; ++file) {
    acked_[file] = 0;
    const std::string name = std::to_string(file);
    replies_.OnRequest(name, name, file);
    EXPECT_EQ(Give(name, 8 * kMiB), file <= 4) << file;
  }
}

TEST_F(UnreadRepliesTest, AClosedConnectionDoesNotCountEvenIfItsFileIsReused) {
  acked_[1] = 1000;
  replies_.OnRequest("gone", "anna", 1);
  EXPECT_TRUE(Give("gone", 8 * kMiB));
  acked_.erase(1);
  acked_[2] = 0;
  replies_.OnRequest("next", "anna", 2);
  EXPECT_TRUE(Give("next", 8 * kMiB));
  acked_[1] = 10;  // The kernel reused file descriptor 1 for a new connection.
  acked_[3] = 0;
  replies_.OnRequest("third", "bert", 3);
  EXPECT_TRUE(Give("third", 8 * kMiB));
}

TEST_F(UnreadRepliesTest, ForgetsAConnectionWhoseFileIsReused) {
  acked_[1] = 0;
  replies_.OnRequest("gone", "anna", 1);
  replies_.OnRequest("next", "bert", 1);
  EXPECT_TRUE(Give("next", kMiB));
  EXPECT_EQ(replies_.OfKey("anna"), 0u);
  EXPECT_EQ(replies_.OfKey("bert"), kMiB);
}

TEST_F(UnreadRepliesTest, CountsAReplyOfAKeyFromItsCreationUntilItIsAcknowledged) {
  acked_[1] = 1000;
  replies_.OnRequest("route", "anna", 1);
  replies_.AddWaiting("anna", 5 * kMiB);
  replies_.AddWaiting("anna", kMiB);
  replies_.AddWaiting("bert", kMiB);
  EXPECT_EQ(replies_.OfKey("anna"), 6 * kMiB);
  EXPECT_TRUE(Give("route", 5 * kMiB));
  replies_.RemoveWaiting("anna", 5 * kMiB);
  EXPECT_EQ(replies_.OfKey("anna"), 6 * kMiB);
  acked_[1] += 2 * kMiB;
  EXPECT_EQ(replies_.OfKey("anna"), 4 * kMiB);
  replies_.RemoveWaiting("anna", kMiB);  // The reply was dropped.
  acked_[1] += 3 * kMiB;
  EXPECT_EQ(replies_.OfKey("anna"), 0u);
  EXPECT_EQ(replies_.OfKey("bert"), kMiB);
}

TEST_F(UnreadRepliesTest, AnUnknownRoutingIdHasRoom) { EXPECT_TRUE(Give("unknown", 100 * kMiB)); }

}  // namespace
}  // namespace moondb
