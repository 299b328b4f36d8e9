"""The launcher: runs a fleet as processes of this machine, from the first to the last.

It starts a router, the world and one agent per robot, the agents from a fork server where there are several; it
restarts a router that dies, and a page, without which the run goes on; it ends everything in order, and by force where
that takes too long. A fleet that the machine cannot hold is refused first (`check_limits`). The router, the page and
the fork server report on a pipe when they are ready; how a child ended is known from its exit code.
"""

from __future__ import annotations

import os
import signal
import socket
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from importlib.util import find_spec
from pathlib import Path

from fogwatch.launch.child_control import GOODBYE_S, ProcessControlServer
from fogwatch.launch.children import FORK_SERVER, OF_MINDS, Child, Children, ForkServer
from fogwatch.launch.private import Secrets
from fogwatch.run_folder.runfolder import PolicyNotMade, RunFolder
from fogwatch.terminal.live_table import RunDisplay
from monitor.process import KEY
from patrol.errors import BadInput
from patrol.exchange import FIRST_INCARNATION
from patrol.wire import read
from runtime.messages.telemetry import EVENTS, MAX_NOTICE, METRICS, Metrics, Notice, longest_metrics
from runtime.net.link import Link, LinkDown, open_link
from runtime.net.mailbox import Mailbox
from runtime.process.failures import BAD_INPUT, INTERRUPTED, LEAST, allow_files
from runtime.security.access import write_pointer
from runtime.security.credentials import read_credentials
from runtime.security.keys import fleet_keys
from runtime.security.roles import VIEWER, WORLD_ROLE, robot_role
from runtime.starting.forking import can_fork
from runtime.starting.readiness import StartFailure
from worldsim.faults import process_name

ROUTER, WORLD, PAGE = "the router", "the world", "the page"
"""Names that no robot can have."""
LOGS = {ROUTER: "router", WORLD: "world", PAGE: "page", FORK_SERVER: "fork-server"}
"""Names of their logs."""
NOT_JUDGED = (PAGE, FORK_SERVER)
"""Children without influence on the run: their exit codes are not judged."""

AGENT = "agent"
"""The module that a robot's process runs."""
LATEST = 9999
"""Largest incarnation that fits into the process title."""
ROUTER_S = 60.0
"""Longest time until a router listens, on a machine with much else to do; one that ends is noticed at once."""
BEGIN_S = 5.0
"""Longest time until an interrupted world either ends or has a run to end in order."""
PAGE_WAIT_S = "86400"
"""Time that the page waits for the world, which may have a large map to work on, s."""
MOST_ROUTERS = 20
"""Largest number of starts of a router, for a free port or after it has died."""
MOST_RESTARTS = 3
"""Largest number of restarts of a page that has died."""
PROCESS_GB = 0.15
"""Memory of one agent's process, GB."""
LOOPBACK_S = 2.0
"""Longest wait for a connection of this machine with itself, s."""
LAST_WORDS_S = 2.0
"""Longest wait for a notice of a world that has failed."""
_TICK_S = 0.05


class LaunchFailed(Exception):
    """The fleet could not be brought to run; the message says why in one line, and quotes a child's log below."""


