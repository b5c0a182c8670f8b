// ImageSpectrum: the Fourier transform of a complex image of 256 x 256 pixels, for the correlation of two images.
//
// Radix-4 transforms of whole rows, which take a quarter of the time of Eigen's FFT (docs/decisions). Images are
// periodic. Not thread-safe.
#pragma once

#include <Eigen/Core>

namespace moondb {

class ImageSpectrum {
 public:
  static constexpr int kSide = 256;
  using Plane = Eigen::Array<float, Eigen::Dynamic, kSide, Eigen::RowMajor>;  // Row y, column x.

  // Pixels, or their transform in an order of its own.
  Plane& real() { return real_; }
  Plane& imaginary() { return imaginary_; }

  // Transforms the pixels.
  void Transform();
  // Turns the transform Z into the pixels of the correlation sum over b of conj(z(b)) * y(b + t), for each shift t,
  // times 65,536. `other`: the transform Y.
  void Correlate(const ImageSpectrum& other);

 private:
  void TransformColumns(bool is_inverse);
  void TransformStrip(int column, bool is_inverse);

  Plane real_ = Plane::Zero(kSide, kSide);
  Plane imaginary_ = Plane::Zero(kSide, kSide);
  Plane next_real_ = Plane(kSide, kSide);
  Plane next_imaginary_ = Plane(kSide, kSide);
};

}  // namespace moondb
