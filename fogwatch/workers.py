"""The minds of a fleet in several processes of this machine, called as if they were in one.

Each worker is a fork of the process that runs the world, and makes the minds of some of the robots. It gets one call at
a time through a pipe, and ends when the other end of the pipe is closed, by whatever cause.
"""

from __future__ import annotations

import gc
import signal
import sys
from contextlib import suppress
from multiprocessing import get_context
from traceback import format_exception
from typing import TYPE_CHECKING, Any

from patrol.errors import BadInput
from patrol.radio.inbox import heard_by
from worldsim.fleet.process_control import NotStarted

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess

    from patrol.exchange import Reply, Sensed
    from patrol.journal import Status
    from worldsim.fleet.loop import Fleet

    PolicyFailure = Callable[[int, str, BaseException | None], None]
    """Takes a robot's number, how its policy has failed, and what it raised (None where it raised nothing)."""

    MakePart = Callable[[Sequence[int], PolicyFailure], Fleet]
    """Makes the fleet of some robots, given by number; it tells the other argument of each policy that fails."""


GRACE_S = 5.0
"""Wall time in which a worker may end by itself."""


class WorkerEnded(Exception):
    """A worker has ended by itself, or was ended; the minds in it are gone."""


class FailedInWorker(Exception):
    """An error of a policy in a worker, whose own class may not go through a pipe: ``str(error)`` is its traceback."""


class WithoutProcesses:
    """The part of `worldsim.fleet.process_control.ProcessControl` that does nothing for minds without processes."""

    def pause(self, number: int) -> str:
        """Do nothing: a mind that is not called stands still, and has no process to look at."""
        del number
        return ""

    def resume(self, number: int) -> str:
        """Do nothing: the mind is called again."""
        del number
        return ""

    def release(self, paused: Iterable[int]) -> None:
        """Do nothing: no mind is held."""


class Workers(WithoutProcesses):
    """A fleet in several workers, each of which has every n-th robot's mind.

    It implements `worldsim.fleet.loop.Fleet` and `worldsim.fleet.process_control.ProcessControl`. Answers are put in
    roster order, so that a trace does not depend on the number of workers. An error of a worker is raised here, with
    its traceback as a note; policies that fail are told of with `FailedInWorker`.
    """

    def __init__(self, count: int, numbers: Iterable[int], make: MakePart, failure: PolicyFailure) -> None:
        """Start workers for some robots; `failure` is told of each policy that fails."""
        if sys.platform != "linux":
            raise BadInput(f"--workers {count}: only Linux forks a process safely; leave it out")
        self._failure = failure
        self._pipes: list[Connection] = []
        self._processes: list[BaseProcess] = []
        numbers, context = list(numbers), get_context("fork")
        gc.freeze()  # or a collection in a worker would write to each object, and so copy all memory of this process
        try:
            for worker in range(count):
                pipe, other = context.Pipe()
                part = [number for number in numbers if number % count == worker]
                self._pipes.append(pipe)
                ends = (other, self._pipes)
                process = context.Process(target=_serve_calls, args=(*ends, part, make), name=f"worker {worker}")
                process.daemon = True  # ended with this process, where that comes to an end of its own
                process.start()
                other.close()
                self._processes.append(process)
        finally:
            gc.unfreeze()
        try:
            self._answers()
        except BaseException:
            self.finish(0)
            raise

    def phase_a(self, k: int, reports: Mapping[int, Sensed]) -> Mapping[int, Sequence[bytes]]:
        """Return the frames that every mind sends."""
        frames: dict[int, Sequence[bytes]] = self._ask_all(
            "phase_a", k, reports, lambda part: {number: reports[number] for number in part}
        )
        return frames

    def phase_b(self, k: int, heard: Mapping[int, list[bytes]]) -> Mapping[int, Reply]:
        """Return every mind's command."""
        replies: dict[int, Reply] = self._ask_all("phase_b", k, heard, lambda part: heard_by(part, heard))
        return replies

    def lost(self) -> Sequence[tuple[int, Status, str]]:
        """Return the robots whose policy has failed in this tick."""
        for worker in range(len(self._pipes)):
            self._send(worker, "lost")
        return sorted(lost for part in self._answers() for lost in part)

    def kill(self, number: int) -> None:
        """Drop a mind, with all that it knew."""
        self._ask(number, "kill")

    def leave(self, number: int) -> None:
        """Drop a mind; it has nothing to put in order."""
        self._ask(number, "leave")

    def start(self, number: int, incarnation: int) -> None:
        """Make a new mind."""
        self._ask(number, "start", incarnation)

    def arrived(self, number: int) -> bool:
        """Return True at once; a mind whose policy cannot be made raises NotStarted."""
        return bool(self._ask(number, "arrived"))

    def finish(self, k: int) -> None:
        """End the workers."""
        del k
        for pipe in self._pipes:
            pipe.close()
        for process in self._processes:
            process.join(GRACE_S)
            process.kill()

    def _ask_all(self, method: str, k: int, numbers: Iterable[int], part_of: Callable[[list[int]], object]) -> Any:
        """Call a method of every worker with what `part_of` makes for its robots, and join the answers."""
        for worker in range(count := len(self._pipes)):
            self._send(worker, method, k, part_of([number for number in numbers if number % count == worker]))
        answers = {number: answer for part in self._answers() for number, answer in part.items()}
        return {number: answers[number] for number in numbers if number in answers}

    def _ask(self, number: int, method: str, *arguments: object) -> Any:
        """Call a method of the worker that has a robot's mind."""
        worker = number % len(self._pipes)
        self._send(worker, method, number, *arguments)
        return self._answer(worker)

    def _answers(self) -> list[Any]:
        return [self._answer(worker) for worker in range(len(self._pipes))]

    def _send(self, worker: int, *call: object) -> None:
        try:
            self._pipes[worker].send(call)
        except ConnectionError:
            raise self._ended(worker) from None

    def _answer(self, worker: int) -> Any:
        try:
            answer, failures, error = self._pipes[worker].recv()
        except (EOFError, ConnectionError):
            raise self._ended(worker) from None
        for failure in failures:
            self._failure(*failure)
        if error is not None:
            raise error
        return answer

    def _ended(self, worker: int) -> WorkerEnded:
        process = self._processes[worker]
        process.join()
        return WorkerEnded(f"{process.name} of {len(self._pipes)} has ended with exit code {process.exitcode}")


def _serve_calls(pipe: Connection, others: Sequence[Connection], numbers: Sequence[int], make: MakePart) -> None:
    """Make the minds of some robots, and answer calls of them until the other end of a pipe is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other end closes the pipe
    for number in (signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT):  # whose handlers are those of the other end
        signal.signal(number, signal.SIG_DFL)
    for other in others:  # this process has them as well, which would keep them open
        other.close()
    failures: list[tuple[int, str, BaseException | None]] = []

    def note_failure(number: int, reason: str, error: BaseException | None) -> None:
        portable = None if error is None else FailedInWorker("".join(format_exception(error)))
        failures.append((number, reason, portable))

    answer, refused = None, None
    try:
        fleet = make(numbers, note_failure)
        while True:
            pipe.send((answer, failures, refused))
            failures.clear()
            method, *arguments = pipe.recv()
            answer, refused = None, None
            try:
                answer = getattr(fleet, method)(*arguments)
            except NotStarted as error:
                refused = error
    except (EOFError, ConnectionError):
        return
    except BaseException as error:
        error.add_note("".join(format_exception(error)))
        with suppress(ConnectionError):
            pipe.send((None, failures, error))
        raise SystemExit(1) from error
