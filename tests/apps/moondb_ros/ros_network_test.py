#!/usr/bin/env python3
"""Tests who finds moondb_ros, and whom it finds: programs with the settings of ROS 2's middlewares, many at once, while a
second computer is in the network, and after this computer's address changed.

Usage: ros_network_test.py PROGRAMS    PROGRAMS is the folder of moonctl, moondb_ros, ros_listener and the others.
Exit codes: 0 passed, 1 failed, 77 skipped (no network namespace can be made).
"""
import contextlib
import os
import re
import signal
import statistics
import subprocess
import sys

from ros_test import INTERFACE, LIMIT_S, MAKE_INTERFACE, Lab, main, packets_sent, require

DOMAIN = "8"
PARTICIPANTS = 25
RECONNECTING = 13
RECONNECTS = 100

AUTO_INDEX = ("<Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>{}</MaxAutoParticipantIndex>"
              "{}</Discovery>")
PEER = "<Peers><Peer address=\"localhost\"/></Peers>"
NO_MULTICAST = "<General><AllowMulticast>false</AllowMulticast></General>"
LOOPBACK = "<General><Interfaces><NetworkInterface address=\"127.0.0.1\"/></Interfaces></General>"
# As rmw_cyclonedds sets them.
CYCLONE = {
    "Cyclone on 127.0.0.1 (Humble, localhost only)": LOOPBACK,
    "Cyclone, index to 32 (Jazzy)": AUTO_INDEX.format(32, ""),
    "Cyclone, index to 32, peer localhost (Jazzy, localhost only)": NO_MULTICAST + AUTO_INDEX.format(32, PEER),
}
# Many programs of one computer, in the whole range of indices.
LOCAL = NO_MULTICAST + AUTO_INDEX.format(119, PEER)

FAST_PROFILE = """<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles"><profiles>{transport}
<participant profile_name="peer" is_default_profile="true"><rtps>{settings}</rtps></participant></profiles></dds>
"""
UDP_ON_LOOPBACK = """<transport_descriptors><transport_descriptor><transport_id>udp</transport_id><type>UDPv4</type>
<interfaceWhiteList><address>127.0.0.1</address></interfaceWhiteList></transport_descriptor></transport_descriptors>"""
FAST = {
    "Fast DDS on 127.0.0.1 (Humble, localhost only)": FAST_PROFILE.format(
        transport=UDP_ON_LOOPBACK,
        settings="<userTransports><transport_id>udp</transport_id></userTransports>"
                 "<useBuiltinTransports>false</useBuiltinTransports>"),
    "Fast DDS, peer localhost (Jazzy, localhost only)": FAST_PROFILE.format(
        transport="",
        settings="<builtin><initialPeersList><locator><udpv4><address>127.0.0.1</address></udpv4></locator>"
                 "</initialPeersList></builtin>"),
    "Fast DDS, default settings": None,
}


class NetworkLab(Lab):
    def listener(self, log, *words, prefix=()):
        words = ["--domain", DOMAIN, *words]
        with open(self.folder / log, "w", encoding="utf-8") as file:
            process = subprocess.Popen([*prefix, self.programs / "ros_listener", *words], stdout=file,
                                       stderr=subprocess.STDOUT, env=self.environment)
        self.started.append(process)
        return process

    def received(self, log):
        """Returns the seconds after which the listener of this log received the map, each time."""
        return [float(seconds) for seconds in re.findall(r"^received (\S+)$", self.text(log), re.MULTILINE)]

    def finish(self, what, processes):
        for process in processes:
            require(process.wait(timeout=LIMIT_S) == 0, f"{what}: a listener got no map")

    def fast_peer(self, name, profile):
        if profile:
            (self.folder / "fast.xml").write_text(profile, encoding="utf-8")
            self.environment["FASTRTPS_DEFAULT_PROFILES_FILE"] = str(self.folder / "fast.xml")
        check = self.start("check.log", "moondb_ros", "check", "--domain-id", DOMAIN)
        self.until("moondb_ros check listens", lambda: "listening" in self.text("check.log"))
        peer = self.run("fast_dds_peer", DOMAIN, str(LIMIT_S / 2))
        self.environment.pop("FASTRTPS_DEFAULT_PROFILES_FILE", None)
        require(peer.returncode == 0, f"{name}: {peer}\n{self.text('bridge.log')}")
        check.wait(timeout=LIMIT_S)
        require("odom to base_link" in self.text("check.log"), f"{name}: is not heard: {self.text('check.log')}")


