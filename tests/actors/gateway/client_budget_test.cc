#include "actors/gateway/client_budget.h"

#include <gmock/gmock.h>

#include "actors/gateway/request_check.h"

namespace moondb {
namespace {

proto::ControlRequest Read(std::uint32_t content_bytes_max) {
  proto::ControlRequest request;
  request.mutable_read()->set_content_bytes_max(content_bytes_max);
  return request;
}

TEST(ClientBudgetTest, RequestsCountToTheirKeyOrAgentOrConnection) {
  EXPECT_EQ(OwnerOf("anna", 0, "k1"), OwnerOf("anna", 0, "k2"));
  EXPECT_EQ(OwnerOf("", 2, "actor1"), OwnerOf("", 2, "actor2"));
  EXPECT_NE(OwnerOf("", 0, "1"), OwnerOf("", 0, "2"));
  EXPECT_NE(OwnerOf("2", 0, ""), OwnerOf("", 2, ""));
}

TEST(ClientBudgetTest, AReadCountsWithItsPage) {
  EXPECT_EQ(AnswerBytesOf(Read(0), /*is_relayed=*/false), kReadContentBytesDefault);
  EXPECT_EQ(AnswerBytesOf(Read(5000), /*is_relayed=*/false), 5000u);
  EXPECT_EQ(AnswerBytesOf(Read(1u << 31), /*is_relayed=*/false), kReadContentBytesMax);
  EXPECT_EQ(AnswerBytesOf(Read(1u << 31), /*is_relayed=*/true), kRelayedContentBytesMax);
}

TEST(ClientBudgetTest, TheReadOfAKeyHasASmallerPage) {
  proto::ControlRequest request = Read(1u << 31);
  BoundKeyedPage(request);
  EXPECT_EQ(request.read().content_bytes_max(), kKeyedContentBytesMax);
  request = Read(0);
  BoundKeyedPage(request);
  EXPECT_EQ(AnswerBytesOf(request, /*is_relayed=*/false), kReadContentBytesDefault);
}

TEST(ClientBudgetTest, OnlyRequestsForPagesTakeTurns) {
  EXPECT_TRUE(TakesTurns(Read(1)));
  proto::ControlRequest request;
  request.mutable_map_tiles();
  EXPECT_TRUE(TakesTurns(request));
  request.mutable_map_tiles()->set_wait_s(5);
  EXPECT_FALSE(TakesTurns(request)) << "others of the client would wait until the map changes";
  request.mutable_insert();
  EXPECT_FALSE(TakesTurns(request));
  request.mutable_status();
  EXPECT_FALSE(TakesTurns(request));
}

TEST(ClientBudgetTest, RefusesAnAnswerBeyondTheBytesOfAKey) {
  constexpr std::size_t kPage = kReadContentBytesMax;
  EXPECT_TRUE(CheckAnswerBytes({.own_bytes = kPage}, kPage));
  EXPECT_TRUE(CheckAnswerBytes({.unread_bytes = kPage}, kPage));
  const Result<void> refused = CheckAnswerBytes({.own_bytes = kPage, .unread_bytes = 1}, kPage);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kFull);
  EXPECT_THAT(refused.error().text, testing::HasSubstr("read those answers, then ask again"));
  EXPECT_TRUE(CheckAnswerBytes({}, kAnswerBytesOfKeyMax + 1)) << "no other answer is on its way";
}

TEST(ClientBudgetTest, RefusesARequestBeyondTheNumberOfAClient) {
  const ClientLimits limits{.pending_of_client_max = 2, .waits_of_client_max = 1};
  EXPECT_TRUE(CheckRequestCount(limits, {.own = 1, .own_waits = 1}, /*is_wait=*/false, ""));
  EXPECT_FALSE(CheckRequestCount(limits, {.own = 1, .own_waits = 1}, /*is_wait=*/true, ""));
  EXPECT_FALSE(CheckRequestCount(limits, {.own = 2}, /*is_wait=*/false, ""));
  EXPECT_FALSE(CheckRequestCount(limits, {.own_relays = 8}, /*is_wait=*/false, "rover2"));
  EXPECT_TRUE(CheckRequestCount(limits, {.own_relays = 8}, /*is_wait=*/false, ""));
}

}  // namespace
}  // namespace moondb
