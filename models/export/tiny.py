"""Makes the fixtures of tests/network.rs: tiny networks with random weights and what `transformers` makes of them.

    pip install -r models/export/requirements.txt
    python models/export/tiny.py tests/models

Writes segformer.onnx, mask2former.onnx and nan.onnx, and for the first two the library's own post-processed scores at
some pixels (`*.f32`: little-endian, row, column, class) with `expected.json` telling which.
"""

import json
import sys
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper
from transformers import (
    Mask2FormerConfig,
    Mask2FormerForUniversalSegmentation,
    Mask2FormerImageProcessor,
    SegformerConfig,
    SegformerForSemanticSegmentation,
    SegformerImageProcessor,
    SwinConfig,
)

from common import check, export

MEAN = np.array([0.485, 0.456, 0.406], np.float32)
STD = np.array([0.229, 0.224, 0.225], np.float32)
SEGFORMER_SIZE = (160, 96)
MASK2FORMER_SIZE = (512, 512)


def picture(width, height):
    """Slanted stripes of three colours; tests/network.rs draws the same."""
    y, x = np.mgrid[0:height, 0:width]
    bands = [(x * (3 + 2 * c) + y * (7 - 2 * c) + x * y // 64) % 256 for c in range(3)]
    return np.stack(bands, axis=-1).astype(np.uint8)


def pixel_values(width, height):
    scaled = picture(width, height).astype(np.float32) / 255
    return torch.from_numpy(((scaled - MEAN) / STD).transpose(2, 0, 1)[None].copy())


def spread(network, module, name, size, wanted=3.0):
    """Random weights as they come say much the same of every pixel. Widens the last layer until the values of an
    output differ by a few units, so that wrong axes and orders show."""
    with torch.no_grad():
        values = network(pixel_values=pixel_values(*size))[name]
        for weights in module.parameters():
            if weights.dim() > 1:
                weights.mul_(wanted / values.std())


def tiny_segformer():
    torch.manual_seed(1)
    network = SegformerForSemanticSegmentation(
        SegformerConfig(
            depths=[1, 1, 1, 1],
            hidden_sizes=[8, 8, 16, 16],
            num_attention_heads=[1, 1, 2, 2],
            mlp_ratios=[2, 2, 2, 2],
            decoder_hidden_size=16,
            num_labels=150,
        )
    ).eval()
    spread(network, network.decode_head.classifier, "logits", SEGFORMER_SIZE)
    return network


def tiny_mask2former():
    torch.manual_seed(2)
    network = Mask2FormerForUniversalSegmentation(
        Mask2FormerConfig(
            backbone_config=SwinConfig(
                embed_dim=8,
                depths=[1, 1, 1, 1],
                num_heads=[1, 1, 2, 2],
                window_size=4,
                mlp_ratio=2.0,
                out_features=["stage1", "stage2", "stage3", "stage4"],
            ),
            feature_size=32,
            mask_feature_size=32,
            hidden_dim=32,
            encoder_feedforward_dim=16,
            encoder_layers=2,
            decoder_layers=3,
            dim_feedforward=16,
            num_attention_heads=2,
            num_queries=6,
            num_labels=133,
        )
    ).eval()
    spread(network, network.class_predictor, "class_queries_logits", MASK2FORMER_SIZE)
    embedder = network.model.transformer_module.decoder.mask_predictor.mask_embedder
    spread(network, list(embedder.children())[-1], "masks_queries_logits", MASK2FORMER_SIZE)
    return network


def scores(processor, outputs):
    [result] = processor.post_process_semantic_segmentation(outputs, return_segmentation_scores=True)
    return result.segmentation_scores


def write(folder, name, network, names, processor, size, first, step, expected, softmax):
    width, height = size
    path = str(folder / f"{name}.onnx")
    # Tables of positions, computed when the network runs, keep the file small.
    export(network, names, width, height, path, largest_constant=1024)
    check(network, names, width, height, path)
    with torch.no_grad():
        outputs = network(pixel_values=pixel_values(width, height))
        values = scores(processor, outputs)
        if softmax:
            values = values.softmax(dim=0)
    raster = outputs[names[-1]].shape[-2:]
    kept = values[:, first::step, first::step].permute(1, 2, 0).contiguous().numpy()
    top = kept.argmax(axis=-1)
    shares = kept.max(axis=-1) / kept.sum(axis=-1)
    print(f"{name}: {len(np.unique(top))} classes win somewhere, with shares of {shares.min():.2f} to {shares.max():.2f}")
    kept.astype("<f4").tofile(folder / f"{name}.f32")
    expected[name] = {
        "picture": [width, height],
        "raster": [raster[1], raster[0]],
        "kept": [kept.shape[1], kept.shape[0], kept.shape[2]],
    }


def nan(path):
    """A network that divides zero by zero."""
    zero = helper.make_tensor("zero", TensorProto.FLOAT, [1], [0.0])
    nodes = [
        helper.make_node("Mul", ["pixel_values", "zero"], ["nothing"]),
        helper.make_node("Div", ["nothing", "zero"], ["all"]),
        helper.make_node("Slice", ["all", "starts", "ends", "axes"], ["one"]),
        helper.make_node("Expand", ["one", "shape"], ["logits"]),
    ]
    whole = lambda name, values: helper.make_tensor(name, TensorProto.INT64, [len(values)], values)
    graph = helper.make_graph(
        nodes,
        "nan",
        [helper.make_tensor_value_info("pixel_values", TensorProto.FLOAT, [1, 3, 8, 8])],
        [helper.make_tensor_value_info("logits", TensorProto.FLOAT, [1, 150, 8, 8])],
        [zero, whole("starts", [0]), whole("ends", [1]), whole("axes", [1]), whole("shape", [1, 150, 8, 8])],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, path)


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    expected = {}
    # The scores come at the size of the logits, a quarter of the picture.
    write(
        folder, "segformer", tiny_segformer(), ["logits"], SegformerImageProcessor(), SEGFORMER_SIZE, 0, 2, expected, True
    )
    # The scores come at 384 x 384, three pixels for each of a mask of 128 x 128; the middle one of the three is the
    # mask's own pixel, wherever it is taken: here every eighth.
    write(
        folder,
        "mask2former",
        tiny_mask2former(),
        ["class_queries_logits", "masks_queries_logits"],
        Mask2FormerImageProcessor(),
        MASK2FORMER_SIZE,
        1,
        24,
        expected,
        False,
    )
    nan(str(folder / "nan.onnx"))
    (folder / "expected.json").write_text(json.dumps(expected, indent=1) + "\n")


if __name__ == "__main__":
    main()
