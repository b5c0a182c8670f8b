#include <chrono>
#include <memory>
#include <string>
#include <thread>

#include "bench/cases.h"
#include "bench/linked_agents.h"
#include "bench/process_status.h"

namespace moondb {
namespace {

constexpr int kAgents = 4;
constexpr int kPoolActors = 4;
constexpr int kThreadActors = 3;
// Time from the start of the agents until they are idle.
constexpr std::chrono::seconds kSettling(5);

class Idler final : public Actor {
 public:
  void OnMessage(Context&, const proto::Message&) override {}
};

void SpawnIdlers(ActorSystem& system, int count, Placement placement, const std::string& name) {
  SpawnOptions options;
  options.placement = placement;
  for (int i = 0; i < count; ++i) {
    system.Spawn(name + std::to_string(i), options, [] { return std::make_unique<Idler>(); });
  }
}

// Measures wake-ups and processor time of idle agents that run in this process. The results are averages per agent.
Result<std::vector<Section>> RunIdle(const BenchOptions& options) {
  if (!IsAskedFor("moondb", options)) return std::vector<Section>{};
  Tally tally(/*sender_count=*/1, /*per_sender=*/1);
  LinkedAgents agents(kAgents, /*is_curve=*/true, tally);
  for (AgentId id = 1; id <= kAgents; ++id) {
    SpawnIdlers(agents.system(id), kPoolActors, Placement::kPool, "pool");
    SpawnIdlers(agents.system(id), kThreadActors, Placement::kOwnThread, "thread");
  }
  if (const Result<void> started = agents.Start(); !started) return tl::unexpected(started.error());
  std::this_thread::sleep_for(kSettling);

  const auto start = BenchClock::now();
  const double cpu_before_s = CpuSeconds();
  const std::int64_t switches_before = VoluntarySwitches();
  std::this_thread::sleep_for(std::chrono::seconds(options.idle_seconds));
  const auto switches = static_cast<double>(VoluntarySwitches() - switches_before);
  const double cpu_s = CpuSeconds() - cpu_before_s;
  const double seconds = std::chrono::duration<double>(BenchClock::now() - start).count();
  return std::vector<Section>{
      {"idle_wakeups_per_s", "1/s", "<= 5", {{"moondb", {switches / seconds / kAgents}}}},
      {"idle_cpu_percent", "% of a core", "<= 0.1", {{"moondb", {100 * cpu_s / seconds / kAgents}}}},
  };
}

}  // namespace

std::vector<BenchCase> IdleCases() { return {{"idle", RunIdle}}; }

}  // namespace moondb
