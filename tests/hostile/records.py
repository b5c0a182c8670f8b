"""Attackers with records: a compromised member sends records of other origins, or records that agents must not keep."""
import random
import time

import messages
from member import Member
from messages import record, types
from team import TAKEN, Failure

TAKES_ROVER3 = True
ROVER1, ROVER2, ROVER3, BASE = 1, 2, 3, 4
NODE = types.POSE_GRAPH_NODE
EVENT = types.AGENT_EVENT
MERGED_MAPS_MAX = 65_535  # Same as maps_max in actors/merge/map_collection.h.
EPOCH = 1 << 48  # Above all epochs that a new team uses.


def own_epoch(session):
    """Returns an epoch above all earlier epochs of rover3."""
    return max([stream.epoch for stream in session.have.streams if stream.origin_agent == ROVER3], default=0) + EPOCH


def records_of_another(team, scale):
    """rover3 gives the leader 200 nodes and events in rover2's name, under rover2's present epoch and next seqs."""
    team.share()
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        for name, make in (("POSE_GRAPH_NODE", lambda i: messages.node(ROVER2, 10_000 + i)),
                           ("AGENT_EVENT", lambda i: messages.event(f"role swap {i}", by="anna (key)"))):
            epoch, last = session.last_of(ROVER2, name)
            session.bring([messages.stored(ROVER2, epoch, last + 1 + i, make(i)) for i in range(200)])
    forged = {key for key in team.records("rover1") if key[1] == ROVER2} - set(team.records("rover2"))
    if forged:
        raise Failure(f"the leader holds {len(forged)} records in rover2's name that rover2 never gave")
    team.share()


def state_of_another(team, scale):
    """rover3 sends the leader a temperature in rover2's name, with a key above all later ones of rover2."""
    team.insert("rover2", [messages.temperature(20)])
    team.share()
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        epoch, _ = session.last_of(ROVER2, "TEMPERATURE")
        session.bring([messages.stored(ROVER2, epoch, messages.SEQ_MAX, messages.temperature(-273))])
    team.insert("rover2", [messages.temperature(21)])
    team.share()
    with team.store("rover1") as store:
        celsius = [row[0] for row in store.execute("SELECT celsius FROM temperature WHERE origin = ?", (ROVER2,))]
    if celsius != [21]:
        raise Failure(f"the leader takes {celsius} for rover2's temperature, which is 21")


def drops_of_another(team, scale):
    """rover3 says that rover2's next million nodes were dropped, so that nobody would ask for them."""
    team.share()
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        epoch, last = session.last_of(ROVER2, "POSE_GRAPH_NODE")
        session.bring(dropped=[messages.dropped_stream(ROVER2, epoch, NODE, last + 1_000_000, first=last + 1)],
                      remaining=0)
    team.share()


def own_epochs_used_up(team, scale):
    """rover3 brings rover1 records of rover1's own, under epochs up to 2^64 - 1, each within a jump of the last."""
    with Member(team, TAKEN) as member:
        for agent, number in (("rover1", ROVER1), ("rover2", ROVER2)):
            session = member.session(agent)
            for epoch in (1 << 62, 1 << 63, 3 << 62, (1 << 64) - 1):
                session.bring([messages.stored(number, epoch, 1, messages.temperature(1))])
    for agent in ("rover1", "rover2"):
        team.insert_node(agent)


def climbing_epochs(team, scale):
    """rover3 reports epochs of rover1's own, each as far ahead as may be, again and again."""
    highest = 0
    with Member(team, TAKEN) as member:
        for i in range(1, int(2000 * scale)):
            highest = min(highest + (1 << 62), (1 << 64) - 1 - i % 7)
            member.send("rover1", "storage", epoch_report={"epochs": [highest]})
    team.insert_node("rover1")
    epoch = max(key[2] for key in team.records("rover1") if key[1] == ROVER1)
    if epoch > 1 << 62:
        raise Failure(f"rover1 numbers its records from epoch {epoch:x} on: few are left")


def streams_of_another(team, scale):
    """rover3 gives the leader 65,700 events in rover2's name, one stream each."""
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        for i in range(17):
            session.bring([messages.stored(ROVER2, EPOCH * 2 + 4096 * i + j, 1, messages.event("x"))
                           for j in range(4096 if i < 16 else 164)])
    team.share()


