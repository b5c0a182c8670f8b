// The answers, the tables, the curves and the events: texts from the server into elements of the page.
import { age, bytes, signed, utc } from "./format.js";

const kDim_s = 10; // Older values are dim.
const kOld_s = 60; // Still older ones are grey, with their age.

export const byId = (id) => document.getElementById(id);

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function setClass(element, name) {
  if (element.className !== name) element.className = name;
}

function child(parent, tag, index) {
  while (parent.children.length <= index) parent.append(document.createElement(tag));
  return parent.children[index];
}

// Makes the rows of a table body, and changes only what differs. A cell is {text, className, label, isHead, part}; `part`
// shades this part of it.
function fillRows(body, rows) {
  while (body.children.length > rows.length) body.lastElementChild.remove();
  rows.forEach((cells, i) => {
    const row = child(body, "tr", i);
    cells.forEach((cell, k) => {
      const tag = cell.isHead ? "th" : "td";
      let element = row.children[k];
      if (element === undefined || element.localName !== tag) {
        const made = document.createElement(tag);
        if (cell.isHead) made.scope = body.localName === "thead" ? "col" : "row";
        if (element === undefined) row.append(made);
        else element.replaceWith(made);
        element = made;
      }
      setText(element, cell.text);
      setClass(element, cell.className ?? "");
      if (cell.label === undefined) element.removeAttribute("aria-label");
      else element.setAttribute("aria-label", cell.label);
      const shade = cell.part === undefined ? "" : `linear-gradient(to right, var(--shade) ${Math.round(100 * cell.part)}%, transparent 0)`;
      if (element.style.backgroundImage !== shade) element.style.backgroundImage = shade;
    });
    while (row.children.length > cells.length) row.lastElementChild.remove();
  });
}

const kUnknown = { text: "–", className: "unknown", label: "unknown" };

// A value with its age: dim, then grey with the age.
function aged(text, age_s, className = "") {
  if (!Number.isFinite(age_s)) return { text, className };
  if (age_s > kOld_s) return { text: `${text} (${age(age_s)} ago)`, className: "old" };
  return { text, className: age_s > kDim_s ? "dim" : className };
}

export function showAnswers(answers) {
  for (const name of ["leader", "loss", "silent", "maps"]) {
    const answer = answers[name];
    const box = byId(`answer-${name}`);
    setText(box.querySelector("p"), answer.text);
    setClass(box, `answer ${answer.is_known ? (answer.is_good ? "is-good" : "is-bad") : "is-unknown"}`);
  }
}

export function showWhy(why) {
  const box = byId("answer-cell");
  const details = box.querySelector("details");
  if (why.error) {
    setText(box.querySelector("p"), `no answer: ${why.error.text}`);
    details.hidden = true;
    return;
  }
  setText(box.querySelector("p"), `(${why.x_m.toFixed(3)}, ${why.y_m.toFixed(3)}): ${why.text}`);
  const list = box.querySelector("ol");
  list.replaceChildren(...why.observations.map((said) => {
    const item = document.createElement("li");
    const when = said.time_s === null ? "" : `, ${utc(said.time_s)}`;
    const cells = said.resolution_m === null ? "" : `, cells of ${said.resolution_m} m`;
    item.textContent = `${said.is_winner ? "decides: " : ""}${said.value} by ${said.node}${when}${cells}` +
      `${said.remark ? `, ${said.remark}` : ""}`;
    return item;
  }));
  if (why.left_out > 0) list.append(Object.assign(document.createElement("li"), { textContent: `and ${why.left_out} more` }));
  details.hidden = why.observations.length === 0;
}

function linkCell({ state, heard_s }, elapsed_s) {
  if (state === "self") return { text: "this agent" };
  if (state === "unknown") return kUnknown;
  if (heard_s === null) return { text: state === "silent" ? "silent, never heard" : state, className: state === "silent" ? "bad" : "" };
  if (state === "silent") return { text: `silent ${age(heard_s + elapsed_s)}`, className: "bad" };
  return { text: `${age(heard_s + elapsed_s)} ago` };
}

export function showTeam(team, elapsed_s) {
  fillRows(byId("team-table").tBodies[0], team.agents.map((agent) => [
    { text: agent.name, isHead: true, className: agent.is_left ? "old" : "" },
    agent.role === "" ? kUnknown : { text: agent.role.replaceAll("_", " ") },
    agent.is_left ? { text: "" } : linkCell(agent.link, elapsed_s),
    agent.battery === null ? kUnknown : aged(`${Math.round(100 * agent.battery.ratio)} %`, agent.battery.age_s + elapsed_s,
      agent.battery.ratio < 0.2 ? "bad" : ""),
    agent.clock === null ? kUnknown : aged(signed(agent.clock.offset_s), agent.clock.age_s + elapsed_s,
      Math.abs(agent.clock.offset_s) > 10 ? "bad" : ""),
    agent.disk === null ? kUnknown : aged(bytes(agent.disk.free_bytes), agent.disk.age_s + elapsed_s),
    { text: agent.lease },
  ]));
}

