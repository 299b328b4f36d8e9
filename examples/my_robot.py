"""A robot of one's own in a fleet: this one only pretends to drive; yours would talk to its motors.

    fogwatch router --listen tcp/127.0.0.1:7447
    python -m worldsim --router tcp/127.0.0.1:7447 --fleet demo --scenario examples/own-robot.yaml --out runs/own
    fogwatch agent --router tcp/127.0.0.1:7447 --fleet demo --scenario examples/own-robot.yaml --robot r1    # and r2
    python examples/my_robot.py --router tcp/127.0.0.1:7447 --fleet demo --robot guest

r1 and r2 are simulated; this one is not, and patrols with them: it hears where they are, and they hear where it is.
docs/robots.md says what a robot has to do.
"""

import argparse
import sys
from pathlib import Path

from agent.own_robot import Site, drive
from patrol.exchange import Sensed
from patrol.ground.swept_path import advance, path_is_free
from patrol.pose import Command, halted


class MyRobot:
    """Senses where it is, and obeys commands for one step each."""

    def __init__(self, site: Site) -> None:
        self.site = site
        self.pose = site.start
        self.command: Command = halted(site.spec.model)
        self.k = -1

    def sense(self) -> Sensed | None:
        """Wait for the fleet's next tick, then say where this robot is. A real one asks its localisation."""
        k = self.site.clock.tick()
        if k is None:
            return None  # it is time to leave
        free = path_is_free(self.site.terrain, self.pose, self.command, self.site.step, self.site.spec.radius)
        if free and k == self.k + 1:
            self.pose = advance(self.pose, self.command, self.site.step)
        self.k, self.command = k, halted(self.site.spec.model)  # a command holds for one step
        return Sensed(k, self.pose, bumped=not free, clock_s=k * self.site.step)

    def act(self, command: Command) -> None:
        """Take a command for one step. A real robot tells its motors, and stops by itself when none comes in time."""
        self.command = command

    def stop(self, reason: str) -> None:
        """Stop for good."""
        self.command = halted(self.site.spec.model)
        print(f"stopped: {reason}", file=sys.stderr)


def main() -> int:
    """Drive until Ctrl-C; return the exit code."""
    parser = argparse.ArgumentParser(description="A robot of one's own in a fleet.")
    parser.add_argument("--credentials", metavar="FOLDER", help="this robot's, made by fogwatch fleet init")
    parser.add_argument("--router", metavar="LOCATOR", help="of the fleet, tcp/HOST:7447 (default: the credentials')")
    parser.add_argument("--fleet", metavar="NAME", help="the fleet's name (default: the credentials')")
    parser.add_argument("--robot", default="guest", metavar="NAME", help="name in the scenario (default: %(default)s)")
    parser.add_argument("--scenario", default=str(Path(__file__).with_name("own-robot.yaml")), metavar="FILE")
    parser.add_argument("--wait", type=float, default=60.0, metavar="S", help="for router and others, s (%(default)g)")
    options = parser.parse_args()
    return drive(
        MyRobot,
        scenario=options.scenario,
        robot=options.robot,
        credentials=options.credentials,
        router=options.router,
        fleet=options.fleet,
        wait_s=options.wait,
    )


if __name__ == "__main__":
    sys.exit(main())
