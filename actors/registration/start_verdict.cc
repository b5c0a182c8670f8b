#include "actors/registration/start_verdict.h"

#include <algorithm>
#include <set>

namespace moondb {
namespace {

constexpr double kOverlapMax_m = 30;
constexpr int kNearlyCommon = kSubmapCommonMin / 2;
constexpr double kMoved_m = 0.05;
constexpr double kMoved_rad = 0.003;
constexpr double kSpan_m = 4;
constexpr double kSigmaMax_m = 0.25;

// A set is accepted by either of two rules.
constexpr double kEvidence = 12;
constexpr double kMatched = 0.90;
constexpr double kContradicted = 0.06;
constexpr double kRivalFactor = 1.5;         // Times the evidence of a rival that contradicts little.
constexpr double kRivalContradicted = 0.14;  // A rival that contradicts more needs only less evidence.
constexpr double kStrongEvidence = 40;
constexpr double kStrongMatched = 0.85;
constexpr double kStrongContradicted = 0.10;
constexpr double kStrongRivalFactor = 3;

// Returns the largest distance of two of the used poses.
double SpanOf(const std::vector<PlanarOffset>& poses, const std::set<std::size_t>& used) {
  double span_m = 0;
  for (const std::size_t a : used) {
    for (const std::size_t b : used) span_m = std::max(span_m, (poses[a].position_m() - poses[b].position_m()).norm());
  }
  return span_m;
}

bool FitsWell(const JudgedSet& set) { return set.matched >= kMatched && set.contradicted <= kContradicted; }

}  // namespace

bool SetFit::MayOverlap(const SubmapGraph& solved, std::size_t first_pose, std::size_t second_pose) {
  const Eigen::Vector2d apart_m = solved.poses()[first_pose].position_m() - solved.poses()[second_pose].position_m();
  return apart_m.norm() <= kOverlapMax_m;
}

void SetFit::Add(const SubmapGraph& solved, std::size_t first_pose, std::size_t second_pose, const Submap& first,
                 const Submap& second) {
  if (!MayOverlap(solved, first_pose, second_pose)) return;
  const PlanarOffset offset = solved.poses()[first_pose].Inverse() * solved.poses()[second_pose];
  SubmapOverlap overlap = CompareSubmaps(first, second, offset);
  if (overlap.Common() < kNearlyCommon) return;
  const Eigen::Matrix3d least = Eigen::Vector3d(kMoved_m, kMoved_m, kMoved_rad).cwiseAbs2().asDiagonal();
  const Eigen::Matrix3d covariance = solved.RelativeCovarianceOf(first_pose, second_pose) + least;
  const PlanarOffset refined = RefineSubmaps(first, second, {offset, covariance.inverse()});
  const SubmapGraph::Factor moved{first_pose, second_pose, refined, least};
  if (solved.ChiSquareOf(moved, /*with_poses=*/true) <= kPlanarChiSquareMax)
    overlap = CompareSubmaps(first, second, refined);
  if (overlap.Common() < kSubmapCommonMin) return;
  for (const SubmapOverlap::Counts& counts : overlap.of) {
    common_ += counts.common;
    matched_ += counts.matched;
    contradicted_ += counts.contradicted;
  }
}

JudgedSet FiguresOf(const SubmapSet& set, const SetFit& fit, const SubmapSets& all) {
  std::set<std::size_t> first, second;
  for (const std::size_t member : set.members) {
    first.insert(all.hypotheses()[member].first);
    second.insert(set.first_count + all.hypotheses()[member].second);
  }
  const double span_m = std::min(SpanOf(set.graph.poses(), first), SpanOf(set.graph.poses(), second));
  return {set.evidence, fit.matched(), fit.contradicted(), set.sigma_m, span_m};
}

PlacedSubmaps BestPlaceOf(const SubmapSet& set, const SubmapSets& all) {
  const SubmapHypothesis& best = all.hypotheses()[set.members.front()];
  return {all.first().NodesOf(best.first), all.second().NodesOf(best.second), best.place.first_from_second};
}

JudgedStart JudgeSets(const std::vector<JudgedSet>& sets) {
  JudgedStart judged;
  if (sets.empty()) return judged;
  const JudgedSet& best = judged.best = sets.front();
  double near_rival = 0;  // Evidence of rivals that contradict little.
  bool has_twin = false;  // Another set would be accepted alone.
  for (std::size_t i = 1; i < sets.size(); ++i) {
    judged.rival = std::max(judged.rival, sets[i].evidence);
    if (sets[i].contradicted <= kRivalContradicted) near_rival = std::max(near_rival, sets[i].evidence);
    has_twin = has_twin || (sets[i].evidence >= kEvidence && FitsWell(sets[i]));
  }
  const bool is_rivalled = best.evidence < kRivalFactor * near_rival || best.evidence < judged.rival;
  const bool is_strong = best.evidence >= kStrongEvidence && best.evidence >= kStrongRivalFactor * judged.rival;
  if (best.span_m < kSpan_m) {
    judged.verdict = StartVerdict::kFewSubmaps;
  } else if (best.sigma_m > kSigmaMax_m) {
    judged.verdict = StartVerdict::kUncertain;
  } else if (has_twin) {
    judged.verdict = StartVerdict::kRival;
  } else if (is_strong && best.matched >= kStrongMatched && best.contradicted <= kStrongContradicted) {
    judged.verdict = StartVerdict::kAccepted;
  } else if (best.evidence < kEvidence) {
    judged.verdict = StartVerdict::kLittleEvidence;
  } else if (is_rivalled) {
    judged.verdict = StartVerdict::kRival;
  } else if (!FitsWell(best)) {
    judged.verdict = StartVerdict::kContradicted;
  } else {
    judged.verdict = StartVerdict::kAccepted;
  }
  return judged;
}

std::string ToString(StartVerdict verdict) {
  switch (verdict) {
    case StartVerdict::kAccepted:
      return "accepted";
    case StartVerdict::kNoPlace:
      return "no two places look alike";
    case StartVerdict::kFewSubmaps:
      return "only one place looks alike";
    case StartVerdict::kUncertain:
      return "the position is too uncertain";
    case StartVerdict::kLittleEvidence:
      return "too little looks alike";
    case StartVerdict::kRival:
      return "another place fits nearly as well";
    case StartVerdict::kContradicted:
      return "the maps contradict each other";
    case StartVerdict::kFewMaps:
      return "too few single maps match";
  }
  return "unknown";
}

std::string RemedyOf(StartVerdict verdict) {
  switch (verdict) {
    case StartVerdict::kAccepted:
      return "";
    case StartVerdict::kNoPlace:
    case StartVerdict::kFewSubmaps:
    case StartVerdict::kLittleEvidence:
      return "drive one of them through places that the other has seen";
    case StartVerdict::kUncertain:
    case StartVerdict::kFewMaps:
      return "drive one of them along the other's path";
    case StartVerdict::kRival:
      return "drive one of them on, to where its surroundings differ from those that look alike";
    case StartVerdict::kContradicted:
      return "drive one of them through other places that the other has seen, or quarantine maps of things that have "
             "moved since";
  }
  return "";
}

}  // namespace moondb
