// Opens the page of moondb_view in Chromium and checks what it shows of a running team, while one agent is killed and
// the roles are swapped. Prints a line for each part; ends with 1 and the reason if one is wrong.
//
// Usage: page_checks.mjs URL PROGRAMS [PICTURES]    PICTURES is a folder for screenshots.
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { chromium } from "playwright-core";

const [url, programs, pictures] = process.argv.slice(2);
const kWait_ms = 120_000; // Ten times what an idle machine needs, and more.
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

function moonctl(...words) {
  try {
    return JSON.parse(execFileSync(`${programs}/moonctl`, ["--json", ...words], { encoding: "utf8" }));
  } catch (failure) {
    return JSON.parse(failure.stdout); // For example, health ends with 1 if something is wrong.
  }
}

function require(condition, text) {
  if (!condition) throw new Error(text);
}

async function answer(page, name) {
  return (await page.locator(`#answer-${name}`).innerText()).replaceAll(/\s+/g, " ");
}

// Waits until the answer contains a text.
async function untilAnswer(page, name, text) {
  await page.waitForFunction(
    ([id, wanted]) => document.getElementById(id).innerText.replaceAll(/\s+/g, " ").includes(wanted),
    [`answer-${name}`, text], { timeout: kWait_ms },
  ).catch(async () => { throw new Error(`answer ${name}: expected "${text}", found "${await answer(page, name)}"`); });
  console.log(`answer ${name}: ${await answer(page, name)}`);
}

