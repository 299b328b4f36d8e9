"""Reads recordings back with mcap's own reader, also those that were cut off."""

import struct
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.records import Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory

Topics = dict[str, list[tuple[float, Any]]]
"""Messages by topic, each with its time in s."""


@dataclass
class Recording:
    """The contents of a recording."""

    facts: dict[str, str] = field(default_factory=dict)
    topics: Topics = field(default_factory=lambda: defaultdict(list))
    is_whole: bool = False  # False for a file that ends early


def read_recording(path: Path) -> Recording:
    """Read a recording as far as it goes; checksums are tested."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    factory, recording = DecoderFactory(), Recording()
    with path.open("rb") as file:
        try:
            for record in StreamReader(file, validate_crcs=True).records:
                match record:
                    case Metadata():
                        recording.facts = record.metadata
                    case Schema():
                        schemas[record.id] = record
                    case Channel():
                        channels[record.id] = record
                    case Message():
                        assert record.log_time == record.publish_time
                        channel = channels[record.channel_id]
                        decode = factory.decoder_for(channel.message_encoding, schemas[channel.schema_id])
                        assert decode is not None
                        recording.topics[channel.topic].append((record.log_time / 1e9, decode(record.data)))
            recording.is_whole = True
        except (McapError, struct.error):  # the latter within the head of a record
            pass
    return recording


def decoded(path: Path) -> Topics:
    """Messages of a whole recording."""
    recording = read_recording(path)
    assert recording.is_whole
    return recording.topics
