// The cells of the merged map, as small pictures that the map draws.

const kPicturesMax = 256; // Of each kind: cells, and cells that changed. One takes 256 KiB for tiles of 256 cells.
const kMarksMax = 4; // Changes of a tile that are marked at a time.
const kMarkedCellsMax = 4_000_000; // Of all tiles. The oldest changes are forgotten first.
export const kMarked_ms = 60_000;
const kOverviewSide = 4096; // Pixels of the overview, at most.
const kOverviewCellsMax = 64; // Pixels of one tile's side in the overview, at most.
const kPaint_ms = 10; // Time in one frame to bring the overview up to date.

// Returns a colour such as "#1a2b3c" as a pixel of ImageData, read as a little-endian 32-bit number.
function pixelOf(color) {
  const value = parseInt(color.slice(1), 16);
  return (0xff000000 | (value & 0xff) << 16 | (value & 0xff00) | value >> 16) >>> 0;
}

// Returns the cells of a tile in fewer, larger cells with the greatest value of each: a hazard stays visible.
function shrink(cells, side, newSide) {
  if (newSide === side) return cells;
  const small = new Uint8Array(newSide * newSide);
  const columns = Uint16Array.from({ length: side }, (_, x) => Math.floor(x * newSide / side));
  for (let y = 0, i = 0; y < side; ++y) {
    const row = Math.floor(y * newSide / side) * newSide;
    for (let x = 0; x < side; ++x, ++i) {
      if (cells[i] > small[row + columns[x]]) small[row + columns[x]] = cells[i];
    }
  }
  return small;
}

// Returns the ImageData of cells. Row 0 of a picture is its top, and row 0 of a tile the smallest y.
function imageOf(cells, side, palette) {
  const image = new ImageData(side, side);
  const pixels = new Uint32Array(image.data.buffer);
  for (let y = 0; y < side; ++y) {
    const from = (side - 1 - y) * side;
    for (let x = 0; x < side; ++x) pixels[y * side + x] = palette[cells[from + x]] ?? 0;
  }
  return image;
}

function canvasOf(image) {
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [image.width, image.height];
  canvas.getContext("2d").putImageData(image, 0, 0);
  return canvas;
}

// Returns the picture with this key, and makes it the last one to be evicted.
function cached(pictures, key, make) {
  let picture = pictures.get(key);
  pictures.delete(key);
  if (picture === undefined) {
    if (pictures.size >= kPicturesMax) pictures.delete(pictures.keys().next().value);
    picture = make();
  }
  pictures.set(key, picture);
  return picture;
}

export class Tiles {
  constructor() {
    this.palette = [0, 0, 0];
    this.markPalette = [0, 0];
    this.begin(null);
  }

  begin(head) {
    this.head = head;
    this.tiles = new Map(); // "x,y" to {x, y, cells}.
    this.pictures = new Map(); // The same keys; the most recently used ones last.
    this.marks = []; // Changes {key, at, cells}, the oldest first.
    this.markedCells = 0; // Sum of the sizes in `marks`.
    this.markPictures = new Map(); // "x,y,side" to a picture of the cells that changed.
    this.overview = null;
    this.toPaint = new Set(); // Keys of tiles that the overview does not show yet.
    this.bounds = null; // Of the tiles: [x min, y min, x max, y max].
  }

  // Colours of unknown, free, hazard and changed cells. Unknown cells are transparent.
  setColors([, free, hazard, changed]) {
    this.palette = [0, pixelOf(free), pixelOf(hazard)];
    this.markPalette = [0, pixelOf(changed)];
    this.pictures.clear();
    this.markPictures.clear();
    this.toPaint = new Set(this.tiles.keys());
  }

  get side() { return this.head?.tile_cells ?? 1; }
  get cell_m() { return this.head === null ? 0.05 : this.head.resolution_um * 1e-6; }
  get tile_m() { return this.head === null ? 1 : this.cell_m * this.head.tile_cells; }

  set(x, y, cells) {
    if (this.head === null || cells.length !== this.side ** 2) return;
    const key = `${x},${y}`;
    const old = this.tiles.get(key);
    if (old !== undefined) this.mark(key, old.cells, cells);
    this.tiles.set(key, { x, y, cells });
    this.pictures.delete(key);
    this.toPaint.add(key);
    const [x0, y0, x1, y1] = this.bounds ?? [x, y, x, y];
    this.bounds = [Math.min(x0, x), Math.min(y0, y), Math.max(x1, x), Math.max(y1, y)];
  }

  mark(key, old, cells) {
    const changed = [];
    for (let i = 0; i < cells.length; ++i) {
      if (cells[i] !== old[i]) changed.push(i);
    }
    if (changed.length === 0) return;
    const ofTile = this.marks.filter((mark) => mark.key === key);
    if (ofTile.length >= kMarksMax) this.unmark(ofTile[0]);
    this.marks.push({ key, at: performance.now(), cells: Uint32Array.from(changed) });
    this.markedCells += changed.length;
    this.forgetMarkPictures(key);
    while (this.markedCells > kMarkedCellsMax) this.unmark(this.marks[0]);
  }

