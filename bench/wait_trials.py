#!/usr/bin/env python3
"""Counts how often `sync now --wait` and `replicate now --wait` report success although records are missing. Runs real teams
of four agents in network namespaces at 1 Mbit/s each (tests/apps/network_lab.py); roles change and disks are lost.

Usage: wait_trials.py PROGRAMS SCENARIO [--trials N] [--teams N] [--seed N] [--json FILE]
    PROGRAMS   folder of moonctl, moondb_agent, moondb_mission and moondb_replay
    SCENARIO   flap       the new leader's link is down at `role swap`, and comes back 20 to 350 ms after it
               flap_slow  the same, and each frame from moonctl to an agent takes 20 ms longer
               flap_at_once  as flap_slow, by `role swap --no-wait`: the commands begin before the new leader leads
               mid        `role swap` in mid-replication, while a rover is down whose records two others hold
               wipe       the leader's disk is lost; it starts with an empty one
               chase      four clients of one rover insert maps without a pause, each fsync of an agent takes 50 ms longer
                          (bench/slow_fsync.cc); `sync now --wait` alone
               restart    a rover is killed in the middle of `sync now --wait`, and starts again after 0.3 s
    --trials   in all (40); --teams of them side by side (1)
    --json     the trials one by one, and the counts

Each trial inserts records, reads the running agents' database files, makes the change of the scenario and runs the two
commands. Then it reads the database files of leader and survivor with sqlite3: no record that existed before `sync now`
may be missing there. A command claims that all is there when it exits with 0, or with 3 and
"is_acknowledged": then of all agents that run. A trial is early when both claim so and anything is missing. It is late
when a command ran to its limit although everything that existed at the request was there; `restart` counts each run to
the limit as late.

The slow moonctl of flap_slow is no part of moondb: a proxy of this program stands on each agent's socket for clients.

Exit codes: 0 no trial was early or late, 1 some were, 2 usage, 3 a trial could not be run, 77 skipped (no namespaces here).
"""
import argparse
import asyncio
import contextlib
import json
import os
import pathlib
import random
import shutil
import sqlite3
import subprocess
import sys
import threading
import time

SOURCE = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(SOURCE / "tests" / "apps"))
import network_lab  # noqa: E402
from network_lab import NAMES, Failure  # noqa: E402
from python_example_test import MODULES, python_with  # noqa: E402

SKIPPED = 77
SCENARIOS = ("flap", "flap_slow", "flap_at_once", "mid", "wipe", "chase", "restart")
ROVER = 2  # A rover that is neither leader nor survivor.
SLOWER_S = 0.020
# Seconds of the mission that each trial inserts.
SLICE_S = {"flap": 30, "flap_slow": 30, "flap_at_once": 30, "mid": 60, "wipe": 30, "chase": 10, "restart": 60}
# Number of trials after which the disks are emptied, so that the stores stay small.
TRIALS_A_LIFE = {"flap": 20, "flap_slow": 20, "flap_at_once": 20, "mid": 12, "wipe": 5, "chase": 10, "restart": 12}
# Types that are shared as `latest`. The trials check only each agent's own rows of these types, but all rows of other
# types.
STATES = {"temperature", "power", "awake_status", "mode", "health", "exploration", "distributed_measurements",
          "optimized_pose", "edge_verdict", "map_match"}
COMMAND_LIMIT = "60s"
FSYNC_MS = 50
CLIENTS = 4
TIMED_OUT = 5  # Exit code of moonctl after a timeout.


