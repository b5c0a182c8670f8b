#include "model/control_message.h"

#include <gtest/gtest.h>

#include "proto/control.pb.h"
#include "proto/message.pb.h"

namespace moondb {
namespace {

proto::ControlRequest ReadFrom(std::uint64_t row) {
  proto::ControlRequest request;
  request.mutable_read()->set_after_row_id(row);
  return request;
}

TEST(ControlMessageTest, UnpacksTheBodyThatWasPacked) {
  const proto::Message message = MessageOf(ReadFrom(7));
  EXPECT_EQ(message.ms_type(), proto::CONTROL);
  const auto request = ControlRequestOf(message);
  ASSERT_TRUE(request);
  EXPECT_EQ(request->read().after_row_id(), 7u);
  proto::ControlReply reply;
  reply.mutable_read()->add_row_ids(9);
  const auto again = ControlReplyOf(MessageOf(reply));
  ASSERT_TRUE(again);
  EXPECT_EQ(again->read().row_ids(0), 9u);
}

// The agent parses a client's ClientMessage as a Message, so equal fields must have equal numbers.
TEST(ControlMessageTest, AClientMessageHasTheSameBytes) {
  proto::ClientMessage sent;
  sent.set_request_id(42);
  *sent.mutable_control_request() = ReadFrom(7);
  proto::Message message;
  ASSERT_TRUE(message.ParseFromString(sent.SerializeAsString()));
  EXPECT_EQ(message.request_id(), 42u);
  const auto request = ControlRequestOf(message);
  ASSERT_TRUE(request);
  EXPECT_EQ(request->read().after_row_id(), 7u);

  proto::Message answer = ErrorMessage({ErrorCode::kFull, "later", "read"});
  answer.set_request_id(42);
  proto::ClientMessage received;
  ASSERT_TRUE(received.ParseFromString(answer.SerializeAsString()));
  EXPECT_EQ(received.request_id(), 42u);
  EXPECT_EQ(received.control_reply().error().text(), "later");
}

TEST(ControlMessageTest, ReportsErrorsOfABody) {
  EXPECT_EQ(ControlRequestOf(ErrorMessage({})).error().code, ErrorCode::kInvalid);
  EXPECT_EQ(ControlReplyOf(MessageOf(ReadFrom(7))).error().code, ErrorCode::kInvalid);
  proto::Message damaged;
  damaged.set_control_request("\xff\xff");
  EXPECT_EQ(ControlRequestOf(damaged).error().code, ErrorCode::kCorrupt);
  proto::ControlRequest many;  // Each record takes two bytes on the wire, but much more in memory.
  for (int i = 0; i < 300'000; ++i) many.mutable_insert()->add_records();
  EXPECT_EQ(ControlRequestOf(MessageOf(many)).error().code, ErrorCode::kCorrupt);
}

TEST(ControlMessageTest, FailsWithTheErrorOfAReply) {
  const Result<void> refused = CheckControlReply(ErrorMessage({ErrorCode::kFull, "later", "read"}));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kFull);
  EXPECT_EQ(refused.error().text, "later");
  EXPECT_EQ(refused.error().field, "read");
  EXPECT_TRUE(CheckControlReply(MessageOf(proto::ControlReply())));
  EXPECT_FALSE(CheckControlReply({}));
}

}  // namespace
}  // namespace moondb
