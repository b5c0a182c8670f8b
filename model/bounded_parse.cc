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

// Fewer bytes cannot hold enough parts to matter.
constexpr std::size_t kUncountedBytesMax = 64 * 1024;
constexpr int kDepthMax = 100;  // Protobuf's own.

// Takes a part from `left` for each; false when none is left. Stops where the bytes do not decode: so does the parser.
bool CountParts(const Descriptor& type, int depth, CodedInputStream& in, std::size_t& left) {
  while (const std::uint32_t tag = in.ReadTag()) {
    const FieldDescriptor* field = type.FindFieldByNumber(WireFormatLite::GetTagFieldNumber(tag));
    const bool is_message = field != nullptr && field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    const bool is_part = field == nullptr || field->is_repeated() || is_message;
    const WireFormatLite::WireType wire_type = WireFormatLite::GetTagWireType(tag);
    if (wire_type == WireFormatLite::WIRETYPE_START_GROUP) return false;  // Nobody here writes them.
    if (is_part && left-- == 0) return false;
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

bool HasFewParts(std::string_view bytes, const Descriptor& type) {
  CodedInputStream in(reinterpret_cast<const std::uint8_t*>(bytes.data()), static_cast<int>(bytes.size()));
  std::size_t left = kParsedPartsMax;
  return CountParts(type, /*depth=*/0, in, left);
}

}  // namespace

bool ParseBounded(std::string_view bytes, google::protobuf::Message* message) {
  if (bytes.size() > INT32_MAX) return false;
  if (bytes.size() > kUncountedBytesMax && !HasFewParts(bytes, *message->GetDescriptor())) return false;
  return message->ParseFromArray(bytes.data(), static_cast<int>(bytes.size()));
}

}  // namespace moondb
