#include "model/bounded_parse.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/wire_format_lite.h>

#include <cstdint>

namespace moondb {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::FieldDescriptor;
using google::protobuf::internal::WireFormatLite;
using google::protobuf::io::CodedInputStream;

// Messages of at most these sizes in bytes are parsed without counting their parts (kParsedPartsMax): such messages are
// too small to have many parts.
constexpr std::size_t kUncountedBytesMax = 64 * 1024;
constexpr std::size_t kUncountedPeerBytesMax = 1024;
constexpr int kDepthMax = 100;  // Protobuf's own recursion limit.

// Returns the minimum size in bytes of one element of a packed list.
std::size_t ElementBytesMin(const FieldDescriptor& field) {
  switch (field.type()) {
    case FieldDescriptor::TYPE_DOUBLE:
    case FieldDescriptor::TYPE_FIXED64:
    case FieldDescriptor::TYPE_SFIXED64:
      return 8;
    case FieldDescriptor::TYPE_FLOAT:
    case FieldDescriptor::TYPE_FIXED32:
    case FieldDescriptor::TYPE_SFIXED32:
      return 4;
    default:
      return 1;
  }
}

// Subtracts the number of parts of a message from `left`. Returns false if the message has more parts than `left`, or
// contains a group. Stops at bytes that do not decode and returns true, because the parser rejects such bytes.
bool CountParts(const Descriptor& type, int depth, CodedInputStream& in, std::size_t& left) {
  while (const std::uint32_t tag = in.ReadTag()) {
    const FieldDescriptor* field = type.FindFieldByNumber(WireFormatLite::GetTagFieldNumber(tag));
    const bool is_message = field != nullptr && field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    const bool is_part = field == nullptr || field->is_repeated() || is_message;
    const WireFormatLite::WireType wire_type = WireFormatLite::GetTagWireType(tag);
    if (wire_type == WireFormatLite::WIRETYPE_START_GROUP)
      return false;  // The messages of this project have no groups.
    if (is_part && left-- == 0) return false;
    const bool is_packed =
        field != nullptr && field->is_packable() && wire_type == WireFormatLite::WIRETYPE_LENGTH_DELIMITED;
    if (is_packed) {
      std::uint32_t length = 0;
      if (!in.ReadVarint32(&length)) return true;
      const std::size_t elements = length / ElementBytesMin(*field);
      if (elements > left) return false;
      left -= elements;
      if (!in.Skip(static_cast<int>(length))) return true;
      continue;
    }
    if (!is_message || wire_type != WireFormatLite::WIRETYPE_LENGTH_DELIMITED) {
      if (!WireFormatLite::SkipField(&in, tag)) return true;
      continue;
    }
    std::uint32_t length = 0;
    if (depth == kDepthMax || !in.ReadVarint32(&length)) return true;
    const CodedInputStream::Limit outer = in.PushLimit(static_cast<int>(length));
    if (!CountParts(*field->message_type(), depth + 1, in, left)) return false;
    if (in.BytesUntilLimit() != 0) return true;
    in.PopLimit(outer);
  }
  return true;
}

bool HasFewParts(std::string_view bytes, const Descriptor& type, std::size_t parts_max) {
  CodedInputStream in(reinterpret_cast<const std::uint8_t*>(bytes.data()), static_cast<int>(bytes.size()));
  return CountParts(type, /*depth=*/0, in, parts_max);
}

bool Parse(std::string_view bytes, std::size_t uncounted_bytes_max, std::size_t parts_max,
           google::protobuf::Message* message) {
  if (bytes.size() > INT32_MAX) return false;
  if (bytes.size() > uncounted_bytes_max && !HasFewParts(bytes, *message->GetDescriptor(), parts_max)) return false;
  return message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

}  // namespace

bool ParseBounded(std::string_view bytes, google::protobuf::Message* message) {
  return Parse(bytes, kUncountedBytesMax, kParsedPartsMax, message);
}

bool ParseBoundedFromPeer(std::string_view bytes, google::protobuf::Message* message) {
  return Parse(bytes, kUncountedPeerBytesMax, bytes.size() / kPeerBytesOfPartMin, message);
}

}  // namespace moondb
