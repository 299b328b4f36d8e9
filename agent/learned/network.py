"""The policy `learned`, in which a trained network decides.

    patrol: {policy: learned, options: {weights: trained.npz, inputs: [sectors]}}

A network in a ``.npz`` file holds the float arrays ``w0, b0, w1, b1, ...``, of which ``w`` is (inputs, outputs) and
``b`` (outputs,), and under ``activation`` the text ``tanh`` or ``relu``, which is applied between them:

    y = activation(x @ w0 + b0) @ w1 + b1

It is evaluated in float64 in a fixed order, so that every machine finds the same numbers. An ``.onnx`` file is
evaluated by onnxruntime in one thread, whose last digits may differ between processors.

When a decision is due, the network makes an action of an observation:

actions   an action is                                                                  it means
bearing   0 to 7, a sector of `observation`, or 8                                       Bearing, or Stay
place     two numbers in [-1, 1]: x and y from the robot, in half windows               Place
node      a vertex of the terrain's graph, moved to the nearest ground of this body     Place
"""

from __future__ import annotations

import io
import math
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from agent.learned.observation import SECTORS, Observation, Observer, bearing_of
from agent.ports import Bearing, Intent, Place, Stay
from patrol.classes.class_file import FIELD
from patrol.errors import BadInput
from patrol.files.untrusted import WEIGHTS
from patrol.graph import on_reach

if TYPE_CHECKING:
    from agent.ports import PolicySetup
    from agent.routes.ground import Spot
    from agent.routes.routes import Way
    from agent.view import View
    from patrol.scenario.policies import LearnedOptions


STAY = SECTORS
"""The action that stands still."""

MASK = "action_mask"
"""The part of an environment's observation that says which actions may be chosen; no network gets it."""

NO_NEARER_S = 15.0
"""A robot that has come no nearer to a place for so long has arrived, s."""

NEARER = 0.1
"""Least share of a stride that counts as nearer."""

Action = int | NDArray[np.float32]


