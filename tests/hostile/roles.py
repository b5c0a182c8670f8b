"""Attackers with roles: a compromised member decides who leads, or whose poses are accepted."""
import random
import time

import messages
from member import Member
from messages import record, term
from team import HONEST, TAKEN, Failure

TAKES_ROVER3 = True
ROVER1, ROVER2, ROVER3, BASE = 1, 2, 3, 4
TERM_JUMP = 1_000_000  # Same as kTermJumpMax of actors/role/role_logic.h.
TERM_GROWTH_MAX = 100
# One more than kAtOnce of actors/role/change_budget.h, because the budget grows by one while the test runs.
CHANGES_MAX = 21
REIGN_SHIFT = 32  # Same as kEraShift of model/term.h.
TERM_MAX = (1 << 52) - 1
MAP_WIDTH_MAX_M = 500
SIGNATURE_BYTES = 64


def roles_of(team):
    """Returns {agent: (leader, survivor)} of the honest agents."""
    return {agent: (roles.leader, roles.survivor) for agent in HONEST for roles in [team.status(agent).roles]}


def expect_roles(team, before):
    for agent, roles in roles_of(team).items():
        if roles != before[agent]:
            raise Failure(f"{agent} takes agent {roles[0]} for the leader and {roles[1]} for the survivor, "
                          f"since {TAKEN} says so")


def assignment(team, follows, leader, survivor, issuer=ROVER3, number=None, era_begins=False):
    """Returns an assignment signed with rover3's key, whatever its issuer. Its number is `number`, or else the next
    one."""
    next_number = ((follows.term.number >> REIGN_SHIFT) + 1) << REIGN_SHIFT if era_begins else follows.term.number + 1
    roles = term.RoleAssignment(
        term={"number": next_number if number is None else number, "issuer": issuer,
              "issuer_epoch": random.getrandbits(63)},
        leader=leader, survivor=survivor, timestamp_ns=messages.now_ns(), reason="hostile", follows=follows.signature)
    team.sign(TAKEN, roles)
    return roles


def announce(team, *make):
    """For each function in `make`, announces make(the present roles) to each honest agent. Fails if an agent's
    roles change."""
    before = roles_of(team)
    with Member(team, TAKEN) as member:
        present = member.ask("rover1", status={}).status.roles
        for agent in HONEST:
            for one in make:
                member.send(agent, "role", role_announce={"roles": one(present)})
        for agent in HONEST:
            member.ask(agent, status={})
        for agent in HONEST:
            member.ask(agent, role_show={})
    expect_roles(team, before)


def roles_of_its_own(team, scale):
    """rover3 announces, under its own signature, that it leads: as the next revision, in a new era, in the last of all."""
    announce(team, lambda present: assignment(team, present, ROVER3, ROVER2),
             lambda present: assignment(team, present, ROVER3, ROVER2, era_begins=True),
             lambda present: assignment(team, present, ROVER3, ROVER2, number=TERM_MAX))


def roles_in_anothers_name(team, scale):
    """rover3 announces that rover2, the base station or rover1 decided that rover3 leads."""
    announce(team, *(lambda present, issuer=issuer, begins=begins: assignment(
        team, present, ROVER3, ROVER2, issuer=issuer, era_begins=begins)
        for issuer, begins in ((ROVER2, False), (BASE, True), (ROVER1, False), (0, False))))


def roles_of_the_file(team, scale):
    """rover3 announces other roles under the number of the team file's, which nobody signs."""
    announce(team, lambda _: term.RoleAssignment(leader=ROVER3, survivor=ROVER2),
             lambda present: term.RoleAssignment(term=present.term, leader=ROVER3, survivor=ROVER2,
                                                  follows=present.follows, signature=present.signature))


def roles_as_a_record(team, scale):
    """rover3 brings the leader assignments as records, in its own and in the base station's name, in which it leads."""
    before = roles_of(team)
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        present = member.ask("rover1", status={}).status.roles
        for origin in (ROVER3, BASE):
            roles = assignment(team, present, ROVER3, ROVER2, issuer=origin, era_begins=origin == BASE)
            body = record.Record(timestamp_ns=messages.now_ns(), role_assignment=roles)
            session.bring([messages.stored(origin, 1 << 49, 1, body)])
        member.ask("rover1", status={})
    expect_roles(team, before)


def lead(team, leader, survivor, at="rover1"):
    """Assigns the roles at agent `at`, as an operator. Waits until rover1 acts on them, and returns the roles."""
    team.moonctl("-a", at, "role", "set", f"rover{leader}", "leader", f"rover{survivor}", "survivor", check=False)
    for _ in range(100):
        roles = team.status("rover1").roles
        if (roles.leader, roles.survivor) == (leader, survivor):
            return roles
        time.sleep(0.1)
    raise Failure(f"rover1 does not act on the operator's word that rover{leader} leads")


