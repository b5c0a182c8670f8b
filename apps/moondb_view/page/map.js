// The map: tiles, lines, trajectories and robots on one canvas, with zoom, pan and a cursor for the keyboard.
import { age } from "./format.js";
import { Tiles } from "./tiles.js";

const kScaleMin = 0.2; // Pixels per metre.
const kScaleMax = 1000;
const kSilent_s = 60; // After this time, a robot's place is an old one.
const kLabelHeight = 17;
// Colours that people with any colour vision can tell apart (Okabe and Ito 2008), darker on the light theme.
const kAgentColors = {
  light: ["#0072b2", "#a34700", "#00694b", "#8f3f71", "#6b5b00", "#1b6fa8", "#333333", "#5c3d99"],
  dark: ["#6cb8ef", "#f0a35e", "#4fd1a5", "#e7a3cb", "#f0e442", "#9bd3f5", "#f2f2f2", "#c3aef2"],
};
const kScaleBarSteps_m = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000];

export class TeamMap {
  // `ask` is called with the place of a cell in metres. `silent` returns the names of silent agents, `now_s` the team's
  // time.
  constructor(canvas, { ask, silent, now_s }) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.ask = ask;
    this.silent = silent;
    this.now_s = now_s;
    this.tiles = new Tiles();
    this.agents = [];
    this.lines = [];
    this.shown = { range: true, closure: true, match: true };
    this.center = [0, 0];
    this.scale = 20;
    this.isFitted = true; // Until the user moves the view, it follows the map's size.
    this.cursor = null; // Place of the keyboard's cursor, in metres.
    this.picked = null; // The cell that was asked about.
    this.isDrawn = true;
    this.pointers = new Map();
    this.setTheme("light");
    this.listen();
  }

  setTheme(theme) {
    this.theme = theme;
    const style = getComputedStyle(document.documentElement);
    this.color = (name) => style.getPropertyValue(`--${name}`).trim();
    this.tiles.setColors(["cell-unknown", "cell-free", "cell-hazard", "cell-changed"].map(this.color));
    this.redraw();
  }

  begin(head) { this.tiles.begin(head); this.redraw(); }
  setTile(x, y, cells) { this.tiles.set(x, y, cells); this.redraw(); }
  setAgents(agents) { this.agents = agents; this.redraw(); }
  setLines(lines) { this.lines = lines; this.redraw(); }
  show(kind, isShown) { this.shown[kind] = isShown; this.redraw(); }

  // Returns the tiles next to the middle of the view.
  nearest(tiles, count) {
    if (tiles.length <= count) return tiles;
    const distance = ([x, y]) => Math.hypot((x + 0.5) * this.tiles.tile_m - this.center[0],
      (y + 0.5) * this.tiles.tile_m - this.center[1]);
    return tiles.map((tile) => [distance(tile), tile]).sort(([a], [b]) => a - b).slice(0, count).map(([, tile]) => tile);
  }

  toScreen = (x_m, y_m) => [
    this.width / 2 + (x_m - this.center[0]) * this.scale, this.height / 2 - (y_m - this.center[1]) * this.scale,
  ];
  toMetres = (x, y) => [
    this.center[0] + (x - this.width / 2) / this.scale, this.center[1] - (y - this.height / 2) / this.scale,
  ];

  redraw() {
    if (!this.isDrawn) return;
    this.isDrawn = false;
    requestAnimationFrame(() => { this.isDrawn = true; this.draw(); });
  }

  // Extent of all that is drawn, in metres.
  extent() {
    const places = [];
    if (this.tiles.bounds !== null) {
      const [x0, y0, x1, y1] = this.tiles.bounds.map((value) => value * this.tiles.tile_m);
      places.push([x0, y0], [x1 + this.tiles.tile_m, y1 + this.tiles.tile_m]);
    }
    for (const agent of this.agents) {
      if (agent.is_placed && agent.x_m.length > 0) agent.x_m.forEach((x, i) => places.push([x, agent.y_m[i]]));
    }
    const finite = places.filter(([x, y]) => Number.isFinite(x) && Number.isFinite(y));
    if (finite.length === 0) return null;
    return finite.reduce(([x0, y0, x1, y1], [x, y]) => [Math.min(x0, x), Math.min(y0, y), Math.max(x1, x), Math.max(y1, y)],
      [Infinity, Infinity, -Infinity, -Infinity]);
  }

  fit() {
    const extent = this.extent();
    if (extent === null || this.width === 0) return;
    const [x0, y0, x1, y1] = extent;
    this.center = [(x0 + x1) / 2, (y0 + y1) / 2];
    const scale = 0.94 * Math.min(this.width / Math.max(1, x1 - x0), this.height / Math.max(1, y1 - y0));
    this.scale = Math.min(kScaleMax, Math.max(kScaleMin, scale));
  }

  zoom(factor, x = this.width / 2, y = this.height / 2) {
    this.isFitted = false;
    const [x_m, y_m] = this.toMetres(x, y);
    this.scale = Math.min(kScaleMax, Math.max(kScaleMin, this.scale * factor));
    const [newX, newY] = this.toMetres(x, y);
    this.center = [this.center[0] + x_m - newX, this.center[1] + y_m - newY];
    this.redraw();
  }

  listen() {
    const { canvas } = this;
    new ResizeObserver(() => this.redraw()).observe(canvas);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * 0.0015), event.offsetX, event.offsetY);
    }, { passive: false });
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, { x: event.offsetX, y: event.offsetY, way: 0 });
    });
    canvas.addEventListener("pointermove", (event) => this.move(event));
    canvas.addEventListener("pointerup", (event) => {
      const pointer = this.pointers.get(event.pointerId);
      this.pointers.delete(event.pointerId);
      if (pointer !== undefined && pointer.way < 6 && this.pointers.size === 0) {
        this.pick(this.toMetres(event.offsetX, event.offsetY));
      }
    });
    canvas.addEventListener("pointercancel", (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener("keydown", (event) => this.key(event));
    canvas.addEventListener("focus", () => this.redraw());
    canvas.addEventListener("blur", () => this.redraw());
  }

  move(event) {
    const pointer = this.pointers.get(event.pointerId);
    if (pointer === undefined) return;
    const [dx, dy] = [event.offsetX - pointer.x, event.offsetY - pointer.y];
    if (this.pointers.size === 2) {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)[1];
      const before = Math.hypot(pointer.x - other.x, pointer.y - other.y);
      const after = Math.hypot(event.offsetX - other.x, event.offsetY - other.y);
      if (before > 0) this.zoom(after / before, (event.offsetX + other.x) / 2, (event.offsetY + other.y) / 2);
    } else if (pointer.way + Math.hypot(dx, dy) >= 6) {
      this.isFitted = false;
      this.center = [this.center[0] - dx / this.scale, this.center[1] + dy / this.scale];
      this.redraw();
    }
    Object.assign(pointer, { x: event.offsetX, y: event.offsetY, way: pointer.way + Math.hypot(dx, dy) });
  }

  key(event) {
    const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (event.key in steps) {
      const pixels = event.shiftKey ? 1 : 16;
      const step_m = Math.max(this.tiles.cell_m, pixels / this.scale);
      const [x, y] = this.cursor ?? this.center;
      this.cursor = [x + steps[event.key][0] * step_m, y + steps[event.key][1] * step_m];
      this.followCursor();
    } else if (event.key === "Enter" || event.key === " ") {
      this.pick(this.cursor ?? this.center);
    } else if (event.key === "+" || event.key === "=") {
      this.zoom(1.4);
    } else if (event.key === "-") {
      this.zoom(1 / 1.4);
    } else {
      return;
    }
    event.preventDefault();
    this.redraw();
  }

  // Moves the view if the cursor has left it.
  followCursor() {
    const [x, y] = this.toScreen(...this.cursor);
    if (x > 20 && y > 20 && x < this.width - 20 && y < this.height - 20) return;
    this.isFitted = false;
    this.center = [...this.cursor];
  }

  pick(place) {
    this.picked = place;
    this.ask(...place);
    this.redraw();
  }

  draw() {
    const { canvas, context } = this;
    const ratio = window.devicePixelRatio || 1;
    [this.width, this.height] = [canvas.clientWidth, canvas.clientHeight];
    if (this.width === 0) return;
    if (canvas.width !== Math.round(this.width * ratio) || canvas.height !== Math.round(this.height * ratio)) {
      [canvas.width, canvas.height] = [Math.round(this.width * ratio), Math.round(this.height * ratio)];
    }
    if (this.isFitted) this.fit();
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = this.color("cell-unknown");
    context.fillRect(0, 0, this.width, this.height);
    if (!this.tiles.draw(context, this.toScreen, this.scale, this.width, this.height)) this.redraw();
    this.tiles.drawMarks(context, this.toScreen, this.scale, this.width, this.height);
    this.drawLines();
    this.drawAgents();
    this.drawPlaces();
    this.drawScale();
  }

  drawLines() {
    const { context } = this;
    for (const [kind, x0, y0, x1, y1, isRejected] of this.lines) {
      if (!this.shown[kind]) continue;
      context.strokeStyle = this.color(isRejected ? "line-rejected" : `line-${kind}`);
      context.setLineDash(isRejected ? [5, 4] : []);
      context.globalAlpha = kind === "range" && !isRejected ? 0.45 : 0.9;
      context.lineWidth = kind === "range" ? 1 : 2;
      context.beginPath();
      context.moveTo(...this.toScreen(x0, y0));
      context.lineTo(...this.toScreen(x1, y1));
      context.stroke();
    }
    context.setLineDash([]);
    context.globalAlpha = 1;
  }

  drawAgents() {
    const { context } = this;
    const silent = this.silent();
    const labels = [];
    this.agents.forEach((agent, index) => {
      if (!agent.is_placed || agent.x_m.length === 0) return;
      const last = agent.x_m.length - 1;
      const old_s = this.now_s() - agent.time_s[last];
      const isSilent = silent.includes(agent.name);
      const color = isSilent ? this.color("soft") : kAgentColors[this.theme][index % kAgentColors[this.theme].length];
      for (const [width, stroke] of [[5, this.color("panel")], [2.5, color]]) {
        context.strokeStyle = stroke;
        context.lineWidth = width;
        context.lineJoin = "round";
        context.beginPath();
        agent.x_m.forEach((x, i) => context.lineTo(...this.toScreen(x, agent.y_m[i])));
        context.stroke();
      }
      const place = this.toScreen(agent.x_m[last], agent.y_m[last]);
      this.drawMarker(place, agent.yaw_rad[last], color);
      const when = old_s > kSilent_s ? `, ${age(old_s)} ago` : "";
      labels.push({ place, text: `${agent.name}${when}${isSilent ? ", silent" : ""}`, color });
    });
    this.drawLabels(labels);
  }

  drawMarker([x, y], yaw_rad, color) {
    const { context } = this;
    context.save();
    context.translate(x, y);
    context.rotate(-yaw_rad);
    context.beginPath();
    for (const [ahead, left] of [[11, 0], [-7, 7], [-3, 0], [-7, -7]]) context.lineTo(ahead, -left);
    context.closePath();
    context.fillStyle = color;
    context.strokeStyle = this.color("panel");
    context.lineWidth = 2;
    context.stroke();
    context.fill();
    context.restore();
  }

  // Puts each label beside its robot, where it covers no other label.
  drawLabels(labels) {
    const { context } = this;
    context.font = "600 12px system-ui, sans-serif";
    context.textBaseline = "middle";
    const taken = [];
    for (const { place: [x, y], text, color } of labels) {
      const width = context.measureText(text).width + 10;
      const spots = [];
      for (let away = 0; away < 8; ++away) {
        const dy = away * (kLabelHeight + 2);
        spots.push([x + 12, y - kLabelHeight / 2 - dy], [x - 12 - width, y - kLabelHeight / 2 - dy],
          [x + 12, y - kLabelHeight / 2 + dy], [x - 12 - width, y - kLabelHeight / 2 + dy]);
      }
      const isFree = ([left, top]) => left >= 0 && top >= 0 && left + width <= this.width && top + kLabelHeight <= this.height &&
        taken.every((other) => left + width < other[0] || other[0] + other[2] < left || top + kLabelHeight < other[1] ||
          other[1] + kLabelHeight < top);
      const [left, top] = spots.find(isFree) ?? spots[0];
      taken.push([left, top, width]);
      context.fillStyle = this.color("panel");
      context.strokeStyle = color;
      context.lineWidth = 1.5;
      context.beginPath();
      context.roundRect(left, top, width, kLabelHeight, 3);
      context.fill();
      context.stroke();
      context.fillStyle = this.color("text");
      context.fillText(text, left + 5, top + kLabelHeight / 2 + 0.5);
    }
  }

  // Draws the cursor, and the cell that was asked about.
  drawPlaces() {
    const { context } = this;
    const cross = ([x, y], size) => {
      for (const [width, color] of [[4, this.color("panel")], [2, this.color("accent")]]) {
        context.strokeStyle = color;
        context.lineWidth = width;
        context.beginPath();
        context.moveTo(x - size, y);
        context.lineTo(x + size, y);
        context.moveTo(x, y - size);
        context.lineTo(x, y + size);
        context.stroke();
      }
    };
    if (this.picked !== null) cross(this.toScreen(...this.picked), 6);
    if (document.activeElement === this.canvas) cross(this.toScreen(...(this.cursor ?? this.center)), 12);
  }

  drawScale() {
    const { context } = this;
    const length_m = kScaleBarSteps_m.findLast((step) => step * this.scale <= 140) ?? kScaleBarSteps_m[0];
    const [x, y] = [12, this.height - 14];
    const width = length_m * this.scale;
    const text = length_m < 1 ? `${Math.round(length_m * 100)} cm` : length_m < 1000 ? `${length_m} m` : `${length_m / 1000} km`;
    context.font = "600 12px system-ui, sans-serif";
    context.textBaseline = "alphabetic";
    context.fillStyle = this.color("panel");
    context.globalAlpha = 0.85;
    context.fillRect(x - 6, y - 22, Math.max(width, context.measureText(text).width) + 12, 30);
    context.fillRect(this.width - 34, 8, 26, 38);
    context.globalAlpha = 1;
    context.fillStyle = context.strokeStyle = this.color("text");
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(x, y - 4);
    context.lineTo(x, y);
    context.lineTo(x + width, y);
    context.lineTo(x + width, y - 4);
    context.stroke();
    context.fillText(text, x, y - 8);
    context.fillText("N", this.width - 25, 40);
    context.beginPath();
    context.moveTo(this.width - 21, 12);
    context.lineTo(this.width - 27, 26);
    context.lineTo(this.width - 15, 26);
    context.fill();
  }
}
