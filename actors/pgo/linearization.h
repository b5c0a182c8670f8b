// Linearization: the normal equations of a solve at its solution. Predicts the solution without some of its factors,
// without solving again.
//
// J is the Jacobian of all residuals r at the solution, and H = J^T J. For a set S of tested factors, J_S and r_S are
// the rows of S, and H_o = H - J_S^T J_S is the information of the other terms. Without S, the solution moves by
//
//   d = H_o^-1 J_S^T r_S,
//
// because the gradients of S and of the other terms cancel at the solution. The effective number of residuals of S is
//
//   n = trace(J_S H^-1 J_S^T),
//
// the expected rise of the other terms' chi-square if S is correct. Residuals that the other terms determine as well as
// S does, or that repeat each other, count only in part. n is estimated with random probes of a fixed seed.
//
// Single-threaded.
#pragma once

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

namespace moondb {

// The rows of a linearised problem.
struct LinearTerms {
  Eigen::SparseMatrix<double, Eigen::RowMajor> jacobian;
  Eigen::VectorXd residuals;
  std::vector<int> tested_of_row;  // Number of the tested factor of each row; -1 for other terms.
};

class Linearization {
 public:
  // Returns null if the graph does not determine all variables.
  static std::unique_ptr<const Linearization> Make(LinearTerms terms);

  // Returns H^-1 `right`.
  Eigen::MatrixXd Solve(const Eigen::MatrixXd& right) const { return factorised_.solve(right); }

  // `is_left_out`: one flag per tested factor.
  Eigen::VectorXd MoveWithout(const std::vector<bool>& is_left_out) const;
  double EffectiveResiduals(const std::vector<bool>& is_left_out) const;

 private:
  using Matrix = Eigen::SparseMatrix<double>;

  Linearization() = default;
  // Returns the rows of the tested factors whose flag in `is_left_out` is true, and sets `residuals` to theirs.
  Eigen::SparseMatrix<double, Eigen::RowMajor> RowsOf(const std::vector<bool>& is_left_out,
                                                      Eigen::VectorXd& residuals) const;

  LinearTerms terms_;
  Matrix information_;
  Eigen::SimplicialLLT<Matrix> factorised_;
};

}  // namespace moondb
