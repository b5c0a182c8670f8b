"""Attackers by resource use: they make an agent log, store, decode or compare too much."""
import contextlib
import random
import socket
import threading
import time

import messages
import zmtp
import zstandard
from client import KeyedClient
from havesets import Receiver
from member import CODEC_PAPER_SQL, CODEC_ZSTD, Member, frame_of
from messages import have, record, types
from records import named_in_health
from team import TAKEN, Failure

TAKES_ROVER3 = True
ROVER3 = 3
STREAMS = 60_000
# Address of the honest client. The agent limits connections per address, so this address differs from the attacker's.
ELSEWHERE = "127.0.0.2"
BOMB_BYTES = 17 << 20


def floods_the_log(team, scale):
    """rover3 sends 300,000 messages of ten kinds that an agent warns of."""
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        warned_of = [
            member.message("rover1", "lease", lease_announce={"number": 1, "driving_s": -1}),
            member.message("rover1", "role", role_announce={"roles": {"leader": 99, "survivor": 98}}),
            member.message("rover1", "role", role_chain_reply={"chain": [{"leader": 99}]}),
            member.message("rover1", "storage", epoch_report={"epochs": [3, 2, 1]}),
            member.message("rover1", "storage", epoch_report={"epochs": range(1, 200)}),
            member.message("rover1", "sync", hello={"wire_version": 7, "session_id": 1}),
            member.message("rover1", "sync", hello={"wire_version": 1, "team_id": b"\x1b[2J" * 100, "session_id": 1}),
            session.batch([messages.stored(ROVER3, 1 << 50, 1, messages.event("x" * 5000))]),
            session.batch(coded=b"no records", record_count=7),
            member.message("rover1", "sync", refusal={"session_id": 1, "error": {"code": 3, "text": b"no\n" * 100}}),
            member.message("rover1", "storage", insert_request={}),
            member.message("rover1", "sync", hop_sender=2, hello={}),
        ]
        frames = [frame_of(one) for one in warned_of]
        for _ in range(int(300_000 * scale / len(frames))):
            for frame in frames:
                member.send_frame("rover1", frame)
        member.ask_until_answered("rover1", timeout_s=60, status={})
        for _ in range(3):
            team.answers("rover1")


def ask_beside(team, count, scale):
    """One client opens `count` connections and asks over each, while another client waits for a record and asks."""
    with contextlib.ExitStack() as stack:
        carl = stack.enter_context(KeyedClient(team, "sharer", from_address=ELSEWHERE))
        last = carl.ask(read={"records_max": 1, "is_newest_first": True}).read.row_ids[0]
        carl.send(77, read={"after_row_id": last, "data_types": [types.MODE], "wait_s": 50})
        for i in range(count):
            watcher = stack.enter_context(KeyedClient(team, "watcher"))
            watcher.send(i + 1, status={})
        for _ in range(max(3, int(12 * scale))):
            with KeyedClient(team, "sharer", timeout_s=5, from_address=ELSEWHERE) as other:
                other.ask(status={})
        team.insert("rover1", [record.Record(timestamp_ns=messages.now_ns(), mode={"activity": 1})])
        answer = carl.receive(10)
        if answer is None or answer.request_id != 77:
            raise Failure("a client that waited for a record got no answer when it came")


def connections_of_one_key(team, scale):
    """A client that may view asks over 50 connections, more than are remembered of one key, beside another client."""
    ask_beside(team, 50, scale)


def more_connections_than_places(team, scale):
    """A client that may view asks over 300 connections, more than client_address has places, beside another client."""
    ask_beside(team, 300, scale)


def giant_have_sets(team, scale):
    """rover3 claims 60,000 unknown streams, and asks for a new Hello after each batch."""
    epochs = random.getrandbits(60)
    giants = [have.HaveSet(streams=[
        {"origin_agent": 1 + i % 4, "epoch": epochs + STREAMS * giant + i, "data_type": types.POSE_GRAPH_NODE,
         "held": [{"first": j, "last": j} for j in (1, 3, 5)]} for i in range(STREAMS)]) for giant in range(3)]
    with Member(team, TAKEN) as member:
        receiver = Receiver(member, lambda: {"have": random.choice(giants)}, is_refusing=True)
        receiver.ask("rover1")
        time.sleep(25 * scale)
        member.ask_until_answered("rover1", timeout_s=60, status={})
        if receiver.greetings < 2:
            raise Failure(f"rover1 greeted {receiver.greetings} times, which shows nothing")


