// ActorHost: one actor's life: made by its factory, run message by message, destroyed when it fails.
//
// The one place that catches what leaves a handler (users' code, libraries, bad_alloc). ActorSystem and SimulatedTeam
// derive from it and add what differs between them: threads or a virtual clock, and the way to others. When to make
// the actor anew is for them, with a Supervisor.
//
// Start, Handle and End are called on one thread at a time; the counters may be read on any.
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
  // `seed` is the system's; the actor's rng() gets its own from it and from `self`.
  ActorHost(Address self, ActorFactory factory, std::uint64_t seed);

  // Makes the actor, a new incarnation, and runs OnStart. Why it failed, if it did: it is then destroyed already.
  std::optional<Error> Start();

  // Runs OnMessage; likewise. Only while there is an actor. `sender` lives until this returns; null: the message's
  // envelope says who it is.
  std::optional<Error> Handle(const proto::Message& message, const Address* sender);

  // Destroys the actor; not from inside its handler.
  void End() { actor_.reset(); }

  bool has_actor() const { return actor_ != nullptr; }
  bool is_in_handler() const { return is_in_handler_; }
  std::uint32_t incarnation() const { return incarnation_; }  // Counts from 1; 0 before the first Start.
  std::uint64_t handled() const { return handled_; }          // Messages, those that it failed at too.
  // Whether RequestStop was called since this was last asked.
  bool TakeStopRequest() { return std::exchange(is_stop_requested_, false); }

  // Context.
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
  std::unique_ptr<std::mt19937_64> rng_;  // Made when first asked for: it is large.
  Address remote_sender_;
  std::optional<Error> failure_;

  // What each message writes, on a cache line that no other thread reads often.
  alignas(64) std::unique_ptr<Actor> actor_;
  const Address* sender_;         // Of the message in hand, self_ in OnStart.
  std::uint64_t request_id_ = 0;  // Of the message in hand.
  bool has_failed_ = false;       // failure_ says why.
  bool is_in_handler_ = false;
  bool is_stop_requested_ = false;
  std::uint32_t incarnation_ = 0;
  std::atomic<std::uint64_t> handled_ = 0;
};

}  // namespace moondb
