// Tests that a client's call ends, within its limits, if the agent's answers do not.
#include <gmock/gmock.h>

#include "client/client.h"
#include "proto/control.pb.h"
#include "tests/client/fake_agent.h"

namespace moondb {
namespace {

std::vector<std::string> FramesOf(const proto::ClientMessage& request, const proto::ControlReply& reply) {
  proto::ClientMessage message;
  message.set_request_id(request.request_id());
  *message.mutable_control_reply() = reply;
  return {message.SerializeAsString()};
}

std::unique_ptr<Client> ConnectToFake(const FakeAgent& agent) {
  auto client = Client::Connect(agent.endpoint(), "rover1", {});
  EXPECT_TRUE(client.has_value()) << ToString(client.error());
  return *std::move(client);
}

TEST(AnswerLimitsTest, RowsThatDoNotAscendEndTheReading) {
  FakeAgent agent([](const proto::ClientMessage& request) {
    proto::ControlReply reply;
    reply.mutable_status()->set_agent_id(1);
    reply.mutable_read()->add_records();
    reply.mutable_read()->add_row_ids(1);
    return FramesOf(request, reply);
  });
  const auto next = ConnectToFake(agent)->NextNodeIndex();
  ASSERT_FALSE(next);
  EXPECT_EQ(next.error().code, ErrorCode::kCorrupt);
  EXPECT_LE(agent.requests(), 3);
}

TEST(AnswerLimitsTest, TilesWithoutEndAreRefused) {
  FakeAgent agent([](const proto::ClientMessage& request) {
    proto::ControlReply reply;
    proto::MapTilesReply& tiles = *reply.mutable_map_tiles();
    tiles.set_tile_cells(1);
    for (int i = 0; i < 10'000; ++i) tiles.add_tiles()->set_x(i);
    return FramesOf(request, reply);
  });
  proto::MapTilesRequest request;
  const auto tiles = ConnectToFake(agent)->NextMapTiles(request);
  ASSERT_FALSE(tiles);
  EXPECT_EQ(tiles.error().code, ErrorCode::kCorrupt);
  EXPECT_THAT(tiles.error().text, testing::HasSubstr("more tiles"));
  EXPECT_EQ(agent.requests(), 27);
}

}  // namespace
}  // namespace moondb
