"""``fogwatch doctor``: listening on a robot's Zenoh router, and findings on whether a patrol could start."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from patrol.errors import Malformed, printable
from ros2.robot.localisation import AHEAD_S, LONGEST_S, Source
from ros2.robot.options import DriveSettings
from ros2.wire import messages as ros
from ros2.wire.codec import CODINGS, decode
from ros2.wire.definitions import ACTION, NO_HASH, type_hash
from ros2.wire.formats import Bridge, Format, Origin, RmwZenoh
from ros2.wire.link import RouterSays, ZenohRos2Link
from ros2.wire.mailbox import Ear, Overheard
from ros2.wire.names import ADMIN_SPACE, Entity, EntityKind, entity_of, full_name

ARROW = " -> "

_KNOWN = {coding.type_name: kind for kind, coding in CODINGS.items() if coding.longest}


@dataclass(frozen=True, slots=True)
class Topic:
    """The nodes and messages of a topic."""

    name: str  # in full
    type_name: str  # empty where no node says
    type_hash: str  # empty where no node says
    rate: float  # messages a second
    messages: int  # number heard
    size: int  # bytes of the longest message
    frames: tuple[str, ...]  # that its messages name
    publishers: int  # number, as far as tokens or attachments tell
    subscribers: int  # number, as far as tokens tell
    wrong: str  # why its messages cannot be used; empty where they can


def topics_of(seen: Survey, form: Format, entities: Sequence[Entity]) -> Iterator[Topic]:
    """Yield the topics that matter, as far as there are any."""
    for name, (usual_kind, _) in topics_wanted(seen.namespace, seen.wanted).items():
        if isinstance(form, Bridge):
            keys = [key for key in seen.heard if key == form.heard(name)]
        else:
            keys = [key for key in seen.heard if key.startswith(f"{form.domain}/{name.strip('/')}/") and "::" in key]
        about = [entity for entity in entities if entity.topic == name]
        publishers = sum(entity.kind is EntityKind.PUBLISHER for entity in about)
        subscribers = sum(entity.kind is EntityKind.SUBSCRIPTION for entity in about)
        for key in keys or [""]:
            origin = form.origin(key) if key else Origin()
            # A publisher's type counts before those of others.
            chosen = min(about, key=lambda entity: entity.kind is not EntityKind.PUBLISHER, default=None)
            type_name = origin.type_name or (chosen.type_name if chosen else "")
            hashed = origin.type_hash or (chosen.type_hash if chosen else "")
            overheard = seen.heard.get(key) or Overheard(0.0)
            frames, wrong = _look_at_messages(_KNOWN.get(type_name, usual_kind), overheard)
            if type_name in _KNOWN and hashed not in {"", NO_HASH, type_hash(type_name)}:
                wrong = f"its hash is {hashed[:80]}, and so its fields are other than ours"
            if overheard.messages or about:
                yield Topic(
                    name,
                    printable(type_name[:255]),
                    printable(hashed[:80]),
                    overheard.rate,
                    overheard.messages,
                    overheard.size,
                    frames,
                    max(publishers, len(overheard.senders)),
                    subscribers,
                    printable(wrong),
                )


def _look_at_messages(kind: Any, heard: Overheard) -> tuple[tuple[str, ...], str]:
    """Return the frames in messages of a class, and why they cannot be used, if so."""
    frames: dict[str, None] = {}
    try:
        for payload in [*(payload for _, payload in list(heard.recent)), heard.newest]:
            if payload is not None and kind is not None:
                frames |= dict.fromkeys(_message_frames(decode(kind, payload)))
    except Malformed as bad:
        return tuple(frames), str(bad)
    return tuple(frames), ""


def _message_frames(message: Any) -> Iterator[str]:
    if isinstance(message, ros.TFMessage):
        for transform in message.transforms:
            yield f"{transform.frame}{ARROW}{transform.child_frame}"
    elif isinstance(message, ros.Odometry):
        yield f"{message.frame}{ARROW}{message.child_frame}"
    elif getattr(message, "frame", ""):
        yield message.frame


_TOKENS_S = 3.0


@dataclass(slots=True)
class Survey:
    """All that was seen and overheard of a robot."""

    domain: int  # ROS_DOMAIN_ID
    namespace: str
    wanted: DriveSettings  # of the robot's agent, which say what a patrol needs of the robot
    tokens: list[str] = field(default_factory=list)  # of both formats and every domain
    heard: dict[str, Overheard] = field(default_factory=dict)  # by key
    router: RouterSays | None = None  # what the router says of itself; None if it does not answer

    def name(self, usual: str) -> str:
        """Return the full name of a topic by its usual one."""
        return full_name(self.namespace, self.wanted.topic(usual))

    def shared_names(self, usual: str) -> list[str]:
        """Return the full names of a topic that may be outside of the robot's namespace too."""
        return [full_name(space, self.wanted.topic(usual)) for space in (self.namespace, "")]

    def odometry(self, form: Format) -> Iterator[Overheard]:
        """Yield the messages heard under the keys of the robot's odometry."""
        where = form.heard(self.name("odom")).removesuffix("/*/*")
        yield from (topic for key, topic in self.heard.items() if key == where or key.startswith(f"{where}/"))


