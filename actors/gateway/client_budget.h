// Decides how much one client may have waiting at this agent: requests without an answer, and bytes of answers that the
// client has not read.
//
// Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "model/error.h"
#include "model/ids.h"
#include "proto/control.pb.h"

namespace moondb {

// Limit of the bytes of answers on their way to the clients of one key: answers that their systems have not
// acknowledged, and the largest possible answers to requests in flight.
inline constexpr std::size_t kAnswerBytesOfKeyMax = 16 * 1024 * 1024;
// Bytes that a request counts with if its answer has no stated limit: a page of the merged map, and any other answer.
inline constexpr std::size_t kMapAnswerBytes = 8 * 1024 * 1024;
inline constexpr std::size_t kShortAnswerBytes = 64 * 1024;
// Limit of ReadRequest.content_bytes_max of a client with a key. libzmq copies an answer three times to encrypt it.
inline constexpr std::uint32_t kKeyedContentBytesMax = 4 * 1024 * 1024;

// Limits of the requests that wait for an answer at one agent.
struct ClientLimits {
  std::size_t pending_max = 256;
  // Maximum number of pending requests per client: per key, connection or other agent.
  std::size_t pending_of_client_max = 64;
  // Maximum number of pending requests of one client that are relayed to the same agent. Replies cross the radio, and
  // must leave room for the replies to other clients.
  std::size_t relays_of_client_max = 8;
  std::size_t waits_max = 32;  // Maximum total number of pending requests with wait_s.
  // Maximum number of pending requests with wait_s per client.
  std::size_t waits_of_client_max = 8;
};

// The requests of one client, and of all clients, that wait for an answer.
struct ClientLoad {
  std::size_t pending = 0;         // Requests of all clients.
  std::size_t waits = 0;           // Requests of all clients with wait_s.
  std::size_t own = 0;             // Requests of this client.
  std::size_t own_waits = 0;       // Requests of this client with wait_s.
  std::size_t own_relays = 0;      // Requests of this client that are relayed to the same agent.
  std::size_t own_bytes = 0;       // Largest possible answers to this client's requests that are being answered.
  std::uint64_t unread_bytes = 0;  // Answers that this client's system has not acknowledged.
};

// Names the client to which a request counts: the key; without a key, the other agent `peer`, or the connection if
// `peer` is 0.
std::string OwnerOf(const std::string& key_name, AgentId peer, const std::string& connection);

// Returns kFull if one more request exceeds a limit. `is_wait`: the request has wait_s. `relayed_to`: the name of the
// agent to which the request is relayed; empty if it is not relayed.
Result<void> CheckRequestCount(const ClientLimits& limits, const ClientLoad& load, bool is_wait,
                               const std::string& relayed_to);

// Returns true if the requests of one client to the actor take turns (page_turns.h): reads that occupy StorageActor,
// and requests for the merged map that do not wait for a change. A read with wait_s takes a turn each time it is sent
// to StorageActor.
bool TakesTurns(const proto::ControlRequest& request);

// Limits the page of a read of a client with a key to kKeyedContentBytesMax. Other requests stay unchanged.
void BoundKeyedPage(proto::ControlRequest& request);

// Returns the bytes with which the request counts while it is being answered. `is_relayed`: true if the answer crosses
// the radio.
std::size_t AnswerBytesOf(const proto::ControlRequest& request, bool is_relayed);

// Returns kFull if an answer of `bytes` exceeds kAnswerBytesOfKeyMax. An answer of any size is allowed if no other
// answer is on its way.
Result<void> CheckAnswerBytes(const ClientLoad& load, std::size_t bytes);

}  // namespace moondb
