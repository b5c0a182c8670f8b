#include "bench/in_process.h"

#include <algorithm>
#include <utility>

#include "bench/limit_cases.h"
#include "bench/moondb_cases.h"
#include "model/check.h"
#if MOONDB_HAS_CAF
#include "bench/caf_cases.h"
#endif

namespace moondb {
namespace {

constexpr int kManySenders = 8;

struct Case {
  std::string name;
  std::string unit;
  std::string target;
  std::uint64_t share;  // Of BenchOptions::messages: one part in so many.
  Measure moondb;
  Measure caf;
  Measure limit;
};

// NAME without CAF: an empty function.
#if MOONDB_HAS_CAF
#define MOONDB_CAF(...) __VA_ARGS__
#else
#define MOONDB_CAF(...) nullptr
#endif

const std::vector<Case>& Cases() {
  static const std::vector<Case> cases = {
      {"one_to_one", "messages/s", ">= 2 x CAF", 1, [](std::uint64_t count) { return MoondbFanIn(1, count); },
       MOONDB_CAF([](std::uint64_t count) { return CafFanIn(1, count); }),
       [](std::uint64_t count) { return LimitFanIn(1, count); }},
      {"fan_in", "messages/s", ">= 2 x CAF", 1, [](std::uint64_t count) { return MoondbFanIn(kManySenders, count); },
       MOONDB_CAF([](std::uint64_t count) { return CafFanIn(kManySenders, count); }),
       [](std::uint64_t count) { return LimitFanIn(kManySenders, count); }},
      {"actor_to_actor", "messages/s", "", 1, MoondbActorToActor, MOONDB_CAF(CafActorToActor),
       [](std::uint64_t count) { return Result<double>(LimitCalls(2, count)); }},
      {"ring", "messages/s", ">= 5 x CAF", 5, MoondbRing, MOONDB_CAF(CafRing),
       [](std::uint64_t count) { return Result<double>(LimitCalls(kRingActors, count)); }},
      {"ping_pong_same_worker_us", "us", "<= 0.5 x CAF", 5, MoondbPingPongSameWorker, MOONDB_CAF(CafPingPongSameWorker),
       [](std::uint64_t count) { return Result<double>(2e6 / LimitCalls(2, 2 * count)); }},
      {"ping_pong_across_threads_us", "us", "<= 1.3 x limit", 50, MoondbPingPongAcrossThreads,
       MOONDB_CAF(CafPingPongAcrossThreads), [](std::uint64_t count) { return Result<double>(LimitHandover(count)); }},
  };
  return cases;
}

#undef MOONDB_CAF

}  // namespace

std::vector<std::string> InProcessCases() {
  std::vector<std::string> names;
  for (const Case& one : Cases()) names.push_back(one.name);
  return names;
}

Result<Section> RunInProcessCase(const std::string& name, const BenchOptions& options) {
  const auto found = std::find_if(Cases().begin(), Cases().end(), [&](const Case& one) { return one.name == name; });
  Check(found != Cases().end(), "the case exists");
  std::vector<Contender> contenders = {{"moondb", found->moondb}};
  if (found->caf) contenders.push_back({"caf", found->caf});
  contenders.push_back({"limit", found->limit});
  const std::uint64_t count = std::max<std::uint64_t>(options.messages / found->share, 8);
  Result<std::vector<Figure>> figures = MeasureInTurn(contenders, options.repetitions, count);
  if (!figures) return tl::unexpected(figures.error());
  return Section{name, found->unit, found->target, std::move(*figures)};
}

}  // namespace moondb
