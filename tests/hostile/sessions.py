"""Attackers with other messages between two agents: frames, sessions, leases, clocks."""
import contextlib
import random

import messages
from member import CODEC_PLAIN, REPLICATION, SYNC, Member, frame_of
from messages import message
from team import HONEST, TAKEN, Failure

TAKES_ROVER3 = True
ROVER2, ROVER3 = 2, 3
FRAGMENT_BYTES, PIECES_WHOLE_BYTES = 200 << 10, 16 << 20
DAY_NS = 86_400 * 10**9


def answers(team, member):
    """Waits for a reply of rover1. It has then processed or, if its mailboxes were full, dropped all earlier
    messages."""
    for _ in range(5):
        with contextlib.suppress(Failure):
            return member.ask("rover1", timeout_s=5, status={})
    return member.ask("rover1", timeout_s=30, status={})


def floods_of_hellos(team, scale):
    """rover3 begins 30,000 sessions of both kinds, none of which goes on."""
    with Member(team, TAKEN) as member:
        begin = random.getrandbits(40)
        for i in range(int(30_000 * scale)):
            kind = SYNC if i % 2 else REPLICATION
            member.send("rover1", "sync" if i % 2 else "replica", hello={
                "wire_version": 1 + (i % 5 == 0), "team_id": team.team_id, "session_id": begin + i * (1 + i % 3 * 5000),
                "kind": kind, "origin_agents": range(1, 1 + i % 7), "everyones_types": range(i % 60)})
        answers(team, member)


def replayed_session(team, scale):
    """rover3 sends the frames of a session that is over again and again, amid a later one and after it."""
    def nodes(first, count):
        return [messages.stored(ROVER3, epoch, last + i, messages.node(ROVER3, 5000 + i)) for i in range(first, first + count)]

    with Member(team, TAKEN) as member:
        old = member.session("rover1")
        epoch, last = old.last_of(ROVER3, "POSE_GRAPH_NODE")
        frames = [frame_of(member.message("rover1", "sync", hello=old.hello())),
                  *(frame_of(old.batch([one])) for one in nodes(1, 20))]
        for number, frame in enumerate(frames[1:], 1):
            member.send_frame("rover1", frame)
            old.wait_for(number)
        for i in range(int(40 * scale)):
            new = member.session("rover1")
            for frame in frames * 3:
                member.send_frame("rover1", frame)
            new.bring(nodes(100 + i, 1))
        answers(team, member)
    held = {key[3] for key in team.records("rover1") if key[:3] == ("pose_graph_node", ROVER3, epoch)}
    if held != {*range(1, last + 21), *range(last + 100, last + 100 + int(40 * scale))}:
        raise Failure("rover1 does not hold what rover3 brought, and nothing else")


