"""The summary of a run as typed values: what summary.json holds, from the first key to the last.

A summary is computed (`patrol.summary.totals`, `worldsim.output.summary`) or read from summary.json. Its fields are in
the order of the file. A field that an older version did not write, or that a run of this kind does not have, is not
set, and is missing in the document.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict

from patrol.ground.left_out import LeftOut
from patrol.summary.metric import Metric

__all__ = ["Summary"]


class _Part(BaseModel):
    """A mapping in summary.json. It may hold more than is declared, because other versions write other keys."""

    model_config = ConfigDict(strict=True, extra="allow", frozen=True)

    def document(self) -> dict[str, Any]:
        """Return the content as plain mappings, lists, texts and numbers, ready for JSON."""
        return self.model_dump(exclude_unset=True)


class Stalest(_Part):
    """The stalest place at some time."""

    x: float
    y: float
    age_s: float  # since it was last seen, or since the start if never
    at_s: float  # the time at which it had this age
    seen: bool  # it had been seen at least once
    nearest: str | None  # living robot nearest in a straight line; None if none was alive
    nearest_m: float | None


class Stalests(_Part):
    """The stalest places over the run and at its end; None without a tick."""

    worst: Stalest | None = None
    end: Stalest | None = None


class LeftOutFacts(_Part):
    """The free ground that no robot sees; see `patrol.ground.left_out.LeftOut`."""

    area_m2: float
    parts: int
    largest_m2: float
    x: float
    y: float
    why: str
    small_parts: int = 0

    @property
    def text(self) -> str:
        """The same in words."""
        return LeftOut(**self.model_dump()).text


class ClosedOut(_Part):
    """A time in which ground was closed out: the largest area at once, and its middle."""

    since_s: float
    until_s: float | None  # None where it was closed out to the end
    area_m2: float
    x: float
    y: float


class CheckFacts(_Part):
    """The result of one check of the verdict."""

    name: str
    ok: bool
    detail: str = ""
    judged: bool = True
    warnings: list[str] = []


class VerdictFacts(_Part):
    """The verdict on a run; see `worldsim.verdict.judge.Verdict`."""

    valid: bool = False
    outcome: str = "unknown"
    warnings: Annotated[list[str], Metric("warnings, one line each", sweep="count")] = []
    checks: list[CheckFacts]


class LinkFacts(_Part):
    """The frames of one sender to one receiver."""

    sent: int
    delivered: int
    dropped: dict[str, int]
    in_flight: int


class FaultFacts(_Part):
    """The frames on a fault's links while it was active, and its effects on them."""

    kind: str = ""
    frames: int | None = None
    dropped: int | None = None
    delayed: int | None = None
    duplicated: int | None = None


class HeardCounts(_Part):
    """The frames of a link of a direct radio, as the robots at its ends reported them."""

    sent: int
    heard: int


class DirectFacts(_Part):
    """Frames as robots with a direct radio reported them; see `worldsim.output.traffic`."""

    links: dict[str, HeardCounts] = {}
    heard_share: float | None = None
    missed: dict[str, int] = {}
    unsaid: list[str] = []


class IntruderFacts(_Part):
    """One intruder."""

    place_m: list[float] = []  # x and y
    at_s: float = 0.0
    until_s: float | None = None  # when it went; None where it stayed to the end
    first_reported_s: float | None  # when a robot first reported it; None for never
    reported_s: float = 0.0  # how long a robot reported it
    surrounded_s: float  # how long robots stood around it
    most_robots: int  # most robots around it at once


class Deadlines(_Part):
    """Deadlines that were missed by robots, by their names, and by the world, in wall seconds."""

    late_frames: dict[str, int]
    too_late: dict[str, int]
    late_commands: dict[str, int]
    slipped_s: float = 0.0
    held_up_s: float = 0.0
    longest_held_up_s: float = 0.0


