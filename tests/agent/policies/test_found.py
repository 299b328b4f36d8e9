"""Which policy a scenario names: where it is looked for, what options it takes, and what is said of a missing one."""

from __future__ import annotations

import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from textwrap import dedent
from typing import Any

import pytest
import yaml

from agent.build import Shared, build_mind
from agent.policies.found import POLICIES, policy_of
from agent.policies.potential_field import PotentialField
from agent.policies.stochastic import Committed, Stochastic
from agent.ports import PolicyFailed, State
from patrol.classes.class_file import LONGEST, file_digest
from patrol.errors import BadInput
from patrol.pose import Pose
from patrol.prepare import prepare
from patrol.scenario import (
    CommittedOptions,
    PotentialFieldOptions,
    Scenario,
    StochasticOptions,
    dump_scenario,
    load_scenario,
    scenario_hash,
)
from patrol.scenario.load import keep_scenario
from tests.agent.minds import at

STILL = '''
    from agent.ports import Stay

    class Still:
        def __init__(self, setup):
            self.options = setup.options

        def decide(self, view):
            return Stay("resting")

    class Silent:
        """No policy: it decides nothing."""

    def function(setup):
        return Still(setup)
    '''
PATIENT = """
    from pydantic import BaseModel, ConfigDict, Field
    from agent.ports import Stay

    class Patient:
        class Options(BaseModel):
            model_config = ConfigDict(extra="forbid")
            patience: float = Field(3.0, gt=0.0)
            corners: list[int] = []

        def __init__(self, setup):
            self.options = setup.options

        def decide(self, view):
            return Stay()
    """

Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a policy's file and a scenario's that names it, in a folder of the test's own; the scenario's path."""

    def make(policy: str, source: str = STILL, folder: str = "own", name: str = "guard.py", **patrol: Any) -> Path:
        place = tmp_path / folder
        place.mkdir(exist_ok=True)
        (place / name).write_text(dedent(source), encoding="utf-8")
        path = place / "scenario.yaml"
        mapping = {"terrain": {"builtin": "open"}, "point": 2.0, "patrol": {"policy": policy, **patrol}}
        path.write_text(yaml.safe_dump(mapping), encoding="utf-8")
        return path

    return make


def named(policy: str, **patrol: Any) -> Scenario:
    return load_scenario({"terrain": {"builtin": "open"}, "point": 2.0, "patrol": {"policy": policy, **patrol}})


def refused(scenario: Scenario) -> str:
    with pytest.raises(BadInput) as bad:
        policy_of(scenario)
    said = str(bad.value)
    assert "\n" not in said
    return said


# --- where it comes from ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scenario", "name", "made", "options"),
    [
        (load_scenario({"terrain": {"builtin": "open"}}), "stochastic", Stochastic, StochasticOptions),
        (named("committed"), "committed", Committed, CommittedOptions),
        (named("potential-field"), "potential-field", PotentialField, PotentialFieldOptions),
    ],
    ids=["default", "committed", "potential-field"],
)
def test_the_built_in_policies(scenario: Scenario, name: str, made: type, options: type) -> None:
    kind = policy_of(scenario)
    assert (kind.name, kind.make, kind.ours) == (name, made, True)
    assert type(kind.options) is options
    assert scenario.patrol.policy_sha256 is None


def test_a_policy_that_builds_on_a_built_in_one_has_its_options_and_lengths(write: Write) -> None:
    source = """
    from agent.policies.potential_field import PotentialField

    class Mine(PotentialField):
        pass
    """
    scenario = load_scenario(write("./guard.py:Mine", source, options={"direction": "vector", "dilatation": 3}))
    kind = policy_of(scenario)
    assert (kind.options.direction, kind.options.dilatation) == ("vector", 3.0)
    assert build_mind(Shared(prepare(scenario)), 1).policy is not None


ON_THE_TOUR = """
    from dataclasses import replace
    from agent.policies.stochastic import Committed
    from patrol.scenario import CommittedOptions

    class OnTheTour:
        {word}

        def __init__(self, setup):
            self.within = Committed(replace(setup, options=CommittedOptions()))

        def decide(self, view):
            return self.within.decide(view)
    """


def test_a_policy_that_makes_one_on_a_round_says_so(write: Write) -> None:
    says = load_scenario(write("./guard.py:OnTheTour", ON_THE_TOUR.format(word="follows_rounds = True")))
    policy: Any = build_mind(Shared(prepare(says)), 1).policy
    assert type(policy.otherwise.within.choice).__name__ == "Drawn"
    says_nothing = load_scenario(write("./other.py:OnTheTour", ON_THE_TOUR.format(word="pass"), name="other.py"))
    with pytest.raises(PolicyFailed, match="follows_rounds = True"):
        build_mind(Shared(prepare(says_nothing)), 1)


def test_a_file_beside_the_scenario(write: Write, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = write("./guard.py:Still")
    monkeypatch.chdir(tmp_path)
    scenario = load_scenario(path)
    kind = policy_of(scenario)
    assert not kind.ours
    assert kind.name == scenario.patrol.policy == f"{path.parent / 'guard.py'}:Still"
    assert scenario.patrol.policy_sha256 == file_digest(path.parent / "guard.py", "patrol.policy")
    mind = build_mind(Shared(prepare(scenario)), 1)
    decision = mind.step(at(0, Pose(20.0, 20.0, 0.0)), [])
    assert decision.state == "resting"
    assert decision.command.numbers == (0.0, 0.0)


def test_a_file_without_a_class_is_answered_with_its_classes(write: Write) -> None:
    path = write("./guard.py")
    with pytest.raises(BadInput, match=re.escape('"./guard.py": expected ./guard.py:Still or ./guard.py:Silent')):
        load_scenario(path)
    for source in ("raise SystemExit\n", "class A:\n", f"class A: pass\n{'#' * LONGEST}"):
        (path.parent / "guard.py").write_text(source, encoding="utf-8")
        with pytest.raises(BadInput, match=re.escape("expected ./guard.py:Class")):
            load_scenario(path)


def test_a_strangers_scenario_opens_no_file_for_its_error(write: Write) -> None:
    raw = yaml.safe_load(write("./guard.py").read_text(encoding="utf-8"))
    with pytest.raises(BadInput, match="expected committed, potential-field, package"):
        load_scenario(raw, base=write("./guard.py").parent, opens_classes=False)


@pytest.mark.parametrize("policy", ["guard.py:Still", "../own/guard.py:Still"])
def test_a_file_is_named_in_any_way_that_leads_there(policy: str, write: Write) -> None:
    assert policy_of(load_scenario(write(policy))).make.__name__ == "Still"


def test_a_file_given_from_code_is_relative_to_the_work_folder(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write("./guard.py:Still")
    monkeypatch.chdir(path.parent)
    assert policy_of(named("./guard.py:Still")).name == f"{path.parent / 'guard.py'}:Still"


def test_a_file_is_run_once_as_long_as_it_stays_the_same(write: Write) -> None:
    first, again = (policy_of(load_scenario(write("./guard.py:Still", folder=name))) for name in ("one", "two"))
    assert first.make is again.make
    changed = policy_of(load_scenario(write("./guard.py:Still", dedent(STILL) + "\nMORE = 1\n")))
    assert changed.make is not first.make


def test_a_module_and_class(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "guarding_of_a_test.py").write_text(dedent(STILL), encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    scenario = named("guarding_of_a_test:Still")
    assert scenario.patrol.policy_sha256 is None
    kind = policy_of(scenario)
    assert kind.make.__module__ == "guarding_of_a_test"
    assert (kind.name, kind.ours) == ("guarding_of_a_test:Still", False)
    monkeypatch.delitem(sys.modules, "guarding_of_a_test")


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A package that offers the policies `sleepy` and `broken`."""
    (tmp_path / "sleepers_of_a_test.py").write_text(dedent(STILL), encoding="utf-8")
    facts = tmp_path / "sleepers_of_a_test-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: sleepers-of-a-test\nVersion: 1.0\n", encoding="utf-8")
    points = f"[{POLICIES.group}]\nsleepy = sleepers_of_a_test:Still\nbroken = sleepers_of_a_test:Nobody\n"
    (facts / "entry_points.txt").write_text(points, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "sleepers_of_a_test", raising=False)


