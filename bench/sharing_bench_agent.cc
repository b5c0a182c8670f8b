// sharing_bench_agent: the standard moondb agent with additional actors for bench/sharing_bench. One actor answers
// control messages. With --ping, another actor sends control messages. The messages use the same links as the standard
// actors.
//
// Each answer adds a line to --ping-file: microseconds to the peer, microseconds back. Both agents must run on one
// machine, because their times must come from the same clock.
#include <cstdio>
#include <fstream>
#include <memory>
#include <random>

#include "apps/common/arguments.h"
#include "apps/moondb_agent/agent_program.h"

namespace moondb {
namespace {

constexpr char kPing[] = "bench-ping";
constexpr char kEcho[] = "bench-echo";

std::uint64_t NanosecondsOf(MonotonicTime time) { return static_cast<std::uint64_t>(time.time_since_epoch().count()); }

// Replies with the time at which the ping arrived. The request_id of the reply is the time at which the ping was sent.
class EchoActor final : public Actor {
 public:
  void OnMessage(Context& context, const proto::Message& message) override {
    if (message.body_case() != proto::Message::BODY_NOT_SET || context.sender().actor != kPing) return;
    proto::Message reply;
    reply.set_ms_type(proto::CONTROL);
    reply.set_remaining(NanosecondsOf(context.now()));
    (void)context.Reply(std::move(reply));
  }
};

class PingActor final : public Actor {
 public:
  struct Options {
    AgentId to = 0;
    std::string file;
    // The period is random between the two limits, so that pings do not synchronise with batches.
    Duration period_min = std::chrono::milliseconds(50);
    Duration period_max = std::chrono::milliseconds(150);
  };

  explicit PingActor(const Options& options) : options_(options), file_(options.file, std::ios::app) {}

  void OnStart(Context& context) override { SetTimer(context); }

  void OnMessage(Context& context, const proto::Message& message) override {
    if (message.has_timer()) {
      proto::Message ping;
      ping.set_ms_type(proto::CONTROL);
      ping.set_request_id(NanosecondsOf(context.now()));
      (void)context.Send({options_.to, kEcho}, std::move(ping));  // A lost ping yields no sample.
      SetTimer(context);
    } else if (message.body_case() == proto::Message::BODY_NOT_SET && context.sender().agent == options_.to) {
      const std::uint64_t sent = message.request_id();
      const std::uint64_t heard = message.remaining();
      file_ << (heard - sent) / 1000 << ' ' << (NanosecondsOf(context.now()) - heard) / 1000 << std::endl;
    }
  }

 private:
  void SetTimer(Context& context) {
    std::uniform_int_distribution<std::int64_t> period(options_.period_min.count(), options_.period_max.count());
    context.AfterTimer(Duration(period(context.rng())), /*kind=*/1);
  }

  const Options options_;
  std::ofstream file_;
};

std::vector<OwnActor> MakeActors(const PingActor::Options& ping) {
  std::vector<OwnActor> actors(1);
  actors[0].name = kEcho;
  actors[0].factory = [] { return std::make_unique<EchoActor>(); };
  if (ping.to == 0) return actors;
  actors.emplace_back();
  actors[1].name = kPing;
  actors[1].factory = [ping] { return std::make_unique<PingActor>(ping); };
  return actors;
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  moondb::PingActor::Options ping;
  moondb::AgentProgram program;
  program.name = "sharing_bench_agent";
  program.add_options = [&ping](moondb::Command& app) {
    app.AddOption("--ping", ping.to, "Agent to send control messages to");
    app.AddOption("--ping-file", ping.file, "File for the round-trip times");
  };
  program.make_actors = [&ping](moondb::AgentId, const moondb::proto::TeamConfig&) {
    return moondb::Result<std::vector<moondb::OwnActor>>(moondb::MakeActors(ping));
  };
  return moondb::RunAgentProgram(argc, argv, program);
}
