"""The journal: the records of a run, the file that holds them, and their trace hash."""

from patrol.journal.file import Journal, JournalWriter, pack, read_journal, unpack
from patrol.journal.records import End, Event, Header, Record, RobotFacts, RobotTick, Status, TerrainFacts, TickRecord
from patrol.journal.trace import TraceHash, trace_hash

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
