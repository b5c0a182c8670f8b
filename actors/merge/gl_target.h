// GlTarget: the render target of GlGather, reused for each draw and read back afterwards. A pixel has two 32-bit
// integers.
//
// Requires: the OpenGL context is current on the calling thread.
#pragma once

#include <GLES3/gl31.h>

#include <cstdint>
#include <vector>

#include "actors/merge/gl_objects.h"
#include "model/error.h"

namespace moondb {

class GlTarget {
 public:
  // Directs the following draws to this target, with at least width x height pixels. Returns kUnavailable if OpenGL
  // cannot draw to a target of this size.
  Result<void> Bind(GLsizei width, GLsizei height);

  // Waits for the draw and reads the lower left width x height pixels. Returns kUnavailable if OpenGL failed.
  Result<void> Read(GLsizei width, GLsizei height);
  // Pixels of the last Read, row by row. Each pixel holds two 32-bit integers, the first in the lower 32 bits.
  const std::vector<std::uint64_t>& pixels() const { return pixels_; }

 private:
  GlRenderbuffer color_;
  GlFramebuffer framebuffer_;
  GLsizei width_ = 0;
  GLsizei height_ = 0;
  std::vector<std::uint64_t> pixels_;
  std::vector<std::uint32_t> channels_;  // Raw pixels if OpenGL returns four integers per pixel.
};

}  // namespace moondb
