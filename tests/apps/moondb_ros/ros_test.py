#!/usr/bin/env python3
"""Runs three robots, as a ROS 2 graph shows them, with moondb_ros and an agent each, in a network of their own.

All robots start at unknown places. Checks that each receives the same map, that tf places each where it is, that an
agent which is killed for a while gets all nodes, and what moondb_ros prints for mistakes. A second network interface is
up, as on a robot; nothing is sent there. Then a peer with Fast DDS takes the place of one robot.

Usage: ros_test.py PROGRAMS    PROGRAMS is the folder of moonctl, moondb_ros, ros_robot and the others.
Exit codes: 0 passed, 1 failed, 77 skipped (no network namespace can be made).
"""
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import time

SKIPPED = 77
DOMAIN = "7"
INTERFACE = "lab0"
MAKE_INTERFACE = (f"ip link add {INTERFACE} type veth peer name other; ip addr add 10.77.0.1/24 dev {INTERFACE}; "
                  f"ip link set {INTERFACE} up; ip link set other up")
ROBOTS = (1, 2, 3)
EPOCH_S = 1577836800  # The time at which simulated time is 0.
SPEED = 5
SIMULATED_S = 150
LIMIT_S = 600  # The limit of each wait: ten times what an idle machine needs.


class Failure(Exception):
    pass


def require(condition, text):
    if not condition:
        raise Failure(text)


def in_own_network():
    """Runs this program again in a new network namespace. Returns False if this machine allows none."""
    if os.environ.get("MOONDB_OWN_NETWORK"):
        return True
    if os.geteuid() != 0 or not shutil.which("unshare"):
        return False
    if subprocess.run(["unshare", "-n", "ip", "link", "set", "lo", "up"], capture_output=True).returncode != 0:
        return False
    os.environ["MOONDB_OWN_NETWORK"] = "1"
    set_up = f"ip link set lo up; sysctl -qw net.ipv6.conf.all.disable_ipv6=1; {MAKE_INTERFACE}; "
    os.execvp("unshare", ["unshare", "-n", "bash", "-c", set_up + 'exec "$@"', "bash", sys.executable, *sys.argv])


def packets_sent():
    shown = subprocess.run(["ip", "-s", "-j", "link", "show", INTERFACE], capture_output=True, text=True, check=True)
    return json.loads(shown.stdout)[0]["stats64"]["tx"]["packets"]


class Lab:
    def __init__(self, programs, folder):
        self.programs, self.folder = programs, pathlib.Path(folder)
        self.environment = dict(os.environ, MOONDB_RUN_DIR=f"{folder}/run", MOONDB_TEAM=f"{folder}/team/team.yaml",
                                HOME=str(folder), NO_COLOR="1", COLUMNS="200")
        self.started = []
        self.bridges = {}  # moondb_ros of each robot.

    def run(self, *command):
        return subprocess.run([self.programs / command[0], *command[1:]], cwd=self.folder, env=self.environment,
                              capture_output=True, text=True, timeout=LIMIT_S)

    def start(self, log, *command):
        with open(self.folder / log, "w", encoding="utf-8") as file:
            process = subprocess.Popen([self.programs / command[0], *command[1:]], cwd=self.folder, stdout=file,
                                       stderr=subprocess.STDOUT, env=self.environment)
        self.started.append(process)
        return process

    def bridge(self, robot, log):
        self.bridges[robot] = self.start(log, "moondb_ros", "--agent", f"rover{robot}", "--namespace", f"robot{robot}",
                                         "--domain-id", DOMAIN, "--sim-time")

    def robot(self, robot, seconds, log):
        return self.start(log, "ros_robot", "--robot", str(robot), "--namespace", f"robot{robot}", "--domain", DOMAIN,
                          "--seconds", str(seconds), "--speed", str(SPEED), "--truth", str(self.folder / f"truth{robot}"))

    def text(self, log):
        return (self.folder / log).read_text(encoding="utf-8")

    def until(self, what, condition):
        end = time.monotonic() + LIMIT_S
        while not condition():
            require(time.monotonic() < end, f"{what}: not within {LIMIT_S} s\n{self.run('moonctl', 'status').stdout}")
            time.sleep(0.5)

    def nodes(self, robot):
        answer = self.run("moonctl", "-a", f"rover{robot}", "record", "list", "pose_graph_node", "--origin",
                          f"rover{robot}", "--limit", "1000", "--json")
        return answer.stdout.count('"pose_graph_node"')

    def placed_count(self):
        stats = json.loads(self.run("moonctl", "graph", "stats", "--json").stdout or "{}")
        return sum(not rover["is_unplaced"] for rover in stats.get("last_solve", {}).get("rovers", []))

    def end(self):
        for process in self.started:
            process.terminate()
        for process in self.started:
            process.wait(timeout=60)
        self.run("moonctl", "down")


def place_of(report):
    found = re.search(r"^placed (.*)$", report, re.MULTILINE)
    require(found, f"the robot received no transform:\n{report}")
    return [float(number) for number in found.group(1).split()]


