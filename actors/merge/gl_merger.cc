#include "actors/merge/gl_merger.h"

#include <GLES3/gl31.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/glm.hpp>
#include <utility>
#include <vector>

#include "actors/merge/egl_context.h"
#include "actors/merge/gl_objects.h"
#include "actors/merge/layer_atlas.h"
#include "merge_shaders.h"

namespace moondb {
namespace {

// The vertex attributes of one rectangle, as shaders/merge.vert names them.
struct Instance {
  glm::vec4 center_and_x;
  glm::vec2 half_y;
  glm::uvec4 placed;
  glm::uvec4 sides;
  glm::uvec2 winner;
};

// Beyond the rectangle: the quad's own float corners, and cells whose centre lies just inside, never decide.
constexpr double kInflationCells = 1.5;

std::uint32_t Wrap(std::int64_t value) { return static_cast<std::uint32_t>(static_cast<std::uint64_t>(value)); }

// The part that both blocks and footprints have.
Instance PlaceInstance(const PlacedRectangle& placed, const CellBox& tile) {
  const std::int64_t i = tile.first_x - placed.anchor_x;
  const std::int64_t j = tile.first_y - placed.anchor_y;
  const std::int64_t u = placed.u0 + i * placed.step_cos + j * placed.step_sin;
  const std::int64_t v = placed.v0 - i * placed.step_sin + j * placed.step_cos;

  const double step = std::hypot(placed.step_cos, placed.step_sin);
  const glm::dvec2 axis_x = glm::dvec2(placed.step_cos, placed.step_sin) / step;
  const glm::dvec2 axis_y(-axis_x.y, axis_x.x);
  const glm::dvec2 half = glm::dvec2(placed.width_q, placed.height_q) / 2.0;
  // The pixel (0, 0) has its centre at (0.5, 0.5); from there to the rectangle's centre.
  const glm::dvec2 offset = (half - glm::dvec2(static_cast<double>(u), static_cast<double>(v))) / step;
  const glm::dvec2 center = glm::dvec2(0.5) + offset.x * axis_x + offset.y * axis_y;
  const glm::dvec2 half_x = (half.x / step + kInflationCells) * axis_x;

  Instance instance{};
  instance.center_and_x = glm::vec4(glm::vec2(center), glm::vec2(half_x));
  instance.half_y = glm::vec2((half.y / step + kInflationCells) * axis_y);
  instance.placed = {Wrap(u), Wrap(v), Wrap(placed.step_cos), Wrap(placed.step_sin)};
  instance.sides = {placed.width_q, placed.height_q, 0, 0};
  instance.winner = {kNoSlot, kFootprintLevel};
  return instance;
}

struct Attribute {
  GLint count;
  GLenum type;
  std::size_t offset;
};

constexpr Attribute kAttributes[] = {
    {4, GL_FLOAT, offsetof(Instance, center_and_x)},  {2, GL_FLOAT, offsetof(Instance, half_y)},
    {4, GL_UNSIGNED_INT, offsetof(Instance, placed)}, {4, GL_UNSIGNED_INT, offsetof(Instance, sides)},
    {2, GL_UNSIGNED_INT, offsetof(Instance, winner)},
};

}  // namespace

class GlMerger::Painter {
 public:
  explicit Painter(const Options& options)
      : atlas_(std::max(options.atlas_page_cells_max, kBlockSideCellsMax)),
        tile_cells_(std::min({options.tile_cells_max, GetGlInteger(GL_MAX_TEXTURE_SIZE),
                              GetGlInteger(GL_MAX_RENDERBUFFER_SIZE), ViewportMax()})) {}

  Result<void> Start() {
    Result<GlProgram> program = MakeProgram(kMergeVertexShader, kMergeFragmentShader);
    if (!program) return tl::unexpected(program.error());
    program_ = std::move(*program);
    tile_size_uniform_ = glGetUniformLocation(program_.id(), "tile_size");
    buffer_ = MakeBuffer();
    vertex_array_ = MakeVertexArray();
    glBindVertexArray(vertex_array_.id());
    glBindBuffer(GL_ARRAY_BUFFER, buffer_.id());
    GLuint location = 0;
    for (const Attribute& attribute : kAttributes) {
      const auto* offset = reinterpret_cast<const void*>(attribute.offset);
      glEnableVertexAttribArray(location);
      if (attribute.type == GL_FLOAT) {
        glVertexAttribPointer(location, attribute.count, GL_FLOAT, GL_FALSE, sizeof(Instance), offset);
      } else {
        glVertexAttribIPointer(location, attribute.count, attribute.type, sizeof(Instance), offset);
      }
      glVertexAttribDivisor(location, 1);
      ++location;
    }
    return CheckGl("preparing");
  }