def streams_of_its_own(team, scale):
    """rover3 gives the leader 66,000 events of its own, one stream each: more than a have-set may have."""
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        epoch = own_epoch(session)
        for i in range(17):
            session.bring([messages.stored(ROVER3, epoch + 4096 * i + j, 1, messages.event("x")) for j in range(4096)])
    team.share()


def quarantine_in_anothers_name(team, scale):
    """rover3 sends a forged quarantine of the base station for all maps of rover1."""
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        quarantine = record.Record(timestamp_ns=messages.now_ns(), map_quarantine={
            "agent_id": ROVER1, "from_ns": 0, "to_ns": messages.SEQ_MAX, "reason": "dust"})
        session.bring([messages.stored(BASE, EPOCH, 1, quarantine)])
    if any(table == "map_quarantine" and origin == BASE for table, origin, _, _ in team.records("rover1")):
        raise Failure("rover1 leaves out maps by a word of the base station that it never gave")


def left_out_maps(team):
    """Returns the number of maps of rover1 and rover2 that the leader excludes from the merged map."""
    stats = team.call("rover1", map_stats={}).map_stats
    return sum(agent.quarantined_map_count for agent in stats.agents if agent.agent_id in (ROVER1, ROVER2))


def named_in_health(team, words):
    findings = team.moonctl("-a", "rover1", "health", check=False).stdout
    if not any("rover3" in line and words in line for line in findings.splitlines()):
        raise Failure(f"health does not say of rover3 that it {words}: {findings[-300:]}")


def quarantines_of_others(team, scale):
    """rover3 quarantines all maps of rover1 and rover2, in the present term, which it does not lead, and in a far one."""
    before = left_out_maps(team)
    roles = team.status("rover1").roles
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        epoch = own_epoch(session)
        session.bring([messages.stored(ROVER3, epoch, i + 1, record.Record(timestamp_ns=messages.now_ns(), map_quarantine={
            "agent_id": agent, "from_ns": 0, "to_ns": messages.SEQ_MAX, "reason": "dust", "term": term}))
            for i, (agent, term) in enumerate((agent, term) for agent in (ROVER1, ROVER2)
                                              for term in (roles.term, {"number": 1 << 40, "issuer": ROVER3}))])
    after = left_out_maps(team)
    if after > before:
        raise Failure(f"the leader leaves out {after - before} more maps of rover1 and rover2 by rover3's word")
    named_in_health(team, "did not lead in their term")


def lifts_of_others(team, scale):
    """rover3 lifts a quarantine that the leader's operator gave."""
    key = team.insert("rover1", [record.Record(timestamp_ns=messages.now_ns(), map_quarantine={
        "agent_id": ROVER2, "from_ns": 0, "to_ns": messages.SEQ_MAX, "reason": "dust"})])[0]
    before = left_out_maps(team)
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        session.bring([messages.stored(ROVER3, own_epoch(session), 1, record.Record(
            timestamp_ns=messages.now_ns(), map_quarantine={"lifts": key, "term": team.status("rover1").roles.term}))])
    after = left_out_maps(team)
    team.insert("rover1", [record.Record(timestamp_ns=messages.now_ns(), map_quarantine={"lifts": key})])
    if before == 0 or after < before:
        raise Failure(f"of {before} maps that the operator left out, {before - after} are used again by rover3's word")


def edges_of_others(team, scale):
    """rover3 joins rover1's first node to each of its others, kilometres long, and measures ranges between two others."""
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        epoch = own_epoch(session)
        edges = [messages.edge(ROVER1, i) for i in range(1, 15)]
        for i, edge in enumerate(edges):
            edge.pose_graph_edge.to.index = i + 2
            edge.pose_graph_edge.relative_pose.from_from_to.position_m.x = 5000
        edges.append(record.Record(timestamp_ns=messages.now_ns(), pose_graph_edge={
            "from": {"agent_id": ROVER1, "index": 1}, "to": {"agent_id": ROVER2, "index": 1},
            "range": {"range_m": 9000, "variance_m2": 1e-8}}))
        answer = session.bring([messages.stored(ROVER3, epoch, i + 1, edge) for i, edge in enumerate(edges)])
    settled = sum(interval.last - interval.first + 1 for stream in answer.streams
                  if (stream.origin_agent, stream.epoch) == (ROVER3, epoch) for interval in stream.held)
    if settled != len(edges):
        raise Failure(f"{settled} of {len(edges)} edges that can never be valid are settled; sync --wait would not end")
    if any(key[:3] == ("pose_graph_edge", ROVER3, epoch) for key in team.records("rover1")):
        raise Failure("the leader stores edges between nodes of others")
    named_in_health(team, "about other agents")


