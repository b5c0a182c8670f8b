"""The demo's last act: a robot is lost at half time, and another one comes later.

Records flow by themselves: no command moves one. rover1 and rover2 drive the first half of the mission; then rover2 is
killed and stays away. Only now does rover3 start, so the two never met. At the end each robot that is left has the map of
all, with what rover2 saw.
"""
import json
import os
import shutil
import signal
import time

PERIOD_S = 2
POLL_S = 0.5
LOST, LATE, LEFT = "rover2", "rover3", ("rover1", "rover3", "base")


class NotSettled(Exception):
    """Records still moved after the limit."""


def let_records_flow(team_file):
    """Changes a team file so that each rover gets the records of the team's map without a command."""
    text = team_file.read_text(encoding="utf-8")
    text = text.replace("sync_period_s: 0", f"sync_period_s: {PERIOD_S}")
    text = text.replace("\n# rovers: {", "\nrovers: {pose_graph_edge: all, pose_prior: all, ")
    text = text.replace("  local_traversability_map: none", "  local_traversability_map: all")
    team_file.write_text(text, encoding="utf-8")


def wait_until_settled(team, names, away, limit_s):
    """Waits until nothing moves any more between these agents. Records may still wait for the agent `away`. Returns
    whether their maps are equal: a rover that is not placed shows its own map alone."""
    rest = ("", f"{away} does not answer; the other agents have settled")
    deadline, before = time.monotonic() + limit_s, None
    while time.monotonic() < deadline:
        time.sleep(POLL_S)
        why = json.loads(team.moonctl("--json", "status")).get("not_settled", "")
        if why == "a solve of the pose graph is due":
            team.moonctl("graph", "optimize")  # By itself the leader solves once a minute, which the demo does not await.
        hashes = [json.loads(team.moonctl("-a", name, "--json", "map", "stats"))["cells_hash"] for name in names]
        if why in rest and hashes == before:
            return len(set(hashes)) == 1
        before = hashes if why in rest else None
    raise NotSettled(f"not settled after {limit_s} s: {why}")


def share_of_copies(risk):
    """Returns the parts of all records that at least two of the agents hold, and that all of them hold."""
    agents = [agent for agent in risk["agents"] if "one_copy" in agent]
    one = sum(agent["one_copy"] for agent in agents)
    two = sum(agent["two_copies"] for agent in agents) / 2
    all_of_them = sum(agent["three_or_more_copies"] for agent in agents) / len(agents)
    total = one + two + all_of_them
    return (two + all_of_them) / total, all_of_them / total


def tell(story, mission, middle_s, out, limit_s, is_aligned):
    """Runs the act. Returns what goes into summary.json."""
    team = story.team
    with story.step(f"once more, no command moves a record: {LOST} is lost at half time, {LATE} comes later and never meets it"):
        for name in ("rover1", LOST, "base"):
            team.moonctl("-a", name, "up")
        team.replay("feed", "--mission", mission, "--to", middle_s, "--agents", "rover1", LOST, "base")
        wait_until_settled(team, ("rover1", LOST), LATE, limit_s)
        lost = team.status()[LOST]
        os.kill(int(lost["pid"]), signal.SIGKILL)
        team.moonctl("-a", LATE, "up")
        team.replay("feed", "--mission", mission, "--agents", *LEFT)
        are_equal = wait_until_settled(team, LEFT, LOST, limit_s)
    scores = {}
    for name in ("rover1", LATE):
        team.replay("score", "--mission", mission, "-a", name, "--out", out / name, "--json", out / name / "score.json",
                    *(["--align"] if is_aligned else []))
        scores[name] = json.loads((out / name / "score.json").read_text(encoding="utf-8"))
    shutil.copy(out / LATE / "merged_after.png", out / f"map_of_{LATE}.png")
    on_two, on_all = share_of_copies(json.loads(team.moonctl("--json", "risk")))
    status = team.status()
    sent = sent_bytes(lost) + sum(sent_bytes(status[name]) for name in LEFT)
    robot_minutes = (1 + 1 + 0.5) * 2 * middle_s / 60  # The lost robot drove for half of the time.
    return {
        "are_maps_equal": are_equal,
        "area_ratio": {name: score["area_ratio"] for name, score in scores.items()},
        "records_on_two_disks_ratio": on_two,
        "records_on_all_disks_ratio": on_all,
        "sent_kb_per_robot_minute": sent / 1000 / robot_minutes,
    }


def sent_bytes(status):
    return sum(int(peer["sent_bytes"]) for peer in status["peers"])


def print_result(result):
    print(f"\nOnce more, and no command moved a record: {LOST} was lost at half time; {LATE} came later and never met it.")
    for name, ratio in result["area_ratio"].items():
        print(f"{'map of ' + name:28}{100 * ratio:14.1f} %  of the area that all three would have mapped")
    are_equal = "equal" if result["are_maps_equal"] else "DIFFERENT"
    print(f"{'maps of ' + ', '.join(LEFT):28}{are_equal:>16}"
          + ("" if result["are_maps_equal"] else "  (a rover that is not placed shows its own map alone)"))
    print(f"{'records on two disks':28}{100 * result['records_on_two_disks_ratio']:14.1f} %  of those that the robots made, "
          f"{LOST}'s among them")
    print(f"{'records on all disks':28}{100 * result['records_on_all_disks_ratio']:14.1f} %  of them (the disks of "
          f"{', '.join(LEFT)})")
    print(f"{'sent per robot and minute':28}{result['sent_kb_per_robot_minute']:14.1f} kB of the mission's time")
