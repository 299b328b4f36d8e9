"""The stops of the robot. Each source of a stop must release it before it drives again, also after a restart."""

from __future__ import annotations

from enum import StrEnum
from threading import Condition, Thread

from ros2.robot.stop_files import StopFiles

SAVE_S = 1.0
"""Longest time to write a stop to disk before its source is told that it is not written, s."""


class Stopper(StrEnum):
    """The sources of stops."""

    OPERATOR = "operator"
    TOPIC = "topic"


class Stops:
    """The stops that hold; called from any thread.

    A stop holds at once. A thread notes it, so that no slow disk keeps a robot driving; `unsaved` waits for that.
    Without `files` the stops end with this process.
    """

    def __init__(self, topic: str, files: StopFiles | None = None) -> None:
        self._texts = {
            Stopper.OPERATOR: ("an operator", "fogwatch control ... release"),
            Stopper.TOPIC: (f"the topic {topic}", "publish false there to release it"),
        }
        self._files = files
        self._changed = Condition()
        self._held = [] if files is None else [stopper for stopper in Stopper if files.holds(stopper)]
        self._noted = set(self._held)
        self._error = ""
        if files is not None:
            Thread(target=self._note, args=(files,), name="stops", daemon=True).start()

    def __bool__(self) -> bool:
        return bool(self._held)

    def __contains__(self, stopper: Stopper) -> bool:
        return stopper in self._held

    @property
    def why(self) -> str:
        """The stops of the robot and how to release them; empty if there are none."""
        with self._changed:
            held = [self._texts[stopper] for stopper in self._held]
        return "; ".join(f"stopped by {who} ({release})" for who, release in held)

    @property
    def error(self) -> str:
        """The reason why the files do not say which stops hold; empty if they do, or will in a moment."""
        return self._error

    def who(self, stopper: Stopper) -> str:
        """Name a source of stops, for people."""
        return self._texts[stopper][0]

    def hold(self, stopper: Stopper) -> bool:
        """Stop the robot for one source; return True if that is new."""
        with self._changed:
            new = stopper not in self._held
            if new:
                self._held.append(stopper)
            self._error = ""
            self._changed.notify_all()
            return new

    def release(self, stopper: Stopper) -> bool:
        """Release the stops of one source, while others' stops still hold; return True if that is new."""
        with self._changed:
            new = stopper in self._held
            if new:
                self._held.remove(stopper)
            self._error = ""
            self._changed.notify_all()
            return new

    def unsaved(self, limit_s: float = SAVE_S) -> str:
        """Wait until the stops that hold now are noted; return why they are not, in a few words, empty if they are."""
        with self._changed:
            if self._files is None:
                return ""
            self._changed.wait_for(lambda: bool(self._error) or self._is_noted(), limit_s)
            return "" if self._is_noted() else self._error or "the disk is slow"

    def _is_noted(self) -> bool:
        return self._noted == set(self._held)

    def _note(self, files: StopFiles) -> None:
        """Have the files say what holds, always; after an error when something changes."""
        while True:
            with self._changed:
                self._changed.wait_for(lambda: not self._error and not self._is_noted())
                wrong = next(iter(set(self._held) ^ self._noted))
                holds = wrong in self._held
            error = files.note(wrong, self._texts[wrong][0]) if holds else files.forget(wrong)
            with self._changed:
                self._error = error
                if not error:
                    (self._noted.add if holds else self._noted.discard)(wrong)
                self._changed.notify_all()
