// LineFields: the numbers and poses of one line of a text file of pose graphs, taken from the left; what the readers of
// PyFG, g2o and TUM have in common.
#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"
#include "model/geometry.h"
#include "model/pose_graph.h"
#include "model/text_lines.h"

namespace moondb {

// The first error stays; later calls give zeros. The line must outlive it.
class LineFields {
 public:
  explicit LineFields(std::string_view line);

  std::size_t left() const { return fields_.size() - next_; }
  const std::string& error() const { return error_; }  // Empty: none.
  void Stop(std::string error);

  std::string_view Take();
  double Number();           // Finite.
  std::uint64_t Index();     // 64 bits.
  std::int64_t Timestamp();  // Seconds, as nanoseconds.

  // 2 or 3 coordinates up to 1e9 m; z is 0 in the plane.
  Eigen::Vector3d Position(bool is_planar);

  // x y yaw, or x y z qx qy qz qw; a quaternion's length must be 1 within 1 %, and is made 1.
  Pose PoseOf(bool is_planar);

  // The upper triangle, row by row.
  template <int kSize>
  Eigen::Matrix<double, kSize, kSize> Symmetric() {
    Eigen::Matrix<double, kSize, kSize> matrix;
    for (int row = 0; row < kSize; ++row) {
      for (int column = row; column < kSize; ++column) matrix(row, column) = matrix(column, row) = Number();
    }
    return matrix;
  }

  // The same, and it must be positive definite. `name` is what the matrix is called in errors.
  template <int kSize>
  Eigen::Matrix<double, kSize, kSize> PositiveDefinite(const char* name) {
    const Eigen::Matrix<double, kSize, kSize> matrix = Symmetric<kSize>();
    const Eigen::LLT<Eigen::Matrix<double, kSize, kSize>> decomposition(matrix);
    if (decomposition.info() != Eigen::Success) Stop(std::string("the ") + name + " is not positive definite");
    return matrix;
  }

 private:
  Eigen::Quaterniond Orientation();

  std::vector<std::string_view> fields_;
  std::size_t next_ = 0;
  std::string error_;
};

inline constexpr std::size_t kGraphLineBytesMax = 4096;

// Gives `parse` each line that is neither empty nor a comment (#), and its number from 1. kInvalid with file (`name`)
// and line as the field: the first error that it notes, fields that it leaves, a line longer than kGraphLineBytesMax.
// Also the errors of TextLines.
Result<void> ParseLines(TextLines lines, const std::string& name,
                        const std::function<void(LineFields& fields, std::size_t line)>& parse);

// The planar x, y and yaw of a matrix over x y z roll pitch yaw; its other entries stay.
void SetPlanar(const Eigen::Matrix3d& planar, Matrix6d& spatial);
Eigen::Matrix3d PlanarOf(const Matrix6d& spatial);

// The yaw that reads back as exactly this quaternion, where one near the computed angle does: the arc tangent's last
// bits are not those of the angle that was read.
double ExactPlanarYaw(const Eigen::Quaterniond& q);

}  // namespace moondb