class Decisions:
    """The decisions of one robot, one after the other."""

    def __init__(self, setup: PolicySetup, options: LearnedOptions) -> None:
        self.observer = Observer(setup.ground.terrain, options, setup.fleet.step)
        self._kind, self._lasts = options.actions, options.decide == "arrival"
        self._patience = NO_NEARER_S / setup.fleet.step
        self._nodes: list[Spot] = []
        self.choices: int | None = None  # number of actions; None where an action is two numbers
        if options.actions == "node":
            places = on_reach(setup.ground.graph(), setup.ground.terrain, setup.ground.fields.reach).places
            self._nodes = [(x, y) for x, y in places.tolist()]
            self.choices = len(self._nodes)
        elif options.actions == "bearing":
            self.choices = SECTORS + 1
        self._bearing: float | None = None
        self._place: Spot | None = None
        self._least = math.inf
        self._since = 0
        self._last_way: tuple[int, Way | None] | None = None

    def is_due(self, view: View) -> bool:
        """Return True if an action must be taken before `intent` is asked for; it changes nothing."""
        if not self._lasts or self._place is None:
            return True
        way = self._way_to(view, self._place)
        if way is None:
            return False  # the body finds back to the reachable ground first
        is_stuck = view.tick - self._since >= self._patience and not self._is_nearer(way, view)
        return is_stuck or way.length <= 0.5 * view.stride

    def observe(self, view: View) -> Observation:
        """Return the observation to decide by."""
        return self.observer.observe(view)

    def mask(self, view: View) -> NDArray[np.int8] | None:
        """Return 1 for each action that leads anywhere, 0 for others; None where an action is two numbers.

        A bearing leads somewhere if the next point is open, and staying always does. If no bearing does, all count.
        """
        if self.choices is None:
            return None
        mask = np.ones(self.choices, dtype=np.int8)
        if self._kind == "bearing":
            free = self.observer.free_ways(view) > 0
            if free.any():
                mask[:SECTORS] = free
        return mask

    def take(self, action: Action, view: View) -> None:
        """Decide on an action of the module's table: any kind of integer, or any sequence of two numbers."""
        self._least, self._since, self._last_way = math.inf, view.tick, None
        if self._kind == "node":
            self._place = self._nodes[int(action)]
        elif self._kind == "bearing":
            self._bearing = None if int(action) == STAY else bearing_of(int(action))
        else:
            across, up = (min(max(float(share), -1.0), 1.0) * self.observer.half_m for share in np.asarray(action))
            self._place = view.pose.x + across, view.pose.y + up

    def intent(self, view: View) -> Intent:
        """Return the intent that the last action means, once in a tick."""
        if self._place is None:
            return Stay() if self._bearing is None else Bearing((self._bearing,))
        if not self._lasts:
            return Place(*self._place)
        way = self._way_to(view, self._place)
        if way is None:
            return Bearing(())
        if self._is_nearer(way, view):
            self._least, self._since = way.length, view.tick
        return Place(*self._place, bend=way.bend)

    def _way_to(self, view: View, place: Spot) -> Way | None:
        if self._last_way is None or self._last_way[0] != view.tick:
            self._last_way = view.tick, view.way(place)
        return self._last_way[1]

    def _is_nearer(self, way: Way, view: View) -> bool:
        return way.length < self._least - NEARER * view.stride


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
                values = _activate_values(values, self.activation)
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
            values = {name.removesuffix(".npy"): _read_array(archive, name) for name in archive.namelist()}
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
    weights = [_check_numbers(values[f"w{layer}"], 2, f"{wrong}: w{layer}") for layer in range(count)]
    biases = [_check_numbers(values[f"b{layer}"], 1, f"{wrong}: b{layer}") for layer in range(count)]
    takes = weights[0].shape[0]
    for layer, (weight, bias) in enumerate(zip(weights, biases, strict=True)):
        if weight.shape != (takes, bias.size) or 0 in weight.shape:
            raise BadInput(f"{wrong}: w{layer} is {weight.shape}; expected ({takes}, {bias.size})")
        takes = bias.size
    return Layers(weights, biases, "tanh" if activation == "tanh" else "relu")


def _read_array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Read an array of an archive; its header must not claim more than the entry holds."""
    content = archive.read(name)
    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    shape, _, dtype = header(stream)
    if math.prod(shape) * dtype.itemsize > len(content):
        raise ValueError(f"{name} is cut off")
    return np.load(io.BytesIO(content), allow_pickle=False)  # type: ignore[no-any-return]


def _check_numbers(array: NDArray[Any], dimensions: int, name: str) -> Vector:
    if array.dtype.kind != "f" or array.ndim != dimensions or not (np.abs(array) <= MOST).all():
        raise BadInput(
            f"{name} is no array of {dimensions} dimensions with floating-point numbers from -{MOST:g} to {MOST:g}"
        )
    return np.ascontiguousarray(array, dtype=np.float64)


def _activate_values(values: Vector, activation: Activation) -> Vector:
    if activation == "relu":
        return np.maximum(values, 0.0)
    return np.array([math.tanh(value) for value in values.tolist()])


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


class Learned:
    """Asks a network whenever a decision is due."""

    def __init__(self, setup: PolicySetup) -> None:
        """Read the network, or raise `BadInput` where there is none that can be used."""
        options = setup.options
        content = options.read_weights()
        self._decisions = Decisions(setup, options)
        choices = self._decisions.choices
        outputs = 2 if choices is None else choices
        self._network = read_network(content, Path(options.weights), self._decisions.observer.size, outputs)

    def decide(self, view: View) -> Intent:
        """Go on as decided before, or decide anew."""
        decisions = self._decisions
        if decisions.is_due(view):
            outputs = self._network(flattened(decisions.observe(view)))
            decisions.take(action_of(outputs, decisions.mask(view)), view)
        return decisions.intent(view)