class Messages(_Part):
    """The frames of the whole fleet."""

    frames: Annotated[int, Metric("frames that robots sent, each counted once", sweep="once")] = 0
    bytes: Annotated[int, Metric("size of these frames")] = 0
    sent: Annotated[int, Metric("frames sent, counted for each receiver", sweep="once")] = 0
    delivered: Annotated[int, Metric("frames that arrived; with direct radio, frames heard", sweep="once")] = 0
    dropped: Annotated[int | None, Metric("frames that were lost; unknown (null) with direct radio", sweep="once")] = 0
    dropped_by_cause: Annotated[dict[str, int], Metric("the same by the kind of cause")] = {}
    in_flight: Annotated[int | None, Metric("frames that were still under way at the end; null with direct radio")] = 0
    rejected: Annotated[int, Metric("frames that a receiver refused", sweep="once")] = 0
    bytes_per_robot_s: Annotated[float, Metric("bytes that a living robot sends per second", sweep="once")] = 0.0
    forged: Annotated[int, Metric("forged frames, which no other number here counts")] = 0


class BatteryFigures(_Part):
    """The charge of one robot over a run."""

    least_share: float  # least share of the capacity that was in the battery
    end_share: float  # the same at the end
    charges: int = 0
    docked_s: float = 0.0
    # of its living time, neither on its way to a dock, nor waiting, nor charging; None where it took no part
    patrol_share: float | None = 1.0
    empty_s: float | None = None  # when it first was empty; None for never


class RobotFigures(_Part):
    """The metrics of one robot."""

    status: Annotated[str, Metric("alive, paused, dead, lost, absent or left, at the end")] = "absent"
    distance_m: Annotated[
        float, Metric("length of its way", "m", "driven", note="all robots", digits=0, sweep="sum")
    ] = 0.0
    dead_end_share: Annotated[
        float,
        Metric(
            "share of its decisions that were spent getting unstuck",
            "%",
            "dead ends",
            better="lower",
            sweep="mean",
            column="dead_end_percent",
        ),
    ] = 0.0
    planned_share: Annotated[
        float | None,
        Metric("the fleet's `planned_share` for this robot; null also where it never was on patrol", "%", "planned"),
    ] = None
    collisions: Annotated[
        int,
        Metric(
            "ticks in which its move was cancelled because it would have touched something",
            title="collisions",
            note="moves cancelled",
            digits=0,
            better="lower",
            sweep="sum",
        ),
    ] = 0
    longest_stay_s: Annotated[
        float | None,
        Metric(
            "the longest time [in one circle](progress.md#trapped) of four times its radius and stride together; null "
            "where it took no part",
            sweep="max",
        ),
    ] = None
    longest_stay: Annotated[dict[str, Any] | None, Metric("that circle, and since when")] = None
    decisions: Annotated[int, Metric("commands that came in time", title="decisions", digits=0)] = 0
    missed: Annotated[int, Metric("ticks in which no command came in time")] = 0
    refused_commands: Annotated[int, Metric("commands that were invalid, and so not obeyed")] = 0
    decision_ms_p50: Annotated[
        float | None, Metric("median wall time of a decision; null without one", "ms", "p50", better="lower")
    ] = None
    decision_ms_p99: Annotated[
        float | None, Metric("99th percentile of the wall time of a decision", "ms", "p99", better="lower")
    ] = None
    battery: Annotated[
        BatteryFigures | None, Metric("with a battery only: [its charge over the run](energy.md#figures)")
    ] = None
    bytes: Annotated[int, Metric("size of its own frames, each counted once")] = 0
    sent: Annotated[int, Metric("its own frames, counted for each receiver")] = 0
    delivered: Annotated[int, Metric("those of them that arrived")] = 0
    dropped: Annotated[int | None, Metric("those that were lost; null with direct radio")] = 0
    in_flight: Annotated[int | None, Metric("those still under way at the end; null with direct radio")] = 0
    rejected: Annotated[int, Metric("frames of others that it refused")] = 0