def rows(database):
    """Returns all shared records as {(table, origin, epoch, seq): content}."""
    found = {}
    tables = [name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
    for table in tables:
        columns = {row[1] for row in database.execute(f"PRAGMA table_info({table})")}
        if not {"seq", "content", "origin"} <= columns:
            continue
        found.update({(table, *row[:3]): row[3] for row in database.execute(
            f"SELECT origin, epoch, seq, content FROM {table} WHERE seq IS NOT NULL")})
    return found


@contextlib.contextmanager
def frozen(team, agents):
    """Yields a consistent view of the agents' databases: in each database a read transaction starts before any is
    read."""
    with contextlib.ExitStack() as stack:
        databases = {}
        for agent in agents:
            file = team.folder / NAMES[agent] / "moondb.sqlite"
            database = stack.enter_context(contextlib.closing(
                sqlite3.connect(f"file:{file}?mode=ro", uri=True, isolation_level=None)))
            database.execute("BEGIN")
            database.execute("SELECT count(*) FROM sqlite_master").fetchone()
            databases[agent] = database
        copies = {}
        for agent, database in databases.items():
            copies[agent] = stack.enter_context(contextlib.closing(sqlite3.connect(":memory:")))
            database.backup(copies[agent])
        yield copies


def existing(team, agents):
    found = {}
    with frozen(team, agents) as copies:
        for agent, copy in copies.items():
            found.update({key: content for key, content in rows(copy).items()
                          if key[0] not in STATES or key[1] == agent + 1})
    return found


def lacking(team, before, agents):
    """Returns, by agent and table, how many of the records in `before` are missing or have other content."""
    missing = {}
    with frozen(team, agents) as copies:
        for agent, copy in copies.items():
            held = rows(copy)
            keys = [key for key, content in before.items() if held.get(key) != content]
            missing[NAMES[agent]] = {"count": len(keys), "of": sorted({f"{key[1]} {key[0]}" for key in keys})}
    return missing


class SlowProxy:
    """Proxy on an agent's client socket that delays each frame to the agent."""

    def __init__(self, folder):
        self.loop = asyncio.new_event_loop()
        self.sockets = sorted(folder.glob("**/*.sock"))
        for socket in self.sockets:
            real = socket.with_suffix(".real")
            socket.rename(real)
            self.loop.run_until_complete(asyncio.start_unix_server(
                lambda reader, writer, real=real: self.serve(real, reader, writer), path=str(socket)))
        threading.Thread(target=self.loop.run_forever, daemon=True).start()

    def close(self):
        self.loop.call_soon_threadsafe(self.loop.stop)
        for socket in self.sockets:
            socket.unlink(missing_ok=True)
            socket.with_suffix(".real").unlink(missing_ok=True)

    async def serve(self, real, reader, writer):
        try:
            to_agent_reader, to_agent = await asyncio.open_unix_connection(str(real))
        except OSError:
            writer.close()
            return
        await asyncio.gather(self.carry(reader, to_agent, SLOWER_S), self.carry(to_agent_reader, writer, 0))

    @staticmethod
    async def carry(reader, writer, delay):
        with contextlib.suppress(OSError):
            while data := await reader.read(1 << 16):
                if delay:
                    await asyncio.sleep(delay)
                writer.write(data)
                await writer.drain()
        writer.close()


def insert_without_pause(team_file, built):
    """Inserts maps of noise at the rover, through several clients, until this process is killed."""
    sys.path[:0] = [str(built / "python"), str(SOURCE / "examples/python")]
    from moondb import Client, endpoint_of, team_of  # pylint: disable=import-outside-toplevel
    from survey import map_at, node_at  # pylint: disable=import-outside-toplevel
    endpoint, team_id = endpoint_of(team_file, NAMES[ROVER]), team_of(team_file)[1]
    # Use node indexes that the mission does not use.
    index = 1_000_000 + Client(endpoint, team_id).next_node_index()
    Client(endpoint, team_id).insert([node_at(ROVER + 1, index, 1.0, 1.0)])

    def insert(number):
        client, rng = Client(endpoint, team_id, timeout_s=30), random.Random(number)
        while True:
            client.insert([map_at(ROVER + 1, index, [rng.randrange(3) for _ in range(1600)], 40, 0.1)])

    for number in range(CLIENTS):
        threading.Thread(target=insert, args=(number,)).start()


class Trials:
    def __init__(self, team, network, scenario, rng, mission):
        self.team, self.network, self.scenario, self.rng, self.mission = team, network, scenario, rng, mission
        self.leader, self.survivor = 0, 1
        self.fed_s = 0
        self.proxy = None

    def note_start(self):
        """Restarts all agents with empty disks."""
        self.team.stop()
        if self.proxy:
            self.proxy.close()
        for name in NAMES:
            shutil.rmtree(self.team.folder / name, ignore_errors=True)
        self.leader, self.survivor = 0, 1
        self.fed_s = 0
        for agent in range(len(NAMES)):
            self.team.start(agent)
        self.team.until_joined()
        self.until_agreed()
        if self.scenario in ("flap_slow", "flap_at_once"):
            self.proxy = SlowProxy(pathlib.Path(os.environ["MOONDB_RUN_DIR"]))

    def running(self):
        return sorted(self.team.agents)

    def roles(self):
        shown = json.loads(self.team.moonctl("--json", "role", "show", check=False).stdout)["agents"]
        return [agent.get("roles") for agent in shown if agent["is_reachable"]]

    def until_agreed(self):
        def agree():
            roles = self.roles()
            return len(roles) == len(self.running()) and all(
                each["leader"] == self.leader + 1 and each["term"] == roles[0]["term"] and
                each["term"].get("issuer") == self.leader + 1 for each in roles)
        self.team.until(agree, "the agents do not agree on the roles")

    def feed(self):
        length = SLICE_S[self.scenario]
        self.team.feed(self.mission, "--from", self.fed_s, "--to", self.fed_s + length)
        self.fed_s += length

    def command(self, *words):
        started = time.monotonic()
        done = self.team.moonctl("--json", "--timeout", COMMAND_LIMIT, *words, check=False)
        try:
            said = json.loads(done.stdout)
        except ValueError:
            said = {}
        claims = done.returncode == 0 or (done.returncode == 3 and said.get("is_acknowledged", False))
        return {"exit": done.returncode, "claims": claims, "said": said, "s": round(time.monotonic() - started, 3),
                "shown": done.stderr.strip().splitlines()[-1:]}

    def swap(self):
        """Swaps the roles and switches the new leader's link as the scenario requires."""
        new = self.survivor
        link = None
        if self.scenario != "mid":
            delay = self.rng.uniform(0.020, 0.350)
            self.network.set_link(new, False)
            # The extra 0.04 s give moonctl time to start and to request the leader.
            link = threading.Timer(delay + 0.04, lambda: self.network.set_link(new, True))
            link.start()
        how = ["--no-wait"] if self.scenario == "flap_at_once" else []
        done = self.team.moonctl("--json", "role", "swap", *how, check=False)
        if done.returncode not in (0, 3):
            raise Failure(f"role swap: {done.stdout.strip()} (exit {done.returncode})")
        self.leader, self.survivor = self.survivor, self.leader
        return link, done.returncode

    def ask(self, before):
        sync = self.command("sync", "now", "--wait")
        replicate = self.command("replicate", "now", "--wait")
        missing = lacking(self.team, before, [self.leader, self.survivor])
        count = sum(each["count"] for each in missing.values())
        is_claimed = sync["claims"] and replicate["claims"]
        return {"existing": len(before), "sync": sync, "replicate": replicate, "is_claimed": is_claimed,
                "missing": missing, "is_early": is_claimed and count > 0,
                "is_late": count == 0 and TIMED_OUT in (sync["exit"], replicate["exit"])}

    def heal(self, before):
        """Waits until all records are stored, regardless of the commands' reports. Returns the time that this took."""
        started = time.monotonic()

        def is_whole():
            missing = lacking(self.team, before, [self.leader, self.survivor])
            if all(each["count"] == 0 for each in missing.values()):
                return True
            for kind in ("sync", "replicate"):
                self.team.moonctl(kind, "now", check=False)
            return False
        self.team.until(is_whole, "leader and survivor do not come to hold all")
        return round(time.monotonic() - started, 2)

    def run_chase(self):
        self.feed()
        python = python_with(MODULES)
        with subprocess.Popen([python, __file__, "-", "chase", "--insert-into", str(self.team.file), "--built",
                               str(self.built)]) as robot:
            try:
                time.sleep(2)
                if robot.poll() is not None:
                    raise Failure("the robot does not insert")
                before = existing(self.team, [ROVER])
                sync = self.command("sync", "now", "--wait")
                missing = lacking(self.team, before, [self.leader])
            finally:
                robot.kill()
        return self.judge(sync, before, missing)

    def run_restart(self):
        self.feed()
        before = existing(self.team, self.running())

        def restart():
            self.team.kill(ROVER)
            time.sleep(0.3)
            self.team.start(ROVER)
        restarted = threading.Timer(self.rng.uniform(0.05, 1.5), restart)
        restarted.start()
        sync = self.command("sync", "now", "--wait")
        missing = lacking(self.team, before, [self.leader])
        restarted.join()
        result = self.judge(sync, before, missing)
        result["is_late"] = sync["exit"] == TIMED_OUT
        self.team.until_joined()
        self.until_agreed()
        return result

    @staticmethod
    def judge(sync, before, missing):
        """Returns the result of a trial with only `sync now --wait`."""
        count = sum(each["count"] for each in missing.values())
        return {"existing": len(before), "sync": sync, "is_claimed": sync["claims"], "missing": missing,
                "is_early": sync["claims"] and count > 0, "is_late": sync["exit"] == TIMED_OUT and count == 0}

    def run(self):
        if self.scenario == "chase":
            return self.run_chase()
        if self.scenario == "restart":
            return self.run_restart()
        if self.scenario == "wipe":
            return self.run_wipe()
        if self.scenario == "mid":
            return self.run_mid()
        self.feed()
        before = existing(self.team, self.running())
        link, swapped = self.swap()
        result = self.ask(before)
        link.join()
        result["swap_exit"] = swapped
        result["healed_s"] = self.heal(before)
        self.until_agreed()
        return result

    def run_mid(self):
        if ROVER not in self.team.agents:
            self.team.start(ROVER)
            self.team.until_joined()
            self.until_agreed()
        self.feed()
        for _ in range(5):
            if self.command("sync", "now", "--wait")["exit"] == 0:
                break
        else:
            raise Failure("the records do not come to the leader")
        self.team.kill(ROVER)
        before = existing(self.team, self.running())
        self.team.moonctl("replicate", "now")
        time.sleep(self.rng.uniform(0.02, 0.3))
        _, swapped = self.swap()
        result = self.ask(before)
        result["swap_exit"] = swapped
        result["healed_s"] = self.heal(before)
        return result

    def run_wipe(self):
        self.feed()
        before = existing(self.team, self.running())
        self.heal(before)
        self.team.kill(self.leader)
        shutil.rmtree(self.team.folder / NAMES[self.leader])
        before = existing(self.team, self.running())
        self.team.start(self.leader)
        result = self.ask(before)
        result["healed_s"] = self.heal(before)
        self.until_agreed()
        return result


def work(options):
    """Runs trials with one team and prints one line of JSON per trial."""
    try:
        with network_lab.lab(options.programs) as (team, network):
            scenario = options.scenario
            if scenario == "chase":
                team.environment = dict(os.environ, LD_PRELOAD=str(options.built / "slow_fsync.so"), MOONDB_FSYNC_MS=str(FSYNC_MS))
            trials = Trials(team, network, scenario, random.Random(options.seed), options.mission)
            trials.built = options.built
            for number in range(options.trials):
                started = time.monotonic()
                if number % TRIALS_A_LIFE[scenario] == 0:
                    trials.note_start()
                result = trials.run()
                result.update(number=number, seed=options.seed, trial_s=round(time.monotonic() - started, 2))
                print(json.dumps(result), flush=True)
    except network_lab.Unsupported as reason:
        print(f"skipped: {reason}", file=sys.stderr)
        return SKIPPED
    except (Failure, subprocess.TimeoutExpired) as failure:
        print(f"seed {options.seed}: {failure}", file=sys.stderr)
        return 3
    return 0


def count(results):
    counted = {"trials": len(results), "both_exit_0": 0, "both_claim": 0, "early": 0, "late": 0}
    for result in results:
        result.setdefault("replicate", {"exit": 0})  # Some scenarios run no replication.
    for kind in ("sync", "replicate"):
        exits = {}
        for result in results:
            exits[str(result[kind]["exit"])] = exits.get(str(result[kind]["exit"]), 0) + 1
        counted[f"{kind}_exits"] = exits
    for result in results:
        counted["both_exit_0"] += result["sync"]["exit"] == 0 and result["replicate"]["exit"] == 0
        counted["both_claim"] += result["is_claimed"]
        counted["early"] += result["is_early"]
        counted["late"] += result["is_late"]
    counted["replicate_exit_0_lacking"] = sum(
        result["replicate"]["exit"] == 0 and any(each["count"] for each in result["missing"].values())
        for result in results)
    return counted


def oversee(options):
    with network_lab.scratch_folder() as folder:
        minutes = TRIALS_A_LIFE[options.scenario] * SLICE_S[options.scenario] // 60 + 1
        subprocess.run([options.programs / "moondb_mission", "generate", "--seed", "7", "--minutes", str(minutes),
                        "--period-s", "2", "--out", folder / "mission"], check=True, stdout=subprocess.DEVNULL)
        built = folder / "built"
        built.mkdir()
        if options.scenario == "chase":
            shutil.copytree(options.programs.parent / "python/moondb", built / "python/moondb")
            subprocess.run(["c++", "-shared", "-fPIC", "-o", built / "slow_fsync.so", SOURCE / "bench/slow_fsync.cc", "-ldl"],
                           check=True)
        return oversee_teams(options, folder / "mission", built)


def oversee_teams(options, mission, built):
    """Runs teams in parallel, each in its own process: namespaces and sockets are named by process id."""
    started, results, codes = time.monotonic(), [], []
    lock = threading.Lock()

    def attend(index):
        share = options.trials // options.teams + (index < options.trials % options.teams)
        seed = options.seed + 1000 * index
        with subprocess.Popen([sys.executable, __file__, str(options.programs), options.scenario, "--worker", "--trials",
                               str(share), "--seed", str(seed), "--mission", str(mission), "--built", str(built)],
                              stdout=subprocess.PIPE, text=True) as worker:
            for line in worker.stdout:
                with lock:
                    results.append(json.loads(line))
                    last, done = results[-1], len(results)
                    early, late = (sum(each[what] for each in results) for what in ("is_early", "is_late"))
                    rate = 60 * done / (time.monotonic() - started)
                    print(f"{options.scenario} {done}/{options.trials}: sync {last['sync']['exit']}, replicate "
                          f"{last.get('replicate', {}).get('exit', '-')}{', EARLY' if last['is_early'] else ''}"
                          f"{', LATE' if last['is_late'] else ''}; {early} early, {late} late, {rate:.1f} trials a minute",
                          flush=True)
            codes.append(worker.wait())

    teams = [threading.Thread(target=attend, args=(index,)) for index in range(options.teams)]
    for team in teams:
        team.start()
        time.sleep(0.5)
    for team in teams:
        team.join()
    counted = {"scenario": options.scenario, "seed": options.seed, "teams": options.teams,
               "s": round(time.monotonic() - started, 1), **count(results)}
    print(json.dumps(counted))
    if options.json:
        options.json.write_text(json.dumps({**counted, "results": results}, indent=1) + "\n", encoding="utf-8")
    if counted["early"] or counted["late"]:
        return 1
    return max(codes)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("scenario", choices=SCENARIOS)
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--teams", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--mission", type=pathlib.Path, help=argparse.SUPPRESS)
    parser.add_argument("--built", type=pathlib.Path, help=argparse.SUPPRESS)
    parser.add_argument("--insert-into", type=pathlib.Path, help=argparse.SUPPRESS)
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.trials < 1 or not 1 <= options.teams <= options.trials:
        parser.error("expected at least one trial for each team")
    if options.insert_into:
        return insert_without_pause(options.insert_into, options.built)
    return work(options) if options.worker else oversee(options)


if __name__ == "__main__":
    sys.exit(main())
