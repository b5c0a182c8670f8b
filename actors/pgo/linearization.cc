#include "actors/pgo/linearization.h"

#include <random>
#include <utility>

namespace moondb {
namespace {

// Probes of a set. A set of many residuals needs fewer: the errors of its residuals average out.
constexpr int kProbes = 8;
constexpr int kProbesOfMany = 2;
constexpr Eigen::Index kMany = 1000;
constexpr int kIterationsMax = 20;
constexpr double kTolerance = 0.02;

}  // namespace

std::unique_ptr<const Linearization> Linearization::Make(LinearTerms terms) {
  if (terms.jacobian.cols() == 0) return nullptr;
  std::unique_ptr<Linearization> result(new Linearization());
  result->terms_ = std::move(terms);
  result->information_ = result->terms_.jacobian.transpose() * result->terms_.jacobian;
  result->factorised_.compute(result->information_);
  if (result->factorised_.info() != Eigen::Success) return nullptr;
  return result;
}

Eigen::SparseMatrix<double, Eigen::RowMajor> Linearization::RowsOf(const std::vector<bool>& is_left_out,
                                                                   Eigen::VectorXd& residuals) const {
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<double> chosen;
  for (Eigen::Index row = 0; row < terms_.jacobian.rows(); ++row) {
    const int tested = terms_.tested_of_row[static_cast<std::size_t>(row)];
    if (tested < 0 || !is_left_out[static_cast<std::size_t>(tested)]) continue;
    for (decltype(terms_.jacobian)::InnerIterator entry(terms_.jacobian, row); entry; ++entry) {
      entries.emplace_back(static_cast<int>(chosen.size()), static_cast<int>(entry.col()), entry.value());
    }
    chosen.push_back(terms_.residuals(row));
  }
  Eigen::SparseMatrix<double, Eigen::RowMajor> rows(static_cast<Eigen::Index>(chosen.size()), terms_.jacobian.cols());
  rows.setFromTriplets(entries.begin(), entries.end());
  residuals = Eigen::Map<Eigen::VectorXd>(chosen.data(), static_cast<Eigen::Index>(chosen.size()));
  return rows;
}

// Conjugate gradients on H_o d = J_S^T r_S, preconditioned with H. H and H_o differ only by S, so few iterations
// suffice.
Eigen::VectorXd Linearization::MoveWithout(const std::vector<bool>& is_left_out) const {
  Eigen::VectorXd of_set;
  const auto rows = RowsOf(is_left_out, of_set);
  const Eigen::VectorXd gradient = rows.transpose() * of_set;
  Eigen::VectorXd move = Eigen::VectorXd::Zero(gradient.size());
  Eigen::VectorXd left = gradient;
  Eigen::VectorXd preconditioned = factorised_.solve(left);
  Eigen::VectorXd direction = preconditioned;
  double product = left.dot(preconditioned);
  const double end = kTolerance * kTolerance * product;
  for (int i = 0; i < kIterationsMax && product > end; ++i) {
    const Eigen::VectorXd image = information_ * direction - rows.transpose() * (rows * direction);
    const double curvature = direction.dot(image);
    if (!(curvature > 0)) break;  // The other terms do not determine this direction.
    move += product / curvature * direction;
    left -= product / curvature * image;
    preconditioned = factorised_.solve(left);
    const double next = left.dot(preconditioned);
    direction = preconditioned + next / product * direction;
    product = next;
  }
  return move;
}

double Linearization::EffectiveResiduals(const std::vector<bool>& is_left_out) const {
  Eigen::VectorXd of_set;
  const auto rows = RowsOf(is_left_out, of_set);
  std::mt19937 random(1);
  const int probes = rows.rows() > kMany ? kProbesOfMany : kProbes;
  double sum = 0;
  for (int probe = 0; probe < probes; ++probe) {
    Eigen::VectorXd signs(rows.rows());
    for (double& sign : signs) sign = (random() & 1) != 0 ? 1 : -1;
    const Eigen::VectorXd image = rows.transpose() * signs;
    sum += image.dot(factorised_.solve(image));
  }
  return sum / probes;
}

}  // namespace moondb