class NodeFigures(_Part):
    """The measures on the vertices of the scenario's graph; see `patrol.measures.nodes`."""

    vertices: Annotated[int, Metric("vertices of the graph")] = 0
    visits: Annotated[int, Metric("visits of all of them")] = 0
    least_visits: Annotated[int, Metric("visits of the vertex that has fewest: complete patrol cycles")] = 0
    unvisited: Annotated[list[int], Metric("the vertices that were never visited", sweep="count")] = []
    once: Annotated[list[int], Metric("the vertices that were visited once, and never again", sweep="count")] = []
    idleness_mean_s: Annotated[
        float, Metric("mean idleness over vertices and ticks (AGI)", "s", "mean idleness", better="lower", sweep="once")
    ] = 0.0
    idleness_late_s: Annotated[float, Metric("the same over the second half", better="lower", sweep="once")] = 0.0
    idleness_end_s: Annotated[
        float, Metric("mean idleness over vertices at the end (IGI)", better="lower", sweep="once")
    ] = 0.0
    worst_mean_s: Annotated[
        float, Metric("greatest idleness of a vertex, mean over ticks", better="lower", sweep="once")
    ] = 0.0
    worst_s: Annotated[
        float, Metric("greatest idleness of a vertex (WI)", "s", "worst idleness", better="lower", sweep="once")
    ] = 0.0
    worst_late_s: Annotated[float, Metric("the same over the second half", better="lower", sweep="once")] = 0.0
    worst_end_s: Annotated[
        float, Metric("greatest idleness of a vertex at the end (IWI)", better="lower", sweep="once")
    ] = 0.0
    visits_mean_s: Annotated[
        float | None,
        Metric("mean over vertices of the mean idleness that visits end, as patrolling_sim prints it", sweep="once"),
    ] = None
    visits_worst_s: Annotated[float | None, Metric("the greatest of these means", sweep="once")] = None
    visits_median_s: Annotated[float | None, Metric("their median")] = None
    visits_deviation_s: Annotated[float | None, Metric("their standard deviation")] = None
    return_s: Annotated[
        list[float], Metric("return times of all vertices: least, 10, 25, 50, 75 and 90 %, greatest")
    ] = []
    return_mean_s: Annotated[float | None, Metric("their mean, as patrolling_sim's global idleness")] = None
    return_deviation_s: Annotated[float | None, Metric("their standard deviation")] = None
    interference: Annotated[
        int,
        Metric(
            "times that a robot came within 2 m of one of a lower number, each robot at most once in 10 s", sweep="once"
        ),
    ] = 0
    interference_per_min: Annotated[float, Metric("the same per minute")] = 0.0
    entropy_bits: Annotated[
        float | None, Metric("how unpredictable the next vertex is, bits per move", better="higher", sweep="once")
    ] = None
    original_bytes: Annotated[
        int | None,
        Metric(
            "[bytes that the policy's original would have sent](#what-the-original-would-have-sent) besides positions; "
            "null for a policy that is not of the literature",
            sweep="once",
        ),
    ] = None


class ClosureFigures(_Part):
    """The closings of a closure."""

    closings: int = 0
    closed_s: float = 0.0


class ZoneFigures(_Part):
    """The metrics of a weighted zone over the ticks in which it was in force, or of the ground in none of them."""

    weight: Annotated[float, Metric("how many times an age counted when the zone was last in force")] = 1.0
    area_m2: Annotated[float, Metric("its patrolled ground")] = 0.0
    fog_mean_s: Annotated[float, Metric("mean age of a point, over points and ticks", better="lower")] = 0.0
    mfow_mean_s: Annotated[float, Metric("mean age of its stalest point, over these ticks", better="lower")] = 0.0
    mfow_late_mean_s: Annotated[float, Metric("the same over their second half", better="lower")] = 0.0
    mfow_max_s: Annotated[float, Metric("greatest age", better="lower")] = 0.0
    wanted_s: Annotated[float | None, Metric("the wanted age; null without one")] = None
    kept_share: Annotated[
        float | None, Metric("share of these ticks in which no point was older than that", better="higher")
    ] = None


