#include "runtime/actor.h"

#include <utility>

namespace moondb {

const char* ToString(SendResult result) {
  switch (result) {
    case SendResult::kAccepted:
      return "accepted";
    case SendResult::kFull:
      return "full";
    case SendResult::kNoActor:
      return "no such actor";
    case SendResult::kNoPeer:
      return "no such peer";
    case SendResult::kUnreachable:
      return "unreachable";
    case SendResult::kTooLong:
      return "too long for a message between agents";
  }
  return "unknown";
}

bool IsControl(const proto::Message& message) {
  switch (message.body_case()) {
    case proto::Message::kPeerEvent:
    case proto::Message::kRolesChanged:
    case proto::Message::kDown:
    case proto::Message::kPing:
    case proto::Message::kStepDown:
    case proto::Message::kLeasesChanged:
      return true;
    default:
      return false;
  }
}

bool IsOfTopic(const proto::Message& message) {
  switch (static_cast<Topic>(message.body_case())) {
    case Topic::kRoles:
    case Topic::kLeases:
    case Topic::kStored:
      return true;
  }
  return false;
}

TimerId Context::AfterTimer(Duration delay, std::uint32_t kind, std::uint64_t value) {
  proto::Message message;
  message.mutable_timer()->set_kind(kind);
  message.mutable_timer()->set_value(value);
  return After(delay, std::move(message));
}

}  // namespace moondb