def survey(link: ZenohRos2Link, domain: int, namespace: str, wanted: DriveSettings, seconds: float) -> Survey:
    """Look at a robot's router and listen there for some seconds; `domain` is the ROS_DOMAIN_ID."""
    ear = Ear()
    for form in (RmwZenoh(domain), Bridge()):
        for name, (_, latched) in topics_wanted(namespace, wanted).items():
            link.overhear(form.heard(name), ear, latched)
    threading.Event().wait(seconds)
    # A router with access rules answers for our domain, and not for all of them.
    graphs = (RmwZenoh(domain).graph, f"{ADMIN_SPACE}/**", Bridge.graph)
    tokens = dict.fromkeys(token for graph in graphs for token in link.tokens(graph, _TOKENS_S))
    return Survey(domain, namespace, wanted, list(tokens), ear.heard, link.router(_TOKENS_S))


WantedTopic = tuple[type | None, bool]
"""The class of a topic's messages, where its key does not say (None where there are several), and if it is latched."""

_OWN: dict[str, WantedTopic] = {
    "odom": (ros.Odometry, False),
    "amcl_pose": (ros.PoseWithCovarianceStamped, True),
    "cmd_vel": (None, False),
}
_SHARED: dict[str, WantedTopic] = {
    "tf": (ros.TFMessage, False),
    "tf_static": (ros.TFMessage, True),
    "map": (ros.OccupancyGrid, True),
}
"""Topics in a robot's namespace, and those that may be outside of it too, by their usual names."""


def topics_wanted(namespace: str, wanted: DriveSettings) -> dict[str, WantedTopic]:
    """Return all topics that matter by their full names."""
    topics = {full_name(namespace, wanted.topic(usual)): topic for usual, topic in _OWN.items()}
    for usual, topic in _SHARED.items():
        topics |= {full_name(space, wanted.topic(usual)): topic for space in (namespace, "")}
    if wanted.sim_time:
        topics[full_name(namespace, wanted.topic("clock"))] = (ros.Clock, False)
    return topics


SLOW_HZ = 5.0
"""Fewer poses a second than this are few for a robot that drives."""
CLOCKS_S = 0.1
"""Clocks that differ by more than this make poses look older or younger than they are."""
_SIMULATED_S = 86400.0
_COMMANDS = [CODINGS[kind].type_name for kind in (ros.TwistStamped, ros.Twist, ros.AckermannDriveStamped)]


