#include "actors/merge/gl_target.h"

#include <algorithm>
#include <cstddef>
#include <string>

namespace moondb {

Result<void> GlTarget::Bind(GLsizei width, GLsizei height) {
  if (width <= width_ && height <= height_) {
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
    return {};
  }
  width_ = std::max(width, width_);
  height_ = std::max(height, height_);
  color_ = MakeRenderbuffer();
  glBindRenderbuffer(GL_RENDERBUFFER, color_.id());
  glRenderbufferStorage(GL_RENDERBUFFER, GL_RG32UI, width_, height_);
  framebuffer_ = MakeFramebuffer();
  glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color_.id());
  if (glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE && CheckGl("making a target")) return {};
  width_ = height_ = 0;
  return Fail(ErrorCode::kUnavailable,
              "OpenGL cannot draw to " + std::to_string(width) + " x " + std::to_string(height) + " pixels");
}

Result<void> GlTarget::Read(GLsizei width, GLsizei height) {
  const auto count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  pixels_.resize(count);
  glPixelStorei(GL_PACK_ALIGNMENT, 4);
  // OpenGL ES guarantees only that a read with four channels works. Most drivers can also read just the two channels of
  // this target.
  const bool is_two = GetGlInteger(GL_IMPLEMENTATION_COLOR_READ_FORMAT) == GL_RG_INTEGER &&
                      GetGlInteger(GL_IMPLEMENTATION_COLOR_READ_TYPE) == GL_UNSIGNED_INT;
  if (is_two) {
    glReadPixels(0, 0, width, height, GL_RG_INTEGER, GL_UNSIGNED_INT, pixels_.data());
  } else {
    channels_.resize(count * 4);
    glReadPixels(0, 0, width, height, GL_RGBA_INTEGER, GL_UNSIGNED_INT, channels_.data());
    for (std::size_t i = 0; i < count; ++i) {
      pixels_[i] = channels_[4 * i] | static_cast<std::uint64_t>(channels_[4 * i + 1]) << 32;
    }
  }
  return CheckGl("reading back");
}

}  // namespace moondb
