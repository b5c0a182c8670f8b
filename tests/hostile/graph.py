"""Attackers on the pose graph: a compromised member inserts measurements that should move the other robots, or more than
a solve can hold."""
import math
import pathlib
import shutil
import time

import messages
from member import Member
from messages import record
from records import own_epoch
from team import NODES, TAKEN, Failure

TAKES_ROVER3 = True
ROVER1, ROVER2, ROVER3, BASE = 1, 2, 3, 4
MOVE_MAX_M = 0.3
# The rovers drive side by side along x, at these y (m). The base station is at (-2, 0); its antenna is 1.2 m higher.
LANES_M = {ROVER1: 0.0, ROVER2: 2.0, ROVER3: 4.0}
BASE_X_M, BASE_HEIGHT_M = -2.0, 1.2
SHIFT_M = 1.0  # The distance by which the lies would move rover1 towards y.


def bring(member, records):
    session = member.session("rover1")
    epoch = own_epoch(session)
    for first in range(0, len(records), 500):
        session.bring([messages.stored(ROVER3, epoch, first + 1 + i, one)
                       for i, one in enumerate(records[first:first + 500])])


def closure(from_index, to_index, source):
    """Says that node `to_index` of rover1 lies SHIFT_M beside the place that the team knows."""
    covariance = [0.0] * 21
    for diagonal in (0, 6, 11, 15, 18, 20):
        covariance[diagonal] = 1e-4
    measurement = {"from_from_to": messages.pose(to_index - from_index, LANES_M[ROVER1] - LANES_M[ROVER3] + SHIFT_M),
                   "covariance": covariance}
    return record.Record(timestamp_ns=messages.now_ns(),
                         pose_graph_edge={"from": {"agent_id": ROVER3, "index": from_index},
                                          "to": {"agent_id": ROVER1, "index": to_index},
                                          "relative_pose": measurement, "source": source})


def distance(ends, range_m, sigma_m):
    (from_agent, from_index), (to_agent, to_index) = ends
    return record.Record(timestamp_ns=messages.now_ns(),
                         pose_graph_edge={"from": {"agent_id": from_agent, "index": from_index},
                                          "to": {"agent_id": to_agent, "index": to_index},
                                          "range": {"range_m": range_m, "variance_m2": sigma_m * sigma_m}})


def false_distance(from_index, to_index):
    """A range with a sigma of 1 mm from rover3, as if rover1 stood SHIFT_M beside its place."""
    across = LANES_M[ROVER3] - LANES_M[ROVER1] - SHIFT_M
    return distance(((ROVER3, from_index), (ROVER1, to_index)), math.hypot(to_index - from_index, across), 0.001)


def insert_true_measurements(team):
    """Gives rover1 and rover2 a first node at their start, and true ranges to each other and to the base station."""
    for agent in (ROVER1, ROVER2):
        lane = LANES_M[agent]
        records = [messages.node(agent, 0, y=lane), messages.edge(agent, 0)]
        for i in range(NODES + 1):
            records.append(distance(((agent, i), (BASE, 0)), math.hypot(i - BASE_X_M, lane, BASE_HEIGHT_M), 0.1))
            if agent == ROVER1:
                records.append(distance(((ROVER1, i), (ROVER2, i)), LANES_M[ROVER2] - lane, 0.1))
        team.insert(f"rover{agent}", records)
    team.share()


def solve(team):
    for _ in range(20):  # Retry: a restarted leader needs a moment before it leads.
        solved = team.moonctl("-a", "rover1", "graph", "optimize", check=False)
        if solved.returncode == 0:
            return solved.stdout
        time.sleep(0.5)
    raise Failure(f"the leader does not solve the pose graph: {solved.stderr.strip()[-300:]}")


def places_of(team, agent):
    """Returns the positions of the agent's nodes, by timestamp, as the leader exports them."""
    folder = pathlib.Path(team.folder / "tracks")
    shutil.rmtree(folder, ignore_errors=True)
    team.moonctl("-a", "rover1", "graph", "export", "--format", "tum", str(folder))
    lines = [line.split() for line in (folder / f"{agent}.tum").read_text().splitlines() if not line.startswith("#")]
    return {line[0]: tuple(float(number) for number in line[1:4]) for line in lines}


def lies(team, records):
    insert_true_measurements(team)
    solve(team)
    before = places_of(team, "rover1")
    with Member(team, TAKEN) as member:
        bring(member, [messages.node(ROVER3, 0, y=LANES_M[ROVER3]), messages.edge(ROVER3, 0), *records])
    solve(team)
    after = places_of(team, "rover1")
    moved = max(math.dist(place, after[stamp]) for stamp, place in before.items() if stamp in after)
    if moved > MOVE_MAX_M:
        raise Failure(f"the lies of rover3 move rover1 by {moved:.2f} m")
    health = team.moonctl("-a", "rover1", "health", check=False).stdout
    if not any("the last solve refused" in line and "rover3" in line for line in health.splitlines()):
        raise Failure(f"health does not name rover3, whose measurements are wrong: {health[-400:]}")
    team.moonctl("-a", "rover1", "graph", "quarantine", "--agent", "rover3", "--reason", "it lies")
    solve(team)
    if "the last solve refused" in team.moonctl("health", check=False).stdout:
        raise Failure("after a quarantine of rover3 the solve still refuses measurements")


def closures_of_many_sources(team, scale):
    """rover3 inserts loop closures to rover1's nodes, all wrong by 1 m, each under 40 names."""
    del scale
    lies(team, [closure(i, i, f"tool{source}") for source in range(40) for i in range(1, NODES + 1)])


def ranges_of_one_rover(team, scale):
    """rover3 inserts ranges from 8 of its nodes to all of rover1's, as if rover1 stood 1 m beside its place."""
    del scale
    lies(team, [false_distance(i, j) for i in range(1, 9) for j in range(1, NODES + 1)])


def untied_nodes(team, scale):
    """rover3 inserts 190,000 nodes without edges or maps, and the leader solves the pose graph."""
    with Member(team, TAKEN) as member:
        bring(member, [messages.node(ROVER3, 300_000 + i, x=i % 100, y=i % 77) for i in range(int(190_000 * scale))])
    solve(team)
    team.moonctl("-a", "rover1", "map", "stats")
    for line in team.moonctl("-a", "rover1", "health", check=False).stdout.splitlines():
        if "from the map or the pose graph" in line and "rover3" in line:
            return
    raise Failure("health does not say that rover3's nodes are left out")


ATTACKERS = [closures_of_many_sources, ranges_of_one_rover, untied_nodes]
LEAVES_MUCH = [closures_of_many_sources, ranges_of_one_rover, untied_nodes]
RSS_MB_MAX_OF = {untied_nodes: 190}