def dense_graph(team, scale):
    """rover3 says by 20,000 odometry edges that its 1,000 nodes are all joined, and the leader solves the pose graph."""
    def bring(epoch, records):
        for first in range(0, len(records), 250):
            session.bring([messages.stored(ROVER3, epoch, first + 1 + i, one)
                           for i, one in enumerate(records[first:first + 250])])

    chance, edges = random.Random(1), []
    for _ in range(int(20_000 * scale)):
        edge, places = messages.edge(ROVER3, 0), chance.sample(range(1000), 2)
        getattr(edge.pose_graph_edge, "from").index, edge.pose_graph_edge.to.index = (50_000 + place for place in places)
        edges.append(edge)
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        epoch = own_epoch(session)
        bring(epoch, [messages.node(ROVER3, 50_000 + i, x=i) for i in range(1000)])
        bring(epoch, edges)
    for _ in range(20):  # Retry: a restarted leader needs a moment before it leads.
        solved = team.moonctl("-a", "rover1", "graph", "optimize", check=False)
        if solved.returncode == 0:
            break
        time.sleep(0.5)
    else:
        raise Failure(f"the leader does not solve the pose graph: {solved.stderr.strip()[-300:]}")
    named_in_health(team, "from the map or the pose graph")


def many_maps(team, scale):
    """rover3 makes more maps, of four cells each, than a merged map has room for."""
    def merged():
        stats = team.call("rover1", map_stats={}).map_stats
        return {agent.agent_id: agent.map_count for agent in stats.agents}

    before = merged()
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        epoch, count = own_epoch(session), int(MERGED_MAPS_MAX * scale) + 500
        session.bring([messages.stored(ROVER3, epoch, 1, messages.node(ROVER3, 90_000))])
        for first in range(1, count, 500):
            session.bring([messages.stored(ROVER3, epoch, seq, messages.map_at(ROVER3, 90_000, cells=2))
                           for seq in range(first, first + 500)])
    after = merged()
    if any(after[agent] < before[agent] for agent in (ROVER1, ROVER2)):
        raise Failure(f"maps of others are left out: {before} before, {after} after")
    named_in_health(team, "from the map or the pose graph")


def far_apart_nodes(team, scale):
    """rover3 inserts nodes that lie 13 m apart, so that their footprints take more pages than a merged map has."""
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        epoch, count = own_epoch(session), 2_000 + int(15_000 * scale)
        for first in range(0, count, 500):
            session.bring([messages.stored(ROVER3, epoch, 1 + i, messages.node(ROVER3, 200_000 + i, x=100 + 13 * i))
                           for i in range(first, first + 500)])
    for agent in ("rover1", "rover2"):
        if agent == "rover2":
            team.moonctl("replicate", "now", "--wait", "--timeout", "50s", check=False)  # rover3 does not answer.
        team.moonctl("-a", agent, "map", "stats")
        team.moonctl("-a", agent, "map", "why", "3", "0")
        team.moonctl("-a", agent, "map", "export", str(team.folder / "far"))
    named_in_health(team, "moonctl map quarantine --agent rover3")
    given = team.moonctl("map", "quarantine", "--agent", "rover3", "--reason", "far apart").stdout
    exported = team.moonctl("map", "export", str(team.folder / "far")).stdout
    findings = team.moonctl("-a", "rover1", "health", check=False).stdout
    team.moonctl("map", "quarantine", "--lift", given.split()[1])
    if "excluded" in exported or "share of the memory" in findings:
        raise Failure(f"after a quarantine of rover3 something is left out: {exported[-300:]} {findings[-300:]}")


