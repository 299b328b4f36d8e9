import sys
from pathlib import Path
from textwrap import dedent

import pytest

from agent.policies.found import policy_named
from patrol.classes.class_file import LONGEST
from patrol.classes.static_check import check_without_running
from patrol.scenario import Scenario, load_scenario
from tests.agent.policies.test_found import PATIENT, STILL, Write, installed, named, write
from tests.hostile.files.looks import one_line

__all__ = ["installed", "write"]

MARKS = "\nopen(__file__ + '.ran', 'w').close()\n"


def check_of(scenario: Scenario) -> None:
    check_without_running(policy_named(scenario))


def ran(folder: Path) -> bool:
    return bool(list(folder.rglob("*.ran")))


@pytest.mark.parametrize(
    ("name", "source"),
    [
        ("Still", STILL),
        ("Patient", PATIENT),
        ("Heir", "from somewhere import Base\nclass Heir(Base): pass"),
        ("Made", "import somewhere\nMade = somewhere.make()"),
        ("Lent", "from somewhere import Lent"),
        ("Any", "from somewhere import *"),
        ("Tried", "try:\n    import fast\nexcept ImportError:\n    class Tried:\n        def decide(self, view): ..."),
        ("Either", "if True:\n    pass\nelse:\n    class Either:\n        decide = print"),
        ("Long", "#" * (LONGEST + 1)),
    ],
)
def test_what_may_be_a_policy_passes_and_does_not_run(name: str, source: str, write: Write, tmp_path: Path) -> None:
    check_of(load_scenario(write(f"./guard.py:{name}", dedent(source) + MARKS)))
    assert not ran(tmp_path)


@pytest.mark.parametrize(
    ("name", "source", "says"),
    [
        ("Stil", STILL, "has no Stil; did you mean Still?"),
        ("Still", "X = 1", "has no Still; there is none in it"),
        ("Silent", STILL, "is not a class with a method decide(view)"),
        ("function", STILL, "is not a class with a method decide(view)"),
        ("Still", "def broken(:", "raises SyntaxError: "),
        ("Still", "x = " + "-" * 100_000 + "1", "raises "),
        ("Still", "a" + ".a" * 20_000, "raises "),
        ("Still", "\0", "raises "),
        ("Inner", "def make():\n    class Inner:\n        def decide(self, view): ...", "has no Inner"),
    ],
)
def test_what_cannot_be_one_is_refused_and_does_not_run(
    name: str, source: str, says: str, write: Write, tmp_path: Path
) -> None:
    scenario = load_scenario(write(f"./guard.py:{name}", dedent(source) + MARKS))
    said = one_line(lambda: check_of(scenario))
    assert said.startswith(f"patrol.policy = {scenario.patrol.policy}: ")
    assert says in said
    assert not ran(tmp_path)


def test_a_file_that_is_not_there_or_another_is_refused(write: Write) -> None:
    assert "cannot be read" in one_line(lambda: check_of(load_scenario(write("./missing.py:Still"))))
    other = load_scenario(write("./guard.py:Still", policy_sha256="0" * 64))
    assert "is not the file" in one_line(lambda: check_of(other))


def test_a_module_is_found_and_neither_it_nor_its_package_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    package = tmp_path / "guards_of_a_test"
    package.mkdir()
    for name, source in (("__init__.py", ""), ("still.py", dedent(STILL))):
        (package / name).write_text(source + MARKS, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    check_of(named("guards_of_a_test.still:Still"))
    for policy, says in (
        ("guards_of_a_test.still:Stil", "has no Stil; did you mean Still?"),
        ("guards_of_a_test.none:Still", "No module named 'guards_of_a_test.none'; install it"),
        ("guards_of_a_test.still.none:Still", "No module named 'guards_of_a_test.still.none'; install it"),
        ("nobody_has_this.module:Class", "No module named 'nobody_has_this'; install it"),
        ("__main__:Class", ""),
        ("antigravity:Class", "has no Class"),
    ):
        assert says in one_line(lambda: check_of(named(policy)))  # noqa: B023 - called at once
    check_of(named("math:Class"))
    assert not ran(tmp_path)
    assert not {"guards_of_a_test", "guards_of_a_test.still", "antigravity"} & set(sys.modules)


@pytest.mark.usefixtures("installed")
def test_an_entry_point_is_found_and_its_package_does_not_run() -> None:
    check_of(named("sleepy"))
    assert "has no Nobody" in one_line(lambda: check_of(named("broken")))
    assert "no such policy" in one_line(lambda: check_of(named("sleepi")))
    assert "sleepers_of_a_test" not in sys.modules
