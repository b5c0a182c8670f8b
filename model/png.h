// Reads and writes PNG images with 8 bits per channel, with libpng. Used for maps in mission folders and for pictures.
//
// ReadPng checks the size of an image before it reads the pixels. Errors of libpng are returned as values. Thread-safe.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "model/error.h"
#include "model/file_notes.h"

namespace moondb {

using Color = std::array<std::uint8_t, 3>;

inline constexpr int kImageSideMax = 32768;
inline constexpr std::size_t kImageBytesMax = 256 * 1024 * 1024;

// An image: rows from top to bottom, pixels from left to right, channels interleaved. 1 channel is gray, 3 are RGB, 4
// are RGBA.
struct Image {
  int width = 0;
  int height = 0;
  int channels = 1;
  std::vector<std::uint8_t> bytes;  // width * height * channels bytes.

  Image() = default;
  Image(int w, int h, int c, std::uint8_t fill = 0);
  std::uint8_t* At(int column, int row) { return &bytes[OffsetOf(column, row)]; }
  const std::uint8_t* At(int column, int row) const { return &bytes[OffsetOf(column, row)]; }

 private:
  std::size_t OffsetOf(int column, int row) const {
    return (static_cast<std::size_t>(row) * width + column) * channels;
  }
};

// Reads a file. Gray images get 1 channel, images with colour or a palette 3, images with transparency 4. The error's
// field is the path. Fails with kNotFound if there is no such file, and with kCorrupt if the file is not a PNG, or is
// truncated or damaged. Fails with kInvalid if the image exceeds kImageSideMax or kImageBytesMax, or has 16 bits per
// channel.
Result<Image> ReadPng(const std::filesystem::path& file);

struct PngExtras {
  // At most 256 colours, indexed by the bytes of an image with 1 channel. Empty: the image is gray.
  std::vector<Color> palette;
  FileNotes notes;  // Metadata, written as tEXt chunks.
};

// Returns the bytes of a PNG file. Fails with kInvalid if sides, channels, bytes and palette are inconsistent or exceed
// the limits.
Result<std::string> PngBytes(const Image& image, const PngExtras& extras = {});

// Writes a PNG file. Fails like PngBytes, and with kInternal if the file cannot be written.
Result<void> WritePng(const Image& image, const std::filesystem::path& file);

}  // namespace moondb
