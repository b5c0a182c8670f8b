#include "actors/pgo/arrangement.h"

#include <gtest/gtest.h>

#include <cmath>

namespace moondb {
namespace {

// Robot 1 drives a wide arc, and its poses are placed already. ArrangeParts must place points and a second robot by
// their ranges.
class ArrangementTest : public testing::Test {
 protected:
  ArrangementTest() {
    graph_.is_planar = true;
    options_.freedom = BodyFreedom::kPlanar;
    for (std::uint64_t i = 0; i < 40; ++i) {
      const double angle = 0.08 * static_cast<double>(i);
      Add({1, i}, Pose::FromPlanar(20 * std::sin(angle), 20 * (1 - std::cos(angle)), angle), /*is_point=*/false, 0);
      placed_.back() = true;
    }
  }

  std::size_t Add(const NodeKey& key, const Pose& truth, bool is_point, std::size_t head) {
    graph_.nodes.push_back({key, truth, static_cast<std::int64_t>(key.index), is_point, false});
    state_.push_back(ToBlock(truth));
    placed_.push_back(false);
    active_.push_back(true);
    heads_.push_back(head);
    return graph_.nodes.size() - 1;
  }

  std::size_t AddPoint(std::uint64_t index, double x, double y) {
    return Add({50, index}, Pose::FromPlanar(x, y, 0), /*is_point=*/true, graph_.nodes.size());
  }

  void Range(std::size_t from, std::size_t to) {
    const double range_m = (graph_.nodes[from].vertex.position_m - graph_.nodes[to].vertex.position_m).norm();
    graph_.ranges.push_back({from, to, range_m, 0.1});
  }

  // Resets the node's state to the origin.
  void Forget(std::size_t node) { state_[node] = ToBlock(Pose{}); }

  std::vector<Arrangement> Arrange() { return ArrangeParts(graph_, active_, placed_, heads_, state_, options_); }

  double ErrorM(const Arrangement& arrangement, std::size_t node) const {
    return (FromBlock(arrangement.state[node]).position_m - graph_.nodes[node].vertex.position_m).norm();
  }

  StandaloneGraph graph_;
  ActiveNodes active_;
  std::vector<bool> placed_;
  std::vector<std::size_t> heads_;
  PlainState state_;
  ArrangementOptions options_;
};

TEST_F(ArrangementTest, PlacesARobotByItsRangesBestSolutionFirst) {
  const std::size_t first = graph_.nodes.size();
  for (std::uint64_t i = 0; i < 40; ++i) {
    const double along_m = 0.5 * static_cast<double>(i);
    const std::size_t node = Add({2, i}, Pose::FromPlanar(5 + along_m, 30 - 0.02 * along_m * along_m, 0), false, first);
    Range(i, node);
  }
  const Pose elsewhere = Pose::FromPlanar(-200, 90, 2);
  for (std::size_t node = first; node < first + 40; ++node) state_[node] = ToBlock(elsewhere * FromBlock(state_[node]));
  const std::vector<Arrangement> found = Arrange();
  ASSERT_FALSE(found.empty());
  EXPECT_LT(ErrorM(found[0], first), 0.01);
  EXPECT_LT(ErrorM(found[0], first + 39), 0.01);
  ASSERT_TRUE(found[0].map_from_body.contains(first));
  for (std::size_t i = 1; i < found.size(); ++i) EXPECT_GE(found[i].cost, found[i - 1].cost);
}

TEST_F(ArrangementTest, DoesNotMoveABodyWithoutRanges) {
  const std::size_t lonely = AddPoint(0, 3, 3);
  const std::vector<Arrangement> found = Arrange();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].state[lonely], state_[lonely]);
  EXPECT_TRUE(found[0].map_from_body.empty());
}

TEST_F(ArrangementTest, StartsFromTheGivenPosesOnRequest) {
  const std::size_t point = AddPoint(0, 10, 12);
  for (std::size_t i = 0; i < 40; i += 5) Range(i, point);
  state_[point][0] += 0.5;
  options_.starts = 0;
  options_.begins_as_given = true;
  const std::vector<Arrangement> found = Arrange();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_LT(ErrorM(found[0], point), 1e-3);
}

TEST_F(ArrangementTest, UsesEnoughRangesForEachOfManyBodies) {
  std::vector<std::size_t> points;
  for (std::uint64_t k = 0; k < 150; ++k) {
    const double angle = 0.2 * static_cast<double>(k);
    points.push_back(AddPoint(k, 8 + 0.1 * static_cast<double>(k) * std::cos(angle), 20 + 12 * std::sin(angle)));
    for (std::size_t i = 0; i < 40; ++i) Range(i, points.back());
    state_[points.back()][0] += 0.5;
    state_[points.back()][1] -= 0.5;
  }
  options_.starts = 0;
  options_.begins_as_given = true;
  const Arrangement found = Arrange().front();
  for (const std::size_t point : points) EXPECT_LT(ErrorM(found, point), 0.01) << point;
}

TEST_F(ArrangementTest, StopsOnRequest) {
  const std::size_t point = AddPoint(0, 10, 12);
  for (std::size_t i = 0; i < 40; ++i) Range(i, point);
  Forget(point);
  int polls = 0;
  options_.stop_requested = [&polls] { return ++polls > 3; };
  (void)Arrange();
  EXPECT_LT(polls, 8) << "it went on for all starts";
}

}  // namespace
}  // namespace moondb
