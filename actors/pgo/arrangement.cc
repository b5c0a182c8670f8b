#include "actors/pgo/arrangement.h"

#include <ceres/loss_function.h>
#include <ceres/problem.h>
#include <ceres/solver.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>

#include "actors/pgo/ceres_options.h"

namespace moondb {

namespace {

// Odometry drift, as a fraction of the median range. Increases the sigma of each range (root sum of squares).
constexpr double kDriftPart = 0.02;
constexpr double kCauchySigmas = 2;
constexpr double kSamePlacePart = 0.05;  // Positions closer than this fraction of the median range count as the same.
constexpr int kIterationsMax = 60;
constexpr std::size_t kManyBodies = 20;  // Above this number, use fewer starts and a sparse solver.
constexpr int kStartsMin = 4;
constexpr std::size_t kRangesOfBodyMin = 10;

// Returns element k of a low-discrepancy sequence in [0, 1). Sequences of different `dimension` are uncorrelated.
double Spread(int k, int dimension) {
  // The steps are powers of the inverse of the generalised golden ratio in five dimensions (Roberts, 2018).
  constexpr double kBase = 1.0 / 1.1347241384015194;
  return std::fmod(0.5 + std::pow(kBase, dimension % 5 + 1) * (k + 1) + 0.37 * (dimension / 5) * (k + 1), 1.0);
}

class Arranger {
 public:
  Arranger(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<bool>& placed,
           const std::vector<std::size_t>& heads, const PlainState& state, const ArrangementOptions& options)
      : graph_(graph), active_(active), placed_(placed), heads_(heads), state_(state), options_(options) {
    ChooseRanges();
    OrderBodies();
    MakeFactors();
  }

  std::vector<Arrangement> Run() {
    std::vector<std::pair<double, Frames>> found;
    if (!order_.empty()) {
      const auto fit = [&](Frames frames) {
        const double cost = Fit(frames);
        if (std::isfinite(cost)) found.emplace_back(cost, std::move(frames));
      };
      if (options_.begins_as_given) fit(GivenFrames());
      for (int start = 0; start < StartCount() && !IsStopped(); ++start) fit(FirstFrames(start));
    }
    if (found.empty()) return {Arrangement{0, state_, {}}};
    std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<Arrangement> kept;
    std::vector<const Frames*> kept_frames;
    for (const auto& [cost, frames] : found) {
      if (kept.size() == options_.kept) break;
      const auto is_same = [&, &own = frames](const Frames* other) { return IsSame(own, *other); };
      if (std::any_of(kept_frames.begin(), kept_frames.end(), is_same)) continue;
      kept.push_back({cost, Apply(frames), PosesOf(frames)});
      kept_frames.push_back(&frames);
    }
    return kept;
  }

 private:
  using Frames = std::map<std::size_t, PoseBlock>;  // map_from_body, keyed by the head (first node) of the body.

  bool IsStopped() const { return options_.stop_requested && options_.stop_requested(); }
  bool IsBody(std::size_t node) const { return !placed_[node]; }

  int StartCount() const {
    if (order_.size() <= kManyBodies) return options_.starts;
    return std::max(kStartsMin, options_.starts * static_cast<int>(kManyBodies) / static_cast<int>(order_.size()));
  }

  void ChooseRanges() {
    std::vector<const PlainRange*> joining;
    for (const PlainRange& range : graph_.ranges) {
      if (!active_[range.from] || !active_[range.to]) continue;
      if (placed_[range.from] && placed_[range.to]) continue;
      const bool is_within = IsBody(range.from) && IsBody(range.to) && heads_[range.from] == heads_[range.to];
      if (!is_within) joining.push_back(&range);
    }
    const auto time_of = [this](const PlainRange* range) {
      return std::max(graph_.nodes[range->from].time, graph_.nodes[range->to].time);
    };
    std::stable_sort(joining.begin(), joining.end(),
                     [&](const auto* a, const auto* b) { return time_of(a) < time_of(b); });
    std::vector<bool> is_chosen(joining.size(), false);
    const std::size_t count = std::min(joining.size(), options_.ranges_max);
    for (std::size_t i = 0; i < count; ++i) is_chosen[i * joining.size() / count] = true;
    ChooseForEachBody(joining, is_chosen);
    for (std::size_t i = 0; i < joining.size(); ++i) {
      if (is_chosen[i]) ranges_.push_back(joining[i]);
    }
  }

