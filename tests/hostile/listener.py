"""Attackers before authentication, or whose bytes never form a complete message."""
import contextlib
import socket
import struct
import threading
import time

import nacl.utils
import zmtp
from team import Failure


def idle_connections(team, scale):
    """No key: more connections than the agent may have open files, which send nothing."""
    connections = []
    for _ in range(int(1500 * scale)):
        connection = socket.socket()
        connection.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            connection.connect(team.address("rover1"))
        connections.append(connection)
        if len(connections) % 100 == 0:
            time.sleep(0.02)
    team.answers("rover1")
    time.sleep(1)
    for connection in connections:
        connection.close()


def announced_frames(team, scale):
    """No key: 60 connections announce a command of 255 KiB or of 7 MiB each, and send all but a byte of it."""
    connections = []
    for i in range(60):
        with contextlib.suppress(OSError):
            connection = zmtp.Connection(team.address("rover1"), timeout_s=2)
            connections.append(connection)
            connection.send_raw(zmtp.GREETING)
            connection.receive_raw(64)
            connection.send_raw(struct.pack(">BQ", zmtp.COMMAND | zmtp.LONG, (255 << 10) if i % 2 else 7 << 20))
    for part in range(max(1, int(28 * scale))):
        for connection in connections[::2] if part else connections:
            with contextlib.suppress(OSError):
                connection.send_raw(bytes((255 << 10) - 1))
    for connection in connections:
        connection.close()


def any_bytes(team, scale):
    """No key: handshakes that stop at any byte, and bytes that are not a handshake."""
    for i in range(int(2000 * scale)):
        with contextlib.suppress(OSError):
            connection = zmtp.Connection(team.address("rover1"), timeout_s=1)
            begin = zmtp.GREETING[:i % 65] if i % 2 else b""
            connection.send_raw(begin + nacl.utils.random(1 + i % 300))
            connection.close()


