"""The table of results: ratios, what has none, and the heading."""

from pathlib import Path

import pyperf
import pytest

from bench.table import main, table


def benchmark(name: str, *values: float, unit: str = "second", **facts: object) -> pyperf.Benchmark:
    metadata = {"name": name, "unit": unit, "date": "2026-11-23 12:00:00.000000", **facts}
    run = pyperf.Run(values, metadata={**metadata, "duration": 1.0}, collect_metadata=False)
    return pyperf.Benchmark([run])


SUITE = pyperf.BenchmarkSuite(
    [
        benchmark("wave: ours, lengths alone", 0.001, 0.002, 0.003),
        benchmark("wave: ours, with bends", 0.004, 0.004, 0.004),
        benchmark("wave: rival 1.0", 0.02, 0.04, 0.06, note="no bends"),
        benchmark("memory", 2e8, unit="byte", mem_max_rss=300_000_000),
    ]
)


def test_a_rival_is_compared_with_each_of_ours_that_does_the_same() -> None:
    head, _, alone, bends, rival, memory = table(SUITE)
    assert head.startswith("| what |")
    assert alone == "| wave | ours, lengths alone | 2.00 ms | 1.00 ms | 3.00 ms | 3 |  |  |"
    assert bends == "| wave | ours, with bends | 4.00 ms | 4.00 ms | 4.00 ms | 3 |  |  |"
    assert rival == (
        "| wave | rival 1.0 | 40.0 ms | 20.0 ms | 60.0 ms | 3 | 20 (6.67 to 60); 10 (5 to 15) | no bends |"
    )
    assert memory == "| memory |  | 190.7 MiB | 190.7 MiB | 190.7 MiB | 1 |  |  |"


def test_peak_memory_is_shown_on_demand() -> None:
    assert table(SUITE, memory=True)[-1] == "| memory |  | 190.7 MiB | 190.7 MiB | 190.7 MiB | 1 |  | 286 MiB |  |"


def test_a_file_is_shown_with_its_machine_and_dates(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "one.json"
    pyperf.BenchmarkSuite([benchmark("a", 1.0, cpu_model_name="A Processor")]).dump(str(path))
    assert main([str(path)]) == 0
    heading, _, _, _, row, *_ = capsys.readouterr().out.splitlines()
    assert heading.startswith("one.json: A Processor, 2026-11-23 12:00 to 12:00")
    assert row == "| a |  | 1.00 sec | 1.00 sec | 1.00 sec | 1 |  |  |"
