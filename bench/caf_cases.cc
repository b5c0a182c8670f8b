#include <caf/all.hpp>
#include <vector>

#include "bench/in_process.h"
#include "bench/tally.h"

namespace moondb {
namespace {

caf::behavior Sink(caf::event_based_actor*, Tally* tally) {
  return {[=](std::uint64_t id) { tally->Count(id); }};
}

caf::behavior BurstSink(caf::event_based_actor* self, Tally* tally) {
  return {[=](std::uint64_t id) {
    tally->Count(id);
    if ((id + 1) % kBurstMessages == 0) self->send(caf::actor_cast<caf::actor>(self->current_sender()), id);
  }};
}

struct BurstState {
  std::uint64_t sent = 0;
};

caf::behavior BurstSource(caf::stateful_actor<BurstState>* self, caf::actor sink, std::uint64_t count) {
  return {[=](std::uint64_t) {
    std::uint64_t& sent = self->state.sent;
    for (std::uint64_t i = 0; i < kBurstMessages && sent < count; ++i) self->send(sink, sent++);
  }};
}

caf::behavior Ping(caf::event_based_actor* self, Tally* tally, caf::actor pong) {
  return {[=](std::uint64_t left) {
    if (left == 0) return tally->Finish();
    self->send(pong, left - 1);
  }};
}

caf::behavior Pong(caf::event_based_actor*) {
  return {[](std::uint64_t left) { return left; }};
}

struct RingState {
  caf::actor next;
};

// An actor of the ring. A message with an actor sets the receiver's successor. A message with a number travels around
// the ring and ends the measurement at 0.
caf::behavior RingActor(caf::stateful_actor<RingState>* self, Tally* tally) {
  return {[=](const caf::actor& next) { self->state.next = next; },
          [=](std::uint64_t left) {
            if (left == 0) return tally->Finish();
            self->send(self->state.next, left - 1);
          }};
}

void End(const std::vector<caf::actor>& actors) {
  for (const caf::actor& actor : actors) caf::anon_send_exit(actor, caf::exit_reason::kill);
}

Result<BenchClock::duration> RunFrom(const caf::actor& actor, std::uint64_t id, Tally& tally) {
  const auto start = BenchClock::now();
  caf::anon_send(actor, id);
  if (const Result<void> done = tally.Wait(); !done) return tl::unexpected(done.error());
  return BenchClock::now() - start;
}

Result<double> PingPong(const caf::actor& ping, const caf::actor& pong, Tally& tally, std::uint64_t count) {
  const auto took = RunFrom(ping, count, tally);
  End({ping, pong});
  if (!took) return tl::unexpected(took.error());
  return MicrosecondsEach(count, *took);
}

Result<double> FanIn(int sender_count, std::uint64_t count) {
  const std::uint64_t per_sender = count / static_cast<std::uint64_t>(sender_count);
  Tally tally(sender_count, per_sender);
  caf::actor_system_config config;
  caf::actor_system system(config);
  const caf::actor sink = system.spawn(Sink, &tally);
  const auto start = BenchClock::now();
  RunSenders(sender_count, [&](int sender) {
    for (std::uint64_t number = 0; number < per_sender; ++number) caf::anon_send(sink, Tally::IdOf(sender, number));
  });
  const Result<void> done = tally.Wait();
  const auto took = BenchClock::now() - start;
  End({sink});
  if (!done) return tl::unexpected(done.error());
  return PerSecond(per_sender * static_cast<std::uint64_t>(sender_count), took);
}

Result<double> ActorToActor(std::uint64_t count) {
  Tally tally(/*sender_count=*/1, count);
  caf::actor_system_config config;
  caf::actor_system system(config);
  const caf::actor sink = system.spawn(BurstSink, &tally);
  const caf::actor source = system.spawn(BurstSource, sink, count);
  const auto took = RunFrom(source, 0, tally);
  End({source, sink});
  if (!took) return tl::unexpected(took.error());
  return PerSecond(count, *took);
}

Result<double> PingPongSameWorker(std::uint64_t count) {
  Tally tally(/*sender_count=*/1, count);
  caf::actor_system_config config;
  config.set("scheduler.max-threads", 1);
  caf::actor_system system(config);
  const caf::actor pong = system.spawn(Pong);
  return PingPong(system.spawn(Ping, &tally, pong), pong, tally, count);
}

Result<double> PingPongAcrossThreads(std::uint64_t count) {
  Tally tally(/*sender_count=*/1, count);
  caf::actor_system_config config;
  caf::actor_system system(config);
  const caf::actor pong = system.spawn<caf::detached>(Pong);
  return PingPong(system.spawn<caf::detached>(Ping, &tally, pong), pong, tally, count);
}

Result<double> Ring(std::uint64_t count) {
  Tally tally(/*sender_count=*/1, count);
  caf::actor_system_config config;
  caf::actor_system system(config);
  std::vector<caf::actor> ring;
  for (int i = 0; i < kRingActors; ++i) ring.push_back(system.spawn(RingActor, &tally));
  for (int i = 0; i < kRingActors; ++i) caf::anon_send(ring[i], ring[(i + 1) % kRingActors]);
  const auto took = RunFrom(ring[0], count, tally);
  End(ring);
  if (!took) return tl::unexpected(took.error());
  return PerSecond(count, *took);
}

}  // namespace

InProcess CafInProcess() { return {FanIn, ActorToActor, Ring, PingPongSameWorker, PingPongAcrossThreads}; }

}  // namespace moondb