class Level(StrEnum):
    """The severity of a finding, the worst first. A patrol can start unless something is missing."""

    MISSING = "missing"
    WARNING = "warning"
    OK = "ok"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was found."""

    level: Level
    says: str
    remedy: str = ""  # empty where nothing has to be done


@dataclass(frozen=True, slots=True)
class Examined:
    """The result of a survey."""

    speaks: str  # a format; empty where nothing was seen
    clock_s: float | None  # how far our clock is ahead of the robot's, messages' travel time included; None if unknown
    topics: tuple[Topic, ...]  # only those that matter
    findings: tuple[Finding, ...]  # the worst first

    @property
    def fit(self) -> bool:
        """True if a patrol could start."""
        return all(finding.level is not Level.MISSING for finding in self.findings)


def examine(seen: Survey) -> Examined:
    """Return the findings of a survey."""
    bridge = Bridge()
    ours = [entity for token in seen.tokens if (entity := entity_of(token)) is not None]
    bridged = [entity for token in seen.tokens if (entity := bridge.entity(token)) is not None]
    here = [entity for entity in ours if entity.domain == seen.domain and not entity.node.name.startswith("fogwatch")]
    spoken = any(key.split("/")[0] == str(seen.domain) and "::dds_::" in key for key in seen.heard)
    plain = any("::dds_::" not in key for key in seen.heard)
    form: Format = RmwZenoh(seen.domain) if here or spoken or not (bridged or plain) else bridge
    entities = bridged if isinstance(form, Bridge) else here
    topics = tuple(topics_of(seen, form, entities))
    findings = [*_of_format(seen, form, entities, ours)]
    clock_s = _clock_lead_s(seen, form)
    if findings[-1].level is not Level.MISSING:
        findings += [
            *_of_topics(topics),
            *_of_odometry(seen, topics, entities),
            *_of_stamps(seen, form),
            *_of_pose(seen, topics),
            *_of_commands(seen, topics, entities),
            *_of_map(seen, topics),
            *_of_clock(seen, topics, clock_s),
        ]
    findings += _of_router(seen)
    return Examined(
        "" if not (entities or seen.heard) else form.name,
        clock_s,
        topics,
        tuple(sorted(findings, key=lambda finding: [*Level].index(finding.level))),
    )


def _of_format(seen: Survey, form: Format, here: Sequence[Entity], ours: Sequence[Entity]) -> Iterator[Finding]:
    if not here and not seen.heard:
        domains = sorted({entity.domain for entity in ours} - {seen.domain})
        remedy = "start rmw_zenohd there and the nodes with RMW_IMPLEMENTATION=rmw_zenoh_cpp, or zenoh-bridge-ros2dds"
        if domains:
            remedy = f"there is a robot in domain {domains[0]}: give --domain {domains[0]}"
        yield Finding(Level.MISSING, f"nothing of ROS 2 is on this router in domain {seen.domain}", remedy)
        return
    inside = full_name(seen.namespace, "").rstrip("/")
    driving = (seen.wanted.topic("odom"), seen.wanted.topic("cmd_vel"))
    there = {entity.topic.rpartition("/")[0].strip("/") for entity in here if entity.topic.endswith(driving)}
    spaces = sorted(printable(name[:255]) for name in there)
    if spaces and inside.strip("/") not in spaces and not any(seen.odometry(form)):
        shown = ", ".join(name or "''" for name in spaces[:8])
        yield Finding(Level.MISSING, f"no robot is in the namespace {inside or '/'}", f"give --namespace {shown}")
        return
    humble = any(entity.type_hash == NO_HASH for entity in here) or any(key.endswith(NO_HASH) for key in seen.heard)
    option = "bridge" if isinstance(form, Bridge) else "rmw_zenoh-humble" if humble else "rmw_zenoh"
    yield Finding(Level.OK, f"the robot speaks {option}", "")


def _of_router(seen: Survey) -> Iterator[Finding]:
    if seen.router is None:
        yield Finding(Level.OK, "the router does not answer about itself: no access, or it has no admin space")
    elif seen.router.others:
        yield Finding(Level.OK, f"the router has Zenoh {seen.router.version}; connected: {seen.router.others} more")
    else:
        problem = f"the router has Zenoh {seen.router.version}, and no other process is connected to it"
        yield Finding(Level.WARNING, problem, "start the robot's nodes with the address of this router")


def _elsewhere_remedy(entities: Iterable[Entity], usual: str) -> str:
    """Return the remedy where a topic has another name, or no node has it."""
    names = sorted({printable(entity.topic[:255]) for entity in entities})
    if not names:
        return "start the robot's base driver"
    suffix = f" (there is {', '.join(names[1:4])}, too)" if names[1:] else ""
    return f"give --topic {usual}={names[0]}{suffix}"


def _of_topics(topics: Iterable[Topic]) -> Iterator[Finding]:
    for topic in topics:
        if topic.wrong:
            remedy = "bring both to releases of ROS 2 that agree, or use another topic"
            yield Finding(Level.WARNING, f"{topic.name}: messages cannot be used: {topic.wrong}", remedy)


def _usable_topics(topics: Iterable[Topic], names: Iterable[str]) -> list[Topic]:
    return [topic for topic in topics if topic.name in set(names) and topic.messages and not topic.wrong]


def _of_odometry(seen: Survey, topics: Sequence[Topic], entities: Sequence[Entity]) -> Iterator[Finding]:
    name = seen.name("odom")
    odometry = _usable_topics(topics, [name])
    if not odometry:
        kind = CODINGS[ros.Odometry].type_name
        alternatives = [entity for entity in entities if entity.type_name == kind and entity.topic != name]
        yield Finding(Level.MISSING, f"no odometry comes on {name}", _elsewhere_remedy(alternatives, "odom"))
    for topic in odometry:
        if topic.publishers > 1:
            remedy = "only one may publish it; give each robot a namespace of its own"
            yield Finding(Level.MISSING, f"{name}: {topic.publishers} publish it", remedy)
        if topic.rate < SLOW_HZ:
            few = f"fewer than {SLOW_HZ:g} are few for a robot that drives"
            problem = f"{name}: {topic.rate:.1f} messages a second; {few}"
            yield Finding(Level.WARNING, problem, "raise its rate, or drive slowly")
        else:
            yield Finding(Level.OK, f"{name}: {topic.rate:.1f} messages a second, {', '.join(topic.frames)}")


def _of_stamps(seen: Survey, form: Format) -> Iterator[Finding]:
    """Find whether an agent would take the robot's odometry for new (`ros2.robot.localisation`)."""
    age_s = _age_of_odometry(seen, form)
    if age_s is None or seen.wanted.sim_time or -AHEAD_S <= age_s <= LONGEST_S:
        return
    if abs(age_s) > _SIMULATED_S:
        remedy = "where the robot runs on simulated time, give --use-sim-time"
        yield Finding(Level.MISSING, "the stamps of odometry are of another day", remedy)
        return
    way = "behind" if age_s > 0.0 else "ahead of"
    problem = f"the stamps of odometry are {abs(age_s):.2f} s {way} our clock; an agent does not drive by these"
    remedy = "run chrony or another NTP client on both machines; give the agent --delay S if only the stamps are wrong"
    yield Finding(Level.MISSING, problem, remedy)


