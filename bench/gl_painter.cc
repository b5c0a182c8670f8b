#include "bench/gl_painter.h"

#include <GLES3/gl31.h>

#include <array>
#include <utility>

#include "actors/merge/egl_context.h"
#include "actors/merge/gl_objects.h"
#include "bench/painted_layers.h"

namespace moondb {
namespace {

constexpr char kVertexShader[] = R"glsl(#version 310 es
precision highp float;
// Centre of the quad in cells of the target, and half of its x side as a vector.
uniform vec4 center_and_x;
uniform vec2 half_y;
uniform vec2 target_size;
out vec2 place;  // Position in the layer, from 0 to 1 in each direction.
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1) * 2.0 - 1.0;
  vec2 cell = center_and_x.xy + corner.x * center_and_x.zw + corner.y * half_y;
  place = corner * 0.5 + 0.5;
  gl_Position = vec4(cell / target_size * 2.0 - 1.0, 0.0, 1.0);
}
)glsl";

constexpr char kFragmentShader[] = R"glsl(#version 310 es
precision highp float;
precision highp usampler2D;
uniform usampler2D layer;
uniform uint fixed_value;  // For a footprint, the value of all cells; 0 for a layer.
in vec2 place;
layout(location = 0) out uvec4 cell;
void main() {
  uint value = fixed_value;
  if (value == 0u) value = texelFetch(layer, ivec2(place * vec2(textureSize(layer, 0))), 0).r;
  if (value == 0u) discard;
  cell = uvec4(value, 0u, 0u, 0u);
}
)glsl";

struct Quad {
  GLuint texture = 0;  // 0 if the quad is a footprint.
  PlacedRectangle placed;
};

}  // namespace

class GlPainter::Context {
 public:
  explicit Context(std::unique_ptr<EglContext> egl) : egl_(std::move(egl)) {}
  ~Context() {
    const CurrentContext current(*egl_);
    textures_.clear();
    program_ = {};
    color_ = {};
    framebuffer_ = {};
  }

  Result<void> Start() {
    const CurrentContext current(*egl_);
    Result<GlProgram> program = MakeProgram(kVertexShader, kFragmentShader);
    if (!program) return tl::unexpected(program.error());
    program_ = std::move(*program);
    return CheckGl("preparing");
  }

  Result<void> Load(std::span<const PlacedMap> maps, std::span<const Footprint> footprints, const MergeGrid& grid) {
    const CurrentContext current(*egl_);
    quads_.clear();
    textures_.clear();
    glPixelStorei(GL_UNPACK_ALIGNMENT, 1);
    for (const PaintedLayer& layer : LayersToPaint(maps, footprints, grid)) {
      quads_.push_back({layer.cells.empty() ? 0 : Upload(layer), layer.placed});
    }
    glFinish();
    return CheckGl("uploading");
  }

