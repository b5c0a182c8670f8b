"""Runs a mission through a team of real processes and reports what came of it (see tools/demo).

It feeds the first half of the mission, syncs, replicates and optimises. While it feeds the second half, it swaps leader
and designated survivor; then it syncs, replicates and optimises again. It kills the new leader with SIGKILL. The survivor
takes over by command, and a new survivor is named. All figures of the report are read back from the agents.
"""
import argparse
import contextlib
import csv
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

import demo_lost_rover

AGENT_COUNT = 4
STEP_LIMIT_S = 240
MARK = ".moondb-demo"
# Stages of score.json, and their names in the table.
STAGES = {"before": "odometry", "without_matches": "optimised", "after": "optimised, maps matched"}
COLUMN = 21  # Width of a table column. The longest role has 19 letters.
TYPES_FILE = pathlib.Path(__file__).resolve().parent.parent / "proto/types.proto"
TYPE_NAMES = {int(number): name.lower()
              for name, number in re.findall(r"^  ([A-Z_]+) = (\d+);", TYPES_FILE.read_text(), re.MULTILINE)}


class DemoError(Exception):
    """An error described in one line."""


def free_port_run(count):
    """Returns the first of `count` consecutive loopback ports that are free now."""
    for first in range(17400, 60000, 50):
        with contextlib.ExitStack() as stack:
            try:
                for port in range(first, first + count):
                    stack.enter_context(socket.socket()).bind(("127.0.0.1", port))
                return first
            except OSError:
                continue
    raise DemoError("no free loopback ports")


