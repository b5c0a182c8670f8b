#include "actors/registration/image_spectrum.h"

#include <gtest/gtest.h>

#include <complex>
#include <random>
#include <vector>

namespace moondb {
namespace {

constexpr int kSide = ImageSpectrum::kSide;

// Sets some pixels of an image.
void Draw(std::uint64_t seed, ImageSpectrum& image) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> value(-1, 1);
  for (int i = 0; i < 300; ++i) {
    const auto y = static_cast<int>(random() % kSide);
    const auto x = static_cast<int>(random() % kSide);
    image.real()(y, x) = value(random);
    image.imaginary()(y, x) = value(random);
  }
}

TEST(ImageSpectrumTest, CorrelatesAsTheSumDoes) {
  ImageSpectrum y, z;
  Draw(1, y);
  Draw(2, z);
  const ImageSpectrum::Plane y_real = y.real(), y_imaginary = y.imaginary();
  const ImageSpectrum::Plane z_real = z.real(), z_imaginary = z.imaginary();
  y.Transform();
  z.Transform();
  z.Correlate(y);
  for (const auto& [shift_y, shift_x] : {std::pair(0, 0), {3, 5}, {250, 17}, {255, 255}, {128, 64}}) {
    std::complex<double> expected = 0;
    for (int row = 0; row < kSide; ++row) {
      for (int column = 0; column < kSide; ++column) {
        const int to_row = (row + shift_y) % kSide;
        const int to_column = (column + shift_x) % kSide;
        expected += std::complex<double>(z_real(row, column), -z_imaginary(row, column)) *
                    std::complex<double>(y_real(to_row, to_column), y_imaginary(to_row, to_column));
      }
    }
    EXPECT_NEAR(z.real()(shift_y, shift_x) / (kSide * kSide), expected.real(), 1e-4) << shift_y << ' ' << shift_x;
    EXPECT_NEAR(z.imaginary()(shift_y, shift_x) / (kSide * kSide), expected.imag(), 1e-4);
  }
}

}  // namespace
}  // namespace moondb
