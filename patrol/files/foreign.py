"""Kinds of files that are mistaken for maps and scenarios: each is named, with what to do instead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_DRAW = "draw its ground as a PNG, white where robots can be, and write the map's YAML file for it (docs/maps.md)"
_SAVE = "take its map out with: fogwatch map extract BAG --out DIR"
_BAG = f"is a bag of ROS; {_SAVE}"
BAG_FOLDER = f"is the folder of a bag of ROS; {_SAVE}"
_DXF = f"is a DXF drawing; {_DRAW}"
BUILDING = "is a building of Open-RMF's traffic editor"
_LANES = "give it as terrain.graph, with the map that it belongs to"

_HEADS = (
    (b"version https://git-lfs", "is a Git LFS pointer to the file, not the file; get it with: git lfs pull"),
    (b"\x89MCAP0", _BAG),
    (b"SQLite format 3", _BAG),
    (b"type octile", f"is a grid of MovingAI; {_DRAW}"),
    (b"AutoCAD Binary DXF", _DXF),
    (b"#ROSBAG", "is a bag of ROS 1; convert it with: rosbags-convert --src FILE --dst FOLDER"),
)
"""First bytes of files, without white space before them."""

_TAGS = (
    (b"<", b"<svg", f"is an SVG drawing; {_DRAW}"),
    (b"<", b"<sdf", f"is a world of Gazebo; map it with a robot, or {_DRAW}"),
    (b"<", b"<?xml", f"is an XML file; {_DRAW}"),
    ((b"0", b"999"), b"SECTION", _DXF),  # 999 begins a comment
)
"""First bytes of files, and what is soon to follow them, the telling ones first."""

HEAD = 512
"""Bytes at a file's beginning that tell its kind."""

_KEYS = (
    ({"levels", "coordinate_system"}, f"{BUILDING}; {_DRAW}"),
    ({"levels", "building_name"}, f"is a navigation graph of Open-RMF; {_LANES}"),
    ({"levels", "lifts"}, f"{BUILDING}; {_DRAW}"),
    ({"type", "features"}, f"is a route graph in GeoJSON; {_LANES}"),
    ({"verts", "room_category"}, f"is a floor plan of HouseExpo; {_DRAW}"),
    ({"rosbag2_bagfile_information"}, _BAG.replace("is a bag", "describes a bag")),
)
"""Keys of mappings in YAML or JSON."""


def kind_of_bytes(head: bytes) -> str:
    """Return what a file is that begins with these bytes, and what to do with it; empty for any other."""
    head = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    known = next((kind for first, kind in _HEADS if head.startswith(first)), "")
    return known or next((kind for first, tag, kind in _TAGS if head.startswith(first) and tag in head), "")


def kind_of_mapping(content: Mapping[Any, Any]) -> str:
    """Return what a mapping of a file is, and what to do with it; empty for any other."""
    return next((kind for keys, kind in _KEYS if keys <= content.keys()), "")
