#include "model/png.h"

#include <png.h>

#include <string>

#include "model/check.h"
#include "model/text.h"

namespace moondb {

namespace {

// RAII wrapper of png_image; frees the memory that libpng allocated.
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

constexpr std::size_t kHeaderBytes = 8 + 25;  // Size of the signature and the IHDR chunk, with which each file begins.

std::string BigEndian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xFF);
  return bytes;
}

// Computes the CRC of the PNG specification (Annex D).
std::uint32_t Crc32(std::string_view bytes) {
  std::uint32_t crc = 0xFFFFFFFF;
  for (const char byte : bytes) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? crc >> 1 ^ 0xEDB88320 : crc >> 1;
  }
  return ~crc;
}

// Returns the notes as tEXt chunks, which libpng's simplified API cannot write.
std::string TextChunks(const FileNotes& notes) {
  std::string chunks;
  for (const auto& [key, text] : notes) {
    const std::string content = "tEXt" + key + '\0' + text;
    chunks += BigEndian(static_cast<std::uint32_t>(content.size() - 4)) + content + BigEndian(Crc32(content));
  }
  return chunks;
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
  if (const Result<void> is_file = CheckRegularFile(file); !is_file) return tl::unexpected(is_file.error());
  PngImage png;
  if (!png_image_begin_read_from_file(png.get(), file.c_str())) {
    return Fail(ErrorCode::kCorrupt, std::string("is not a readable PNG: ") + png->message, file.string());
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
  // Ignore warnings of libpng, such as a bad checksum in an ancillary chunk: the pixels are still correct. If pixels
  // are wrong, libpng reports an error.
  if (!png_image_finish_read(png.get(), nullptr, image.bytes.data(), 0, nullptr)) {
    return Fail(ErrorCode::kCorrupt, std::string("is a damaged PNG: ") + png->message, file.string());
  }
  return image;
}

Result<std::string> PngBytes(const Image& image, const PngExtras& extras) {
  const bool has_known_channels = image.channels == 1 || image.channels == 3 || image.channels == 4;
  if (!has_known_channels || image.width < 1 || image.height < 1 ||
      !IsWithinLimits(static_cast<std::uint64_t>(image.width), static_cast<std::uint64_t>(image.height),
                      static_cast<std::uint64_t>(image.channels)) ||
      image.bytes.size() != static_cast<std::size_t>(image.width) * image.height * image.channels) {
    return Fail(ErrorCode::kInvalid, "the picture's size is wrong or too large");
  }
  if (!extras.palette.empty() && (image.channels != 1 || extras.palette.size() > 256)) {
    return Fail(ErrorCode::kInvalid, "the picture's palette does not fit its kind of pixels");
  }
  PngImage png;
  png->width = static_cast<png_uint_32>(image.width);
  png->height = static_cast<png_uint_32>(image.height);
  png->format = extras.palette.empty() ? FormatOf(image.channels) : PNG_FORMAT_RGB_COLORMAP;
  png->colormap_entries = static_cast<png_uint_32>(extras.palette.size());
  const void* palette = extras.palette.empty() ? nullptr : extras.palette.front().data();
  png_alloc_size_t size = PNG_IMAGE_PNG_SIZE_MAX(*png.get());
  std::string bytes(size, '\0');
  if (!png_image_write_to_memory(png.get(), bytes.data(), &size, 0, image.bytes.data(), 0, palette)) {
    return Fail(ErrorCode::kInternal, std::string("cannot be made: ") + png->message);
  }
  bytes.resize(size);
  bytes.insert(kHeaderBytes, TextChunks(extras.notes));
  return bytes;
}

Result<void> WritePng(const Image& image, const std::filesystem::path& file) {
  const Result<std::string> bytes = PngBytes(image);
  if (!bytes) return Fail(bytes.error().code, bytes.error().text, file.string());
  return WriteTextFile(file, *bytes);
}

}  // namespace moondb
