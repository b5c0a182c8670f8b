#include "actors/merge/gl_gather.h"

#include <GLES3/gl31.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstring>
#include <glm/glm.hpp>
#include <utility>
#include <vector>

#include "actors/merge/egl_context.h"
#include "actors/merge/gl_objects.h"
#include "actors/merge/layer_atlas.h"
#include "merge_shaders.h"

namespace moondb {
namespace {

// How many blocks of a tile are drawn before it is read back: most cells are known after very few.
constexpr std::size_t kBlocksAtOnce = 500'000;  // In one draw; each is a few instances.
constexpr std::array<std::size_t, 5> kRoundBlocks = {3, 6, 12, 48, 60'000};

// What 16 bits count.
constexpr std::size_t kTileBlocksMax = 65'536;

// Pages drawn at once: a target of 4096 x 4096 cells.
constexpr std::size_t kBatchPages = 256;

// The vertex attributes of one instance, as shaders/merge.vert names them.
struct Instance {
  glm::uvec2 rectangle;
  glm::uvec4 placed;
  glm::uvec4 sides;
  glm::uint winner;
};

struct Attribute {
  GLint count;
  std::size_t offset;
};

constexpr std::array<Attribute, 4> kAttributes = {{{2, offsetof(Instance, rectangle)},
                                                   {4, offsetof(Instance, placed)},
                                                   {4, offsetof(Instance, sides)},
                                                   {1, offsetof(Instance, winner)}}};

constexpr std::uint32_t kFootprintPage = UINT32_MAX;

std::uint32_t Wrap(std::int64_t value) { return static_cast<std::uint32_t>(static_cast<std::uint64_t>(value)); }

// Modulo 1024 cells a tile's cells beside the block could be taken for cells within.
bool IsSteep(const PlacedRectangle& placed) {
  const std::int64_t steps = std::abs(std::int64_t{placed.step_cos}) + std::abs(std::int64_t{placed.step_sin});
  return steps * kTileSideCells > std::int64_t{500} << kFractionBits;
}

// Squares x to end_x of the rows y to end_y.
struct SquareBox {
  std::uint32_t first_x;
  std::uint32_t end_x;
  std::uint32_t first_y;
  std::uint32_t end_y;
};

// Takes a rectangle of set squares off the mask, which is not empty: as far right as there are any, then as far up.
SquareBox TakeBox(std::uint64_t& squares) {
  const auto first = static_cast<std::uint32_t>(std::countr_zero(squares));
  const std::uint64_t row = squares >> first & (255u >> (first % 8));
  const auto width = static_cast<std::uint32_t>(std::countr_one(row));
  const std::uint64_t run = ((std::uint64_t{1} << width) - 1) << (first % 8);
  SquareBox box{first % 8, first % 8 + width, first / 8, first / 8};
  while (box.end_y < 8 && (squares >> (8 * box.end_y) & run) == run) {
    squares &= ~(run << (8 * box.end_y));
    ++box.end_y;
  }
  return box;
}

// What a rectangle more costs, in squares drawn: setting up its triangles.
constexpr std::uint32_t kBoxCostSquares = 10;

// Rectangles that hold all of a mask's squares: one each where they fit together well, or one around them all.
std::vector<SquareBox>& CoverSquares(std::uint64_t squares, std::vector<SquareBox>& boxes) {
  boxes.clear();
  const auto square_count = static_cast<std::uint32_t>(std::popcount(squares));
  SquareBox all{8, 0, 8, 0};
  while (squares != 0) {
    const SquareBox& box = boxes.emplace_back(TakeBox(squares));
    all = {std::min(all.first_x, box.first_x), std::max(all.end_x, box.end_x), std::min(all.first_y, box.first_y),
           std::max(all.end_y, box.end_y)};
  }
  const std::uint32_t all_count = (all.end_x - all.first_x) * (all.end_y - all.first_y);
  const auto box_count = static_cast<std::uint32_t>(boxes.size());
  if (all_count + kBoxCostSquares <= square_count + kBoxCostSquares * box_count) boxes = {all};
  return boxes;
}

// A tile on its way.
struct OpenTile {
  GatherWork* work = nullptr;
  std::size_t index = 0;  // In its page.
  CellBox box;
  const std::vector<OrderedBlock>* list = nullptr;  // Of its page.
  std::size_t next = 0;                             // In the list.
  std::uint64_t open = ~std::uint64_t{0};           // Squares with unknown cells.
  std::unique_ptr<Tile> tile;                       // Null until something may be known.
  std::vector<const PlacedBlock*> round;            // Drawn in this round; a pixel's winner counts here.
  // Where it stands in the target, in tiles.
  std::uint32_t column = 0;
  std::uint32_t row = 0;
  bool is_for_cpu = false;

  std::size_t CountBlocks() const { return round.size() + (tile == nullptr ? 0 : tile->blocks.size()); }
};

template <typename Visit>
void ForEachKnownCell(Tile& tile, Visit visit) {
  for (std::size_t square = 0; square < kSquaresInTile; ++square) {
    std::uint16_t* winners = tile.winners.data() + 64 * square;
    if (~tile.known[square] == 0) {
      for (std::size_t i = 0; i < 64; ++i) visit(winners[i]);
      continue;
    }
    for (std::uint64_t cells = tile.known[square]; cells != 0; cells &= cells - 1) {
      visit(winners[static_cast<std::size_t>(std::countr_zero(cells))]);
    }
  }
}

// Strikes blocks that were drawn and won nothing.
void DropLosers(Tile& tile) {
  std::vector<std::uint16_t> numbers(tile.blocks.size());
  ForEachKnownCell(tile, [&numbers](std::uint16_t winner) { numbers[winner] = 1; });
  std::uint16_t count = 0;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (numbers[i] == 0) continue;
    tile.blocks[count] = tile.blocks[i];
    numbers[i] = count++;
  }
  if (count == tile.blocks.size()) return;
  tile.blocks.resize(count);
  ForEachKnownCell(tile, [&numbers](std::uint16_t& winner) { winner = numbers[winner]; });
  for (std::size_t square = 0; square < kSquaresInTile; ++square) {
    if (tile.known[square] != 0) tile.weakest[square] = numbers[tile.weakest[square]];
  }
}

// Takes over what a round drew of a square. `pixels` is the square's first, `stride` the target's width; `base` is what
// the first block of the round is called in the tile.
void ReadSquare(const std::uint32_t* pixels, std::size_t stride, std::uint32_t base, std::size_t square, Tile& tile) {
  std::array<std::uint32_t, 64> drawn;
  for (std::size_t y = 0; y < 8; ++y) std::copy_n(pixels + y * stride, 8, drawn.begin() + 8 * y);
  std::uint64_t free = 0;
  std::uint64_t hazard = 0;
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    free |= static_cast<std::uint64_t>(drawn[i] & 1) << i;
    hazard |= static_cast<std::uint64_t>(drawn[i] >> 1 & 1) << i;
  }
  const std::uint64_t taken = (free | hazard) & ~tile.known[square];
  if (taken == 0) return;
  std::uint16_t* winners = tile.winners.data() + 64 * square;
  std::uint32_t weakest = 0;
  if (~taken == 0) {
    for (std::size_t i = 0; i < drawn.size(); ++i) {
      weakest = std::max(weakest, drawn[i] >> 8);
      winners[i] = static_cast<std::uint16_t>(base + (drawn[i] >> 8));
    }
  } else {
    for (std::uint64_t cells = taken; cells != 0; cells &= cells - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(cells));
      weakest = std::max(weakest, drawn[i] >> 8);
      winners[i] = static_cast<std::uint16_t>(base + (drawn[i] >> 8));
    }
  }
  tile.known[square] |= taken;
  tile.hazard[square] |= hazard & taken;
  tile.weakest[square] = static_cast<std::uint16_t>(base + weakest);
}

