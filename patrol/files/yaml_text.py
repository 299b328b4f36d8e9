"""YAML as text, read strictly and within a budget.

Plain values are read by YAML 1.2's core rules, so 1e3 is a number, 1:30 and 2024-01-01 are texts and `yes` is not a
boolean. A key that occurs twice in one mapping is an error, and so are merge keys (`<<`). A short text cannot stand for
much: entries, their depth and the length of each value are limited, and what an alias stands for counts each time.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Sequence
from pathlib import Path
from typing import Any

import yaml

from patrol.errors import BadInput
from patrol.files.foreign import BAG_FOLDER, HEAD, kind_of_bytes
from patrol.files.untrusted import BAG, SCENARIO, Kind, open_untrusted, read_untrusted, refuse_half_characters

MOST_NODES = 100_000
"""Keys, values and lists of one text, those that an alias stands for included: what takes about two seconds to read."""

DEEPEST = 50
"""Levels of lists and mappings."""

LONGEST = 1 << 16
"""Characters of one value."""

MOST_DIGITS = 64
"""Characters of one whole number. A longer one means nothing here, and some cannot be printed again."""

_CONTROLS = frozenset(range(32)) - frozenset(b"\t\n\r")
_TAG = "tag:yaml.org,2002:"


class _Loader(yaml.SafeLoader):
    """The core of YAML's safe subset within the budget, with the rules of 1.2 for plain values and no key twice."""

    yaml_implicit_resolvers: dict[str, list[tuple[str, re.Pattern[str]]]] = {}  # noqa: RUF012 - PyYAML's protocol
    yaml_constructors = {  # noqa: RUF012 - PyYAML's protocol
        tag: made
        for tag, made in yaml.SafeLoader.yaml_constructors.items()
        if tag is None or tag in {f"{_TAG}{name}" for name in ("null", "bool", "float", "str", "seq", "map")}
    }

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._nodes = 0
        self._depth = 0
        self._whole: dict[str, int] = {}
        """By anchor, the nodes that it names, once they are complete."""

    def scan_to_next_token(self) -> None:
        """Skip tabs between tokens too, as YAML 1.2 and yaml-cpp do; PyYAML only skips spaces. None may indent."""
        super().scan_to_next_token()
        while self.peek() == "\t" and (
            self.flow_level or self.buffer[self.buffer.rfind("\n", 0, self.pointer) + 1 : self.pointer].strip()
        ):
            while self.peek() in ("\t", " "):
                self.forward()
            super().scan_to_next_token()

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            if event.anchor in self.anchors:
                if event.anchor not in self._whole:
                    raise _make_error(f"*{event.anchor} is inside of what it stands for", event)
                self._count_nodes(self._whole[event.anchor], event)
            return super().compose_node(parent, index)
        before = self._nodes
        self._count_nodes(1, event)
        if isinstance(event, yaml.ScalarEvent) and len(event.value) > LONGEST:
            raise _make_error(f"a value of {len(event.value)} characters, and at most {LONGEST} are read", event)
        self._depth += 1
        if self._depth > DEEPEST:
            raise RecursionError
        node = super().compose_node(parent, index)
        self._depth -= 1
        if event.anchor is not None:
            self._whole[event.anchor] = self._nodes - before
        return node

    def _count_nodes(self, nodes: int, event: yaml.Event) -> None:
        self._nodes += nodes
        if self._nodes > MOST_NODES:
            raise _make_error(f"more than {MOST_NODES} entries, what aliases stand for included", event)

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen_keys: set[tuple[str, str]] = set()
        for key, _ in node.value:
            if key.tag == f"{_TAG}merge":
                raise _make_error("merge keys (<<) are not read; write the entries out", key)
            name = (key.tag, key.value) if isinstance(key, yaml.ScalarNode) else None
            if name in seen_keys:
                raise _make_error(f"{key.value} occurs twice", key)
            if name is not None:
                seen_keys.add(name)
        return super().construct_mapping(node, deep)


def _make_error(what: str, where: Any) -> yaml.MarkedYAMLError:
    """Make an error at the beginning of a node or an event."""
    return yaml.constructor.ConstructorError(None, None, what, where.start_mark)