def absurd_bodies():
    """Yields absurd records: values that are not numbers, sizes beyond all limits, unknown agents."""
    nan, huge = float("nan"), 1e300
    yield messages.node(ROVER3, 0, x=nan)
    yield messages.node(ROVER3, messages.SEQ_MAX * 2 + 1, x=huge)
    yield messages.node(77, 1)
    yield record.Record(pose_graph_node={"node": {"agent_id": ROVER3, "index": 1}})
    yield record.Record(pose_graph_edge={"from": {"agent_id": ROVER3}, "to": {"agent_id": ROVER3},
                                         "relative_pose": {"from_from_to": messages.pose(nan), "covariance": [0] * 21}})
    yield record.Record(pose_graph_edge={"from": {"agent_id": ROVER3, "index": 1}, "to": {"agent_id": ROVER1, "index": 1},
                                         "range": {"range_m": -1, "variance_m2": 0}})
    for width, height, cells in ((0, 0, b""), (1 << 31, 1 << 31, b"\x55" * 100), ((1 << 32) - 1, 1, b"\x55"),
                                 (40, 40, b"\xff" * 400), (65536, 65536, b"")):
        body = messages.map_at(ROVER3, 1)
        layer = body.local_traversability_map.layers[0]
        layer.width_cells, layer.height_cells, layer.cells = width, height, cells
        yield body
    for resolution, centre in ((0, 0), (1, 0), ((1 << 32) - 1, 0), (50000, nan), (50000, huge)):
        body = messages.map_at(ROVER3, 1)
        layer = body.local_traversability_map.layers[0]
        layer.resolution_um, layer.center_x_m = resolution, centre
        yield body
    body = messages.map_at(ROVER3, 1)
    body.local_traversability_map.layers.extend(body.local_traversability_map.layers[:1] * 500)
    yield body
    for stamp in (-messages.SEQ_MAX, messages.SEQ_MAX):
        body = messages.temperature(nan)
        body.timestamp_ns = stamp
        yield body
    yield record.Record(custom={"data_type": 5, "payload": b"x"})
    yield record.Record(custom={"data_type": 1999, "latest_key": bytes(100_000)})
    yield messages.event("\x1b[2J\r\n" * 200)
    yield record.Record()


def absurd_records(team, scale):
    """rover3 brings records of its own that no robot gives, and then has them merged, solved and shown."""
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        epoch = own_epoch(session)
        for seq, body in enumerate(absurd_bodies(), 1):
            for data_type in {NODE if body.WhichOneof("body") is None else None, 1000 if body.HasField("custom") else None}:
                if data_type is not None or body.WhichOneof("body") not in (None, "custom"):
                    session.bring([messages.stored(ROVER3, epoch, seq, body, data_type)])
    for words in (("graph", "optimize"), ("map", "stats"), ("map", "export", str(team.folder / "map"), "--format", "pgm"),
                  ("record", "list"), ("log",), ("health",)):
        shown = team.moonctl(*words, check=False)
        if "\x1b[2J" in shown.stdout + shown.stderr:
            raise Failure(f"moonctl {' '.join(words)} writes what rover3 wrote to the terminal as it is")
        if "did not answer" in shown.stderr or shown.returncode < 0:
            raise Failure(f"moonctl {' '.join(words)}: {shown.stderr.strip()[-200:]}")


def undeclared_types(team, scale):
    """rover3 brings records of 1,000 custom types that nobody declared, 256 bytes of key and 4 kB each."""
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        epoch = own_epoch(session)
        for i in range(int(100 * scale)):
            session.bring([messages.stored(ROVER3, epoch, i + 1, record.Record(custom={
                "data_type": data_type, "latest_key": (b"%d" % i) * 40, "payload": bytes(4096)}), data_type)
                for data_type in range(1000 + i % 20 * 50, 1050 + i % 20 * 50)])


ATTACKERS = [records_of_another, state_of_another, drops_of_another, own_epochs_used_up, climbing_epochs, streams_of_another,
             streams_of_its_own, quarantine_in_anothers_name, quarantines_of_others, lifts_of_others, edges_of_others, dense_graph,
             many_maps, far_apart_nodes, absurd_records, undeclared_types]
ONLY_AT_LENGTH = [streams_of_its_own, many_maps]
# The merged map keeps its 65,535 input maps in memory, about 1.5 kB each; a solve takes 5 kB for each far node.
RSS_MB_MAX_OF = {many_maps: 160, far_apart_nodes: 200}
# These attackers leave many of rover3's records on every disk. The team is rebuilt, because have-sets would stay large.
LEAVES_MUCH = [streams_of_its_own, dense_graph, many_maps, far_apart_nodes]
