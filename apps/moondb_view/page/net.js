// Follows the server: asks what changed, and fetches each changed part once, the most urgent one first. The two requests
// in flight are all that a slow link has to carry, and nothing waits in a queue: a part that changes twice is fetched
// once.

const kPartOrder = ["team", "poses", "timeline", "events", "lines"];
const kTilesAfter = 1; // Tiles come after this index of kPartOrder.
const kTilesMax = 64; // In one answer, as the server allows.
const kTileBytesMax = 512 * 1024;
const kTimeout_ms = 60_000;
const kBackoffMax_ms = 10_000;

async function get(path) {
  const abort = new AbortController();
  const timer = setTimeout(() => abort.abort(), kTimeout_ms);
  try {
    const answer = await fetch(path, { signal: abort.signal });
    if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
    return path.startsWith("/tiles") ? await answer.arrayBuffer() : await answer.json();
  } finally {
    clearTimeout(timer);
  }
}

const pause = (ms) => new Promise((done) => { setTimeout(done, ms); });

export class Feed {
  // `sink` has part(name, value), map(head), tile(x, y, cells), nearest(tiles, count), heard() and lost().
  constructor(sink) {
    this.sink = sink;
    this.wake = () => {};
    this.forget();
    this.mapId = null;
    this.tileCells = 1;
    this.instance = null;
  }

  start() {
    this.repeat(() => this.pollChanges());
    this.repeat(() => this.fetchNext());
  }

  forget() {
    this.since = 0;
    this.parts = new Set();
    this.tiles = new Map(); // "x,y" to [x, y, version].
  }

  async repeat(work) {
    for (let wait = 1000; ;) {
      try {
        await work();
        wait = 1000;
      } catch (error) {
        this.sink.lost(error);
        await pause(wait);
        wait = Math.min(2 * wait, kBackoffMax_ms);
      }
    }
  }

  async pollChanges() {
    const changes = await get(`/api/changes?since=${this.since}`);
    this.sink.heard();
    if (changes.instance !== this.instance) {
      const isFirst = this.instance === null;
      this.instance = changes.instance;
      this.mapId = null;
      this.forget();
      if (!isFirst) return; // The program started again, and counts from 0.
    }
    const mapId = changes.map?.id ?? null;
    if (mapId !== this.mapId) {
      this.mapId = mapId;
      this.tileCells = changes.map?.tile_cells ?? 1;
      this.tiles.clear();
      this.sink.map(changes.map);
    }
    for (const name of Object.keys(changes.resources)) this.parts.add(name);
    for (const tile of changes.tiles) this.tiles.set(`${tile[0]},${tile[1]}`, tile);
    this.since = changes.version;
    this.wake();
  }

  async fetchNext() {
    const part = kPartOrder.find((name) => this.parts.has(name));
    const isTileFirst = this.tiles.size > 0 && (part === undefined || kPartOrder.indexOf(part) > kTilesAfter);
    if (isTileFirst) return this.fetchTiles();
    if (part === undefined) {
      await new Promise((done) => { this.wake = done; });
      return undefined;
    }
    this.parts.delete(part);
    try {
      this.sink.part(part, await get(`/api/${part}`));
    } catch (error) {
      this.parts.add(part);
      throw error;
    }
    return undefined;
  }

  // Fetches the tiles next to the middle of the view, as many as one answer holds.
  async fetchTiles() {
    const mapId = this.mapId;
    const size = this.tileCells ** 2;
    const count = Math.max(1, Math.min(kTilesMax, Math.floor(kTileBytesMax / (size + 8))));
    const tiles = this.sink.nearest([...this.tiles.values()], count);
    const answer = new DataView(await get(`/tiles?map=${mapId}&at=${tiles.map(([x, y]) => `${x},${y}`).join(";")}`));
    if (mapId !== this.mapId) return;
    // A newer version that was announced meanwhile stays to be fetched.
    for (const tile of tiles) {
      const key = `${tile[0]},${tile[1]}`;
      if (this.tiles.get(key) === tile) this.tiles.delete(key);
    }
    for (let at = 0; at + 8 + size <= answer.byteLength; at += 8 + size) {
      this.sink.tile(answer.getInt32(at, true), answer.getInt32(at + 4, true), new Uint8Array(answer.buffer, at + 8, size));
    }
  }
}

// Asks why a cell is as it is. Returns the answer, or the error of the server or of the network as {error: {text}}.
export async function askWhy(x_m, y_m) {
  try {
    const answer = await fetch(`/api/why?x=${x_m}&y=${y_m}`);
    return await answer.json();
  } catch {
    return { error: { text: "moondb_view does not answer" } };
  }
}

export async function switchAsk(isOn) {
  await fetch("/api/ask", {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ is_on: isOn }),
  });
}
