"""Reading `.graph` files, in the format of patrolling_sim.

Numbers separated by white space: vertices, width and height of the image in pixels, resolution in m per pixel, x and y
offset in m; then for each vertex its number, x and y in pixels (y upwards), its number of neighbours, and for each of
them its number, the direction (N, NE, ...) and the length of the way there in pixels. All numbers here are in metres.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from patrol.errors import BadInput
from patrol.files.untrusted import GRAPH
from patrol.files.yaml_text import read_text
from patrol.printable import printable

DIRECTIONS = ("N", "NE", "E", "SE", "S", "SW", "W", "NW")

MOST_VERTICES = 2000
"""Vertices of the largest graph: policies keep a length for each pair."""

LARGEST = 1e6
"""The greatest coordinate, m."""


class _Words:
    """The words of a file, one after the other, each with its line for errors."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._words = self._split(read_text(path, GRAPH))
        self._line = 1

    @staticmethod
    def _split(text: str) -> Iterator[tuple[int, str]]:
        for number, line in enumerate(text.splitlines(), 1):
            for word in line.split():
                yield number, word

    def wrong(self, problem: str) -> BadInput:
        """Make the error about the word that was read last."""
        return BadInput(f"{self._path}: line {self._line}: {problem}")

    def text(self, what: str) -> str:
        """Return the next word."""
        found = next(self._words, None)
        if found is None:
            raise BadInput(f"{self._path}: ends where {what} should be; expected a .graph file of patrolling_sim")
        self._line, word = found
        return word

    def number(self, what: str) -> float:
        """Return the next word as a finite number."""
        word = self.text(what)
        try:
            value = float(word)
        except ValueError:
            value = math.nan
        if not abs(value) <= LARGEST:
            raise self.wrong(f"{printable(word)[:40]}: expected {what}, a number")
        return value

    def whole(self, what: str, least: int, most: int) -> int:
        """Return the next word as a whole number within bounds."""
        value = self.number(what)
        if not value.is_integer() or not least <= value <= most:
            raise self.wrong(f"{value:g}: expected {what}, a whole number from {least} to {most}")
        return int(value)

    def end(self) -> None:
        """Refuse more words."""
        if (more := next(self._words, None)) is not None:
            raise BadInput(f"{self._path}: line {more[0]}: {printable(more[1])[:40]}: more than the vertices above")


def read_graph(path: Path, map_image: tuple[int, int] | None = None) -> dict[str, Any]:
    """Read a `.graph` file.

    Returns ``vertices``, x and y of each in m; ``edges``, each once in the file's order, as two vertices and the length
    in m; and ``pixel``, the resolution in m. `map_image` is the width and height in pixels that the file must name,
    None for any.
    """
    words = _Words(path)
    count = words.whole("the number of vertices", 1, MOST_VERTICES)
    width, height = (words.number(f"the image's {side}") for side in ("width", "height"))
    if map_image is not None and map_image != (width, height):
        has = f"the map's has {map_image[0]} x {map_image[1]}"
        raise words.wrong(f"is made for an image of {width:g} x {height:g} pixels, and {has}; give this map's graph")
    resolution = words.number("the resolution in m per pixel")
    if resolution <= 0.0:
        raise words.wrong(f"{resolution:g}: expected the resolution in m per pixel, above 0")
    offset = words.number("the x offset in m"), words.number("the y offset in m")
    places: list[tuple[float, float]] = []
    lengths: dict[tuple[int, int], float] = {}
    for vertex in range(count):
        if words.whole("a vertex's number", 0, count - 1) != vertex:
            raise words.wrong(f"expected vertex {vertex}: they stand in order")
        x, y = (words.number("a vertex's place in pixels") for _ in range(2))
        places.append((round(x * resolution + offset[0], 6), round(y * resolution + offset[1], 6)))
        for _ in range(words.whole("a vertex's number of neighbours", 0, count - 1)):
            other = words.whole("a neighbour's number", 0, count - 1)
            if words.text("a neighbour's direction") not in DIRECTIONS:
                raise words.wrong(f"expected a neighbour's direction: {' '.join(DIRECTIONS)}")
            length = round(words.number("the length of an edge in pixels") * resolution, 6)
            if other == vertex or length <= 0.0:
                raise words.wrong("expected a neighbour other than the vertex itself, at a length above 0")
            lengths.setdefault((min(vertex, other), max(vertex, other)), length)
    words.end()
    edges = [(first, last, length) for (first, last), length in lengths.items()]
    return {"vertices": places, "edges": edges, "pixel": resolution}
