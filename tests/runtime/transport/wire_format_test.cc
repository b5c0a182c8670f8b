// Compares the fields of all messages between agents, and between agents and clients, with the golden file of the wire
// version (docs/COMPATIBILITY.md).
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <set>
#include <string>

#include "model/text.h"
#include "model/wire_version.h"
#include "proto/control.pb.h"
#include "proto/record.pb.h"
#include "runtime/transport/inbound.h"
#include "runtime/transport/outbound.h"

namespace moondb {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;
using testing::IsEmpty;

// Returns true if the transport accepts a message with this body from another agent.
bool MayTravel(const FieldDescriptor& body) {
  proto::Message message;
  message.set_hop_sender(2);
  if (body.message_type() != nullptr) {
    message.GetReflection()->MutableMessage(&message, &body);
  } else {
    message.GetReflection()->SetString(&message, &body, "");
  }
  return ParsePeerFrame(ToPeerFrame(message), 2).has_value();
}

// Lists the fields and enumerators of the wire format as lines such as "Batch.codec = 3 Codec" and
// "Codec.CODEC_PLAIN = 1".
class WireLines {
 public:
  WireLines() {
    AddMessage(*proto::PeerFrame::descriptor());
    AddMessage(*proto::RecordBatch::descriptor());  // Batch.coded contains a serialized RecordBatch.
    AddMessage(*proto::ClientMessage::descriptor());
  }
  const std::set<std::string>& lines() const { return lines_; }

 private:
  static std::string NameOf(const std::string& full_name) {
    const std::string package = "moondb.proto.";
    return full_name.starts_with(package) ? full_name.substr(package.size()) : full_name;
  }

  void AddMessage(const Descriptor& type) {
    if (!type.full_name().starts_with("moondb.") || !seen_.insert(type.full_name()).second) return;
    for (int i = 0; i < type.field_count(); ++i) {
      const FieldDescriptor& field = *type.field(i);
      const bool is_body = field.containing_oneof() != nullptr && &type == proto::Message::descriptor();
      if (!is_body || MayTravel(field)) AddField(field);
    }
  }

  void AddField(const FieldDescriptor& field) {
    std::string type = field.type_name();
    if (const Descriptor* message = field.message_type()) {
      type = NameOf(message->full_name());
      AddMessage(*message);
    }
    if (const EnumDescriptor* values = field.enum_type()) {
      type = NameOf(values->full_name());
      for (int i = 0; i < values->value_count(); ++i) {
        lines_.insert(type + "." + values->value(i)->name() + " = " + std::to_string(values->value(i)->number()));
      }
    }
    lines_.insert(NameOf(field.full_name()) + " = " + std::to_string(field.number()) + " " +
                  (field.is_repeated() ? "repeated " : "") + type);
  }

  std::set<std::string> lines_;
  std::set<std::string> seen_;
};

std::set<std::string> Without(const std::set<std::string>& lines, const std::set<std::string>& others) {
  std::set<std::string> rest;
  std::set_difference(lines.begin(), lines.end(), others.begin(), others.end(), std::inserter(rest, rest.end()));
  return rest;
}

std::set<std::string> LinesOfToday() {
  const WireLines today;
  return today.lines();
}

std::string GoldenFile() {
  return std::string(MOONDB_SOURCE_DIR) + "/tests/runtime/transport/golden/wire_v" + std::to_string(kWireVersion) +
         ".txt";
}

// New fields may change until a release adds them to the golden file.
TEST(WireFormatTest, HasTheFieldsOfItsVersion) {
  const auto text = ReadTextFile(GoldenFile());
  ASSERT_TRUE(text) << ToString(text.error());
  std::set<std::string> golden;
  for (const std::string_view line : Split(*text, '\n')) {
    if (!line.empty()) golden.emplace(line);
  }
  EXPECT_THAT(Without(golden, LinesOfToday()), IsEmpty())
      << "changed or removed: that takes another wire version (docs/COMPATIBILITY.md)";
}

// Writes the golden file. Run this at each release, with --gtest_also_run_disabled_tests and
// --gtest_filter=WireFormatTest.DISABLED_HoldStill.
TEST(WireFormatTest, DISABLED_HoldStill) {
  std::ofstream out(GoldenFile());
  for (const std::string& line : LinesOfToday()) out << line << "\n";
}

}  // namespace
}  // namespace moondb
