// ActorHost: creates one actor through its factory, runs its handlers, and destroys the actor when it fails.
//
// Only this class catches exceptions of handlers. Its derived classes (ActorCell, and Host in SimulatedAgent) deliver
// messages, provide threads or a virtual clock, and restart the actor.
//
// Start, Handle and End must not run concurrently. Any thread may call handled().
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>

#include "runtime/actor.h"

namespace moondb {

class ActorHost : public Context {
 public:
  // The actor's rng() is seeded from `seed`, which is the same for all actors of a system, and from `self`.
  ActorHost(Address self, ActorFactory factory, std::uint64_t seed);

  // Creates the actor as a new incarnation and runs OnStart. If the factory or OnStart fails, destroys the actor and
  // returns the error.
  std::optional<Error> Start();

  // Runs OnMessage. If OnMessage fails, destroys the actor and returns the error. Requires: has_actor(). `sender` must
  // stay valid until Handle returns. If `sender` is null, reads the sender from the message's envelope.
  std::optional<Error> Handle(const proto::Message& message, const Address* sender);

  // Destroys the actor. Must not be called from inside its handler.
  void End() { actor_.reset(); }

  bool has_actor() const { return actor_ != nullptr; }
  bool is_in_handler() const { return is_in_handler_; }
  std::uint32_t incarnation() const { return incarnation_; }  // Starts at 1; 0 before the first Start.
  std::uint64_t handled() const { return handled_; }          // Number of handled messages, including failed ones.
  // Returns whether RequestStop was called since the last call of this function.
  bool TakeStopRequest() { return std::exchange(is_stop_requested_, false); }

  // Implementation of Context.
  const Address& self() const override { return self_; }
  const Address& sender() const override { return *sender_; }
  std::mt19937_64& rng() override;
  SendResult Reply(OwnedMessage message) override;
  void Fail(Error error) override;
  void RequestStop() override { is_stop_requested_ = true; }

 private:
  template <typename Handler>
  std::optional<Error> Run(Handler handler);

  const Address self_;
  const ActorFactory factory_;
  const std::uint64_t seed_;
  std::unique_ptr<std::mt19937_64> rng_;  // Created at the first use, because an mt19937_64 occupies 2.5 kB.
  Address remote_sender_;
  std::optional<Error> failure_;

  // Members that are written for each message. They are on a cache line that other threads rarely read.
  alignas(64) std::unique_ptr<Actor> actor_;
  const Address* sender_;         // Sender of the current message; self_ in OnStart.
  std::uint64_t request_id_ = 0;  // request_id of the current message.
  bool has_failed_ = false;       // If true, failure_ holds the error.
  bool is_in_handler_ = false;
  bool is_stop_requested_ = false;
  std::uint32_t incarnation_ = 0;
  std::atomic<std::uint64_t> handled_ = 0;
};

}  // namespace moondb
