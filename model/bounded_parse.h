// ParseBounded: parses untrusted bytes into a message, and limits the memory that the message needs.
//
// An empty part of a message (a nested message or a list element) takes two bytes on the wire and up to a hundred in
// memory. Many empty parts compress well: three kilobytes from a peer could expand to a gigabyte. ParseBounded counts
// the parts before it allocates memory. Thread-safe.
#pragma once

#include <google/protobuf/message.h>

#include <cstddef>
#include <string_view>

namespace moondb {

// Maximum number of parts: nested messages, elements of lists, and unknown fields. This many parts need about 25 MB.
inline constexpr std::size_t kParsedPartsMax = 262'144;

// Limits the number of parts of a message between agents: at most the message's size in bytes divided by this value.
// The shortest interval of a have-set takes 6 bytes; an empty part takes 2.
inline constexpr std::size_t kPeerBytesOfPartMin = 6;

// Returns false if the bytes do not decode or hold more than kParsedPartsMax parts; `message` is then unspecified. Each
// element of a packed list of numbers is a part, too.
bool ParseBounded(std::string_view bytes, google::protobuf::Message* message);
// Like ParseBounded, but for a message from another agent: the limit is bytes.size() / kPeerBytesOfPartMin parts.
bool ParseBoundedFromPeer(std::string_view bytes, google::protobuf::Message* message);

}  // namespace moondb
