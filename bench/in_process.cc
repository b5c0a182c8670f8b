#include "bench/in_process.h"

#include <string>
#include <utility>
#include <vector>

#include "bench/cases.h"

namespace moondb {
namespace {

constexpr int kManySenders = 8;

Contest FanIn(std::string name, int sender_count) {
  const auto with = [sender_count](const InProcess& contender) -> Measure {
    if (!contender.fan_in) return nullptr;
    return [fan_in = contender.fan_in, sender_count](std::uint64_t count) { return fan_in(sender_count, count); };
  };
  return {std::move(name),
          "messages/s",
          ">= 2 x caf",
          /*share=*/1,
          {{"moondb", with(MoondbInProcess())}, {"caf", with(CafInProcess())}, {"limit", with(LimitInProcess())}}};
}

Contest Of(std::string name, std::string unit, std::string target, std::uint64_t share, Measure InProcess::*measure) {
  return {
      std::move(name),
      std::move(unit),
      std::move(target),
      share,
      {{"moondb", MoondbInProcess().*measure}, {"caf", CafInProcess().*measure}, {"limit", LimitInProcess().*measure}}};
}

}  // namespace

std::vector<BenchCase> InProcessCases() {
  return {
      AsCase(FanIn("one_to_one", 1)),
      AsCase(FanIn("fan_in", kManySenders)),
      AsCase(Of("actor_to_actor", "messages/s", "", /*share=*/1, &InProcess::actor_to_actor)),
      AsCase(Of("ring", "messages/s", ">= 5 x caf", /*share=*/2, &InProcess::ring)),
      AsCase(Of("ping_pong_same_worker_us", "us", "<= 0.5 x caf", /*share=*/5, &InProcess::ping_pong_same_worker)),
      AsCase(Of("ping_pong_across_threads_us", "us", "<= 1.3 x limit", /*share=*/50,
                &InProcess::ping_pong_across_threads)),
  };
}

}  // namespace moondb
