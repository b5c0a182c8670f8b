#include "runtime/inbound.h"

#include <gtest/gtest.h>

#include "runtime/address.h"

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

TEST(InboundTest, LetsTheWordsOfUsersActorsThrough) {
  proto::Message message = From(2);
  message.mutable_custom()->set_value("question");
  const auto parsed = ParsePeerFrame(message.SerializeAsString(), 2);
  ASSERT_TRUE(parsed.has_value()) << ToString(parsed.error());
  EXPECT_EQ((*parsed)->custom().value(), "question");
  EXPECT_EQ((*parsed)->destination_actor(), "soil");
}

TEST(InboundTest, RefusesWhatMustNotLeaveItsAgent) {
  for (const int body : {20, 21, 22, 23, 30, 33, 40, 47}) {
    proto::Message message = From(2);
    const auto* field = proto::Message::descriptor()->FindFieldByNumber(body);
    ASSERT_NE(field, nullptr) << body;
    message.GetReflection()->MutableMessage(&message, field);
    const std::string frame = message.SerializeAsString();
    EXPECT_EQ(ParsePeerFrame(frame, 2).error().code, ErrorCode::kRefused) << field->name();
    EXPECT_EQ(ParseClientFrame(frame, "robot", 1).error().code, ErrorCode::kRefused) << field->name();
  }
}

TEST(InboundTest, RefusesAnAgentThatClaimsToBeAnother) {
  const std::string frame = From(3).SerializeAsString();
  EXPECT_EQ(ParsePeerFrame(frame, 2).error().code, ErrorCode::kRefused);
  EXPECT_TRUE(ParsePeerFrame(frame, 3).has_value());
}

TEST(InboundTest, GivesWhateverAClientWritesToTheGatewayInTheClientsName) {
  proto::Message message = From(2);
  message.mutable_custom()->set_value("question");
  const auto parsed = ParseClientFrame(message.SerializeAsString(), "robot", 1);
  ASSERT_TRUE(parsed.has_value()) << ToString(parsed.error());
  EXPECT_EQ((*parsed)->hop_sender(), kClients);
  EXPECT_EQ((*parsed)->source_actor(), "robot");
  EXPECT_EQ((*parsed)->destination_id(), 1u);
  EXPECT_EQ((*parsed)->destination_actor(), actor_name::kGateway);
}

}  // namespace
}  // namespace moondb