@dataclass(slots=True)
class Launch:
    """One run as processes."""

    folder: RunFolder
    fleet: str  # a name that no other run has, so that two on one router never meet
    robots: Sequence[str]  # in the order of their numbers
    display: RunDisplay
    stop: Callable[[], bool]  # asked all the time whether to end the run
    port: int | None = None  # TCP port of the router; None for a free one
    urgent: Callable[[], bool] = lambda: False  # asked whether to end by force at once
    absent: Collection[str] = ()  # robots that are not started with the others
    page: bool = False  # serve a live page
    key: str | None = None  # file of the fleet's key, for the page to check tags of messages
    alike: bool = False  # the agents load the same, so one process that has loaded it may make them
    kernels: Sequence[str] = ()  # modules that agents need beside those that all agents load
    interrupted: bool = False  # the run ends because it was asked to
    children: Children = field(init=False)
    _control: ProcessControlServer | None = None
    _secrets: Secrets | None = None
    _endpoint: str = ""
    _routers: int = 0
    _reported: set[str] = field(default_factory=set)
    _page_child: PageChild | None = None
    _fork_server: ForkServer | None = None

    def __post_init__(self) -> None:
        self.children = Children(self.urgent)

    def start(self) -> None:
        """Start all processes, but agents that a fork server makes: it has to load first.

        Those that are started wait for the static fields, should the caller still compute them. LaunchFailed if the
        router does not start; KeyboardInterrupt if `stop` says yes before it has.
        """
        self.folder.logs.mkdir(exist_ok=True)
        secrets = self._secrets = Secrets(self.fleet, self.robots)
        if self.alike and len(self.robots) > 1 and can_fork():  # before the others, because it has most to load
            commands = [self.children.command(AGENT, self._agent_arguments(name, LATEST)) for name in self.robots]
            self._fork_server = ForkServer(self.children, self._log_file(FORK_SERVER), commands, self.kernels)
        self._start_router()
        secrets.for_members(self._endpoint)
        write_pointer(self.folder.access, self.fleet, self._endpoint, secrets.name)
        ours, theirs = socket.socketpair()
        with theirs:
            own_arguments = ["--out", str(self.folder.path), "--process-control", str(theirs.fileno())]
            arguments = [*self._common_arguments(secrets.of_role(WORLD_ROLE)), *own_arguments]
            self.children.spawn(WORLD, "worldsim", arguments, self._log_file(WORLD), inherit=[theirs.fileno()])
        self._control = ProcessControlServer(ours, self.children, self.robots, self.restart)
        if self._fork_server is None:
            self._spawn_agents()
        if self.page:
            arguments = ["--access", str(self.folder.access), "--wait", PAGE_WAIT_S]
            arguments += [] if self.key is None else ["--key", self.key]
            self._page_child = PageChild(self.children, arguments, self._log_file(PAGE), self.display.say)
            self._page_child.start()

    def watch(self) -> None:
        """Start the agents that a fork server makes; show how the run goes until the world or `stop` ends it.

        LaunchFailed if the router cannot be reached or keeps dying, or if an agent ended before the run began.
        """
        if self._fork_server is not None:
            self._fork_server.await_start(self.stop)
            self._spawn_agents()
        try:
            credentials = read_credentials(self._of_run.of_role(VIEWER), "the run")
            link = open_link(self._endpoint, ROUTER_S, stopped=self.stop, credentials=credentials)
        except LinkDown as down:
            if self.stop():
                self.interrupted = True
                return
            raise LaunchFailed(str(down)) from None
        try:
            self._watch_world(link)
        finally:
            link.close()

    def finish(self) -> Mapping[str, int | None]:
        """End what is left, in order, and return the exit codes, negative for signals.

        They are by name, as `worldsim.faults.process_name` makes it.
        """
        children = self.children
        if self.interrupted:
            children.signal([WORLD], signal.SIGTERM)
        if self._fork_server is not None:  # first: the world may be waiting for a robot that this is to make
            self._fork_server.close()
        if self._control is not None:
            self._control.close()
        children.signal(self.robots, signal.SIGCONT)  # one that is paused could not leave
        world = children.by_name.get(WORLD)
        if world is not None and self.interrupted:
            children.wait([WORLD], BEGIN_S)
        if world is not None and self.folder.journal.exists() and (self.interrupted or world.poll() == 0):
            children.wait([WORLD, *self.robots], GOODBYE_S)
        children.end([name for name in children.by_name if name != ROUTER])
        children.end([ROUTER] if ROUTER in children.by_name else [])
        children.close()
        self.folder.access.unlink(missing_ok=True)
        if self._secrets is not None:
            self._secrets.remove()
        judged = [child for child in (*children.by_name.values(), *children.former) if child.name not in NOT_JUDGED]
        return {process_name(child.name, child.incarnation): child.code for child in judged}

    def restart(self, robot: int, incarnation: int) -> None:
        """Start a new process for a robot whose last one has ended, or that had none.

        Process control calls it. `incarnation` is how often the robot has been started, this time included.
        """
        name = self.robots[robot - 1]
        if (last := self.children.by_name.get(name)) is not None:
            self.children.former.append(last)
        self._reported.discard(name)
        self._spawn_agent(name, incarnation)

    # --- starting ----------------------------------------------------------------------------------------------------

    def _start_router(self) -> None:
        for _ in range(MOST_ROUTERS):
            free = free_port()  # also where a port is given: finds out whether processes can reach each other
            port = self.port or free
            self._endpoint = f"tcp/127.0.0.1:{port}"
            router = self._spawn_router()
            report = router.await_start(ROUTER_S, self.stop)
            if report is not None and report.ready:
                return
            if self.stop():
                raise KeyboardInterrupt
            if report is None or report.failure is not StartFailure.PORT_BUSY:
                why = f": {report.detail}" if report is not None else f":\n{router.log_tail()}"
                raise LaunchFailed(f"{ROUTER} did not start{why}")
            if self.port is not None:
                raise BadInput(f"--port {port}: the port is busy; choose another, or leave the choice to fogwatch")
        raise LaunchFailed("found no free port for the router")

    def _spawn_router(self) -> Child:
        arguments = ["--fleet", str(self._of_run.for_router(self._endpoint))]
        return self.children.spawn(ROUTER, "fogwatch.router", arguments, self._log_file(ROUTER), reports_start=True)

    @property
    def _of_run(self) -> Secrets:
        """The run's secrets, which `start` has drawn."""
        assert self._secrets is not None
        return self._secrets

    def _common_arguments(self, credentials: Path) -> list[str]:
        """Return the arguments that world and agents share. The path of the credentials is no secret."""
        common = ["--credentials", str(credentials), "--scenario", str(self.folder.scenario)]
        return [*common, "--static", str(self.folder.static)]

    def _spawn_agents(self) -> None:
        for name in self.robots:
            if name not in self.absent and not self.stop():
                self._spawn_agent(name, FIRST_INCARNATION)

    def _spawn_agent(self, name: str, incarnation: int) -> None:
        environment = dict(OF_MINDS) if self.alike else {}
        agent = self.children.spawn(
            name, AGENT, self._agent_arguments(name, incarnation), self._log_file(name), environment=environment
        )
        agent.incarnation = incarnation

    def _agent_arguments(self, name: str, incarnation: int) -> list[str]:
        common = self._common_arguments(self._of_run.of_role(robot_role(name)))
        return [*common, "--robot", name, "--incarnation", str(incarnation)]

    def _log_file(self, name: str) -> Path:
        return self.folder.robot_log(name) if name in self.robots else self.folder.log(LOGS[name])

    # --- watching ----------------------------------------------------------------------------------------------------

    def _watch_world(self, link: Link) -> None:
        keys = fleet_keys(self.fleet)
        metrics, events = keys.truth(METRICS), keys.truth(EVENTS)
        measures = Mailbox([metrics], partial(read, Metrics), longest_metrics(len(self.robots)), room=1)
        notices = Mailbox([events], partial(read, Notice), MAX_NOTICE)
        link.subscribe(metrics, measures)
        link.subscribe(events, notices)
        while self.children.by_name[WORLD].poll() is None:
            if self.stop():
                self.interrupted = True
                break
            if (arrived := measures.get(_TICK_S)) is not None:
                self.display.metrics(arrived[1])
            self._show_notices(notices)
            self._check_children()
        # Why a world has failed may still be on its way, and its log may be full.
        self._show_notices(notices, LAST_WORDS_S if self.children.by_name[WORLD].code else 0.0)

    def _show_notices(self, notices: Mailbox[Notice], wait_s: float = 0.0) -> None:
        while (news := notices.get(wait_s)) is not None:
            self.display.notice(news[1])

    def _check_children(self) -> None:
        """Restart a router or a page that has died; report an agent that has, and give up if the run had not begun."""
        if self._page_child is not None:
            self._page_child.check()
        router = self.children.by_name[ROUTER]
        if router.poll() is not None and not self.stop():
            self._routers += 1
            if self._routers > MOST_ROUTERS:
                raise LaunchFailed(f"{ROUTER} keeps dying:\n{router.log_tail()}")
            self.display.say(f"{router.describe_exit()}; starting it again")
            self._spawn_router()
        for name in self.robots:
            child = self.children.by_name.get(name)
            if child is None or child.killed_by_fault or name in self._reported or not child.poll():
                continue
            self._reported.add(name)
            if not self.folder.journal.exists():
                if child.code == BAD_INPUT and (why := child.last_words()):
                    if child.has_traceback:
                        raise PolicyNotMade(why, child.log)
                    raise BadInput(why)
                raise LaunchFailed(f"the run could not begin: {child.describe_end()}")
            self.display.say(child.describe_end())


