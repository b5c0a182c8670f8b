#include "apps/moondb_view/foxglove_viewer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace moondb {
namespace {

using testing::HasSubstr;

class FoxgloveViewerTest : public testing::Test {
 protected:
  FoxgloveViewerTest() {
    state_ = channels_.Open({0, "/state", "json", "any", "{}"});
    log_ = channels_.Open({0, "/log", "protobuf", "foxglove.Log", "\1\2\3\4"});
  }

  // Returns the text of the next frame; empty if there is none.
  std::string NextText() {
    const auto frame = viewer_.Next();
    EXPECT_TRUE(!frame || !frame->is_binary);
    return frame ? frame->bytes : "";
  }
  std::string NextData() {
    const auto frame = viewer_.Next();
    EXPECT_TRUE(!frame || frame->is_binary) << frame->bytes;
    return frame ? frame->bytes : "";
  }
  void Send(const std::string& text) { viewer_.OnMessage({text, false}); }
  void Begin() {
    (void)NextText();
    (void)NextText();
    EXPECT_FALSE(viewer_.Next());
  }
  void Subscribe(std::uint32_t id, std::uint32_t channel) {
    Send(R"({"op":"subscribe","subscriptions":[{"id":)" + std::to_string(id) + R"(,"channelId":)" +
         std::to_string(channel) + "}]}");
  }

