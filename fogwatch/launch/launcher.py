"""The launcher: a fleet as processes of this machine, from the first to the last.

It spawns a router, the world and one agent per robot, each in a session of its own, so that Ctrl-C reaches the launcher
alone; it restarts a router that dies; it ends everything in order, and by force where order takes too long. Children
hold the reading end of a pipe whose end tells them that the launcher is gone.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType

from fogwatch.launch.child_control import HandsServer
from fogwatch.launch.live_table import Show
from fogwatch.launch.runfolder import RunFolder
from fogwatch.router import READY
from monitor.process import KEY
from monitor.process import READY as ADDRESS
from patrol.errors import BadInput
from patrol.net.access import Access, write_access
from patrol.net.keys import fleet_keys
from patrol.net.link import Link, LinkDown, Mailbox, open_link
from patrol.net.phases import FIRST_INCARNATION
from patrol.net.telemetry import EVENTS, MAX_VIEW, METRICS, read_metrics, read_notice
from worldsim.lifecycle import process_name

ROUTER, WORLD, PAGE = "the router", "the world", "the page"
"""Names that no robot can have."""

LOG_LINES = 5
ROUTER_S = 10.0
"""How long a router may take to listen."""
GOODBYE_S = 5.0
"""How long processes may take to leave by themselves once the run is over."""
TERM_S = 2.0
"""How long a process may take to heed a signal before it is killed."""
PAGE_WAIT_S = "86400"
"""How long the page waits for the world, which may have a large map to work on."""
MOST_ROUTERS = 20
_TICK_S = 0.05


class Failed(Exception):
    """The fleet could not be brought to run; one line says why."""


@dataclass(slots=True)
class Child:
    """A process of ours. code: its exit code, negative for the signal that killed it, None while it lives.

    incarnation: how often its robot was started. planned: whether the run's faults have killed it.
    """

    name: str
    process: subprocess.Popen[bytes]
    log: Path
    code: int | None = None
    incarnation: int = FIRST_INCARNATION
    planned: bool = False

    def poll(self) -> int | None:
        """Its exit code, when it has ended."""
        self.code = self.process.poll()
        return self.code

    def last_words(self) -> str:
        """The end of its log, on one line each, indented."""
        try:
            lines = self.log.read_text(encoding="utf-8", errors="replace").splitlines()
        except OSError:
            lines = []
        return "\n".join(f"    {line}" for line in lines[-LOG_LINES:] if line.strip())


@dataclass(slots=True)
class Launch:
    """One run as processes.

    fleet: a name that no other run has, so that two on one router never meet. stop: asked all the time; urgent: whether
    to end by force at once. absent: robots that are not started with the others. page: whether to serve one.
    """

    folder: RunFolder
    fleet: str
    robots: Sequence[str]
    show: Show
    stop: Callable[[], bool]
    port: int | None = None
    urgent: Callable[[], bool] = lambda: False
    absent: Collection[str] = ()
    page: bool = False
    children: dict[str, Child] = field(default_factory=dict)
    interrupted: bool = False
    _former: list[Child] = field(default_factory=list)
    _hands: HandsServer | None = None
    _pipe: tuple[int, int] = (-1, -1)
    _endpoint: str = ""
    _routers: int = 0
    _reported: set[str] = field(default_factory=set)
    _page_key: str = ""

    def start(self) -> None:
        """Spawn everything. Agents and world wait for the static fields, should the caller still compute them."""
        self._pipe = os.pipe()
        self.folder.logs.mkdir(exist_ok=True)
        self._start_router()
        write_access(self.folder.access, Access(self.fleet, self._endpoint, os.urandom(16).hex()))
        ours, theirs = socket.socketpair()
        with theirs:
            own = ["--out", str(self.folder.path), "--control", str(self.folder.access)]
            hands = ["--hands", str(theirs.fileno())]
            self._spawn(WORLD, "worldsim", [*self._common(), *own, *hands], theirs.fileno())
        self._hands = HandsServer(ours, self)
        for name in self.robots:
            if name not in self.absent:
                self._spawn_agent(name, FIRST_INCARNATION)
        if self.page:
            self._start_page()

    def watch(self) -> None:
        """Show how the run goes until the world has ended, or somebody wants it to."""
        try:
            link = open_link(self._endpoint, ROUTER_S)
        except LinkDown as down:
            raise Failed(str(down)) from None
        try:
            self._watch(link)
        finally:
            link.close()

    def finish(self) -> Mapping[str, int | None]:
        """End whatever is left, in order; the exit codes by name (`worldsim.lifecycle.process_name`)."""
        if self.interrupted:
            self._signal([WORLD], signal.SIGTERM)
        if self._hands is not None:
            self._hands.close()
        self._signal(self.robots, signal.SIGCONT)  # one that is paused could not leave
        world = self.children.get(WORLD)
        if world is not None and self.folder.journal.exists() and (self.interrupted or world.poll() == 0):
            self._wait([WORLD, *self.robots], GOODBYE_S)
        rest = [name for name in self.children if name != ROUTER]
        self._end(rest)
        self._end([ROUTER] if ROUTER in self.children else [])
        for end in self._pipe:
            if end >= 0:
                os.close(end)
        self._pipe = (-1, -1)
        self.folder.access.unlink(missing_ok=True)
        all_there_were = [*self.children.values(), *self._former]
        # How the page fares is nothing that a run could be judged by.
        judged = [child for child in all_there_were if child.name != PAGE]
        return {process_name(child.name, child.incarnation): child.code for child in judged}

    def obituary(self, name: str) -> str:
        """How a process ended and the end of its log."""
        child = self.children[name]
        words = child.last_words()
        return f"{name} {_how(child.code)}" + (f"; the end of its log ({child.log}):\n{words}" if words else "")

    # --- hands: what the world asks for, called on their own thread --------------------------------------------------

    def kill(self, robot: int) -> None:
        """SIGKILL to a robot's process, and waited for; one that is gone already stays as it is."""
        child = self._child(robot)
        child.planned = True
        child.process.kill()
        child.process.wait()
        child.poll()

    def pause(self, robot: int) -> None:
        """SIGSTOP to a robot's process; it stands still when this returns."""
        process = self._child(robot).process
        process.send_signal(signal.SIGSTOP)
        with suppress(ChildProcessError):  # it has ended by itself
            os.waitid(os.P_PID, process.pid, os.WSTOPPED | os.WEXITED | os.WNOWAIT)

    def state(self, robot: int) -> str:
        """What a robot's process does by proc(5), T where it is stopped; empty where there is no proc."""
        try:
            stat = Path(f"/proc/{self._child(robot).process.pid}/stat").read_text(encoding="ascii", errors="replace")
        except OSError:
            return ""
        return stat.rpartition(")")[2].split()[0]

    def resume(self, robot: int) -> None:
        """SIGCONT to a robot's process."""
        self._child(robot).process.send_signal(signal.SIGCONT)

    def see_off(self, robot: int) -> None:
        """Wait for a robot's process, which has been told to go; one that does not go in time is ended."""
        name = self.robots[robot - 1]
        self._wait([name], GOODBYE_S)
        self._end([name])

    def start_anew(self, robot: int, incarnation: int) -> None:
        """A new process for a robot whose last one is gone, or that had none."""
        name = self.robots[robot - 1]
        if (last := self.children.get(name)) is not None:
            self._former.append(last)
        self._reported.discard(name)
        self._spawn_agent(name, incarnation)

    def _child(self, robot: int) -> Child:
        return self.children[self.robots[robot - 1]]

    # --- starting ----------------------------------------------------------------------------------------------------

    def _start_router(self) -> None:
        for _ in range(MOST_ROUTERS):
            port = self.port or _free_port()
            self._endpoint = f"tcp/127.0.0.1:{port}"
            router = self._spawn(ROUTER, "fogwatch.router", ["--listen", self._endpoint])
            if self._listens(router):
                return
            busy = "busy" in router.last_words()
            if not busy:
                raise Failed(f"{ROUTER} did not start:\n{router.last_words()}")
            if self.port is not None:
                raise BadInput(f"--port {port}: the port is busy; choose another, or leave the choice to fogwatch")
        raise Failed("found no free port for the router")

    def _listens(self, router: Child) -> bool:
        until = time.monotonic() + ROUTER_S
        while router.poll() is None and time.monotonic() < until:
            if READY in router.log.read_text(encoding="utf-8", errors="replace"):
                return True
            time.sleep(0.01)
        return False

    def _common(self) -> list[str]:
        """What world and agents are all given."""
        common = ["--router", self._endpoint, "--fleet", self.fleet, "--scenario", str(self.folder.scenario)]
        return [*common, "--static", str(self.folder.static)]

    def _spawn_agent(self, name: str, incarnation: int) -> None:
        agent = [*self._common(), "--robot", name, "--incarnation", str(incarnation)]
        self._spawn(name, "agent", agent).incarnation = incarnation

    def _start_page(self) -> None:
        """Serve a page, where what it needs is installed. Its key goes into nobody's log and no list of processes."""
        missing = [name for name in ("starlette", "uvicorn", "websockets", "plotly") if find_spec(name) is None]
        if missing:
            self.show.say(f"no page: {missing[0]} is not installed (pip install 'fogwatch[monitor]')")
            return
        self._page_key = os.urandom(16).hex()
        self._spawn(
            PAGE, "monitor", ["--access", str(self.folder.access), "--wait", PAGE_WAIT_S], extra={KEY: self._page_key}
        )

    def _spawn(
        self,
        name: str,
        module: str,
        arguments: Sequence[str],
        *descriptors: int,
        extra: Mapping[str, str] = MappingProxyType({}),
    ) -> Child:
        log = self.folder.log(f"robot-{name}" if name in self.robots else name.removeprefix("the "))
        command = [sys.executable, "-P", "-m", module, *arguments, "--lifeline", str(self._pipe[0])]
        with log.open("ab") as output:
            process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                env={**os.environ, **extra},
                pass_fds=[self._pipe[0], *descriptors],
                start_new_session=True,
            )
        child = Child(name, process, log)
        self.children[name] = child
        return child

    # --- watching ----------------------------------------------------------------------------------------------------

    def _watch(self, link: Link) -> None:
        keys = fleet_keys(self.fleet)
        metrics, events = keys.truth(METRICS), keys.truth(EVENTS)
        seen = Mailbox([metrics], read_metrics, MAX_VIEW, room=1)
        heard = Mailbox([events], read_notice, MAX_VIEW)
        link.subscribe(metrics, seen)
        link.subscribe(events, heard)
        while self.children[WORLD].poll() is None:
            if self.stop():
                self.interrupted = True
                break
            if (arrived := seen.get(_TICK_S)) is not None:
                self.show.metrics(arrived[1])
            while (news := heard.get()) is not None:
                self.show.notice(news[1])
            self._look_after_children()

    def _look_after_children(self) -> None:
        """Restart a router that has died; report an agent that has, and give up when it never got to work."""
        self._look_after_page()
        router = self.children[ROUTER]
        if router.poll() is not None and not self.stop():
            self._routers += 1
            if self._routers > MOST_ROUTERS:
                raise Failed(f"{ROUTER} keeps dying:\n{router.last_words()}")
            self.show.say(f"{ROUTER} {_how(router.code)}; starting it again")
            self._spawn(ROUTER, "fogwatch.router", ["--listen", self._endpoint])
        for name in self.robots:
            child = self.children.get(name)
            if child is None or child.planned or name in self._reported or not child.poll():
                continue
            self._reported.add(name)
            if not self.folder.journal.exists():
                raise Failed(f"the run could not begin: {self.obituary(name)}")
            self.show.say(self.obituary(name))

    def _look_after_page(self) -> None:
        """Say where the page is, once it is there, and when it is gone; the run goes on without."""
        page = self.children.get(PAGE)
        if page is None or PAGE in self._reported:
            return
        if page.poll() is not None:
            self._reported.add(PAGE)
            self.show.say(self.obituary(PAGE))
        elif self._page_key and (address := _address_in(page.log)):
            self.show.say(f"{ADDRESS}{address}?key={self._page_key}")
            self._page_key = ""

    # --- ending ------------------------------------------------------------------------------------------------------

    def _end(self, names: Sequence[str]) -> None:
        """SIGTERM, and SIGKILL for whoever does not heed it; a stopped process continues first."""
        if not self.urgent():
            self._signal(names, signal.SIGTERM)
            self._signal(names, signal.SIGCONT)
            self._wait(names, TERM_S)
        self._signal(names, signal.SIGKILL)
        for name in names:
            self.children[name].process.wait()
            self.children[name].poll()

    def _signal(self, names: Sequence[str], number: signal.Signals) -> None:
        for name in names:
            if name in self.children and self.children[name].poll() is None:
                self.children[name].process.send_signal(number)

    def _wait(self, names: Sequence[str], limit_s: float) -> None:
        until = time.monotonic() + limit_s
        while time.monotonic() < until and not self.urgent():
            if all(self.children[name].poll() is not None for name in names if name in self.children):
                return
            time.sleep(0.01)


def _how(code: int | None) -> str:
    """How a process ended, in words."""
    if code is not None and code < 0:
        return f"was killed by {signal.Signals(-code).name}"
    return f"ended with exit code {code}"


def _address_in(log: Path) -> str:
    """The address that a page has printed; empty as long as it has not."""
    lines = log.read_text(encoding="utf-8", errors="replace").splitlines(keepends=True)
    return next(
        (line.removeprefix(ADDRESS).strip() for line in lines if line.startswith(ADDRESS) and line[-1] == "\n"), ""
    )


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
