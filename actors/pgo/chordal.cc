#include "actors/pgo/chordal.h"

#include <Eigen/SVD>
#include <Eigen/SparseCholesky>
#include <array>
#include <cmath>
#include <deque>

#include "actors/pgo/connected_parts.h"

namespace moondb {

namespace {

using Triplets = std::vector<Eigen::Triplet<double>>;

constexpr int kStands = -1;

// The chordal relaxation: one linear least squares problem per row of the rotation matrices, all with the same
// coefficient matrix. A pose has size_ unknowns for its rotation row and one for its coordinate. A point has only the
// coordinate.
class Relaxation {
 public:
  Relaxation(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<std::size_t>& heads)
      : graph_(graph), size_(graph.is_planar ? 2 : 3), first_unknown_(graph.nodes.size(), kStands) {
    for (std::size_t node = 0; node < graph.nodes.size(); ++node) {
      if (!active[node] || heads[node] == node) continue;
      first_unknown_[node] = unknown_count_;
      unknown_count_ += graph.nodes[node].is_point ? 1 : size_ + 1;
    }
    for (const PlainStep& step : graph.steps) {
      if (active[step.from] && active[step.to]) AddStep(step);
    }
    for (const PlainSighting& sighting : graph.sightings) {
      if (active[sighting.from] && active[sighting.to]) AddSighting(sighting);
    }
  }

  // Writes the solution to `state`. Returns false, and does not change `state`, if the minimum is not unique or numbers
  // overflow. Rounding may hide that the minimum is not unique. The solution is then still finite, which suffices for
  // initial values.
  bool Solve(PlainState& state) const {
    Eigen::SparseMatrix<double> rows(row_count_, unknown_count_);
    rows.setFromTriplets(entries_.begin(), entries_.end());
    Eigen::SparseMatrix<double> standing(row_count_, size_);
    standing.setFromTriplets(standing_entries_.begin(), standing_entries_.end());
    const Eigen::SparseMatrix<double> normal = rows.transpose() * rows;
    const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factorised(normal);
    if (factorised.info() != Eigen::Success) return false;
    const Eigen::MatrixXd right = -(rows.transpose() * standing).toDense();
    const Eigen::MatrixXd solution = factorised.solve(right);
    if (!solution.allFinite()) return false;
    for (std::size_t node = 0; node < state.size(); ++node) {
      if (first_unknown_[node] != kStands) Write(node, solution, state[node]);
    }
    return true;
  }

 private:
  // Adds the coefficient of the node's unknown number `offset` to the current row. The rotation of a head is fixed
  // at the identity, so row r of this rotation is the unit vector r. The coefficients of a head are therefore added to
  // the right-hand side.
  void Add(std::size_t node, int offset, double value) {
    const int first = first_unknown_[node];
    if (first != kStands) {
      entries_.emplace_back(row_count_, first + offset, value);
    } else if (offset < size_ && !graph_.nodes[node].is_point) {
      standing_entries_.emplace_back(row_count_, offset, value);
    }
  }

  int CoordinateOf(std::size_t node) const { return graph_.nodes[node].is_point ? 0 : size_; }

  void AddTranslation(std::size_t from, std::size_t to, const Eigen::Vector3d& translation, double tau) {
    const double weight = std::sqrt(tau);
    Add(to, CoordinateOf(to), weight);
    Add(from, CoordinateOf(from), -weight);
    for (int axis = 0; axis < size_; ++axis) Add(from, axis, -weight * translation[axis]);
    ++row_count_;
  }

  void AddStep(const PlainStep& step) {
    const Eigen::Matrix3d turn = step.from_from_to.orientation.toRotationMatrix();
    const double weight = std::sqrt(step.kappa);
    for (int column = 0; column < size_; ++column) {
      Add(step.to, column, weight);
      for (int axis = 0; axis < size_; ++axis) Add(step.from, axis, -weight * turn(axis, column));
      ++row_count_;
    }
    AddTranslation(step.from, step.to, step.from_from_to.position_m, step.tau);
  }

  void AddSighting(const PlainSighting& sighting) {
    AddTranslation(sighting.from, sighting.to, sighting.from_point_m, sighting.tau);
  }

  void Write(std::size_t node, const Eigen::MatrixXd& solution, PoseBlock& block) const {
    Pose pose;
    const int first = first_unknown_[node];
    pose.position_m.head(size_) = solution.row(first + CoordinateOf(node)).transpose();
    if (!graph_.nodes[node].is_point) {
      Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
      matrix.topLeftCorner(size_, size_) = solution.middleRows(first, size_).transpose();
      pose.orientation = NearestRotation(matrix);
    }
    block = ToBlock(pose);
  }

