#!/usr/bin/env python3
"""Measures what the page of moondb_view costs: viewers, their first picture, an update, and a slow link.

It runs a team with a mission and moondb_view at the leader. A viewer is a program that asks as the page does, one thing
after another. Alternating periods without and with viewers give the agent's CPU time; the interval is that of the pairs.
Results are printed as JSON.

Usage: view_load.py PROGRAMS MISSION [--viewers 20] [--pairs 7] [--seconds 20] [--slow-s 600] > view_load.json
"""
import argparse
import json
import os
import pathlib
import re
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import zlib

TICKS = os.sysconf("SC_CLK_TCK")
ORDER = ["team", "poses", "tiles", "timeline", "events", "lines"]


class Viewer(threading.Thread):
    """Asks as the page does. `kbps` limits what it reads; `cuts` are times in s in which it reads nothing."""

    def __init__(self, port, kbps=None):
        super().__init__(daemon=True)
        self.port, self.kbps = port, kbps
        self.start_time = time.monotonic()
        self.is_ended, self.picture_s, self.bytes = False, None, 0
        self.team_at, self.team_time, self.tile_times = None, None, []
        self.is_cut = threading.Event()
        self.socket = None

    def receive(self):
        while self.is_cut.is_set() and not self.is_ended:
            time.sleep(0.05)
        part = self.socket.recv(1024 if self.kbps else 65536)
        if not part:
            raise OSError("closed")
        self.bytes += len(part)
        if self.kbps:
            time.sleep(len(part) * 8 / (self.kbps * 1000))
        return part

    def get(self, path):
        """Returns the content, and sleeps as long as a link of `kbps` would take."""
        if self.socket is None:
            self.socket = socket.socket()
            if self.kbps:
                self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            self.socket.settimeout(60)
            self.socket.connect(("127.0.0.1", self.port))
        self.socket.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\nAccept-Encoding: deflate\r\n\r\n".encode())
        data = b""
        while b"\r\n\r\n" not in data:
            data += self.receive()
        head, data = data.split(b"\r\n\r\n", 1)
        length = int(re.search(rb"Content-Length: (\d+)", head).group(1))
        while len(data) < length:
            data += self.receive()
        return zlib.decompress(data) if b"Content-Encoding: deflate" in head else data

    def run(self):
        since, parts, tiles = 0, set(), {}
        while not self.is_ended:
            try:
                changes = json.loads(self.get(f"/api/changes?since={since}"))
                since = changes["version"]
                parts |= set(changes["resources"])
                tiles.update({(x, y): v for x, y, v in changes["tiles"]})
                self.fetch(parts, tiles, (changes["map"] or {}).get("id"))
            except OSError:
                self.socket = None
                time.sleep(0.2)

    def fetch(self, parts, tiles, map_id):
        for name in ORDER:
            if name == "tiles":
                # The page asks for changes meanwhile. A viewer on a slow link does so after each group.
                while tiles:
                    places = list(tiles)[:64]
                    self.get(f"/tiles?map={map_id}&at=" + ";".join(f"{x},{y}" for x, y in places))
                    self.tile_times.append(time.time())
                    for place in places:
                        tiles.pop(place)
                    if self.kbps:
                        break
                if not tiles and self.picture_s is None:
                    self.picture_s = time.monotonic() - self.start_time
            elif name in parts:
                parts.discard(name)
                content = json.loads(self.get(f"/api/{name}"))
                if name == "team":
                    self.team_at, self.team_time = time.time(), content["time_s"]

    def end(self):
        self.is_ended = True