  Result<MergeResult> Merge(const MapPlacement& placement, const StopPredicate& stop) {
    if (Result<void> loaded = atlas_.Load(placement.slots); !loaded) return tl::unexpected(loaded.error());
    MergeResult result = MakeEmptyResult(placement);
    const CellBox& extent = placement.extent;
    for (std::int64_t y = extent.first_y; y <= extent.last_y; y += tile_cells_) {
      for (std::int64_t x = extent.first_x; x <= extent.last_x; x += tile_cells_) {
        if (stop && stop()) return Fail(ErrorCode::kUnavailable, "the merge was stopped");
        const CellBox tile{x, y, std::min(extent.last_x, x + tile_cells_ - 1),
                           std::min(extent.last_y, y + tile_cells_ - 1)};
        Result<void> drawn = DrawTile(placement, tile);
        if (!drawn) return tl::unexpected(drawn.error());
        Result<void> read = ReadTile(tile, extent, result);
        if (!read) return tl::unexpected(read.error());
      }
    }
    return result;
  }

 private:
  static GLint ViewportMax() {
    GLint sides[2] = {0, 0};
    glGetIntegerv(GL_MAX_VIEWPORT_DIMS, sides);
    return std::min(sides[0], sides[1]);
  }

  // A target at least as large as the tile; kept for the next one.
  Result<void> PrepareTarget(std::int32_t width, std::int32_t height) {
    if (width <= target_width_ && height <= target_height_) {
      glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
      return {};
    }
    target_width_ = std::max(width, target_width_);
    target_height_ = std::max(height, target_height_);
    color_ = MakeRenderbuffer();
    glBindRenderbuffer(GL_RENDERBUFFER, color_.id());
    glRenderbufferStorage(GL_RENDERBUFFER, GL_RGBA8UI, target_width_, target_height_);
    depth_ = MakeRenderbuffer();
    glBindRenderbuffer(GL_RENDERBUFFER, depth_.id());
    glRenderbufferStorage(GL_RENDERBUFFER, GL_DEPTH_COMPONENT16, target_width_, target_height_);
    framebuffer_ = MakeFramebuffer();
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_COLOR_ATTACHMENT0, GL_RENDERBUFFER, color_.id());
    glFramebufferRenderbuffer(GL_FRAMEBUFFER, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER, depth_.id());
    if (glCheckFramebufferStatus(GL_FRAMEBUFFER) == GL_FRAMEBUFFER_COMPLETE && CheckGl("making a target")) return {};
    target_width_ = target_height_ = 0;
    return Fail(ErrorCode::kUnavailable,
                "OpenGL cannot draw to " + std::to_string(width) + " x " + std::to_string(height) + " cells");
  }

  void CollectInstances(const MapPlacement& placement, const CellBox& tile) {
    instances_.clear();
    for (const PlacedRectangle& footprint : placement.footprints) {
      if (footprint.box.Touches(tile)) instances_.push_back(PlaceInstance(footprint, tile));
    }
    for (const PlacedBlock& placed : placement.blocks) {
      if (!placed.rectangle.box.Touches(tile)) continue;
      Instance instance = PlaceInstance(placed.rectangle, tile);
      const std::shared_ptr<const LocalMap>& map = placement.slots[placed.slot].map;
      const auto block = std::find(map->blocks.begin(), map->blocks.end(), placed.block);
      const LayerAtlas::Spot& spot = atlas_.Find(map, static_cast<std::size_t>(block - map->blocks.begin()));
      instance.sides.z = static_cast<std::uint32_t>(spot.x) | static_cast<std::uint32_t>(spot.y) << 16;
      instance.sides.w = static_cast<std::uint32_t>(spot.page);
      instance.winner = {placed.slot, placed.block.level};
      instances_.push_back(instance);
    }
  }

