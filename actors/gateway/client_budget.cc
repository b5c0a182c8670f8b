#include "actors/gateway/client_budget.h"

#include <algorithm>

#include "actors/gateway/request_check.h"

namespace moondb {

using Request = proto::ControlRequest;

std::string OwnerOf(const std::string& key_name, AgentId peer, const std::string& connection) {
  if (!key_name.empty()) return "key " + key_name;
  return peer != 0 ? "agent " + std::to_string(peer) : "connection " + connection;
}

Result<void> CheckRequestCount(const ClientLimits& limits, const ClientLoad& load, bool is_wait,
                               const std::string& relayed_to) {
  if (load.pending >= limits.pending_max) {
    return Fail(ErrorCode::kFull, "too many requests wait for an answer at this agent; try again later");
  }
  if (load.own >= limits.pending_of_client_max) {
    return Fail(ErrorCode::kFull, "too many requests of this client wait for an answer; try again later");
  }
  if (!relayed_to.empty() && load.own_relays >= limits.relays_of_client_max) {
    return Fail(ErrorCode::kFull,
                "too many requests of this client wait for an answer of " + relayed_to + "; try again later");
  }
  if (is_wait && load.waits >= limits.waits_max) {
    return Fail(ErrorCode::kFull, "too many requests with a wait time are open at this agent; try again later");
  }
  if (is_wait && load.own_waits >= limits.waits_of_client_max) {
    return Fail(ErrorCode::kFull, "too many requests of this client with a wait time are open; try again later");
  }
  return {};
}

bool TakesTurns(const Request& request) {
  switch (request.request_case()) {
    case Request::kRead:
    case Request::kHave:
    case Request::kVerify:
    case Request::kFingerprint:
    case Request::kReadBundle:
    case Request::kMerge:
    case Request::kMapWhy:
    case Request::kMapStats:
      return true;
    case Request::kMapTiles:
      return !(request.map_tiles().wait_s() > 0);
    default:
      return false;
  }
}

void BoundKeyedPage(Request& request) {
  if (!request.has_read()) return;
  proto::ReadRequest& page = *request.mutable_read();
  page.set_content_bytes_max(std::min(page.content_bytes_max(), kKeyedContentBytesMax));
}

std::size_t AnswerBytesOf(const Request& request, bool is_relayed) {
  switch (request.request_case()) {
    case Request::kRead: {
      proto::ReadRequest page = request.read();
      BoundPage(page, is_relayed);
      return page.content_bytes_max();
    }
    case Request::kMerge:
      return kMapAnswerBytes;
    case Request::kMapTiles:
      // A request that waits for a change usually brings few tiles.
      return request.map_tiles().wait_s() > 0 ? kMapAnswerBytes / 8 : kMapAnswerBytes;
    default:
      return kShortAnswerBytes;
  }
}

Result<void> CheckAnswerBytes(const ClientLoad& load, std::size_t bytes) {
  const std::uint64_t on_their_way = load.unread_bytes + load.own_bytes;
  if (on_their_way == 0 || on_their_way + bytes <= kAnswerBytesOfKeyMax) return {};
  return Fail(ErrorCode::kFull,
              std::to_string(on_their_way / 1024) +
                  " KiB of answers are on their way to the clients of this key; this answer may have " +
                  std::to_string(bytes / 1024) + " KiB, and the limit for all is " +
                  std::to_string(kAnswerBytesOfKeyMax / 1024) + " KiB; read those answers, then ask again");
}

}  // namespace moondb