@pytest.mark.usefixtures("installed")
def test_an_entry_point_of_an_installed_package() -> None:
    kind = policy_of(named("sleepy"))
    assert kind.make.__module__ == "sleepers_of_a_test"
    assert (kind.name, kind.ours) == ("sleepy", False)


@pytest.mark.usefixtures("installed")
def test_an_entry_point_that_cannot_be_loaded_is_named() -> None:
    said = refused(named("broken"))
    assert said.startswith("patrol.policy = broken (sleepers_of_a_test:Nobody): raises AttributeError: ")


def test_the_papers_patrol_names_its_policy() -> None:
    assert "= paper: this is a patrol; its policy is potential-field" in refused(named("paper"))


def test_an_unknown_entry_point_is_named_and_what_there_is_offered() -> None:
    said = refused(named("potential-feild"))
    assert said.startswith("patrol.policy = potential-feild: no such policy; ")
    assert "potential-field" in said.partition(";")[2]
    assert "package.module:Class or ./file.py:Class" in said


# --- what is wrong with it -------------------------------------------------------------------------------------------


def test_a_file_that_is_not_there_is_named(write: Write) -> None:
    path = write("./missing.py:Still")
    says = f"patrol.policy = {path.parent / 'missing.py'}: cannot be read (No such file or directory); correct it"
    assert refused(load_scenario(path)).startswith(says)


