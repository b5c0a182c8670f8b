// Follows the server: asks what changed, and fetches each changed part once, the most urgent one first. The two requests
// in flight are all that a slow link has to carry, and nothing waits in a queue: a part that changes twice is fetched
// once.

const kPartOrder = ["team", "poses", "timeline", "events", "lines"];
const kTilesAfter = 1; // Tiles come after this index of kPartOrder.
const kTilesMax = 64; // In one answer, as the server allows.
const kTileBytesMax = 512 * 1024;
const kTimeout_ms = 60_000;
const kChangesTimeout_ms = 30_000; // The server waits up to 20 s for a change.
const kProbe_ms = 5_000; // After this time without an answer, a probe tells a quiet server from a dead connection.
const kBackoffMax_ms = 10_000;

const inFlight = new Set(); // AbortControllers.

async function get(path, timeout_ms = kTimeout_ms, options = {}) {
  const abort = new AbortController();
  const timer = setTimeout(() => abort.abort(), timeout_ms);
  inFlight.add(abort);
  try {
    const answer = await fetch(path, { ...options, signal: abort.signal });
    if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
    return path.startsWith("/tiles") ? await answer.arrayBuffer() : await answer.json();
  } finally {
    clearTimeout(timer);
    inFlight.delete(abort);
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
    this.heard_at = performance.now();
    this.isCut = false;
    this.retries = []; // Each ends one pause.
  }

  start() {
    this.repeat(() => this.pollChanges());
    this.repeat(() => this.fetchNext());
    this.repeat(() => this.probe());
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
        await this.pauseUnlessHeard(wait);
        wait = Math.min(2 * wait, kBackoffMax_ms);
      }
    }
  }

  async pollChanges() {
    const changes = await get(`/api/changes?since=${this.since}`, kChangesTimeout_ms);
    this.hear();
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

  // Waits before the next try, but not longer than until the server answers another request.
  pauseUnlessHeard(ms) {
    return new Promise((done) => {
      const timer = setTimeout(done, ms);
      this.retries.push(() => { clearTimeout(timer); done(); });
    });
  }

  hear() {
    this.retries.splice(0).forEach((retry) => retry());
    this.heard_at = performance.now();
    this.sink.heard();
  }

  // Fetches the team if the server has been quiet. After a cut, the first answer ends the requests that the cut has
  // left hanging, because their connections recover only after the timeout.
  async probe() {
    await pause(1000);
    if (performance.now() - this.heard_at < kProbe_ms) return;
    const old = [...inFlight];
    const isSlow = this.isCut;
    this.isCut = true; // Until the probe is answered.
    const team = await get("/api/team", kProbe_ms).catch(() => null);
    if (team === null) return;
    this.isCut = false;
    if (isSlow) old.forEach((abort) => abort.abort());
    this.hear();
    this.sink.part("team", team);
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
      const value = await get(`/api/${part}`);
      this.hear();
      this.sink.part(part, value);
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
    this.hear();
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
    const answer = await fetch(`/api/why?x=${x_m}&y=${y_m}`, { signal: AbortSignal.timeout(kChangesTimeout_ms) });
    return await answer.json();
  } catch {
    return { error: { text: "moondb_view does not answer" } };
  }
}

export function switchAsk(isOn) {
  return get("/api/ask", kChangesTimeout_ms, {
    method: "POST", headers: { "Content-Type": "application/json" }, body: JSON.stringify({ is_on: isOn }),
  });
}
