"""Trained networks in ONNX files, evaluated by onnxruntime (extra ``onnx``)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from patrol.classes.class_file import FIELD
from patrol.errors import BadInput

_EXTERNAL = b"\x0a\x08location\x12"
"""How a file of weights beside the network is named in it: the key of a protobuf entry, and the start of its value."""

_TYPES = {"tensor(float)": np.float32, "tensor(double)": np.float64}


def onnx_network(
    content: bytes, path: Path
) -> tuple[Callable[[NDArray[np.float64]], NDArray[np.float64]], tuple[int, int]]:
    """Return a network with one input and one output, each (1, n), and how many values it takes and gives.

    It raises `BadInput` where onnxruntime is not installed, or does not take the file.
    """
    try:
        import onnxruntime
    except ImportError:
        raise BadInput(
            f"{FIELD} = {path}: needs onnxruntime; install fogwatch[onnx], or give the network as .npz"
        ) from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1  # so that a run repeats on one machine
    options.log_severity_level = 4
    wrong = f"{FIELD} = {path}: is no network that this policy can use"
    if _EXTERNAL in content:
        raise BadInput(f"{wrong}: it keeps weights in other files; save it as one file")
    try:
        session: Any = onnxruntime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # noqa: BLE001 - its exceptions have no common type
        raise BadInput(f"{wrong} ({str(error).splitlines()[0][:200]})") from None
    inputs, outputs = session.get_inputs(), session.get_outputs()
    sides = [side.shape for side in (*inputs, *outputs)]
    is_row = all(len(shape) == 2 and shape[0] in (1, "N", "batch", None) for shape in sides)
    types = {side.type for side in (*inputs, *outputs)}
    if len(inputs) != 1 or len(outputs) != 1 or not is_row or not types <= _TYPES.keys():
        raise BadInput(f"{wrong}; give one input and one output of floating-point numbers, each of shape (1, n)")
    name, dtype = inputs[0].name, _TYPES[inputs[0].type]

    def evaluate(values: NDArray[np.float64]) -> NDArray[np.float64]:
        rows = session.run(None, {name: values[None, :].astype(dtype)})[0]
        row = np.asarray(rows[0], dtype=np.float64)
        if not np.isfinite(row).all():
            raise ValueError("the network gives values that are no finite numbers")
        return row

    try:
        tried = evaluate(np.zeros(sides[0][1])).shape
    except Exception as error:  # noqa: BLE001 - as above
        raise BadInput(f"{wrong} ({str(error).splitlines()[0][:200]})") from None
    if tried != (sides[1][1],):
        raise BadInput(f"{wrong}: it gives {tried} values and says {sides[1][1]}")
    return evaluate, (sides[0][1], sides[1][1])