@contextlib.contextmanager
def second_computer():
    """Makes a second computer at the other end of the network. Gives the words that run a command there."""
    with subprocess.Popen(["unshare", "-n", "sleep", "infinity"]) as sleeper:
        try:
            there = ["nsenter", "-t", str(sleeper.pid), "-n"]
            own = os.readlink("/proc/self/ns/net")
            while os.readlink(f"/proc/{sleeper.pid}/ns/net") == own:
                pass  # Until unshare has made the new namespace.
            moved = subprocess.run(f"ip link set other netns {sleeper.pid} && {' '.join(there)} bash -c "
                                   "'ip link set lo up && ip addr add 10.77.0.2/24 dev other && ip link set other up'",
                                   shell=True, check=False)
            require(moved.returncode == 0, "the second computer could not be made")
            yield there
        finally:
            sleeper.kill()


def check_second_computer(lab):
    with second_computer() as there:
        before = packets_sent()
        for log, config in (("far1.log", ""), ("far2.log", AUTO_INDEX.format(32, ""))):
            far = lab.listener(log, "--config", config, "--limit", "8", prefix=there)
            require(far.wait(timeout=LIMIT_S) == 1, f"a second computer received the map: {lab.text(log)}")
        require(packets_sent() == before == 0, f"{packets_sent()} packets were sent on {INTERFACE}")
        # Otherwise the interface would vanish some time after the second computer.
        subprocess.run(f"ip link del {INTERFACE}; {MAKE_INTERFACE}", shell=True, check=True)
    print("a second computer received nothing, and no packet was sent")


def check_cyclone(lab, name):
    log = f"cyclone{len(lab.started)}.log"
    odometry = f"odom{len(lab.started)}"
    listener = lab.listener(log, "--config", CYCLONE[name], "--odom", odometry, "--hold", "20")
    check = lab.run("moondb_ros", "check", "--odom", f"/{odometry}", "--domain-id", DOMAIN)
    require("odom to base_link" in check.stdout, f"{name}: moondb_ros does not hear it: {check.stdout}")
    lab.finish(name, [listener])
    print(f"{name}: received the map after {lab.received(log)[0]} s, and is heard")


def check_many(lab):
    names = list(CYCLONE)
    check_cyclone(lab, names[0])  # Has room for 10 programs of a computer.
    logs = [f"many{i}.log" for i in range(PARTICIPANTS)]
    many = [lab.listener(log, "--config", LOCAL, "--hold", str(LIMIT_S)) for log in logs]
    lab.until(f"{PARTICIPANTS} programs receive the map", lambda: all(lab.received(log) for log in logs))
    print(f"{PARTICIPANTS} programs at once received the map after at most {max(lab.received(log)[0] for log in logs)} s")
    for name in names[1:]:
        check_cyclone(lab, name)
    check_fast_dds(lab, FAST)
    for process in many:
        process.terminate()
    for process in many:
        process.wait(timeout=LIMIT_S)


def check_fast_dds(lab, profiles):
    if not (lab.programs / "fast_dds_peer").exists():
        print("without Fast DDS: it is not installed")
        return
    for name, profile in profiles.items():
        lab.fast_peer(name, profile)
        print(f"{name}: map and transforms received, odometry heard")


def check_large_map(lab):
    """A late reader of small and of large maps."""
    for number, side in enumerate((384, 4000)):
        domain = str(20 + number)
        log = f"large{side}.log"
        lab.start("writer.log", "ros_listener", "--domain", domain, "--write", str(side), "--hold", str(LIMIT_S))
        lab.until("the map is written", lambda: "written" in lab.text("writer.log"))
        lab.finish(f"a map of {side} cells", [lab.listener(log, "--domain", domain, "--config", LOCAL)])
        lab.started[-2].terminate()
        print(f"a late reader of a map of {side} x {side} cells: after {lab.received(log)[0]} s")