def zstd_bombs(team, scale):
    """rover3 sends batches of a kilobyte that decompress to 17 MiB each, in one session after the other."""
    bomb = zstandard.ZstdCompressor(level=19).compress(record.RecordBatch(records=[
        {"key": {"origin_agent": ROVER3, "epoch": 1 << 50, "data_type": types.AGENT_EVENT, "seq": 1},
         "content": bytes(BOMB_BYTES)}]).SerializeToString())
    with Member(team, TAKEN) as member:
        for _ in range(max(2, int(40 * scale))):
            session = member.session("rover1")
            for _ in range(16):
                member.send_frame("rover1", frame_of(session.batch(coded=bomb, record_count=1, codec=CODEC_ZSTD)))
        member.ask_until_answered("rover1", timeout_s=60, status={})


def statements_of_a_compact_team(team, scale):
    """rover3 sends records as SQL though its team does not use SQL: a valid one, and others that would run long."""
    epoch, endless = 1 << 50, ("(WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) SELECT count(*) FROM c)")
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        for seq in range(1, max(2, int(20_000 * scale))):
            batch = session.batch(coded=b"", record_count=1, codec=CODEC_PAPER_SQL)
            batch.record_id = f"{ROVER3}.{epoch:016x}.1.{seq}".encode()
            batch.sql = (f"INSERT INTO temperature (record_id, agent_id, timestamp_ns, celsius) VALUES "
                         f"('{batch.record_id.decode()}', {ROVER3}, 1700, {-40.5 if seq == 1 else endless})").encode()
            member.send_frame("rover1", frame_of(batch))
        member.ask_until_answered("rover1", timeout_s=60, status={})
    with team.store("rover1") as store:
        if store.execute("SELECT count(*) FROM temperature WHERE epoch = ?", (epoch,)).fetchone()[0]:
            raise Failure("rover1 ran a member's SQL, though the team's codec is compact")


def long_questions(team, scale):
    """Two clients that may view and share ask for whole checks, maps and pages, more of them than can be answered."""
    questions = [{"verify": {"part": 1}}, {"merge": {}}, {"map_stats": {}}, {"read": {"records_max": 1000}},
                 {"verify": {"part": 2}}, {"fingerprint": {"stream": {"origin_agent": 1, "epoch": 1, "data_type": 20}}},
                 {"map_tiles": {}}, {"have": {}}, {"trace": {}}, {"graph_stats": {}}]
    with KeyedClient(team, "watcher") as watcher, KeyedClient(team, "sharer") as sharer:
        for i in range(int(5000 * scale)):
            watcher.send(i + 1, **questions[i % len(questions)])
            sharer.send(i + 1, **({"optimize": {"from_scratch": True}} if i % 50 == 0 else questions[i % len(questions)]))
            if i % 500 == 0:
                team.answers("rover1")
        team.answers("rover1")


def endless_messages_over_links(team, scale):
    """rover3 answers rover1, which connects to it, with a message that never ends, of 64 kB parts, then of 1 byte."""
    is_over, sent = threading.Event(), [0]

    def send_parts(accepted):
        with contextlib.suppress(OSError):
            connection = zmtp.accept(accepted, team.keys(TAKEN)[1])
            size = 1 << 16 if sent[0] < 200 << 20 else 1
            while not is_over.is_set() and connection.peer_key == team.keys("rover1")[0]:
                block = b"".join(connection.part(bytes(size), more=True) for _ in range(max(1, 65536 // (size + 40))))
                connection.send_raw(block)
                sent[0] += len(block)
        accepted.close()

    with socket.create_server(team.address(TAKEN)) as server, contextlib.ExitStack() as stack:
        stack.callback(is_over.set)
        server.settimeout(0.2)
        end = time.monotonic() + max(2, 15 * scale)
        while time.monotonic() < end:
            with contextlib.suppress(TimeoutError):
                threading.Thread(target=send_parts, args=(server.accept()[0],), daemon=True).start()
    named_in_health(team, "sent data over an outgoing connection of this agent")


ATTACKERS = [floods_the_log, endless_messages_over_links, connections_of_one_key, more_connections_than_places,
             giant_have_sets, zstd_bombs, statements_of_a_compact_team, long_questions]

ONLY_AT_LENGTH = [giant_have_sets]
