"""Any bytes: handshakes and frames that were right until an attacker changed some of them, at random (the runner's seed)."""
import concurrent.futures
import contextlib
import random

import messages
import nacl.exceptions
import zmtp
from member import SYNC, Member, frame_of
from team import HONEST, TAKEN, Failure

TAKES_ROVER3 = True
ROVER3 = 3
HANDSHAKES, FRAMES = 4_000, 96_000  # Numbers of handshakes and frames with --scale 1.
HANDSHAKE_TIMEOUT_S = 0.2
HANDSHAKES_AT_ONCE = 32
# Number of frames after which rover1 must answer a request. The answer proves that rover1 has processed the frames.
ANSWER_EVERY = 5000


def changed(data, chance=random):
    """Returns the bytes with one to four changes: bits or bytes changed, parts left out, repeated or invented."""
    data = bytearray(data)
    for _ in range(chance.randint(1, 4)):
        at = chance.randrange(len(data) + 1)
        to = min(len(data), at + chance.choice([1, 1, 2, 8, 40]))
        kind = chance.randrange(6)
        if kind == 0 and at < len(data):
            data[at] ^= 1 << chance.randrange(8)
        elif kind == 1 and at < len(data):
            data[at] = chance.choice([0, 1, 0x7F, 0x80, 0xFF])
        elif kind == 2:
            del data[at:to]
        elif kind == 3:
            data[at:at] = data[at:to] * chance.choice([1, 2, 50])
        elif kind == 4:
            data[at:at] = chance.randbytes(chance.randint(1, 20))
        else:
            del data[chance.randrange(len(data) + 1):]
    return bytes(data)


class ChangedConnection(zmtp.Connection):
    """A connection that changes one step of its handshake."""

    def __init__(self, address, timeout_s, chance):
        super().__init__(address, timeout_s)
        self.chance, self.steps_before = chance, chance.randrange(4)

    def send_raw(self, data):
        if self.steps_before == 0:
            data = changed(data, self.chance)
        self.steps_before -= 1
        super().send_raw(data)


def handshake(team, number, seed):
    """Runs one handshake in which one step is changed, and then sends nothing more."""
    chance = random.Random(seed + number)
    keys = team.keys(TAKEN) if number % 2 else zmtp.key_pair()
    connections = []

    def make(address, timeout_s):
        connections.append(ChangedConnection(address, timeout_s, chance))
        return connections[0]
    with contextlib.suppress(OSError, nacl.exceptions.CryptoError, ValueError):
        zmtp.connect(team.address("rover1"), team.keys("rover1")[0], keys, b"3", HANDSHAKE_TIMEOUT_S, make)
    for connection in connections:
        connection.close()


def handshakes(team, scale):
    """No key, and rover3's: handshakes of which one step is changed, at the agents' address."""
    seed = random.getrandbits(32)
    with concurrent.futures.ThreadPoolExecutor(HANDSHAKES_AT_ONCE) as threads:
        list(threads.map(lambda number: handshake(team, number, seed), range(int(HANDSHAKES * scale))))


def right_messages(member, session):
    """Returns one valid message of each kind that an agent may send."""
    epoch = 1 << 50
    records = [messages.stored(ROVER3, epoch, seq, body) for seq, body in enumerate(
        (messages.node(ROVER3, 7000), messages.edge(ROVER3, 7000), messages.map_at(ROVER3, 1), messages.event("x"),
         messages.temperature(1)), 1)]
    roles = member.ask("rover1", status={}).status.roles
    status = messages.control.ControlRequest(for_agent=1, team_id=member.team.team_id, status={})
    read = messages.control.ControlRequest(for_agent=1, team_id=member.team.team_id, read={"records_max": 5})
    bodies = [
        ("sync", {"hello": session.hello(origin_agents=[1, 2], everyones_types=[31])}),
        ("sync", {"have": {"session_id": session.id, "is_whole": True,
                           "have": {"streams": [messages.have_stream(1, epoch, 20, 9)]}}}),
        ("replica", {"refusal": {"session_id": 1, "error": {"code": 3, "field": "x", "text": b"no"}}}),
        ("sync", {"share_request": {"kind": SYNC, "from_agents": [1], "order": 7}}),
        ("sync", {"share_reply": {"session_count": 1, "roles": roles, "order": 7}}),
        ("role", {"role_announce": {"roles": roles}}),
        ("role", {"role_chain_request": {"signature": roles.signature}}),
        ("role", {"role_chain_reply": {"chain": [roles]}}),
        ("lease", {"lease_announce": {"number": 5, "driving_s": 1}}),
        ("clock", {"clock_report": {"utc_ns": messages.now_ns()}}),
        ("storage", {"epoch_report": {"epochs": [1, epoch]}}),
        ("failover", {"leader_check": {}}),
        ("", {"link_report": {"reported_link": 6, "received_bytes": 7}}),
        ("gateway", {"control_request": status.SerializeToString(), "request_id": 5}),
        ("gateway", {"control_request": read.SerializeToString(), "request_id": 6}),
        ("retention", {"control_request": messages.control.ControlRequest(have={}).SerializeToString()}),
    ]
    return [member.message("rover1", actor, **body) for actor, body in bodies] + [
        session.batch(records[i:i + 1]) for i in range(len(records))] + [
        session.batch(records, remaining=0), session.batch(dropped=[messages.dropped_stream(ROVER3, epoch, 1, 2)])]


def changed_frame(right):
    """Returns a frame of changed messages. In most cases the frame itself is valid, so the decoder reads further."""
    one = random.choice(right)
    kind = random.randrange(4)
    if kind == 0:
        return changed(frame_of(one))
    if kind == 1:
        return changed(frame_of(*random.choices(right, k=random.randint(1, 5))))
    body = changed(one.SerializeToString())
    length, size = b"", len(body)
    while size > 127:
        length, size = length + bytes([size & 127 | 128]), size >> 7
    return b"\x0a" + length + bytes([size]) + body


def frames(team, scale):
    """rover3, with its key: frames of its own, with bits, lengths and fields changed, left out, repeated or made up."""
    with Member(team, TAKEN) as member:
        right = right_messages(member, member.session("rover1"))
        for i in range(int(FRAMES * scale)):
            member.send_frame("rover1", changed_frame(right))
            if i % ANSWER_EVERY == 0:
                member.ask("rover1", timeout_s=60, status={})
        member.ask("rover1", timeout_s=60, status={})
    for agent in HONEST:
        if not team.is_alive(agent):
            raise Failure(f"{agent} ended")


ATTACKERS = [handshakes, frames]