async function accessible(page, what) {
  await page.evaluate(axe);
  const { violations } = await page.evaluate(() => globalThis.axe.run());
  const found = violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html.slice(0, 120)).join(" | ")}`);
  require(violations.length === 0, `${what} is not accessible: ${found.join("\n")}`);
}

async function fits(page, what) {
  const [shown, needed] = await page.evaluate(() => [innerWidth, document.documentElement.scrollWidth]);
  require(needed <= shown, `${what}: the page is ${needed} pixels wide`);
}

// Returns how many colours more than 200 pixels of the map have.
async function colorsOfMap(page) {
  return page.locator("canvas").first().evaluate((canvas) => {
    const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
    const counts = new Map();
    for (let i = 0; i < data.length; i += 4) {
      const color = `${data[i]},${data[i + 1]},${data[i + 2]}`;
      counts.set(color, (counts.get(color) ?? 0) + 1);
    }
    return [...counts.values()].filter((count) => count > 200).length;
  });
}

// Waits until the answer says what moonctl says at that time, because both change.
async function untilEqual(page, name, expected) {
  let wanted = "";
  for (const end = Date.now() + kWait_ms; Date.now() < end;) {
    wanted = expected(moonctl("status"));
    const found = await answer(page, name);
    if (found.includes(wanted)) return console.log(`answer ${name}: ${found}`);
    await page.waitForTimeout(500);
  }
  throw new Error(`answer ${name}: moonctl says "${wanted}", and the page "${await answer(page, name)}"`);
}

async function checkAnswers(page) {
  const leaderOf = ({ agents }) => agents.find(({ status }) => status?.role === "ROLE_LEADER");
  await untilEqual(page, "leader", (status) => `${leaderOf(status).name} leads`);
  await untilEqual(page, "silent", ({ agents }) => (agents.every(({ is_reachable }) => is_reachable) ? "nobody" : "silent"));
  await untilEqual(page, "loss", (status) => {
    const { count } = leaderOf(status).status.storage.one_copy;
    return count === 0 ? "nothing" : `${count} record`;
  });
  await untilAnswer(page, "maps", "ask the team");
  await page.getByRole("switch", { name: "Ask the team" }).click();
  await untilEqual(page, "maps", ({ is_settled, not_settled }) => (is_settled ? "yes" : `no: ${not_settled}`));
}

async function checkCell(page) {
  const map = page.locator("canvas").first();
  await map.click();
  // Before the answer, the page names the place that it asks about.
  await page.waitForFunction(() => document.getElementById("answer-cell").innerText.includes("this cell is"), null,
    { timeout: kWait_ms });
  const text = await answer(page, "cell");
  const [, x, y] = text.match(/\((-?[\d.]+)[^\d-]+(-?[\d.]+)/);
  const why = moonctl("map", "why", x, y);
  const value = ["unknown", "free", "hazard"][why.value];
  require(text.includes(value), `the cell at (${x}, ${y}) is ${value}, and the page says: ${text}`);
  console.log(`answer cell: ${text}`);
}

// Moves the cursor of the map by the keyboard, and asks there.
async function checkKeyboard(page) {
  const before = await answer(page, "cell");
  await page.locator("canvas").first().focus();
  for (let i = 0; i < 5; ++i) await page.keyboard.press("ArrowRight");
  await page.keyboard.press("Enter");
  await page.waitForFunction((old) => {
    const text = document.getElementById("answer-cell").innerText.replaceAll(/\s+/g, " ");
    return text !== old && text.includes("this cell is");
  }, before, { timeout: kWait_ms });
  console.log(`by the keyboard, ${await answer(page, "cell")}`);
}

// The page says that its agent does not answer, and recovers by itself.
async function checkLostAgent(page) {
  const { pid } = moonctl("status").agents.find(({ name }) => name === "rover1").status;
  process.kill(pid, "SIGKILL");
  const banner = page.locator("#banner");
  await banner.filter({ hasText: "rover1 does not answer" }).waitFor({ timeout: kWait_ms });
  await untilAnswer(page, "leader", "not known");
  await untilAnswer(page, "silent", "not known");
  moonctl("up");
  await banner.waitFor({ state: "hidden", timeout: kWait_ms });
  await untilAnswer(page, "leader", "rover2 leads");
}

async function checkRow(page, agent, text) {
  await page.waitForFunction(
    ([name, wanted]) => [...document.querySelectorAll("tr")].some((row) =>
      row.innerText.includes(name) && row.innerText.toLowerCase().includes(wanted)),
    [agent, text], { timeout: kWait_ms },
  ).catch(() => { throw new Error(`no row of ${agent} says "${text}"`); });
}

async function main() {
  const browser = await chromium.launch({ executablePath: "/usr/bin/chromium", args: ["--no-sandbox"] });
  const page = await browser.newPage({ viewport: { width: 1440, height: 900 } });
  const errors = [];
  page.on("console", (message) => { if (message.type() === "error") errors.push(message.text()); });
  page.on("pageerror", (error) => errors.push(String(error)));
  const foreign = [];
  page.on("request", (request) => { if (new URL(request.url()).host !== new URL(url).host) foreign.push(request.url()); });
  await page.goto(url);
  await checkAnswers(page);
  const colors = await colorsOfMap(page);
  require(colors >= 3, `the map shows ${colors} colours`);
  await checkCell(page);
  await checkKeyboard(page);

  for (const theme of ["light", "dark"]) {
    for (const width of [1440, 390]) {
      await page.emulateMedia({ colorScheme: theme });
      await page.setViewportSize({ width, height: width === 390 ? 844 : 900 });
      await page.waitForTimeout(500); // Until it is drawn; nothing waits for this in vain.
      await fits(page, `${theme}, ${width}`);
      await accessible(page, `${theme}, ${width}`);
      if (pictures) await page.screenshot({ path: `${pictures}/${theme}_${width}.png`, fullPage: width === 390 });
    }
  }
  await page.setViewportSize({ width: 1440, height: 900 });
  console.log("both themes and both widths are accessible");

  moonctl("role", "swap", "rover1", "rover2");
  await untilAnswer(page, "leader", "rover2 leads");
  const { pid } = moonctl("status").agents.find(({ name }) => name === "rover3").status;
  process.kill(pid, "SIGKILL");
  await untilAnswer(page, "silent", "rover3");
  await checkRow(page, "rover3", "silent");
  await accessible(page, "with a silent agent");
  if (pictures) await page.screenshot({ path: `${pictures}/silent.png` });

  await checkLostAgent(page);

  require(foreign.length === 0, `requests to others: ${foreign.join(" ")}`);
  require(errors.length === 0, `errors of the page: ${errors.join("\n")}`);
  await browser.close();
}

main().then(() => process.exit(0), (error) => { console.error(String(error.message ?? error)); process.exit(1); });
