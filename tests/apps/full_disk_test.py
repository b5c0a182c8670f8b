#!/usr/bin/env python3
"""Real agents whose disk is full, fails, is read-only, or loses the store's file while it is open. Such an agent
starts, reads, shares and prunes its records, and follows role changes. It accepts inserts when the disk works again.

Usage: full_disk_test.py PROGRAMS [--trials N] [--json FILE] [--only NAME] [--disk tmpfs|ext4|btrfs]

PROGRAMS is the folder of moonctl and moondb_agent. Needs root, to mount file systems. Reports and leaves out file
systems that cannot be created here. With --trials each case runs N times, and FILE receives how often each step
succeeded.
Exit codes: 0 passed, 1 failed, 77 skipped.
"""
import argparse
import collections
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

SKIPPED = 77
NAMES = ["rover1", "rover2", "rover3", "base"]
DISK_MB = {"tmpfs": 48, "ext4": 48, "btrfs": 160}
MAP_BYTES = 20_000


class Failure(Exception):
    pass


def run(*command, check=True, env=None, timeout=90):
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=timeout, env=env)
    if check and done.returncode != 0:
        raise Failure(f"{' '.join(str(part) for part in command)}: exit {done.returncode}: "
                      f"{(done.stderr.strip() or done.stdout.strip())[-400:]}")
    return done


class Disk:
    """A small file system of the given kind, mounted on a folder."""

    def __init__(self, kind, folder, image):
        self.kind, self.folder, self.image = kind, folder, image
        folder.mkdir(parents=True, exist_ok=True)
        size = DISK_MB[kind]
        if kind == "tmpfs":
            run("mount", "-t", "tmpfs", "-o", f"size={size}m", "none", folder)
            return
        with open(image, "wb") as file:
            file.truncate(size << 20)
        make = {"ext4": ["mkfs.ext4", "-q", "-m", "0", image], "btrfs": ["mkfs.btrfs", "-q", "-M", image]}[kind]
        run(*make)
        run("mount", "-o", "loop", image, folder)

    def free(self):
        status = os.statvfs(self.folder)
        return status.f_bavail * status.f_frsize

    def fill(self):
        """Fills the disk completely with blocks of decreasing size."""
        with open(self.folder / "fill", "ab", buffering=0) as file:
            for size in (1 << 20, 1 << 16, 1 << 12, 1 << 9, 1):
                for _ in range(1000):
                    try:
                        if file.write(os.urandom(size)) < size:
                            break
                    except OSError:
                        break
            try:
                os.fsync(file.fileno())
            except OSError:
                pass

    def make_room(self):
        (self.folder / "fill").unlink()

    def remount(self, options):
        # Retry: files of a process may stay open for a moment after its end.
        deadline = time.monotonic() + 10
        while run("mount", "-o", f"remount,{options}", self.folder, check=False).returncode != 0:
            if time.monotonic() > deadline:
                raise Failure(f"{self.folder} cannot be mounted {options}")
            time.sleep(0.1)

    def close(self):
        for _ in range(50):
            if run("umount", self.folder, check=False).returncode == 0:
                break
            time.sleep(0.1)
        else:
            run("umount", "-l", self.folder, check=False)
        if self.image.exists():
            self.image.unlink()


