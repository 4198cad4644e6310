import pytest
from onnx import TensorProto

from llrp_online.architecture import architecture
from llrp_online.graph import PICTURE, PROBABILITIES, build_graph


def shape_of(value):
    return tuple(dimension.dim_value for dimension in value.type.tensor_type.shape.dim)


@pytest.mark.parametrize("preset", ["paper", "online"])
@pytest.mark.parametrize("picture_shape", [(64, 80, 3), (64, 80, 9), (13, 9, 3)])
def test_weights_are_inputs_and_no_constants(preset, picture_shape):
    graph = build_graph(preset, picture_shape, (31, 5)).graph
    inputs = {value.name: shape_of(value) for value in graph.input}
    assert inputs == {
        PICTURE: (1, *picture_shape),
        **architecture(preset, picture_shape[2]).parameters(picture_shape, (31, 5)),
    }
    assert graph.input[0].type.tensor_type.elem_type == TensorProto.UINT8
    assert {value.name: shape_of(value) for value in graph.output} == {PROBABILITIES: (31, 5)}
    assert not {constant.name for constant in graph.initializer} & set(inputs)
