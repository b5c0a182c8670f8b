#include "actors/pgo/linearization.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

// One variable x. A term of the others wants x = 0, and each factor of the set wants x = 2, all with sigma 1.
LinearTerms TermsWith(int set_size) {
  const double x = 2.0 * set_size / (1 + set_size);
  LinearTerms terms;
  terms.jacobian.resize(1 + set_size, 1);
  terms.residuals.resize(1 + set_size);
  for (int row = 0; row <= set_size; ++row) {
    terms.jacobian.insert(row, 0) = 1;
    terms.residuals(row) = row == 0 ? x : x - 2;
    terms.tested_of_row.push_back(row - 1);
  }
  return terms;
}

TEST(LinearizationTest, PredictsTheSolutionWithoutASet) {
  for (const int set_size : {1, 3, 100}) {
    const auto linear = Linearization::Make(TermsWith(set_size));
    ASSERT_NE(linear, nullptr);
    const double x = 2.0 * set_size / (1 + set_size);
    const std::vector<bool> all(static_cast<std::size_t>(set_size), true);
    EXPECT_NEAR(linear->MoveWithout(all)(0), -x, 1e-6) << set_size << " factors";
  }
}

TEST(LinearizationTest, MovesNothingWithoutNothing) {
  const auto linear = Linearization::Make(TermsWith(3));
  ASSERT_NE(linear, nullptr);
  EXPECT_EQ(linear->MoveWithout({false, false, false})(0), 0);
}

TEST(LinearizationTest, CountsRepeatedResidualsOnce) {
  const auto one = Linearization::Make(TermsWith(1));
  ASSERT_NE(one, nullptr);
  EXPECT_NEAR(one->EffectiveResiduals({true}), 0.5, 1e-12);
  // A hundred factors that measure the same number determine one number. The probes estimate it.
  const auto many = Linearization::Make(TermsWith(100));
  ASSERT_NE(many, nullptr);
  EXPECT_LT(many->EffectiveResiduals(std::vector<bool>(100, true)), 4);
}

TEST(LinearizationTest, RefusesAProblemThatDoesNotDetermineItsVariables) {
  LinearTerms terms = TermsWith(1);
  terms.jacobian.conservativeResize(2, 2);
  EXPECT_EQ(Linearization::Make(std::move(terms)), nullptr);
}

}  // namespace
}  // namespace moondb