class Team:
    """Four agents on this machine. The data folder of one of them is on a separate disk."""

    def __init__(self, programs, folder, name, kind, preload):
        self.programs, self.folder, self.name = programs, folder, name
        self.file = folder / "team.yaml"
        self.flag = folder / "fails"
        self.environment = {**os.environ, "MOONDB_RUN_DIR": str(folder / "run"), "MOONDB_TEAM": str(self.file),
                            "MOONDB_FAILING_DISK": str(self.flag)}
        self.preload = preload
        run(programs / "moonctl", "config", "init", "--agents", "4", self.file, env=self.environment)
        text = self.file.read_text()
        text = re.sub(r"tcp://127\.0\.0\.1:(\d+)", lambda port: f"ipc://{folder}/p{port.group(1)}", text)
        self.file.write_text(text.replace("solve_by_itself: true", "solve_by_itself: false"))
        self.data = folder / "moondb-data" / name
        self.disk = Disk(kind, self.data, folder / "disk.image")
        self.node = 0

    def moonctl(self, *arguments, check=True, env=None):
        return run(self.programs / "moonctl", *arguments, check=check, env=env or self.environment)

    def up(self, *names):
        for name in names or NAMES:
            env = dict(self.environment)
            if self.preload and name == self.name:
                env["LD_PRELOAD"] = str(self.preload)
            self.moonctl("up", "-a", name, env=env)

    def pid(self):
        status = self.status()
        return status["pid"] if status else 0

    def end(self, how):
        pid = self.pid()
        os.kill(pid, how)
        deadline = time.monotonic() + 15
        while os.path.exists(f"/proc/{pid}") and time.monotonic() < deadline:
            if open(f"/proc/{pid}/stat").read().split()[2] == "Z":
                break
            time.sleep(0.02)

    def status(self, name=None):
        done = self.moonctl("--json", "-a", name or self.name, "status", check=False)
        try:
            return json.loads(done.stdout)["agents"][0].get("status")
        except (ValueError, KeyError, IndexError):
            return None

    def storage(self):
        status = self.status()
        return status.get("storage", {}) if status else {}

    def until(self, what, condition, limit_s=40):
        deadline = time.monotonic() + limit_s
        while not condition():
            if time.monotonic() > deadline:
                raise Failure(f"not within {limit_s} s: {what}")
            time.sleep(0.1)

    def insert(self, check=True, name=None):
        self.node += 1
        name = name or self.name
        record = {"node": {"agent_id": NAMES.index(name) + 1, "index": self.node},
                  "map_from_node": {"position_m": {"x": self.node}, "orientation": {"w": 1}}}
        return self.moonctl("-a", name, "record", "insert", "pose_graph_node", json.dumps(record), check=check)

    def insert_map(self, check=True):
        import base64
        side = 280
        layer = {"width_cells": side, "height_cells": side, "resolution_um": 50000,
                 "cells": base64.b64encode(bytes(byte & 0x55 for byte in os.urandom(side * side // 4))).decode()}
        record = {"node": {"agent_id": NAMES.index(self.name) + 1, "index": 1},
                  "node_from_map": {"position_m": {}, "orientation": {"w": 1}}, "layers": [layer]}
        return self.moonctl("-a", self.name, "record", "insert", "local_traversability_map", json.dumps(record),
                            check=check)

    def begin(self):
        self.up()
        self.until("roles agreed", lambda: all((self.status(name) or {}).get("roles", {}).get("term", {}).get("number")
                                               for name in NAMES))
        for _ in range(8):
            self.insert()
        for _ in range(6):
            self.insert_map()
        self.moonctl("sync", "now", "--wait")
        self.moonctl("replicate", "now", "--wait")
        for _ in range(3):
            self.insert()  # These records are only on this agent's disk.
        goal = min(16 << 20, os.statvfs(self.data).f_blocks * os.statvfs(self.data).f_frsize // 8)
        self.until("the reserve is made", lambda: self.storage().get("reserve_bytes", 0) >= goal)

    def count(self, name):
        done = self.moonctl("--json", "-a", name, "record", "list", "pose_graph_node", "--limit", "1000")
        return len(json.loads(done.stdout)["records"])

    def close(self):
        if self.flag.exists():
            self.flag.unlink()
        if self.data.exists():
            try:
                self.disk.remount("rw")
            except Failure:
                pass
        self.moonctl("down", check=False)
        for name in NAMES:
            status = self.status(name)
            if status:
                os.kill(status["pid"], signal.SIGKILL)
        self.disk.close()


def expect(is_so, what):
    if not is_so:
        raise Failure(what)


def share(team, takes_roles):
    """Checks that the agent's records reach rover2: a rover's records through the leader, a leader's records directly.

    A leader that cannot store a new term must not lead after its start, and must report this. Then rover2 leads."""
    if team.name == "rover1" and not takes_roles:
        team.until("it says that it cannot store its term", lambda: (team.status() or {}).get("unstored_roles"))
        expect(team.status("rover1")["role"] == "ROLE_ROVER", "it leads in a term that it cannot store")
        health = team.moonctl("health", check=False)
        expect("cannot store term" in health.stdout, f"health: {health.stdout}")
        team.moonctl("role", "set", "rover2", "leader", "rover3", "survivor", "-a", "rover2")
        team.until("all have agreed", lambda: {(team.status(name) or {}).get("roles", {}).get("leader")
                                               for name in NAMES} == {2})
    else:
        team.moonctl("sync", "now", "--from", "rover3", "--wait")
        team.moonctl("replicate", "now", "--wait")
    team.moonctl("sync", "now", check=False)
    team.until("rover2 holds all", lambda: team.count("rover2") >= 11)


def refuses(team, words):
    done = team.insert(check=False)
    expect(done.returncode == 1, f"an insert ends with {done.returncode}: {done.stderr}")
    expect(all(word in done.stderr for word in words), f"an insert says {done.stderr}")
    health = team.moonctl("-a", team.name, "health", check=False)
    expect(health.returncode == 1 and "BAD" in health.stdout, f"health: {health.returncode}, {health.stdout}")


def starts_and_serves(team, seen, takes_roles):
    team.up(team.name)
    seen["started"] += 1
    expect(team.count(team.name) >= 11, f"{team.count(team.name)} of 11 nodes are read")
    seen["read"] += 1
    share(team, takes_roles)
    seen["shared"] += 1


def full(team, seen, number):
    team.begin()
    team.disk.fill()
    refuses(team, ["disk is full", "db prune"])
    if number % 4 < 2:
        team.insert_map(check=False)
    team.end(signal.SIGKILL if number % 2 else signal.SIGTERM)
    team.disk.fill()
    starts_and_serves(team, seen, takes_roles=True)
    if number % 2 == 0:  # Start the agent again on a full disk without the reserve.
        team.disk.fill()
        team.end(signal.SIGKILL)
        team.disk.fill()
        team.up(team.name)
        expect(team.count(team.name) >= 11, "the second start reads nothing")
        team.disk.make_room()
        team.until("the reserve is made again", lambda: team.storage().get("reserve_bytes", 0) > 1 << 20)
        team.disk.fill()
    seen["started again"] += 1
    pruned = team.moonctl("-a", team.name, "db", "prune", "--type", "local_traversability_map")
    expect("local_traversability_map" in pruned.stdout, f"prune says {pruned.stdout}")
    seen["pruned"] += 1
    team.moonctl("role", "swap")
    team.until("the other leads", lambda: (team.status("rover2") or {}).get("role") == "ROLE_LEADER")
    team.until("all have agreed", lambda: len({(team.status(name) or {}).get("roles", {}).get("term", {}).get("number")
                                               for name in NAMES}) == 1)
    leads = [name for name in NAMES if (team.status(name) or {}).get("role") == "ROLE_LEADER"]
    expect(leads == ["rover2"], f"{leads} lead")
    seen["swapped"] += 1
    team.disk.make_room()
    team.until("inserts are taken again", lambda: team.insert(check=False).returncode == 0)
    seen["went on"] += 1


def failing(team, seen, number):
    team.begin()
    team.flag.touch()
    done = team.insert(check=False)
    expect(done.returncode == 1 and "I/O error" in done.stderr, f"an insert: {done.returncode}, {done.stderr}")
    team.end(signal.SIGKILL if number % 2 else signal.SIGTERM)
    starts_and_serves(team, seen, takes_roles=False)
    refuses(team, ["error"])
    # Change the leader while the agent's disk fails. All agents, including this one, must follow the new leader.
    if team.name == "rover1":
        team.moonctl("role", "set", "rover3", "leader", "rover2", "survivor", "-a", "rover3")
    else:
        team.moonctl("role", "swap", "-a", "rover1")
    leader = "rover3" if team.name == "rover1" else "rover2"
    team.until("all follow the new leader", lambda: {(team.status(name) or {}).get("roles", {}).get("leader")
                                                     for name in NAMES} == {NAMES.index(leader) + 1})
    seen["stepped down"] += 1
    team.flag.unlink()
    team.until("inserts are taken again", lambda: team.insert(check=False).returncode == 0)
    team.until("its roles are stored", lambda: not (team.status() or {}).get("unstored_roles"))
    expect(not team.storage().get("write_trouble"), f"it still says {team.storage().get('write_trouble')}")
    seen["went on"] += 1


def read_only(team, seen, number):
    team.begin()
    team.end(signal.SIGKILL if number % 2 else signal.SIGTERM)
    team.disk.remount("ro")
    starts_and_serves(team, seen, takes_roles=False)
    refuses(team, ["read-only"])
    if number % 3 == 0:
        team.moonctl("down", "-a", team.name)
        team.up(team.name)
    seen["stopped"] += 1
    second = run(team.programs / "moondb_agent", "-t", team.file, "-a", team.name, check=False, env=team.environment,
                 timeout=20)
    expect(second.returncode == 1 and "in use" in second.stderr, f"a second process: {second.stderr}")
    team.disk.remount("rw")
    team.until("inserts are taken again", lambda: team.insert(check=False).returncode == 0)
    seen["went on"] += 1


def taken_away(team, seen, number):
    team.begin()
    pid = team.pid()
    store = team.data / "moondb.sqlite"
    how = ["removed", "moved", "cut", "its log removed"][number % 4]
    if how == "removed":
        for file in team.data.iterdir():
            if file.is_file():
                file.unlink()
    elif how == "moved":
        store.rename(team.data / "elsewhere.sqlite")
    elif how == "cut":
        os.truncate(store, 4096 * 3)
    else:
        (team.data / "moondb.sqlite-wal").unlink()
    if number % 2:
        done = team.insert(check=False)
        expect(done.returncode != 0, f"an insert after it was {how} ended with 0")
    team.until(f"the process ends after its store was {how}", lambda: not os.path.exists(f"/proc/{pid}"), 20)
    seen["ended"] += 1
    log = (team.data / "agent.log")
    if log.exists():
        lines = [line for line in log.read_text().splitlines() if "while this agent had it open" in line]
        expect(lines, f"agent.log says nothing of a store that was {how}")
    seen["said so"] += 1


CASES = {
    "full, leader": (full, "rover1"),
    "full, rover": (full, "rover3"),
    "failing, leader": (failing, "rover1"),
    "failing, rover": (failing, "rover3"),
    "read-only, leader": (read_only, "rover1"),
    "read-only, rover": (read_only, "rover3"),
    "taken away": (taken_away, "rover3"),
}
# These cases do not depend on the file system. They run on one file system only.
ON_ONE = {"failing", "taken away"}


def usable_disks(folder, wanted):
    usable = []
    for kind in wanted:
        disk = None
        try:
            disk = Disk(kind, folder / f"probe-{kind}", folder / "probe.image")
            usable.append(kind)
        except (Failure, OSError) as error:
            print(f"left out: {kind}: {error}", flush=True)
        finally:
            if disk:
                disk.close()
    return usable


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("programs", type=lambda path: pathlib.Path(path).resolve())
    parser.add_argument("--preload", type=lambda path: pathlib.Path(path).resolve())
    parser.add_argument("--trials", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first trial")
    parser.add_argument("--json", type=pathlib.Path)
    parser.add_argument("--only", default="")
    parser.add_argument("--disk", action="append", choices=sorted(DISK_MB))
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="moondb-disk") as top:
        top = pathlib.Path(top)
        disks = usable_disks(top, arguments.disk or ["tmpfs", "ext4", "btrfs"])
        if not disks:
            print("skipped: no file system can be mounted here")
            return SKIPPED
        results = collections.OrderedDict()
        is_good = True
        for case, (body, name) in CASES.items():
            if not case.startswith(arguments.only):
                continue
            if body is failing and not arguments.preload:
                print("left out: failing: no --preload")
                continue
            for kind in disks[:1] if case.split(",")[0] in ON_ONE else disks:
                seen, faults = collections.Counter(), []
                for number in range(arguments.first, arguments.first + arguments.trials):
                    folder = top / f"t{number}"
                    folder.mkdir()
                    started = time.monotonic()
                    team = Team(arguments.programs, folder, name, kind, arguments.preload)
                    try:
                        body(team, seen, number)
                    except (Failure, subprocess.TimeoutExpired, OSError, ValueError) as error:
                        faults.append(f"trial {number}: {error}")
                        log = team.data / "agent.log"
                        if log.exists():
                            print("\n".join(log.read_text().splitlines()[-15:]))
                    finally:
                        team.close()
                        shutil.rmtree(folder, ignore_errors=True)
                    line = faults[-1] if faults and faults[-1].startswith(f"trial {number}:") else "good"
                    print(f"{case}, {kind}, trial {number}: {line} ({time.monotonic() - started:.1f} s)", flush=True)
                results[f"{case}, {kind}"] = {"trials": arguments.trials, **seen, "faults": faults}
                is_good = is_good and not faults
        if arguments.json:
            arguments.json.write_text(json.dumps(results, indent=1))
        for case, result in results.items():
            counts = ", ".join(f"{step} {count}" for step, count in result.items() if step not in ("trials", "faults"))
            print(f"{case}: {result['trials']} trials: {counts}")
        return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
