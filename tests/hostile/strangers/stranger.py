"""The stranger: a process that attacks one running fleet until it is killed, and reports each attack as a line of JSON.

    python -m tests.hostile.strangers.stranger --run FOLDER --robots r1,r2 --seed 7 --holds viewer --lifeline 5

`run.py` starts it. It looks into the run's folder for what it is meant to hold, and for the router's
address and the fleet's name, which everybody on the machine can see.
"""

import argparse
import json
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from patrol.errors import BadInput, did_you_mean
from patrol.random import Draws, Purpose
from runtime.process.failures import BAD_INPUT
from runtime.process.lifeline import heed, run_process
from runtime.security.access import FILE, credentials_at
from runtime.security.keys import fleet_keys
from runtime.security.private_files import read_object
from tests.hostile.strangers.door import Door, begin_well, knock, say_nothing, send_noise
from tests.hostile.strangers.member import Member
from tests.hostile.strangers.spell import ATTACKS, Holds, role_of_stranger

ENTER_S = 20.0
"""How long a member waits to be let in, beside everything else that the machine does."""

Attack = Callable[[Draws], Counter[str]]


def main(arguments: Sequence[str] | None = None) -> int:
    """Attack a fleet until asked to stop; exit code 2: it is not there, or does not let its own member in."""
    options = _options(arguments)
    ending = heed(options.lifeline)
    try:
        attacks = _attacks(options.run, tuple(options.robots.split(",")), Holds[options.holds], options.victim)
        attacks = _chosen(attacks, options.only)
    except BadInput as bad:
        print(f"stranger: {bad}", file=sys.stderr)
        return BAD_INPUT
    dice = Draws(options.seed, Purpose.STRANGER, ATTACKS)
    while not ending.wait(0.1):
        name = dice.choice(*attacks)
        print(json.dumps({"begins": name}), flush=True)
        print(json.dumps({"attack": name, "counts": attacks[name](dice)}), flush=True)
    return 0


def _attacks(run: Path, robots: tuple[str, ...], holds: Holds, victim: str) -> Mapping[str, Attack]:
    """The attacks that somebody can make who holds something, by name."""
    says = read_object(run / FILE, "--run")
    door = Door(str(says["router"]), fleet_keys(str(says["fleet"])), robots)
    attacks: dict[str, Attack] = {
        "knocks": lambda dice: knock(door, dice),
        "noise on connections": lambda dice: send_noise(door, dice),
        "silent connections": lambda dice: say_nothing(door, dice),
        "connections that begin well": lambda dice: begin_well(door, dice),
    }
    role = role_of_stranger(holds, victim)
    if role is None:
        return attacks
    session = door.enter(credentials_at(run, "--run", role), ENTER_S)
    if session is None:
        raise BadInput(f"--run {run}: its router does not let {role.user} in, who has the right credentials")
    member = Member(door, role, session)
    attacks |= {
        "listening": member.listen,
        "false offers": member.answer_everything,
        "noise": member.send_noise,
        "changed messages": member.send_changed,
        "replays": member.replay,
        "forgeries": member.forge,
        "floods": member.flood,
        "huge messages": member.send_huge,
        "questions": member.ask,
        "false tokens": member.pretend,
        "stopped readers": member.stop_reading,
    }
    if role.robot:
        attacks |= {"false answers": member.impersonate, "false farewells": member.farewell}
    return attacks


def _chosen(attacks: Mapping[str, Attack], only: Sequence[str]) -> Mapping[str, Attack]:
    for name in only:
        if name not in attacks:
            raise BadInput(f"--only {name}: {did_you_mean(name, list(attacks))}")
    return {name: attack for name, attack in attacks.items() if not only or name in only}


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="python -m tests.hostile.strangers.stranger", description="Attack a running fleet."
    )
    parser.add_argument("--run", type=Path, required=True, metavar="FOLDER", help="the run's folder")
    parser.add_argument("--robots", required=True, metavar="NAMES", help="names of its robots, such as r1,r2")
    parser.add_argument("--holds", required=True, choices=[holds.name for holds in Holds], help="what it holds")
    parser.add_argument("--victim", required=True, metavar="NAME", help="the robot whose credentials it holds")
    parser.add_argument("--seed", type=int, required=True, help="decides the attacks")
    parser.add_argument("--only", action="append", default=[], metavar="NAME", help="make this attack; may be repeated")
    parser.add_argument("--lifeline", type=int, metavar="FD", help="leave when this pipe ends (set by the launcher)")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    run_process(main)
