"""The core works where the studies are not installed, and says which extra brings them."""

import subprocess
from pathlib import Path

import pytest

from tests.fleets import python

NAMES = ("intruder", "sweep", "benchmark", "reproduce")
ROOT = Path(__file__).parents[2]
CORE = ("agent", "fogwatch", "monitor", "patrol", "ros2", "runtime", "worldsim")
WITHOUT = """
import sys
sys.path = [sys.argv.pop(1), *(folder for folder in sys.path if folder != sys.argv[1])]
del sys.argv[1]
"""
COMMAND = f"""{WITHOUT}
from fogwatch.cli.main import main
sys.exit(main())
"""

EXTRA = "pip install 'fogwatch[experiments]'"


pytestmark = pytest.mark.processes


def without_studies(folder: Path, *words: str, program: str = COMMAND) -> subprocess.CompletedProcess[str]:
    core = folder / "core"
    core.mkdir()
    for package in CORE:
        (core / package).symlink_to(ROOT / package)
    return python("-c", program, core, ROOT, *words, cwd=folder)


def test_a_run_needs_no_study_and_its_report_says_what_it_lacks(tmp_path: Path) -> None:
    words = "run open --robots 2 --point 1 --duration 60 --in-process --no-picture --no-recording --out run"
    done = without_studies(tmp_path, *words.split())
    assert done.returncode == 0, done.stderr  # the verdict is valid
    assert "fogwatch[experiments]" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "words",
    [
        *NAMES,
        "sweep plan.yaml --seeds 5 --help",
        "run open --preset paper",
        "run open --set patrol.policy=gbs --point 1 --in-process",
    ],
)
def test_what_needs_a_study_names_the_extra_that_brings_it(tmp_path: Path, words: str) -> None:
    done = without_studies(tmp_path, *words.split())
    assert done.returncode == 2, done.stderr
    assert EXTRA in done.stderr.replace("\n", " ")
    assert "Traceback" not in done.stderr
    assert "fogwatch fogwatch" not in done.stderr


def test_the_help_lists_them_all_the_same(tmp_path: Path) -> None:
    done = without_studies(tmp_path, "--help")
    assert done.returncode == 0, done.stderr
    assert all(name in done.stdout for name in NAMES)


def test_python_names_the_extra_too(tmp_path: Path) -> None:
    done = without_studies(tmp_path, program=f"{WITHOUT}import fogwatch; fogwatch.sweep")
    assert done.returncode == 1
    assert EXTRA in done.stderr