def check_stopped_reader(lab):
    """A reader that is stopped takes no map from the others, and holds up the writer by 0.1 s a map, until DDS drops it
    after 10 s."""
    domain = "22"
    writer = lab.start("slow.log", "ros_listener", "--domain", domain, "--write", "2000", "--times", "20")
    stopped = lab.listener("stopped.log", "--domain", domain, "--config", LOCAL, "--hold", str(LIMIT_S))
    lab.until("the map at the reader that will stop", lambda: lab.received("stopped.log"))
    stopped.send_signal(signal.SIGSTOP)
    other = lab.listener("other.log", "--domain", domain, "--config", LOCAL, "--hold", "3")
    lab.finish("beside a stopped reader", [other])
    newest = int(re.search(r"^newest (\d+)", lab.text("other.log"), re.MULTILINE).group(1))
    wrote = re.findall(r"^wrote (\d+) (\S+)", lab.text("slow.log"), re.MULTILINE)
    require(newest >= int(wrote[-1][0]) - 2, f"map {newest} of {wrote[-1][0]} beside a stopped reader")
    require(writer.wait(timeout=LIMIT_S) == 0, "the writer beside a stopped reader")
    longest_s = max(float(seconds) for _, seconds in re.findall(r"^wrote (\d+) (\S+)", lab.text("slow.log"), re.MULTILINE))
    require(longest_s < 2, f"writing a map took {longest_s} s beside a stopped reader")
    stopped.kill()
    print(f"beside a stopped reader: map {newest} of {wrote[-1][0]}, the longest write {longest_s} s")


def check_change_of_address(lab):
    lab.listener("before.log", "--config", LOCAL, "--hold", str(LIMIT_S))
    lab.until("the map", lambda: lab.received("before.log"))
    subprocess.run(f"ip addr add 10.77.0.9/24 dev {INTERFACE}; ip addr del 10.77.0.1/24 dev {INTERFACE}", shell=True,
                   check=True)
    lab.until("the change is seen", lambda: "addresses changed" in lab.text("bridge.log"))
    listener = lab.listener("after.log", "--config", CYCLONE["Cyclone, index to 32 (Jazzy)"])
    lab.finish("after a change of address", [listener])
    print(f"after a change of address: received the map after {lab.received('after.log')[0]} s")


def check_reconnects(lab):
    logs = [f"again{i}.log" for i in range(RECONNECTING)]
    again = [lab.listener(log, "--config", LOCAL, "--times", str(RECONNECTS)) for log in logs]
    lab.finish("reconnects", again)
    seconds = sorted(second for log in logs for second in lab.received(log))
    require(len(seconds) == RECONNECTING * RECONNECTS, f"{len(seconds)} maps were received")
    print(f"{len(seconds)} joins of {RECONNECTING} programs: the map after {statistics.median(seconds)} s (median), "
          f"{seconds[-1]} s (longest)")


def test(lab):
    made = lab.run("moonctl", "config", "init", "--agents", "2", "--name", "lab", "team/team.yaml")
    require(made.returncode == 0, f"{made}")
    up = lab.run("moonctl", "-a", "rover1", "up")
    require(up.returncode == 0, f"{up}")
    lab.start("bridge.log", "moondb_ros", "--agent", "rover1", "--domain-id", DOMAIN)
    lab.until("moondb_ros joins", lambda: "publishes" in lab.text("bridge.log"))
    # A program that stays on this computer makes the map.
    robot = lab.start("robot.log", "ros_robot", "--domain", DOMAIN, "--seconds", "20", "--speed", "5")
    lab.until("a map", lambda: "a map of" in lab.text("robot.log"))
    robot.terminate()
    robot.wait(timeout=LIMIT_S)
    check_second_computer(lab)
    check_large_map(lab)
    check_stopped_reader(lab)
    check_many(lab)
    check_change_of_address(lab)
    check_reconnects(lab)
    return 0


if __name__ == "__main__":
    sys.exit(main(__doc__, test, NetworkLab))
