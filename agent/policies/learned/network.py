"""Trained networks: from an observation to an action.

A network in a ``.npz`` file holds the float arrays ``w0, b0, w1, b1, ...``, of which ``w`` is (inputs, outputs) and
``b`` (outputs,), and under ``activation`` the text ``tanh`` or ``relu``, which is applied between them:

    y = activation(x @ w0 + b0) @ w1 + b1

It is evaluated in float64 in a fixed order, so that every machine finds the same numbers. An ``.onnx`` file is
evaluated by onnxruntime in one thread, whose last digits may differ between processors.
"""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from agent.policies.learned.decisions import MASK, Action
from agent.policies.learned.observation import Observation
from patrol.classes.weights_file import FIELD
from patrol.errors import BadInput
from patrol.files.untrusted import WEIGHTS

Vector = NDArray[np.float64]

Activation = Literal["tanh", "relu"]

MOST = 1e6
"""Greatest weight and bias of a network, so that no layer overflows."""


@dataclass(frozen=True)
class Layers:
    """A network of layers that are fully connected."""

    weights: Sequence[Vector]  # float64 (inputs, outputs) of each layer
    biases: Sequence[Vector]  # float64 (outputs,) of each layer
    activation: Activation = "tanh"  # between layers

    def __call__(self, values: Vector) -> Vector:
        """Evaluate the network: float64 (inputs,) to float64 (outputs,)."""
        for layer, (weights, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if layer:
                values = _activated(values, self.activation)
            # Products are summed by input, one after the other: a matrix product's order depends on the processor.
            values = np.add.reduce(weights * values[:, None], axis=0) + bias
        return values

    def save(self, path: Path | str) -> None:
        """Write it as an ``.npz`` file."""
        arrays: dict[str, Any] = {"activation": np.array(self.activation)}
        for layer, (weights, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays |= {f"w{layer}": weights, f"b{layer}": bias}
        np.savez(path, **arrays)


def flattened(observation: Observation) -> Vector:
    """Return an observation's values in one row, as a network gets them: float64 (inputs,).

    The parts keep their order, that of `patrol.options.inputs`; a mask of actions is left out.
    """
    parts = [part.reshape(-1) for name, part in observation.items() if name != MASK]
    return np.concatenate(parts, dtype=np.float64)


def action_of(outputs: Vector, mask: NDArray[np.int8] | None) -> Action:
    """Return the action that a network's outputs mean.

    With a mask, int8 (choices,), it is the first of the permitted actions with the greatest output. If the mask is
    None, it is a place: the hyperbolic tangents of the outputs, float64 (2,).
    """
    if mask is None:
        return np.array([math.tanh(value) for value in outputs.tolist()], dtype=np.float32)
    return int(np.argmax(np.where(mask != 0, outputs, -np.inf)))


def read_network(content: bytes, path: Path, inputs: int, outputs: int) -> Callable[[Vector], Vector]:
    """Read a trained network, ``.npz`` or ``.onnx``, that has to take `inputs` values and give `outputs`."""
    network: Callable[[Vector], Vector]
    if path.suffix == ".onnx":
        from agent.policies.learned.onnx_network import onnx_network  # here: its library is an extra

        network, shape = onnx_network(content, path)
    else:
        network = read_layers(content, path)
        shape = network.weights[0].shape[0], network.weights[-1].shape[1]
    if shape != (inputs, outputs):
        raise BadInput(
            f"{FIELD} = {path}: takes {shape[0]} values and gives {shape[1]}, and this scenario has {inputs} and "
            f"{outputs}; state inputs, window, heard and actions under patrol.options as in training"
        )
    return network


def read_layers(content: bytes, path: Path) -> Layers:
    """Read a network of a ``.npz`` file; `path` is only named in errors."""
    wrong = f"{FIELD} = {path}: is no network"
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > WEIGHTS.most:
                raise BadInput(f"{wrong}: decompressed it is larger than {WEIGHTS.what} may be; make it smaller")
            values = {name.removesuffix(".npy"): _array(archive, name) for name in archive.namelist()}
    except BadInput:
        raise
    except Exception as error:  # noqa: BLE001 - what a hostile archive can raise has no common type
        raise BadInput(f"{wrong} ({error}); write it with fogwatch.learn.Layers.save") from None
    count = (len(values) - 1) // 2
    names = {"activation", *(f"{kind}{layer}" for layer in range(count) for kind in "wb")}
    if count == 0 or values.keys() != names:
        raise BadInput(f"{wrong}: it holds {', '.join(sorted(values))[:100]}; expected activation, w0, b0, w1, b1, ...")
    activation = str(values["activation"])
    if activation not in ("tanh", "relu"):
        raise BadInput(f"{wrong}: activation is {activation[:20]!r}; expected tanh or relu")
    weights = [_numbers(values[f"w{layer}"], 2, f"{wrong}: w{layer}") for layer in range(count)]
    biases = [_numbers(values[f"b{layer}"], 1, f"{wrong}: b{layer}") for layer in range(count)]
    takes = weights[0].shape[0]
    for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        if weight.shape != (takes, bias.size) or 0 in weight.shape:
            raise BadInput(f"{wrong}: w{layer} is {weight.shape}; expected ({takes}, {bias.size})")
        takes = bias.size
    return Layers(weights, biases, "tanh" if activation == "tanh" else "relu")


def _array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Read an array of an archive; its header must not claim more than the entry holds."""
    content = archive.read(name)
    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = header(stream)
    if math.prod(shape) * dtype.itemsize > len(content):
        raise ValueError(f"{name} is cut off")
    return np.load(io.BytesIO(content), allow_pickle=False)  # type: ignore[no-any-return]


def _numbers(array: NDArray[Any], dimensions: int, name: str) -> Vector:
    if array.dtype.kind != "f" or array.ndim != dimensions or not (np.abs(array) <= MOST).all():
        raise BadInput(
            f"{name} is no array of {dimensions} dimensions with floating-point numbers from -{MOST:g} to {MOST:g}"
        )
    return np.ascontiguousarray(array, dtype=np.float64)


def _activated(values: Vector, activation: Activation) -> Vector:
    if activation == "relu":
        return np.maximum(values, 0.0)
    return np.array([math.tanh(value) for value in values.tolist()])
