#include "runtime/transport/outbound.h"

#include <gtest/gtest.h>

#include <vector>

#include "proto/types.pb.h"

namespace moondb {
namespace {

proto::Message Data(std::uint32_t data_type) {
  proto::Message message;
  message.set_ms_type(proto::DATA);
  message.set_data_type(data_type);
  return message;
}

TEST(OutboundTest, OrdersControlThenTheSharingClasses) {
  proto::Message control;
  control.set_ms_type(proto::CONTROL);
  proto::Message acknowledgment = Data(proto::LOCAL_TRAVERSABILITY_MAP);
  acknowledgment.set_ms_type(proto::ACKNOWLEDGMENT);
  EXPECT_EQ(OutboundClassOf(control), kControlClass);
  EXPECT_EQ(OutboundClassOf(acknowledgment), kControlClass);

  std::size_t previous = kControlClass;
  for (const std::uint32_t type :
       std::vector<std::uint32_t>{proto::TEMPERATURE, proto::POSE_GRAPH_NODE, proto::POSE_GRAPH_EDGE,
                                  proto::OPTIMIZED_POSE, 1000, proto::LOCAL_TRAVERSABILITY_MAP}) {
    SCOPED_TRACE(type);
    EXPECT_GT(OutboundClassOf(Data(type)), previous);
    previous = OutboundClassOf(Data(type));
  }
  EXPECT_EQ(previous + 1, kOutboundClasses);
}

TEST(OutboundTest, ReplacesOnlyMessagesWhoseNewestVersionIsComplete) {
  proto::Message announce;
  announce.set_destination_actor("role");
  announce.mutable_role_announce();
  proto::Message reply = announce;
  reply.mutable_role_announce()->set_is_reply(true);
  EXPECT_EQ(ReplaceKeyOf(announce), ReplaceKeyOf(announce));
  EXPECT_NE(ReplaceKeyOf(announce), "");
  EXPECT_NE(ReplaceKeyOf(announce), ReplaceKeyOf(reply));

  proto::Message lease;
  lease.mutable_lease_announce();
  EXPECT_NE(ReplaceKeyOf(lease), "");

  proto::Message sync;
  sync.set_source_actor("sync");
  sync.mutable_hello()->set_kind(proto::SHARING_KIND_SYNC);
  proto::Message replication = sync;
  replication.mutable_hello()->set_kind(proto::SHARING_KIND_REPLICATION);
  EXPECT_NE(ReplaceKeyOf(sync), ReplaceKeyOf(replication));
  proto::Message other_actor = sync;
  other_actor.set_source_actor("replica");
  EXPECT_NE(ReplaceKeyOf(sync), ReplaceKeyOf(other_actor));

  for (const auto& make : std::vector<void (*)(proto::Message&)>{
           [](proto::Message& m) { m.mutable_have(); }, [](proto::Message& m) { m.mutable_batch(); },
           [](proto::Message& m) { m.mutable_refusal(); }, [](proto::Message& m) { m.mutable_share_request(); },
           [](proto::Message& m) { m.mutable_custom(); }}) {
    proto::Message message;
    make(message);
    EXPECT_EQ(ReplaceKeyOf(message), "") << message.ShortDebugString();
  }
}

TEST(OutboundTest, SerialisesIntoTheFrame) {
  proto::Message message = Data(proto::POWER);
  EXPECT_EQ(ToClientFrame(message, message.ByteSizeLong()).text(), message.SerializeAsString());
  for (const std::size_t bytes : {0, 1, 100, 20'000, 3'000'000}) {
    message.set_record_id(std::string(bytes, 'x'));
    proto::PeerFrame frame;
    *frame.add_messages() = message;
    EXPECT_EQ(ToPeerFrame(message), frame.SerializeAsString()) << bytes;
    EXPECT_LE(ToPeerFrame(message).size(), message.ByteSizeLong() + kPeerFrameBytesMore);
  }
}

}  // namespace
}  // namespace moondb
