"""The state of a fleet without a world and without a scenario: the processes that are there, and what they send."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from functools import partial

from fogwatch.status.fleet_status import FleetStatus, RobotStatus
from monitor.live.positions_source import MAX_TELEMETRY
from monitor.observation.hearing import Hearing
from patrol.errors import Malformed
from patrol.net.keys import FleetKeys
from patrol.net.link import Link
from patrol.net.mailbox import Air, Mailbox
from patrol.net.messages.stop_orders import robots_there
from patrol.net.messages.telemetry import Telemetry
from patrol.process.lifeline import Ending
from patrol.radio.message import CONTACT, MAX_FRAME, Position, Rejected, decode
from patrol.wire import read

_UNKNOWN = "frames' tags, MFoW and trapped robots: give --scenario FILE"
_UNKNOWN_AT_A_ROUTER = f"robots that should be here and are not, {_UNKNOWN}"

_TAKE_S = 0.1


class _Heard:
    """The position and the reports that were heard of a robot."""

    def __init__(self, link: Link, air: Air, keys: FleetKeys, name: str, now: float) -> None:
        self.followed_since, self._name = now, name
        position, telemetry = keys.position(name), keys.telemetry(name)
        self._frames: Mailbox[Position] = Mailbox([position], _position, MAX_FRAME)
        self._reports: Mailbox[Telemetry] = Mailbox([telemetry], partial(read, Telemetry), MAX_TELEMETRY)
        self.position: Position | None = None
        self.position_at = 0.0
        self.report: Telemetry | None = None
        air.subscribe(position, self._frames)
        link.subscribe(telemetry, self._reports)

    def take(self, now: float, hearing: Hearing) -> None:
        """Take in what has arrived."""
        while (frame := self._frames.get()) is not None:
            hearing.sent(self._name)
            if frame[1].robot != CONTACT:
                self.position, self.position_at = frame[1], now
        while (report := self._reports.get()) is not None:
            self.report = report[1]
            hearing.take(self._name, self.report.traffic)


class TokenWatch:
    """Looks at the processes of a fleet."""

    def __init__(
        self,
        link: Link,
        air: Air,
        keys: FleetKeys,
        router: str,
        ending: Ending,
        silent_s: float,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """Take over the connections, which `close` closes.

        `link` leads to the fleet's router, `air` to where the robots send positions; they may be the same. A robot
        without a position for `silent_s` is silent. `ending` ends a look early. `now` gives the wall clock in s.
        """
        self._link, self._air, self._keys, self._router = link, air, keys, router
        self._ending, self._silent_s, self._now = ending, silent_s, now
        self._robots: dict[str, _Heard] = {}
        self._hearing = Hearing()

    def look(self, seconds: float) -> FleetStatus:
        """See `FleetWatch`."""
        self._follow()
        until = self._now() + seconds
        while (left := until - self._now()) > 0.0 and not self._ending.wait(min(left, _TAKE_S)):
            self._take()
        self._take()
        there, mesh = self._follow(), self._link.mesh
        names = sorted({*self._robots, *(() if mesh is None else mesh.robots)})
        robots = tuple(self._robot(name, there) for name in names)
        new = [robot.name for robot in robots if robot.heard_s is None and not robot.wrong]
        too_new = (
            (f"whether {', '.join(new)} can be heard: followed for less than {self._silent_s:g} s",) if new else ()
        )
        unknown = (*too_new, _UNKNOWN_AT_A_ROUTER if mesh is None else _UNKNOWN)
        return FleetStatus(self._keys.fleet, self._router, None, None, robots, unknown=unknown)

    def close(self) -> None:
        """See `FleetWatch`."""
        self._link.close()
        if self._air is not self._link:
            self._air.close()

    def _follow(self) -> list[str]:
        """List the robots that are there, and listen to those that are new."""
        there = robots_there(self._link, self._keys)
        for name in there:
            if name not in self._robots:
                self._robots[name] = _Heard(self._link, self._air, self._keys, name, self._now())
        return there

    def _take(self) -> None:
        for heard in self._robots.values():
            heard.take(self._now(), self._hearing)

    def _robot(self, name: str, there: Collection[str]) -> RobotStatus:
        if name not in self._robots:
            return RobotStatus(name, "absent", wrong="is not there")
        heard = self._robots[name]
        position, report = heard.position, heard.report
        now = self._now()
        heard_s = None if position is None else now - heard.position_at
        is_new = position is None and now - heard.followed_since < self._silent_s
        wrong = ""
        if name not in there:
            wrong = "its process has gone"
        elif is_new:
            pass
        elif position is None and report is None:
            wrong = f"has sent nothing for {self._silent_s:g} s"
        elif heard_s is None or heard_s > self._silent_s:
            wrong = f"no position for {self._silent_s:g} s"
            if heard_s is None:
                wrong += " here; if robots hear each other elsewhere, give --radio"
        else:
            wrong = self._hearing.wrong(name, there)
        return RobotStatus(
            name=name,
            status="alive" if name in there else "gone",
            doing="" if report is None else report.state,
            heard_s=heard_s,
            place=None if position is None else (position.pose.x, position.pose.y),
            tick=None if report is None else report.k,
            wrong=wrong,
        )


def _position(frame: bytes) -> Position:
    """Decode a frame; its tag is not checked."""
    try:
        return decode(frame)
    except Rejected as rejected:
        raise Malformed(str(rejected)) from None
