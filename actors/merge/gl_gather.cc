#include "actors/merge/gl_gather.h"

#include <GLES3/gl31.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <glm/glm.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "actors/merge/egl_context.h"
#include "actors/merge/gl_objects.h"
#include "actors/merge/gl_target.h"
#include "actors/merge/layer_atlas.h"
#include "actors/merge/open_tile.h"
#include "merge_shaders.h"

namespace moondb {
namespace {

// Tiles are drawn in rounds, until all their cells are known. For each round: the maximum number of blocks in the lists
// of a tile and of a square. The first lists are short, because most cells are known after very few blocks. No list is
// longer than 63, because the byte that is read back for a cell has 6 bits for the block's number.
struct RoundLimits {
  std::size_t tile_blocks;
  std::uint8_t square_blocks;
};
constexpr std::array<RoundLimits, 3> kRounds = {{{8, 4}, {24, 12}, {63, 63}}};

// Maximum size of Tile::blocks, because the index of a cell's winner in Tile::blocks has 16 bits.
constexpr std::size_t kTileBlocksMax = 65'536;

// Maximum number of pages that are gathered together: 4096 x 4096 cells.
constexpr std::size_t kBatchPages = 256;

// One block or footprint in a square's list, in the format that shaders/merge.frag reads: two texels.
struct ListEntry {
  glm::uvec4 placed;
  glm::uvec2 sides;
  glm::uint corner;
  glm::uint page_and_number;
};
constexpr std::size_t kEntryTexels = 2;
static_assert(sizeof(ListEntry) == kEntryTexels * 4 * sizeof(std::uint32_t));

// Number of entries in a row of the list texture, as in shaders/merge.frag.
constexpr std::size_t kListColumns = 1024;
constexpr std::size_t kEntriesMax = kListColumns << 10;  // Maximum number of entries in one draw.

// Numbers of the texture units to which the shader's textures are bound.
constexpr GLint kLayersUnit = 0;
constexpr GLint kSquaresUnit = 1;
constexpr GLint kListsUnit = 2;

// Page number that marks a footprint. No page of the atlas has this number.
constexpr std::uint32_t kFootprintPage = LayerAtlas::kPagesMax;

std::uint32_t Wrap(std::int64_t value) { return static_cast<std::uint32_t>(static_cast<std::uint64_t>(value)); }

// Returns true if the steps are too large for 32-bit coordinates, which wrap around after 1024 cells. A cell outside
// the block could then appear inside the block.
bool IsSteep(const PlacedRectangle& placed) {
  const std::int64_t steps = std::abs(std::int64_t{placed.step_cos}) + std::abs(std::int64_t{placed.step_sin});
  return steps * kSquareSideCells > std::int64_t{500} << kFractionBits;
}

// A block that may know some cells of a tile.
struct Candidate {
  const PlacedBlock* block = nullptr;
  std::uint64_t squares = 0;
  ListEntry at_tile;  // The block's list entry, with the coordinates of the tile's first cell.
};

// Counts, for each square of a tile, the blocks in the square's list.
class SquareCounts {
 public:
  SquareCounts(std::uint64_t squares, std::uint8_t blocks_max) : wanting_(squares), blocks_max_(blocks_max) {}

  // Adds a block to the list of each square in `squares` whose list is not full. Returns the squares whose list got the
  // block.
  std::uint64_t Add(std::uint64_t squares) {
    const std::uint64_t taken = squares & wanting_;
    listed_ |= taken;
    for (std::uint64_t todo = taken; todo != 0; todo &= todo - 1) {
      const int square = std::countr_zero(todo);
      if (++counts_[static_cast<std::size_t>(square)] == blocks_max_) wanting_ &= ~(std::uint64_t{1} << square);
    }
    return taken;
  }
  std::uint64_t wanting() const { return wanting_; }  // Squares whose list is not full.
  std::uint64_t listed() const { return listed_; }    // Squares that list at least one block.
  std::size_t of(std::size_t square) const { return counts_[square]; }

 private:
  std::uint64_t wanting_;
  const std::uint8_t blocks_max_;
  std::uint64_t listed_ = 0;
  std::array<std::uint8_t, kSquaresInTile> counts_{};
};

}  // namespace

class GlGather::Painter {
 public:
  Painter(const Options& options, const EglContext& context, Times& times)
      : options_(options),
        context_(context),
        times_(times),
        atlas_(options.atlas_page_texels_max),
        cpu_({options.threads, nullptr}),
        side_(static_cast<std::size_t>(
            std::min({options.target_cells_max / static_cast<std::int32_t>(kSquareSideCells),
                      GetGlInteger(GL_MAX_TEXTURE_SIZE) / static_cast<std::int32_t>(kSquarePixelsX),
                      GetGlInteger(GL_MAX_RENDERBUFFER_SIZE) / static_cast<std::int32_t>(kSquarePixelsX),
                      ViewportMax() / static_cast<std::int32_t>(kSquarePixelsX)}))) {}