def endless(connect, part_bytes, total_bytes):
    """Sends a message with endless parts until the connection is closed or all is sent. Returns the bytes accepted."""
    connection = connect()
    part = bytes(part_bytes)
    sent = 0
    with contextlib.suppress(OSError):
        while sent < total_bytes:
            block = b"".join(connection.part(part, more=True) for _ in range(max(1, 65536 // (part_bytes + 40))))
            connection.send_raw(block)
            sent += len(block)
    connection.close()
    return sent


def endless_parts_of_a_member(team, scale):
    """rover3, with its key: four connections with messages that never end, of 1 kB parts."""
    for _ in range(4):
        endless(lambda: team.connect("rover1", "rover3"), 1024, int((100 << 20) * scale))


def tiny_parts_of_a_member(team, scale):
    """rover3, with its key: a message that never ends, of parts of one byte."""
    endless(lambda: team.connect("rover1", "rover3"), 1, int((32 << 20) * scale))


def endless_parts_of_a_client(team, scale):
    """A client that may only view: a message that never ends."""
    endless(lambda: team.connect_client("watcher"), 1024, int((300 << 20) * scale))


def tiny_parts_of_a_client(team, scale):
    """A client that may only view: a message that never ends, of parts of one byte."""
    endless(lambda: team.connect_client("watcher"), 1, int((32 << 20) * scale))


class RecordedConnection(zmtp.Connection):
    """A connection that records the bytes that it sends."""

    def __init__(self, address, timeout_s):
        super().__init__(address, timeout_s)
        self.sent = []

    def send_raw(self, data):
        self.sent.append(data)
        super().send_raw(data)


def replayed_connections(team, scale):
    """An eavesdropper replays rover3's bytes over new connections and inside rover3's own connection."""
    made = []

    def make(address, timeout_s):
        made.append(RecordedConnection(address, timeout_s))
        return made[0]
    address, server_key = team.address("rover1"), team.keys("rover1")[0]
    lost_before = team.connects("rover2", "rover1")
    true = zmtp.connect(address, server_key, team.keys("rover3"), b"3", make=make)
    for _ in range(20):
        true.send(b"\x0a\x00")
    for _ in range(int(200 * scale)):
        with contextlib.suppress(OSError):
            stranger = zmtp.Connection(address, timeout_s=1)
            for data in made[0].sent:
                stranger.send_raw(data)
            if not stranger.is_closed_within(3):
                raise Failure("a connection that repeats another's bytes is admitted")
    true.send_raw(made[0].sent[-1])  # Repeats a message, and so a nonce that was already used.
    true.close()
    if team.connects("rover2", "rover1") != lost_before:
        raise Failure("rover2's link to rover1 was lost")


def endless_metadata(team, scale):
    """A stranger, and rover3, with 2,000 properties in their handshake, of 200 bytes or of 100 kB each."""
    for i in range(int(200 * scale)):
        properties = [(b"X-%d" % j, bytes(100_000 if i % 10 == 0 else 200)) for j in range(20 if i % 10 == 0 else 2000)]
        keys = team.keys("rover3") if i % 2 else zmtp.key_pair()
        with contextlib.suppress(OSError):
            zmtp.connect(team.address("rover1"), team.keys("rover1")[0], keys, bytes(300), 1, properties=properties).close()


def foreign_routing_ids(team, scale):
    """rover3, with its key: connections with the routing ids of other agents, while those share."""
    is_over = threading.Event()

    def connect():
        while not is_over.is_set():
            for number in (b"1", b"2", b"4"):
                with contextlib.suppress(OSError):
                    team.connect("rover1", "rover3", routing_id=number).close()

    others = ["rover2", "base"]
    before = [team.connects(agent, "rover1") for agent in others]
    attacker = threading.Thread(target=connect)
    attacker.start()
    try:
        end = time.monotonic() + 15 * scale
        while time.monotonic() < end:
            team.moonctl("sync", "now", "--from", "rover2", "--wait", "--timeout", "10s")
    finally:
        is_over.set()
        attacker.join()
    after = [team.connects(agent, "rover1") for agent in others]
    if before != after:
        raise Failure(f"the others' links came up {before} times before, and {after} times after")


# The first connection ids that libzmq assigns in a ROUTER or REP socket if rand() is not seeded.
UNSEEDED_NUMBERS = [0x6b8b4567, 0xe43c9869, 0xf4b0dc51, 0x2ae8944a]


def claim_next_ids(connect):
    """Claims the ids that an unseeded ROUTER is about to assign, and lets it assign them."""
    with contextlib.ExitStack() as stack:
        for ahead in range(4, 8):
            for number in UNSEEDED_NUMBERS:
                with contextlib.suppress(OSError):
                    routing_id = b"\x00" + struct.pack(">I", number + ahead)
                    stack.callback(connect(routing_id).close)
        for _ in range(12):
            with contextlib.suppress(OSError):
                stack.callback(connect(b"").close)
        time.sleep(0.5)


def claimed_ids_of_a_client(team, scale):
    """A client that may view: connections that claim the routing ids which the agent would assign next."""
    claim_next_ids(lambda routing_id: team.connect_client("watcher", routing_id, timeout_s=2))


def claimed_ids_of_a_member(team, scale):
    """rover3, with its key: connections that claim the routing ids which the agent would assign next."""
    claim_next_ids(lambda routing_id: team.connect("rover1", "rover3", routing_id))


def messages_under_claimed_ids(team, scale):
    """A client that may share: each message comes over a connection with an id of its own choice, and cuts it."""
    for routing_id in (b"1", b"\x00" + bytes(4), b"anna"):
        connection = team.connect_client("sharer", routing_id)
        connection.send(b"\x82\x7d\x01")
        if not connection.is_closed_within(5):
            raise Failure(f"a client that claimed the id {routing_id!r} stays connected")


ATTACKERS = [claimed_ids_of_a_client, claimed_ids_of_a_member, messages_under_claimed_ids, idle_connections, announced_frames, any_bytes, endless_parts_of_a_member, tiny_parts_of_a_member,
             endless_parts_of_a_client, tiny_parts_of_a_client,
             replayed_connections, endless_metadata, foreign_routing_ids]

# These attackers run only in a long test, because they have no effect with a smaller scale.
ONLY_AT_LENGTH = [tiny_parts_of_a_member, tiny_parts_of_a_client]