// The same of a tile, whose first pixel `pixels` is.
void ReadRound(const std::uint32_t* pixels, std::size_t stride, OpenTile& open) {
  Tile& tile = *open.tile;
  const auto base = static_cast<std::uint32_t>(tile.blocks.size());
  tile.blocks.insert(tile.blocks.end(), open.round.begin(), open.round.end());
  for (std::uint64_t todo = open.open; todo != 0; todo &= todo - 1) {
    const auto square = static_cast<std::size_t>(std::countr_zero(todo));
    ReadSquare(pixels + square / 8 * 8 * stride + square % 8 * 8, stride, base, square, tile);
    if (~tile.known[square] == 0) open.open &= ~(std::uint64_t{1} << square);
  }
}

}  // namespace

class GlGather::Painter {
 public:
  Painter(const Options& options, const EglContext& context, Times& times)
      : options_(options),
        context_(context),
        times_(times),
        atlas_(options.atlas_page_texels_max),
        target_tiles_(std::min({options.target_cells_max, GetGlInteger(GL_MAX_TEXTURE_SIZE),
                                GetGlInteger(GL_MAX_RENDERBUFFER_SIZE), ViewportMax()}) /
                      static_cast<std::int32_t>(kTileSideCells)) {}

  Result<void> Start() {
    if (target_tiles_ < 1) return Fail(ErrorCode::kUnavailable, "OpenGL cannot draw to 64 x 64 cells");
    Result<GlProgram> program = MakeProgram(kMergeVertexShader, kMergeFragmentShader);
    if (!program) return tl::unexpected(program.error());
    program_ = std::move(*program);
    target_size_uniform_ = glGetUniformLocation(program_.id(), "target_size");
    buffer_ = MakeBuffer();
    vertex_array_ = MakeVertexArray();
    glBindVertexArray(vertex_array_.id());
    glBindBuffer(GL_ARRAY_BUFFER, buffer_.id());
    GLuint location = 0;
    for (const Attribute& attribute : kAttributes) {
      glEnableVertexAttribArray(location);
      glVertexAttribIPointer(location, attribute.count, GL_UNSIGNED_INT, sizeof(Instance),
                             reinterpret_cast<const void*>(attribute.offset));
      glVertexAttribDivisor(location, 1);
      ++location;
    }
    return CheckGl("preparing");
  }

