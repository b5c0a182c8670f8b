#!/usr/bin/env python3
"""A team of four real agents in four network namespaces, joined at 1 Mbit/s each: links go down and come back, an agent
is killed in mid-transfer, roles change in between. Afterwards leader and survivor hold the same, and all of it.

Usage: network_test.py PROGRAMS    PROGRAMS is the folder of moonctl, moondb_agent, moondb_mission and moondb_replay.
Exit codes: 0 passed, 1 failed, 77 skipped (no namespaces here; it says why).
"""
import contextlib
import json
import os
import pathlib
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time

SKIPPED = 77
NAMES = ["rover1", "rover2", "rover3", "base"]
RATE = "1mbit"
STEP_LIMIT_S = 60


class Failure(Exception):
    """One line that says what went wrong."""


def run(*command, check=True):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=2 * STEP_LIMIT_S,
                          check=False)
    if check and done.returncode != 0:
        line = (done.stderr.strip() or done.stdout.strip() or "no output").splitlines()[-1]
        raise Failure(f"{' '.join(str(part) for part in command)}: {line} (exit {done.returncode})")
    return done


class Network:
    """A namespace for each agent and one with the bridge between them."""

    def __init__(self):
        self.hub = f"moondb{os.getpid()}hub"
        self.spaces = [f"moondb{os.getpid()}n{i + 1}" for i in range(len(NAMES))]

    def make(self):
        for space in [self.hub, *self.spaces]:
            run("ip", "netns", "add", space)
            run("ip", "-n", space, "link", "set", "lo", "up")
        run("ip", "-n", self.hub, "link", "add", "br0", "type", "bridge")
        run("ip", "-n", self.hub, "link", "set", "br0", "up")
        for i, space in enumerate(self.spaces):
            port = f"p{i + 1}"
            run("ip", "-n", self.hub, "link", "add", port, "type", "veth", "peer", "name", "eth0", "netns", space)
            run("ip", "-n", self.hub, "link", "set", port, "master", "br0", "up")
            run("ip", "-n", space, "addr", "add", f"{address(i)}/24", "dev", "eth0")
            run("ip", "-n", space, "link", "set", "eth0", "up")
            for where, device in ((self.hub, port), (space, "eth0")):
                run("tc", "-n", where, "qdisc", "add", "dev", device, "root", "tbf", "rate", RATE, "burst", "4kb",
                    "latency", "100ms")

    def set_link(self, agent, is_up):
        run("ip", "-n", self.hub, "link", "set", f"p{agent + 1}", "up" if is_up else "down")

    def bytes_to(self, agent):
        """Sent to that agent so far."""
        links = json.loads(run("ip", "-n", self.hub, "-j", "-s", "link", "show", f"p{agent + 1}").stdout)
        return links[0]["stats64"]["tx"]["bytes"]

    def remove(self):
        for space in [self.hub, *self.spaces]:
            run("ip", "netns", "del", space, check=False)


def address(agent):
    return f"10.77.0.{agent + 1}"


