"""Attackers with have-sets: a compromised member lies about its own records or those of others."""
import random
import threading

import messages
from member import ACTOR_OF_KIND, REPLICATION, SYNC, Member
from messages import errors, types
from team import HONEST, TAKEN, Failure

TAKES_ROVER3 = True
ROVER1, ROVER3 = 1, 3
OWN_EPOCH = 3  # Same as REFUSAL_CAUSE_OWN_EPOCH of proto/status.proto.
SESSION_TIMEOUT_S = 10


class Receiver:
    """The receiving end of sessions that other agents start with this member."""

    def __init__(self, member, make_have, is_refusing=False):
        """`make_have` returns the fields of the Have that answers a Hello or a batch. With `is_refusing`, batches
        are refused, so that the other agent sends a new Hello."""
        self.member, self.make_have, self.is_refusing = member, make_have, is_refusing
        self.greeted, self.greetings = threading.Event(), 0
        member.answers["hello"] = self._on_hello
        member.answers["batch"] = self._on_batch

    def ask(self, agent, kind=SYNC):
        """Makes the agent share its records with this member, as an operator would, and waits for its Hello."""
        self.greeted.clear()
        self.member.team.call(agent, share={"kind": kind, "destination": self.member.number})
        if not self.greeted.wait(SESSION_TIMEOUT_S):
            raise Failure(f"{agent} began no session with {self.member.name}")

    def _send(self, heard, **have):
        self.member.send(self.member.agent_of(heard), heard.destination_actor.decode(), have=have)

    def _on_hello(self, heard):
        self._send(heard, session_id=heard.hello.session_id, is_whole=True, unacked_bytes_max=8192, **self.make_have())
        self.greetings += 1
        self.greeted.set()

    def _on_batch(self, heard):
        if self.is_refusing:
            refusal = {"session_id": heard.batch.session_id, "error": {"code": errors.ERROR_CODE_NOT_FOUND}}
            self.member.send(self.member.agent_of(heard), heard.destination_actor.decode(), refusal=refusal)
            return
        self._send(heard, session_id=heard.batch.session_id, batch_number=heard.batch.batch_number,
                   unacked_bytes_max=8192, **self.make_have())


def everything(team):
    """Returns a have-set with all possible seqs of every stream that honest agents hold."""
    streams = {key[:3] for agent in HONEST for key in team.records(agent)}
    return {"streams": [messages.have_stream(origin, epoch, types.DataType.Value(table.upper()), messages.SEQ_MAX)
                        for table, origin, epoch in streams]}


def acknowledges_what_it_never_got(team, scale):
    """rover3 acknowledges all that there is, to everybody, and then the operator prunes."""
    with Member(team, TAKEN) as member:
        receiver = Receiver(member, lambda: {"have": everything(team)})
        for agent in HONEST:
            receiver.ask(agent)
        for agent in ("rover1", "base"):  # Each agent asks the survivor before it prunes.
            team.prune_everything(agent)


def home_haves(team, scale):
    """rover3 says that it holds records of rover1's own that rover1 never gave."""
    def beyond():
        streams = {key[:3] for key in team.records("rover1") if key[1] == ROVER1}
        return {"have": {"streams": [
            messages.have_stream(origin, epoch, types.DataType.Value(table.upper()), 1 << 40)
            for table, origin, epoch in streams] + [messages.have_stream(ROVER1, 1 << 61, 1, 1)]}}
    with Member(team, TAKEN) as member:
        Receiver(member, beyond).ask("rover1")
        member.ask("rover1", status={})
    team.share()
    if not any(refused.agent_id == ROVER3 and refused.cause == OWN_EPOCH for refused in team.status("rover1").refused):
        raise Failure("rover1's status does not say that rover3 reports records that rover1 never issued")


def malformed():
    """Yields invalid have-sets."""
    def one(held, **fields):
        return {"streams": [{"origin_agent": 1, "epoch": 1, "data_type": 20, "held": held, **fields}]}
    yield one([{"first": 9, "last": 1}])
    yield one([{"first": 0, "last": 1}])
    yield one([{"first": 1, "last": 5}, {"first": 4, "last": 9}])
    yield one([{"first": 1, "last": (1 << 64) - 1}])
    yield one([{"first": 2 * i + 1, "last": 2 * i + 1} for i in range(80_000)])
    yield one([{"first": 1, "last": 5}], dropped=[{"first": 3, "last": 4}])
    yield {"streams": [{"origin_agent": 99, "epoch": 0, "data_type": 4_000_000_000}] * 3}
    yield {"streams": [{}] * 100_000}


def malformed_haves(team, scale):
    """rover3 answers with have-sets that are reversed, overlap, or are too large; and again, and again."""
    haves = list(malformed())
    with Member(team, TAKEN) as member:
        receiver = Receiver(member, lambda: {"have": random.choice(haves)})
        for i in range(int(30 * scale)):
            receiver.ask(HONEST[i % 3])
        member.ask("rover1", timeout_s=60, status={})


def haves_never_asked(team, scale):
    """rover3 acknowledges batches that rover1 never sent, in sessions that it never began, 10,000 times."""
    have = everything(team)
    with Member(team, TAKEN) as member:
        for i in range(int(10_000 * scale)):
            member.send("rover1", ACTOR_OF_KIND[SYNC if i % 2 else REPLICATION], have={
                "session_id": random.getrandbits(random.choice([3, 64])), "batch_number": random.getrandbits(32),
                "is_whole": bool(i % 3), "have": have, "needs_new_run": bool(i % 2), "unacked_bytes_max": 1 << 31,
                "bytes_per_second_max": 1, "part_hash": 1, "part_bytes": 1 << 60})
        member.ask("rover1", timeout_s=60, status={})


def refuses_for_ever(team, scale):
    """rover3 refuses each session that the others begin with it, or requests each batch again."""
    with Member(team, TAKEN) as member:
        def refuse(heard):
            member.send(member.agent_of(heard), heard.destination_actor.decode(), refusal={
                "session_id": heard.hello.session_id, "error": {"code": random.randrange(1, 9), "text": b"\x1b[2Jno"}})
        member.answers["hello"] = refuse
        for _ in range(int(100 * scale)):
            team.call(random.choice(HONEST), share={"kind": SYNC, "destination": ROVER3})
        member.ask("rover1", timeout_s=60, status={})


ATTACKERS = [acknowledges_what_it_never_got, home_haves, malformed_haves, haves_never_asked, refuses_for_ever]
PRUNING = [acknowledges_what_it_never_got]

# These attackers run only in a long test, because they need much time before they have an effect.
ONLY_AT_LENGTH = [malformed_haves]
