"""The journal: the records of a run, the file that holds them, and their trace hash."""

from patrol.journal.file import (
    End,
    Event,
    Header,
    Journal,
    JournalWriter,
    Record,
    RobotFacts,
    RobotTick,
    Status,
    TerrainFacts,
    TickRecord,
    TraceHash,
    pack,
    read_journal,
    trace_hash,
    unpack,
)

__all__ = [
    "End",
    "Event",
    "Header",
    "Journal",
    "JournalWriter",
    "Record",
    "RobotFacts",
    "RobotTick",
    "Status",
    "TerrainFacts",
    "TickRecord",
    "TraceHash",
    "pack",
    "read_journal",
    "trace_hash",
    "unpack",
]
