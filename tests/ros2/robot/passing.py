"""A time that passes only while somebody waits, for tests of how long things wait."""

from collections.abc import Callable
from types import ModuleType
from typing import Any

import pytest


class Passing:
    """The time, and the waits so far; in place of the module `time` it is what `monotonic` tells."""

    def __init__(self) -> None:
        self.now_s = 100.0
        self.waits: list[float] = []

    def monotonic(self) -> float:
        return self.now_s

    def put_into(self, monkeypatch: pytest.MonkeyPatch, module: ModuleType, *names: str) -> None:
        """Let a module's time pass so; names are those of `Event` or `Condition`, whichever it uses."""
        monkeypatch.setattr(module, "time", self)
        for name in names:
            monkeypatch.setattr(module, name, lambda: Waiter(self))


class Waiter:
    """An event or a condition on which nobody else acts, so each wait lasts as long as it may."""

    def __init__(self, passing: Passing) -> None:
        self._passing = passing
        self._is_set = False

    def __enter__(self) -> None:
        pass

    def __exit__(self, *_: object) -> None:
        pass

    def notify_all(self) -> None:
        pass

    def set(self) -> None:
        self._is_set = True

    def is_set(self) -> bool:
        return self._is_set

    def wait(self, timeout: float) -> bool:
        if not self._is_set:
            self._passing.waits.append(timeout)
            self._passing.now_s += timeout
        return self._is_set

    def wait_for(self, is_so: Callable[[], Any], timeout: float) -> bool:
        return bool(is_so()) or self.wait(timeout)
