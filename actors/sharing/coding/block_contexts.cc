#include "actors/sharing/coding/block_contexts.h"

#include "actors/sharing/coding/cell_memory.h"

namespace moondb {

namespace {

constexpr int kNoCoarser = 3;

}  // namespace

BlockContexts::BlockContexts(const LayerContext& layer) : layer_(layer) {
  if (layer.coarser) coarser_row_.resize(static_cast<std::size_t>(layer.coarser->stride()));
}

void BlockContexts::StartRow(std::int32_t row, std::int32_t outwards) {
  if (!layer_.coarser) return;
  const std::int32_t y = layer_.rows->index[static_cast<std::size_t>(row)];
  if (y < 0) return;
  const std::uint8_t* here = layer_.coarser->At(-CellPlane::kMargin, y);
  const std::uint8_t* north = layer_.coarser->At(-CellPlane::kMargin, y - outwards);
  const std::uint8_t* south = layer_.coarser->At(-CellPlane::kMargin, y + outwards);
  for (std::size_t i = 0; i < coarser_row_.size(); ++i) {
    coarser_row_[i] = static_cast<std::uint8_t>(here[i] | north[i] << 2 | south[i] << 4);
  }
}

void BlockContexts::Start(const Block& block) {
  is_ready_ = false;
  Around& a = around_;
  a.north_west2 = Widen(block.north - 2);
  a.north_west = Widen(block.north - 1);
  a.north = Widen(block.north);
  a.north_east = Widen(block.north + 1);
  a.north_east2 = Widen(block.north + 2);
  a.north_east3 = Widen(block.north + 3);
  a.north2_west = Widen(block.north2 - 1);
  a.north2 = Widen(block.north2);
  a.north2_east = Widen(block.north2 + 1);
  for (std::size_t i = 0; i < block.size; ++i) {
    a.bearing[i] = static_cast<std::uint16_t>(block.quadrant.number * 8 + block.rays[i].bearing);
    a.distance[i] = block.rays[i].distance;
  }
  LookUpCoarser(block);
  const Coarser& c = coarser_;
  for (std::size_t i = 0; i < kBlock; ++i) {
    const int cells = a.north[i] | a.north_west[i] | a.north_east[i] | a.north2[i];
    const int coarser = c.here[i] | c.east[i] | c.south[i] | c.south_east[i] | c.west[i] | c.north[i] |
                        c.north_east[i] | c.south_west[i] | c.north_west[i];
    a.is_quiet[i] = (cells | coarser) == 0 ? 1 : 0;
  }
  if (!layer_.previous) return;
  LookUpPrevious(block);
  for (std::size_t i = 0; i < kBlock; ++i) a.is_quiet[i] &= previous_.here[i] == 0 ? 1 : 0;
}

BlockContexts::Numbers BlockContexts::Widen(const std::uint8_t* cells) {
  Numbers numbers;
  for (std::size_t i = 0; i < kBlock; ++i) numbers[i] = cells[i];
  return numbers;
}

void BlockContexts::LookUpCoarser(const Block& block) {
  Coarser& c = coarser_;
  Numbers here, east{}, west{};  // Numbers from coarser_row_, which pack three cells each.
  here.fill(kNoCoarser);
  c.half_x.fill(0);
  c.half_y.fill(0);
  c.memory.fill(kNotCovered);
  const std::int32_t y = layer_.coarser ? layer_.rows->index[static_cast<std::size_t>(block.row)] : -1;
  for (std::size_t i = 0; y >= 0 && i < block.size; ++i) {
    const std::size_t column = static_cast<std::size_t>(block.column + static_cast<std::int32_t>(i) * block.quadrant.x);
    const std::int32_t x = layer_.columns->index[column];
    if (x < 0) continue;
    const std::uint8_t* at = coarser_row_.data() + x + CellPlane::kMargin;
    here[i] = at[0];
    east[i] = at[block.quadrant.x];
    west[i] = at[-block.quadrant.x];
    const bool is_far_x = layer_.columns->half[column] != 0;
    const bool is_far_y = layer_.rows->half[static_cast<std::size_t>(block.row)] != 0;
    c.half_x[i] = is_far_x == (block.quadrant.x > 0) ? 1 : 0;
    c.half_y[i] = is_far_y == (block.quadrant.y > 0) ? 1 : 0;
    if (layer_.coarser_previous) c.memory[i] = static_cast<std::uint16_t>(LastCell(*layer_.coarser_previous->At(x, y)));
  }
  for (std::size_t i = 0; i < kBlock; ++i) {
    c.here[i] = here[i] & 3;
    c.north[i] = here[i] >> 2 & 3;
    c.south[i] = here[i] >> 4;
    c.east[i] = east[i] & 3;
    c.north_east[i] = east[i] >> 2 & 3;
    c.south_east[i] = east[i] >> 4;
    c.west[i] = west[i] & 3;
    c.north_west[i] = west[i] >> 2 & 3;
    c.south_west[i] = west[i] >> 4;
  }
}

void BlockContexts::LookUpPrevious(const Block& block) {
  // Three rows of the previous map, from one cell before the block to one cell behind it.
  std::array<std::array<std::uint8_t, kBlock + 2>, 3> memory{}, cells;
  for (std::size_t row = 0; row < memory.size(); ++row) {
    const std::int32_t at = block.row + (static_cast<std::int32_t>(row) - 1) * block.quadrant.y;
    const std::uint8_t* from = layer_.previous->At(block.column - block.quadrant.x, at);
    for (std::size_t i = 0; i < block.size + 2; ++i, from += block.quadrant.x) memory[row][i] = *from;
    for (std::size_t i = 0; i < kBlock + 2; ++i)
      cells[row][i] = static_cast<std::uint8_t>(LastOrUnknown(memory[row][i]));
  }
  Previous& p = previous_;
  p.north_west = Widen(cells[0].data());
  p.north = Widen(cells[0].data() + 1);
  p.north_east = Widen(cells[0].data() + 2);
  p.west = Widen(cells[1].data());
  p.here = Widen(cells[1].data() + 1);
  p.east = Widen(cells[1].data() + 2);
  p.south_west = Widen(cells[2].data());
  p.south = Widen(cells[2].data() + 1);
  p.south_east = Widen(cells[2].data() + 2);
  for (std::size_t i = 0; i < kBlock; ++i) {
    p.last[i] = static_cast<std::uint16_t>(LastCell(memory[1][i + 1]));
    p.state[i] = kMemoryStateOf[memory[1][i + 1]];
  }
}

void BlockContexts::Make() {
  is_ready_ = true;
  const Around& a = around_;
  const Coarser& c = coarser_;
  auto& models = ready_.models;
  const int depth = static_cast<int>(layer_.depth);
  for (std::size_t i = 0; i < kBlock; ++i) {
    const int here = c.here[i], east = c.east[i], south = c.south[i], south_east = c.south_east[i];
    const int quarter = c.half_x[i] + 2 * c.half_y[i];
    const int nearest_x = c.half_x[i] != 0 ? east : c.west[i];
    const int nearest_y = c.half_y[i] != 0 ? south : c.north[i];
    const int north = a.north[i], north_west = a.north_west[i], north_east = a.north_east[i];
    models[0][i] = Join(3, north, north_west, north_east, 0, a.north2[i]) * 4 + here;
    models[1][i] = Join(3, north, north_east, east, south, south_east) * 16 + quarter * 4 + here;
    models[3][i] = Join(3, north, north_west, north_east) * 128 + here * 32 + a.bearing[i];
    models[4][i] = here * 32 + a.distance[i] * 4 + depth;
    models[5][i] = Join(3, nearest_x, nearest_y, east, south, 0, 0) * 16 + quarter * 4 + here;
    models[6][i] = Join(3, north, 0) * 512 + here * 128 + depth * 32 + a.bearing[i];
    models[7][i] = Join(3, east, south, south_east, c.west[i], c.north[i]) * 16 + quarter * 4 + here;
    models[8][i] = Join(3, north, north_east, a.north_east2[i], a.north2_east[i], a.north_east3[i]) * 4 + here;
    ready_.weight_sets[0][i] = Join(3, north, north_east) * 4 + here;
    ready_.weight_sets[1][i] = a.bearing[i] * 8 + a.distance[i];
    ready_.refinement[i] = Join(3, here == kNoCoarser ? 0 : here, 0, north) * 4 + quarter;
  }
  MakeOwn(Decision::kIsKnown);
  MakeOwn(Decision::kIsHazard);
  if (layer_.previous) MakeWithPrevious();
}

void BlockContexts::MakeOwn(Decision decision) {
  const auto bit = [decision](int cell) { return BitOf(decision, cell); };
  const Around& a = around_;
  const Coarser& c = coarser_;
  auto& models = ready_.own[static_cast<std::size_t>(decision)];
  for (std::size_t i = 0; i < kBlock; ++i) {
    models[2][i] =
        Join(2, bit(a.north[i]), bit(a.north_west[i]), bit(a.north_east[i]), 0, bit(a.north2[i]), bit(a.north_east2[i]),
             bit(a.north2_east[i]), bit(a.north2_west[i]), bit(a.north_west2[i]), bit(a.north_east3[i]), 0);
    const int quarter = c.half_x[i] + 2 * c.half_y[i];
    const int here = c.here[i] == kNoCoarser ? 0 : c.here[i];
    models[9][i] =
        Join(2, bit(a.north[i]), bit(here), bit(c.east[i]), bit(c.south[i]), bit(c.south_east[i]), bit(c.west[i]),
             bit(c.north[i]), bit(c.north_east[i]), bit(c.south_west[i]), bit(c.north_west[i])) *
            4 +
        quarter;
  }
  if (!layer_.previous) return;
  const Previous& p = previous_;
  for (std::size_t i = 0; i < kBlock; ++i) {
    models[12][i] =
        Join(2, bit(a.north[i]), bit(p.north_west[i]), bit(p.north[i]), bit(p.north_east[i]), bit(p.west[i]),
             bit(p.here[i]), bit(p.east[i]), bit(p.south_west[i]), bit(p.south[i]), bit(p.south_east[i])) *
            4 +
        c.here[i];
  }
}

void BlockContexts::MakeWithPrevious() {
  const Around& a = around_;
  const Coarser& c = coarser_;
  const Previous& p = previous_;
  auto& models = ready_.models;
  for (std::size_t i = 0; i < kBlock; ++i) {
    const int here = c.here[i];
    const int quarter = c.half_x[i] + 2 * c.half_y[i];
    const int north = a.north[i];
    models[10][i] = Join(3, p.east[i], p.south[i], p.west[i], p.north[i]) * 64 + here * 16 + p.state[i];
    models[11][i] = Join(3, north, p.east[i], p.south_east[i]) * 64 + quarter * 16 + here * 4 + p.last[i];
    models[13][i] = Join(3, north, a.north_east[i]) * 256 + c.memory[i] * 64 + here * 16 + p.state[i];
    ready_.weight_sets[0][i] = (here == kNoCoarser ? 0 : here) * 16 + p.state[i];
    ready_.refinement[i] = north * 16 + here * 4 + p.last[i];
  }
}

}  // namespace moondb