def unfinished_fragments(team, scale):
    """rover3 sends records of 16 MiB in fragments, one after the other, and finishes none."""
    with Member(team, TAKEN) as member:
        for kind in (SYNC, REPLICATION):
            session = member.session("rover1", kind)
            for i in range(int(1000 * scale)):
                whole, index = divmod(i, PIECES_WHOLE_BYTES // FRAGMENT_BYTES)
                piece = {"hash": 1 + whole, "first_byte": index * FRAGMENT_BYTES, "whole_bytes": PIECES_WHOLE_BYTES}
                member.send_frame("rover1", frame_of(session.batch(coded=bytes(FRAGMENT_BYTES), record_count=1, fragment=piece,
                                                                   codec=CODEC_PLAIN)))
        answers(team, member)


def empty_messages(team, scale):
    """rover3 sends frames of 16,000 messages with nothing in them, and of 100,000."""
    with Member(team, TAKEN) as member:
        small, large = b"\x0a\x00" * 16_000, b"\x0a\x00" * 100_000
        named = frame_of(*[message.Message(hop_sender=ROVER3)] * 8000)
        addressed = frame_of(*[message.Message(hop_sender=ROVER3, destination_actor=b"gateway")] * 2000)
        for _ in range(int(500 * scale)):
            for frame in (small, large, named, addressed, b"", b"\x0a", b"\x0a\xff\xff\xff\xff\x0f"):
                member.send_frame("rover1", frame)
        answers(team, member)


def varint(number):
    out = b""
    while number > 127:
        out, number = out + bytes([number & 127 | 128]), number >> 7
    return out + bytes([number])


def frames_of_many_parts(team, scale):
    """rover3 sends frames of 250 kB of empty parts, to actors that handle them and to one that may be busy."""
    fields = message.Message.DESCRIPTOR.fields_by_name
    with Member(team, TAKEN) as member:
        for i in range(int(2000 * scale)):
            body = ("have", "role_chain_reply", "batch")[i % 3]
            envelope = member.message("rover1", ("sync", "role", "merge")[i % 3]).SerializeToString()
            parts = (b"\x0a\x00", b"\x0a\x00", b"\x82\x7d\x00")[i % 3] * 80_000
            whole = envelope + varint(fields[body].number << 3 | 2) + varint(len(parts)) + parts
            member.send_frame("rover1", b"\x0a" + varint(len(whole)) + whole)
        answers(team, member)


def absurd_frames(team, scale):
    """rover3 sends frames whose lengths are wrong, groups 100,000 deep, megabytes of unknown fields, lists without end."""
    def within_message(body):
        """Returns a frame with a message that has a valid address, followed by `body`."""
        return frame_of(message.Message(hop_sender=ROVER3, destination_actor=b"sync"))[2:] + body

    def framed(body):
        size, length = len(body), b""
        while size > 127:
            length, size = length + bytes([size & 127 | 128]), size >> 7
        return b"\x0a" + length + bytes([size]) + body

    absurd = [
        b"\x0b" * 100_000,                                   # Groups that begin and never end.
        b"\xda\x3e\x80\x80\x80\x08" + bytes(1000),           # A body that claims 16 MB but contains 1 kB.
        b"\xf2\x03" * 100_000,                               # Bodies nested in bodies.
        b"\x82\x7d\xc0\x9a\x0c" + bytes(200_000),            # An unknown field of 200 kB.
        b"\x08\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff",  # A number that does not end.
        b"\x98\x7d\x01" * 80_000,                            # An unknown field, 80,000 times.
        b"\xea\x03\x02\x2a\x00" * 50_000,                    # 50,000 bodies in one message.
        b"\x00" * 1000, b"\xff" * 1000,
    ]
    with Member(team, TAKEN) as member:
        for _ in range(int(100 * scale)):
            for body in absurd:
                member.send_frame("rover1", framed(within_message(body)))
        answers(team, member)


def leases_for_others(team, scale):
    """rover3 announces that rover2 sleeps for a day and that it sleeps, drives and wakes itself 20,000 times."""
    with Member(team, TAKEN) as member:
        number = random.getrandbits(40)
        for i in range(int(20_000 * scale)):
            lease = {"number": number + i, "driving_s": i % 3 * 100, "sleeping_s": i % 2 * 86_400, "paused_s": 0}
            member.send("rover1", "lease", agent_id=ROVER2, lease_announce=lease)
            member.send("rover1", "lease", hop_sender=ROVER2, agent_id=ROVER2, lease_announce=lease)
        answers(team, member)
    if any(lease.agent_id == ROVER2 for lease in team.status("rover1").leases):
        raise Failure("rover1 takes rover2 for one that sleeps")


def lying_clocks(team, scale):
    """rover3 reports that it is 1990, 2200 and every time in between."""
    with Member(team, TAKEN) as member:
        for i in range(int(20_000 * scale)):
            utc_ns = random.choice([0, messages.SEQ_MAX, -messages.SEQ_MAX, messages.now_ns() + (i - 5000) * DAY_NS])
            member.send("rover1", "clock", clock_report={"utc_ns": utc_ns})
        answers(team, member)
    suspect = team.status("rover1").storage.clock_suspect
    if suspect:
        raise Failure(f"rover1 takes its own clock for suspect: {suspect}")


def orders_to_share(team, scale):
    """rover3 asks each agent to bring it, and the others, what it has, 3,000 times."""
    with Member(team, TAKEN) as member:
        for i in range(int(3000 * scale)):
            for agent in HONEST:
                member.send(agent, "sync" if i % 2 else "replica", term={"number": 1 << 39}, share_request={
                    "kind": SYNC if i % 2 else REPLICATION, "destination": i % 5, "from_agents": range(i % 6),
                    "order": random.getrandbits(60), "bytes_max": i % 100})
        answers(team, member)


def lying_reports(team, scale):
    """rover3 reports to the transport what never arrived, under false link numbers, and announces frames of 2^63 bytes."""
    with Member(team, TAKEN) as member:
        link = member.links["rover1"]
        number = link.number
        for i in range(int(30_000 * scale)):
            link.number = random.choice([number, i + 1])
            member.send("rover1", "", link_report={
                "reported_link": random.getrandbits(32), "received_bytes": random.getrandbits(64), "is_asking": True,
                "report_after_bytes": 1, "coming_bytes": 1 << 63})
        link.number = number
        answers(team, member)


ATTACKERS = [floods_of_hellos, replayed_session, unfinished_fragments, empty_messages, frames_of_many_parts, absurd_frames,
             leases_for_others,
             lying_clocks, orders_to_share, lying_reports]
