"""A model file is bounded: what it may make of memory, how often it repeats, and that its own bytes are all of it."""

from __future__ import annotations

import resource
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from onnx import GraphProto, ModelProto, NodeProto, TensorProto, helper, numpy_helper

from lfa.agents.following.onnx_bounds import BROKEN, FIELDS_MAX, STRUCTURE_BYTES_MAX, beyond_bounds
from lfa.agents.following.onnx_policy import FIELDS, OUTPUTS, OnnxModel
from lfa.protocol.errors import Refused

ROSE_MIB_MAX = 400
"""Memory [MiB] that no file of any kind may cost: the tensors, and what the runtime makes of a whole structure."""
PRODUCT = helper.make_node("MatMul", ["seen", "weights"], ["twist"])


def _model(*nodes: NodeProto, tensors: tuple[TensorProto, ...] = ()) -> ModelProto:
    """Return the model of a controller that answers zeros, with more `nodes` and `tensors`."""
    weights = numpy_helper.from_array(np.zeros((len(FIELDS), OUTPUTS), np.float32), "weights")
    graph = helper.make_graph(
        [PRODUCT, *nodes],
        "graph",
        [helper.make_tensor_value_info("seen", TensorProto.FLOAT, [1, len(FIELDS)])],
        [helper.make_tensor_value_info("twist", TensorProto.FLOAT, [1, OUTPUTS])],
        [weights, *tensors],
    )
    return helper.make_model(graph, ir_version=10, opset_imports=[helper.make_opsetid("", 17)])


def _outside() -> bytes:
    """Return a model whose weights are in another file."""
    made = _model()
    kept = made.graph.initializer[0]
    kept.ClearField("raw_data")
    kept.data_location = TensorProto.EXTERNAL
    kept.external_data.add(key="location", value="weights.bin")
    return made.SerializeToString()


def _repeated() -> bytes:
    value = helper.make_tensor_value_info
    body = helper.make_graph(
        [helper.make_node("Identity", ["go"], ["goes"])],
        "body",
        [value("n", TensorProto.INT64, []), value("go", TensorProto.BOOL, [])],
        [value("goes", TensorProto.BOOL, [])],
    )
    often = numpy_helper.from_array(np.array(1 << 62, np.int64), "often")
    return _model(helper.make_node("Loop", ["often", ""], [], body=body), tensors=(often,)).SerializeToString()


def _scanned() -> bytes:
    """Return a model that goes through as many zeros as fit into the memory, and for each through as many again."""
    value, zero = helper.make_tensor_value_info, helper.make_tensor("zero", TensorProto.FLOAT, [1], [0.0])

    def scan(start: str, end: str, body: GraphProto) -> list[NodeProto]:
        zeros = helper.make_node("ConstantOfShape", ["shape"], [f"zeros_{end}"], value=zero)
        return [zeros, helper.make_node("Scan", [start, f"zeros_{end}"], [end], num_scan_inputs=1, body=body)]

    def graph(nodes: list[NodeProto], name: str) -> GraphProto:
        inputs = [value(f"{name}_in", TensorProto.FLOAT, [1]), value(f"{name}_n", TensorProto.FLOAT, [])]
        return helper.make_graph(nodes, name, inputs, [value(f"{name}_out", TensorProto.FLOAT, [1])])

    inner = graph([helper.make_node("Neg", ["inner_in"], ["inner_out"])], "inner")
    outer = graph(scan("outer_in", "outer_out", inner), "outer")
    shape = numpy_helper.from_array(np.array([10_000], np.int64), "shape")
    start = numpy_helper.from_array(np.zeros(1, np.float32), "start")
    return _model(*scan("start", "end", outer), tensors=(shape, start)).SerializeToString()


