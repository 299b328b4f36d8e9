"""Trained networks: read, refused, and evaluated the same everywhere."""

import contextlib
import io
import sys
import zipfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from hypothesis import given
from hypothesis import strategies as st
from onnx import TensorProto, helper, numpy_helper

from agent.learned.network import MASK, Layers, action_of, flattened, onnx_network, read_layers, read_network
from patrol.errors import BadInput
from patrol.files.untrusted import WEIGHTS, Kind

FILE = Path("trained.npz")


def layers(*sizes: int, activation: Any = "tanh") -> Layers:
    rng = np.random.default_rng(3)
    pairs = list(pairwise(sizes))
    return Layers([rng.normal(size=pair) for pair in pairs], [rng.normal(size=out) for _, out in pairs], activation)


def model_of(graph: Any) -> Any:
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)


def written(network: Layers, folder: Path) -> bytes:
    network.save(folder / FILE)
    return (folder / FILE).read_bytes()


def as_onnx(network: Layers, dtype: Any = np.float64) -> bytes:
    """The same network as Gemm, Tanh and Relu nodes."""
    nodes, constants, name = [], [], "x"
    for layer, (weights, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        if layer:
            kind = "Tanh" if network.activation == "tanh" else "Relu"
            nodes.append(helper.make_node(kind, [name], [f"a{layer}"]))
            name = f"a{layer}"
        constants += [numpy_helper.from_array(a.astype(dtype), f"{n}{layer}") for n, a in (("w", weights), ("b", bias))]
        nodes.append(helper.make_node("Gemm", [name, f"w{layer}", f"b{layer}"], [f"y{layer}"]))
        name = f"y{layer}"
    kind_of = TensorProto.DOUBLE if dtype == np.float64 else TensorProto.FLOAT
    takes = helper.make_tensor_value_info("x", kind_of, [1, network.weights[0].shape[0]])
    gives = helper.make_tensor_value_info(name, kind_of, [1, network.weights[-1].shape[1]])
    model = model_of(helper.make_graph(nodes, "policy", [takes], [gives], constants))
    onnx.checker.check_model(model)
    return bytes(model.SerializeToString())


@pytest.mark.parametrize("activation", ["tanh", "relu"])
def test_a_network_that_was_saved_is_the_same_again(tmp_path: Path, activation: str) -> None:
    network = layers(5, 7, 3, activation=activation)
    again = read_network(written(network, tmp_path), FILE, 5, 3)
    values = np.linspace(-1.0, 1.0, 5)
    hidden = values @ network.weights[0] + network.biases[0]
    hidden = np.tanh(hidden) if activation == "tanh" else np.maximum(hidden, 0.0)
    assert again(values).tolist() == network(values).tolist()
    np.testing.assert_allclose(again(values), hidden @ network.weights[1] + network.biases[1], rtol=1e-12)


@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize(("dtype", "error"), [(np.float64, 1e-12), (np.float32, 1e-5)])
def test_an_onnx_file_gives_what_the_same_layers_give(activation: str, dtype: Any, error: float) -> None:
    network = layers(6, 4, 9, activation=activation)
    loaded = read_network(as_onnx(network, dtype), Path("trained.onnx"), 6, 9)
    values = np.linspace(-0.5, 0.9, 6)
    np.testing.assert_allclose(loaded(values), network(values), rtol=error, atol=error)


def test_without_onnxruntime_an_onnx_file_is_refused_with_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(BadInput, match=r"trained\.onnx: needs onnxruntime; install fogwatch\[onnx\]"):
        read_network(as_onnx(layers(2, 3)), Path("trained.onnx"), 2, 3)


def test_what_is_no_onnx_network_of_rows_is_refused() -> None:
    with pytest.raises(BadInput, match="is no network that this policy can use"):
        read_network(b"not a model", Path("trained.onnx"), 2, 3)
    wide = onnx.load_model_from_string(as_onnx(layers(2, 3)))
    wide.graph.input[0].type.tensor_type.shape.dim[0].dim_value = 4
    wide.graph.output[0].type.tensor_type.shape.dim[0].dim_value = 4
    with pytest.raises(BadInput, match=r"each of shape \(1, n\)"):
        read_network(wide.SerializeToString(), Path("trained.onnx"), 2, 3)


def test_a_network_for_other_observations_or_actions_is_refused(tmp_path: Path) -> None:
    content = written(layers(5, 3), tmp_path)
    for inputs, outputs in ((4, 3), (5, 9)):
        with pytest.raises(BadInput, match=f"takes 5 values and gives 3, and this scenario has {inputs} and {outputs}"):
            read_network(content, FILE, inputs, outputs)


def archive(**arrays: Any) -> bytes:
    file = io.BytesIO()
    np.savez(file, **arrays)
    return file.getvalue()


ONE = {"w0": np.ones((2, 3)), "b0": np.ones(3)}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is no network"),
        (b"PK\x03\x04 but no more", "is no network"),
        (archive(**ONE), "it holds b0, w0; expected activation"),
        (archive(activation="tanh"), "expected activation, w0, b0"),
        (archive(activation="swish", **ONE), "activation is 'swish'; expected tanh or relu"),
        (archive(activation="tanh", w0=np.ones((2, 3)), b0=np.ones(2)), r"w0 is \(2, 3\); expected \(2, 2\)"),
        (archive(activation="tanh", w0=np.ones((0, 3)), b0=np.ones(3)), r"w0 is \(0, 3\)"),
        (archive(activation="tanh", w0=np.ones(3), b0=np.ones(3)), "w0 is no array of 2 dimensions"),
        (archive(activation="tanh", w0=np.full((2, 3), np.nan), b0=np.ones(3)), "numbers from -1e"),
        (archive(activation="tanh", w0=np.array([["a"]]), b0=np.ones(1)), "numbers from -1e"),
        (archive(activation="tanh", w0=np.full((2, 3), 1e308), b0=np.ones(3)), "numbers from -1e"),
        (archive(activation="tanh", w0=np.array([[{}]], dtype=object), b0=np.ones(1)), "is no network"),
    ],
)
def test_what_is_no_network_is_refused_in_one_line(content: bytes, message: str) -> None:
    with pytest.raises(BadInput, match=message) as refused:
        read_layers(content, FILE)
    assert str(refused.value).startswith("patrol.options.weights = trained.npz: is no network")
    assert "\n" not in str(refused.value)