  Channels channels_;
  std::uint32_t state_ = 0;
  std::uint32_t log_ = 0;
  FoxgloveViewer viewer_{channels_, "moondb: lab", "run7", [] {}};
};

TEST_F(FoxgloveViewerTest, BeginsWithTheServerAndItsChannels) {
  EXPECT_EQ(NextText(), R"({"op":"serverInfo","name":"moondb: lab","capabilities":[],"supportedEncodings":[],)"
                        R"("metadata":{},"sessionId":"run7"})");
  EXPECT_EQ(NextText(), R"({"op":"advertise","channels":[)"
                        R"({"id":1,"topic":"/state","encoding":"json","schemaName":"any",)"
                        R"("schemaEncoding":"jsonschema","schema":"{}"},)"
                        R"({"id":2,"topic":"/log","encoding":"protobuf","schemaName":"foxglove.Log",)"
                        R"("schemaEncoding":"protobuf","schema":"AQIDBA=="}]})");
  EXPECT_FALSE(viewer_.Next());
}

TEST_F(FoxgloveViewerTest, SendsTheNewestMessageOnEachSubscription) {
  Begin();
  channels_.Set(state_, 0x0102, "old");
  channels_.Set(state_, 0x0102, "new");
  EXPECT_FALSE(viewer_.Next()) << "nobody subscribed";
  Subscribe(5, state_);
  const std::string expected = std::string("\1\5\0\0\0\2\1\0\0\0\0\0\0", 13) + "new";
  EXPECT_EQ(NextData(), expected);
  EXPECT_FALSE(viewer_.Next());
  Send(R"({"op":"unsubscribe","subscriptionIds":[5]})");
  Subscribe(5, state_);
  EXPECT_EQ(NextData(), expected) << "again";
  channels_.Set(state_, 0, "newer");
  EXPECT_THAT(NextData(), HasSubstr("newer"));
}

TEST_F(FoxgloveViewerTest, ServesItsSubscriptionsInTurn) {
  Begin();
  Subscribe(1, state_);
  Subscribe(2, log_);
  for (int i = 0; i < 3; ++i) {
    channels_.Set(state_, 0, "state " + std::to_string(i));
    channels_.Append(log_, 0, "event " + std::to_string(i));
    EXPECT_THAT(NextData(), HasSubstr("state " + std::to_string(i)));
    EXPECT_THAT(NextData(), HasSubstr("event " + std::to_string(i)));
  }
}

TEST_F(FoxgloveViewerTest, StatesDoNotWaitForAllTilesOfTheMap) {
  Channel tile{0, "/map/0", "json", "any", "{}", true};
  for (int i = 0; i < 10; ++i) {
    tile.topic = "/map/" + std::to_string(i);
    channels_.Set(channels_.Open(tile), 0, "tile " + std::to_string(i));
  }
  Begin();
  for (std::uint32_t id = 1; id <= 12; ++id) Subscribe(id, id);
  channels_.Set(state_, 0, "state");
  EXPECT_THAT(NextData(), HasSubstr("tile 0"));
  EXPECT_THAT(NextData(), HasSubstr("state"));
  EXPECT_THAT(NextData(), HasSubstr("tile 1"));
  channels_.Set(state_, 0, "newer state");
  EXPECT_THAT(NextData(), HasSubstr("newer state"));
  EXPECT_THAT(NextData(), HasSubstr("tile 2"));
  EXPECT_THAT(NextData(), HasSubstr("tile 3"));
}

TEST_F(FoxgloveViewerTest, ASlowViewerGetsNewStatesAndHearsOfEventsThatAreGone) {
  Begin();
  Subscribe(1, log_);
  Subscribe(2, state_);
  channels_.Append(log_, 0, "first");
  EXPECT_THAT(NextData(), HasSubstr("first"));
  for (std::size_t i = 0; i < 2 * Channels::kLogMessagesMax; ++i) {
    channels_.Append(log_, 0, "event " + std::to_string(i));
    channels_.Set(state_, 0, "state " + std::to_string(i));
  }
  EXPECT_THAT(NextData(), HasSubstr("state 511"));
  EXPECT_THAT(NextData(), HasSubstr("event 256"));
  EXPECT_THAT(NextText(), HasSubstr("too slow: events were dropped"));
  EXPECT_THAT(NextData(), HasSubstr("event 257"));
}

TEST_F(FoxgloveViewerTest, AnnouncesNewAndRemovedChannels) {
  Begin();
  for (int i = 0; i < 20; ++i) channels_.Open({0, "/map/" + std::to_string(i), "json", "any", "{}"});
  EXPECT_THAT(NextText(), HasSubstr(R"("id":18,)")) << "16 at once";
  EXPECT_THAT(NextText(), HasSubstr(R"("id":22,)"));
  Subscribe(1, 22);
  channels_.Close("/map/");
  EXPECT_THAT(NextText(), HasSubstr(R"({"op":"unadvertise","channelIds":[3,4,)"));
  EXPECT_FALSE(viewer_.Next());
  Subscribe(2, 22);
  EXPECT_THAT(NextText(), HasSubstr("there is no channel 22"));
}

TEST_F(FoxgloveViewerTest, RefusesWhatItDoesNotKnow) {
  Begin();
  viewer_.OnMessage({"\1data", true});
  EXPECT_THAT(NextText(), HasSubstr(R"("op":"status","level":2,"message":"this server accepts no data)"));
  for (const char* text : {"", "nonsense", "[]", R"({"op":7)", R"({"op":"subscribe","subscriptions":[{"id":-1}]})"}) {
    Send(text);
    EXPECT_THAT(NextText(), HasSubstr(R"("level":2)")) << text;
  }
  Send(R"({"op":"getParameters","parameterNames":[]})");
  EXPECT_THAT(NextText(), HasSubstr(R"(the operation \"getParameters\" is not supported)"));
  Subscribe(1, state_);
  Subscribe(1, log_);
  EXPECT_THAT(NextText(), HasSubstr("the subscription 1 exists already"));
  for (int i = 0; i < 1000; ++i) Send("nonsense");
  std::size_t count = 0;
  while (viewer_.Next()) ++count;
  EXPECT_EQ(count, FoxgloveViewer::kStatusesMax) << "a viewer cannot fill the memory with errors";
}

TEST_F(FoxgloveViewerTest, HasALimitOfSubscriptions) {
  Begin();
  for (std::uint32_t id = 0; id <= FoxgloveViewer::kSubscriptionsMax; ++id) Subscribe(id, state_);
  EXPECT_THAT(NextText(), HasSubstr("too many subscriptions"));
}

}  // namespace
}  // namespace moondb
