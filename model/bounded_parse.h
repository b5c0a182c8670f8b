// ParseBounded: parses untrusted bytes into a message, and limits the memory that the message needs.
//
// An empty part of a message takes two bytes on the wire and up to a hundred in memory, and many empty parts compress
// very well. Three kilobytes from a peer could expand to a gigabyte in memory. ParseBounded counts the parts before it
// allocates memory for them. Thread-safe.
#pragma once

#include <google/protobuf/message.h>

#include <cstddef>
#include <string_view>

namespace moondb {

// Maximum number of parts: nested messages, elements of lists, and unknown fields. So many parts need about 25 MB of
// memory.
inline constexpr std::size_t kParsedPartsMax = 262'144;

// Minimum average size in bytes of the parts of a message between agents. The message's size divided by this value
// limits the number of its parts. The shortest interval of a have-set takes 6 bytes. Empty parts take 2.
inline constexpr std::size_t kPeerBytesOfPartMin = 6;

// Returns false if the bytes do not decode or hold more than kParsedPartsMax parts; `message` is then unspecified.
// Elements of packed lists of numbers count as parts, too.
bool ParseBounded(std::string_view bytes, google::protobuf::Message* message);
// Like ParseBounded, with the limit for messages between agents (kPeerBytesOfPartMin).
bool ParseBoundedFromPeer(std::string_view bytes, google::protobuf::Message* message);

}  // namespace moondb
