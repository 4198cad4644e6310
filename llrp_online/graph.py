"""The network as an ONNX graph: picture in, probabilities out, and the weights as inputs beside the picture.

With the weights as inputs, one inference session serves every version of them. Standardisation is inside the graph, so
that what is inferred is what was trained; the blocks are those of `llrp_online.architecture`.
"""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from llrp_online.architecture import DEVIATION_FLOOR, Block, Outputs, PictureShape, Preset, architecture
from llrp_online.mirror import Mirror

PICTURE = "picture"
PROBABILITIES = "probabilities"

# The newest pair that every supported ONNX Runtime (1.22 on) reads.
_OPSET = 18
_IR_VERSION = 10


def build_graph(
    preset: Preset, picture_shape: PictureShape, outputs: Outputs, mirror: Mirror | None = None
) -> onnx.ModelProto:
    """The graph of a preset, checked.

    Inputs: `picture` (1, H, W, C) uint8, and each parameter by its name, float32.
    Output: `probabilities` (T, S) float32; with `mirror`, of the mean of the logits of the picture and of its mirror
    image, seen back in the mirror.

    >>> [node.name for node in build_graph("paper", (64, 80, 3), (31, 5)).graph.input][:2]
    ['picture', 'convolutions.0.weight']
    """
    plan = architecture(preset, picture_shape[2])
    nodes = [] if mirror is None else _both_ways("both")
    nodes += _standardisation(PICTURE if mirror is None else "both", "standardised")
    features = "standardised"
    for index, block in enumerate(plan.blocks):
        nodes += _block(block, f"convolutions.{index}", features, f"block.{index}")
        features = f"block.{index}"
    nodes += [
        helper.make_node("Flatten", [features], ["features"], axis=1),
        helper.make_node("Gemm", ["features", "dense.weight", "dense.bias"], ["dense"], transB=1),
        helper.make_node("Relu", ["dense"], ["dense.active"]),
        helper.make_node("Gemm", ["dense.active", "outputs.weight", "outputs.bias"], ["flat"], transB=1),
        helper.make_node("Reshape", ["flat", "label_shape"], ["each"]),
        *([helper.make_node("Squeeze", ["each", "batch"], ["logits"])] if mirror is None else _mean("each", "logits")),
        helper.make_node("Sigmoid", ["logits"], [PROBABILITIES]),
    ]
    weights = [
        helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
        for name, shape in plan.parameters(picture_shape, outputs).items()
    ]
    graph = helper.make_graph(
        nodes,
        f"llrp_{preset}",
        [helper.make_tensor_value_info(PICTURE, TensorProto.UINT8, (1, *picture_shape)), *weights],
        [helper.make_tensor_value_info(PROBABILITIES, TensorProto.FLOAT, outputs)],
        [
            helper.make_tensor("every_axis", TensorProto.INT64, [3], [1, 2, 3]),
            helper.make_tensor("deviation_floor", TensorProto.FLOAT, [], [DEVIATION_FLOOR]),
            helper.make_tensor("label_shape", TensorProto.INT64, [3], [-1, *outputs]),
            *([numpy_helper.from_array(np.zeros(1, np.int64), "batch")] if mirror is None else _constants(mirror)),
        ],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", _OPSET)], ir_version=_IR_VERSION)
    onnx.checker.check_model(model, full_check=True)
    return model


def _both_ways(output: str) -> list[onnx.NodeProto]:
    """The picture, and after it its mirror image."""
    return [
        helper.make_node("Slice", [PICTURE, "last", "before_first", "columns", "backwards"], ["flipped"]),
        helper.make_node("Gather", ["flipped", "channels"], ["mirrored"], axis=3),
        helper.make_node("Concat", [PICTURE, "mirrored"], [output], axis=0),
    ]


def _mean(each: str, output: str) -> list[onnx.NodeProto]:
    """Of what the picture says and what its mirror image says, targets and sensors put back in their places."""
    return [
        helper.make_node("Gather", [each, "first"], ["straight"], axis=0),
        helper.make_node("Gather", [each, "second"], ["reflected"], axis=0),
        helper.make_node("Gather", ["reflected", "targets"], ["reflected.targets"], axis=0),
        helper.make_node("Gather", ["reflected.targets", "sensors"], ["put_back"], axis=1),
        helper.make_node("Mean", ["straight", "put_back"], [output]),
    ]


def _constants(mirror: Mirror) -> list[onnx.TensorProto]:
    told = {
        "last": [-1],
        "before_first": [np.iinfo(np.int64).min],
        "columns": [2],
        "backwards": [-1],
        "channels": mirror.channels,
        "targets": mirror.targets,
        "sensors": mirror.sensors,
        "first": 0,
        "second": 1,
    }
    return [numpy_helper.from_array(np.array(value, np.int64), name) for name, value in told.items()]


def _standardisation(pictures: str, output: str) -> list[onnx.NodeProto]:
    """Each picture minus its mean over its deviation, channels first; see `network.standardise`."""
    return [
        helper.make_node("Transpose", [pictures], ["channels_first"], perm=[0, 3, 1, 2]),
        helper.make_node("Cast", ["channels_first"], ["levels"], to=TensorProto.FLOAT),
        helper.make_node("ReduceMean", ["levels", "every_axis"], ["mean"]),
        helper.make_node("Sub", ["levels", "mean"], ["centred"]),
        helper.make_node("Mul", ["centred", "centred"], ["squared"]),
        helper.make_node("ReduceMean", ["squared", "every_axis"], ["variance"]),
        helper.make_node("Sqrt", ["variance"], ["deviation"]),
        helper.make_node("Max", ["deviation", "deviation_floor"], ["divisor"]),
        helper.make_node("Div", ["centred", "divisor"], [output]),
    ]


def _block(block: Block, parameters: str, features: str, output: str) -> list[onnx.NodeProto]:
    weight, bias = f"{parameters}.weight", f"{parameters}.bias"
    kernel, stride, pads = [block.kernel] * 2, [block.stride] * 2, [block.padding] * 4
    return [
        helper.make_node(
            "Conv", [features, weight, bias], [f"{output}.sum"], kernel_shape=kernel, strides=stride, pads=pads
        ),
        helper.make_node(
            "MaxPool", [f"{output}.sum"], [f"{output}.pool"], kernel_shape=[2, 2], strides=[2, 2], ceil_mode=1
        ),
        helper.make_node("Relu", [f"{output}.pool"], [output]),
    ]
