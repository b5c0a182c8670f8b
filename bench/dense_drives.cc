#include "bench/dense_drives.h"

#include <fmt/core.h>

#include <map>
#include <memory>

#include "actors/registration/match_plan.h"
#include "apps/moondb_mission/random.h"
#include "bench/laser_maps.h"
#include "bench/measure.h"
#include "bench/process_status.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

constexpr std::uint64_t kSeed = 7;
constexpr int kRovers = 3;
constexpr int kMapsOfRover = 798;
constexpr double kStep_m = 0.2;
constexpr int kPassesMax = 5;
constexpr double kDrift = 0.01;

}  // namespace

std::vector<DensePass> MatchDenseDrives() {
  const std::vector<LaserMap> driven = MakeLaserDrives(kSeed, kRovers, kMapsOfRover, kStep_m);
  Random random(kSeed);
  std::vector<RegisteredMap> maps;
  std::map<RecordKey, const LaserMap*> of_key;
  Pose drift;
  for (const LaserMap& one : driven) {
    if (one.node.index == 0) drift = Pose();
    drift.position_m.x() += kDrift * kStep_m * random.Normal();
    drift.position_m.y() += kDrift * kStep_m * random.Normal();
    const RecordKey key{{one.node.agent, 1, proto::LOCAL_TRAVERSABILITY_MAP}, one.node.index + 1};
    of_key[key] = &one;
    maps.push_back({key, one.node, 0, drift * one.pose, drift * one.pose});
  }
  MatchPlan plan{MatchPlan::Options{}};
  std::map<RecordKey, std::unique_ptr<HazardField>> fields;
  const auto field_of = [&](const RecordKey& key) -> const HazardField& {
    std::unique_ptr<HazardField>& field = fields[key];
    if (!field) field = std::make_unique<HazardField>(of_key.at(key)->map, std::span<const MaskedDisc>());
    return *field;
  };
  std::vector<DensePass> passes;
  for (int i = 0; i < kPassesMax; ++i) {
    DensePass pass;
    std::vector<double> errors_m;
    const double begin = CpuSeconds();
    const std::vector<PlannedMatch> planned = plan.StartPass(maps, [](AgentId, AgentId) { return true; });
    if (planned.empty()) break;
    for (const PlannedMatch& pair : planned) {
      if (!plan.HasWorkFor(pair)) continue;
      const MatchResult result =
          MatchMaps(field_of(pair.first.key), field_of(pair.second.key), pair.expected, pair.window);
      plan.Note(pair, result);
      if (result.verdict != MatchVerdict::kAccepted) continue;
      const PlanarOffset truth =
          PlanarOffset::Between(of_key.at(pair.first.key)->pose, of_key.at(pair.second.key)->pose);
      errors_m.push_back((truth.Inverse() * result.first_from_second).position_m().norm());
    }
    pass.seconds = CpuSeconds() - begin;
    pass.map_count = maps.size();
    pass.pair_count = planned.size();
    pass.accepted_count = errors_m.size();
    for (const auto& [agents, count] : plan.CountLeftOut()) pass.left_out_count += count;
    if (!errors_m.empty()) pass.error_m = Median(errors_m);
    passes.push_back(pass);
  }
  return passes;
}

std::string TextOf(const std::vector<DensePass>& passes) {
  std::string text = "Maps each 0.2 m in one building\n";
  double seconds = 0;
  for (const DensePass& pass : passes) {
    seconds += pass.seconds;
    text +=
        fmt::format("{} maps, {} pairs, {} left out; {} accepted, median error {:.3f} m; {:.1f} s\n", pass.map_count,
                    pass.pair_count, pass.left_out_count, pass.accepted_count, pass.error_m, pass.seconds);
  }
  return text + fmt::format("all passes: {:.1f} s\n", seconds);
}

}  // namespace moondb