def test_a_module_that_is_not_there_is_named() -> None:
    says = "patrol.policy = nobody_has_this.module:Class: No module named 'nobody_has_this'; install it"
    assert refused(named("nobody_has_this.module:Class")).startswith(says)


@pytest.mark.parametrize(
    ("name", "source", "says"),
    [
        *((name, STILL, "is not a class with a method decide(view)") for name in ("Silent", "function", "Stay")),
        ("Stil", STILL, "has no Stil; did you mean Still"),
        ("Still", "X = 1\n", "has no Still; there is none in it"),
        ("Still", "1 / 0\n", "raises ZeroDivisionError: division by zero; correct it"),
        ("Still", "def broken(:\n", "raises SyntaxError: "),
        ("Still", "raise ValueError('two\\nlines')\n", "raises ValueError: two lines; correct it"),
        ("Still", "import nobody_has_this\n", "No module named 'nobody_has_this'"),
    ],
)
def test_a_file_without_the_policy_is_named_with_the_reason(name: str, source: str, says: str, write: Write) -> None:
    scenario = load_scenario(write(f"./guard.py:{name}", source))
    for _ in range(2):
        said = refused(scenario)
        assert said.startswith(f"patrol.policy = {scenario.patrol.policy}: ")
        assert says in said


def test_a_file_that_has_changed_is_refused_and_another_load_takes_it(write: Write) -> None:
    path = write("./guard.py:Still")
    scenario = load_scenario(path)
    old = file_digest(path.parent / "guard.py", "patrol.policy")
    with (path.parent / "guard.py").open("a", encoding="utf-8") as file:
        file.write("\nMORE = 1\n")
    new = file_digest(path.parent / "guard.py", "patrol.policy")
    said = refused(scenario)
    assert said.startswith(f"{path.parent / 'guard.py'}: is not the file that this scenario was resolved with")
    for part in (old[:12], new[:12], "patrol.policy_sha256"):
        assert part in said
    assert policy_of(load_scenario(path)).make.__name__ == "Still"


def test_a_scenario_may_insist_on_a_files_content(write: Write) -> None:
    path = write("./guard.py:Still", policy_sha256="0" * 64)
    scenario = load_scenario(path)
    assert scenario.patrol.policy_sha256 == "0" * 64
    assert "is not the file" in refused(scenario)


@pytest.mark.parametrize("digest", ["", "0" * 63, "G" * 64, 7])
def test_a_digest_is_64_hex_digits(digest: object) -> None:
    with pytest.raises(BadInput, match=r"patrol\.policy_sha256"):
        named("potential-field", policy_sha256=digest)


@pytest.mark.parametrize("policy", ["", "two words", ":Class", "file.py:", "file.py:not-a-name", "a\nb", 7])
def test_what_names_no_policy_at_all_is_refused_when_the_scenario_is_read(policy: Any) -> None:
    with pytest.raises(BadInput, match=r"patrol\.policy"):
        named(policy)


def test_a_policy_that_cannot_be_made_fails_with_what_it_raises(write: Write) -> None:
    source = dedent(STILL).replace("self.options = setup.options", "raise KeyError('no idea')")
    prepared = prepare(load_scenario(write("./guard.py:Still", source)))
    with pytest.raises(PolicyFailed, match=r"Still: cannot be made for r1: KeyError: 'no idea' \(guard\.py:\d+\)"):
        build_mind(Shared(prepared), 1)


# --- options ---------------------------------------------------------------------------------------------------------


def test_options_are_the_policys_own(write: Write) -> None:
    scenario = load_scenario(write("./guard.py:Patient", PATIENT, options={"patience": 7, "corners": [1, 2]}))
    kind = policy_of(scenario)
    assert (kind.options.patience, kind.options.corners) == (7.0, [1, 2])
    assert policy_of(load_scenario(write("./guard.py:Patient", PATIENT))).options.patience == 3.0
    mind = build_mind(Shared(prepare(scenario)), 1)
    assert mind.policy.otherwise.options.patience == 7.0  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"patience": -1}, "patrol.options.patience = -1: "),
        ({"patience": "long"}, "patrol.options.patience = 'long': "),
        ({"corners": [1, "x"]}, "patrol.options.corners.1 = 'x': "),
        ({"patiense": 1}, "patrol.options.patiense = 1: "),
    ],
)
def test_a_wrong_option_is_named_with_value_and_alternatives(options: dict[str, Any], says: str, write: Write) -> None:
    scenario = load_scenario(write("./guard.py:Patient", PATIENT, options=options))
    said = refused(scenario)
    assert said.startswith(says)
    assert said.endswith(f"{scenario.patrol.policy} has the options patience, corners")