def to_truth(place):
    """Returns the pose (x, y, yaw) of the team's map in the building, by one robot's pose in both."""
    x, y, yaw, true_x, true_y, true_yaw = place
    turn = true_yaw - yaw
    return (true_x - math.cos(turn) * x + math.sin(turn) * y, true_y - math.sin(turn) * x - math.cos(turn) * y, turn)


def trajectory_error(lab):
    """Returns the root mean square distance of all optimized nodes from the truth, after one rotation and shift in the
    plane that fits the whole team best, and the number of nodes."""
    exported = lab.run("moonctl", "-a", "rover1", "graph", "export", "poses", "--format", "tum")
    require(exported.returncode == 0, f"{exported}")
    pairs = []
    for robot in ROBOTS:
        truth = {int(line.split()[0]): complex(*map(float, line.split()[1:3]))
                 for line in lab.text(f"truth{robot}").splitlines()}
        for line in lab.text(f"poses/rover{robot}.tum").splitlines():
            if line.startswith("#"):
                continue
            time_s, x, y = map(float, line.split()[:3])
            # A robot that stands after its drive has no truth of its own there.
            pairs.append((complex(x, y), truth.get(round(time_s - EPOCH_S), truth[max(truth)])))
    poses_mean = sum(pose for pose, _ in pairs) / len(pairs)
    truth_mean = sum(true for _, true in pairs) / len(pairs)
    turn = sum((pose - poses_mean).conjugate() * (true - truth_mean) for pose, true in pairs)
    turn /= abs(turn)
    squares = [abs(turn * (pose - poses_mean) + truth_mean - true) ** 2 for pose, true in pairs]
    return math.sqrt(sum(squares) / len(squares)), len(pairs)


def check_mistakes(lab):
    wrong = lab.run("moondb_ros", "--agent", "rover9")
    require(wrong.returncode == 2 and "rover9" in wrong.stderr, f"an unknown agent: {wrong}")
    (lab.folder / "ros.yaml").write_text("agent: rover1\nodm: /odom\n", encoding="utf-8")
    wrong = lab.run("moondb_ros", "--config", "ros.yaml")
    require(wrong.returncode == 2 and 'ros.yaml:2:1' in wrong.stderr and 'mean "odom"' in wrong.stderr, f"{wrong}")
    second = lab.run("moondb_ros", "--agent", "rover1", "--domain-id", DOMAIN)
    require(second.returncode == 1 and "another moondb_ros runs for rover1" in second.stderr, f"a second one: {second}")
    silent = lab.run("moondb_ros", "check", "--namespace", "robot9", "--domain-id", DOMAIN)
    require(silent.returncode == 1 and "/robot9/odom: no publisher was found in domain 7" in silent.stdout, f"{silent}")


def check_fast_dds(lab):
    """Robots of ROS 2's default middleware, in its default settings, which also uses the second interface."""
    if not (lab.programs / "fast_dds_peer").exists():
        print("without Fast DDS: it is not installed")
        return
    lab.bridges[1].terminate()
    lab.bridges[1].wait(timeout=LIMIT_S)
    before = lab.nodes(1)
    lab.start("fast.log", "moondb_ros", "--agent", "rover1", "--domain-id", "8")
    peer = lab.run("fast_dds_peer", "8", str(LIMIT_S - 60))
    require(peer.returncode == 0, f"Fast DDS: {peer}\n{lab.text('fast.log')}")
    require(lab.nodes(1) > before, f"Fast DDS: no node was made\n{lab.text('fast.log')}")
    print(f"Fast DDS: {' '.join(peer.stdout.split())}")


def check_up_with_ros(lab):
    """moonctl up and down start and end moondb_ros with the agents."""
    settings = lab.folder / "team/ros.yaml"
    settings.write_text("sim_tme: true\n", encoding="utf-8")
    up = lab.run("moonctl", "up", "--with", "ros")
    require(up.returncode == 1 and 'mean "sim_time"' in up.stdout, f"a mistake in ros.yaml: {up}")
    settings.write_text(f"sim_time: true\ndomain_id: {DOMAIN}\n", encoding="utf-8")
    up = lab.run("moonctl", "up", "--with", "ros")
    require(up.returncode == 0 and len(re.findall(r"moondb_ros of .* started", up.stdout)) == len(ROBOTS), f"{up}")
    again = lab.run("moonctl", "up", "--with", "ros")
    require(again.returncode == 0 and len(re.findall(r"moondb_ros of .* was running", again.stdout)) == len(ROBOTS), f"{again}")
    down = lab.run("moonctl", "down")
    require(down.returncode == 0 and len(re.findall(r"moondb_ros of .* stopped", down.stdout)) == len(ROBOTS), f"{down}")
    require("moondb_ros" not in lab.run("moonctl", "down").stdout, "a second end of moondb_ros")
    # rover1 had made its node 5 (RosState), and its agent lost its store.
    state = lab.folder / "elsewhere/rover1/ros/moondb_ros.state"
    state.parent.mkdir(parents=True)
    state.write_bytes(bytes([1 << 3, 5, 5 << 3 | 2, 0]))
    up = lab.run("moonctl", "up", "--with", "ros", "--data-dir", "elsewhere")
    require(up.returncode == 0 and "the agent's store lacks node 5 of this robot" in up.stdout, f"a lost store: {up}")
    down = lab.run("moonctl", "down", "--data-dir", "elsewhere")
    require(len(re.findall(r"moondb_ros of .* stopped", down.stdout)) == len(ROBOTS), f"down --data-dir: {down}")
    settings.unlink()


