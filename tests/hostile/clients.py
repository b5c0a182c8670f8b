"""Attackers with an accepted client key that request too much, or more than their rights allow."""
import contextlib
import pathlib
import random
import select
import subprocess
import sys
import threading
import time

import messages
from client import KeyedClient
from messages import control, errors, message, rights_of, types
from team import HONEST, Failure

VIEW = 1
FEEDS = 500
READERS, QUESTIONS = 15, 550
# The page that is read: maps of MAP_CELLS x MAP_CELLS cells, 8.3 MB in all.
MAP_CELLS, MAPS = 2000, 9
PAGE_READERS, PAGE_ROUNDS, ROUND_PAUSE_S = 14, 40, 0.1
STATUS_S_MAX, SYNC_S_MAX = 1, 10
# 16 MiB of answers take up to three times their size while libzmq encrypts them. Six runs took 48 to 60 MB on a busy
# machine; without the limits, an agent took 155 MB.
PAGES_MB_MAX = 75
LEAKED, LEAKED_AT_ONCE = 2000, 300
ESCAPES = "\x1b[2J\x1b]0;owned\x07\nbase: role swap (anna (key))"


def feeds_kept_open(team, scale):
    """A client that may view opens 500 reads that wait for a minute, while others ask and wait, too."""
    with contextlib.ExitStack() as stack:
        watchers = [stack.enter_context(KeyedClient(team, "watcher")) for _ in range(10)]
        for i in range(FEEDS):
            watchers[i % len(watchers)].send(i + 1, read={"after_row_id": 1 << 50, "wait_s": 60})
        sharer = stack.enter_context(KeyedClient(team, "sharer"))
        last = sharer.ask(read={"records_max": 1, "is_newest_first": True}).read.row_ids[0]
        sharer.send(77, read={"after_row_id": last, "data_types": [types.MODE], "wait_s": 30})
        team.insert("rover1", [messages.record.Record(timestamp_ns=messages.now_ns(), mode={"activity": 2})])
        answer = sharer.receive(10)
        if answer is None or not answer.control_reply.read.records:
            raise Failure("a client that waited for a record was not sent it")
        team.answers("rover1")


def never_reads(team, scale):
    """A client that may view asks 8,000 times for all records, over 15 connections, and reads no answer."""
    with contextlib.ExitStack() as stack:
        readers = [stack.enter_context(KeyedClient(team, "watcher")) for _ in range(READERS)]
        for i in range(int(QUESTIONS * scale)):
            for reader in readers:
                reader.send(i + 1, read={"records_max": 1000, "content_bytes_max": 1 << 20})
        time.sleep(1)
        team.answers("rover1")
        sharer = stack.enter_context(KeyedClient(team, "sharer"))
        sharer.ask(status={})


def pages_never_read(team, scale):
    """A client that may view asks over 14 connections for pages of maps of 8.3 MB, and reads no answer."""
    if team.records_of("rover1", "local_traversability_map") < MAPS:
        for index in range(2, MAPS + 2):
            team.insert("rover1", [messages.map_at(1, index, cells=MAP_CELLS)])
        team.settle()
        team.moonctl("sync", "now", "--wait", "--timeout", "30s")
        team.moonctl("replicate", "now", "--wait", "--timeout", "30s")
    page = {"records_max": 1000, "content_bytes_max": 8 << 20, "data_types": [types.LOCAL_TRAVERSABILITY_MAP]}
    team.call("rover1", read=page)  # The memory that one honest read leaves in caches is not the attack's.
    rss_mb = team.rss_mb("rover1")
    team.forget_peak("rover1")
    with contextlib.ExitStack() as stack:
        readers = [stack.enter_context(KeyedClient(team, "watcher")) for _ in range(PAGE_READERS)]
        slowest_s, failures, is_over = 0, [], threading.Event()

        def operator():
            nonlocal slowest_s
            while not is_over.is_set() and not failures:
                try:
                    slowest_s = max(slowest_s, team.answers("rover1"))
                except Failure as failure:
                    failures.append(failure)

        watch = threading.Thread(target=operator)
        watch.start()
        try:
            for i in range(max(20, int(PAGE_ROUNDS * scale))):
                for reader in readers:
                    reader.send(i + 1, read=page)
                time.sleep(ROUND_PAUSE_S)
        finally:
            is_over.set()
            watch.join()
        if failures:
            raise failures[0]
        sharer = stack.enter_context(KeyedClient(team, "sharer"))
        sharer.ask(status={})
        begin = time.monotonic()
        team.moonctl("sync", "now", "--wait", "--timeout", f"{SYNC_S_MAX}s")
        sync_s = time.monotonic() - begin
        more_mb = team.rss_mb("rover1", peak=True) - rss_mb
    print(f"    status {slowest_s:.2f} s, sync {sync_s:.2f} s, {more_mb:.0f} MB", flush=True)
    if slowest_s > STATUS_S_MAX or more_mb > PAGES_MB_MAX:
        raise Failure(f"the operator waited {slowest_s:.2f} s for status, and the agent took {more_mb:.0f} MB")


