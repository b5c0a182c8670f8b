#!/usr/bin/env python3
"""Reads what `moonctl export mcap` writes with the readers that Foxglove uses, and compares the values with other exports.

Usage: mcap_readers_test.py PROGRAMS FOLDER    FOLDER gets the packages of the readers (package-lock.json), by npm.
Exit codes: 0 passed, 1 failed, 77 skipped (node or npm is missing, or npm cannot fetch the packages; it says which).
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

SKIPPED = 77
HERE = pathlib.Path(__file__).resolve().parent
ROVERS = ["rover1", "rover2", "rover3"]


def run(command, **options):
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, **options)
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout


def install_readers(folder):
    """Returns why the readers cannot be installed, or None."""
    for program in ("node", "npm"):
        if shutil.which(program) is None:
            return f"there is no {program}"
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("package.json", "package-lock.json", "read_mcap.mjs"):
        shutil.copy(HERE / name, folder)
    done = subprocess.run(["npm", "ci", "--no-audit", "--no-fund"], cwd=folder, capture_output=True, text=True, timeout=300)
    return None if done.returncode == 0 else "npm ci failed: " + done.stderr[-500:]


def make_recording(environment, folder):
    """Runs a team, and returns the exported file, the tracks by TUM and the counts of cells of the exported map."""
    run(["moondb_mission", "generate", "--seed", "7", "--minutes", "3", "--out", "mission"], env=environment, cwd=folder)
    run(["moonctl", "config", "init", "--mission", "mission", "team/team.yaml", "--first-port", "19840"], env=environment,
        cwd=folder)
    try:
        run(["moonctl", "up"], env=environment, cwd=folder)
        run(["moondb_replay", "feed", "--mission", "mission"], env=environment, cwd=folder)
        run(["moonctl", "sync", "now", "--wait"], env=environment, cwd=folder)
        run(["moonctl", "graph", "optimize"], env=environment, cwd=folder)
        run(["moonctl", "export", "mcap", "recording"], env=environment, cwd=folder)
        run(["moonctl", "graph", "export", "tracks", "--format", "tum"], env=environment, cwd=folder)
        stats = json.loads(run(["moonctl", "--json", "map", "stats"], env=environment, cwd=folder))
    finally:
        subprocess.run(["moonctl", "down"], env=environment, cwd=folder, capture_output=True, timeout=60)
    tracks = {name: [list(map(float, line.split())) for line in (folder / "tracks" / f"{name}.tum").read_text().splitlines()
                     if line and not line.startswith("#")] for name in ROVERS}
    return folder / "recording/recording_0.mcap", tracks, stats


def check(what, found, expected):
    if found != expected:
        raise RuntimeError(f"{what}: found {found!r}, expected {expected!r}")


def pose_of(value):
    """Returns the numbers of a line of a TUM file, without the time."""
    position, turn = value["position"], value["orientation"]
    return [position[axis] for axis in "xyz"] + [turn[axis] for axis in "xyzw"]


def check_recording(read, tracks, stats):
    topics = read["topics"]
    check("profile", read["profile"], "ros2")
    check("metadata", read["metadata"]["moondb"]["team"], "mission")
    count = sum(len(topic["messages"]) for topic in topics.values())
    check("messages by the index", str(count), read["messageCount"])
    check("messages of the stream", read["streamed"], {"count": count, "isDone": True})
    check("the cut file has an end", read["cut"]["isDone"], False)
    check("a message of the cut file", read["cut"]["count"] > 0, True)
    for name in ROVERS:
        topic = topics[f"/team/{name}/pose"]
        check("type", topic["type"], "geometry_msgs/msg/PoseStamped")
        messages = topic["messages"]
        check(f"poses of {name}", [pose_of(message["value"]["pose"]) for message in messages],
              [line[1:] for line in tracks[name]])
        for message, line in zip(messages, tracks[name]):
            stamp = message["value"]["header"]["stamp"]
            check("stamp", f"{stamp['sec']}{stamp['nanosec']:09}", message["time"])
            check("time", abs(int(message["time"]) / 1e9 - line[0]) < 1e-6, True)
    moved = [message["value"]["transforms"][0]["child_frame_id"] for message in topics["/tf"]["messages"]]
    check("frames", set(moved), {f"{name}/base_link" for name in ROVERS + ["base"]})
    newest = topics["/team_map"]["messages"][-1]["value"]
    check("frame", newest["header"]["frame_id"], "team_map")
    check("cells of the map", [newest["data"].get("0", 0), newest["data"].get("100", 0)],
          [int(stats["free_cell_count"]), int(stats["hazard_cell_count"])])
    check("an event", any("started" in message["value"]["msg"] for message in topics["/team/events"]["messages"]), True)


def main():
    programs, packages = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
    if why := install_readers(packages):
        print("skipped:", why)
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="moondb-mcap-") as folder:
        environment = dict(os.environ, PATH=f"{programs}:{os.environ['PATH']}", MOONDB_RUN_DIR=f"{folder}/run",
                           MOONDB_TEAM=f"{folder}/team/team.yaml")
        file, tracks, stats = make_recording(environment, pathlib.Path(folder))
        read = json.loads(run(["node", "read_mcap.mjs", str(file)], cwd=packages))
        check_recording(read, tracks, stats)
    print("passed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
