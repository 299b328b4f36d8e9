"""The groups of measures, in the order in which they are taken. Light, so that the command's help is quick."""

KERNELS = "kernels"
DECISIONS = "decisions"
FLEETS = "fleets"
START_UP = "start-up"
MEMORY = "memory"
HORIZON = "horizon"
SCALE = "scale"
ALL = "all"

GROUPS = {
    KERNELS: "the wave and the dilatation beside other libraries, a look, a record of the journal",
    DECISIONS: "a full decision at 10 cm, one robot among five",
    FLEETS: "fleets in one process on a square kilometre, and as processes",
    START_UP: "from the start of a robot's process to its first decision",
    MEMORY: "what the processes of a fleet hold",
    HORIZON: "what changes where robots hear only those near them",
    SCALE: "what a router carries, and from that what fleets of up to 100,000 robots would need",
}
"""What each group measures."""
