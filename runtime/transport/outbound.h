// What leaves for other agents: in which order, what takes the place of what, and as which bytes. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "proto/message.pb.h"
#include "runtime/transport/zmq_socket.h"

namespace moondb {

// What waits for a peer goes out by class, 0 first: control messages and acknowledgments, then data by the sharing
// class of their type (model/ids.h): roles, states, pose-graph nodes, edges, poses, custom types, maps.
inline constexpr std::size_t kOutboundClasses = 8;
inline constexpr std::size_t kControlClass = 0;
std::size_t OutboundClassOf(const proto::Message& message);

// A message takes the place of a waiting one with the same key; with an empty key, of none. Only messages have a key
// whose newest one says all that an older one said: a role announcement carries the whole assignment, a lease
// announcement both leases, and a Hello ends the session that the Hello before it began. An acknowledgment (Have) tells
// of one batch and replaces nothing.
std::string ReplaceKeyOf(const proto::Message& message);

// Several messages share a frame up to this size; a larger one has its own.
inline constexpr std::size_t kSharedFrameBytesMax = 32 * 1024;

// The fields of proto::PeerFrame as protobuf writes them: the link number, which the connection adds when it sends,
// then the messages.
inline constexpr char kLinkNumberTag = proto::PeerFrame::kLinkNumberFieldNumber << 3 | 5;
inline constexpr std::size_t kLinkNumberBytes = 1 + 4;
inline constexpr std::uint32_t kPeerFrameTag = proto::PeerFrame::kMessagesFieldNumber << 3 | 2;
inline constexpr std::size_t kPeerFrameTagBytes = 1;
// A frame has at most so many bytes more than the message in it.
inline constexpr std::size_t kPeerFrameBytesMore = kLinkNumberBytes + kPeerFrameTagBytes + 5;

// Returns a proto::PeerFrame of this message alone, without the link number. Several of them in a row are such a frame
// too.
std::string ToPeerFrame(const proto::Message& message);
// Writes the link number's kLinkNumberBytes to `to`.
void WriteLinkNumber(std::uint32_t link_number, char* to);
// For a client; `bytes` is message.ByteSizeLong(), just computed.
ZmqFrame ToClientFrame(const proto::Message& message, std::size_t bytes);

}  // namespace moondb