def changes_as_records(team, scale):
    """rover3, which led once, brings the leader a hundred changes of roles as records, each after the one before."""
    roles = lead(team, ROVER3, ROVER2)
    lead(team, ROVER1, ROVER2, at="rover2")
    assignments = []
    for i in range(100):
        roles = assignment(team, roles, ROVER3, ROVER2 if i % 2 else ROVER1)
        assignments.append(roles)
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        for i, one in enumerate(assignments):
            body = record.Record(timestamp_ns=messages.now_ns(), role_assignment=one)
            session.bring([messages.stored(ROVER3, 1 << 49, i + 1, body)])
        member.ask("rover1", status={})
        present = member.ask("rover1", status={}).status.roles
    changes = sum(one.term.number <= present.term.number for one in assignments) if present.leader == ROVER3 else 0
    lead(team, ROVER1, ROVER2, at="base")
    if changes > CHANGES_MAX:
        raise Failure(f"rover1 acted on {changes} changes that rover3 brought as records")


def terms_to_the_end(team, scale):
    """rover3 announces the present roles in terms that go up by a million each, towards the last there can be."""
    with Member(team, TAKEN) as member:
        present = member.ask("rover1", status={}).status.roles
        first = number = present.term.number
        for _ in range(max(3, int(3000 * scale))):
            roles = assignment(team, present, ROVER1, ROVER2, number=number + TERM_JUMP)
            member.send("rover1", "role", role_announce={"roles": roles})
            shown = [member.ask("rover1", status={}).status.roles.term.number for _ in range(3)]
            if shown[-1] == number:
                break  # The agents would refuse later terms too.
            number = shown[-1]
    number = team.status("rover1").roles.term.number
    if number > first + TERM_GROWTH_MAX:
        raise Failure(f"rover1 went from term {first} to {number} by {TAKEN}'s word")


def chains_never_asked(team, scale):
    """rover3 sends chains of assignments that nobody asked it for, and asks for chains that there are not."""
    before = roles_of(team)
    with Member(team, TAKEN) as member:
        present = member.ask("rover1", status={}).status.roles
        chain = [assignment(team, present, ROVER3, ROVER2, number=1000 + i) for i in range(50)]
        for i in range(int(5000 * scale)):
            random.shuffle(chain)
            member.send("rover1", "role", role_chain_reply={"chain": chain})
            member.send("rover1", "role", role_chain_request={
                "signature": present.signature if i % 2 else random.randbytes(SIGNATURE_BYTES)})
        member.ask("rover1", timeout_s=60, status={})
    expect_roles(team, before)


def endless_chain(team, scale):
    """rover3 announces an assignment that follows one that follows one..., and gives a page whenever it is asked."""
    before = roles_of(team)
    asked = []
    with Member(team, TAKEN) as member:
        present = member.ask("rover1", status={}).status.roles
        length = max(200, int(5000 * scale))
        chain = [assignment(team, present, ROVER3, ROVER2)]
        for _ in range(length):
            chain.append(assignment(team, chain[-1], ROVER3, ROVER2))
        place_of = {roles.signature: i for i, roles in enumerate(chain)}

        def answer(heard):
            at = place_of.get(heard.role_chain_request.signature)
            asked.append(at)
            page = [] if at is None else chain[max(0, at - 100):at + 1][::-1]
            member.send(member.agent_of(heard), "role", role_chain_reply={"chain": page})
        member.answers["role_chain_request"] = answer
        member.send("rover1", "role", role_announce={"roles": chain[-1]})
        count = -1
        while count != len(asked):  # Wait until the agent requests no more pages.
            count = len(asked)
            time.sleep(1)
    expect_roles(team, before)


def poses_of_a_high_term(team, scale):
    """rover3 brings optimized poses of rover1's nodes, in the highest term there can be."""
    with Member(team, TAKEN) as member:
        session = member.session("rover1")
        poses = [record.Record(timestamp_ns=messages.now_ns(), optimized_pose={
            "node": {"agent_id": ROVER1, "index": index}, "map_from_node": messages.pose(1000, 1000),
            "term": {"number": (1 << 40) - 1, "issuer": ROVER3, "issuer_epoch": 1}, "run": 1}) for index in (1, 10)]
        session.bring([messages.stored(ROVER3, 1 << 50, seq, body) for seq, body in enumerate(poses, 1)])
    reply = team.call("rover1", merge={}).merge
    width_m = reply.width_cells * reply.resolution_um * 1e-6
    if width_m > MAP_WIDTH_MAX_M:
        raise Failure(f"the merged map is {width_m:.0f} m wide: maps of rover1 lie where {TAKEN} says that their nodes are")


def vouches_as_survivor(team, scale):
    """rover3 announces that it survives, holds all that there is by its own word, and the operator prunes."""
    with Member(team, TAKEN) as member:
        member.vouch_for_everything()
        present = member.ask("rover1", status={}).status.roles
        for agent in HONEST:
            member.send(agent, "role", role_announce={"roles": assignment(team, present, ROVER1, ROVER3)})
        for agent in HONEST:
            member.ask(agent, role_show={})
        for agent in HONEST:
            team.prune_everything(agent)


ATTACKERS = [roles_of_its_own, roles_in_anothers_name, roles_of_the_file, roles_as_a_record, changes_as_records,
             terms_to_the_end, chains_never_asked, endless_chain, poses_of_a_high_term, vouches_as_survivor]
PRUNING = [vouches_as_survivor]
LEADS = [changes_as_records]  # Attacks during which rover3 is the leader.
# The team is rebuilt after these attacks, because a former leader has more rights than a rover that never led.
LEAVES_MUCH = [changes_as_records]