  static Eigen::Quaterniond NearestRotation(const Eigen::Matrix3d& matrix) {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
    flip(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
    return Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * flip * svd.matrixV().transpose())).normalized();
  }

  const StandaloneGraph& graph_;
  const int size_;
  std::vector<int> first_unknown_;
  int unknown_count_ = 0;
  int row_count_ = 0;
  Triplets entries_;
  Triplets standing_entries_;
};

// Returns, for each node, the indices of its edges. Index i means step i if i < steps.size(), otherwise sighting i -
// steps.size(). A sighting is listed only at its `from` node.
std::vector<std::vector<std::size_t>> FindTouching(const StandaloneGraph& graph) {
  std::vector<std::vector<std::size_t>> touching(graph.nodes.size());
  for (std::size_t i = 0; i < graph.steps.size(); ++i) {
    touching[graph.steps[i].from].push_back(i);
    touching[graph.steps[i].to].push_back(i);
  }
  for (std::size_t i = 0; i < graph.sightings.size(); ++i) {
    touching[graph.sightings[i].from].push_back(graph.steps.size() + i);
  }
  return touching;
}

}  // namespace

std::vector<std::size_t> FindHeads(const StandaloneGraph& graph, const ActiveNodes& active) {
  ConnectedParts parts(graph.nodes.size());
  const auto join = [&](const auto& edge) {
    if (active[edge.from] && active[edge.to]) parts.Join(edge.from, edge.to);
  };
  for (const PlainStep& step : graph.steps) join(step);
  for (const PlainSighting& sighting : graph.sightings) join(sighting);
  std::vector<std::size_t> heads(graph.nodes.size());
  for (std::size_t node = 0; node < heads.size(); ++node) heads[node] = parts.HeadOf(node);
  return heads;
}

bool HasLoops(const StandaloneGraph& graph, const ActiveNodes& active, const std::vector<std::size_t>& heads) {
  std::size_t edges = 0;
  for (const PlainStep& step : graph.steps) edges += active[step.from] && active[step.to];
  for (const PlainSighting& sighting : graph.sightings) edges += active[sighting.from] && active[sighting.to];
  std::size_t joined = 0;
  for (std::size_t node = 0; node < heads.size(); ++node) joined += active[node] && heads[node] != node;
  return edges > joined;
}

void ComposeFromPlaced(const StandaloneGraph& graph, const ActiveNodes& active, ComposeAlong along,
                       std::vector<bool>& placed, PlainState& state) {
  const std::vector<std::vector<std::size_t>> touching = FindTouching(graph);
  const auto is_used = [&](std::size_t edge) {
    if (along == ComposeAlong::kAll) return true;
    if (edge >= graph.steps.size()) return false;
    const NodeKey& from = graph.nodes[graph.steps[edge].from].key;
    return graph.nodes[graph.steps[edge].to].key == NodeKey{from.agent, from.index + 1};
  };
  std::deque<std::size_t> open;
  for (std::size_t node = 0; node < placed.size(); ++node) {
    if (placed[node] && active[node]) open.push_back(node);
  }
  const auto place = [&](std::size_t node, const Pose& pose) {
    if (placed[node] || !active[node]) return;
    state[node] = ToBlock(pose);
    placed[node] = true;
    open.push_back(node);
  };
  while (!open.empty()) {
    const std::size_t node = open.front();
    open.pop_front();
    const Pose pose = FromBlock(state[node]);
    for (const std::size_t edge : touching[node]) {
      if (!is_used(edge)) continue;
      if (edge >= graph.steps.size()) {
        const PlainSighting& sighting = graph.sightings[edge - graph.steps.size()];
        place(sighting.to, Pose{pose * sighting.from_point_m, Eigen::Quaterniond::Identity()});
        continue;
      }
      const PlainStep& step = graph.steps[edge];
      if (step.from == node) place(step.to, pose * step.from_from_to);
      if (step.to == node) place(step.from, pose * step.from_from_to.Inverse());
    }
  }
}

PlainState ChordalParts(const StandaloneGraph& graph, const ActiveNodes& active,
                        const std::vector<std::size_t>& heads) {
  PlainState state(graph.nodes.size(), ToBlock(Pose{}));
  if (HasLoops(graph, active, heads) && Relaxation(graph, active, heads).Solve(state)) return state;
  state.assign(graph.nodes.size(), ToBlock(Pose{}));
  std::vector<bool> placed(graph.nodes.size(), false);
  for (std::size_t node = 0; node < heads.size(); ++node) placed[node] = active[node] && heads[node] == node;
  ComposeFromPlaced(graph, active, ComposeAlong::kAll, placed, state);
  return state;
}

}  // namespace moondb
