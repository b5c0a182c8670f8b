#include <memory>
#include <string>
#include <utility>

#include "bench/in_process.h"
#include "bench/measure.h"
#include "bench/tally.h"
#include "runtime/actor_system.h"

namespace moondb {
namespace {

constexpr AgentId kSelf = 1;

OwnedMessage Small(std::uint64_t id) {
  OwnedMessage message;
  message->set_request_id(id);
  return message;
}

ActorSystem::Options Defaults() {
  ActorSystem::Options options;
  options.self = kSelf;
  return options;
}

ActorSystem::Options OneWorker() {
  ActorSystem::Options options = Defaults();
  options.worker_count = 1;
  return options;
}

class Sink final : public Actor {
 public:
  explicit Sink(Tally& tally) : tally_(tally) {}
  void OnMessage(Context&, const proto::Message& message) override { tally_.Count(message.request_id()); }

 private:
  Tally& tally_;
};

// Acknowledges the last message of each burst.
class BurstSink final : public Actor {
 public:
  explicit BurstSink(Tally& tally) : tally_(tally) {}
  void OnMessage(Context& context, const proto::Message& message) override {
    tally_.Count(message.request_id());
    if ((message.request_id() + 1) % kBurstMessages != 0) return;
    if (context.Reply(OwnedMessage()) != SendResult::kAccepted) tally_.Fail("an acknowledgment was refused");
  }

 private:
  Tally& tally_;
};

class BurstSource final : public Actor {
 public:
  BurstSource(Tally& tally, std::uint64_t count) : tally_(tally), count_(count) {}
  void OnMessage(Context& context, const proto::Message&) override {
    for (std::uint64_t i = 0; i < kBurstMessages && sent_ < count_; ++i) {
      if (context.Send(sink_, Small(sent_++)) != SendResult::kAccepted) return tally_.Fail("a message was refused");
    }
  }

 private:
  Tally& tally_;
  const std::uint64_t count_;
  const Address sink_{kSelf, "sink"};
  std::uint64_t sent_ = 0;
};

class Ping final : public Actor {
 public:
  explicit Ping(Tally& tally) : tally_(tally) {}
  void OnMessage(Context& context, const proto::Message& message) override {
    if (message.request_id() == 0) return tally_.Finish();
    if (context.Send(pong_, Small(message.request_id() - 1)) != SendResult::kAccepted)
      tally_.Fail("a ping was refused");
  }

 private:
  Tally& tally_;
  const Address pong_{kSelf, "pong"};
};

class Pong final : public Actor {
 public:
  explicit Pong(Tally& tally) : tally_(tally) {}
  void OnMessage(Context& context, const proto::Message&) override {
    if (context.Reply(OwnedMessage()) != SendResult::kAccepted) tally_.Fail("a pong was refused");
  }

 private:
  Tally& tally_;
};

std::string NameOf(int index) { return "actor" + std::to_string(index); }

class RingActor final : public Actor {
 public:
  RingActor(Tally& tally, int next) : tally_(tally), next_{kSelf, NameOf(next)} {}
  void OnMessage(Context& context, const proto::Message& message) override {
    if (message.request_id() == 0) return tally_.Finish();
    if (context.Send(next_, Small(message.request_id() - 1)) != SendResult::kAccepted) tally_.Fail("a hop was refused");
  }

 private:
  Tally& tally_;
  const Address next_;
};

// Starts the measurement with a message to `actor`. Returns the time until `tally` finished, or its error.
Result<BenchClock::duration> RunFrom(ActorSystem& system, const std::string& actor, std::uint64_t id, Tally& tally) {
  const auto start = BenchClock::now();
  if (system.Post(actor, Small(id)) != SendResult::kAccepted) tally.Fail("the first message was refused");
  if (const Result<void> done = tally.Wait(); !done) return tl::unexpected(done.error());
  return BenchClock::now() - start;
}

Result<double> PingPong(ActorSystem& system, Placement placement, std::uint64_t count) {
  Tally tally(/*sender_count=*/1, count);
  SpawnOptions options;
  options.placement = placement;
  system.Spawn("ping", options, [&] { return std::make_unique<Ping>(tally); });
  system.Spawn("pong", options, [&] { return std::make_unique<Pong>(tally); });
  system.Start(nullptr);
  const auto took = RunFrom(system, "ping", count, tally);
  system.Stop();
  if (!took) return tl::unexpected(took.error());
  return MicrosecondsEach(count, *took);
}

Result<double> FanIn(int sender_count, std::uint64_t count) {
  const std::uint64_t per_sender = count / static_cast<std::uint64_t>(sender_count);
  Tally tally(sender_count, per_sender);
  ActorSystem system(Defaults());
  SpawnOptions options;
  options.overflow = Overflow::kBlock;
  system.Spawn("sink", options, [&] { return std::make_unique<Sink>(tally); });
  system.Start(nullptr);
  const auto start = BenchClock::now();
  RunSenders(sender_count, [&](int sender) {
    for (std::uint64_t number = 0; number < per_sender; ++number) {
      const std::uint64_t id = Tally::IdOf(sender, number);
      if (system.Post("sink", Small(id)) != SendResult::kAccepted) return tally.Fail("a message was refused");
    }
  });
  const Result<void> done = tally.Wait();
  const auto took = BenchClock::now() - start;
  system.Stop();
  if (!done) return tl::unexpected(done.error());
  return PerSecond(per_sender * static_cast<std::uint64_t>(sender_count), took);
}

Result<double> ActorToActor(std::uint64_t count) {
  Tally tally(/*sender_count=*/1, count);
  ActorSystem system(Defaults());
  system.Spawn("source", {}, [&] { return std::make_unique<BurstSource>(tally, count); });
  system.Spawn("sink", {}, [&] { return std::make_unique<BurstSink>(tally); });
  system.Start(nullptr);
  const auto took = RunFrom(system, "source", 0, tally);
  system.Stop();
  if (!took) return tl::unexpected(took.error());
  return PerSecond(count, *took);
}

Result<double> PingPongSameWorker(std::uint64_t count) {
  ActorSystem system(OneWorker());
  return PingPong(system, Placement::kPool, count);
}

Result<double> PingPongAcrossThreads(std::uint64_t count) {
  ActorSystem system(Defaults());
  return PingPong(system, Placement::kOwnThread, count);
}

Result<double> Ring(std::uint64_t count) {
  Tally tally(/*sender_count=*/1, count);
  ActorSystem system(Defaults());
  for (int i = 0; i < kRingActors; ++i) {
    const int next = (i + 1) % kRingActors;
    system.Spawn(NameOf(i), {}, [&tally, next] { return std::make_unique<RingActor>(tally, next); });
  }
  system.Start(nullptr);
  const auto took = RunFrom(system, NameOf(0), count, tally);
  system.Stop();
  if (!took) return tl::unexpected(took.error());
  return PerSecond(count, *took);
}

}  // namespace

InProcess MoondbInProcess() { return {FanIn, ActorToActor, Ring, PingPongSameWorker, PingPongAcrossThreads}; }

}  // namespace moondb
