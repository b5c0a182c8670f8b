// Draws into PNG and SVG files with Cairo. Thread-safe.
#pragma once

#include <cairo/cairo.h>

#include <filesystem>
#include <functional>

#include "model/error.h"

namespace moondb {

// Writes a file of width x height pixels (or SVG user units); `draw` draws into it, on white. In an SVG file, text
// becomes outlines, so a reader needs no font. Fails with kInvalid if the name ends neither in .png nor in .svg, or a
// side is not 1 to 16,384 pixels. Fails with kInternal if Cairo reports an error or the file cannot be written.
Result<void> WriteDrawing(const std::filesystem::path& file, int width, int height,
                          const std::function<void(cairo_t*)>& draw);

}  // namespace moondb
