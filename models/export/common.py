"""What the export scripts share: a network with a fixed input size as one ONNX file that both runtimes take."""

import argparse
import warnings
from pathlib import Path

import numpy as np
import onnx
import onnx_ir
import torch
from onnxscript import optimizer

OPSET = 18
# Bytes of weights that go into the ONNX file itself; the format ends at 2 GiB.
LARGEST_FILE = 3 << 29


class Outputs(torch.nn.Module):
    """A network that takes pixel values and gives only the named outputs, in their order."""

    def __init__(self, network, names):
        super().__init__()
        self.network = network
        self.names = names

    def forward(self, pixel_values):
        outputs = self.network(pixel_values=pixel_values)
        return tuple(getattr(outputs, name) for name in self.names)


def export(network, names, width, height, path, largest_constant=1 << 22):
    """Writes `network` for pictures of one size. Free sizes would leave shape arithmetic in the graph, which costs
    time at every run and is where runtimes disagree. What does not depend on the picture is computed here, unless
    the result has more than `largest_constant` numbers."""
    # The fused attention of torch does not pass its exporter.
    network.set_attn_implementation("eager")
    wrapped = Outputs(network.eval(), names)
    write(wrapped, {"pixel_values": torch.zeros(1, 3, height, width)}, names, path, largest_constant)


def write(module, examples, names, path, largest_constant=1 << 22):
    """Writes a module whose inputs are as the examples, by name and in their order, to one ONNX file; where the
    weights are too many for one, they go into a file beside it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            module.eval(),
            tuple(examples.values()),
            input_names=list(examples),
            output_names=list(names),
            opset_version=OPSET,
            dynamo=True,
            optimize=False,
        )
    optimizer.optimize(program.model, output_size_limit=largest_constant)
    weights = sum(tensor.numel() * tensor.element_size() for tensor in module.parameters())
    if weights > LARGEST_FILE:
        onnx_ir.save(program.model, path, external_data=Path(path).name + ".data")
        onnx.checker.check_model(path, full_check=True)
        return
    model = program.model_proto
    strip(model)
    onnx.checker.check_model(model, full_check=True)
    onnx.save(model, path)


def strip(model):
    """Takes away what only a debugger of the exporter reads: it can be larger than the weights."""
    del model.metadata_props[:]
    del model.graph.metadata_props[:]
    del model.graph.value_info[:]
    model.doc_string = ""
    for node in model.graph.node:
        del node.metadata_props[:]
        node.doc_string = ""
    for value in [*model.graph.input, *model.graph.output, *model.graph.initializer]:
        if hasattr(value, "metadata_props"):
            del value.metadata_props[:]
        value.doc_string = ""


def check(network, names, width, height, path):
    """Compares the file under ONNX Runtime with the network itself, on noise."""
    noise = np.random.default_rng(1).normal(size=(1, 3, height, width)).astype(np.float32)
    compare(Outputs(network.eval(), names), {"pixel_values": torch.from_numpy(noise)}, names, path)


def compare(module, inputs, names, path):
    """Compares a file under ONNX Runtime with the module that it was made of."""
    import onnxruntime

    with torch.no_grad():
        wanted = module(*inputs.values())
    wanted = wanted if isinstance(wanted, tuple) else (wanted,)
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    got = session.run(list(names), {name: value.numpy() for name, value in inputs.items()})
    for name, a, b in zip(names, wanted, got):
        worst = float(np.abs(a.numpy() - b).max())
        size = float(np.abs(a.numpy()).max())
        print(f"{name}: largest difference {worst:.2e} of values up to {size:.3g}")
        if worst > 1e-3 * max(size, 1.0):
            raise SystemExit(f"{path}: the exported network differs from the original")


def side(text):
    """A side of the input: both families halve it five times."""
    pixels = int(text)
    if pixels < 32 or pixels % 32 != 0:
        raise argparse.ArgumentTypeError("must be a multiple of 32")
    return pixels