// `isKeeper`: the holder leads or is the designated survivor, so it should hold everything.
function holdingCell(cell, isKeeper) {
  if (cell === null) return kUnknown;
  if (cell.missing === null) return { text: String(cell.held) };
  const eta = cell.eta_s === null ? "" : `, ${age(cell.eta_s)} left`;
  const all = cell.held + cell.missing;
  if (cell.missing === 0) return { text: String(cell.held), part: all === 0 ? 0 : 1 };
  return { text: `${cell.held}, lacks ${cell.missing}${eta}`, className: isKeeper ? "bad" : "", part: cell.held / all };
}

export function showHoldings({ holdings: { origins, rows }, agents }, elapsed_s) {
  const keepers = agents.filter(({ role }) => role === "leader" || role === "designated_survivor").map(({ name }) => name);
  const table = byId("holdings");
  fillRows(table.tHead, [[{ text: "Held by", isHead: true }, ...origins.map((text) => ({ text, isHead: true }))]]);
  fillRows(table.tBodies[0], rows.map((row) => {
    const old = Number.isFinite(row.age_s) && row.age_s + elapsed_s > kOld_s ? ` (${age(row.age_s + elapsed_s)} ago)` : "";
    return [{ text: row.agent + old, isHead: true, className: old ? "old" : "" }, ...row.cells.map((cell) => holdingCell(cell, keepers.includes(row.agent)))];
  }));
}

export function showAsk(ask) {
  byId("ask").setAttribute("aria-checked", String(ask.is_on));
  const spent = ask.spent_bytes > 0 ? `; ${bytes(ask.spent_bytes)} sent so far` : "";
  setText(byId("ask-cost"), `Asks the other agents every ${age(ask.period_s)}, about ${bytes(ask.cost_bytes)} each time by radio if ` +
    `they are on other machines${spent}.${ask.trouble === "" ? "" : ` No answer from ${ask.trouble}.`}`);
}

export function showFindings(findings) {
  const list = byId("findings");
  while (list.children.length > findings.length) list.lastElementChild.remove();
  findings.forEach(({ agent, text }, i) => setText(child(list, "li", i), `${agent}: ${text}`));
  list.hidden = findings.length === 0;
}

export function showEvents(events) {
  const severity = byId("filter-severity").value;
  const agent = byId("filter-agent").value;
  const text = byId("filter-text").value.toLowerCase();
  const isShown = (event) => (severity === "" || event.severity === "error" || event.severity === severity) &&
    (agent === "" || event.agent === agent) && (text === "" || `${event.kind} ${event.text} ${event.by}`.toLowerCase().includes(text));
  const shown = events.filter(isShown);
  fillRows(byId("events").tBodies[0], shown.map((event) => [
    { text: utc(event.time_s) }, { text: event.agent },
    { text: event.kind, className: event.severity === "info" ? "" : "bad" },
    { text: event.by ? `${event.text} (${event.by})` : event.text },
  ]));
  setText(byId("events-count"), `${shown.length} of the newest ${events.length} events`);
}

export function showAgentFilter(names) {
  const select = byId("filter-agent");
  const now = [...select.options].slice(1).map((option) => option.value);
  if (now.join("\n") === names.join("\n")) return;
  while (select.options.length > 1) select.remove(1);
  for (const name of names) select.add(new Option(name, name));
}

const kCurves = [["created", "made"], ["leader", "the leader"], ["survivor", "the survivor"], ["ground", "the base station"]];

// Returns the parts of a curve between unknown values, as points of an SVG of 300 x 56.
function partsOf(times, values, most) {
  const [start, end] = [times[0], Math.max(times[times.length - 1], times[0] + 1)];
  const parts = [[]];
  values.forEach((value, i) => {
    if (!Number.isFinite(value)) {
      parts.push([]);
      return;
    }
    parts[parts.length - 1].push(`${(300 * (times[i] - start) / (end - start)).toFixed(1)},${(54 - 52 * value / most).toFixed(1)}`);
  });
  return parts.filter((part) => part.length > 1);
}

function timelineSummary(agent) {
  const newest = (name) => agent[name][agent[name].length - 1] ?? null;
  const made = newest("created");
  const holds = kCurves.slice(1).map(([name, holder]) => `${holder} ${newest(name) ?? "unknown"}`);
  return `${made === null ? "made: unknown" : `${made} made`}; held: ${holds.join(", ")}`;
}

export function showTimelines({ agents }) {
  const box = byId("timelines");
  while (box.children.length > agents.length) box.lastElementChild.remove();
  agents.forEach((agent, i) => {
    const figure = child(box, "div", i);
    figure.className = "timeline";
    if (figure.children.length === 0) {
      const title = document.createElement("h3");
      title.append(document.createElement("b"), " ", document.createElement("span"));
      const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
      svg.setAttribute("viewBox", "0 0 300 56");
      svg.setAttribute("preserveAspectRatio", "none");
      svg.setAttribute("aria-hidden", "true"); // The summary beside it says the same.
      figure.append(title, svg);
    }
    setText(figure.querySelector("b"), agent.name);
    setText(figure.querySelector("span"), timelineSummary(agent));
    const most = Math.max(1, ...kCurves.flatMap(([name]) => agent[name]).filter(Number.isFinite));
    figure.querySelector("svg").replaceChildren(...kCurves.toReversed().flatMap(([name]) =>
      partsOf(agent.time_s, agent[name], most).map((points) => {
        const line = document.createElementNS("http://www.w3.org/2000/svg", "polyline");
        line.setAttribute("class", name);
        line.setAttribute("points", points.join(" "));
        return line;
      })));
  });
}