def _doubled() -> bytes:
    """Return a model of functions that each call the one before twice: a million nodes and more without functions."""
    opset, own = helper.make_opsetid("", 17), helper.make_opsetid("own", 1)
    made = _model(helper.make_node("f20", ["seen"], ["other"], domain="own"))
    made.opset_import.append(own)
    made.functions.append(
        helper.make_function("own", "f0", ["x"], ["y"], [helper.make_node("Neg", ["x"], ["y"])], [opset])
    )
    for n in range(1, 21):
        calls = [
            helper.make_node(f"f{n - 1}", ["x"], ["between"], domain="own"),
            helper.make_node(f"f{n - 1}", ["between"], ["y"], domain="own"),
        ]
        made.functions.append(helper.make_function("own", f"f{n}", ["x"], ["y"], calls, [opset, own]))
    return made.SerializeToString()


def _wide() -> bytes:
    """Return a model of a few bytes that fills a gigabyte with zeros."""
    shape = numpy_helper.from_array(np.array([1 << 28], np.int64), "shape")
    return _model(helper.make_node("ConstantOfShape", ["shape"], ["filled"]), tensors=(shape,)).SerializeToString()


def _product_of_vectors() -> bytes:
    column = numpy_helper.from_array(np.ones((1 << 15, 1), np.float32), "column")
    row = numpy_helper.from_array(np.ones((1, 1 << 15), np.float32), "row")
    return _model(helper.make_node("MatMul", ["column", "row"], ["square"]), tensors=(column, row)).SerializeToString()


def _empty_nodes() -> bytes:
    return ModelProto(graph=GraphProto(node=[NodeProto()] * FIELDS_MAX)).SerializeToString()


def _deep() -> bytes:
    graph = GraphProto()
    for _ in range(30):
        graph = helper.make_graph([helper.make_node("If", ["go"], [], then_branch=graph)], "g", [], [])
    return ModelProto(graph=graph).SerializeToString()


def _long_text() -> bytes:
    made = _model()
    made.doc_string = "x" * STRUCTURE_BYTES_MAX
    return made.SerializeToString()


def _sparse() -> bytes:
    made = _model()
    made.graph.sparse_initializer.add(dims=[1 << 40])
    return made.SerializeToString()


@pytest.mark.parametrize(
    ("made", "says"),
    [
        (_outside, "has weights in another file"),
        (_repeated, "may repeat a part without a bound (a node with a graph in it that is no If)"),
        (_scanned, "may repeat a part without a bound (a node with a graph in it that is no If)"),
        (_doubled, "has functions of its own, which may stand for any number of nodes (onnx.inliner takes them out)"),
        (_wide, "needs more than 128 MiB of memory"),
        (_product_of_vectors, "needs more than 128 MiB of memory"),
        (_empty_nodes, f"has more than {FIELDS_MAX} fields beside its weights"),
        (_deep, "has graphs more than 10 deep in each other"),
        (_long_text, f"has more than {STRUCTURE_BYTES_MAX} bytes beside its weights"),
        (_sparse, "has sparse tensors"),
    ],
)
def test_a_model_beyond_its_bounds_is_refused_in_one_line_before_it_takes_memory(
    made: Callable[[], bytes], says: str, tmp_path: Path
) -> None:
    path = tmp_path / "m.onnx"
    path.write_bytes(made())
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(Refused) as refused:
        OnnxModel(path, "--controller m.onnx")
    assert str(refused.value).startswith(f"--controller m.onnx: {says}, must be a model (ONNX)")
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) >> 10 < ROSE_MIB_MAX


def test_a_model_of_16_mib_of_weights_is_within_its_bounds() -> None:
    weights = numpy_helper.from_array(np.zeros(1 << 22, np.float32), "more")
    assert beyond_bounds(_model(tensors=(weights,)).SerializeToString()) == ""


def test_a_choice_between_two_graphs_is_within_its_bounds() -> None:
    one = helper.make_graph([helper.make_node("Identity", ["seen"], ["chosen"])], "one", [], [])
    choice = helper.make_node("If", ["go"], ["end"], then_branch=one, else_branch=one)
    assert beyond_bounds(_model(choice).SerializeToString()) == ""


@pytest.mark.parametrize("end", [b"\x3a", b"\x3a\x05\x0a", b"\x3b", b"\x08" + b"\xff" * 11])
def test_what_is_no_protobuf_is_told_as_such(end: bytes) -> None:
    assert beyond_bounds(_model().SerializeToString() + end) == BROKEN
