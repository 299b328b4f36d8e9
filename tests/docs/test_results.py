"""The pages of results: each table says by which commit and which command it was measured, and pages have samples."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from docs.samples import read_samples

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs" / "results").glob("*.md"))
COMMIT = re.compile(r"\b(?=[0-9a-f]*\d)[0-9a-f]{7,8}\b")
COMMAND = re.compile(r"^    .*\S|`(?:fogwatch|pytest|make|python) [^`]+`", re.MULTILINE)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_each_table_names_its_commit_and_command_in_its_section_or_at_the_beginning(page: Path) -> None:
    head, *sections = re.split(r"^(?=## )", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    for section in (head, *sections):
        if re.search(r"^\|", section, re.MULTILINE):
            title = section.partition("\n")[0]
            assert COMMIT.search(head + section), f"{title}: no commit"
            assert COMMAND.search(head + section), f"{title}: no command"


def test_samples_are_on_their_pages_and_pages_without_say_why() -> None:
    samples, unsampled = read_samples()
    for sample in samples:
        assert sample.stated(ROOT / "docs" / "results")[1] > 0.0
    assert {sample.page for sample in samples} | set(unsampled) == {page.stem for page in PAGES}