def free_port() -> int:
    """Find a TCP port of 127.0.0.1 at which no process listens now; one may before it is used."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        probe.listen()
        try:
            socket.create_connection(probe.getsockname(), LOOPBACK_S).close()
        except OSError as error:
            why = f"the processes of a run cannot reach each other at 127.0.0.1 ({error.strerror or error})"
            raise BadInput(f"{why}; switch its interface on: ip link set lo up") from None
        return int(probe.getsockname()[1])


def check_limits(robots: int, spares: int) -> None:
    """Refuse a fleet of processes beyond the machine's memory or the account's limit of open files.

    The router has most files open: a connection for each robot, and those of the world and of all who watch. The
    `spares` are among the `robots`; they are absent at first.
    """
    needed_gb = (robots - spares) * PROCESS_GB
    there_gb = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9
    if needed_gb > there_gb:
        raise BadInput(
            f"{robots - spares} robots as processes need about {needed_gb:.0f} GB of memory, and this machine has "
            f"{there_gb:.0f} GB; use --in-process or fewer robots"
        )
    allow_files(LEAST + 2 * robots, f"a fleet of {robots} robots as processes")


class PageChild:
    """A run's page. Its key is in no log and in no list of processes."""

    def __init__(self, children: Children, arguments: Sequence[str], log: Path, say: Callable[[str], None]) -> None:
        """Start no page yet."""
        self._children, self._arguments, self._log, self._say = children, arguments, log, say
        self._key, self._address = os.urandom(16).hex(), ""
        self._announced, self._restarts, self._over = False, 0, False

    def start(self) -> None:
        """Serve a page, if its libraries are installed."""
        missing = [name for name in ("starlette", "uvicorn", "websockets", "plotly") if find_spec(name) is None]
        if missing:
            self._over = True
            self._say(f"no page: {missing[0]} is not installed (pip install 'fogwatch[monitor]')")
            return
        self._spawn_page([])

    def check(self) -> None:
        """Show the address of a page that is ready; start one that has died again, at its address and with its key."""
        page = self._children.by_name.get(PAGE)
        if page is None or page.start is None or self._over:
            return
        has_ended = page.poll() is not None
        # One that has ended may have been ready: its address is the one to serve again.
        if not self._announced and (report := page.start.report()) is not None and report.address:
            self._announced = True
            if self._address != report.address:
                self._address = report.address
                self._say(f"page: {report.address}?key={self._key}")
        if has_ended:
            self._restart_page(page)

    def _restart_page(self, page: Child) -> None:
        if page.code == INTERRUPTED or self._restarts == MOST_RESTARTS:
            self._over = True
            self._say(page.describe_end())
            return
        self._restarts += 1
        self._say(f"{page.describe_exit()}; starting it again ({self._restarts} of {MOST_RESTARTS} times)")
        port = self._address.rpartition(":")[2].strip("/")
        self._spawn_page(["--page-port", port] if port and self._announced else [])

    def _spawn_page(self, extra: Sequence[str]) -> None:
        self._announced = False
        arguments, key = [*self._arguments, *extra], {KEY: self._key}
        self._children.spawn(PAGE, "monitor", arguments, self._log, reports_start=True, environment=key)
