// The cells of the merged map, as small pictures that the map draws.

const kBitmapsMax = 512;
const kMarksMax = 4; // Changes of a tile that are marked at a time.
export const kMarked_ms = 60_000;
const kOverviewCells = 8; // Side of a tile in the overview.
const kOverviewSideMax = 4096;

// Returns the red, green, blue of a colour such as "#1a2b3c".
function channels(color) {
  return [1, 3, 5].map((at) => parseInt(color.slice(at, at + 2), 16));
}

function pictureOf(side, colorOf) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = side;
  const context = canvas.getContext("2d");
  const image = context.createImageData(side, side);
  for (let row = 0; row < side; ++row) {
    for (let column = 0; column < side; ++column) {
      const color = colorOf(column, row);
      if (color === null) continue;
      // Row 0 of a picture is its top, and row 0 of a tile the smallest y.
      const at = 4 * ((side - 1 - row) * side + column);
      image.data.set(color, at);
      image.data[at + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

export class Tiles {
  constructor() {
    this.begin(null);
    this.colors = [[0, 0, 0], [0, 0, 0], [0, 0, 0]];
  }

  begin(head) {
    this.head = head;
    this.tiles = new Map(); // "x,y" to {x, y, cells, marks}.
    this.bitmaps = new Map(); // The same keys; the most recently used ones last.
    this.overview = null;
    this.bounds = null; // Of the tiles: [x min, y min, x max, y max].
  }

  // Colours of unknown, free and hazard cells.
  setColors(colors) {
    this.colors = colors.map(channels);
    this.bitmaps.clear();
    this.overview = null;
  }

  get cell_m() { return this.head === null ? 0.05 : this.head.resolution_um * 1e-6; }
  get tile_m() { return this.head === null ? 1 : this.cell_m * this.head.tile_cells; }

  set(x, y, cells) {
    if (this.head === null || cells.length !== this.head.tile_cells ** 2) return;
    const key = `${x},${y}`;
    const old = this.tiles.get(key);
    const marks = old === undefined ? [] : this.marksAfter(old, cells);
    this.tiles.set(key, { x, y, cells, marks });
    this.bitmaps.delete(key);
    this.overview = null;
    const [x0, y0, x1, y1] = this.bounds ?? [x, y, x, y];
    this.bounds = [Math.min(x0, x), Math.min(y0, y), Math.max(x1, x), Math.max(y1, y)];
  }

  marksAfter(old, cells) {
    const changed = [];
    for (let i = 0; i < cells.length; ++i) {
      if (cells[i] !== old.cells[i]) changed.push(i);
    }
    const now = performance.now();
    const marks = old.marks.filter((mark) => now - mark.at < kMarked_ms);
    if (changed.length > 0) marks.push({ at: now, cells: changed });
    return marks.slice(-kMarksMax);
  }

  bitmap(key, tile) {
    let bitmap = this.bitmaps.get(key);
    this.bitmaps.delete(key);
    if (bitmap === undefined) {
      const side = this.head.tile_cells;
      bitmap = pictureOf(side, (column, row) => {
        const value = tile.cells[row * side + column];
        return value === 0 ? null : this.colors[value] ?? null;
      });
      if (this.bitmaps.size >= kBitmapsMax) this.bitmaps.delete(this.bitmaps.keys().next().value);
    }
    this.bitmaps.set(key, bitmap);
    return bitmap;
  }

  // One picture of all tiles, with the worst cell of each part: a hazard stays visible.
  overviewPicture() {
    if (this.overview !== null) return this.overview;
    const [x0, y0, x1, y1] = this.bounds;
    const canvas = document.createElement("canvas");
    canvas.width = Math.min(kOverviewSideMax, (x1 - x0 + 1) * kOverviewCells);
    canvas.height = Math.min(kOverviewSideMax, (y1 - y0 + 1) * kOverviewCells);
    const context = canvas.getContext("2d");
    const side = this.head.tile_cells;
    const step = Math.max(1, Math.floor(side / kOverviewCells));
    for (const tile of this.tiles.values()) {
      const picture = pictureOf(Math.floor(side / step), (column, row) => {
        let worst = 0;
        for (let y = row * step; y < (row + 1) * step; ++y) {
          for (let x = column * step; x < (column + 1) * step; ++x) worst = Math.max(worst, tile.cells[y * side + x]);
        }
        return worst === 0 ? null : this.colors[worst] ?? null;
      });
      const width = canvas.width / (x1 - x0 + 1);
      const height = canvas.height / (y1 - y0 + 1);
      context.drawImage(picture, (tile.x - x0) * width, (y1 - tile.y) * height, width, height);
    }
    this.overview = canvas;
    return canvas;
  }

  // Draws the tiles. `toScreen` turns metres into pixels, `scale` is in pixels per metre.
  draw(context, toScreen, scale, width, height) {
    if (this.bounds === null) return;
    context.imageSmoothingEnabled = false;
    const size = this.tile_m * scale;
    if (size < 2 * kOverviewCells) {
      const [x0, y0, x1, y1] = this.bounds;
      const [left, top] = toScreen(x0 * this.tile_m, (y1 + 1) * this.tile_m);
      context.drawImage(this.overviewPicture(), left, top, (x1 - x0 + 1) * size, (y1 - y0 + 1) * size);
      return;
    }
    for (const [key, tile] of this.tiles) {
      const [left, top] = toScreen(tile.x * this.tile_m, (tile.y + 1) * this.tile_m);
      if (left > width || top > height || left + size < 0 || top + size < 0) continue;
      // Whole pixels, so that no seam is left between two tiles.
      const x = Math.round(left);
      const y = Math.round(top);
      context.drawImage(this.bitmap(key, tile), x, y, Math.round(left + size) - x, Math.round(top + size) - y);
    }
  }

  // Draws the cells that changed in the last minute. Returns whether there is one.
  drawMarks(context, toScreen, scale, color) {
    const now = performance.now();
    const side = this.head?.tile_cells ?? 1;
    const size = Math.max(1, this.cell_m * scale);
    let isAny = false;
    context.fillStyle = color;
    for (const tile of this.tiles.values()) {
      for (const mark of tile.marks) {
        if (now - mark.at >= kMarked_ms) continue;
        isAny = true;
        context.globalAlpha = 0.4 * (1 - (now - mark.at) / kMarked_ms) + 0.15;
        for (const i of mark.cells) {
          const [x, y] = toScreen(tile.x * this.tile_m + (i % side) * this.cell_m,
            tile.y * this.tile_m + (Math.floor(i / side) + 1) * this.cell_m);
          context.fillRect(x, y, size, size);
        }
      }
    }
    context.globalAlpha = 1;
    return isAny;
  }
}
