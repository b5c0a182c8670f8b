#!/usr/bin/env python3
"""Trials of the team's map on every robot: records flow between four agents in network namespaces (network_lab.py).

    bench/team_map_trials.py build/dev/bin MISSION bytes           what one robot gets for the complete map, and after a solve
    bench/team_map_trials.py build/dev/bin MISSION flow --runs 3   a mission at ten times its pace; are all maps equal?
        --loss 5 --delay-ms 200 --gaps 2 --kill-leader             with a bad radio, gaps of 40 s, and the leader killed
    bench/team_map_trials.py build/dev/bin MISSION hour            bytes per robot-hour at the mission's own pace

No trial gives a command that moves records. Prints JSON. Exits with 1 if maps that should be equal differ.
"""
import argparse
import json
import pathlib
import re
import subprocess
import sys
import threading
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "tests/apps"))
import network_lab  # noqa: E402
from network_lab import NAMES, Failure  # noqa: E402

LEADER, PLAIN_ROVER = 0, 2  # Places in NAMES. rover2 is the designated survivor.
GAP_S = 40
DEAD_S = 25
SETTLE_LIMIT_S = 300
AFTER_SETTLED_S = 10
PERIOD_OF_HOUR_S = 60
MAP_TYPES = "pose_graph_node: all, optimized_pose: latest, local_traversability_map: all"


def make_team_file(team, mission, period_s, solves, with_edges):
    """Makes the team file of a mission's agents, with the addresses of the namespaces."""
    team.file = team.folder / "mission" / "team.yaml"
    network_lab.run(team.programs / "moonctl", "config", "init", "--mission", mission, "--first-port", 7400, team.file)
    text = team.file.read_text(encoding="utf-8")
    for i in range(len(NAMES)):
        text = text.replace(f"tcp://127.0.0.1:{7400 + i}", f"tcp://{network_lab.address(i)}:7400")
    edges = ", pose_graph_edge: all, pose_prior: all" if with_edges else ""
    for old, new in (("sync_period_s: 0", f"sync_period_s: {period_s}"),
                     ("\n# rovers: {", f"\nrovers: {{{MAP_TYPES}{edges}}}\n# rovers: {{"),
                     ("  local_traversability_map: none", "  local_traversability_map: all"),
                     ("failover: manual, leader_timeout_s: 120", "failover: automatic, leader_timeout_s: 15")):
        if old not in text:
            raise Failure(f"the team file has no line with {old.strip()!r}")
        text = text.replace(old, new)
    if not solves:
        text = re.sub(r"(?m)^pose_graph:.*$", "pose_graph: {solve_by_itself: false}", text)
    team.file.write_text(text, encoding="utf-8")


def settle(team):
    """Waits until the team has settled. Returns the seconds that it took."""
    begin, why = time.monotonic(), ""
    while time.monotonic() < begin + SETTLE_LIMIT_S:
        answer = json.loads(team.moonctl("--json", "status", check=False).stdout or "{}")
        if answer.get("is_settled"):
            return time.monotonic() - begin
        why = answer.get("not_settled", "status gave no answer")
        time.sleep(1)
    raise Failure(f"not settled after {SETTLE_LIMIT_S} s: {why}")


def hashes(team):
    return [json.loads(team.moonctl("-a", name, "--json", "map", "stats").stdout)["cells_hash"] for name in NAMES]


def coded_bytes_to(team, agent):
    """Returns the coded bytes that all agents together have sent to the agent in sync sessions."""
    agents = json.loads(team.moonctl("--json", "sync", "status", check=False).stdout)["agents"]
    rows = [row for sender in agents for row in sender.get("sessions", []) if row["to"] == NAMES[agent]]
    return sum(int(row["session"].get("coded_bytes", 0)) for row in rows)


def start(team):
    for agent in range(len(NAMES)):
        team.start(agent)
    team.until_joined()


def try_bytes(team, network, options):
    make_team_file(team, options.mission, period_s=2, solves=False, with_edges=False)
    start(team)
    counted = {}
    before, coded_before = network.bytes_to(PLAIN_ROVER), 0

    def count(step):
        nonlocal before, coded_before
        settle(team)
        now, coded = network.bytes_to(PLAIN_ROVER), coded_bytes_to(team, PLAIN_ROVER)
        counted[step] = {"device": now - before, "coded": coded - coded_before}
        before, coded_before = now, coded

    team.feed(options.mission)
    count("maps_and_nodes")
    team.moonctl("graph", "optimize")
    count("poses_of_the_first_solve")
    team.moonctl("graph", "matches", "--wait", "300s", check=False)
    team.moonctl("graph", "optimize", "--from-scratch")
    count("one_more_solve")
    counted["hashes"] = hashes(team)
    team.moonctl("role", "swap", NAMES[0], NAMES[1])
    count("role_swap")
    counted["hashes_after_swap"] = hashes(team)
    time.sleep(60)
    counted["idle_minute"] = network.bytes_to(PLAIN_ROVER) - before
    return counted, all(len(set(counted[key])) == 1 for key in ("hashes", "hashes_after_swap"))