def entry(header: str, version: bytes = b"\x01\x00") -> bytes:
    """An array whose header says what its data does not hold."""
    text = header.encode() + b"\n"
    return b"\x93NUMPY" + version + len(text).to_bytes(2, "little") + text + bytes(16)


@pytest.mark.parametrize(
    "content",
    [
        entry("{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000000, 9), }"),
        entry("{'descr': '<f8', 'fortran_order': False, 'shape': (100000000000000000000000, 9), }"),
        entry("(((("),
        entry("{}", b"\x07\x00"),
        b"no array at all",
        b"",
    ],
)
@pytest.mark.parametrize("kind", [zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED])
def test_an_array_that_is_none_is_refused_in_one_line(content: bytes, kind: int) -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", kind) as hostile:
        hostile.writestr("w0.npy", content)
    for bytes_of in (file.getvalue(), file.getvalue().replace(b"w0.npy", b"w0.npz")):
        with pytest.raises(BadInput, match="is no network") as refused:
            read_layers(bytes_of, FILE)
        assert "\n" not in str(refused.value)


@given(st.data())
def test_whatever_is_changed_in_a_file_it_is_read_or_refused(data: st.DataObject) -> None:
    content = bytearray(archive(activation="tanh", **ONE))
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    with contextlib.suppress(BadInput):
        read_layers(bytes(content), FILE)


def refused(node: Any, *constants: Any, gives: Any = TensorProto.DOUBLE) -> str:
    kinds = {"x": TensorProto.DOUBLE, "y": gives}
    x, y = (helper.make_tensor_value_info(name, kind, [1, 2]) for name, kind in kinds.items())
    content = bytes(model_of(helper.make_graph([node], "policy", [x], [y], constants)).SerializeToString())
    with pytest.raises(BadInput) as bad:
        onnx_network(content, Path("a.onnx"))
    return str(bad.value)


ADD = helper.make_node("Add", ["x", "w"], ["y"])


def test_an_onnx_network_whose_weights_are_elsewhere_is_refused() -> None:
    outside = numpy_helper.from_array(np.ones((1, 2)), "w")
    onnx.external_data_helper.set_external_data(outside, location="secret.bin")
    outside.ClearField("raw_data")
    outside.data_location = TensorProto.EXTERNAL
    assert "keeps weights in other files; save it as one file" in refused(ADD, outside)


def test_an_onnx_network_that_gives_no_numbers_is_refused() -> None:
    assert "no finite numbers" in refused(ADD, numpy_helper.from_array(np.full((1, 2), np.nan), "w"))
    cast = helper.make_node("Cast", ["x"], ["y"], to=TensorProto.STRING)
    assert "floating-point numbers" in refused(cast, gives=TensorProto.STRING)


def test_a_small_file_that_would_become_large_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as large:
        large.writestr("w0.npy", bytes(100_000))
    monkeypatch.setattr("agent.learned.network.WEIGHTS", Kind(WEIGHTS.what, 50_000))
    with pytest.raises(BadInput, match="decompressed it is larger"):
        read_layers(file.getvalue(), FILE)


def test_the_first_of_the_best_allowed_actions_is_chosen() -> None:
    outputs = np.array([3.0, 1.0, 2.0, 2.0])
    assert action_of(outputs, np.ones(4, np.int8)) == 0
    assert action_of(outputs, np.array([0, 1, 1, 1], np.int8)) == 2


def test_two_outputs_are_a_place_within_the_window() -> None:
    action = action_of(np.array([0.0, 50.0]), None)
    assert isinstance(action, np.ndarray)
    assert action.tolist() == [0.0, 1.0]


def test_a_network_does_not_get_the_mask() -> None:
    parts: dict[str, Any] = {"pose": np.array([[1.0, 2.0]], np.float32), MASK: np.ones(9, np.int8)}
    assert flattened(parts).tolist() == [1.0, 2.0]
