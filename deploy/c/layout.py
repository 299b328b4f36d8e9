"""Write what follows from the frame's declaration in `patrol.radio.message`: layout.h, and the table in docs/radio.md.

python deploy/c/layout.py            # write both
python deploy/c/layout.py --check    # exit with 1 where one of them is another
"""

from __future__ import annotations

import sys
from pathlib import Path

from patrol.radio import message
from patrol.radio.message import FIELDS, STEP, WireField

HERE = Path(__file__).parent
HEADER = HERE / "layout.h"
PAGE = HERE.parents[1] / "docs" / "radio.md"
BEGIN, END = "<!-- made by deploy/c/layout.py -->\n", "<!-- until here -->\n"

_TYPES = {
    f"{sign}int{bits}": (0, 2**bits - 1) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
    for bits in (8, 16, 32)
    for sign in ("u", "")
}
"""The ranges of C's types, the smallest types first."""

_CONSTANTS = {
    "VERSION": message.VERSION,
    "CONTACT": message.CONTACT,
    "MAX_FRAME": message.MAX_FRAME,
    "MAX_TRAIL": message.MAX_TRAIL,
    "MAX_KEY": message.MAX_KEY,
    "TAG": message.TAG_BYTES,
    "FIELDS": len(FIELDS),
}


def header() -> str:
    """Return the content of layout.h."""
    ends = {name: field for name, field in FIELDS.items() if (field.least, field.most) != _TYPES[_type_of(field)]}
    constants = _CONSTANTS | {f"MAX_{name.upper()}": field.most for name, field in ends.items()}
    rows = [
        f"FIELD({_type_of(field)}_t, {name}, {_number(field.least)}, {_number(field.most)})"
        for name, field in FIELDS.items()
    ]
    return "\n".join(
        [
            "/* Made by deploy/c/layout.py from patrol/radio/message.py: change that, and run `make layout`. */",
            "#ifndef FOGWATCH_LAYOUT_H",
            "#define FOGWATCH_LAYOUT_H",
            "",
            "#include <stdint.h>",
            "",
            "enum {",
            ",\n".join(f"    FW_{name} = {number}" for name, number in constants.items()),
            "};",
            "",
            "/* The numbers of a frame after its version, in their order: type, name, least, most.",
            " *",
            *(f" * {name}: {_said(field)}" for name, field in FIELDS.items()),
            " */",
            "#define FW_EACH_FIELD(FIELD) \\",
            " \\\n".join(f"    {row}" for row in rows),
            "",
            f"/* A number of a trail: {_said(STEP)}. */",
            f"typedef {_type_of(STEP)}_t fw_step;",
            "enum {",
            f"    FW_MIN_STEP = {_number(STEP.least)},",
            f"    FW_MAX_STEP = {_number(STEP.most)}",
            "};",
            "",
            "#endif",
            "",
        ]
    )


def table() -> str:
    """Return the table of docs/radio.md."""
    rows = [("version", f"{message.VERSION}", "", "of the frame; a receiver refuses any other")]
    rows += [(name, f"{field.least} to {field.most}", field.unit, field.means) for name, field in FIELDS.items()]
    trail = f"up to {message.MAX_TRAIL} pairs in a flat array, newest first; each number {STEP.means}"
    rows += [
        ("[trail]", f"{STEP.least} to {STEP.most}", STEP.unit, trail),
        (
            "[tag]",
            f"{message.TAG_BYTES} bytes",
            "",
            "keyed BLAKE2b over all bytes before the tag's own two-byte header",
        ),
    ]
    lines = [f"| `{name}` | {values} | {unit} | {means} |" for name, values, unit, means in rows]
    return "\n".join(["| value | from, to | unit | is |", "|---|---|---|---|", *lines, ""])


def page() -> str:
    """Return docs/radio.md with its table as it should be."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    return f"{before}{BEGIN}\n{table()}\n{END}{after}"


def _type_of(field: WireField) -> str:
    """The smallest type of C that holds a field."""
    return next(name for name, (least, most) in _TYPES.items() if least <= field.least and field.most <= most)


def _number(value: int) -> str:
    """A number in C; the least and greatest of a type have names, because the least of all cannot be written."""
    named = {
        end: f"{name.upper()}_{which}"
        for name, ends in _TYPES.items()
        for which, end in zip(("MIN", "MAX"), ends, strict=True)
    }
    return named.get(value, str(value)) if value else "0"


def _said(field: WireField) -> str:
    return f"{field.unit}, {field.means}" if field.unit else field.means


def main() -> int:
    """Write both files, or check them."""
    wanted = {HEADER: header(), PAGE: page()}
    if sys.argv[1:] != ["--check"]:
        for path, text in wanted.items():
            path.write_text(text, encoding="utf-8")
        return 0
    wrong = [path for path, text in wanted.items() if not path.exists() or path.read_text(encoding="utf-8") != text]
    for path in wrong:
        print(f"{path}: is not what patrol/radio/message.py says; run `make layout`")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
