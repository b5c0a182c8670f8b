"""Attackers by roles: a member that decides who leads, or whose word on poses stands."""
import random

import messages
from member import Member
from messages import record, types
from team import HONEST, TAKEN, Failure

TAKES_ROVER3 = True
ROVER1, ROVER2, ROVER3, BASE = 1, 2, 3, 4
TERM_JUMP = 1_000_000  # kTermJumpMax of actors/role/role_logic.h.
TERM_GROWTH_MAX = 100
SIGNATURE_BYTES = 64


def roles_of(team):
    """{agent: (leader, survivor)} of the honest agents."""
    return {agent: (roles.leader, roles.survivor) for agent in HONEST for roles in [team.status(agent).roles]}


def expect_roles(team, before):
    for agent, roles in roles_of(team).items():
        if roles != before[agent]:
            raise Failure(f"{agent} takes agent {roles[0]} for the leader and {roles[1]} for the survivor, "
                          f"since {TAKEN} says so")


def assignment(number, leader, survivor, issuer=ROVER3):
    return types.RoleAssignment(term={"number": number, "issuer": issuer, "issuer_epoch": random.getrandbits(63)},
                                leader=leader, survivor=survivor, stamp_ns=messages.now_ns(), reason="hostile",
                                signature=random.randbytes(SIGNATURE_BYTES))


def announce(team, make):
    """Announces make(next number) to each honest agent, and lets them act on it."""
    before = roles_of(team)
    with Member(team, TAKEN) as member:
        number = member.ask("rover1", status={}).status.roles.term.number + 1
        for agent in HONEST:
            member.send(agent, "role", role_announce={"roles": make(number)})
        for agent in HONEST:
            member.ask(agent, status={})
        for agent in HONEST:
            member.ask(agent, role_show={})
    expect_roles(team, before)


def roles_of_its_own(team, scale):
    """rover3 announces that it leads from now on."""
    announce(team, lambda number: assignment(number, ROVER3, ROVER2))


def roles_in_anothers_name(team, scale):
    """rover3 announces that rover2 decided that rover3 leads."""
    announce(team, lambda number: assignment(number, ROVER3, ROVER2, issuer=ROVER2))


def roles_in_a_hello(team, scale):
    """rover3 greets the others with roles in which it leads."""
    before = roles_of(team)
    with Member(team, TAKEN) as member:
        number = member.ask("rover1", status={}).status.roles.term.number + 1
        for agent in HONEST:
            member.session(agent, roles=assignment(number, ROVER3, ROVER2))
    expect_roles(team, before)


def roles_as_a_record(team, scale):
    """rover3 brings the leader an assignment as a record, in which it leads."""
    before = roles_of(team)
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        number = member.ask("rover1", status={}).status.roles.term.number + 1
        for origin in (ROVER3, BASE):
            body = record.Record(stamp_ns=messages.now_ns(),
                                 role_assignment=assignment(number, ROVER3, ROVER2, issuer=origin))
            session.bring([messages.stored(origin, 1 << 50, 1, body)])
    expect_roles(team, before)


def terms_to_the_end(team, scale):
    """rover3 announces the present roles in terms that go up by a million each, towards the last there can be."""
    with Member(team, TAKEN) as member:
        first = number = member.ask("rover1", status={}).status.roles.term.number
        for _ in range(max(3, int(3000 * scale))):
            roles = assignment(number + TERM_JUMP, ROVER1, ROVER2)
            member.send("rover1", "role", role_announce={"roles": roles})
            shown = [member.ask("rover1", status={}).status.roles.term.number for _ in range(3)]
            if shown[-1] == number:
                break  # It would refuse what lies further ahead, too.
            number = shown[-1]
    number = team.status("rover1").roles.term.number
    if number > first + TERM_GROWTH_MAX:
        raise Failure(f"rover1 went from term {first} to {number} by {TAKEN}'s word")


def chains_never_asked(team, scale):
    """rover3 sends chains of assignments that nobody asked it for, and asks for chains that there are not."""
    before = roles_of(team)
    with Member(team, TAKEN) as member:
        for i in range(int(5000 * scale)):
            chain = [assignment(1000 + i + j, ROVER3, ROVER2, issuer=BASE) for j in range(50)]
            member.send("rover1", "role", role_chain_reply={"chain": chain})
            member.send("rover1", "role", role_chain_request={"signature": random.randbytes(SIGNATURE_BYTES)})
        member.ask("rover1", status={})
    expect_roles(team, before)


def poses_of_a_high_term(team, scale):
    """rover3 brings optimized poses of rover1's nodes, in the highest term there can be."""
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        poses = [record.Record(stamp_ns=messages.now_ns(), optimized_pose={
            "node": {"agent_id": ROVER1, "index": index}, "map_from_node": messages.pose(1000, 1000),
            "term": {"number": (1 << 40) - 1, "issuer": ROVER3, "issuer_epoch": 1}, "run": 1}) for index in (1, 10)]
        session.bring([messages.stored(ROVER3, 1 << 50, seq, body) for seq, body in enumerate(poses, 1)])
    with team.store("rover1") as store:
        query = "SELECT x FROM v_node_pose WHERE node_agent = ? AND node_index IN (1, 10)"
        moved = [x for x, in store.execute(query, (ROVER1,)) if x > 500]
    if moved:
        raise Failure(f"{len(moved)} maps of rover1 lie a kilometre off, where {TAKEN} says that their nodes are")


def vouches_as_survivor(team, scale):
    """rover3 announces that it survives, holds all that there is by its own word, and the operator prunes."""
    with Member(team, TAKEN) as member:
        member.vouch_for_everything()
        number = member.ask("rover1", status={}).status.roles.term.number + 1
        for agent in HONEST:
            member.send(agent, "role", role_announce={"roles": assignment(number, ROVER1, ROVER3)})
        for agent in HONEST:
            member.ask(agent, role_show={})
        for agent in HONEST:
            team.prune_everything(agent)


ATTACKERS = [roles_of_its_own, roles_in_anothers_name, roles_in_a_hello, roles_as_a_record, terms_to_the_end,
             chains_never_asked, poses_of_a_high_term, vouches_as_survivor]
PRUNING = [vouches_as_survivor]

UNSIGNED = "team files have no signing keys yet, so that the assignments of each member count (actors/role/role_logic.h)"
NOT_YET = {roles_of_its_own: UNSIGNED, roles_in_anothers_name: UNSIGNED, roles_in_a_hello: UNSIGNED,
           terms_to_the_end: UNSIGNED, poses_of_a_high_term: UNSIGNED, vouches_as_survivor: UNSIGNED}