  Result<void> Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works, const StopPredicate& stop) {
    times_ = {};
    PageLister lister(blocks);
    for (std::size_t first = 0; first < works.size(); first += kBatchPages) {
      const std::span<GatherWork> batch = works.subspan(first, std::min(kBatchPages, works.size() - first));
      lists_.resize(batch.size());
      tiles_.clear();
      for (std::size_t i = 0; i < batch.size(); ++i) {
        lister.List(batch[i].key, lists_[i]);
        AddTiles(batch[i], lists_[i]);
      }
      if (Result<void> drawn = GatherTiles(stop); !drawn) return drawn;
      if (Result<void> finished = Finish(blocks, stop); !finished) return finished;
    }
    return {};
  }

 private:
  static GLint ViewportMax() {
    GLint sides[2] = {0, 0};
    glGetIntegerv(GL_MAX_VIEWPORT_DIMS, sides);
    return std::min(sides[0], sides[1]);
  }

  double NowMs() const {
    if (!options_.now_ms) return 0;
    glFinish();
    return options_.now_ms();
  }

  void AddTiles(GatherWork& work, const std::vector<OrderedBlock>& list) {
    for (std::size_t index = 0; index < kTilesInPage; ++index) {
      if ((work.tiles >> index & 1) == 0) continue;
      OpenTile& open = tiles_.emplace_back();
      open.work = &work;
      open.index = index;
      open.box = BoxOf(work.key, index);
      open.list = &list;
    }
  }

  // As many tiles at once as the target holds, round after round.
  Result<void> GatherTiles(const StopPredicate& stop) {
    const auto at_once = static_cast<std::size_t>(target_tiles_) * static_cast<std::size_t>(target_tiles_);
    std::vector<OpenTile*> open;
    for (OpenTile& tile : tiles_) open.push_back(&tile);
    for (std::size_t round = 0; !open.empty(); ++round) {
      const std::size_t blocks_max = kRoundBlocks[std::min(round, kRoundBlocks.size() - 1)];
      for (std::size_t first = 0; first < open.size();) {
        if (stop && stop()) return Fail(ErrorCode::kUnavailable, "the merge was stopped");
        const std::size_t count = CountAtOnce(std::span(open).subspan(first), blocks_max, at_once);
        if (Result<void> drawn = DrawRound(std::span(open).subspan(first, count), blocks_max); !drawn) return drawn;
        first += count;
      }
      std::erase_if(open, [](const OpenTile* tile) {
        return tile->is_for_cpu || tile->open == 0 || tile->next == tile->list->size();
      });
    }
    return {};
  }

  // Of the tiles, how many one draw takes: what it is told of blocks has a bound, but for a single tile.
  static std::size_t CountAtOnce(std::span<OpenTile*> tiles, std::size_t blocks_max, std::size_t tiles_max) {
    std::size_t count = 0;
    for (std::size_t blocks = 0; count < std::min(tiles.size(), tiles_max); ++count) {
      blocks += std::min(blocks_max, tiles[count]->list->size() - tiles[count]->next);
      if (count > 0 && blocks > kBlocksAtOnce) break;
    }
    return count;
  }

  Result<void> DrawRound(std::span<OpenTile*> tiles, std::size_t blocks_max) {
    const double start_ms = NowMs();
    // The atlas may be made anew while blocks are looked up in it; then what was found before is void.
    std::vector<std::size_t> starts;
    for (const OpenTile* tile : tiles) starts.push_back(tile->next);
    std::uint64_t generation = 0;
    std::uint32_t places = 0;
    do {
      generation = atlas_.generation();
      instances_.clear();
      places = 0;
      for (std::size_t i = 0; i < tiles.size(); ++i) {
        tiles[i]->next = starts[i];
        if (Result<void> added = AddInstances(*tiles[i], blocks_max, places); !added) return added;
      }
    } while (generation != atlas_.generation());
    if (instances_.empty()) return {};
    const auto width =
        static_cast<std::int32_t>(kTileSideCells) * std::min(static_cast<std::int32_t>(places), target_tiles_);
    const auto height = static_cast<std::int32_t>(kTileSideCells) *
                        ((static_cast<std::int32_t>(places) + target_tiles_ - 1) / target_tiles_);
    glBindVertexArray(vertex_array_.id());
    glBindBuffer(GL_ARRAY_BUFFER, buffer_.id());
    glBufferData(GL_ARRAY_BUFFER, static_cast<GLsizeiptr>(instances_.size() * sizeof(Instance)), instances_.data(),
                 GL_STREAM_DRAW);
    const double uploaded_ms = NowMs();
    if (Result<void> drawn = Draw(width, height); !drawn) return drawn;
    const double drawn_ms = NowMs();
    if (Result<void> read = ReadPixels(width, height); !read) return read;
    for (OpenTile* tile : tiles) {
      if (tile->round.empty()) continue;
      const std::size_t first = tile->row * 64 * static_cast<std::size_t>(width) + tile->column * 64;
      ReadRound(pixels_.data() + first, static_cast<std::size_t>(width), *tile);
    }
    times_.upload_ms += uploaded_ms - start_ms;
    times_.draw_ms += drawn_ms - uploaded_ms;
    times_.read_ms += NowMs() - drawn_ms;
    return {};
  }

  // The tile's next blocks that may know something where it is open.
  Result<void> AddInstances(OpenTile& open, std::size_t blocks_max, std::uint32_t& places) {
    open.round.clear();
    open.column = places % static_cast<std::uint32_t>(target_tiles_);
    open.row = places / static_cast<std::uint32_t>(target_tiles_);
    const std::size_t first_instance = instances_.size();
    for (; open.next < open.list->size() && open.round.size() < blocks_max; ++open.next) {
      const OrderedBlock& ordered = (*open.list)[open.next];
      if (!ordered.box.Touches(open.box)) continue;
      const std::uint64_t squares = SquaresThatMayKnow(*ordered.block, open.box) & open.open;
      if (squares == 0) continue;
      const bool is_countable = open.CountBlocks() < kTileBlocksMax;
      if (IsSteep(ordered.block->rectangle) || !is_countable) {
        open.is_for_cpu = true;
        open.round.clear();
        instances_.resize(first_instance);
        return {};
      }
      if (Result<void> added = AddBlock(*ordered.block, open, squares); !added) return added;
      open.round.push_back(ordered.block);
    }
    if (open.round.empty()) return {};
    ++places;
    if (open.tile == nullptr) {
      open.tile = TakeTile();
      open.tile->known.fill(0);
      open.tile->hazard.fill(0);
      open.tile->blocks.clear();
    }
    return {};
  }

  // An instance for each rectangle of the squares.
  Result<void> AddBlock(const PlacedBlock& block, const OpenTile& open, std::uint64_t squares) {
    const PlacedRectangle& placed = block.rectangle;
    const std::int64_t pixel_x = std::int64_t{open.column} * kTileSideCells;
    const std::int64_t pixel_y = std::int64_t{open.row} * kTileSideCells;
    const std::int64_t i = open.box.first_x - placed.anchor_x - pixel_x;
    const std::int64_t j = open.box.first_y - placed.anchor_y - pixel_y;
    Instance instance{};
    instance.placed = {Wrap(placed.u0 + i * placed.step_cos + j * placed.step_sin),
                       Wrap(placed.v0 - i * placed.step_sin + j * placed.step_cos), Wrap(placed.step_cos),
                       Wrap(placed.step_sin)};
    instance.sides = {placed.width_q, placed.height_q, 0, kFootprintPage};
    instance.winner = static_cast<glm::uint>(open.round.size());
    if (!block.is_footprint()) {
      const Result<LayerAtlas::Spot> spot = atlas_.Find(block);
      if (!spot) return tl::unexpected(spot.error());
      instance.sides.z = static_cast<std::uint32_t>(spot->x) | static_cast<std::uint32_t>(spot->y) << 16;
      instance.sides.w = static_cast<std::uint32_t>(spot->page);
    }
    for (const SquareBox& box : CoverSquares(squares, boxes_)) {
      const auto first_x = static_cast<std::uint32_t>(pixel_x) + box.first_x * 8;
      const auto first_y = static_cast<std::uint32_t>(pixel_y) + box.first_y * 8;
      instance.rectangle = {first_x | first_y << 16,
                            (box.end_x - box.first_x) * 8 | (box.end_y - box.first_y) * 8 << 16};
      instances_.push_back(instance);
    }
    return {};
  }

  // A target at least so large; kept for the next round.
  Result<void> PrepareTarget(std::int32_t width, std::int32_t height) {
    if (width <= target_width_ && height <= target_height_) {
      glBindFramebuffer(GL_FRAMEBUFFER, framebuffer_.id());
      return {};
    }
    target_width_ = std::max(width, target_width_);
    target_height_ = std::max(height, target_height_);
    color_ = MakeRenderbuffer();
    glBindRenderbuffer(GL_RENDERBUFFER, color_.id());
    glRenderbufferStorage(GL_RENDERBUFFER, GL_R32UI, target_width_, target_height_);
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

  Result<void> CheckLost() const {
    const bool is_lost = (options_.is_lost && options_.is_lost()) || context_.is_lost();
    if (is_lost) return Fail(ErrorCode::kUnavailable, "the OpenGL context is lost");
    return {};
  }

  Result<void> Draw(std::int32_t width, std::int32_t height) {
    if (Result<void> lost = CheckLost(); !lost) return lost;
    if (Result<void> prepared = PrepareTarget(width, height); !prepared) return prepared;
    glViewport(0, 0, width, height);
    const std::array<GLuint, 4> unknown = {0, 0, 0, 0};
    const GLfloat far_depth = 1;
    glEnable(GL_SCISSOR_TEST);
    glScissor(0, 0, width, height);
    glDepthMask(GL_TRUE);
    glClearBufferuiv(GL_COLOR, 0, unknown.data());
    glClearBufferfv(GL_DEPTH, 0, &far_depth);
    glDisable(GL_SCISSOR_TEST);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_LESS);  // All have one depth: the first that is drawn stays.
    glDisable(GL_BLEND);
    glDisable(GL_DITHER);
    glDisable(GL_CULL_FACE);
    glUseProgram(program_.id());
    glUniform2f(target_size_uniform_, static_cast<GLfloat>(width), static_cast<GLfloat>(height));
    glActiveTexture(GL_TEXTURE0);
    glBindTexture(GL_TEXTURE_2D_ARRAY, atlas_.texture());
    glDrawArraysInstanced(GL_TRIANGLE_STRIP, 0, 4, static_cast<GLsizei>(instances_.size()));
    return CheckGl("drawing");
  }

  Result<void> ReadPixels(std::int32_t width, std::int32_t height) {
    const auto count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    pixels_.resize(count);
    glPixelStorei(GL_PACK_ALIGNMENT, 4);
    // OpenGL ES promises four channels; most drivers also give the one that is there.
    const bool is_one = GetGlInteger(GL_IMPLEMENTATION_COLOR_READ_FORMAT) == GL_RED_INTEGER &&
                        GetGlInteger(GL_IMPLEMENTATION_COLOR_READ_TYPE) == GL_UNSIGNED_INT;
    if (is_one) {
      glReadPixels(0, 0, width, height, GL_RED_INTEGER, GL_UNSIGNED_INT, pixels_.data());
    } else {
      channels_.resize(count * 4);
      glReadPixels(0, 0, width, height, GL_RGBA_INTEGER, GL_UNSIGNED_INT, channels_.data());
      for (std::size_t i = 0; i < count; ++i) pixels_[i] = channels_[4 * i];
    }
    if (Result<void> read = CheckGl("reading back"); !read) return read;
    return CheckLost();
  }

  std::unique_ptr<Tile> TakeTile() {
    if (spare_.empty()) return std::make_unique_for_overwrite<Tile>();
    std::unique_ptr<Tile> tile = std::move(spare_.back());
    spare_.pop_back();
    return tile;
  }

  // All rounds are done: the new tiles replace the old ones.
  Result<void> Finish(std::span<const OrderedBlock> blocks, const StopPredicate& stop) {
    std::vector<GatherWork> steep;
    std::vector<GatherWork*> steep_origins;
    for (OpenTile& open : tiles_) {
      if (open.is_for_cpu) {
        steep.push_back({open.work->key, open.work->page, static_cast<std::uint16_t>(1 << open.index), 0});
        steep_origins.push_back(open.work);
        continue;
      }
      std::unique_ptr<Tile>& held = open.work->page->tiles[open.index];
      if (open.tile != nullptr) DropLosers(*open.tile);
      if (open.tile != nullptr && open.tile->blocks.empty()) spare_.push_back(std::move(open.tile));
      const bool is_same = held == nullptr || open.tile == nullptr
                               ? held == open.tile
                               : held->known == open.tile->known && held->hazard == open.tile->hazard;
      if (!is_same) open.work->changed = static_cast<std::uint16_t>(open.work->changed | 1 << open.index);
      std::swap(held, open.tile);
      if (open.tile != nullptr) spare_.push_back(std::move(open.tile));
    }
    spare_.resize(std::min(spare_.size(), kBatchPages * kTilesInPage));
    if (steep.empty()) return {};
    if (Result<void> gathered = cpu_.Gather(blocks, steep, stop); !gathered) return gathered;
    for (std::size_t i = 0; i < steep.size(); ++i) {
      steep_origins[i]->changed = static_cast<std::uint16_t>(steep_origins[i]->changed | steep[i].changed);
    }
    return {};
  }

  const Options& options_;
  const EglContext& context_;
  Times& times_;
  LayerAtlas atlas_;
  CpuGather cpu_{{}};
  const std::int32_t target_tiles_;  // A side.
  GlProgram program_;
  GLint target_size_uniform_ = -1;
  GlBuffer buffer_;
  GlVertexArray vertex_array_;
  GlRenderbuffer color_;
  GlRenderbuffer depth_;
  GlFramebuffer framebuffer_;
  std::int32_t target_width_ = 0;
  std::int32_t target_height_ = 0;
  std::vector<std::vector<OrderedBlock>> lists_;  // By page of the batch.
  std::vector<OpenTile> tiles_;                   // Of the batch.
  std::vector<SquareBox> boxes_;                  // Of the block at hand.
  std::vector<Instance> instances_;
  std::vector<std::uint32_t> pixels_;  // Value, and the winner in the round above it.
  std::vector<std::uint32_t> channels_;
  std::vector<std::unique_ptr<Tile>> spare_;
};

GlGather::GlGather(Options options, std::unique_ptr<EglContext> context)
    : options_(std::move(options)), context_(std::move(context)) {}

GlGather::~GlGather() {
  const CurrentContext current(*context_);
  painter_.reset();
}

Result<std::unique_ptr<GlGather>> GlGather::Create(Options options) {
  Result<std::unique_ptr<EglContext>> context = EglContext::Create();
  if (!context) return tl::unexpected(context.error());
  std::unique_ptr<GlGather> gather(new GlGather(std::move(options), std::move(*context)));
  const CurrentContext current(*gather->context_);
  if (!current.made_current()) return tl::unexpected(current.made_current().error());
  gather->painter_ = std::make_unique<Painter>(gather->options_, *gather->context_, gather->times_);
  if (Result<void> started = gather->painter_->Start(); !started) return tl::unexpected(started.error());
  return gather;
}

Result<void> GlGather::Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works,
                              const StopPredicate& stop) {
  const CurrentContext current(*context_);
  if (!current.made_current()) return tl::unexpected(current.made_current().error());
  return painter_->Gather(blocks, works, stop);
}

std::string GlGather::description() const { return "gl (" + context_->renderer() + ")"; }

}  // namespace moondb
