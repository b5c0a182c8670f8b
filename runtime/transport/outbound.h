// Priority classes, replacement keys and wire format of messages to other agents.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "proto/message.pb.h"
#include "runtime/transport/zmq_socket.h"

namespace moondb {

// Priority classes of messages that wait for a peer; class 0 is sent first. Class 0 holds control messages and
// acknowledgments. Classes 1 to 7 hold data by the SharingRank of their type (model/data_types.h): roles, states,
// pose-graph nodes, edges, poses, custom types, maps.
inline constexpr std::size_t kOutboundClasses = 8;
inline constexpr std::size_t kControlClass = 0;
std::size_t OutboundClassOf(const proto::Message& message);

// Returns the replacement key of a message, or an empty key if the message replaces none. A message replaces the
// waiting message with the same key. Only messages that contain all information of an older one have a key. A role
// announcement carries the whole assignment, a lease announcement both leases, and a Hello ends the session of the
// previous Hello. An acknowledgment (Have) covers one batch only and has no key.
std::string ReplaceKeyOf(const proto::Message& message);

// Limit of a frame that holds several messages. A larger message has its own frame.
inline constexpr std::size_t kSharedFrameBytesMax = 32 * 1024;

// Wire format of proto::PeerFrame: the link number, then the messages. PeerConnection adds the link number when it
// sends the frame.
inline constexpr char kLinkNumberTag = proto::PeerFrame::kLinkNumberFieldNumber << 3 | 5;
inline constexpr std::size_t kLinkNumberBytes = 1 + 4;
inline constexpr std::uint32_t kPeerFrameTag = proto::PeerFrame::kMessagesFieldNumber << 3 | 2;
inline constexpr std::size_t kPeerFrameTagBytes = 1;
// Upper limit of the bytes that a frame adds to its message.
inline constexpr std::size_t kPeerFrameBytesMore = kLinkNumberBytes + kPeerFrameTagBytes + 5;

// Returns a proto::PeerFrame with this message, without the link number. The concatenation of several such frames is
// also a valid frame.
std::string ToPeerFrame(const proto::Message& message);
// Writes the field of the link number to `to`, which must have room for kLinkNumberBytes.
void WriteLinkNumber(std::uint32_t link_number, char* to);
// Returns the frame for a client. Requires: `bytes` is the result of message.ByteSizeLong(), called just before.
ZmqFrame ToClientFrame(const proto::Message& message, std::size_t bytes);

}  // namespace moondb