  Result<void> DrawTile(const MapPlacement& placement, const CellBox& tile) {
    const auto width = static_cast<std::int32_t>(tile.width());
    const auto height = static_cast<std::int32_t>(tile.height());
    if (Result<void> prepared = PrepareTarget(width, height); !prepared) return prepared;
    CollectInstances(placement, tile);
    glViewport(0, 0, width, height);
    const GLuint unknown[4] = {0, kNoSlot & 255, kNoSlot >> 8, 0};
    const GLfloat far_depth = 1;
    glDepthMask(GL_TRUE);
    glClearBufferuiv(GL_COLOR, 0, unknown);
    glClearBufferfv(GL_DEPTH, 0, &far_depth);
    if (instances_.empty()) return CheckGl("clearing a tile");
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LESS);  // All rectangles have one depth: the first that is drawn stays.
    glDisable(GL_BLEND);
    glDisable(GL_DITHER);
    glDisable(GL_CULL_FACE);
    glUseProgram(program_.id());
    glUniform2f(tile_size_uniform_, static_cast<GLfloat>(width), static_cast<GLfloat>(height));
    glActiveTexture(GL_TEXTURE0);
    glBindTexture(GL_TEXTURE_2D_ARRAY, atlas_.texture());
    glBindVertexArray(vertex_array_.id());
    glBindBuffer(GL_ARRAY_BUFFER, buffer_.id());
    glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(instances_.size() * sizeof(Instance)), instances_.data(),
                 GL_STREAM_DRAW);
    glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, static_cast<GLsizei>(instances_.size()));
    return CheckGl("drawing a tile");
  }

  Result<void> ReadTile(const CellBox& tile, const CellBox& extent, MergeResult& result) {
    const auto width = static_cast<std::size_t>(tile.width());
    const auto height = static_cast<std::size_t>(tile.height());
    // OpenGL ES promises only 32 bits a channel; most drivers also give the bytes as they are.
    const bool is_bytes = GetGlInteger(GL_IMPLEMENTATION_COLOR_READ_FORMAT) == GL_RGBA_INTEGER &&
                          GetGlInteger(GL_IMPLEMENTATION_COLOR_READ_TYPE) == GL_UNSIGNED_BYTE;
    glPixelStorei(GL_PACK_ALIGNMENT, 1);
    if (is_bytes) {
      bytes_.resize(width * height * 4);
      glReadPixels(0, 0, static_cast<GLsizei>(width), static_cast<GLsizei>(height), GL_RGBA_INTEGER, GL_UNSIGNED_BYTE,
                   bytes_.data());
    } else {
      words_.resize(width * height * 4);
      glReadPixels(0, 0, static_cast<GLsizei>(width), static_cast<GLsizei>(height), GL_RGBA_INTEGER, GL_UNSIGNED_INT,
                   words_.data());
    }
    if (Result<void> read = CheckGl("reading a tile"); !read) return read;
    for (std::size_t row = 0; row < height; ++row) {
      const std::size_t to = (static_cast<std::size_t>(tile.first_y - extent.first_y) + row) *
                                 static_cast<std::size_t>(result.merged.grid.width) +
                             static_cast<std::size_t>(tile.first_x - extent.first_x);
      const std::size_t from = row * width * 4;
      if (is_bytes) {
        CopyRow(bytes_.data() + from, width, to, result);
      } else {
        CopyRow(words_.data() + from, width, to, result);
      }
    }
    return {};
  }

  template <typename Channel>
  static void CopyRow(const Channel* channels, std::size_t width, std::size_t to, MergeResult& result) {
    for (std::size_t i = 0; i < width; ++i, channels += 4) {
      result.merged.grid.cells[to + i] = static_cast<Cell>(channels[0]);
      result.slots[to + i] = static_cast<std::uint16_t>(channels[1] | channels[2] << 8);
      result.levels[to + i] = static_cast<std::uint8_t>(channels[3]);
    }
  }

  LayerAtlas atlas_;
  const std::int32_t tile_cells_;
  GlProgram program_;
  GLint tile_size_uniform_ = -1;
  GlBuffer buffer_;
  GlVertexArray vertex_array_;
  GlRenderbuffer color_;
  GlRenderbuffer depth_;
  GlFramebuffer framebuffer_;
  std::int32_t target_width_ = 0;
  std::int32_t target_height_ = 0;
  std::vector<Instance> instances_;
  std::vector<std::uint8_t> bytes_;
  std::vector<std::uint32_t> words_;
};

GlMerger::GlMerger(std::unique_ptr<EglContext> context) : context_(std::move(context)) {}

GlMerger::~GlMerger() {
  const CurrentContext current(*context_);
  painter_.reset();
}

Result<std::unique_ptr<GlMerger>> GlMerger::Create(Options options) {
  Result<std::unique_ptr<EglContext>> context = EglContext::Create();
  if (!context) return tl::unexpected(context.error());
  std::unique_ptr<GlMerger> merger(new GlMerger(std::move(*context)));
  const CurrentContext current(*merger->context_);
  if (!current.made_current()) return tl::unexpected(current.made_current().error());
  merger->painter_ = std::make_unique<Painter>(options);
  if (Result<void> started = merger->painter_->Start(); !started) return tl::unexpected(started.error());
  return merger;
}

Result<MergeResult> GlMerger::Merge(const MapPlacement& placement, const StopPredicate& stop) {
  const CurrentContext current(*context_);
  if (!current.made_current()) return tl::unexpected(current.made_current().error());
  return painter_->Merge(placement, stop);
}

std::string GlMerger::description() const { return "gl (" + context_->renderer() + ")"; }
bool GlMerger::is_software() const { return context_->is_software(); }

}  // namespace moondb