  Result<void> Start() {
    if (side_ * side_ < kSquaresInTile) return Fail(ErrorCode::kUnavailable, "OpenGL cannot draw to 64 x 64 cells");
    Result<GlProgram> program = MakeProgram(kMergeVertexShader, kMergeFragmentShader);
    if (!program) return tl::unexpected(program.error());
    program_ = std::move(*program);
    glUseProgram(program_.id());
    glUniform1i(glGetUniformLocation(program_.id(), "layers"), kLayersUnit);
    glUniform1i(glGetUniformLocation(program_.id(), "squares"), kSquaresUnit);
    glUniform1i(glGetUniformLocation(program_.id(), "lists"), kListsUnit);
    layers_texel_uniform_ = glGetUniformLocation(program_.id(), "layers_texel");
    lists_texel_uniform_ = glGetUniformLocation(program_.id(), "lists_texel");
    vertex_array_ = MakeVertexArray();
    squares_texture_ = MakeTable(kSquaresUnit, GL_R32UI, side_, side_);
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

  // Draws each tile repeatedly, each time with the next blocks, until all its cells are known or no blocks are left.
  // One draw contains as many tiles as fit into the target.
  Result<void> GatherTiles(const StopPredicate& stop) {
    std::vector<OpenTile*> open;
    for (OpenTile& tile : tiles_) open.push_back(&tile);
    for (std::size_t round = 0; !open.empty(); ++round) {
      const RoundLimits& limits = kRounds[std::min(round, kRounds.size() - 1)];
      const std::size_t at_once =
          std::min(side_ * side_ / kSquaresInTile, kEntriesMax / (kSquaresInTile * limits.square_blocks));
      for (std::size_t first = 0; first < open.size(); first += at_once) {
        if (stop && stop()) return Fail(ErrorCode::kUnavailable, "the merge was stopped");
        const std::size_t count = std::min(at_once, open.size() - first);
        if (Result<void> drawn = DrawRound(std::span(open).subspan(first, count), limits); !drawn) return drawn;
      }
      std::erase_if(open, [](const OpenTile* tile) {
        return tile->is_for_cpu || tile->open == 0 || tile->next == tile->list->size();
      });
    }
    return {};
  }

  Result<void> DrawRound(std::span<OpenTile*> tiles, const RoundLimits& limits) {
    const double start_ms = NowMs();
    if (Result<void> listed = MakeLists(tiles, limits); !listed) return listed;
    if (entries_.empty()) return {};
    // The squares fill the target row by row. Only the last row may be incomplete.
    const std::size_t columns = std::min(square_lists_.size(), side_);
    const std::size_t rows = (square_lists_.size() + columns - 1) / columns;
    square_lists_.resize(rows * columns);
    UploadLists(columns, rows);
    const double uploaded_ms = NowMs();
    const auto width = static_cast<GLsizei>(columns * kSquarePixelsX);
    const auto height = static_cast<GLsizei>(rows * kSquarePixelsY);
    if (Result<void> drawn = Draw(width, height); !drawn) return drawn;
    const double drawn_ms = NowMs();
    Result<void> read = target_.Read(width, height);
    if (read) read = CheckLost();
    if (!read) return read;
    for (OpenTile* tile : tiles) {
      if (tile->squares != 0) ReadRound(target_.pixels(), columns, *tile);
    }
    times_.upload_ms += uploaded_ms - start_ms;
    times_.draw_ms += drawn_ms - uploaded_ms;
    times_.read_ms += NowMs() - drawn_ms;
    return {};
  }

  // Fills entries_ and square_lists_ for a draw. If the upload of a block rebuilds the atlas, the positions in the
  // lists become invalid, and the lists are built again.
  Result<void> MakeLists(std::span<OpenTile*> tiles, const RoundLimits& limits) {
    for (OpenTile* tile : tiles) {
      if (tile->tile != nullptr && tile->tile->blocks.size() + limits.tile_blocks > kTileBlocksMax) {
        DropLosers(*tile->tile);
      }
      tile->first_block = tile->tile == nullptr ? 0 : tile->tile->blocks.size();
    }
    std::vector<std::size_t> starts;
    for (const OpenTile* tile : tiles) starts.push_back(tile->next);
    std::uint64_t generation = 0;
    do {
      generation = atlas_.generation();
      entries_.clear();
      square_lists_.clear();
      for (std::size_t i = 0; i < tiles.size(); ++i) {
        tiles[i]->next = starts[i];
        if (tiles[i]->tile != nullptr) tiles[i]->tile->blocks.resize(tiles[i]->first_block);
        if (Result<void> listed = ListTile(*tiles[i], limits); !listed) return listed;
      }
    } while (generation != atlas_.generation());
    return {};
  }

  // For each open square of the tile, lists the next blocks that may know cells of the square.
  Result<void> ListTile(OpenTile& open, const RoundLimits& limits) {
    candidates_.clear();
    SquareCounts counts(open.open, limits.square_blocks);
    // First block that is missing in a square's list because the list is full. The next round starts with this block.
    std::optional<std::size_t> first_left;
    std::size_t next = open.next;
    for (; next < open.list->size() && candidates_.size() < limits.tile_blocks && counts.wanting() != 0; ++next) {
      const OrderedBlock& ordered = (*open.list)[next];
      if (!ordered.box.Touches(open.box)) continue;
      const std::uint64_t squares = SquaresThatMayKnow(*ordered.block, open.box) & open.open;
      if (squares == 0) continue;
      if (IsSteep(ordered.block->rectangle)) {
        open.is_for_cpu = true;
        open.squares = 0;
        return {};
      }
      if ((squares & ~counts.wanting()) != 0 && !first_left) first_left = next;
      const std::uint64_t taken = counts.Add(squares);
      if (taken == 0) continue;
      if (Result<void> added = AddCandidate(*ordered.block, open.box, taken); !added) return added;
    }
    open.next = first_left.value_or(next);
    open.squares = counts.listed();
    if (candidates_.empty()) return {};
    if (open.tile == nullptr) open.tile = TakeTile();
    for (const Candidate& candidate : candidates_) open.tile->blocks.push_back(candidate.block);
    AddSquares(open, counts);
    return {};
  }

  Result<void> AddCandidate(const PlacedBlock& block, const CellBox& tile, std::uint64_t squares) {
    const PlacedRectangle& placed = block.rectangle;
    const std::int64_t i = tile.first_x - placed.anchor_x;
    const std::int64_t j = tile.first_y - placed.anchor_y;
    ListEntry entry{};
    entry.placed = {Wrap(placed.u0 + i * placed.step_cos + j * placed.step_sin),
                    Wrap(placed.v0 - i * placed.step_sin + j * placed.step_cos), Wrap(placed.step_cos),
                    Wrap(placed.step_sin)};
    entry.sides = {placed.width_q, placed.height_q};
    entry.page_and_number = kFootprintPage;
    if (!block.is_footprint()) {
      const Result<LayerAtlas::Spot> spot = atlas_.Find(block);
      if (!spot) return tl::unexpected(spot.error());
      entry.corner = static_cast<std::uint32_t>(spot->x) | static_cast<std::uint32_t>(spot->y) << 16;
      entry.page_and_number = static_cast<std::uint32_t>(spot->page);
    }
    entry.page_and_number |= static_cast<std::uint32_t>(candidates_.size()) << 16;
    candidates_.push_back({&block, squares, entry});
    return {};
  }

  // For each square of the tile, appends the square's candidates to entries_, and the position and number of these
  // entries to square_lists_.
  void AddSquares(OpenTile& open, const SquareCounts& counts) {
    open.first_place = square_lists_.size();
    std::array<std::size_t, kSquaresInTile> ends;
    std::size_t end = entries_.size();
    for (std::uint64_t todo = open.squares; todo != 0; todo &= todo - 1) {
      const auto square = static_cast<std::size_t>(std::countr_zero(todo));
      square_lists_.push_back(static_cast<std::uint32_t>(end << 6 | counts.of(square)));
      ends[square] = end;
      end += counts.of(square);
    }
    entries_.resize(end);
    for (const Candidate& candidate : candidates_) {
      for (std::uint64_t todo = candidate.squares; todo != 0; todo &= todo - 1) {
        const auto square = static_cast<std::size_t>(std::countr_zero(todo));
        const auto x = static_cast<std::uint32_t>(square % 8 * 8);
        const auto y = static_cast<std::uint32_t>(square / 8 * 8);
        ListEntry& entry = entries_[ends[square]++];
        entry = candidate.at_tile;
        entry.placed.x += x * entry.placed.z + y * entry.placed.w;
        entry.placed.y += y * entry.placed.z - x * entry.placed.w;
      }
    }
  }

  // Creates a texture that holds integers.
  static GlTexture MakeTable(GLint unit, GLenum format, std::size_t columns, std::size_t rows) {
    GlTexture texture = MakeTexture();
    glActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
    glBindTexture(GL_TEXTURE_2D, texture.id());
    glTexStorage2D(GL_TEXTURE_2D, 1, format, static_cast<GLsizei>(columns), static_cast<GLsizei>(rows));
    // Integer textures cannot be filtered. With the default filter the texture is incomplete and reads 0.
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTexParameteri(GL_TEXTURE_2D, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glActiveTexture(GL_TEXTURE0);
    return texture;
  }

  void UploadLists(std::size_t columns, std::size_t rows) {
    const std::size_t list_rows = (entries_.size() + kListColumns - 1) / kListColumns;
    if (list_rows > list_rows_) {
      list_rows_ = std::bit_ceil(list_rows);
      lists_texture_ = MakeTable(kListsUnit, GL_RGBA32UI, kEntryTexels * kListColumns, list_rows_);
    }
    entries_.resize(list_rows * kListColumns);
    glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
    Fill(kListsUnit, lists_texture_, kEntryTexels * kListColumns, list_rows, GL_RGBA_INTEGER, entries_.data());
    Fill(kSquaresUnit, squares_texture_, columns, rows, GL_RED_INTEGER, square_lists_.data());
  }

  static void Fill(GLint unit, const GlTexture& texture, std::size_t columns, std::size_t rows, GLenum format,
                   const void* numbers) {
    glActiveTexture(GL_TEXTURE0 + static_cast<GLenum>(unit));
    glBindTexture(GL_TEXTURE_2D, texture.id());
    glTexSubImage2D(GL_TEXTURE_2D, 0, 0, 0, static_cast<GLsizei>(columns), static_cast<GLsizei>(rows), format,
                    GL_UNSIGNED_INT, numbers);
    glActiveTexture(GL_TEXTURE0);
  }

  Result<void> CheckLost() const {
    const bool is_lost = (options_.is_lost && options_.is_lost()) || context_.is_lost();
    if (is_lost) return Fail(ErrorCode::kUnavailable, "the OpenGL context is lost");
    return {};
  }

  // The draw writes every pixel, so no clear is needed.
  Result<void> Draw(GLsizei width, GLsizei height) {
    if (Result<void> lost = CheckLost(); !lost) return lost;
    if (Result<void> prepared = target_.Bind(width, height); !prepared) return prepared;
    glViewport(0, 0, width, height);
    glDisable(GL_DEPTH_TEST);
    glDisable(GL_BLEND);
    glDisable(GL_DITHER);
    glDisable(GL_CULL_FACE);
    glUseProgram(program_.id());
    glBindVertexArray(vertex_array_.id());
    glBindTexture(GL_TEXTURE_2D_ARRAY, atlas_.texture());
    const GLfloat layers_texel = 1.0f / static_cast<GLfloat>(atlas_.page_texels());
    glUniform2f(layers_texel_uniform_, layers_texel, layers_texel);
    glUniform2f(lists_texel_uniform_, 1.0f / (kEntryTexels * kListColumns), 1.0f / static_cast<GLfloat>(list_rows_));
    glDrawArrays(GL_TRIANGLES, 0, 3);
    return CheckGl("drawing");
  }

  std::unique_ptr<Tile> TakeTile() {
    std::unique_ptr<Tile> tile;
    if (spare_.empty()) {
      tile = std::make_unique_for_overwrite<Tile>();
    } else {
      tile = std::move(spare_.back());
      spare_.pop_back();
    }
    tile->known.fill(0);
    tile->hazard.fill(0);
    tile->blocks.clear();
    return tile;
  }

  // Called after all rounds. Moves the drawn tiles into their pages, and gathers the tiles marked `is_for_cpu` on the
  // CPU.
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
  CpuGather cpu_;
  const std::size_t side_;  // Side of the target in squares.
  GlProgram program_;
  GLint layers_texel_uniform_ = -1;
  GLint lists_texel_uniform_ = -1;
  GlVertexArray vertex_array_;
  GlTexture squares_texture_;
  GlTexture lists_texture_;
  std::size_t list_rows_ = 0;  // Number of rows of lists_texture_.
  GlTarget target_;
  std::vector<std::vector<OrderedBlock>> lists_;  // Blocks of each page of the batch.
  std::vector<OpenTile> tiles_;                   // Tiles of the batch.
  std::vector<Candidate> candidates_;             // Candidates for the current tile.
  // Entries of the current draw.
  std::vector<ListEntry> entries_;
  std::vector<std::uint32_t> square_lists_;  // For each square in the target: first entry << 6 | number of entries.
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
