#include "apps/moondb_sim/own_inserts.h"

#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

proto::Message Request(std::uint64_t request_id) {
  proto::Message message;
  message.set_request_id(request_id);
  message.mutable_insert_request()->add_records()->mutable_power();
  return message;
}

proto::Message Reply(std::uint64_t request_id, std::uint64_t seq) {
  proto::Message message;
  message.set_request_id(request_id);
  *message.mutable_insert_reply()->add_keys() = ToProto(RecordKey{{1, 5, proto::POWER}, seq});
  return message;
}

TEST(OwnInsertsTest, AnAnsweredInsertIsStoredOnce) {
  OwnInserts inserts;
  inserts.OnRequest(1, Request(7));
  inserts.OnRequest(2, Request(7));
  const auto stored = inserts.OnReply(1, Reply(7, 3));
  ASSERT_EQ(stored.size(), 1u);
  EXPECT_EQ(stored[0].first.seq, 3u);
  EXPECT_TRUE(stored[0].second.has_power());
  EXPECT_TRUE(inserts.OnReply(1, Reply(7, 3)).empty());
  EXPECT_EQ(inserts.OnReply(2, Reply(7, 3)).size(), 1u);
}

TEST(OwnInsertsTest, InsertsRefusedOrRequestedBeforeARestartAreNotStored) {
  OwnInserts inserts;
  inserts.OnRequest(1, Request(7));
  proto::Message refused = Reply(7, 3);
  refused.mutable_insert_reply()->mutable_error()->set_code(proto::ERROR_CODE_FULL);
  EXPECT_TRUE(inserts.OnReply(1, refused).empty());
  inserts.OnRequest(1, Request(8));
  EXPECT_TRUE(inserts.Forget(1));
  EXPECT_FALSE(inserts.Forget(1));
  EXPECT_TRUE(inserts.OnReply(1, Reply(8, 3)).empty());
}

}  // namespace
}  // namespace moondb::simulation
