// GlTarget: what GlGather draws to: pixels of two 32-bit numbers each, kept from draw to draw and read back.
//
// Used by the thread that the OpenGL context is current on.
#pragma once

#include <GLES3/gl31.h>

#include <cstdint>
#include <vector>

#include "actors/merge/gl_objects.h"
#include "model/error.h"

namespace moondb {

class GlTarget {
 public:
  // What is drawn from now on goes here, to at least width x height pixels. kUnavailable if OpenGL cannot draw to so
  // many.
  Result<void> Bind(GLsizei width, GLsizei height);

  // Waits for what was drawn to the lower left width x height pixels. kUnavailable if OpenGL failed.
  Result<void> Read(GLsizei width, GLsizei height);
  // What was read last, row by row: the first number in the lower 32 bits.
  const std::vector<std::uint64_t>& pixels() const { return pixels_; }

 private:
  GlRenderbuffer color_;
  GlFramebuffer framebuffer_;
  GLsizei width_ = 0;
  GLsizei height_ = 0;
  std::vector<std::uint64_t> pixels_;
  std::vector<std::uint32_t> channels_;  // As read where OpenGL gives four numbers a pixel.
};

}  // namespace moondb
