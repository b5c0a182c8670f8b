#include "model/png.h"

#include <png.h>

#include <string>
#include <system_error>

#include "model/check.h"

namespace moondb {

namespace {

// libpng's own record of one picture; frees what libpng allocated on every way out.
class PngImage {
 public:
  PngImage() { image_.version = PNG_IMAGE_VERSION; }
  ~PngImage() { png_image_free(&image_); }
  PngImage(const PngImage&) = delete;
  PngImage& operator=(const PngImage&) = delete;

  png_image* operator->() { return &image_; }
  png_image* get() { return &image_; }

 private:
  png_image image_ = {};
};

png_uint_32 FormatOf(int channels) {
  if (channels == 1) return PNG_FORMAT_GRAY;
  return channels == 3 ? PNG_FORMAT_RGB : PNG_FORMAT_RGBA;
}

int ChannelsOf(png_uint_32 format) {
  if ((format & PNG_FORMAT_FLAG_ALPHA) != 0) return 4;
  return (format & PNG_FORMAT_FLAG_COLOR) != 0 ? 3 : 1;
}

bool IsWithinLimits(std::uint64_t width, std::uint64_t height, std::uint64_t channels) {
  return width >= 1 && height >= 1 && width <= kImageSideMax && height <= kImageSideMax &&
         width * height * channels <= kImageBytesMax;
}

}  // namespace

Image::Image(int w, int h, int c, std::uint8_t fill)
    : width(w), height(h), channels(c), bytes(static_cast<std::size_t>(w) * h * c, fill) {
  Check(w >= 0 && h >= 0 && c >= 1, "a picture's sides are not negative");
}

Result<Image> ReadPng(const std::filesystem::path& file) {
  std::error_code failure;
  if (!std::filesystem::exists(file, failure)) return Fail(ErrorCode::kNotFound, "no such file", file.string());
  PngImage png;
  if (!png_image_begin_read_from_file(png.get(), file.c_str())) {
    return Fail(ErrorCode::kCorrupt, std::string("is no readable PNG: ") + png->message, file.string());
  }
  if ((png->format & PNG_FORMAT_FLAG_LINEAR) != 0) {
    return Fail(ErrorCode::kInvalid, "has 16 bits a channel instead of 8", file.string());
  }
  const int channels = ChannelsOf(png->format);
  if (!IsWithinLimits(png->width, png->height, static_cast<std::uint64_t>(channels))) {
    return Fail(ErrorCode::kInvalid,
                "is too large: " + std::to_string(png->width) + " x " + std::to_string(png->height) + " pixels",
                file.string());
  }
  Image image(static_cast<int>(png->width), static_cast<int>(png->height), channels);
  png->format = FormatOf(channels);
  // A warning of libpng's (a bad checksum in an ancillary chunk) does not make the pixels wrong; an error does.
  if (!png_image_finish_read(png.get(), nullptr, image.bytes.data(), 0, nullptr)) {
    return Fail(ErrorCode::kCorrupt, std::string("is a damaged PNG: ") + png->message, file.string());
  }
  return image;
}

Result<void> WritePng(const Image& image, const std::filesystem::path& file) {
  const bool has_known_channels = image.channels == 1 || image.channels == 3 || image.channels == 4;
  if (!has_known_channels || image.width < 1 || image.height < 1 ||
      !IsWithinLimits(static_cast<std::uint64_t>(image.width), static_cast<std::uint64_t>(image.height),
                      static_cast<std::uint64_t>(image.channels)) ||
      image.bytes.size() != static_cast<std::size_t>(image.width) * image.height * image.channels) {
    return Fail(ErrorCode::kInvalid, "the picture's size is wrong or too large", file.string());
  }
  PngImage png;
  png->width = static_cast<png_uint_32>(image.width);
  png->height = static_cast<png_uint_32>(image.height);
  png->format = FormatOf(image.channels);
  if (!png_image_write_to_file(png.get(), file.c_str(), 0, image.bytes.data(), 0, nullptr)) {
    return Fail(ErrorCode::kInternal, std::string("cannot be written: ") + png->message, file.string());
  }
  return {};
}

}  // namespace moondb
