"""A user's modules with the names of our packages, beside a script."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import patrol
from fogwatch.notebook.policy import policy_name
from fogwatch.own_packages import NAMES
from patrol.process.starting import environment

HOME = Path(patrol.__file__).parents[1]


def run_script(folder: Path, text: str) -> subprocess.CompletedProcess[str]:
    script = folder / "script.py"
    script.write_text(text)
    return subprocess.run([sys.executable, str(script)], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.processes
@pytest.mark.parametrize("name", ["agent.py", "patrol/__init__.py", "monitor/__init__.py", "experiments/__init__.py"])
def test_a_users_module_gives_way_until_it_is_imported(tmp_path: Path, name: str) -> None:
    file = tmp_path / name
    file.parent.mkdir(exist_ok=True)
    file.write_text("MINE = 1\n")
    module = name.partition("/")[0].removesuffix(".py")
    ours = run_script(tmp_path, f"import fogwatch, {module}\nfrom agent.ports import Place\nprint({module}.__file__)")
    assert ours.stdout == f"{HOME / module / '__init__.py'}\n", ours.stderr
    assert f"{file}:1: UserWarning: fogwatch has a package of the name {module}" in ours.stderr
    theirs = run_script(tmp_path, f"import {module}, fogwatch")
    assert theirs.stderr.splitlines()[-1] == (
        f"ImportError: {file}: fogwatch has a package of the name {module}; rename it"
    )


def test_processes_get_no_folder_that_hides_a_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hiding, harmless = tmp_path / "hiding", tmp_path / "harmless"
    for folder, name in ((hiding, "agent.py"), (harmless, "my_policy.py")):
        folder.mkdir()
        (folder / name).touch()
    monkeypatch.setenv("PYTHONPATH", f"{hiding}:{HOME}:{harmless}")
    assert environment.own_environment()["PYTHONPATH"] == f"{HOME}:{harmless}"
    monkeypatch.chdir(hiding)
    monkeypatch.setenv("PYTHONPATH", ":.")
    assert environment.own_environment()["PYTHONPATH"] == ""
    assert {*NAMES, "fogwatch"} == set(environment.PACKAGES)


def test_a_policy_beside_the_script_is_a_file_to_other_processes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "beside_the_script.py"
    file.write_text("class Mine:\n    def decide(self, view): ...\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    from beside_the_script import Mine  # type: ignore[import-not-found]

    assert policy_name(Mine, in_process=True) == "beside_the_script:Mine"
    assert policy_name(Mine, in_process=False) == f"{file}:Mine"