def worsen(network, options):
    """Adds delay and loss to all links; the delay is that of the way there and back. Needs netem in the kernel."""
    for i, space in enumerate(network.spaces):
        for where, device in ((network.hub, f"p{i + 1}"), (space, "eth0")):
            network_lab.run("tc", "-n", where, "qdisc", "replace", "dev", device, "root", "netem", "rate",
                            network_lab.RATE, "delay", f"{options.delay_ms / 4}ms", "loss", f"{options.loss / 2}%")


def disturb(team, network, options, stop):
    """Cuts a rover's link again and again, and kills the leader once."""
    for gap in range(options.gaps):
        if stop.wait(20):
            return
        agent = 1 + gap % 3
        network.set_link(agent, False)
        stop.wait(GAP_S)
        network.set_link(agent, True)
    if options.kill_leader and not stop.wait(20):
        team.kill(LEADER)
        time.sleep(DEAD_S)
        team.start(LEADER)


def try_flow(team, network, options):
    make_team_file(team, options.mission, period_s=2, solves=True, with_edges=True)
    if options.loss or options.delay_ms:
        worsen(network, options)
    start(team)
    stop = threading.Event()
    disturbing = threading.Thread(target=disturb, args=(team, network, options, stop))
    disturbing.start()
    fed = subprocess.run([str(team.programs / "moondb_replay"), "feed", "-t", str(team.file), "--mission",
                          str(options.mission), "--speed", str(options.speed)], capture_output=True, text=True,
                         check=False)
    disturbing.join()
    if fed.returncode != 0:
        raise Failure(f"feed: {fed.stderr.strip().splitlines()[-1]}")
    seconds = settle(team)
    time.sleep(AFTER_SETTLED_S)
    found = hashes(team)
    return {"settled_after_s": round(seconds, 1), "hashes": found}, len(set(found)) == 1


def try_hour(team, network, options):
    make_team_file(team, options.mission, period_s=PERIOD_OF_HOUR_S, solves=True, with_edges=False)
    start(team)
    before = [(network.bytes_to(agent), network.bytes_from(agent)) for agent in range(len(NAMES))]
    subprocess.run([str(team.programs / "moondb_replay"), "feed", "-t", str(team.file), "--mission",
                    str(options.mission), "--to", str(options.seconds), "--speed", "1"], capture_output=True,
                   check=True)
    time.sleep(2 * PERIOD_OF_HOUR_S)  # Events may keep some record due, so this trial does not wait for "settled".
    hours = options.seconds / 3600
    counted = {}
    for agent, name in enumerate(NAMES):
        to, sent = before[agent]
        counted[name] = {"kb_received_per_hour": round((network.bytes_to(agent) - to) / 1000 / hours, 1),
                         "kb_sent_per_hour": round((network.bytes_from(agent) - sent) / 1000 / hours, 1)}
    found = hashes(team)
    return {**counted, "hashes": found}, len(set(found)) == 1


TRIALS = {"bytes": try_bytes, "flow": try_flow, "hour": try_hour}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("programs", help="folder of moonctl and the other programs")
    parser.add_argument("mission", type=lambda text: pathlib.Path(text).resolve(), help="mission folder")
    parser.add_argument("trial", choices=TRIALS)
    parser.add_argument("--runs", type=int, default=1)
    parser.add_argument("--speed", type=float, default=10)
    parser.add_argument("--seconds", type=float, default=600, help="of the mission, for hour")
    parser.add_argument("--loss", type=float, default=0, help="per cent of packets, there and back")
    parser.add_argument("--delay-ms", type=float, default=0, help="there and back")
    parser.add_argument("--gaps", type=int, default=0, help=f"times that a link is down for {GAP_S} s")
    parser.add_argument("--kill-leader", action="store_true")
    options = parser.parse_args()
    results, is_good = [], True
    try:
        for _ in range(options.runs):
            with network_lab.lab(options.programs) as (team, network):
                result, is_equal = TRIALS[options.trial](team, network, options)
            results.append(result)
            is_good = is_good and is_equal
            print(json.dumps(result), file=sys.stderr, flush=True)
    except (Failure, network_lab.Unsupported) as error:
        print(f"team_map_trials: {error}", file=sys.stderr)
        return 1
    print(json.dumps({"trial": options.trial, "mission": options.mission.name, "are_all_equal": is_good, "runs": results},
                     indent=2))
    return 0 if is_good else 1


if __name__ == "__main__":
    sys.exit(main())
