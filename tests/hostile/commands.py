"""Attackers with commands: a compromised member commands other agents, or sends answers that no agent requested."""
import random
import threading
import time

import messages
from member import Member, frame_of
from messages import control, errors, message, rights_of, types
from team import HONEST, NAMES, TAKEN, Failure

TAKES_ROVER3 = True
ROVER2, ROVER3, BASE = 2, 3, 4
CLIENTS = 0xFFFF0010  # Same as kClients of runtime/address.h.
VIEW, COMMAND = 1, 3  # Values of the enum ClientRights.
WAIT_S = 60
WAITING_READS = 600  # More than pending_max of actors/gateway/gateway_actor.h.
ACTORS = ["storage", "sync", "replica", "pgo", "merge", "role", "failover", "lease", "gateway", "clock", "event", "downlink",
          "retention", "", "nobody", "@leader"]


def erases_what_the_team_holds(team, scale):
    """rover3 makes itself the survivor, claims to hold everything, and orders each agent to prune all records."""
    with Member(team, TAKEN) as member:
        member.vouch_for_everything()
        for agent in HONEST:
            member.ask(agent, role_set={"survivor": ROVER3})
        for agent in HONEST:
            member.ask(agent, timeout_s=30, prune={"data_types": [
                types.POSE_GRAPH_NODE, types.POSE_GRAPH_EDGE, types.LOCAL_TRAVERSABILITY_MAP, types.AGENT_EVENT]})


def expect_alive(team):
    for agent in HONEST:
        if not team.is_alive(agent):
            raise Failure(f"{agent} ended")


def stops_every_agent(team, scale):
    """rover3 relays a stop to each agent, in the operator's name."""
    with Member(team, TAKEN) as member:
        for agent in HONEST:
            member.ask(agent, stop={})
        time.sleep(1)  # An agent replies to a stop request before it stops.
    expect_alive(team)


def every_command(team, scale):
    """rover3 relays each request that needs more than view rights, in its own name and in the names of others."""
    given = []
    with Member(team, TAKEN) as member:
        for field in control.ControlRequest.DESCRIPTOR.oneofs_by_name["request"].fields:
            if rights_of(field) > VIEW:
                reply = member.ask("rover2", by="anna (key)", **{field.name: {}})
                if reply.error.code != errors.ERROR_CODE_REFUSED or reply.error.field != "command_from":
                    given.append(field.name)
    if given:
        raise Failure(f"rover2 takes {', '.join(given)} through {TAKEN}")
    expect_alive(team)


def commands_in_anothers_name(team, scale):
    """rover3 sends a stop that claims to come from the base station, a client with every right, or rover2 itself."""
    request = control.ControlRequest(stop={}, team_id=team.team_id)
    body = {"control_request": request.SerializeToString(), "client_rights": COMMAND, "client_name": b"anna"}
    with Member(team, TAKEN) as member:
        for agent in HONEST:
            for sender in (BASE, ROVER2, CLIENTS, 0, NAMES.index(agent) + 1):
                member.send(agent, "gateway", hop_sender=sender, agent_id=sender, **body)
            for actor in ("role", "event", "retention", "storage"):
                member.send(agent, actor, source="gateway", **body)
            member.send(agent, "gateway", **body)
        for agent in HONEST:
            member.ask(agent, status={})
        time.sleep(1)
    expect_alive(team)


def requests_for_others(team, scale):
    """rover3 asks each agent to relay requests to other agents and to itself, in loops."""
    with Member(team, TAKEN) as member:
        for _ in range(int(1000 * scale)):
            for agent in HONEST:
                for number in range(6):
                    request = control.ControlRequest(for_agent=number, team_id=team.team_id, status={})
                    member.send(agent, "gateway", request_id=random.getrandbits(60),
                                control_request=request.SerializeToString())
        for agent in HONEST:
            # The agent drops answers while thousands of them wait for rover3. It must answer again after that.
            for tries_left in (2, 1, 0):
                try:
                    member.ask(agent, timeout_s=10, status={})
                    break
                except Failure:
                    if tries_left == 0:
                        raise


