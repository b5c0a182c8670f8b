#include "apps/picture/drawing.h"

#include <cairo/cairo-svg.h>

#include <memory>
#include <string>

#include "model/png.h"
#include "model/text.h"

namespace moondb {
namespace {

constexpr int kSideMax = 16'384;

using Surface = std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)>;
using Canvas = std::unique_ptr<cairo_t, decltype(&cairo_destroy)>;

Result<void> DrawOn(cairo_surface_t* surface, const std::function<void(cairo_t*)>& draw, const std::string& file) {
  const Canvas canvas(cairo_create(surface), &cairo_destroy);
  cairo_set_source_rgb(canvas.get(), 1, 1, 1);
  cairo_paint(canvas.get());
  draw(canvas.get());
  const cairo_status_t status = cairo_status(canvas.get());
  if (status == CAIRO_STATUS_SUCCESS) return {};
  return Fail(ErrorCode::kInternal, std::string("cannot be drawn: ") + cairo_status_to_string(status), file);
}

// Converts Cairo's native-endian 0xXXRRGGBB pixels.
Image ToImage(cairo_surface_t* surface, int width, int height) {
  cairo_surface_flush(surface);
  const unsigned char* bytes = cairo_image_surface_get_data(surface);
  const int stride = cairo_image_surface_get_stride(surface);
  Image image(width, height, 3);
  for (int row = 0; row < height; ++row) {
    const auto* pixels = reinterpret_cast<const std::uint32_t*>(bytes + static_cast<std::ptrdiff_t>(row) * stride);
    for (int column = 0; column < width; ++column) {
      std::uint8_t* rgb = image.At(column, row);
      for (int i = 0; i < 3; ++i) rgb[i] = static_cast<std::uint8_t>(pixels[column] >> (16 - 8 * i));
    }
  }
  return image;
}

Result<void> WritePngDrawing(const std::filesystem::path& file, int width, int height,
                             const std::function<void(cairo_t*)>& draw) {
  const Surface surface(cairo_image_surface_create(CAIRO_FORMAT_RGB24, width, height), &cairo_surface_destroy);
  if (auto drawn = DrawOn(surface.get(), draw, file); !drawn) return drawn;
  return WritePng(ToImage(surface.get(), width, height), file);
}

cairo_status_t Append(void* text, const unsigned char* bytes, unsigned int size) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(bytes), size);
  return CAIRO_STATUS_SUCCESS;
}

Result<void> WriteSvgDrawing(const std::filesystem::path& file, int width, int height,
                             const std::function<void(cairo_t*)>& draw) {
  std::string text;
  {
    const Surface surface(cairo_svg_surface_create_for_stream(Append, &text, width, height), &cairo_surface_destroy);
    cairo_svg_surface_set_document_unit(surface.get(), CAIRO_SVG_UNIT_PX);
    if (auto drawn = DrawOn(surface.get(), draw, file); !drawn) return drawn;
    cairo_surface_finish(surface.get());
  }
  return WriteTextFile(file, text);
}

}  // namespace

Result<void> WriteDrawing(const std::filesystem::path& file, int width, int height,
                          const std::function<void(cairo_t*)>& draw) {
  if (width < 1 || height < 1 || width > kSideMax || height > kSideMax) {
    return Fail(ErrorCode::kInvalid, "the sides of a picture must be 1 to " + std::to_string(kSideMax) + " pixels",
                file.string());
  }
  if (file.extension() == ".png") return WritePngDrawing(file, width, height, draw);
  if (file.extension() == ".svg") return WriteSvgDrawing(file, width, height, draw);
  return Fail(ErrorCode::kInvalid, "the name of a picture must end in .png or .svg", file.string());
}

}  // namespace moondb
