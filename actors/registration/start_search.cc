#include "actors/registration/start_search.h"

#include <algorithm>
#include <numbers>
#include <set>
#include <tuple>

#include "model/check.h"

namespace moondb {
namespace {

constexpr MatchWindow kMapWindow = {1.5, 10 * std::numbers::pi / 180};
constexpr double kMapsApart_m = 5;
constexpr std::size_t kMapPairsOfPlace = 3;

std::uint64_t HashOf(const TrackSubmaps& first, const TrackSubmaps& second) {
  std::uint64_t hash = first.windows.size();
  for (const TrackSubmaps* const rover : {&first, &second}) {
    for (const SubmapWindow& window : rover->windows) hash = 0x9e3779b97f4a7c15 * (hash ^ window.hash);
  }
  return hash;
}

TrackSubmaps SubmapsOf(const StartSearch::Rover& rover) {
  std::map<NodeKey, std::size_t> indices;
  for (std::size_t i = 0; i < rover.track->size(); ++i) indices[rover.track->node(i)] = i;
  std::vector<TrackMap> maps;
  for (const RegisteredMap& map : rover.maps) {
    const auto index = indices.find(map.node);
    if (index == indices.end()) continue;
    const PlanarOffset node_from_local =
        PlanarOffset::From(map.map_from_node).Inverse() * PlanarOffset::From(map.map_from_local);
    maps.push_back({map.key, index->second, rover.track->odom_from_node(index->second) * node_from_local});
  }
  return {rover.track, FindWindows(*rover.track, std::move(maps))};
}

bool ShareNoMap(const StartSearch::Accepted& a, const StartSearch::Accepted& b) {
  return a.first.first.key != b.first.first.key && a.first.second.key != b.first.second.key;
}

}  // namespace

void StartSearch::Begin(const std::map<AgentId, Rover>& rovers, const std::vector<AgentPair>& wanted) {
  matcher_ = SubmapMatcher();
  searches_.clear();
  std::map<AgentId, TrackSubmaps> submaps;
  for (const auto& [agent, rover] : rovers) submaps[agent] = SubmapsOf(rover);
  std::erase_if(places_, [&](const auto& of_pair) { return std::ranges::find(wanted, of_pair.first) == wanted.end(); });
  std::size_t left = kPairsMax;
  for (const AgentPair& agents : wanted) {
    Search search;
    search.agents = agents;
    search.first = submaps.at(agents.first);
    search.second = submaps.at(agents.second);
    std::map<WindowPair, std::vector<SubmapPlace>> kept;
    auto& known = places_[agents];
    for (std::size_t i = 0; i < search.first.windows.size(); ++i) {
      for (std::size_t j = 0; j < search.second.windows.size(); ++j) {
        const auto found = known.find({search.first.windows[i].hash, search.second.windows[j].hash});
        if (found != known.end()) {
          kept.insert(std::move(*found));
        } else if (left > 0) {
          --left;
          search.windows.emplace_back(i, j);
        }
      }
    }
    known = std::move(kept);
    std::ranges::reverse(search.windows);
    const auto judged = judged_windows_.find(agents);
    const bool is_known = judged != judged_windows_.end() && judged->second == HashOf(search.first, search.second);
    if (is_known && search.windows.empty()) continue;
    for (const AgentId agent : {agents.first, agents.second}) {
      for (const RegisteredMap& map : rovers.at(agent).maps) search.maps.emplace(map.key, map);
      search.in_frame[agent] = rovers.at(agent).in_frame;
    }
    searches_.push_back(std::move(search));
  }
  std::ranges::reverse(searches_);
}

std::size_t StartSearch::left_count() const {
  std::size_t count = 0;
  for (const Search& search : searches_) count += std::max<std::size_t>(1, search.windows.size());
  return count;
}

std::vector<StartSearch::Accepted> StartSearch::Step(const KnownMaps& maps, FieldCache& fields) {
  Check(!searches_.empty(), "a pair of rovers is left");
  Search& search = searches_.back();
  if (!search.windows.empty()) {
    MatchNext(search, maps);
  } else if (!search.sets) {
    BeginSets(search);
  } else if (!search.has_sets) {
    search.has_sets = !search.sets->FindNext();
  } else if (search.fits.size() < search.sets->sets().size() || search.fit_row > 0) {
    CompareRow(search, maps);
  } else if (!search.is_judged) {
    std::vector<JudgedSet> sets;
    for (std::size_t i = 0; i < search.fits.size(); ++i) {
      sets.push_back(FiguresOf(search.sets->sets()[i], search.fits[i], *search.sets));
    }
    const JudgedStart judged = JudgeSets(sets);
    judged_[search.agents] = judged;
    judged_windows_[search.agents] = HashOf(search.first, search.second);
    search.is_judged = true;
    if (judged.verdict == StartVerdict::kAccepted) PlanMaps(search);
  } else if (!search.planned.empty()) {
    MatchMapsNext(search, maps, fields);
  } else {
    return Finish(search);
  }
  return {};
}

// Returns null if the cells of a map are gone.
std::shared_ptr<const SubmapTemplate> StartSearch::TemplateOf(const TrackSubmaps& rover, std::size_t window,
                                                              const Search& search, const KnownMaps& maps) {
  const SubmapWindow& of = rover.windows[window];
  const auto found = std::ranges::find(templates_, of.hash, [](const auto& one) { return one.first; });
  if (found != templates_.end()) {
    templates_.splice(templates_.begin(), templates_, found);
    return found->second;
  }
  const PlanarOffset submap_from_odom = rover.OdomFromSubmap(window).Inverse();
  std::vector<Submap::Source> sources;
  for (const TrackMap& map : of.maps) {
    std::optional<TraversabilityMap> cells = maps.FindMap(map.key);
    if (!cells) continue;
    const RegisteredMap& registered = search.maps.at(map.key);
    sources.push_back({*std::move(cells), submap_from_odom * map.odom_from_local,
                       maps.FindRovers(registered, &search.in_frame.at(registered.node.agent))});
  }
  templates_.emplace_front(of.hash, std::make_shared<const SubmapTemplate>(std::make_shared<const Submap>(sources)));
  if (templates_.size() > kSubmapsMax) templates_.pop_back();
  return templates_.front().second;
}

void StartSearch::MatchNext(Search& search, const KnownMaps& maps) {
  const auto [first, second] = search.windows.back();
  if (!matcher_.is_begun()) {
    matcher_.Begin(TemplateOf(search.first, first, search, maps), TemplateOf(search.second, second, search, maps));
  }
  if (matcher_.Step()) return;
  search.windows.pop_back();
  places_[search.agents][{search.first.windows[first].hash, search.second.windows[second].hash}] = matcher_.Finish();
}

void StartSearch::BeginSets(Search& search) {
  std::vector<SubmapHypothesis> hypotheses;
  const auto& places = places_[search.agents];
  for (std::size_t i = 0; i < search.first.windows.size(); ++i) {
    for (std::size_t j = 0; j < search.second.windows.size(); ++j) {
      const auto found = places.find({search.first.windows[i].hash, search.second.windows[j].hash});
      if (found == places.end()) continue;
      for (const SubmapPlace& place : found->second) hypotheses.push_back({i, j, place});
    }
  }
  search.sets.emplace(search.first, search.second, std::move(hypotheses));
}

// Compares one submap of the first rover with all of the second, at the poses of one set.
void StartSearch::CompareRow(Search& search, const KnownMaps& maps) {
  if (search.fit_row == 0) search.fits.emplace_back();
  const std::size_t first_count = search.first.windows.size();
  const SubmapSet& set = search.sets->sets()[search.fits.size() - 1];
  const auto first = TemplateOf(search.first, search.fit_row, search, maps);
  for (std::size_t i = 0; i < search.second.windows.size(); ++i) {
    search.fits.back().Add(set.graph, search.fit_row, first_count + i, first->submap(),
                           TemplateOf(search.second, i, search, maps)->submap());
  }
  search.fit_row = search.fit_row + 1 < first_count ? search.fit_row + 1 : 0;
}

// Plans the pairs of single maps that lie nearest to each other in the submaps of the best set.
void StartSearch::PlanMaps(Search& search) const {
  const SubmapSet& set = search.sets->sets().front();
  std::set<std::pair<RecordKey, RecordKey>> known;
  for (const std::size_t member : set.members) {
    const SubmapHypothesis& hypothesis = search.sets->hypotheses()[member];
    const auto poses_of = [](const TrackSubmaps& rover, std::size_t window, const PlanarOffset& pose) {
      std::vector<std::pair<RecordKey, PlanarOffset>> poses;
      const PlanarOffset common_from_odom = pose * rover.OdomFromSubmap(window).Inverse();
      for (const TrackMap& map : rover.windows[window].maps)
        poses.emplace_back(map.key, common_from_odom * map.odom_from_local);
      return poses;
    };
    std::vector<std::tuple<double, RecordKey, RecordKey, PlanarOffset>> near;
    for (const auto& [first, first_pose] :
         poses_of(search.first, hypothesis.first, set.first_poses[hypothesis.first])) {
      for (const auto& [second, second_pose] :
           poses_of(search.second, hypothesis.second, set.second_poses[hypothesis.second])) {
        const PlanarOffset offset = first_pose.Inverse() * second_pose;
        const double distance_m = offset.position_m().norm();
        if (distance_m <= kMapsApart_m) near.emplace_back(distance_m, first, second, offset);
      }
    }
    std::ranges::sort(near, {},
                      [](const auto& one) { return std::tuple(std::get<0>(one), std::get<1>(one), std::get<2>(one)); });
    std::size_t count = 0;
    for (const auto& [distance_m, first, second, offset] : near) {
      if (search.planned.size() == kMapPairsMax || count == kMapPairsOfPlace) break;
      ++count;
      if (!known.emplace(first, second).second) continue;
      search.planned.push_back({search.maps.at(first), search.maps.at(second), offset, kMapWindow});
    }
  }
  std::ranges::reverse(search.planned);
}

void StartSearch::MatchMapsNext(Search& search, const KnownMaps& maps, FieldCache& fields) {
  const PlannedMatch planned = std::move(search.planned.back());
  search.planned.pop_back();
  const std::shared_ptr<const HazardField> first = fields.FieldOf(planned.first, maps);
  const std::shared_ptr<const HazardField> second = fields.FieldOf(planned.second, maps);
  if (!first || !second) return;
  const MatchResult result = MatchMaps(*first, *second, planned.expected, planned.window);
  if (result.verdict == MatchVerdict::kAccepted) search.passed.emplace_back(planned, result);
}

std::vector<StartSearch::Accepted> StartSearch::Finish(Search& search) {
  std::vector<Accepted> passed = std::move(search.passed);
  JudgedStart& judged = judged_[search.agents];
  const bool are_independent = std::ranges::any_of(passed, [&](const Accepted& a) {
    return std::ranges::any_of(passed, [&](const Accepted& b) { return ShareNoMap(a, b); });
  });
  if (judged.verdict == StartVerdict::kAccepted && (passed.size() < kMapPairsMin || !are_independent)) {
    judged.verdict = StartVerdict::kFewMaps;
  }
  searches_.pop_back();
  if (judged.verdict != StartVerdict::kAccepted) return {};
  return passed;
}

}  // namespace moondb