def _of_pose(seen: Survey, topics: Sequence[Topic]) -> Iterator[Finding]:
    """Find whether the robot's place on the map is known, by the source that the agent is to use."""
    localisation = seen.wanted.localisation
    on_map = localisation.map_frame.lstrip("/")
    tf = _usable_topics(topics, seen.shared_names("tf") + seen.shared_names("tf_static"))
    links = [frame.partition(ARROW) for topic in tf for frame in topic.frames]
    corrected = {child.lstrip("/") for parent, _, child in links if parent.lstrip("/") == on_map}
    odometry = _usable_topics(topics, [seen.name("odom")])
    frames = {frame.partition(ARROW)[0].lstrip("/") for topic in odometry for frame in topic.frames}
    posed = {frame.lstrip("/") for topic in _usable_topics(topics, [seen.name("amcl_pose")]) for frame in topic.frames}
    known = {Source.TF: bool(corrected & frames), Source.POSE: on_map in posed}
    if localisation.source is Source.ODOMETRY:
        yield Finding(Level.OK, "nothing corrects the odometry, as asked; give the agent --start X,Y,HEADING")
    elif known[localisation.source]:
        yield Finding(Level.OK, "the robot knows its place on the map")
    elif any(known.values()):
        alternative = Source.TF if known[Source.TF] else Source.POSE
        problem = f"the robot knows its place on the map, but not by --localisation {localisation.source.value}"
        yield Finding(Level.MISSING, problem, f"give --localisation {alternative.value}")
    else:
        missing = " or ".join(f"{localisation.map_frame}{ARROW}{printable(frame)}" for frame in sorted(frames))
        missing = missing or "transform from the map"
        pose = f"poses in the frame {printable(', '.join(sorted(posed)))} alone" if posed else "no pose"
        problem = f"nothing says where the robot is on the map: no {missing} on tf, and {pose}"
        remedy = (
            "start its localisation (amcl, slam_toolbox); if it waits for a pose, give the agent a --start; if"
            " there is none, give --localisation odometry and the agent a --start"
        )
        if posed:
            frame = localisation.map_frame
            remedy = f"have it give them in {frame}, or give --map-frame with the frame that is the map's"
        yield Finding(Level.MISSING, problem, remedy)


