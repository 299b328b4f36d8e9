"""The elementary functions against Python's, which are the C library's, whatever numpy does on this processor."""

import math
import os
import subprocess
import sys
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from patrol.kernels.elementary import Elementary, arctan2, exp, log10, power

BY_PYTHON: list[tuple[Elementary, Callable[..., float]]] = [
    (exp, math.exp),
    (lambda x: log10(np.abs(x) + 1e-9), lambda x: math.log10(abs(x) + 1e-9)),
    (lambda x: power(x, 4.0), lambda x: math.pow(x, 4.0)),
    (lambda x: power(10.0, x / 10.0), lambda x: math.pow(10.0, x / 10.0)),
    (lambda x: arctan2(x, x[::-1]), math.atan2),
]


@pytest.mark.parametrize(("ours", "theirs"), BY_PYTHON)
@given(values=st.lists(st.floats(-300.0, 300.0), min_size=1, max_size=40))
def test_they_are_those_of_the_c_library_to_the_last_bit(
    ours: Elementary, theirs: Callable[..., float], values: list[float]
) -> None:
    columns = [values, values[::-1]] if theirs is math.atan2 else [values]
    assert ours(np.array(values)).tolist() == [theirs(*row) for row in zip(*columns, strict=True)]


def test_they_keep_an_array_s_shape() -> None:
    assert exp(np.zeros((2, 3))).tolist() == [[1.0] * 3] * 2
    assert power(10.0, np.array([[0.0, 1.0]])).tolist() == [[1.0, 10.0]]


def test_they_do_not_depend_on_what_numpy_does_with_the_processor() -> None:
    program = (
        "import hashlib, numpy as np\n"
        "from patrol.kernels.elementary import arctan2, exp, log10, power\n"
        "x = (np.arange(1, 20001) * 0.6180339887 % 1.0) * 9.0\n"
        "found = [exp(x), log10(x), power(x, 4.0), arctan2(x, x[::-1].copy())]\n"
        "print(hashlib.sha256(np.concatenate(found).tobytes()).hexdigest())\n"
    )
    plain = {**os.environ, "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4 AVX512_ICL AVX512_SPR"}

    def digest(environment: dict[str, str]) -> str:
        command = [sys.executable, "-W", "ignore", "-c", program]
        return subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout

    assert digest(dict(os.environ)) == digest(plain)
