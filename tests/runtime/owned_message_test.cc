#include "runtime/owned_message.h"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/runtime/scripted_actor.h"

namespace moondb {
namespace {

// Number of text fields in a message. A reused message may keep their string objects.
constexpr std::size_t kTexts = 4;

// Sets the field. A text is long enough to allocate memory of its own.
void Fill(proto::Message* message, const google::protobuf::FieldDescriptor& field) {
  const auto& reflection = *message->GetReflection();
  switch (field.cpp_type()) {
    case google::protobuf::FieldDescriptor::CPPTYPE_UINT32:
      return reflection.SetUInt32(message, &field, 7);
    case google::protobuf::FieldDescriptor::CPPTYPE_UINT64:
      return reflection.SetUInt64(message, &field, 7);
    case google::protobuf::FieldDescriptor::CPPTYPE_ENUM:
      return reflection.SetEnumValue(message, &field, 1);
    case google::protobuf::FieldDescriptor::CPPTYPE_STRING:
      return reflection.SetString(message, &field, std::string(10'000, 'x'));
    case google::protobuf::FieldDescriptor::CPPTYPE_MESSAGE:
      (void)reflection.MutableMessage(message, &field);
      return;
    default:
      FAIL() << "a field of a new kind: " << field.full_name();
  }
}

TEST(OwnedMessageTest, AReusedMessageIsEmpty) {
  const auto& type = *proto::Message::descriptor();
  for (int i = 0; i < type.field_count(); ++i) {
    const auto& field = *type.field(i);
    SCOPED_TRACE(field.full_name());
    {
      OwnedMessage message;
      Fill(&*message, field);
      EXPECT_NE(message->SerializeAsString(), "");
    }
    const OwnedMessage next;
    EXPECT_EQ(next->SerializeAsString(), "");
    EXPECT_LE(next->SpaceUsedLong(), proto::Message().SpaceUsedLong() + kTexts * sizeof(std::string));
  }
}

TEST(OwnedMessageTest, TheMemoryOfAClearedTextIsReleased) {
  {
    OwnedMessage message;
    message->set_sql(std::string(10'000, 'x'));
    message->clear_sql();
    EXPECT_GT(message->SpaceUsedLong(), 10'000u);
  }
  EXPECT_LT(OwnedMessage()->SpaceUsedLong(), 1000u);
}

TEST(OwnedMessageTest, HasOneOwner) {
  OwnedMessage first = Numbered(1);
  OwnedMessage second = std::move(first);
  EXPECT_TRUE(first == nullptr);  // NOLINT(bugprone-use-after-move): null after a move, like std::unique_ptr.
  EXPECT_EQ(second->request_id(), 1u);
  second = Numbered(2);
  EXPECT_EQ(second->request_id(), 2u);
  second = nullptr;
  EXPECT_FALSE(second);
}

// One thread creates the messages and another thread releases them. kCount is larger than the number of messages that
// threads exchange in one step.
TEST(OwnedMessageTest, ManyMessagesMoveBetweenThreads) {
  constexpr std::uint64_t kCount = 1000;
  for (int round = 0; round < 3; ++round) {
    std::vector<OwnedMessage> messages;
    std::thread([&] {
      for (std::uint64_t i = 0; i < kCount; ++i) messages.push_back(Numbered(i));
    }).join();
    std::set<const proto::Message*> places;
    for (std::uint64_t i = 0; i < kCount; ++i) {
      EXPECT_EQ(messages[i]->request_id(), i);
      places.insert(&*messages[i]);
    }
    EXPECT_EQ(places.size(), kCount);
  }
}

}  // namespace
}  // namespace moondb