def _of_commands(seen: Survey, topics: Sequence[Topic], entities: Sequence[Entity]) -> Iterator[Finding]:
    name = seen.name("cmd_vel")
    action = f"{seen.name('navigate_to_pose')}/_action/send_goal"
    obeys = [entity for entity in entities if entity.topic == name and entity.kind is EntityKind.SUBSCRIPTION]
    types = sorted({entity.type_name for entity in obeys})
    nav2 = any(entity.topic == action and entity.kind is EntityKind.SERVER for entity in entities)
    if nav2:
        yield Finding(Level.OK, f"Nav2 takes goals ({ACTION})")
    usable = [printable(kind) for kind in types if kind in _COMMANDS]
    if usable:
        yield Finding(Level.OK, f"{name}: the robot obeys {', '.join(usable)}")
    elif types:
        remedy = f"give it one of {', '.join(_COMMANDS)}"
        wants = printable(types[0][:255])
        yield Finding(Level.MISSING, f"{name}: the robot wants {wants}, which we do not send", remedy)
    elif not entities:
        remedy = f"allow {ADMIN_SPACE}/** to us on the router, to see who obeys"
        yield Finding(Level.WARNING, f"nobody says whether the robot obeys commands on {name}", remedy)
    elif not nav2:
        wanting = [
            entity for entity in entities if entity.type_name in _COMMANDS and entity.kind is EntityKind.SUBSCRIPTION
        ]
        yield Finding(Level.MISSING, f"nobody obeys commands on {name}", _elsewhere_remedy(wanting, "cmd_vel"))
    rivals = sum(topic.messages for topic in topics if topic.name == name)
    if rivals:
        remedy = "stop the other program (a joystick, Nav2, another agent), or the robot gets both"
        yield Finding(Level.WARNING, f"{name}: somebody else sends commands, {rivals} while we listened", remedy)


def _of_map(seen: Survey, topics: Sequence[Topic]) -> Iterator[Finding]:
    maps = _usable_topics(topics, seen.shared_names("map"))
    if maps:
        yield Finding(Level.OK, f"{maps[0].name}: a latched map of {maps[0].size} bytes")
    else:
        yield Finding(Level.WARNING, "there is no latched map", "give the agent a map's file with --map")


def _clock_lead_s(seen: Survey, form: Format) -> float | None:
    """Return by how much our clock is ahead, s: by the attachments or, without any, by the stamps of odometry."""
    ages = [overheard.age_ns for overheard in seen.heard.values() if overheard.age_ns is not None]
    return min(ages, key=abs) / 1e9 if ages else _age_of_odometry(seen, form)


def _age_of_odometry(seen: Survey, form: Format) -> float | None:
    """Return the least age by its stamp at which recent odometry arrived, s; None where there is none to be used."""
    for overheard in seen.odometry(form):
        recent = list(overheard.recent)  # at once: messages go on coming
        with suppress(Malformed):
            if recent:
                return min(at_ns - decode(ros.Odometry, payload).stamp_ns for at_ns, payload in recent) / 1e9
    return None


def _of_clock(seen: Survey, topics: Sequence[Topic], clock_s: float | None) -> Iterator[Finding]:
    if seen.wanted.sim_time:
        name = seen.name("clock")
        if _usable_topics(topics, [name]):
            yield Finding(Level.OK, f"{name}: the robot's time comes")
        else:
            yield Finding(
                Level.MISSING, f"no time comes on {name}", "start the simulation, or leave out --use-sim-time"
            )
    elif clock_s is None or abs(clock_s) > _SIMULATED_S:
        return
    elif abs(clock_s) > CLOCKS_S:
        way = "behind" if clock_s > 0.0 else "ahead of"
        problem = f"the robot's clock is {abs(clock_s):.2f} s {way} ours, or its messages take so long"
        yield Finding(Level.WARNING, problem, "run chrony or another NTP client on both machines")
    else:
        yield Finding(Level.OK, f"the robot's clock agrees with ours ({clock_s * 1e3:.0f} ms)")
