#include "actors/registration/image_spectrum.h"

#include <array>
#include <cmath>
#include <complex>
#include <numbers>

namespace moondb {
namespace {

constexpr int kSide = ImageSpectrum::kSide;
constexpr int kStrip = 32;  // Columns at a time, so that the four passes work in the cache.

std::complex<float> RootOfUnity(int power) {
  static const auto roots = [] {
    std::array<std::complex<float>, kSide> all;
    for (int i = 0; i < kSide; ++i) {
      const double angle_rad = -2 * std::numbers::pi * i / kSide;
      all[static_cast<std::size_t>(i)] = {static_cast<float>(std::cos(angle_rad)),
                                          static_cast<float>(std::sin(angle_rad))};
    }
    return all;
  }();
  return roots[static_cast<std::size_t>(power % kSide)];
}

}  // namespace

// Stockham's transform with radix 4: four passes, each from one pair of planes to the other.
void ImageSpectrum::TransformColumns(bool is_inverse) {
  for (int column = 0; column < kSide; column += kStrip) TransformStrip(column, is_inverse);
}

void ImageSpectrum::TransformStrip(int column, bool is_inverse) {
  using Strip = Eigen::Array<float, 1, kStrip, Eigen::RowMajor>;
  // The inverse transform is that of the exchanged parts.
  Plane* from_real = is_inverse ? &imaginary_ : &real_;
  Plane* from_imaginary = is_inverse ? &real_ : &imaginary_;
  Plane* to_real = &next_real_;
  Plane* to_imaginary = &next_imaginary_;
  const auto at = [column](Plane& plane, int row) { return Eigen::Map<Strip>(&plane(row, column)); };
  for (int length = kSide, stride = 1; length > 1; length /= 4, stride *= 4) {
    const int quarter = length / 4;
    for (int p = 0; p < quarter; ++p) {
      const std::complex<float> w1 = RootOfUnity(p * stride);
      const std::complex<float> w2 = RootOfUnity(2 * p * stride);
      const std::complex<float> w3 = RootOfUnity(3 * p * stride);
      for (int q = 0; q < stride; ++q) {
        const int in = q + stride * p;
        const int out = q + stride * 4 * p;
        const Strip re0 = at(*from_real, in), im0 = at(*from_imaginary, in);
        const Strip re1 = at(*from_real, in + stride * quarter), im1 = at(*from_imaginary, in + stride * quarter);
        const Strip re2 = at(*from_real, in + 2 * stride * quarter),
                    im2 = at(*from_imaginary, in + 2 * stride * quarter);
        const Strip re3 = at(*from_real, in + 3 * stride * quarter),
                    im3 = at(*from_imaginary, in + 3 * stride * quarter);
        const Strip sum02_re = re0 + re2, sum02_im = im0 + im2, sum13_re = re1 + re3, sum13_im = im1 + im3;
        const Strip less02_re = re0 - re2, less02_im = im0 - im2, less13_re = re1 - re3, less13_im = im1 - im3;
        const auto write = [&](int part, const Strip& re, const Strip& im, const std::complex<float>& w) {
          at(*to_real, out + part * stride) = re * w.real() - im * w.imag();
          at(*to_imaginary, out + part * stride) = re * w.imag() + im * w.real();
        };
        at(*to_real, out) = sum02_re + sum13_re;
        at(*to_imaginary, out) = sum02_im + sum13_im;
        write(1, less02_re + less13_im, less02_im - less13_re, w1);
        write(2, sum02_re - sum13_re, sum02_im - sum13_im, w2);
        write(3, less02_re - less13_im, less02_im + less13_re, w3);
      }
    }
    std::swap(from_real, to_real);
    std::swap(from_imaginary, to_imaginary);
  }
}

void ImageSpectrum::Transform() {
  TransformColumns(/*is_inverse=*/false);
  real_.transposeInPlace();
  imaginary_.transposeInPlace();
  TransformColumns(/*is_inverse=*/false);
}

void ImageSpectrum::Correlate(const ImageSpectrum& other) {
  next_real_ = other.real_ * real_ + other.imaginary_ * imaginary_;
  imaginary_ = other.imaginary_ * real_ - other.real_ * imaginary_;
  real_ = next_real_;
  TransformColumns(/*is_inverse=*/true);
  real_.transposeInPlace();
  imaginary_.transposeInPlace();
  TransformColumns(/*is_inverse=*/true);
}

}  // namespace moondb