def cpu_s(pid):
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rsplit(") ", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def memory_mb(pid):
    return int(re.search(r"VmHWM:\s+(\d+)", pathlib.Path(f"/proc/{pid}/status").read_text(encoding="utf-8")).group(1)) / 1000


class Team:
    def __init__(self, programs, folder, mission):
        self.programs, self.folder = programs, folder
        self.environment = dict(os.environ, MOONDB_RUN_DIR=f"{folder}/run", MOONDB_TEAM=f"{folder}/team/team.yaml")
        self.run("moonctl", "config", "init", "--mission", mission, f"{folder}/team/team.yaml", "--first-port", "18640")
        self.run("moonctl", "up")
        self.run("moondb_replay", "feed", "--mission", mission)
        self.run("moonctl", "sync", "now", "--wait")
        self.run("moonctl", "graph", "optimize")
        self.run("moonctl", "graph", "matches", "--wait", "10m")
        self.run("moonctl", "graph", "optimize")
        status = json.loads(self.run("moonctl", "-a", "rover1", "--json", "status"))
        self.agent_pid = status["agents"][0]["status"]["pid"]
        self.view = subprocess.Popen([programs / "moondb_view", "--agent", "rover1", "--port", "0"], text=True,
                                     stdout=subprocess.PIPE, env=self.environment)
        self.port = int(re.search(r":(\d+)/", self.view.stdout.readline()).group(1))

    def run(self, program, *words):
        return subprocess.run([self.programs / program, *words], env=self.environment, check=True, capture_output=True,
                              text=True).stdout

    def insert(self, number):
        self.run("moonctl", "-a", "rover1", "record", "insert", "temperature", json.dumps({"celsius": number}))

    def end(self):
        self.view.terminate()
        self.view.wait()
        self.run("moonctl", "down")


def measure_viewers(team, options):
    """Returns the agent's CPU time in s per s without and with viewers, and the viewers' first pictures."""
    pairs, pictures = [], []
    for _ in range(options.pairs):
        loads = []
        for count in (0, options.viewers):
            viewers = [Viewer(team.port) for _ in range(count)]
            for viewer in viewers:
                viewer.start()
            time.sleep(3)
            before, start = cpu_s(team.agent_pid), time.monotonic()
            time.sleep(options.seconds)
            loads.append((cpu_s(team.agent_pid) - before) / (time.monotonic() - start))
            for viewer in viewers:
                viewer.end()
            pictures += [viewer.picture_s for viewer in viewers if viewer.picture_s]
            time.sleep(6)  # Until nobody counts as a viewer.
        pairs.append(loads)
    extra = sorted(100 * (with_ - without) for without, with_ in pairs)
    return {"cpu_percent_without": round(100 * statistics.median(pair[0] for pair in pairs), 2),
            "cpu_percent_with": round(100 * statistics.median(pair[1] for pair in pairs), 2),
            "extra_percent_median": round(statistics.median(extra), 2),
            "extra_percent_range": [round(extra[0], 2), round(extra[-1], 2)],
            "first_picture_s_median": round(statistics.median(pictures), 3),
            "first_picture_s_longest": round(max(pictures), 3), "pictures": len(pictures)}


def measure_inserts(team, options):
    """Returns the time of 50 inserts, without and with viewers, in ms, alternating."""
    pairs = []
    for _ in range(options.pairs):
        times = []
        for count in (0, options.viewers):
            viewers = [Viewer(team.port) for _ in range(count)]
            for viewer in viewers:
                viewer.start()
            time.sleep(2)
            start = time.monotonic()
            for number in range(20):
                team.insert(number)
            times.append((time.monotonic() - start) * 50)
            for viewer in viewers:
                viewer.end()
            time.sleep(1)
        pairs.append(times)
    ratios = sorted(with_ / without for without, with_ in pairs)
    return {"insert_ms_without": round(statistics.median(pair[0] for pair in pairs), 1),
            "insert_ms_with": round(statistics.median(pair[1] for pair in pairs), 1),
            "ratio_median": round(statistics.median(ratios), 3), "ratio_range": [round(ratios[0], 3), round(ratios[-1], 3)]}


def measure_update(team):
    """Returns the times from a quarantine, which changes the map, to the first changed tile at a viewer."""
    viewer = Viewer(team.port)
    viewer.start()
    time.sleep(5)
    found = []
    for _ in range(5):
        seen, start = len(viewer.tile_times), time.time()
        said = team.run("moonctl", "-a", "rover1", "map", "quarantine", "--agent", "rover2", "--from", "2020-01-01T00:00Z",
                        "--reason", "measurement")
        while len(viewer.tile_times) == seen and time.time() - start < 60:
            time.sleep(0.01)
        found.append(viewer.tile_times[seen] - start if len(viewer.tile_times) > seen else None)
        team.run("moonctl", "-a", "rover1", "map", "quarantine", "--lift", said.split()[1])
        time.sleep(5)
    viewer.end()
    return {"update_s": [value and round(value, 2) for value in found]}


def measure_slow(team, options):
    """One viewer at 64 kbit/s, with two cuts of a minute. Returns how old its state was, apart from the cuts."""
    viewer = Viewer(team.port, kbps=64)
    viewer.start()
    start, ages, after_cut = time.monotonic(), [], []
    cuts = [(options.slow_s * part, options.slow_s * part + min(60, options.slow_s / 6)) for part in (0.3, 0.6)]
    while (now := time.monotonic() - start) < options.slow_s:
        is_cut = any(begin <= now < end for begin, end in cuts)
        (viewer.is_cut.set if is_cut else viewer.is_cut.clear)()
        age = time.time() - viewer.team_time if viewer.team_time else None
        if any(end + 5 <= now < end + 6 for _, end in cuts) and age is not None:
            after_cut.append(age)
        elif age is not None and not any(begin <= now < end + 5 for begin, end in cuts):
            ages.append(age)
        time.sleep(0.1)
    viewer.end()
    return {"slow_age_s_median": round(statistics.median(ages), 2), "slow_age_s_longest": round(max(ages), 2),
            "slow_age_s_5_s_after_a_cut": round(max(after_cut), 2), "slow_kbytes": round(viewer.bytes / 1000),
            "first_picture_at_64_kbps_s": viewer.picture_s and round(viewer.picture_s, 1)}


def measure_misuse(team):
    """1,000 connections, half of which ask for something and never read. Returns the agent's answer times meanwhile."""
    def answer_ms():
        start = time.monotonic()
        team.run("moonctl", "-a", "rover1", "role", "show")
        return (time.monotonic() - start) * 1000
    before = statistics.median(answer_ms() for _ in range(15))
    held = []
    for number in range(1000):
        connection = socket.socket()
        connection.settimeout(5)
        try:
            connection.connect(("127.0.0.1", team.port))
            if number % 2:
                connection.sendall(b"GET /api/lines HTTP/1.1\r\nHost: localhost\r\n\r\n" * 20)
        except OSError:
            pass
        held.append(connection)
    during = statistics.median(answer_ms() for _ in range(15))
    for connection in held:
        connection.close()
    return {"answer_ms_before": round(before, 1), "answer_ms_with_1000_connections": round(during, 1)}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("mission")
    parser.add_argument("--viewers", type=int, default=20)
    parser.add_argument("--pairs", type=int, default=7)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--slow-s", type=float, default=600)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="moondb-view-load-") as folder:
        team = Team(options.programs.resolve(), folder, str(pathlib.Path(options.mission).resolve()))
        try:
            time.sleep(5)
            result = {"mission": pathlib.Path(options.mission).name, "viewers": options.viewers}
            result |= measure_viewers(team, options) | measure_inserts(team, options) | measure_update(team)
            result |= measure_misuse(team)
            time.sleep(1)
            if options.slow_s > 0:
                result |= measure_slow(team, options)
            result["view_memory_mb"] = round(memory_mb(team.view.pid), 1)
        finally:
            team.end()
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    sys.exit(main())