_RULES = (
    ("int", re.compile(r"^[-+]?[0-9]+$|^0o[0-7]+$|^0x[0-9a-fA-F]+$"), list("-+0123456789")),
    (
        "float",
        re.compile(r"^[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?$|^[-+]?\.(inf|Inf|INF)$|^\.(nan|NaN|NAN)$"),
        list("-+.0123456789"),
    ),
    ("bool", re.compile(r"^(true|True|TRUE|false|False|FALSE)$"), list("tTfF")),
    ("null", re.compile(r"^(~|null|Null|NULL|)$"), ["~", "n", "N", ""]),
    ("merge", re.compile(r"^<<$"), ["<"]),
)
"""Tag, pattern and possible first characters of each kind of plain value."""


def add_core_rules(reader_or_writer: type[yaml.SafeLoader | yaml.SafeDumper]) -> None:
    """Give a PyYAML loader or dumper the core rules of YAML 1.2 for plain values, beside those that it has."""
    for tag, rule, first in _RULES:
        reader_or_writer.add_implicit_resolver(f"{_TAG}{tag}", rule, first)


add_core_rules(_Loader)


def _read_integer(_loader: _Loader, node: yaml.ScalarNode) -> int:
    text = node.value
    if len(text) > MOST_DIGITS:
        raise _make_error(f"a number of {len(text)} characters, and at most {MOST_DIGITS} are read", node)
    return int(text, {"0o": 8, "0x": 16}.get(text[:2], 10))


_Loader.add_constructor(f"{_TAG}int", _read_integer)


def read_text(path: Path, kind: Kind = SCENARIO) -> str:
    """Read the text of a file in UTF-8, or else in Latin-1, as old maps' comments are."""
    try:
        with open_untrusted(path, BAG) as file:  # a bag is larger than any text
            head = file.read(HEAD)
        if what := kind_of_bytes(head):
            raise BadInput(f"{path}: {what}")
        return _decode_text(read_untrusted(path, kind))
    except FileNotFoundError:
        raise BadInput(f"{path}: no such file") from None
    except IsADirectoryError:
        what = BAG_FOLDER if (path / "metadata.yaml").is_file() else "is a folder; give a file"
        raise BadInput(f"{path}: {what}") from None
    except UnicodeDecodeError as error:
        raise BadInput(f"{path}: is not UTF-8 text (byte {error.start}); give a text file") from None
    except BadInput:
        raise
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None


def _decode_text(content: bytes) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        if _CONTROLS.intersection(content):
            raise
        return content.decode("latin-1")


def parse_yaml(text: str, source: str) -> Any:
    """Parse the one document in a YAML text into plain lists, mappings, texts and numbers."""
    try:
        value = yaml.load(text, Loader=_Loader)  # a SafeLoader: builds plain values only
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        where = "" if mark is None else f" line {mark.line + 1}, column {mark.column + 1}:"
        raise BadInput(f"{source}:{where} {error.problem or error.context}; correct the YAML") from None
    except yaml.reader.ReaderError as error:
        raise BadInput(f"{source}: character {error.position}: {error.reason}; correct the YAML") from None
    except (yaml.YAMLError, ValueError) as error:
        raise BadInput(f"{source}: {error}; correct the YAML") from None
    except LookupError:
        raise BadInput(f"{source}: holds a value that its tag (!!) does not fit; drop the tag") from None
    except RecursionError:
        raise BadInput(f"{source}: nested too deeply; a scenario needs few levels") from None
    refuse_half_characters(value, source)
    return value


def line_of(text: str, location: Sequence[int | str]) -> int | None:
    """Return the line, from 1, on which an entry of a YAML text stands.

    The location is the path of keys and indices to the entry. For an entry that is missing it is the line of the
    innermost entry around it, or None when not even the first key is there.
    """
    node = yaml.compose(text, Loader=_Loader)
    line = None
    for part in location:
        if isinstance(node, yaml.MappingNode):
            entry = next(((key, value) for key, value in node.value if key.value == str(part)), None)
        elif isinstance(node, yaml.SequenceNode) and isinstance(part, int) and part < len(node.value):
            entry = (node.value[part], node.value[part])
        else:
            entry = None
        if entry is None:
            break
        line = entry[0].start_mark.line + 1
        node = entry[1]
    return line