  Result<void> Merge(const CellBox& extent, std::vector<Cell>& cells) {
    const CurrentContext current(*egl_);
    const auto width = static_cast<GLsizei>(extent.width());
    const auto height = static_cast<GLsizei>(extent.height());
    PrepareTarget(width, height);
    glViewport(0, 0, width, height);
    const std::array<GLuint, 4> unknown = {0, 0, 0, 0};
    glClearBufferuiv(GL_COLOR, 0, unknown.data());
    glUseProgram(program_.id());
    glDisable(GL_BLEND);
    glDisable(GL_DITHER);
    glUniform2f(glGetUniformLocation(program_.id(), "target_size"), static_cast<float>(width),
                static_cast<float>(height));
    const GLint center_and_x = glGetUniformLocation(program_.id(), "center_and_x");
    const GLint half_y = glGetUniformLocation(program_.id(), "half_y");
    const GLint fixed_value = glGetUniformLocation(program_.id(), "fixed_value");
    for (const Quad& quad : quads_) {
      DrawQuad(quad, extent, center_and_x, half_y, fixed_value);
    }
    bytes_.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * 4);
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    glReadPixels(0, 0, width, height, GL_RGBA_INTEGER, GL_UNSIGNED_BYTE, bytes_.data());
    cells.resize(bytes_.size() / 4);
    for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = static_cast<Cell>(bytes_[4 * i]);
    return CheckGl("merging");
  }

 private:
  GLuint Upload(const PaintedLayer& layer) {
    static_assert(sizeof(Cell) == 1);
    textures_.push_back(MakeTexture());
    const GLuint id = textures_.back().id();
    glBindTexture(GL_TEXTURE_2D, id);
    glTexStorage2D(GL_TEXTURE_2D, 1, GL_R8UI, layer.width, layer.height);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, layer.width, layer.height, GL_RED_INTEGER, GL_UNSIGNED_BYTE,
                    layer.cells.data());
    return id;
  }

  void PrepareTarget(GLsizei width, GLsizei height) {
    if (width != width_ || height != height_) {
      width_ = width;
      height_ = height;
      color_ = MakeRenderbuffer();
      glBindRenderbuffer(GL_RENDERBUFFER, color_.id());
      glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8UI, width, height);
      framebuffer_ = MakeFramebuffer();
      glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
      glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color_.id());
    }
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
  }

  static void DrawQuad(const Quad& quad, const CellBox& extent, GLint center_and_x, GLint half_y, GLint fixed_value) {
    const PlacedRectangle& p = quad.placed;
    const double c = p.step_cos;
    const double s = p.step_sin;
    // The inverse of the complex number c + i s is (c - i s) * scale.
    const double scale = 1 / (c * c + s * s);
    const double du = p.width_q / 2.0 - p.u0;
    const double dv = p.height_q / 2.0 - p.v0;
    const double x = static_cast<double>(p.anchor_x - extent.first_x) + 0.5 + scale * (c * du - s * dv);
    const double y = static_cast<double>(p.anchor_y - extent.first_y) + 0.5 + scale * (s * du + c * dv);
    glUniform4f(center_and_x, static_cast<float>(x), static_cast<float>(y),
                static_cast<float>(scale * c * p.width_q / 2), static_cast<float>(scale * s * p.width_q / 2));
    glUniform2f(half_y, static_cast<float>(-scale * s * p.height_q / 2),
                static_cast<float>(scale * c * p.height_q / 2));
    glUniform1ui(fixed_value, quad.texture == 0 ? 1 : 0);
    glBindTexture(GL_TEXTURE_2D, quad.texture);
    glDrawArrays(GL_TRIANGLE_STRIP, 0, 4);
  }

  std::unique_ptr<EglContext> egl_;
  GlProgram program_;
  GlRenderbuffer color_;
  GlFramebuffer framebuffer_;
  GLsizei width_ = 0;
  GLsizei height_ = 0;
  std::vector<GlTexture> textures_;
  std::vector<Quad> quads_;
  std::vector<std::uint8_t> bytes_;
};

GlPainter::GlPainter(std::unique_ptr<Context> context) : context_(std::move(context)) {}
GlPainter::~GlPainter() = default;

Result<std::unique_ptr<GlPainter>> GlPainter::Create() {
  Result<std::unique_ptr<EglContext>> egl = EglContext::Create();
  if (!egl) return tl::unexpected(egl.error());
  std::unique_ptr<GlPainter> painter(new GlPainter(std::make_unique<Context>(std::move(*egl))));
  if (Result<void> started = painter->context_->Start(); !started) return tl::unexpected(started.error());
  return painter;
}

Result<void> GlPainter::Load(std::span<const PlacedMap> maps, std::span<const Footprint> footprints,
                             const MergeGrid& grid) {
  return context_->Load(maps, footprints, grid);
}

Result<void> GlPainter::Merge(const CellBox& extent) { return context_->Merge(extent, cells_); }

}  // namespace moondb