class Team:
    """A running team, and the programs with which the demo controls it."""

    def __init__(self, programs, team_file):
        self.programs, self.team_file = pathlib.Path(programs), pathlib.Path(team_file)

    def run(self, program, *arguments, check=True):
        """Runs a program and returns its output. Exit code 3 (agents unreachable) counts as success, because the
        demo kills one agent."""
        command = [str(self.programs / program), *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=STEP_LIMIT_S, check=False)
        if check and done.returncode not in (0, 3):
            line = (done.stderr.strip() or done.stdout.strip() or "no output").splitlines()[-1]
            raise DemoError(f"{program} {' '.join(map(str, arguments))}: {line} (exit {done.returncode})")
        return done.stdout

    def moonctl(self, *arguments, check=True):
        return self.run("moonctl", "-t", self.team_file, *arguments, check=check)

    def replay(self, verb, *arguments):
        return self.run("moondb_replay", verb, "-t", self.team_file, *arguments)

    def replay_beside(self, verb, *arguments):
        """Starts moondb_replay and returns the running process."""
        command = [self.programs / "moondb_replay", verb, "-t", self.team_file, *arguments]
        return subprocess.Popen([str(part) for part in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                text=True)

    def status(self):
        """Returns the status of each agent by name; None for an agent that does not answer."""
        answer = json.loads(self.moonctl("--json", "status"))
        return {row["name"]: row.get("status") for row in answer["agents"]}


def records_of(status):
    """Returns the number of records that an agent holds, from all origins, by type name."""
    records = {}
    for count in status["storage"]["counts"]:
        kind = TYPE_NAMES.get(count["data_type"], str(count["data_type"]))
        records[kind] = records.get(kind, 0) + int(count["count"])
    return records


class Story:
    """The steps of the demo. Each prints its action and its duration."""

    def __init__(self, team, started):
        self.team, self.started = team, started

    @contextlib.contextmanager
    def step(self, text):
        before = time.monotonic()
        print(f"[{before - self.started:6.1f} s] {text}", flush=True)
        yield
        self.show(f"done in {time.monotonic() - before:.1f} s")

    def show(self, text):
        for line in text.strip().splitlines():
            print("           " + line, flush=True)

    def gather(self):
        """Syncs all records to the leader, solves there, and replicates everything to the survivor."""
        with self.step("sync: every agent's records to the leader"):
            self.team.moonctl("--timeout", f"{STEP_LIMIT_S}s", "sync", "now", "--wait")
        with self.step("optimise: the leader solves the pose graph"):
            self.show(self.team.moonctl("graph", "optimize"))
        for text in ("match: the leader matches local maps that overlap, and solves with the matches",
                     "match: again, at the better poses"):
            with self.step(text):
                self.show(self.team.moonctl("graph", "matches", "--wait", f"{STEP_LIMIT_S}s").splitlines()[0])
                self.show(self.team.moonctl("graph", "optimize"))
        with self.step("replicate: all that the leader holds to the designated survivor"):
            self.team.moonctl("--timeout", f"{STEP_LIMIT_S}s", "replicate", "now", "--wait")


def mission_seconds(folder):
    """Returns the timestamp of the mission's last map in seconds."""
    with open(folder / "maps.csv", encoding="utf-8") as file:
        header = file.readline().rstrip("\n").split(",")
        column = header.index("stamp_s")
        return max(float(line.split(",")[column]) for line in file if line.strip())


def expected_records(folder):
    """Returns the number of a mission's records by data type. All must reach leader and survivor."""
    with open(folder / "maps.csv", encoding="utf-8") as file:
        maps = sum(1 for line in file if line.strip()) - 1
    tags = [line.split(" ", 1)[0] for line in open(folder / "graph.pyfg", encoding="utf-8")]
    nodes = sum(tag in ("VERTEX_SE3:QUAT", "VERTEX_XYZ") for tag in tags)
    edges = sum(tag.startswith("EDGE_") for tag in tags)
    return {"pose_graph_node": nodes, "pose_graph_edge": edges, "local_traversability_map": maps}


def check_complete(status, expected, who):
    records = records_of(status)
    for kind, count in expected.items():
        if records.get(kind, 0) != count:
            raise DemoError(f"{who} holds {records.get(kind, 0)} of {count} records of type {kind}")


def without_starts_or_ranges(mission, copy, starts, has_ranges):
    """Writes a mission without starts or ranges, and returns the rovers whose starts are not known. These begin at the
    origin of their own frames."""
    copy.mkdir()
    for name in ("maps", "maps.csv"):
        (copy / name).symlink_to(mission / name)
    with open(mission / "graph.pyfg", encoding="utf-8") as file:
        lines = [line for line in file if has_ranges or not line.startswith("EDGE_RANGE")]
    (copy / "graph.pyfg").write_text("".join(lines), encoding="utf-8")
    with open(mission / "agents.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    rovers = [row["name"] for row in rows if row["kind"] == "rover"]
    unknown = {"all": [], "one": rovers[1:], "none": rovers}[starts]
    for row in rows:
        if row["name"] in unknown:
            row.update(start_x_m=0, start_y_m=0, start_yaw_rad=0)
    with open(copy / "agents.csv", "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return unknown


def remove_starts(team_file, names):
    """Removes the starts of these agents from a team file."""
    kept, name = [], ""
    for line in team_file.read_text(encoding="utf-8").splitlines(keepends=True):
        named = re.match(r"\s*-?\s*name:\s*(\S+)", line)
        name = named.group(1) if named else name
        if name not in names or not line.lstrip().startswith("start:"):
            kept.append(line)
    team_file.write_text("".join(kept), encoding="utf-8")


def tell(story, mission):
    """Runs the whole mission. Returns the statuses just before the kill and at the end."""
    team, middle, expected = story.team, mission_seconds(mission) / 2, expected_records(mission)
    with story.step("start four agents"):
        story.show(team.moonctl("up"))
    with story.step(f"the robots insert the first half of the mission (to {middle:.0f} s)"):
        team.replay("feed", "--mission", mission, "--to", middle)
    story.gather()

    with story.step("the second half; meanwhile rover1 and rover2 swap leader and designated survivor, live"):
        with team.replay_beside("feed", "--mission", mission, "--from", middle) as feed:
            team.moonctl("sync", "now")
            story.show(team.moonctl("role", "swap", "rover1", "rover2"))
            errors = feed.communicate(timeout=STEP_LIMIT_S)[1]
            if feed.returncode != 0:
                raise DemoError(f"moondb_replay could not feed the second half: {errors.strip()}")
    story.gather()
    before_kill = team.status()
    check_complete(before_kill["rover2"], expected, "the leader rover2")
    check_complete(before_kill["rover1"], expected, "the survivor rover1")

    leader_pid = int(before_kill["rover2"]["pid"])
    with story.step(f"kill the leader rover2 (process {leader_pid}) with SIGKILL; the survivor rover1 takes over"):
        os.kill(leader_pid, signal.SIGKILL)
        story.show(team.moonctl("-a", "rover1", "role", "set", "rover1", "leader", "rover3", "survivor"))
    story.gather()
    at_end = team.status()
    check_complete(at_end["rover1"], expected, "the new leader rover1")
    check_complete(at_end["rover3"], expected, "the new survivor rover3")
    return before_kill, at_end


def summarise(mission, before_kill, at_end, score, seconds):
    """Returns the contents of out/summary.json. For a dead agent, records and bytes are its last reported ones."""
    agents, wire_bytes = [], 0
    for name, status in at_end.items():
        last_known = status or before_kill[name]
        agents.append({
            "id": last_known["agent_id"],
            "name": name,
            "alive": status is not None,
            "role": status["role"].removeprefix("ROLE_").lower() if status else "rover",
            "records": records_of(last_known),
        })
        wire_bytes += sum(int(peer["sent_bytes"]) for peer in last_known["peers"])
    return {
        "mission": str(mission),
        "agents": agents,
        "wire_bytes": wire_bytes,
        **{f"{figure}_{when}{unit}": score[when][key]
           for figure, key, unit in (("ate", "ate_m", "_m"), ("hazard_iou", "hazard_iou", ""), ("kappa", "kappa", ""))
           for when in STAGES if when in score},
        "merged_map_is_reproducible": score["is_agents_map_equal"],
        "survivor_took_over": at_end["rover2"] is None and at_end["rover1"]["role"] == "ROLE_LEADER",
        "seconds": round(seconds, 1),
    }


def print_table(summary):
    types = sorted({kind for agent in summary["agents"] for kind in agent["records"]})
    names = [agent["name"] + ("" if agent["alive"] else " (dead)") for agent in summary["agents"]]
    print(f"\n{'records held':28}" + "".join(f"{name:>{COLUMN}}" for name in names))
    for kind in types:
        print(f"{kind:28}" + "".join(f"{agent['records'].get(kind, 0):{COLUMN}}" for agent in summary["agents"]))
    print(f"{'role at the end':28}" + "".join(f"{agent['role']:>{COLUMN}}" for agent in summary["agents"]))
    print(f"\n{'':28}{'ATE':>16}{'hazard IoU':>16}{'kappa':>16}")
    for when, label in STAGES.items():
        if f"ate_{when}_m" not in summary:
            continue
        ate, iou, kappa = (summary[key] for key in (f"ate_{when}_m", f"hazard_iou_{when}", f"kappa_{when}"))
        print(f"{label:28}{ate:14.3f} m{iou:16.3f}{kappa:16.3f}")
    print(f"\n{'bytes between agents':28}{summary['wire_bytes']:16,} (messages as handed to the sockets)")
    print(f"{'survivor took over':28}{'yes' if summary['survivor_took_over'] else 'NO':>16}")
    print(f"{'seconds':28}{summary['seconds']:16}")


def lose_a_rover(story, mission, out, unknown):
    """Runs the last act with a team of its own."""
    folder = out / "lost_rover"
    folder.mkdir()
    team = Team(story.team.programs, folder / "team" / "team.yaml")
    team.moonctl("config", "init", "--mission", mission, team.team_file, "--first-port", free_port_run(AGENT_COUNT))
    remove_starts(team.team_file, unknown)
    demo_lost_rover.let_records_flow(team.team_file)
    try:
        result = demo_lost_rover.tell(Story(team, story.started), mission, mission_seconds(mission) / 2, folder,
                                      STEP_LIMIT_S, bool(unknown))
    except demo_lost_rover.NotSettled as error:
        raise DemoError(str(error)) from error
    finally:
        team.moonctl("down", check=False)
    shutil.copy(folder / f"map_of_{demo_lost_rover.LATE}.png", out)
    return result


def run_demo(options, out):
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="moondb-") as run_folder:
        # Socket paths are limited in length, and a path under out/ may be too long.
        os.environ["MOONDB_RUN_DIR"] = run_folder
        team = Team(options.bin, out / "team" / "team.yaml")
        story = Story(team, started)
        mission = pathlib.Path(options.mission).resolve() if options.mission else out / "mission"
        if not options.mission:
            with story.step(f"make a lunar mission (seed {options.seed})"):
                story.show(team.run("moondb_mission", "generate", "--seed", options.seed, "--out", mission))
        unknown = []
        if options.starts != "all" or options.no_ranges:
            copied = out / "mission_anywhere"
            unknown = without_starts_or_ranges(mission, copied, options.starts, not options.no_ranges)
            mission = copied
        (out / "team").mkdir()
        team.moonctl("config", "init", "--mission", mission, team.team_file, "--first-port",
                     free_port_run(AGENT_COUNT))
        remove_starts(team.team_file, unknown)
        try:
            before_kill, at_end = tell(story, mission)
            with story.step("export the merged map, and score it against the truth"):
                for form in ("png", "nav2"):
                    team.moonctl("-a", "rover1", "map", "export", out / "map", "--format", form)
                team.moonctl("-a", "rover1", "graph", "export", out / "graph.pyfg")
                story.show(team.replay("score", "--mission", mission, "-a", "rover1", "--out", out, "--json",
                                       out / "score.json", *(["--align"] if unknown else [])))
        finally:
            team.moonctl("down", check=False)
        lost_rover = lose_a_rover(story, mission, out, unknown)
    score = json.loads((out / "score.json").read_text(encoding="utf-8"))
    summary = summarise(mission, before_kill, at_end, score, time.monotonic() - started)
    summary["lost_rover"] = lost_rover
    (out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    print_table(summary)
    demo_lost_rover.print_result(lost_rover)
    print(f"\nLook at {out}/before_after.png, trajectories.png, map/ and map_of_{demo_lost_rover.LATE}.png;"
          " figures are in summary.json.")


def parse_arguments():
    parser = argparse.ArgumentParser(prog="tools/demo", description="Runs a mission through a team of real processes.")
    parser.add_argument("--mission", help="a recorded mission's folder (docs/MISSIONS.md); default: make one")
    parser.add_argument("--seed", type=int, default=7, help="of the mission that is made")
    parser.add_argument("--starts", choices=("all", "one", "none"), default="all",
                        help="starts that the team knows: rover1's alone, or none; the others begin at (0, 0) of their "
                             "own frames, and the result is scored after alignment of the team's frame")
    parser.add_argument("--no-ranges", action="store_true", help="leave out the ranges between the radios")
    parser.add_argument("--out", default="out", help="folder for the results; emptied first (default: out)")
    parser.add_argument("--bin", help=argparse.SUPPRESS, default=pathlib.Path(__file__).parent.parent / "build/dev/bin")
    return parser.parse_args()


def make_empty(out):
    """Empties a folder that an earlier run made. Refuses a folder with other contents."""
    if out.exists() and any(out.iterdir()):
        if not (out / MARK).exists():
            raise DemoError(f"{out} is not empty and no earlier demo's; name another by --out")
        shutil.rmtree(out)
    out.mkdir(parents=True, exist_ok=True)
    (out / MARK).write_text("Made by tools/demo; the next run empties this folder.\n", encoding="utf-8")


def run_and_report(action):
    """Runs a demo, and prints its error in one line. Returns the exit code."""
    try:
        action()
    except (DemoError, OSError, subprocess.TimeoutExpired) as error:
        print(f"demo: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("demo: stopped", file=sys.stderr)
        return 130
    return 0


def main():
    options = parse_arguments()
    out = pathlib.Path(options.out).resolve()
    if options.mission and not (pathlib.Path(options.mission) / "maps.csv").exists():
        raise DemoError(f"{options.mission} is no mission folder: it has no maps.csv")
    make_empty(out)
    run_demo(options, out)


if __name__ == "__main__":
    sys.exit(run_and_report(main))
