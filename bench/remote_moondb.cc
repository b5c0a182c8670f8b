#include "bench/remote_moondb.h"

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <utility>

#include "bench/linked_agents.h"
#include "bench/measure.h"
#include "bench/tally.h"
#include "runtime/envelope.h"

namespace moondb {
namespace {

constexpr AgentId kSender = 1;
constexpr AgentId kReceiver = 2;
// Time after which a sender tries again if its queue was full. The queue does not run empty within this time.
constexpr std::chrono::microseconds kRetryAfter(200);

// Makes messages whose serialised size is `bytes`, including their addresses.
class MessageMaker {
 public:
  MessageMaker(Address from, Address to, std::size_t bytes) : from_(std::move(from)), to_(std::move(to)) {
    // The length field of the padding may take one more byte, so shorten the padding until the message fits.
    for (padding_ = bytes; padding_ > 0 && Make(/*id=*/1U << 30)->ByteSizeLong() > bytes; --padding_) continue;
  }

  OwnedMessage Make(std::uint64_t id) const {
    OwnedMessage message = Body(id);
    WriteEnvelope(from_, to_, *message);
    return message;
  }

  // Returns a message without addresses, which the actor system adds.
  OwnedMessage Body(std::uint64_t id) const {
    OwnedMessage message;
    message->set_request_id(id);
    message->mutable_record_id()->assign(padding_, 'x');
    return message;
  }

  const Address& to() const { return to_; }

 private:
  const Address from_;
  const Address to_;
  std::size_t padding_ = 0;
};

class Sink final : public Actor {
 public:
  explicit Sink(Tally& tally) : tally_(tally) {}
  void OnMessage(Context&, const proto::Message& message) override { tally_.Count(message.request_id()); }

 private:
  Tally& tally_;
};

class Ping final : public Actor {
 public:
  Ping(Tally& tally, std::size_t bytes) : tally_(tally), maker_({kSender, "ping"}, {kReceiver, "pong"}, bytes) {}
  void OnMessage(Context& context, const proto::Message& message) override {
    if (message.request_id() == 0) return tally_.Finish();
    const SendResult result = context.Send(maker_.to(), maker_.Body(message.request_id() - 1));
    if (result != SendResult::kAccepted) tally_.Fail("a ping was refused");
  }

 private:
  Tally& tally_;
  const MessageMaker maker_;
};

class Pong final : public Actor {
 public:
  Pong(Tally& tally, std::size_t bytes) : tally_(tally), maker_({kReceiver, "pong"}, {kSender, "ping"}, bytes) {}
  void OnMessage(Context& context, const proto::Message& message) override {
    const SendResult result = context.Send(maker_.to(), maker_.Body(message.request_id()));
    if (result != SendResult::kAccepted) tally_.Fail("a pong was refused");
  }

 private:
  Tally& tally_;
  const MessageMaker maker_;
};

}  // namespace

Result<double> MoondbRemoteThroughput(bool is_curve, std::size_t bytes, std::uint64_t count) {
  Tally tally(/*sender_count=*/1, count);
  LinkedAgents agents(/*agent_count=*/2, is_curve, tally);
  SpawnOptions options;
  options.messages_max = count;
  options.bytes_max = count * bytes;
  agents.system(kReceiver).Spawn("sink", options, [&] { return std::make_unique<Sink>(tally); });
  if (const Result<void> started = agents.Start(); !started) return tl::unexpected(started.error());

  const MessageMaker maker({kSender, "source"}, {kReceiver, "sink"}, bytes);
  Transport& transport = agents.transport(kSender);
  const auto start = BenchClock::now();
  RunSenders(1, [&](int) {
    for (std::uint64_t number = 0; number < count; ++number) {
      const OwnedMessage message = maker.Make(number);
      SendResult result = transport.Send(maker.to(), *message);
      for (; result == SendResult::kFull; result = transport.Send(maker.to(), *message)) {
        std::this_thread::sleep_for(kRetryAfter);
      }
      if (result != SendResult::kAccepted) return tally.Fail(ToString(result));
    }
  });
  if (const Result<void> done = tally.Wait(); !done) return tl::unexpected(done.error());
  return PerSecond(count, BenchClock::now() - start);
}

Result<double> MoondbRemoteRoundTrip(bool is_curve, std::size_t bytes, std::uint64_t count) {
  Tally tally(/*sender_count=*/1, count);
  LinkedAgents agents(/*agent_count=*/2, is_curve, tally);
  agents.system(kSender).Spawn("ping", {}, [&] { return std::make_unique<Ping>(tally, bytes); });
  agents.system(kReceiver).Spawn("pong", {}, [&] { return std::make_unique<Pong>(tally, bytes); });
  if (const Result<void> started = agents.Start(); !started) return tl::unexpected(started.error());

  proto::Message first;
  first.set_request_id(count);
  const auto start = BenchClock::now();
  if (agents.system(kSender).Post("ping", std::move(first)) != SendResult::kAccepted) {
    tally.Fail("the first message was refused");
  }
  if (const Result<void> done = tally.Wait(); !done) return tl::unexpected(done.error());
  return MicrosecondsEach(count, BenchClock::now() - start);
}

}  // namespace moondb
