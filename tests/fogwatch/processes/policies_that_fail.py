"""Policies for tests: each is fine until tick 20, when robot 2's fails; the last one cannot even be made."""

import math
import os
import time
from pathlib import Path

from agent.ports import Bearing, Intent, PolicySetup
from agent.view import View

FAILS_AT = 20


class Sound:
    """Drives round and round."""

    def __init__(self, setup: PolicySetup) -> None:
        self._failing = setup.robot.spec.number == 2

    def decide(self, view: View) -> Intent:
        if self._failing and view.tick == FAILS_AT:
            self.fail()
        return self.answer(view)

    def answer(self, view: View) -> Intent:
        return Bearing((0.3 * view.tick,))

    def fail(self) -> None:
        """Nothing: this one never fails."""


class Raising(Sound):
    """Also starts a process of its own, whose id it leaves in a folder."""

    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        pid = os.spawnlp(os.P_NOWAIT, "sleep", "sleep", "100000")
        Path(os.environ["POLICY_PIDS"], setup.robot.spec.name).write_text(str(pid), encoding="ascii")

    def fail(self) -> None:
        raise ZeroDivisionError("no idea")


class Sleeping(Sound):
    def fail(self) -> None:
        time.sleep(1e6)


class Leaving(Sound):
    def fail(self) -> None:
        raise SystemExit(3)


class Nonsense(Sound):
    def answer(self, view: View) -> Intent:
        return Bearing((math.nan if self._failing and view.tick == FAILS_AT else 0.3 * view.tick,))


class Unmade(Sound):
    def __init__(self, setup: PolicySetup) -> None:
        super().__init__(setup)
        raise ZeroDivisionError("no idea")