def test(lab):
    made = lab.run("moonctl", "config", "init", "--lab", "--robots", str(len(ROBOTS)), "--name", "lab", "team/team.yaml")
    require(made.returncode == 0, f"{made}")
    check_up_with_ros(lab)
    up = lab.run("moonctl", "up")
    require(up.returncode == 0, f"{up}")
    for robot in ROBOTS:
        lab.bridge(robot, f"bridge{robot}.log")
    lab.until("moondb_ros joins", lambda: all("publishes" in lab.text(f"bridge{robot}.log") for robot in ROBOTS))
    check_mistakes(lab)

    robots = [lab.robot(robot, SIMULATED_S, f"robot{robot}.log") for robot in ROBOTS]
    lab.until("nodes of rover2", lambda: lab.nodes(2) > 10)
    working = lab.run("moondb_ros", "check", "--namespace", "robot1", "--domain-id", DOMAIN, "--sim-time")
    require(working.returncode == 0 and "odometry and maps work" in working.stdout, f"{working}")
    # An agent that is gone for a while gets the nodes of that time, and its odometry has no gap.
    lab.run("moonctl", "-a", "rover2", "down")
    before = time.monotonic()
    lab.until("a while without the agent", lambda: time.monotonic() - before > 4)
    lab.run("moonctl", "-a", "rover2", "up")
    lab.until("all robots have driven", lambda: all(lab.nodes(robot) > 30 for robot in ROBOTS))
    lab.until("all are placed", lambda: lab.run("moonctl", "graph", "optimize").returncode == 0
              and lab.placed_count() == len(ROBOTS))
    # A robot that stands still inserts a node each minute, so soon after a solve the next one is due.
    lab.until("the records are shared and the maps matched",
              lambda: any(text in lab.run("moonctl", "status").stdout
                          for text in ("\nsettled", "not settled: a solve of the pose graph is due")))
    before = time.monotonic()
    lab.until("the last map, which is written at most each 5 s", lambda: time.monotonic() - before > 7)
    for process in robots:
        process.terminate()
        process.wait(timeout=LIMIT_S)

    maps = [re.search(r"^map (\d+) (\d+) (\S+) (\d+) (\d+) \d+ (\S+)", lab.text(f"robot{robot}.log"),
                      re.MULTILINE).groups() for robot in ROBOTS]
    require(len(set(maps)) == 1, f"the robots received different maps: {maps}")
    require(int(maps[0][3]) > 40_000 and int(maps[0][4]) > 2_000, f"the map shows too little: {maps[0]}")
    truth = [to_truth(place_of(lab.text(f"robot{robot}.log"))) for robot in ROBOTS]
    print(f"map {maps[0]}, its place in the building by each robot: {truth}")
    apart_m = max(math.dist(truth[0][:2], other[:2]) for other in truth)
    apart_rad = max(abs(math.remainder(truth[0][2] - other[2], 2 * math.pi)) for other in truth)
    require(apart_m < 0.5 and apart_rad < 0.05, f"the robots do not agree on the map's place: {truth}")
    error_m, count = trajectory_error(lab)
    print(f"{count} nodes of {len(ROBOTS)} robots: trajectory error {error_m:.3f} m")
    require(error_m < 0.3, f"the trajectory error is {error_m} m")
    require(packets_sent() == 0, f"{packets_sent()} packets were sent on {INTERFACE}")
    check_fast_dds(lab)
    return 0


def main(doc, test_lab, lab_class):
    """Runs a test with a lab in its own network. Returns the exit code."""
    if len(sys.argv) != 2:
        print(doc.strip(), file=sys.stderr)
        return 2
    if not in_own_network():
        print("skipped: no network namespace can be made")
        return SKIPPED
    with tempfile.TemporaryDirectory(prefix="moondb-ros-") as folder:
        lab = lab_class(pathlib.Path(sys.argv[1]).resolve(), folder)
        try:
            return test_lab(lab)
        except Failure as failure:
            print(f"failed: {failure}")
            for log in sorted(lab.folder.glob("*.log")):
                print(f"--- {log.name}\n{log.read_text(encoding='utf-8')[-1500:]}")
            return 1
        finally:
            lab.end()


if __name__ == "__main__":
    sys.exit(main(__doc__, test, Lab))
