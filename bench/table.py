"""A Markdown table of results, with the ratio of each contender to ours.

    python -m bench.table kernels.json fleets.json --memory

The ratio is that of the medians; in brackets stand the least and the greatest that single values allow, which is wider
than chance makes it.
"""

from __future__ import annotations

import argparse
import statistics
import sys
from collections.abc import Sequence
from pathlib import Path

import pyperf

OURS = "ours"
FACTS = ("cpu_model_name", "cpu_count", "platform", "python_version", "numba_version", "fogwatch_commit")
"""Facts of machine and software in a table's heading."""


def table(suite: pyperf.BenchmarkSuite, memory: bool = False) -> list[str]:
    """Return the lines of a Markdown table.

    Args:
        suite: Results of one or several scripts.
        memory: Whether there is a column with the peak memory of the process that measured.
    """
    heads = ["what", "", "median", "min", "max", "values", "ratio to ours", *(["peak memory"] if memory else []), ""]
    lines = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    benchmarks = suite.get_benchmarks()
    for benchmark in benchmarks:
        task, contender = split(benchmark)
        values = benchmark.get_values()
        shown = map(benchmark.format_value, (statistics.median(values), min(values), max(values)))
        cells = [task, contender, *shown, str(len(values)), ratios(benchmark, benchmarks)]
        if memory:
            cells.append(f"{benchmark.get_metadata().get('mem_max_rss', 0) / 2**20:.0f} MiB")
        lines.append(f"| {' | '.join([*cells, str(benchmark.get_metadata().get('note', ''))])} |")
    return lines


def split(benchmark: pyperf.Benchmark) -> tuple[str, str]:
    """Return the task of a benchmark and its contender, which is empty where there is only one.

    Args:
        benchmark: Its name is ``TASK: CONTENDER``, or a task alone.
    """
    task, _, contender = benchmark.get_name().partition(": ")
    return task, contender


def ratios(benchmark: pyperf.Benchmark, benchmarks: Sequence[pyperf.Benchmark]) -> str:
    """Return how much longer a contender takes than each of ours that does the same task.

    Args:
        benchmark: The contender's.
        benchmarks: All of the same run.

    Returns:
        Such as "17.6 (14.4 to 22.4)", one for each of ours in their order; empty where this is ours, or none is.
    """
    task, contender = split(benchmark)
    if contender.startswith(OURS):
        return ""
    own = [other for other in benchmarks if split(other)[0] == task and split(other)[1].startswith(OURS)]
    return "; ".join(_ratio(benchmark.get_values(), other.get_values()) for other in own)


def _ratio(theirs: Sequence[float], ours: Sequence[float]) -> str:
    middle = statistics.median(theirs) / statistics.median(ours)
    return f"{middle:.3g} ({min(theirs) / max(ours):.3g} to {max(theirs) / min(ours):.3g})"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table for each file.

    Args:
        arguments: The command line; this process's own unless given.

    Returns:
        The exit code.
    """
    parser = argparse.ArgumentParser(
        prog="python -m bench.table", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="results that a script has written by -o")
    parser.add_argument("--memory", action="store_true", help="show the peak memory of the process that measured")
    options = parser.parse_args(arguments)
    for path in options.files:
        suite = pyperf.BenchmarkSuite.load(str(path))
        facts = suite.get_metadata()
        first, last = suite.get_dates()
        heading = [str(facts[name]) for name in FACTS if facts.get(name)]
        print(f"{path.name}: {', '.join(heading)}, {first:%Y-%m-%d %H:%M} to {last:%H:%M}\n")
        print("\n".join([*table(suite, options.memory), ""]))
    return 0


if __name__ == "__main__":
    sys.exit(main())
