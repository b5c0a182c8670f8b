// moondb_sim: simulates a whole team in one process for hours of simulated time, and injects every kind of fault.
//
//   moondb_sim --seed 7            One run, with a summary.
//   moondb_sim --seeds 1..2000     Many runs. Prints each failing seed, its last events and a command to replay it.
//   moondb_sim --list              Lists the faults and their rates.
//
// Exit codes: 0 no invariant violated, 1 an invariant violated, 2 wrong usage.
#include <spdlog/spdlog.h>

#include <chrono>
#include <cstdio>
#include <map>
#include <string>

#include "apps/common/arguments.h"
#include "apps/common/json_writer.h"
#include "apps/common/progress.h"
#include "apps/moondb_sim/byzantine_agent.h"
#include "apps/moondb_sim/rare_states.h"
#include "apps/moondb_sim/simulated_mission.h"
#include "model/text.h"

namespace moondb::simulation {
namespace {

struct Request {
  SimOptions options;
  std::string seeds;
  std::vector<std::string> faults;
  std::string attacks;
  bool is_json = false;
  bool is_list = false;
};

struct Sweep {
  std::uint64_t first = 1;
  std::uint64_t last = 1;
};

Result<Sweep> ParseSeeds(const std::string& text) {
  const std::size_t dots = text.find("..");
  const std::optional<std::uint64_t> first = ParseUnsigned(text.substr(0, dots));
  const std::optional<std::uint64_t> last = dots == std::string::npos ? first : ParseUnsigned(text.substr(dots + 2));
  if (!first || !last || *first > *last || *last - *first >= 1'000'000) {
    return Fail(ErrorCode::kInvalid, "'" + text + "' is no range of seeds such as 1..300", "seeds");
  }
  return Sweep{*first, *last};
}

const std::map<std::string, ByzantineSeeds> kByzantineNames = {
    {"none", ByzantineSeeds::kNone}, {"some", ByzantineSeeds::kSome}, {"all", ByzantineSeeds::kAll}};

int Complain(const std::string& text, int exit_code) {
  std::fprintf(stderr, "moondb_sim: %s\n", text.c_str());
  return exit_code;
}

void PrintList() {
  std::printf("%-14s %8s  %s\n", "FAULT", "AN HOUR", "WHAT HAPPENS");
  for (const FaultKind& kind : FaultKinds()) {
    std::printf("%-14s %8g  %s\n", kind.name.c_str(), kind.per_hour, kind.what.c_str());
  }
  std::printf("\n%-14s %8s  %s\n", "ATTACK", "", "WHAT A BYZANTINE AGENT DOES");
  for (const AttackKind& kind : AttackKinds()) {
    std::printf("%-14s %8s  %s\n", kind.name.c_str(), "", kind.what.c_str());
  }
}

void PrintRareStates(const std::map<std::string, int>& counts) {
  std::printf("Rarely reached states, and how often they were:\n");
  for (const RareState& state : RareStateKinds()) {
    const auto count = counts.find(state.name);
    std::printf("  %-18s %6d  %s\n", state.name.c_str(), count == counts.end() ? 0 : count->second, state.what.c_str());
  }
}

void PrintRun(const SimReport& report) {
  std::printf("%llu records, %llu messages handled, trace %016llx\n", static_cast<unsigned long long>(report.records),
              static_cast<unsigned long long>(report.messages), static_cast<unsigned long long>(report.trace_hash));
  std::printf("%.2f MB on the radio: %.2f MB batches, %.2f MB have-sets\n",
              static_cast<double>(report.radio_bytes) / 1e6, static_cast<double>(report.batch_bytes) / 1e6,
              static_cast<double>(report.have_bytes) / 1e6);
  if (report.refill_bytes > 0) {
    std::printf("a survivor with an empty disk held all again after %.1f s at 1 Mbit/s and %.2f MB\n", report.refill_s,
                static_cast<double>(report.refill_bytes) / 1e6);
  }
  if (report.pruned > 0) std::printf("%.0f records pruned\n", report.pruned);
  if (report.failovers > 0) std::printf("%d times a survivor took the lead by itself\n", report.failovers);
  for (const auto& [fault, count] : report.faults) std::printf("  %-14s %d times\n", fault.c_str(), count);
  PrintRareStates(report.rare);
}

// Returns the command that repeats the run of `seed`.
std::string ReplayCommand(const Request& request, std::uint64_t seed) {
  std::string command = "moondb_sim --seed " + std::to_string(seed);
  const SimOptions standard;
  if (request.options.hours != standard.hours) command += " --hours " + FormatDouble(request.options.hours);
  if (request.options.rovers != standard.rovers) command += " --rovers " + std::to_string(request.options.rovers);
  if (!request.options.has_all_actors()) command += " --sharing";
  if (request.options.is_faultless) command += " --no-faults";
  for (const std::string& fault : request.faults) command += " --fault " + fault;
  for (const auto& [name, seeds] : kByzantineNames) {
    const bool is_it = seeds == request.options.byzantine && seeds != standard.byzantine;
    if (is_it) command += " --byzantine " + name;
  }
  if (!request.attacks.empty()) command += " --attacks " + request.attacks;
  return command;
}

void PrintViolations(const Request& request, std::uint64_t seed, const SimReport& report) {
  std::printf("The last messages before the first broken rule of seed %llu:\n", static_cast<unsigned long long>(seed));
  for (const std::string& event : report.last_events) std::printf("  %s\n", event.c_str());
  for (const Violation& violation : report.violations) {
    std::printf("seed %llu breaks %s at %.3f s, step %llu: %s\n", static_cast<unsigned long long>(seed),
                violation.rule.c_str(), violation.time_s, static_cast<unsigned long long>(violation.step),
                violation.text.c_str());
  }
  std::printf("trace %016llx; to see it again: %s\n", static_cast<unsigned long long>(report.trace_hash),
              ReplayCommand(request, seed).c_str());
  std::fflush(stdout);  // Show the results at once: a sweep takes minutes and may be interrupted.
}

struct Outcome {
  double done = 0;
  double broken = 0;
  std::map<std::string, int> rare;  // Sums of SimReport::rare over all runs.
  JsonWriter list;                  // JSON array of the seeds whose runs violate an invariant.
};

void RunSeed(const Request& request, std::uint64_t seed, bool is_only_one, Outcome& outcome) {
  SimOptions options = request.options;
  options.seed = seed;
  const SimReport report = RunSimulatedMission(options);
  ++outcome.done;
  for (const auto& [state, count] : report.rare) outcome.rare[state] += count;
  if (report.violations.empty()) {
    if (is_only_one && !request.is_json) PrintRun(report);
    return;
  }
  ++outcome.broken;
  if (!request.is_json) PrintViolations(request, seed, report);
  const Violation& first = report.violations.front();
  outcome.list.BeginObject().Key("seed").Number(static_cast<double>(seed)).Key("rule").String(first.rule);
  outcome.list.Key("time_s").Number(first.time_s).Key("step").Number(static_cast<double>(first.step));
  outcome.list.Key("text").String(first.text).EndObject();
}

int Run(const Request& request) {
  const Result<Sweep> sweep =
      request.seeds.empty() ? Sweep{request.options.seed, request.options.seed} : ParseSeeds(request.seeds);
  if (!sweep) return Complain(ToString(sweep.error()), 2);
  const auto start = std::chrono::steady_clock::now();
  const double count = static_cast<double>(sweep->last - sweep->first + 1);
  Outcome outcome;
  outcome.list.BeginArray();
  {
    Progress progress("seeds");
    for (std::uint64_t seed = sweep->first; seed <= sweep->last; ++seed) {
      RunSeed(request, seed, count == 1, outcome);
      if (request.is_json || count == 1) continue;
      progress.Show(outcome.done, count, FormatDouble(outcome.broken) + " broken");
    }
  }
  outcome.list.EndArray();
  const double took_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  const double speed = outcome.done * request.options.hours / took_s;
  if (request.is_json) {
    JsonWriter json;
    json.BeginObject().Key("seeds").Number(outcome.done).Key("violations").Number(outcome.broken);
    json.Key("sim_hours_per_second").Number(speed).Key("broken").Raw(outcome.list.text());
    json.Key("rare_states").BeginObject();
    for (const RareState& state : RareStateKinds()) json.Key(state.name).Number(outcome.rare[state.name]);
    json.EndObject().EndObject();
    std::printf("%s\n", json.text().c_str());
  } else {
    if (count > 1) PrintRareStates(outcome.rare);
    std::printf("%.0f seeds of %g h, %.0f of them break a rule, %.2f simulated hours a second\n", outcome.done,
                request.options.hours, outcome.broken, speed);
  }
  return outcome.broken == 0 ? 0 : 1;
}

int Main(int argc, char** argv) {
  spdlog::set_level(spdlog::level::off);  // Faults make actors fail on purpose, so their log lines are noise.
  Request request;
  Command app("moondb_sim", "Simulates a team for hours, breaks what can break, and checks the rules of sharing");
  Option& seed = app.AddOption("--seed", request.options.seed, "Seed of a single run").DefaultShown();
  app.AddOption("--seeds", request.seeds, "Many runs: FIRST..LAST").Excludes(seed);
  app.AddOption("--hours", request.options.hours, "Simulated time of a run").Within(0.2, 1000.0).DefaultShown();
  app.AddOption("--rovers", request.options.rovers, "Number of rovers, without the base station")
      .Within(2, 63)
      .DefaultShown();
  bool is_sharing_only = false;
  app.AddFlag("--sharing", is_sharing_only, "Simulate only the sharing actors, without clients (faster)");
  app.AddOption("--fault", request.faults, "NAME=RATE an hour; may be given several times");
  app.AddFlag("--no-faults", request.options.is_faultless, "Inject only the faults named by --fault");
  app.AddChoice("--byzantine", request.options.byzantine, kByzantineNames,
                "Seeds with an additional Byzantine rover: none, some (of those with signing keys) or all")
      .DefaultShown("some");
  app.AddOption("--attacks", request.attacks, "NAME,NAME...: use only these of its attacks");
  app.AddFlag("--refill", request.options.measures_refill, "At the end of one run: refill an empty survivor");
  app.AddFlag("--json", request.is_json, "One JSON object at the end");
  app.AddFlag("--list", request.is_list, "List the faults and attacks");
  if (const std::optional<int> exit_code = app.ParseOrReport(argc, argv)) return *exit_code == 0 ? 0 : 2;
  if (is_sharing_only) request.options.actors = SimulatedActors::kSharing;
  if (request.is_list) {
    PrintList();
    return 0;
  }
  for (const std::string& fault : request.faults) {
    if (const Result<void> set = SetFault(fault, request.options); !set) return Complain(ToString(set.error()), 2);
  }
  if (!request.attacks.empty()) {
    if (const Result<void> set = SetAttacks(request.attacks, request.options); !set) {
      return Complain(ToString(set.error()), 2);
    }
  }
  return Run(request);
}

}  // namespace
}  // namespace moondb::simulation

int main(int argc, char** argv) { return moondb::simulation::Main(argc, argv); }
