#include "actors/registration/start_search.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <tuple>

namespace moondb {
namespace {

constexpr MatchWindow kWindow = {5, std::numbers::pi};
constexpr double kMatchedMin = 0.8;
constexpr double kSpacing_m = 2;
constexpr double kSame_m = 0.3;
constexpr double kSameOfPath = 0.05;
constexpr double kSame_rad = 5 * std::numbers::pi / 180;
constexpr std::size_t kAgreeingMin = 2;
constexpr std::size_t kContradictingPart = 3;

// Returns at most `count_max` of the maps: those at multiples of a power of two. A longer list thus keeps the choice of
// a shorter one, as far as it has room.
std::vector<const RegisteredMap*> Thin(const std::vector<const RegisteredMap*>& maps, std::size_t count_max) {
  std::size_t stride = 1;
  while ((maps.size() + stride - 1) / stride > count_max) stride *= 2;
  std::vector<const RegisteredMap*> thin;
  for (std::size_t i = 0; i < maps.size(); i += stride) thin.push_back(maps[i]);
  return thin;
}

// Returns the pose of the rover's own frame in the frame `map` by this match.
PlanarOffset FrameOf(const StartSearch::Accepted& accepted) {
  const auto& [planned, result] = accepted;
  const Pose first = PlanarOffset::From(planned.first.map_from_local).ToPose();
  const Pose second = PlanarOffset::From(planned.second.map_from_local).ToPose();
  return PlanarOffset::From(first * result.first_from_second.ToPose() * second.Inverse());
}

// Compares where the two matches place the middle between their maps of the rover.
bool Agree(const StartSearch::Accepted& a, const StartSearch::Accepted& b) {
  const Eigen::Vector2d first_m = a.first.second.map_from_local.position_m.head<2>();
  const Eigen::Vector2d second_m = b.first.second.map_from_local.position_m.head<2>();
  const Eigen::Vector2d middle_m = (first_m + second_m) / 2;
  const PlanarOffset frame_a = FrameOf(a);
  const PlanarOffset frame_b = FrameOf(b);
  const double apart_m = (frame_a * middle_m - frame_b * middle_m).norm();
  return apart_m <= kSame_m + kSameOfPath * (first_m - second_m).norm() &&
         std::abs(std::remainder(frame_a.yaw_rad - frame_b.yaw_rad, 2 * std::numbers::pi)) <= kSame_rad;
}

bool ShareNoMap(const StartSearch::Accepted& a, const StartSearch::Accepted& b) {
  return a.first.first.key != b.first.first.key && a.first.second.key != b.first.second.key;
}

}  // namespace

std::vector<PlannedMatch> StartSearch::Plan(const std::vector<RegisteredMap>& maps,
                                            const std::set<AgentId>& placed) const {
  std::vector<const RegisteredMap*> others;
  std::map<AgentId, std::vector<const RegisteredMap*>> lost;
  std::set<std::tuple<AgentId, std::int64_t, std::int64_t>> squares;
  for (const RegisteredMap& map : maps) {
    if (!placed.contains(map.node.agent)) {
      lost[map.node.agent].push_back(&map);
      continue;
    }
    const Eigen::Vector2d square = map.map_from_local.position_m.head<2>() / kSpacing_m;
    const bool is_first = squares
                              .emplace(map.node.agent, static_cast<std::int64_t>(std::floor(square.x())),
                                       static_cast<std::int64_t>(std::floor(square.y())))
                              .second;
    if (is_first) others.push_back(&map);
  }
  std::vector<PlannedMatch> planned;
  for (const auto& [rover, of_rover] : lost) {
    for (const RegisteredMap* second : Thin(of_rover, kRoverMapsMax)) {
      for (const RegisteredMap* first : Thin(others, kOtherMapsMax)) {
        if (!tried_.contains({first->key, second->key})) planned.push_back({*first, *second, {}, kWindow});
      }
    }
  }
  return planned;
}

void StartSearch::Note(const PlannedMatch& planned, const MatchResult& result) {
  tried_.insert({planned.first.key, planned.second.key});
  if (result.verdict != MatchVerdict::kAccepted || result.matched < kMatchedMin) return;
  accepted_[planned.second.node.agent].emplace_back(planned, result);
}

std::vector<StartSearch::Accepted> StartSearch::FindAgreeing(AgentId rover) const {
  const auto found = accepted_.find(rover);
  if (found == accepted_.end()) return {};
  std::vector<Accepted> best;
  for (const Accepted& center : found->second) {
    std::vector<Accepted> agreeing;
    bool is_independent = false;
    for (const Accepted& other : found->second) {
      if (!Agree(center, other)) continue;
      agreeing.push_back(other);
      is_independent = is_independent || ShareNoMap(center, other);
    }
    if (is_independent && agreeing.size() > best.size()) best = std::move(agreeing);
  }
  const std::size_t contradicting = found->second.size() - best.size();
  if (best.size() < kAgreeingMin || kContradictingPart * contradicting > best.size()) return {};
  return best;
}

}  // namespace moondb
