// The page of moondb_view: joins the feed of the server with the map and the panels.
import { age } from "./format.js";
import { TeamMap } from "./map.js";
import { Feed, askWhy, switchAsk } from "./net.js";
import {
  byId, showAgentFilter, showAnswers, showAsk, showEvents, showFindings, showHoldings, showTeam, showTimelines, showWhy,
} from "./panels.js";

const kSilentServer_s = 8;

const state = {
  team: null,
  team_at: 0, // performance.now() when it came.
  heard_at: performance.now(),
  events: [],
  unplaced: [],
  frame_of: "",
  asked: 0, // Counts questions about cells; only the last one's answer is shown.
};

const sinceTeam_s = () => (state.team === null ? 0 : (performance.now() - state.team_at) / 1000);
const now_s = () => (state.team === null ? Date.now() / 1000 : state.team.time_s + sinceTeam_s());

async function ask(x_m, y_m) {
  const number = ++state.asked;
  byId("answer-cell").querySelector("p").textContent = `asking about (${x_m.toFixed(2)}, ${y_m.toFixed(2)})`;
  const why = await askWhy(x_m, y_m);
  if (number === state.asked) showWhy(why);
}

const map = new TeamMap(byId("map"), { ask, silent: () => state.team?.answers.silent.agents ?? [], now_s });

function showNote() {
  const notes = [];
  if (state.frame_of !== "") notes.push(`This is the map of ${state.frame_of} alone, in its own frame: it is not placed yet.`);
  const count = state.unplaced.length;
  if (count > 0) {
    notes.push(`${count} ${count === 1 ? "robot is" : "robots are"} not shown: not placed yet (${state.unplaced.join(", ")}).`);
  }
  const note = byId("map-note");
  const text = notes.join(" ");
  if (note.textContent !== text) note.textContent = text;
  note.hidden = notes.length === 0;
}

// Returns the sentence on what does not answer, or an empty one, and the age of the data. Screen readers read the sentence
// once. The age changes each second, so it stands outside the alert.
function trouble() {
  const silent_s = (performance.now() - state.heard_at) / 1000;
  if (silent_s > kSilentServer_s) return ["No answer from moondb_view. The page shows old data.", `Last answer: ${age(silent_s)} ago.`];
  if (state.team === null) return ["", ""];
  const { source, agent } = state.team;
  if (!source.is_reachable) {
    const old = source.age_s === null ? "" : `Last answer: ${age(source.age_s + sinceTeam_s())} ago.`;
    return [`${agent} does not answer: ${source.text}.`, old];
  }
  return ["", ""];
}

function showAges() {
  const [text, old] = trouble();
  byId("banner").hidden = text === "";
  if (byId("banner-text").textContent !== text) byId("banner-text").textContent = text;
  byId("banner-age").textContent = old;
  document.body.classList.toggle("is-stale", text !== "");
  if (state.team === null) return;
  showTeam(state.team, sinceTeam_s());
  showHoldings(state.team, sinceTeam_s());
}

function showTeamPart(team) {
  state.team = team;
  state.team_at = performance.now();
  document.title = `${team.team}: moondb`;
  byId("team-name").textContent = team.team;
  byId("source-line").textContent = `by the records of ${team.agent}; ${team.viewers} ${team.viewers === 1 ? "viewer" : "viewers"}`;
  showAnswers(team.answers);
  showAsk(team.ask);
  showFindings(team.findings);
  showAgentFilter(team.agents.map(({ name }) => name));
  showAges();
  map.redraw();
}

const parts = {
  team: showTeamPart,
  poses({ agents }) {
    state.unplaced = agents.filter(({ is_placed }) => !is_placed).map(({ name }) => name);
    map.setAgents(agents);
    showNote();
  },
  lines({ lines }) { map.setLines(lines); },
  timeline: showTimelines,
  events({ events }) {
    state.events = events;
    showEvents(events);
  },
};

const feed = new Feed({
  part: (name, value) => parts[name]?.(value),
  map(head) {
    state.frame_of = head?.frame_of ?? "";
    map.begin(head);
    showNote();
  },
  tile: (x, y, cells) => map.setTile(x, y, cells),
  nearest: (tiles, count) => map.nearest(tiles, count),
  heard() { state.heard_at = performance.now(); },
  lost() {}, // The banner says so after some seconds.
});

function chooseTheme(theme) {
  document.documentElement.dataset.theme = theme;
  byId("theme").setAttribute("aria-pressed", String(theme === "dark"));
  map.setTheme(theme);
}

function listen() {
  const prefersDark = matchMedia("(prefers-color-scheme: dark)");
  chooseTheme(prefersDark.matches ? "dark" : "light");
  prefersDark.addEventListener("change", ({ matches }) => chooseTheme(matches ? "dark" : "light"));
  byId("theme").addEventListener("click", () => {
    chooseTheme(document.documentElement.dataset.theme === "dark" ? "light" : "dark");
  });
  byId("zoom-in").addEventListener("click", () => map.zoom(1.4));
  byId("zoom-out").addEventListener("click", () => map.zoom(1 / 1.4));
  byId("zoom-fit").addEventListener("click", () => {
    map.isFitted = true;
    map.redraw();
  });
  for (const kind of ["range", "closure", "match"]) {
    byId(`show-${kind}`).addEventListener("change", ({ target }) => map.show(kind, target.checked));
  }
  for (const id of ["filter-severity", "filter-agent", "filter-text"]) {
    byId(id).addEventListener("input", () => showEvents(state.events));
  }
  byId("ask").addEventListener("click", async ({ target }) => {
    try {
      await switchAsk(target.getAttribute("aria-checked") !== "true");
    } catch {
      state.heard_at = -Infinity; // The banner says that the server does not answer.
    }
  });
}

listen();
feed.start();
setInterval(() => {
  showAges();
  map.redraw();
}, 1000);