class Team:
    def __init__(self, programs, folder, network):
        self.programs, self.folder, self.network = pathlib.Path(programs), folder, network
        self.file = folder / "team.yaml"
        self.agents = {}
        run(self.programs / "moonctl", "config", "init", "--agents", len(NAMES), self.file)
        text = self.file.read_text(encoding="utf-8")
        for i in range(len(NAMES)):
            text = text.replace(f"tcp://127.0.0.1:{7400 + i}", f"tcp://{address(i)}:7400")
        self.file.write_text(text, encoding="utf-8")

    def start(self, agent):
        log = open(self.folder / f"{NAMES[agent]}.log", "a", encoding="utf-8")
        self.agents[agent] = subprocess.Popen(
            ["ip", "netns", "exec", self.network.spaces[agent], str(self.programs / "moondb_agent"), "-t",
             str(self.file), "-a", NAMES[agent], "--data-dir", str(self.folder / NAMES[agent]), "--merge-backend", "cpu"],
            stdout=log, stderr=log)
        self.until(lambda: self.moonctl("-a", NAMES[agent], "status", check=False).returncode == 0,
                   f"{NAMES[agent]} does not start")

    def kill(self, agent):
        self.agents[agent].send_signal(signal.SIGKILL)
        self.agents.pop(agent).wait()

    def stop(self):
        for agent in self.agents.values():
            agent.terminate()
        for agent in self.agents.values():
            agent.wait(timeout=30)

    def moonctl(self, *arguments, check=True):
        return run(self.programs / "moonctl", "-t", self.file, *arguments, check=check)

    def feed(self, mission, *arguments):
        run(self.programs / "moondb_replay", "feed", "-t", self.file, "--mission", mission, *arguments)

    def share(self, kind):
        """Again where a change of roles or a lost link ended it."""
        for tries_left in reversed(range(5)):
            done = self.moonctl("--timeout", f"{STEP_LIMIT_S}s", kind, "now", "--wait", check=tries_left == 0)
            if done.returncode == 0:
                return
            time.sleep(1)

    @staticmethod
    def until(condition, text):
        end = time.monotonic() + STEP_LIMIT_S
        while not condition():
            if time.monotonic() > end:
                raise Failure(text)
            time.sleep(0.2)

    def records(self, agent):
        """(origin, epoch, type, seq) and hash of each shared record."""
        found = {}
        with contextlib.closing(sqlite3.connect(f"file:{self.folder / NAMES[agent] / 'moondb.sqlite'}?mode=ro", uri=True)) as db:
            tables = [name for (name,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'table'")]
            for table in tables:
                columns = [row[1] for row in db.execute(f"PRAGMA table_info({table})")]
                if "hash" not in columns:
                    continue
                kind = "data_type" if "data_type" in columns else f"'{table}'"
                rows = db.execute(f"SELECT origin, epoch, {kind}, seq, hash FROM {table} WHERE seq IS NOT NULL")
                found.update({row[:4]: row[4] for row in rows})
        return found


def say(started, text):
    print(f"[{time.monotonic() - started:6.1f} s] {text}", flush=True)


def check_same(team, leader, survivor):
    at_leader, at_survivor = team.records(leader), team.records(survivor)
    if at_leader != at_survivor:
        raise Failure(f"{NAMES[leader]} holds {len(at_leader)} records, {NAMES[survivor]} {len(at_survivor)}")
    for agent in range(len(NAMES)):
        own = {key: value for key, value in team.records(agent).items() if key[0] == agent + 1}
        lacking = [key for key, value in own.items() if at_leader.get(key) != value]
        # Of states only the newest is kept anywhere.
        if lacking:
            raise Failure(f"{NAMES[leader]} lacks {len(lacking)} of {NAMES[agent]}'s records, such as {lacking[0]}")
    return len(at_leader)


def tell(team, network, mission, started):
    for agent in range(len(NAMES)):
        team.start(agent)
    team.feed(mission, "--to", 600)
    say(started, "fed the first half; sync over 1 Mbit/s, rover3's link down in the middle")
    team.moonctl("sync", "now")
    time.sleep(1)
    network.set_link(2, False)
    time.sleep(5)
    network.set_link(2, True)
    team.share("sync")
    team.moonctl("replicate", "now")
    time.sleep(0.5)
    team.kill(1)
    say(started, f"replicated, and SIGKILLed the survivor at {len(team.records(1))} of {len(team.records(0))} records")
    team.start(1)
    team.share("replicate")
    say(started, f"leader and survivor hold the same {check_same(team, 0, 1)} records")

    team.feed(mission, "--from", 600)
    before, start = network.bytes_to(0), time.monotonic()
    team.share("sync")
    took = time.monotonic() - start
    rate = (network.bytes_to(0) - before) * 8 / took
    say(started, f"synced the second half in {took:.1f} s, {rate / 1e6:.2f} Mbit/s to the leader")
    say(started, "swap roles while replicating")
    team.moonctl("replicate", "now")
    team.moonctl("role", "swap")
    team.share("sync")
    team.share("replicate")
    say(started, f"leader and survivor hold the same {check_same(team, 1, 0)} records")

    say(started, "the new leader is killed for good; the survivor leads, rover3 survives")
    team.kill(1)
    team.moonctl("role", "set", "rover1", "leader", "rover3", "survivor")
    network.set_link(2, False)
    time.sleep(4)
    network.set_link(2, True)
    team.moonctl("--timeout", f"{STEP_LIMIT_S}s", "sync", "now", "--from", "rover3", "--from", "base", "--wait", check=False)
    team.until(lambda: team.moonctl("replicate", "now", check=False).returncode == 0, "no replication begins")
    team.until(lambda: team.records(0) == team.records(2), "the new survivor does not get all")
    say(started, f"leader and survivor hold the same {check_same(team, 0, 2)} records")


def main():
    if len(sys.argv) != 2:
        print(__doc__.strip(), file=sys.stderr)
        return 2
    if os.geteuid() != 0 or not shutil.which("ip") or not shutil.which("tc"):
        print("skipped: needs root, ip and tc (package iproute2)")
        return SKIPPED
    network = Network()
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="moondb-net-") as folder:
        os.environ["MOONDB_RUN_DIR"] = f"{folder}/run"
        try:
            network.make()
        except Failure as failure:
            network.remove()
            print(f"skipped: this machine makes no network namespaces at 1 Mbit/s: {failure}")
            return SKIPPED
        team = None
        try:
            mission = pathlib.Path(folder) / "mission"
            run(pathlib.Path(sys.argv[1]) / "moondb_mission", "generate", "--seed", 7, "--minutes", 20, "--out", mission)
            team = Team(sys.argv[1], pathlib.Path(folder) / "team", network)
            tell(team, network, mission, started)
        except (Failure, subprocess.TimeoutExpired) as failure:
            print(f"failed: {failure}")
            for name in NAMES:
                log = pathlib.Path(folder) / "team" / f"{name}.log"
                if log.exists():
                    print(f"--- {name}\n" + "\n".join(log.read_text(encoding="utf-8").splitlines()[-8:]))
            return 1
        finally:
            if team is not None:
                team.stop()
            network.remove()
    say(started, "passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
