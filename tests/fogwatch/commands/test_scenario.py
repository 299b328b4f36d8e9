import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from fogwatch.commands.scenario import app
from patrol.errors import BadInput
from patrol.scenario import load_scenario, open_scenario, scenario_hash, scenario_schema

EXAMPLES = sorted((Path(__file__).parents[3] / "examples").glob("*.yaml"))


def output(*arguments: str) -> str:
    result = CliRunner().invoke(app, arguments, catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


def checked(*settings: str) -> str:
    """The check of a coarse scenario with some settings."""
    return output("check", "open", "--set", "point=0.5", *(word for one in settings for word in ("--set", one)))


def test_show_prints_a_scenario_file(tmp_path: Path) -> None:
    shown = tmp_path / "shown.yaml"
    text = output("show", "yards", "--set", "patrol.contact_memory=0", "--set", "robots.count=3")
    shown.write_text(text, encoding="utf-8")
    scenario = load_scenario(shown)
    assert (scenario.patrol.contact_memory, len(scenario.roster)) == (0.0, 3)
    assert output("show", str(shown)) == text


def test_check_says_what_would_run() -> None:
    told = checked("robots={count: 2, starts: [[20, 20]]}")
    scenario = open_scenario("open", {"point": "0.5", "robots": "{count: 2, starts: [[20, 20]]}"})
    assert told.startswith("open: can run\n")
    assert scenario_hash(scenario) in told
    for fact in ("2 robots, 1 of them at a given start", "8800 m²", "10000 ticks of 0.5 s"):
        assert fact in told
    one = checked("robots.count=1", "duration=0.5")
    assert "  1 robot, placed at random\n" in one
    assert " 0.5 s in 1 tick of 0.5 s\n" in one


def test_check_tells_the_faults_as_they_are_resolved() -> None:
    faults = "{kind: kill, at: 60, who: r2}, {kind: loss, at: 10, for: 5.2, rate: 0.5}, {kind: range, reach: 9}"
    assert [line.rstrip() for line in checked(f"faults=[{faults}]").splitlines()[7:11]] == [
        "  3 faults, until the end; r2 stays dead",
        "    f1         kill       60 s             r2",
        "    f2         loss       10 to 15 s       all to all, rate 0.5",
        "    f3         range      0 to end         all, reach 9",
    ]


@pytest.mark.parametrize(
    ("faults", "told"),
    [
        ("{kind: pause, who: r1, at: 9, for: 1}", "1 fault, healed at 10 s\n"),
        ("{kind: kill, at: 5, who: all}", "1 fault, over at 5 s, but all stay dead"),
        ("{kind: kill, at: 5, who: r2}, {kind: pause, who: [r1, r3]}", "2 faults, over at 5 s, but r2 stays dead, r1"),
        ("{kind: leave, at: 5, who: r2}, {kind: loss, rate: 0.5}", "2 faults, until the end; r2 stays away"),
        ("{kind: kill, at: 5, who: all}, {kind: restart, at: 9, who: all}", "2 faults, healed at 9 s"),
        ("{kind: join, at: 5, who: r1}, {kind: pause, at: 6, for: 2, who: r1}", "2 faults, healed at 8 s"),
    ],
)
def test_check_says_who_does_not_come_back(faults: str, told: str) -> None:
    assert f"\n  {told}" in checked(f"faults=[{faults}]")


@pytest.mark.parametrize(
    ("setting", "problem"),
    [
        ("radio.key=/none/key", r"radio\.key: cannot read"),
        ("robots={count: 1, starts: [[-20, 20]]}", r"robots: start \(-20, 20\) of r1: not on open"),
        ("robots.radius=60", r"robots\.radius = 60: a body this wide fits nowhere on open"),
    ],
)
def test_check_finds_what_the_file_alone_does_not_show(setting: str, problem: str) -> None:
    with pytest.raises(BadInput, match=problem):
        checked(setting)


@pytest.mark.parametrize("command", ["show", "check"])
def test_wrong_input_is_bad_input(command: str) -> None:
    for arguments in (["yrads"], ["yards", "--set", "seed"], ["yards", "--set", "seed=-1"]):
        with pytest.raises(BadInput):
            output(command, *arguments)


def test_schema_goes_to_the_terminal_or_a_file(tmp_path: Path) -> None:
    assert json.loads(output("schema")) == scenario_schema()
    assert output("schema", "--out", str(tmp_path / "schema.json")) == ""
    assert json.loads((tmp_path / "schema.json").read_text(encoding="utf-8")) == scenario_schema()
    with pytest.raises(BadInput, match="cannot be written"):
        output("schema", "--out", str(tmp_path / "none" / "schema.json"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_can_run(path: Path) -> None:
    assert len(EXAMPLES) >= 3
    scenario = load_scenario(path)
    assert scenario.name == path.stem
    # Coarse points on built-in terrains: what is checked is the file, not the terrain. Doors of a map need fine ones.
    coarse = ["--set", "point=0.5"] if scenario.terrain.builtin else []
    assert output("check", str(path), *coarse).startswith(f"{path}: can run\n")


def test_check_does_not_run_the_policy(tmp_path: Path) -> None:
    guard = tmp_path / "guard.py"
    guard.write_text("open(__file__ + '.ran', 'w').close()\nclass Guard:\n    def decide(self, view): ...\n")
    told = output("check", "open", "--set", "point=2", "--set", f"patrol.policy={guard}:Guard")
    assert f"  patrol: policy {guard}:Guard, not run: a run checks its options" in told.splitlines()
    assert list(tmp_path.iterdir()) == [guard]
    with pytest.raises(BadInput, match="has no Gard; did you mean Guard"):
        output("check", "open", "--set", "point=2", "--set", f"patrol.policy={guard}:Gard")


def test_check_refuses_a_trained_policy_without_its_file(tmp_path: Path) -> None:
    path = tmp_path / "trained.npz"
    settings = ("--set", "patrol.policy=learned", "--set", "point=1")
    with pytest.raises(BadInput, match="weights: is missing"):
        output("check", "open", *settings)
    with pytest.raises(BadInput, match="cannot be read"):
        output("check", "open", *settings, "--set", f"patrol.options.weights={path}")
    path.write_bytes(b"")
    assert "policy learned" in output("check", "open", *settings, "--set", f"patrol.options.weights={path}")