LOADED_S = 5  # Longest time that an agent takes to load the maps that the attackers before left in its store.


def leaks_local_connections(team, scale):
    """A local program opens 2,300 connections and closes none, at an agent that may open 1,024 files."""
    team.restart("rover1", files_max=1024)
    try:
        team.answers("rover1")
        time.sleep(LOADED_S)
        rss_mb = team.rss_mb("rover1")
        endpoint = (team.data_folder("rover1") / "agent.endpoint").read_text().strip()
        asked = control.ClientMessage(request_id=1, control_request=control.ControlRequest(
            team_id=team.team_id, status={})).SerializeToString()
        program = pathlib.Path(__file__).resolve().parent / "leaking_program.py"
        with subprocess.Popen([sys.executable, program, endpoint, asked.hex(), str(LEAKED_AT_ONCE),
                               str(max(1000, int(LEAKED * scale)))], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as leak:
            try:
                slowest_s = 0
                while not select.select([leak.stdout], [], [], 0)[0]:
                    slowest_s = max(slowest_s, team.answers("rover1"))
                    if not team.is_alive("rover1"):
                        raise Failure("the agent ended")
                for _ in range(5):
                    slowest_s = max(slowest_s, team.answers("rover1"))
                more_mb = team.rss_mb("rover1", peak=True) - rss_mb
            finally:
                leak.stdin.close()
        print(f"    status {slowest_s:.2f} s, {more_mb:.0f} MB", flush=True)
        if slowest_s > STATUS_S_MAX or more_mb > PAGES_MB_MAX:
            raise Failure(f"the operator waited {slowest_s:.2f} s for status, and the agent took {more_mb:.0f} MB")
    finally:
        team.restart("rover1")
        team.settle()


def above_its_right(team, scale):
    """A client with view rights sends each request that needs more rights, to each agent, with forged rights."""
    granted = []
    with KeyedClient(team, "watcher") as watcher:
        for field in control.ControlRequest.DESCRIPTOR.oneofs_by_name["request"].fields:
            if rights_of(field) <= VIEW:
                continue
            for for_agent in range(5):
                request = control.ControlRequest(for_agent=for_agent, team_id=team.team_id, **{field.name: {}})
                forged = message.Message(request_id=for_agent + 1, client_rights=3, client_name=b"anna", hop_sender=1,
                                         source_actor=b"gateway", control_request=request.SerializeToString())
                watcher.send_bytes(forged.SerializeToString())
                answer = watcher.receive(10)
                if answer is None or answer.control_reply.error.code != errors.ERROR_CODE_REFUSED:
                    granted.append(field.name)
    if granted:
        raise Failure(f"a client that may view is not refused {', '.join(sorted(set(granted)))}")


def bodies_of_agents(team, scale):
    """A client sends messages that only agents may send: each body to each of rover1's actors, in the agents' names."""
    held = {agent: len(team.records(agent)) for agent in HONEST}
    fields = message.Message.DESCRIPTOR.oneofs_by_name["body"].fields
    with KeyedClient(team, "sharer") as sharer:
        for actor in (b"storage", b"sync", b"role", b"gateway", b"retention", b"lease"):
            for field in fields:
                body = random.randbytes(20) if field.type == field.TYPE_BYTES else {}
                sharer.send_bytes(message.Message(
                    hop_sender=random.randrange(6), source_actor=actor, destination_actor=actor, destination_id=1,
                    agent_id=2, request_id=random.getrandbits(64), **{field.name: body}).SerializeToString())
    with KeyedClient(team, "sharer") as sharer:
        sharer.ask(status={})
    for agent, count in held.items():
        if len(team.records(agent)) < count:
            raise Failure(f"{agent} holds fewer records")


def absurd_requests(team, scale):
    """A client sends requests that are nested 100,000 deep, megabytes long, made of nothing, or for no team."""
    deep = b"\x0b" * 100_000
    nested = b""
    for _ in range(200):
        nested = messages.control.ControlRequest(custom={"actor": "x", "body": {"value": nested}}).SerializeToString()
    absurd = [b"", b"\x00", deep, b"\xa2\x06\xff\xff\xff\xff\x0f", b"\xa2\x06\x80\x80\x80\x04" + bytes(1 << 20),
              b"\x82\x7d\x80\x80\xc0\x02" + bytes(5 << 20), b"\x98\x7d\x01" * 300_000,
              message.Message(request_id=1, control_request=nested).SerializeToString(),
              message.Message(request_id=1, control_request=deep).SerializeToString(),
              message.Message(request_id=1, control_request=b"\x12\x02\x0a\x00" * 200_000).SerializeToString()]
    for data in absurd:
        with KeyedClient(team, "sharer") as sharer:
            for _ in range(max(2, int(30 * scale))):
                sharer.send_bytes(data)
    with KeyedClient(team, "sharer") as sharer:
        for pattern in ({"read": {"data_types": range(100_000)}}, {"read": {"records_max": (1 << 32) - 1, "wait_s": -1}},
                        {"map_tiles": {"wait_s": float("nan")}},
                        {"fingerprint": {"stream": {"held": [{"first": 9}] * 1000}}},
                        {"trace": {"actor": ESCAPES * 1000}}, {"merge": {}, "for_agent": 99}):
            sharer.send(1, **pattern)
            if sharer.receive(10) is None:
                raise Failure(f"a client that asks for {next(iter(pattern))} as nobody does is not answered")


def names_with_escapes(team, scale):
    """A client that may share sends terminal escape sequences as its name, in a lease and in a record's text."""
    with KeyedClient(team, "sharer") as sharer:
        sharer.send(1, by=ESCAPES, lease={"kind": 1, "seconds": 1})
        sharer.send(2, by=ESCAPES * 100, share={"kind": 1})
        sharer.send(3, by=ESCAPES, insert={"records": [
            messages.record.Record(timestamp_ns=1, health={"level": 1, "text": ESCAPES})]})
        for _ in range(3):
            sharer.receive(10)
    team.share()
    for words in (["log"], ["health"], ["status"], ["record", "list"], ["trace"]):
        shown = team.moonctl(*words, check=False)
        if "\x1b" in shown.stdout + shown.stderr or "\x07" in shown.stdout:
            raise Failure(f"moonctl {' '.join(words)} writes what a client wrote to the terminal as it is")


def questions_for_others(team, scale):
    """A client with view rights asks rover1 5,000 times for records of other agents, and reads no answer."""
    with KeyedClient(team, "watcher") as watcher:
        for i in range(int(5000 * scale)):
            watcher.send(i + 1, for_agent=2 + i % 3, **({"status": {}} if i % 2 else {"have": {}}))
        with KeyedClient(team, "sharer") as sharer:
            sharer.ask(for_agent=2, status={})
        team.answers("rover1")


ATTACKERS = [feeds_kept_open, never_reads, pages_never_read, leaks_local_connections, above_its_right, bodies_of_agents,
             absurd_requests, names_with_escapes, questions_for_others]
RSS_MB_MAX_OF = {pages_never_read: 90}  # Inserting and sharing the maps takes some 30 MB of it.
RESTARTS = [leaks_local_connections]  # Restarts the attacked agent, which loses requests of others.
