#include "runtime/actor_host.h"

#include <spdlog/spdlog.h>

#include <exception>
#include <utility>

#include "model/check.h"
#include "runtime/envelope.h"
#include "runtime/one_writer.h"

namespace moondb {
namespace {

std::mt19937_64 MakeRng(const Address& self, std::uint64_t seed) {
  std::vector<std::uint32_t> words = {static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32),
                                      self.agent};
  words.insert(words.end(), self.actor.begin(), self.actor.end());
  std::seed_seq sequence(words.begin(), words.end());
  return std::mt19937_64(sequence);
}

}  // namespace

ActorHost::ActorHost(Address self, ActorFactory factory, std::uint64_t seed)
    : self_(std::move(self)), factory_(std::move(factory)), seed_(seed), sender_(&self_) {}

std::optional<Error> ActorHost::Start() {
  Check(!actor_, "an actor is started once an incarnation");
  ++incarnation_;
  sender_ = &self_;
  request_id_ = 0;
  return Run([this] {
    actor_ = factory_();
    Check(actor_ != nullptr, "a factory makes an actor");
    actor_->OnStart(*this);
  });
}

std::optional<Error> ActorHost::Handle(const proto::Message& message, const Address* sender) {
  if (sender == nullptr) {
    remote_sender_ = SenderOf(message);
    sender = &remote_sender_;
  }
  sender_ = sender;
  request_id_ = message.request_id();
  Increase(handled_, 1);
  return Run([&] { actor_->OnMessage(*this, message); });
}

template <typename Handler>
std::optional<Error> ActorHost::Run(Handler handler) {
  is_in_handler_ = true;
  try {
    handler();
  } catch (const std::exception& exception) {
    Fail({ErrorCode::kInternal, exception.what(), {}});
  } catch (...) {
    Fail({ErrorCode::kInternal, "an exception of unknown type left a handler", {}});
  }
  is_in_handler_ = false;
  if (!std::exchange(has_failed_, false)) return std::nullopt;
  spdlog::warn("actor {} failed: {}", ToString(self_), ToString(*failure_));
  End();
  return std::exchange(failure_, std::nullopt);
}

std::mt19937_64& ActorHost::rng() {
  if (!rng_) rng_ = std::make_unique<std::mt19937_64>(MakeRng(self_, seed_));
  return *rng_;
}

SendResult ActorHost::Reply(OwnedMessage message) {
  message->set_request_id(request_id_);
  return Send(*sender_, std::move(message));
}

void ActorHost::Fail(Error error) {
  // Keep the first error: it is most likely the cause.
  if (!std::exchange(has_failed_, true)) failure_ = std::move(error);
}

}  // namespace moondb
