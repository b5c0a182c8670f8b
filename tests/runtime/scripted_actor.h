// ScriptedActor: an actor whose handlers are two functions, for tests of the runtime.
#pragma once

#include <functional>
#include <memory>
#include <utility>

#include "runtime/actor.h"

namespace moondb {

class ScriptedActor final : public Actor {
 public:
  using OnStartFunction = std::function<void(Context&)>;
  using OnMessageFunction = std::function<void(Context&, const proto::Message&)>;

  // `on_start` and `on_message` may be empty.
  ScriptedActor(OnStartFunction on_start, OnMessageFunction on_message)
      : on_start_(std::move(on_start)), on_message_(std::move(on_message)) {}

  void OnStart(Context& context) override {
    if (on_start_) on_start_(context);
  }
  void OnMessage(Context& context, const proto::Message& message) override {
    if (on_message_) on_message_(context, message);
  }

 private:
  OnStartFunction on_start_;
  OnMessageFunction on_message_;
};

inline ActorFactory Scripted(ScriptedActor::OnStartFunction on_start, ScriptedActor::OnMessageFunction on_message) {
  return [=] { return std::make_unique<ScriptedActor>(on_start, on_message); };
}

inline ActorFactory OnEachMessage(ScriptedActor::OnMessageFunction on_message) { return Scripted({}, on_message); }

// Returns a message with this request_id.
inline proto::Message Numbered(std::uint64_t number) {
  proto::Message message;
  message.set_request_id(number);
  return message;
}

}  // namespace moondb
