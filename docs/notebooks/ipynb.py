"""Write the notebooks of this folder as .ipynb files too, without results: ``make tables``."""

from __future__ import annotations

import json
import re
from pathlib import Path

FOLDER = Path(__file__).parent
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
_CODE = re.compile(r"^```\{code-cell\} ipython3\n(?::tags: [^\n]*\n)?(.*?)\n```\n?", re.MULTILINE | re.DOTALL)


def notebook(text: str) -> str:
    """Return a notebook in MyST's Markdown as the JSON of an .ipynb file."""
    _, _, body = text.split("---\n", 2)
    cells: list[dict[str, object]] = []
    for number, part in enumerate(_CODE.split(body)):  # prose and code in turn
        content = part.strip("\n")
        lines = {"metadata": {}, "source": content.splitlines(keepends=True)}
        if number % 2:
            cells.append({"cell_type": "code", "execution_count": None, "outputs": [], **lines})
        elif content:
            cells.append({"cell_type": "markdown", **lines})
    content = {"cells": cells, "metadata": {"kernelspec": KERNEL}, "nbformat": 4, "nbformat_minor": 4}
    return json.dumps(content, indent=1, ensure_ascii=False, sort_keys=True) + "\n"


if __name__ == "__main__":
    for source in sorted(FOLDER.glob("*.md")):
        source.with_suffix(".ipynb").write_text(notebook(source.read_text(encoding="utf-8")), encoding="utf-8")
