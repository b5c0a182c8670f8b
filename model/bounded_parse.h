// ParseBounded: parses bytes that a stranger wrote, where the message may not take much more memory than the bytes.
//
// An empty part of a message is two bytes on the wire and up to a hundred in memory, and a row of them compresses to
// next to nothing: three kilobytes from a peer could ask for a gigabyte here. So the parts are counted before memory is
// taken for them. Pure, safe from any thread.
#pragma once

#include <google/protobuf/message.h>

#include <cstddef>
#include <string_view>

namespace moondb {

// Messages within the message, elements of its lists and fields that are unknown here: some 25 MB in memory.
inline constexpr std::size_t kParsedPartsMax = 262'144;

// The number of parts of a message between agents: as many as fit into the bytes if each takes 6, which the shortest
// interval of a have-set does. Empty parts take 2.
inline constexpr std::size_t kPeerBytesOfPartMin = 6;

// False where the bytes do not decode or hold too many parts; `message` then holds anything. Elements of packed lists
// of numbers count as parts too.
bool ParseBounded(std::string_view bytes, google::protobuf::Message* message);
// As above, for what another agent sent.
bool ParseBoundedFromPeer(std::string_view bytes, google::protobuf::Message* message);

}  // namespace moondb
