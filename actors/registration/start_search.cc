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

bool ShareNoMap(const StartSearch::Accepted& a, const StartSearch::Accepted& b) {
  return a.first.first.key != b.first.first.key && a.first.second.key != b.first.second.key;
}

}  // namespace

void StartSearch::Begin(std::map<AgentId, SearchedRover> rovers, const std::vector<AgentPair>& wanted) {
  matcher_ = SubmapMatcher();
  searches_.clear();
  rovers_ = std::move(rovers);
  std::erase_if(places_, [&](const auto& of_pair) { return std::ranges::find(wanted, of_pair.first) == wanted.end(); });
  std::size_t left = kPairsMax;
  for (const AgentPair& agents : wanted) {
    Search search;
    search.agents = agents;
    const std::vector<SubmapWindow>& first = First(search).windows();
    const std::vector<SubmapWindow>& second = Second(search).windows();
    std::map<WindowPair, std::vector<SubmapPlace>> kept;
    auto& known = places_[agents];
    for (std::size_t i = 0; i < first.size(); ++i) {
      for (std::size_t j = 0; j < second.size(); ++j) {
        const auto found = known.find({first[i].hash, second[j].hash});
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
    const bool is_known = judged != judged_windows_.end() && judged->second == WindowsOf(agents);
    if (!is_known || !search.windows.empty()) searches_.push_back(std::move(search));
  }
  std::ranges::reverse(searches_);
}

// Returns the hashes of all windows of both rovers.
std::vector<std::uint64_t> StartSearch::WindowsOf(const AgentPair& agents) const {
  std::vector<std::uint64_t> hashes;
  for (const AgentId agent : {agents.first, agents.second}) {
    for (const SubmapWindow& window : rovers_.at(agent).windows()) hashes.push_back(window.hash);
    hashes.push_back(agent);
  }
  return hashes;
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
    JudgedStart judged = JudgeSets(sets);
    if (!sets.empty()) judged.place = BestPlaceOf(search.sets->sets().front(), *search.sets);
    judged_[search.agents] = judged;
    judged_windows_[search.agents] = WindowsOf(search.agents);
    search.is_judged = true;
    if (judged.verdict == StartVerdict::kAccepted) PlanMaps(search);
  } else if (!search.planned.empty()) {
    MatchMapsNext(search, maps, fields);
  } else {
    return Finish(search);
  }
  return {};
}

std::shared_ptr<const SubmapTemplate> StartSearch::TemplateOf(const SearchedRover& rover, std::size_t window,
                                                              const KnownMaps& maps) {
  const SubmapWindow& of = rover.windows()[window];
  const auto found = std::ranges::find(templates_, of.hash, [](const auto& one) { return one.first; });
  if (found != templates_.end()) {
    templates_.splice(templates_.begin(), templates_, found);
    return found->second;
  }
  templates_.emplace_front(of.hash, std::make_shared<const SubmapTemplate>(rover.Fuse(window, maps)));
  if (templates_.size() > kSubmapsMax) templates_.pop_back();
  return templates_.front().second;
}

void StartSearch::MatchNext(Search& search, const KnownMaps& maps) {
  const auto [first, second] = search.windows.back();
  if (!matcher_.is_begun()) {
    matcher_.Begin(TemplateOf(First(search), first, maps), TemplateOf(Second(search), second, maps));
  }
  if (matcher_.Step()) return;
  search.windows.pop_back();
  const std::uint64_t first_hash = First(search).windows()[first].hash;
  const std::uint64_t second_hash = Second(search).windows()[second].hash;
  places_[search.agents][{first_hash, second_hash}] = matcher_.Finish();
}

void StartSearch::BeginSets(Search& search) {
  const TrackSubmaps& first = First(search).submaps();
  const TrackSubmaps& second = Second(search).submaps();
  std::vector<SubmapHypothesis> hypotheses;
  const auto& places = places_[search.agents];
  for (std::size_t i = 0; i < first.windows.size(); ++i) {
    for (std::size_t j = 0; j < second.windows.size(); ++j) {
      const auto found = places.find({first.windows[i].hash, second.windows[j].hash});
      if (found == places.end()) continue;
      for (const SubmapPlace& place : found->second) hypotheses.push_back({i, j, place});
    }
  }
  search.sets.emplace(first, second, std::move(hypotheses));
}

// Compares one submap of the first rover with all of the second, at the poses of one set.
void StartSearch::CompareRow(Search& search, const KnownMaps& maps) {
  if (search.fit_row == 0) search.fits.emplace_back();
  const SearchedRover& rover = First(search);
  const SearchedRover& other = Second(search);
  const SubmapSet& set = search.sets->sets()[search.fits.size() - 1];
  const auto first = TemplateOf(rover, search.fit_row, maps);
  for (std::size_t i = 0; i < other.windows().size(); ++i) {
    search.fits.back().Add(set.graph, search.fit_row, set.first_count + i, first->submap(),
                           TemplateOf(other, i, maps)->submap());
  }
  search.fit_row = search.fit_row + 1 < set.first_count ? search.fit_row + 1 : 0;
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
         poses_of(First(search).submaps(), hypothesis.first, set.FirstPose(hypothesis.first))) {
      for (const auto& [second, second_pose] :
           poses_of(Second(search).submaps(), hypothesis.second, set.SecondPose(hypothesis.second))) {
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
      search.planned.push_back({First(search).map(first), Second(search).map(second), offset, kMapWindow});
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
