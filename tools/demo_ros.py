"""Runs three simulated robots as a ROS 2 graph shows them, each with its agent and moondb_ros (see tools/demo --ros).

No robot knows where it starts. Each publishes /roverN/odom, /roverN/scan and /roverN/tf_static, and subscribes to
/roverN/team_map and /roverN/tf, as Nav2 would. The demo prints what these subscribers receive, and writes one picture of
the last map. No ROS is needed.
"""
import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

from demo_team import DemoError, free_port_run, make_empty, run_and_report

ROBOT_COUNT = 3
DOMAIN = 76  # Not ROS's default, so that the demo meets no robot of this computer.
SPEED = 5
DRIVE_S = 150  # Simulated seconds.
LIMIT_S = 300
MAP_PERIOD_S = 7  # moondb_ros writes a changed map at most each 5 s.


class Demo:
    def __init__(self, programs, out, run_folder):
        self.programs, self.out, self.started = pathlib.Path(programs), out, time.monotonic()
        self.environment = dict(os.environ, MOONDB_TEAM=str(out / "team/team.yaml"), MOONDB_RUN_DIR=run_folder,
                                ROS_DOMAIN_ID=str(DOMAIN))
        self.robots = {}
        self.shown = {}  # Lines of each robot's log that were shown.

    def say(self, text):
        print(f"[{time.monotonic() - self.started:6.1f} s] {text}", flush=True)

    def moonctl(self, *words, check=True):
        done = subprocess.run([self.programs / "moonctl", *words], env=self.environment, capture_output=True, text=True,
                              timeout=LIMIT_S, check=False)
        if check and done.returncode != 0:
            raise DemoError(f"moonctl {' '.join(words)}: {(done.stderr or done.stdout).strip()}")
        return done.stdout

    def log(self, name):
        return self.out / f"{name}.log"

    def start_robot(self, number):
        name = f"rover{number}"
        with open(self.log(name), "w", encoding="utf-8") as log:
            self.robots[name] = subprocess.Popen(
                [self.programs / "ros_robot", "--robot", str(number), "--namespace", name, "--domain", str(DOMAIN),
                 "--seconds", str(DRIVE_S), "--speed", str(SPEED), "--map", self.out / f"team_map_of_{name}.png"],
                stdout=log, env=self.environment)

    def show_received(self):
        for name in self.robots:
            lines = self.log(name).read_text(encoding="utf-8").splitlines()
            for line in lines[self.shown.get(name, 0):]:
                if line.startswith("at "):
                    self.say(f"{name} receives {line}")
            self.shown[name] = len(lines)

    def received(self, name):
        """Returns the robot's lines about what it received, without their times."""
        lines = self.log(name).read_text(encoding="utf-8").splitlines()
        return [line.split(": ", 1)[1] for line in lines if line.startswith("at ")]

    def has_one_map(self):
        """Returns whether each robot has a transform, and the last maps of all look alike."""
        received = [self.received(name) for name in self.robots]
        return (all(any("transform" in line for line in lines) for lines in received)
                and len({[line for line in lines if "map of" in line][-1] for lines in received}) == 1)

    def wait_for_one_map(self):
        """Shows what the robots receive until all are placed and have received one map for some seconds."""
        end, waits, equal_since = time.monotonic() + LIMIT_S, None, None
        while True:
            self.show_received()
            is_driven = time.monotonic() - self.started > DRIVE_S / SPEED
            equal_since = (equal_since or time.monotonic()) if is_driven and self.has_one_map() else None
            if equal_since and time.monotonic() - equal_since > MAP_PERIOD_S:
                return
            status = self.moonctl("status", check=False)
            unplaced = re.findall(r"^(\S+): not placed", status, re.MULTILINE)
            if unplaced != waits:
                self.say(f"not placed in the team's map yet: {', '.join(unplaced)}" if unplaced
                         else "all robots are placed in the team's map")
                waits = unplaced
            if time.monotonic() > end:
                raise DemoError(f"the robots did not get one map within {LIMIT_S} s:\n{status}")
            time.sleep(1)

    def end_robots(self):
        for robot in self.robots.values():
            robot.terminate()
        for robot in self.robots.values():
            robot.wait(timeout=60)


def run(demo):
    demo.say(f"make a team of {ROBOT_COUNT} robots; none of them knows where it starts")
    team = demo.out / "team/team.yaml"
    demo.moonctl("config", "init", "--lab", "--robots", str(ROBOT_COUNT), "--name", "lab", "--first-port",
                 str(free_port_run(ROBOT_COUNT)), str(team))
    (team.parent / "ros.yaml").write_text(f"sim_time: true\ndomain_id: {DOMAIN}\n", encoding="utf-8")
    demo.say("moonctl up --with ros: an agent and moondb_ros for each robot")
    print(demo.moonctl("up", "--with", "ros"), end="")
    try:
        demo.say(f"the robots drive for {DRIVE_S} s of simulated time, {SPEED} times as fast as real ones")
        for number in range(1, ROBOT_COUNT + 1):
            demo.start_robot(number)
        demo.wait_for_one_map()
    finally:
        demo.end_robots()
        demo.moonctl("down", check=False)
    report(demo)


def report(demo):
    maps = set()
    print(f"\n{'':10}{'team_map':>24}{'known cells':>14}{'hazards':>10}{'maps':>7}")
    for name in demo.robots:
        text = demo.log(name).read_text(encoding="utf-8")
        last = re.search(r"^map (\d+) (\d+) (\S+) (\d+) (\d+) (\d+) (\S+)", text, re.MULTILINE)
        if not last or not re.search("^placed", text, re.MULTILINE):
            raise DemoError(f"{name} received no map or no transform; see {demo.log(name)}")
        width, height, cell_m, known, hazards, count, content = last.groups()
        maps.add((width, height, content))
        print(f"{name:10}{f'{width} x {height} of {float(cell_m):.2f} m':>24}{known:>14}{hazards:>10}{count:>7}")
    print(f"\nall robots received the same map: {'yes' if len(maps) == 1 else 'NO'}")
    shutil.copy(demo.out / "team_map_of_rover1.png", demo.out / "team_map.png")
    print(f"Look at {demo.out}/team_map.png: light is free, dark red a hazard, grey unknown.")


def main():
    parser = argparse.ArgumentParser(prog="tools/demo --ros", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", default="out", help="folder for the results; emptied first (default: out)")
    parser.add_argument("--bin", help=argparse.SUPPRESS, default=pathlib.Path(__file__).parent.parent / "build/dev/bin")
    options = parser.parse_args()
    out = pathlib.Path(options.out).resolve()
    make_empty(out)
    with tempfile.TemporaryDirectory(prefix="moondb-") as run_folder:
        run(Demo(options.bin, out, run_folder))


if __name__ == "__main__":
    sys.exit(run_and_report(main))
