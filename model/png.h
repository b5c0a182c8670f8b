// PNG pictures of 8 bits a channel, through libpng: what maps of mission folders and pictures for people need.
//
// A file is read only after its size is known to be within bounds; libpng's errors come back as values. Functions are
// pure but for the file, and safe to call from any thread.
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

// Rows from top to bottom, pixels from left to right, channels together. 1 channel is gray, 3 RGB, 4 RGBA.
struct Image {
  int width = 0;
  int height = 0;
  int channels = 1;
  std::vector<std::uint8_t> bytes;  // width * height * channels.

  Image() = default;
  Image(int w, int h, int c, std::uint8_t fill = 0);
  std::uint8_t* At(int column, int row) { return &bytes[OffsetOf(column, row)]; }
  const std::uint8_t* At(int column, int row) const { return &bytes[OffsetOf(column, row)]; }

 private:
  std::size_t OffsetOf(int column, int row) const {
    return (static_cast<std::size_t>(row) * width + column) * channels;
  }
};

// Gray pictures come with 1 channel, colour and palettes with 3, anything with transparency with 4. The error's field
// is the path. kNotFound: no such file; kInvalid: larger than the limits above, or 16 bits a channel; kCorrupt: no PNG,
// truncated or damaged.
Result<Image> ReadPng(const std::filesystem::path& file);

struct PngExtras {
  std::vector<Color> palette;  // Of a picture of 1 channel: its bytes are places in it, 256 at most. Empty: it is gray.
  FileNotes notes;             // tEXt chunks, for people and programs.
};

// The bytes of the file. kInvalid if sides, channels, bytes and palette disagree or exceed the limits.
Result<std::string> PngBytes(const Image& image, const PngExtras& extras = {});

// As PngBytes; kInternal if the file cannot be written.
Result<void> WritePng(const Image& image, const std::filesystem::path& file);

}  // namespace moondb
