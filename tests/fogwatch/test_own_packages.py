"""A user's modules with the names of our packages, beside a script."""

import subprocess
import sys
from pathlib import Path

import pytest

import patrol
from fogwatch.notebook.arguments import policy_name
from fogwatch.own_packages import NAMES
from runtime.starting import environment
from tests.fleets import python

HOME = Path(patrol.__file__).parents[1]


def run_script(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    script = folder / "script.py"
    script.write_text(text)
    command = [sys.executable, "-W", "error", str(script)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.processes
@pytest.mark.parametrize("name", ["agent.py", "patrol/__init__.py", "monitor/__init__.py", "experiments/__init__.py"])
def test_a_users_module_gives_way_until_it_is_imported(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_text("MINE = 1\n")
    module = name.partition("/")[0].removesuffix(".py")
    ours = run_script(tmp_path, f"import fogwatch, {module}\nfrom agent.ports import Place\nprint({module}.__file__)")
    assert ours.stdout == f"{HOME / module / '__init__.py'}\n", ours.stderr
    has = f"{file}: fogwatch has a package of the name {module}"
    assert ours.stderr == f"fogwatch: {has}, which hides this file; rename it\n"
    theirs = run_script(tmp_path, f"import {module}, fogwatch")
    assert theirs.stderr.splitlines()[-1] == f"ImportError: {has}; rename it"


@pytest.mark.processes
def test_a_namespace_folder_that_is_already_imported_is_named(tmp_path: Path) -> None:
    (tmp_path / "agent").mkdir()
    ours = repr(str(HOME))  # while it is on the path, its agent goes before a folder without __init__.py
    program = f"import sys\nsys.path.remove({ours})\nimport agent\nsys.path.append({ours})\nimport fogwatch"
    said = run_script(tmp_path, program).stderr.splitlines()[-1]
    assert said == f"ImportError: {tmp_path / 'agent'}: fogwatch has a package of the name agent; rename it"


@pytest.mark.processes
def test_our_own_packages_by_way_of_a_symbolic_link_are_ours(tmp_path: Path) -> None:
    (tmp_path / "link").symlink_to(HOME)
    linked = "sys.path.insert(0, 'link')"
    program = f"import sys\n{linked}\nimport agent\nsys.path.pop(0)\nimport fogwatch\n{linked}\nimport monitor"
    both = run_script(tmp_path, program)
    assert (both.returncode, both.stderr) == (0, "")


def test_processes_look_for_our_packages_before_a_folder_that_hides_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hiding, harmless = tmp_path / "hiding", tmp_path / "harmless"
    for folder, name in ((hiding, "agent.py"), (harmless, "my_policy.py")):
        folder.mkdir()
        (folder / name).touch()
    link = tmp_path / "link"
    link.symlink_to(HOME)
    monkeypatch.setenv("PYTHONPATH", f"{link}:{harmless}")
    assert environment.own_environment()["PYTHONPATH"] == f"{link}:{harmless}"
    monkeypatch.setenv("PYTHONPATH", f"{harmless}:{hiding}")
    assert environment.own_environment()["PYTHONPATH"] == f"{harmless}:{HOME}:{hiding}"
    monkeypatch.chdir(hiding)
    monkeypatch.setenv("PYTHONPATH", ":.")
    assert environment.own_environment()["PYTHONPATH"] == f"{HOME}::."
    assert {*NAMES, "fogwatch"} == set(environment.PACKAGES)


@pytest.mark.processes
def test_a_process_finds_both_our_package_and_the_users_module_beside_its_namesake(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("agent.py", "mine.py"):
        (tmp_path / name).touch()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    process = python("-c", "import agent.ports, mine; print(mine.__file__)", env=environment.own_environment())
    assert process.stdout == f"{tmp_path / 'mine.py'}\n", process.stderr


def test_a_policy_beside_the_script_is_a_file_to_other_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "beside_the_script.py"
    file.write_text("class Mine:\n    def decide(self, view): ...\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    from beside_the_script import Mine  # type: ignore[import-not-found]

    assert policy_name(Mine, in_process=True) == "beside_the_script:Mine"
    assert policy_name(Mine, in_process=False) == f"{file}:Mine"
