// LineFields: parses one line of a pose-graph text file from left to right. Shared by the readers of PyFG, g2o and TUM.
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

// The parser keeps the first error. Values read after an error are unspecified. Requires: the text of the line outlives
// the parser.
class LineFields {
 public:
  explicit LineFields(std::string_view line);

  std::size_t left() const { return fields_.size() - next_; }
  const std::string& error() const { return error_; }  // Empty if there is none.
  void Stop(std::string error);

  std::string_view Take();
  // Returns the field after the next `count` ones without reading it. Empty if the line ends before it.
  std::string_view Peek(std::size_t count) const {
    return left() > count ? fields_[next_ + count] : std::string_view();
  }
  double Number();           // Reads a finite number.
  std::uint64_t Index();     // Reads an unsigned 64-bit integer.
  std::int64_t Timestamp();  // Reads a timestamp and returns nanoseconds (ParseTimestampNs in model/text.h).

  // Reads the coordinates x y (if `is_planar`) or x y z, of up to 1e9 m. If `is_planar`, z is 0.
  Eigen::Vector3d Position(bool is_planar);

  // Reads x y yaw (if `is_planar`) or x y z qx qy qz qw. The quaternion's length must be 1 within 1 %; the quaternion
  // is normalised.
  Pose PoseOf(bool is_planar);

  // Reads the upper triangle of a symmetric matrix, row by row.
  template <int kSize>
  Eigen::Matrix<double, kSize, kSize> Symmetric() {
    Eigen::Matrix<double, kSize, kSize> matrix;
    for (int row = 0; row < kSize; ++row) {
      for (int column = row; column < kSize; ++column) matrix(row, column) = matrix(column, row) = Number();
    }
    return matrix;
  }

  // Reads a symmetric matrix that must be positive definite. `name` is the matrix's name in errors.
  template <int kSize>
  Eigen::Matrix<double, kSize, kSize> PositiveDefinite(const char* name) {
    const Eigen::Matrix<double, kSize, kSize> matrix = Symmetric<kSize>();
    const Eigen::LLT<Eigen::Matrix<double, kSize, kSize>> decomposition(matrix);
    if (decomposition.info() != Eigen::Success) Stop(std::string("the ") + name + " is not positive definite");
    return matrix;
  }

  // Reads the covariance or information of a position: 2 rows (if `is_planar`) or 3, positive definite. If `is_planar`,
  // the rest is that of the identity.
  Eigen::Matrix3d PositionMatrix(bool is_planar, const char* name) {
    if (!is_planar) return PositiveDefinite<3>(name);
    Eigen::Matrix3d matrix = Eigen::Matrix3d::Identity();
    matrix.topLeftCorner<2, 2>() = PositiveDefinite<2>(name);
    return matrix;
  }

 private:
  Eigen::Quaterniond Orientation();

  std::vector<std::string_view> fields_;
  std::size_t next_ = 0;
  std::string error_;
};

inline constexpr std::size_t kGraphLineBytesMax = 4096;

// Calls `parse` with each line that is neither empty nor a comment (#), and with the line's number, counted from 1.
// Fails with kInvalid and the field "name:line" if `parse` reports an error or leaves fields unread, or if a line is
// longer than kGraphLineBytesMax. Also fails with the errors of TextLines.
Result<void> ParseLines(TextLines lines, const std::string& name,
                        const std::function<void(LineFields& fields, std::size_t line)>& parse);

// Set and get the entries for x, y and yaw in a matrix over x y z roll pitch yaw. The other entries stay unchanged.
void SetPlanar(const Eigen::Matrix3d& planar, Matrix6d& spatial);
Eigen::Matrix3d PlanarOf(const Matrix6d& spatial);

// Returns a yaw from which Pose::FromPlanar makes exactly this quaternion, if such a yaw lies within a few rounding
// steps of the computed yaw; otherwise returns the computed yaw. Rounding of the arc tangent may change the last bits
// of the computed yaw.
double ExactPlanarYaw(const Eigen::Quaterniond& q);

}  // namespace moondb