  void ChooseForEachBody(const std::vector<const PlainRange*>& joining, std::vector<bool>& is_chosen) const {
    std::map<std::size_t, std::vector<std::size_t>> ranges_of;  // Indices in `joining`, keyed by the head of the body.
    std::map<std::size_t, std::size_t> chosen_of;
    for (std::size_t i = 0; i < joining.size(); ++i) {
      for (const std::size_t node : {joining[i]->from, joining[i]->to}) {
        if (!IsBody(node)) continue;
        ranges_of[heads_[node]].push_back(i);
        chosen_of[heads_[node]] += is_chosen[i];
      }
    }
    for (const auto& [body, ranges] : ranges_of) {
      if (chosen_of[body] >= kRangesOfBodyMin) continue;
      const std::size_t count = std::min(ranges.size(), kRangesOfBodyMin);
      for (std::size_t i = 0; i < count; ++i) is_chosen[ranges[i * ranges.size() / count]] = true;
    }
  }

  // Fills order_ outwards from the placed nodes. Each entry is a body and the range that joins the body to a placed
  // node or to a body earlier in order_.
  void OrderBodies() {
    std::map<std::size_t, bool> is_set;
    const auto is_standing = [&](std::size_t node) { return placed_[node] || is_set.contains(heads_[node]); };
    for (bool has_grown = true; has_grown;) {
      has_grown = false;
      for (const PlainRange* range : ranges_) {
        const bool from = is_standing(range->from);
        const bool to = is_standing(range->to);
        if (from == to) continue;
        const std::size_t body = heads_[from ? range->to : range->from];
        is_set[body] = true;
        order_.emplace_back(body, range);
        has_grown = true;
      }
    }
    std::erase_if(ranges_,
                  [&](const PlainRange* range) { return !is_standing(range->from) || !is_standing(range->to); });
  }

  void MakeFactors() {
    std::vector<double> lengths;
    for (const PlainRange* range : ranges_) lengths.push_back(range->range_m);
    std::sort(lengths.begin(), lengths.end());
    typical_range_m_ = lengths.empty() ? 0 : lengths[lengths.size() / 2];
    const double drift_m = kDriftPart * typical_range_m_;
    for (const PlainRange* range : ranges_) {
      const double sigma_m = std::hypot(range->sigma_m, drift_m);
      factors_.push_back(MakeRangeFactor(range->range_m, sigma_m, InFrame(range->from), InFrame(range->to)));
    }
  }

  // Returns a body node's position in its body's frame, or a placed node's position in the map frame.
  Eigen::Vector3d InFrame(std::size_t node) const { return FromBlock(state_[node]).position_m; }

  Eigen::Vector3d InMap(std::size_t node, const Frames& frames) const {
    const auto frame = IsBody(node) ? frames.find(heads_[node]) : frames.end();
    return frame == frames.end() ? InFrame(node) : FromBlock(frame->second) * InFrame(node);
  }

  Eigen::Quaterniond Turn(int start, int dimension) const {
    const double yaw = 2 * M_PI * Spread(start, dimension);
    if (options_.freedom != BodyFreedom::kSpatial) return Pose::FromPlanar(0, 0, yaw).orientation;
    // Shoemake's method for uniformly distributed rotations.
    const double u = Spread(start, dimension + 1);
    const double angle = 2 * M_PI * Spread(start, dimension + 2);
    return Eigen::Quaterniond(std::sqrt(u) * std::cos(angle), std::sqrt(1 - u) * std::sin(yaw),
                              std::sqrt(1 - u) * std::cos(yaw), std::sqrt(u) * std::sin(angle));
  }

  Frames FirstFrames(int start) const {
    Frames frames;
    int dimension = 0;
    for (const auto& [body, range] : order_) {
      const bool is_from = IsBody(range->from) && heads_[range->from] == body;
      const std::size_t own = is_from ? range->from : range->to;
      const std::size_t other = is_from ? range->to : range->from;
      const Eigen::Quaterniond turn = Turn(start, dimension + 2);
      const double angle = 2 * M_PI * Spread(start, dimension);
      const double height = options_.freedom == BodyFreedom::kSpatial ? 2 * Spread(start, dimension + 1) - 1 : 0;
      const double flat = std::sqrt(1 - height * height);
      const Eigen::Vector3d direction(flat * std::cos(angle), flat * std::sin(angle), height);
      const Eigen::Vector3d place = InMap(other, frames) + range->range_m * direction;
      frames[body] = ToBlock(Pose{place - turn * InFrame(own), turn});
      dimension += 5;
    }
    return frames;
  }

