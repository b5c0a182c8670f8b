#include "runtime/transport/inbound.h"

#include <google/protobuf/unknown_field_set.h>
#include <gtest/gtest.h>

#include <set>
#include <string>
#include <string_view>

#include "runtime/address.h"
#include "runtime/transport/outbound.h"

namespace moondb {
namespace {

proto::Message From(AgentId agent) {
  proto::Message message;
  message.set_hop_sender(agent);
  message.set_source_actor("soil");
  message.set_destination_id(1);
  message.set_destination_actor("soil");
  return message;
}

TEST(InboundTest, AcceptsMessagesOfUsersActors) {
  proto::Message message = From(2);
  message.mutable_custom()->set_value("question");
  const auto parsed = ParsePeerFrame(ToPeerFrame(message), 2);
  ASSERT_TRUE(parsed.has_value()) << ToString(parsed.error());
  ASSERT_EQ(parsed->size(), 1u);
  EXPECT_EQ(parsed->front()->custom().value(), "question");
  EXPECT_EQ(parsed->front()->destination_actor(), "soil");
}

// A peer with a later version of moondb may send unknown fields.
TEST(InboundTest, DropsUnknownFields) {
  proto::Message message = From(2);
  message.GetReflection()->MutableUnknownFields(&message)->AddVarint(900, 1);
  const auto parsed = ParsePeerFrame(ToPeerFrame(message), 2);
  ASSERT_TRUE(parsed.has_value()) << ToString(parsed.error());
  EXPECT_EQ(parsed->front()->SerializeAsString(), From(2).SerializeAsString());
  EXPECT_EQ(parsed->front()->SpaceUsedLong(), From(2).SpaceUsedLong());
}

TEST(InboundTest, AcceptsTheMessagesOfAFrameInOrderOrNone) {
  std::string frame;
  std::set<std::size_t> ends;
  for (int i = 0; i < 3; ++i) {
    proto::Message message = From(2);
    message.set_request_id(i);
    frame += ToPeerFrame(message);
    ends.insert(frame.size());
  }
  const auto parsed = ParsePeerFrame(frame, 2);
  ASSERT_TRUE(parsed.has_value()) << ToString(parsed.error());
  ASSERT_EQ(parsed->size(), 3u);
  for (std::uint64_t i = 0; i < 3; ++i) EXPECT_EQ((*parsed)[i]->request_id(), i);
  EXPECT_EQ(ParsePeerFrame(frame + ToPeerFrame(From(3)), 2).error().code, ErrorCode::kRefused);
  EXPECT_EQ(ParsePeerFrame(frame + ToPeerFrame(From(3)), std::nullopt).error().code, ErrorCode::kRefused);
  EXPECT_EQ(ParsePeerFrame(frame + "garbage", 2).error().code, ErrorCode::kCorrupt);
  for (std::size_t cut = 0; cut < frame.size(); ++cut) {
    const auto part = ParsePeerFrame(std::string_view(frame).substr(0, cut), 2);
    EXPECT_EQ(part.has_value(), ends.contains(cut)) << cut;
  }
}

TEST(InboundTest, RefusesInvalidFrames) {
  const std::string small = ToPeerFrame(From(2));
  std::string many;
  while (many.size() <= kSharedFrameBytesMax) many += small;
  EXPECT_EQ(ParsePeerFrame(many, 2).error().code, ErrorCode::kCorrupt) << "too large to be shared";
  EXPECT_TRUE(ParsePeerFrame(std::string_view(many).substr(small.size()), 2).has_value());
  proto::Message report = From(2);
  report.mutable_link_report();
  EXPECT_TRUE(ParsePeerFrame(ToPeerFrame(report), 2).has_value());
  EXPECT_EQ(ParsePeerFrame(ToPeerFrame(report) + small, 2).error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(ParsePeerFrame(small + ToPeerFrame(report), 2).error().code, ErrorCode::kCorrupt);
  EXPECT_EQ(ParsePeerFrame("", 2).error().code, ErrorCode::kCorrupt);
}

// Every field of the `body` oneof that is not listed in `may_leave` must be refused, including fields that are added
// later.
TEST(InboundTest, RefusesMessagesThatMustNotLeaveTheirAgent) {
  const std::set<std::string> may_leave = {"hello",           "have",          "batch",         "refusal",
                                           "share_request",   "share_reply",   "role_announce", "lease_announce",
                                           "link_report",     "clock_report",  "epoch_report",  "leader_check",
                                           "control_request", "control_reply", "custom",        "role_chain_request",
                                           "role_chain_reply"};
  const auto* bodies = proto::Message::descriptor()->FindOneofByName("body");
  for (int i = 0; i < bodies->field_count(); ++i) {
    const auto* field = bodies->field(i);
    proto::Message message = From(2);
    if (field->message_type() == nullptr) {
      message.GetReflection()->SetString(&message, field, "bytes");
    } else {
      message.GetReflection()->MutableMessage(&message, field);
    }
    const auto parsed = ParsePeerFrame(ToPeerFrame(message), 2);
    EXPECT_EQ(parsed.has_value(), may_leave.contains(field->name())) << field->name();
    if (parsed) continue;
    EXPECT_EQ(parsed.error().code, ErrorCode::kRefused) << field->name();
    EXPECT_EQ(ParseClientFrame(message.SerializeAsString(), "robot", {}, 1).error().code, ErrorCode::kRefused)
        << field->name();
  }
}

TEST(InboundTest, RefusesAnAgentThatClaimsToBeAnother) {
  const std::string frame = ToPeerFrame(From(3));
  EXPECT_EQ(ParsePeerFrame(frame, 2).error().code, ErrorCode::kRefused);
  EXPECT_TRUE(ParsePeerFrame(frame, 3).has_value());
}

TEST(InboundTest, SendsEveryClientMessageToTheGatewayInTheClientsName) {
  proto::Message message = From(2);
  message.mutable_custom()->set_value("question");
  message.set_client_rights(proto::CLIENT_RIGHTS_COMMAND);
  message.set_client_name("operator");
  const auto parsed = ParseClientFrame(message.SerializeAsString(), "robot", {proto::CLIENT_RIGHTS_VIEW, "anna"}, 1);
  ASSERT_TRUE(parsed.has_value()) << ToString(parsed.error());
  EXPECT_EQ((*parsed)->hop_sender(), kClients);
  EXPECT_EQ((*parsed)->source_actor(), "robot");
  EXPECT_EQ((*parsed)->destination_id(), 1u);
  EXPECT_EQ((*parsed)->destination_actor(), actor_name::kGateway);
  EXPECT_EQ((*parsed)->client_rights(), proto::CLIENT_RIGHTS_VIEW);
  EXPECT_EQ((*parsed)->client_name(), "anna");
}

TEST(InboundTest, IgnoresClientRightsInAPeersMessage) {
  proto::Message message = From(2);
  message.set_client_rights(proto::CLIENT_RIGHTS_COMMAND);
  message.set_client_name("operator");
  const auto parsed = ParsePeerFrame(ToPeerFrame(message), 2);
  ASSERT_TRUE(parsed.has_value()) << ToString(parsed.error());
  EXPECT_EQ(parsed->front()->client_rights(), proto::CLIENT_RIGHTS_NONE);
  EXPECT_EQ(parsed->front()->client_name(), "");
}

}  // namespace
}  // namespace moondb
