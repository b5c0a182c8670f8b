// ParseBounded: parses untrusted bytes, and bounds the memory that the resulting message needs.
//
// An empty part of a message takes two bytes on the wire and up to a hundred in memory, and many empty parts compress
// very well. Three kilobytes from a peer could expand to a gigabyte. The parts are therefore counted before any memory
// is allocated for them. Thread-safe.
#pragma once

#include <google/protobuf/message.h>

#include <cstddef>
#include <string_view>

namespace moondb {

// Maximum number of parts: nested messages, elements of lists, and unknown fields. They need about 25 MB of memory.
inline constexpr std::size_t kParsedPartsMax = 262'144;

// Minimum average size of a part in a message between agents; bounds the number of parts. The shortest interval of a
// have-set takes 6 bytes. Empty parts take 2.
inline constexpr std::size_t kPeerBytesOfPartMin = 6;

// Returns false if the bytes do not decode or hold more than kParsedPartsMax parts; `message` is then unspecified.
// Elements of packed lists of numbers count as parts, too.
bool ParseBounded(std::string_view bytes, google::protobuf::Message* message);
// Like ParseBounded, with the limit for messages between agents (kPeerBytesOfPartMin).
bool ParseBoundedFromPeer(std::string_view bytes, google::protobuf::Message* message);

}  // namespace moondb