class Summary(_Part):
    """The summary of a run. Times are simulated seconds unless the meaning says wall."""

    name: Annotated[str, Metric("name of the scenario")] = ""
    policy: Annotated[str, Metric("`patrol.policy`; `potential-field` is the paper's, `committed` the tour")] = ""
    scenario_hash: Annotated[str, Metric("hash of the scenario; equal hashes are equal scenarios")] = ""
    trace_hash: Annotated[
        str | None, Metric("hash of all that happened; equal hashes are equal runs; null for a run that was cut off")
    ] = None
    ended: Annotated[
        str | None, Metric("why the run ended: `completed`, or what stopped it; null for a run that was cut off")
    ] = None
    ticks: Annotated[int, Metric("number of ticks")] = 0
    simulated_s: Annotated[float, Metric("simulated time")] = 0.0
    wall_s: Annotated[float | None, Metric("wall time")] = None
    realtime_factor: Annotated[float | None, Metric("simulated time over wall time", better="higher")] = None
    mfow_mean_s: Annotated[
        float | None,
        Metric("mean MFoW over all ticks: the score of a patrol", "s", "mean MFoW", better="lower", sweep="once"),
    ] = None
    mfow_late_mean_s: Annotated[
        float | None,
        Metric(
            "the same over the second half, when ground that is still unseen counts less", better="lower", sweep="once"
        ),
    ] = None
    mfow_max_s: Annotated[float | None, Metric("largest MFoW", "s", "largest MFoW", better="lower", sweep="once")] = (
        None
    )
    mfow_end_s: Annotated[float | None, Metric("MFoW at the end", better="lower", sweep="once")] = None
    fog_mean_s: Annotated[
        float | None,
        Metric("mean age of a point, over points and ticks", "s", "mean fog", better="lower", sweep="once"),
    ] = None
    fog_end_s: Annotated[float | None, Metric("mean age of a point at the end", better="lower")] = None
    seen_share: Annotated[
        float,
        Metric(
            "share of the patrolled ground that was seen at least once",
            "%",
            "seen",
            digits=2,
            better="higher",
            sweep="once",
        ),
    ] = 0.0
    planned_share: Annotated[
        float | None,
        Metric(
            "share of the time on patrol in which robots went by the [plan](algorithm.md#drawn-stations) of "
            "`stochastic` or `committed`; in the rest each chose freely, with the state `free`. Null for other "
            "policies, unless a robot reported that state",
            "%",
            "planned",
            "of the time on patrol; else robots chose freely",
            sweep="once",
            column="planned_percent",
        ),
    ] = None
    bound_s: Annotated[
        float,
        Metric(
            "[what MFoW can be compared with](progress.md#what-can-the-mfow-be-compared-with): a lower bound; 0 where "
            "it says nothing",
            sweep="once",
        ),
    ] = 0.0
    best_tour_s: Annotated[
        float | None,
        Metric(
            "MFoW of all robots that are not spare on the best tour found, as if none were ever down; null where there "
            "is no tour",
            "s",
            "best tour found",
            sweep="once",
        ),
    ] = None
    best_tour_m: Annotated[float | None, Metric("length of that tour", "m", sweep="once")] = None
    mfow_weighted_mean_s: Annotated[
        float | None,
        Metric(
            "with weighted [zones](zones.md) only: mean over all ticks of the greatest age times weight", better="lower"
        ),
    ] = None
    mfow_weighted_late_mean_s: Annotated[float | None, Metric("the same over the second half", better="lower")] = None
    mfow_weighted_max_s: Annotated[float | None, Metric("largest of these", better="lower")] = None
    best_weighted_s: Annotated[
        float | None,
        Metric(
            "[the same of all robots on the best tours](zones.md#figures), by the zones in force in each tick; null "
            "without tours, or with more than four weights"
        ),
    ] = None
    zones: Annotated[
        dict[str, ZoneFigures], Metric("with weighted zones only: [metrics of each](#zones) that was in force, by name")
    ] = {}
    mfow_reachable_mean_s: Annotated[
        float | None,
        Metric(
            "reachable MFoW, where [ground was closed out](closures.md#figures) by a closure or a wreck: mean over all "
            "ticks of the greatest age of a point, counting the time in which it was open to view",
            better="lower",
            sweep="once",
        ),
    ] = None
    mfow_reachable_late_mean_s: Annotated[
        float | None, Metric("the same over the second half", better="lower", sweep="once")
    ] = None
    mfow_reachable_max_s: Annotated[float | None, Metric("largest of these", better="lower", sweep="once")] = None
    closed_out_share: Annotated[
        float | None, Metric("share of ground times time that no robot could get to see because of what was in the way")
    ] = None
    closed_out: Annotated[
        list[ClosedOut],
        Metric("every time for which ground was closed out: since when, until when, and the largest area"),
    ] = []
    closures: Annotated[
        dict[str, ClosureFigures], Metric("with closures only: how often and how long each was closed, by name")
    ] = {}
    nodes: Annotated[NodeFigures | None, Metric("with `terrain.graph` only: [measures on its vertices](#nodes)")] = None
    trapped: Annotated[
        list[dict[str, Any]], Metric("every time for which a robot was trapped: which, where and when")
    ] = []
    stalest: Annotated[
        Stalests,
        Metric(
            "the stalest place over the run (`worst`) and at its end (`end`), with its age and the robot nearest to it"
        ),
    ] = Stalests()
    patrolled_area_m2: Annotated[float, Metric("the ground that counts", sweep="once")] = 0.0
    patrolled_vertices: Annotated[
        int | None, Metric("with `terrain.patrolled: vertices` only: the vertices, in place of ground, that count")
    ] = None
    left_out: Annotated[
        LeftOutFacts | None,
        Metric(
            "free ground that no robot sees from where it gets: its area, its parts, how many of them are smaller than "
            "1 m², the place of the largest and why it is left out; null where there is none. Parts below 1 m² count "
            "where together they have 1 m² or 1 % of the free ground"
        ),
    ] = None
    point_m: Annotated[float, Metric("side of a point")] = 0.0
    sensor_range_m: Annotated[float, Metric("range of the sensor")] = 0.0
    messages: Annotated[Messages, Metric("[frames](#frames) of the whole fleet")] = Messages()
    robots: Annotated[dict[str, RobotFigures], Metric("[metrics of each robot](#robots), by name")] = {}
    links: Annotated[
        dict[str, dict[str, LinkFacts]],
        Metric(
            "frames by sender and receiver, for fleets of at most 64 robots; forged frames have the sender `forger`"
        ),
    ] = {}
    faults: Annotated[
        dict[str, FaultFacts], Metric("by fault: frames on its links while it was active, and what it did to them")
    ] = {}
    intruders: Annotated[
        list[IntruderFacts],
        Metric("with intruders only: when each was first reported, and for how long it was reported and surrounded"),
    ] = []
    refused: Annotated[
        dict[str, int], Metric("as processes only: messages that the world dropped unread, by reason")
    ] = {}
    deadlines: Annotated[
        Deadlines | None,
        Metric(
            "as processes at a pace only: frames and commands that came too late, by robot; by how much the world fell "
            "behind (`slipped_s`) and deadlines moved because the machine woke it late (`held_up_s`), wall seconds"
        ),
    ] = None
    verdict: Annotated[
        VerdictFacts | None,
        Metric("`outcome` (valid, invalid, unknown), `warnings`, and every check with what it found"),
    ] = None
    direct: Annotated[DirectFacts, Metric("with `radio.via: direct` only: what robots say they sent and heard")] = (
        DirectFacts()
    )
    exit_codes: Annotated[
        dict[str, int | None],
        Metric("as processes only: how each process ended, as the launcher saw it; no journal holds this"),
    ] = {}


def ground_text(summary: Summary) -> str:
    """Return what a fleet is to see, for example "18 m²" or "12 vertices"."""
    vertices = summary.patrolled_vertices
    return f"{summary.patrolled_area_m2:.0f} m²" if vertices is None else f"{vertices} vertices"


def unsettled(summary: Summary, yardstick_s: float) -> str:
    """Return why a mean MFoW says nothing yet beside a yardstick; empty once all is seen and the run long enough."""
    if summary.seen_share < 1.0:
        return "not all was seen"
    return "run too short" if summary.simulated_s < 4.0 * yardstick_s else ""