  unmark(mark) {
    this.marks.splice(this.marks.indexOf(mark), 1);
    this.markedCells -= mark.cells.length;
    this.forgetMarkPictures(mark.key);
  }

  forgetMarkPictures(key) {
    for (const side of [this.side, this.overview?.cells]) this.markPictures.delete(`${key},${side}`);
  }

  // Makes the overview large enough for all tiles, with room for twice as many in each direction.
  growOverview() {
    const [x0, y0, x1, y1] = this.bounds;
    const old = this.overview;
    if (old !== null && x0 >= old.x0 && y0 >= old.y0 && x1 < old.x0 + old.tiles && y1 < old.y0 + old.tiles) return;
    const needed = Math.max(x1 - x0, y1 - y0) + 1;
    let tiles = 8;
    while (tiles < needed) tiles *= 2;
    const [left, bottom] = [x0 - Math.floor((tiles - (x1 - x0 + 1)) / 2), y0 - Math.floor((tiles - (y1 - y0 + 1)) / 2)];
    const cells = Math.max(1, Math.min(kOverviewCellsMax, this.side, Math.floor(kOverviewSide / tiles)));
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = Math.min(kOverviewSide, tiles * cells);
    this.overview = { x0: left, y0: bottom, tiles, cells, canvas, context: canvas.getContext("2d") };
    this.markPictures.clear();
    this.toPaint = new Set(this.tiles.keys());
  }

  // Brings the overview up to date. Returns false if some tiles are left for the next frame.
  paintOverview() {
    this.growOverview();
    const { x0, y0, tiles, cells, context } = this.overview;
    const end = performance.now() + kPaint_ms;
    for (const key of this.toPaint) {
      if (performance.now() > end) return false;
      const tile = this.tiles.get(key);
      const image = imageOf(shrink(tile.cells, this.side, cells), cells, this.palette);
      context.putImageData(image, (tile.x - x0) * cells, (y0 + tiles - 1 - tile.y) * cells);
      this.toPaint.delete(key);
    }
    return true;
  }

  // The overview is exact enough while a tile has not many more pixels on the screen than in the overview.
  showsOverview(scale) {
    const { tiles, cells } = this.overview;
    return tiles * cells <= kOverviewSide && this.tile_m * scale < Math.max(8, 1.5 * cells);
  }

  // Draws the tiles. `toScreen` turns metres into pixels, `scale` is in pixels per metre. Returns false if the picture is
  // not complete yet.
  draw(context, toScreen, scale, width, height) {
    if (this.bounds === null) return true;
    context.imageSmoothingEnabled = false;
    this.growOverview();
    if (this.showsOverview(scale)) {
      const isComplete = this.paintOverview();
      const { x0, y0, tiles, canvas } = this.overview;
      const size = tiles * this.tile_m * scale;
      context.drawImage(canvas, ...toScreen(x0 * this.tile_m, (y0 + tiles) * this.tile_m), size, size);
      return isComplete;
    }
    for (const [key, place] of this.visible(toScreen, scale, width, height)) {
      const make = () => canvasOf(imageOf(this.tiles.get(key).cells, this.side, this.palette));
      context.drawImage(cached(this.pictures, key, make), ...place);
    }
    return true;
  }

  // Returns the keys of the tiles in the view with their places on the screen: left, top, width, height. The places are
  // whole pixels, because others leave a seam between two tiles.
  visible(toScreen, scale, width, height) {
    const size = this.tile_m * scale;
    const [left, top] = toScreen(0, 0);
    const [x0, y0, x1, y1] = this.bounds;
    const found = [];
    for (let y = Math.max(y0, Math.floor((top - height) / size)); y <= Math.min(y1, Math.floor(top / size)); ++y) {
      for (let x = Math.max(x0, Math.floor(-left / size)); x <= Math.min(x1, Math.floor((width - left) / size)); ++x) {
        const key = `${x},${y}`;
        if (!this.tiles.has(key)) continue;
        const [from, to] = [Math.round(left + x * size), Math.round(top - (y + 1) * size)];
        found.push([key, [from, to, Math.round(left + (x + 1) * size) - from, Math.round(top - y * size) - to]]);
      }
    }
    return found;
  }

  markPicture(key, side) {
    return cached(this.markPictures, `${key},${side}`, () => {
      const cells = new Uint8Array(this.side ** 2);
      for (const mark of this.marks) {
        if (mark.key === key) mark.cells.forEach((i) => { cells[i] = 1; });
      }
      return canvasOf(imageOf(shrink(cells, this.side, side), side, this.markPalette));
    });
  }

  // Draws the cells that changed in the last minute. Returns whether there is one.
  drawMarks(context, toScreen, scale, width, height) {
    const now = performance.now();
    while (this.marks.length > 0 && now - this.marks[0].at >= kMarked_ms) this.unmark(this.marks[0]);
    if (this.marks.length === 0) return false;
    const side = this.showsOverview(scale) ? this.overview.cells : this.side;
    const marked = new Set(this.marks.map(({ key }) => key));
    context.globalAlpha = 0.55;
    for (const [key, place] of this.visible(toScreen, scale, width, height)) {
      if (marked.has(key)) context.drawImage(this.markPicture(key, side), ...place);
    }
    context.globalAlpha = 1;
    return true;
  }
}