def test_a_policy_without_options_takes_none(write: Write) -> None:
    scenario = load_scenario(write("./guard.py:Still", options={"patience": 3}))
    said = refused(scenario)
    assert said.startswith("patrol.options = {'patience': 3}: ")
    assert "takes no options" in said
    with pytest.raises(BadInput, match="takes no options"):
        build_mind(Shared(prepare(scenario)), 1)
    assert policy_of(load_scenario(write("./guard.py:Still", options={}))).options == {}


@pytest.mark.parametrize(("dilatation", "metres"), [("auto", 5.0), (3, 3.0)])
def test_a_policy_of_ones_own_may_say_how_far_staleness_spreads(write: Write, dilatation: Any, metres: float) -> None:
    source = """
    from pydantic import BaseModel

    class Still:
        class Options(BaseModel):
            dilatation: float | str = "auto"
            critical_width: float | None = None

        def __init__(self, setup):
            assert setup.robot.lengths.dilatation == %s
            assert setup.robot.lengths.critical_width == 8.0

        def decide(self, view):
            ...
    """
    good = load_scenario(write("./guard.py:Still", source % metres, options={"dilatation": dilatation}))
    build_mind(Shared(prepare(good)), 1)
    bad = prepare(load_scenario(write("./guard.py:Still", source % metres, options={"dilatation": "far"})))
    with pytest.raises(BadInput, match=r"patrol.options.dilatation = 'far': expected a length from 0 on"):
        build_mind(Shared(bad), 1)


# --- what a scenario with a policy means -----------------------------------------------------------------------------


def test_a_scenarios_hash_is_that_of_the_files_content_wherever_it_lies(write: Write) -> None:
    here, there = write("./guard.py:Still", folder="here"), write("./sentry.py:Still", folder="there", name="sentry.py")
    assert scenario_hash(load_scenario(here)) == scenario_hash(load_scenario(there))
    by_class = write("./guard.py:Silent", folder="by_class")
    by_content = write("./guard.py:Still", dedent(STILL) + "\nMORE = 1\n", folder="by_content")
    by_options = write("./guard.py:Still", folder="by_options", options={"patience": 1})
    hashes = [scenario_hash(load_scenario(path)) for path in (here, by_class, by_content, by_options)]
    hashes.append(scenario_hash(named("potential-field")))
    assert len(set(hashes)) == 5


def test_looking_at_a_scenario_runs_no_policy(write: Write, tmp_path: Path) -> None:
    mark = tmp_path / "ran"
    scenario = load_scenario(write("./guard.py:Still", f"open({str(mark)!r}, 'w').close()\n"))
    scenario_hash(scenario)
    dump_scenario(scenario)
    (tmp_path / "kept").mkdir()
    keep_scenario(scenario, tmp_path / "kept")
    prepare(scenario)
    assert not mark.exists()
    refused(scenario)
    assert mark.exists()


def test_a_scenario_in_a_run_folder_has_its_policy_with_it_wherever_it_goes(write: Write, tmp_path: Path) -> None:
    path = write("./guard.py:Patient", PATIENT, options={"patience": 7})
    scenario = load_scenario(path)
    kept, moved = tmp_path / "kept", tmp_path / "elsewhere" / "moved"
    kept.mkdir()
    keep_scenario(scenario, kept)
    shutil.copytree(kept, moved)
    shutil.rmtree(path.parent)
    shutil.rmtree(kept)
    again = load_scenario(moved / "scenario.yaml")
    assert again.patrol.policy == f"{moved / 'policy' / 'guard.py'}:Patient"
    assert again.patrol.policy_sha256 == scenario.patrol.policy_sha256
    assert scenario_hash(again) == scenario_hash(scenario)
    assert policy_of(again).options.patience == 7.0


def test_a_copy_of_a_policy_that_is_gone_says_so(write: Write, tmp_path: Path) -> None:
    path = write("./guard.py:Still")
    scenario = load_scenario(path)
    (path.parent / "guard.py").unlink()
    (tmp_path / "kept").mkdir()
    with pytest.raises(BadInput, match=r"patrol\.policy = .*guard\.py: cannot be read \(No such file or directory\)"):
        keep_scenario(scenario, tmp_path / "kept")


def test_surrounding_goes_before_a_policy_of_ones_own(write: Write) -> None:
    mind = build_mind(Shared(prepare(load_scenario(write("./guard.py:Still")))), 1)
    pose = Pose(20.0, 20.0, 0.0)
    assert mind.step(at(0, pose), []).state == "resting"
    assert mind.step(at(1, pose, contacts=((25.0, 20.0),)), []).state is State.SURROUNDING