  Frames GivenFrames() const {
    Frames frames;
    for (const auto& [body, range] : order_) frames[body] = ToBlock(Pose{});
    return frames;
  }

  double Fit(Frames& frames) const {
    AxesManifold body_manifold(AxesOf(options_.freedom, /*is_point=*/false));
    AxesManifold point_manifold(AxesOf(options_.freedom, /*is_point=*/true));
    ceres::CauchyLoss loss(kCauchySigmas);
    PoseBlock map_frame = ToBlock(Pose{});
    double no_bias = 0;
    ceres::Problem problem(BorrowingProblemOptions());
    problem.AddParameterBlock(map_frame.data(), kPoseSize);
    problem.SetParameterBlockConstant(map_frame.data());
    problem.AddParameterBlock(&no_bias, 1);
    problem.SetParameterBlockConstant(&no_bias);
    for (auto& [body, frame] : frames) {
      // A body whose head is a point is a single landmark.
      problem.AddParameterBlock(frame.data(), kPoseSize,
                                graph_.nodes[body].is_point ? &point_manifold : &body_manifold);
    }
    const auto block_of = [&](std::size_t node) {
      return IsBody(node) ? frames.at(heads_[node]).data() : map_frame.data();
    };
    for (std::size_t i = 0; i < ranges_.size(); ++i) {
      problem.AddResidualBlock(factors_[i].get(), &loss, block_of(ranges_[i]->from), block_of(ranges_[i]->to),
                               &no_bias);
    }
    ceres::Solver::Options options = LeastSquaresOptions(/*thread_count=*/1, kIterationsMax);
    if (frames.size() <= kManyBodies) options.linear_solver_type = ceres::DENSE_QR;
    options.function_tolerance = 1e-6;
    StopCallback stop(options_.stop_requested);
    if (options_.stop_requested) options.callbacks.push_back(&stop);
    ceres::Solver::Summary summary;
    ceres::Solve(options, &problem, &summary);
    return summary.IsSolutionUsable() ? summary.final_cost : std::nan("");
  }

  // Returns true if two fits put each end of every range at the same place. Equal costs would not prove this, because
  // mirrored solutions have equal costs.
  bool IsSame(const Frames& a, const Frames& b) const {
    for (const PlainRange* range : ranges_) {
      for (const std::size_t node : {range->from, range->to}) {
        if ((InMap(node, a) - InMap(node, b)).norm() > kSamePlacePart * typical_range_m_) return false;
      }
    }
    return true;
  }

  static std::map<std::size_t, Pose> PosesOf(const Frames& frames) {
    std::map<std::size_t, Pose> poses;
    for (const auto& [body, frame] : frames) poses[body] = FromBlock(frame);
    return poses;
  }

  PlainState Apply(const Frames& frames) const {
    PlainState result = state_;
    for (std::size_t node = 0; node < result.size(); ++node) {
      const auto frame = frames.find(heads_[node]);
      if (active_[node] && IsBody(node) && frame != frames.end()) {
        result[node] = ToBlock(FromBlock(frame->second) * FromBlock(state_[node]));
      }
    }
    return result;
  }

  const StandaloneGraph& graph_;
  const ActiveNodes& active_;
  const std::vector<bool>& placed_;
  const std::vector<std::size_t>& heads_;
  const PlainState& state_;
  const ArrangementOptions& options_;
  std::vector<const PlainRange*> ranges_;
  std::vector<std::pair<std::size_t, const PlainRange*>> order_;
  std::vector<std::unique_ptr<ceres::CostFunction>> factors_;
  double typical_range_m_ = 0;  // Median of the ranges.
};

}  // namespace

std::vector<Arrangement> ArrangeParts(const StandaloneGraph& graph, const ActiveNodes& active,
                                      const std::vector<bool>& placed, const std::vector<std::size_t>& heads,
                                      const PlainState& state, const ArrangementOptions& options) {
  return Arranger(graph, active, placed, heads, state, options).Run();
}

}  // namespace moondb
