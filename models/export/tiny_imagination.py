"""Makes the small networks by which tests/imagination.rs tries what surrounds a network, without weights.

    pip install -r models/export/requirements.txt
    python models/export/tiny_imagination.py tests/models

    negative.onnx       inpainting: the picture's colours from the other end, also outside the hole
    narrow.onnx         the same, without the picture's last column
    red.onnx            depth: the red of the picture, for pictures of any size
    nan_depth.onnx      depth: the logarithm of less than nothing
    nan_unet.onnx       the unet of stable_diffusion/, which says nothing but the logarithm of less than nothing
"""

import sys
from pathlib import Path

import onnx
from onnx import TensorProto, helper


def save(path, inputs, outputs, nodes, constants):
    made = [
        helper.make_tensor(name, kind, [len(values)], values)
        for name, (kind, values) in constants.items()
    ]
    value = lambda name, kind, shape: helper.make_tensor_value_info(name, kind, shape)
    graph = helper.make_graph(
        [helper.make_node(kind, taken, [given], **settings) for kind, taken, given, settings in nodes],
        path.stem,
        [value(*told) for told in inputs],
        [value(*told) for told in outputs],
        made,
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, str(path))


def main():
    folder = Path(sys.argv[1])
    byte, number, whole = TensorProto.UINT8, TensorProto.FLOAT, TensorProto.INT64
    both = [("image", byte, [1, 3, "h", "w"]), ("mask", byte, [1, 1, "h", "w"])]
    picture = [("image", number, [1, 3, "h", "w"])]
    negative = [
        ("Cast", ["image"], "colours", {"to": number}),
        ("Cast", ["mask"], "kept", {"to": number}),
        # So that the mask is part of the network.
        ("Mul", ["kept", "zero"], "nothing", {}),
        ("Add", ["colours", "nothing"], "same", {}),
        ("Sub", ["white", "same"], "other", {}),
    ]
    constants = {"zero": (number, [0.0]), "white": (number, [255.0])}
    cut = {"from": (whole, [0]), "to": (whole, [-1]), "axis": (whole, [3])}
    save(
        folder / "negative.onnx",
        both,
        [("result", byte, [1, 3, "h", "w"])],
        [*negative, ("Cast", ["other"], "result", {"to": byte})],
        constants,
    )
    save(
        folder / "narrow.onnx",
        both,
        [("result", byte, [1, 3, "h", "v"])],
        [
            *negative,
            ("Slice", ["other", "from", "to", "axis"], "part", {}),
            ("Cast", ["part"], "result", {"to": byte}),
        ],
        {**constants, **cut},
    )
    red = {"from": (whole, [0]), "to": (whole, [1]), "axis": (whole, [1])}
    first = ("Slice", ["image", "from", "to", "axis"])
    save(folder / "red.onnx", picture, [("depth", number, [1, 1, "h", "w"])], [(*first, "depth", {})], red)
    below = {"minus": (number, [-1.0])}
    nan = [("Abs", ["part"], "size", {}), ("Sub", ["minus", "size"], "less", {})]
    save(
        folder / "nan_depth.onnx",
        picture,
        [("depth", number, [1, 1, "h", "w"])],
        [(*first, "part", {}), *nan, ("Log", ["less"], "depth", {})],
        {**red, **below},
    )
    save(
        folder / "nan_unet.onnx",
        [("sample", number, [1, 9, 8, 8]), ("timestep", number, [1]), ("prompt_embeds", number, [1, 77, 16])],
        [("prediction", number, [1, 4, 8, 8])],
        [
            ("Slice", ["sample", "from", "four", "axis"], "latents", {}),
            ("ReduceSum", ["prompt_embeds"], "words", {"keepdims": 0}),
            ("Add", ["latents", "words"], "more", {}),
            ("Add", ["more", "timestep"], "part", {}),
            *nan,
            ("Log", ["less"], "prediction", {}),
        ],
        {"from": (whole, [0]), "four": (whole, [4]), "axis": (whole, [1]), **below},
    )


if __name__ == "__main__":
    main()