def waiting_reads(team, scale):
    """rover3 asks rover1 for 600 answers that wait for a minute, each in another actor's name, while others ask, too."""
    with Member(team, TAKEN) as member:
        tiles = member.ask("rover1", map_tiles={}).map_tiles
        waits_for_map = {"wait_s": WAIT_S, "merger_id": tiles.merger_id, "since_version": tiles.version}
        waits_for_records = {"wait_s": WAIT_S, "after_row_id": 1 << 50, "data_types": [types.MODE]}
        for i in range(WAITING_READS):
            read = {"map_tiles": waits_for_map} if i % 2 else {"read": waits_for_records}
            request = control.ControlRequest(for_agent=1, team_id=team.team_id, **read)
            member.send("rover1", "gateway", source=f"reader{i}", request_id=i + 1,
                        control_request=request.SerializeToString())
        time.sleep(1)
        for _ in range(5):
            team.answers("rover1")
            team.status("rover1")


def bodies_to_every_actor(team, scale):
    """rover3 sends each kind of body to each actor, with guessed request ids, as answers to no request."""
    before = {agent: len(team.records(agent)) for agent in HONEST}
    fields = message.Message.DESCRIPTOR.oneofs_by_name["body"].fields
    with Member(team, TAKEN) as member:
        for agent in HONEST:
            for actor in ACTORS:
                for field in fields:
                    if field.name == "link_report":
                        continue
                    body = b"" if field.type == field.TYPE_BYTES else {}
                    for request_id in (0, 1, random.getrandbits(64)):
                        member.send(agent, actor, source=random.choice(ACTORS), request_id=request_id,
                                    **{field.name: body})
        for agent in HONEST:
            member.ask(agent, timeout_s=60, status={})
    expect_alive(team)
    for agent, count in before.items():
        if len(team.records(agent)) < count:
            raise Failure(f"{agent} holds fewer records")


def answers_never_asked(team, scale):
    """rover3 answers clients' requests that rover1 passes on to base, with errors under every id that it can guess."""
    is_over = threading.Event()
    reply = control.ControlReply(error={"code": errors.ERROR_CODE_INTERNAL, "text": b"hostile"})
    with Member(team, TAKEN) as member:
        def answer():
            while not is_over.is_set():
                for request_id in (*range(1, 200), *(random.getrandbits(64) for _ in range(100))):
                    for source, sender in (("gateway", ROVER3), ("storage", ROVER3), ("gateway", BASE)):
                        member.send("rover1", "gateway", source=source, request_id=request_id, hop_sender=sender,
                                    control_reply=reply.SerializeToString())
        attacker = threading.Thread(target=answer)
        attacker.start()
        try:
            for _ in range(max(3, int(30 * scale))):
                team.call("rover1", for_agent=BASE, status={})
        finally:
            is_over.set()
            attacker.join()


def huge_answers(team, scale):
    """rover3 answers what rover1's clients ask it with all that a frame takes, nested without an end, and with what is no answer."""
    def answer(asked):
        kind = random.randrange(4)
        text = b"x" * (240 << 10)
        body = [control.ControlReply(error={"code": errors.ERROR_CODE_INTERNAL, "text": text}).SerializeToString(),
                b"\x0a\x80" * 100_000, b"\x0b" * 240_000, random.randbytes(1000)][kind]
        member.send("rover1", "gateway", request_id=asked.request_id, control_reply=body)

    with Member(team, TAKEN) as member:
        member.answers["control_request"] = answer
        for i in range(max(4, int(20 * scale))):
            try:
                team.call("rover1", for_agent=ROVER3, **({"status": {}} if i % 2 else {"trace": {}}))
            except Failure:
                pass  # Expected: rover3 replies with an error or with unreadable bytes.


def traces_without_end(team, scale):
    """rover3 asks rover1 for its trace, its whole store's check and all its pages, as fast as it can."""
    with Member(team, TAKEN) as member:
        for i in range(int(3000 * scale)):
            asked = [{"trace": {}}, {"verify": {"part": 1}}, {"verify": {"part": 2}}, {"read": {"records_max": 10_000}},
                     {"have": {}}, {"merge": {}}, {"graph_stats": {}}][i % 7]
            request = control.ControlRequest(for_agent=1, team_id=team.team_id, **asked)
            member.send("rover1", "gateway", source=f"asker{i % 50}", request_id=i + 1,
                        control_request=request.SerializeToString())
        team.answers("rover1")


ATTACKERS = [erases_what_the_team_holds, stops_every_agent, every_command, commands_in_anothers_name, requests_for_others,
             waiting_reads, bodies_to_every_actor, answers_never_asked, huge_answers, traces_without_end]
