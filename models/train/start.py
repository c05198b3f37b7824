"""Weights of an exported network, to start another training with."""
from pathlib import Path

import onnx
import torch
from onnx import numpy_helper

from network import Columns


def read_weights(network: Columns, path: Path) -> None:
    """Sets the weights from an ONNX file that `train.py` exported. The answers in evaluation mode are those of the file.

    The export folds each batch norm into the convolution before it; the norms become the identity plus the folded bias.
    `calibrate_norms` must follow before training.
    """
    graph = onnx.load(str(path)).graph
    values = {i.name: torch.from_numpy(numpy_helper.to_array(i).copy()) for i in graph.initializer}
    state = network.state_dict()
    for name in state:
        if name in values:
            state[name] = widened(values[name], state[name])
    for node in graph.node:
        if node.op_type == "Conv" and node.name.endswith("/spread/Conv"):
            # "/down.0/down.0.1/spread/Conv" and "/up.1/spread/Conv".
            block = node.name.removesuffix("/spread/Conv").split("/")[-1]
            state[f"{block}.spread.weight"] = values[node.input[1]]
            state[f"{block}.norm.bias"] = values[node.input[2]]
            state[f"{block}.norm.weight"] = torch.ones_like(values[node.input[2]])
            state[f"{block}.norm.running_mean"] = torch.zeros_like(values[node.input[2]])
            state[f"{block}.norm.running_var"] = torch.ones_like(values[node.input[2]]) - network.get_submodule(block).norm.eps
    network.load_state_dict(state)


def widened(values: torch.Tensor, like: torch.Tensor) -> torch.Tensor:
    """Inputs that the file's network did not have begin with the weight 0. They come after the others."""
    if values.shape == like.shape:
        return values
    wide = torch.zeros_like(like)
    wide[:, :values.shape[1]] = values
    return wide


@torch.no_grad()
def calibrate_norms(network: Columns, batches: list[tuple]) -> None:
    """Sets the statistics of each batch norm to those of the batches, without a change of the answers in evaluation mode."""
    norms = [module for module in network.modules() if isinstance(module, torch.nn.BatchNorm2d)]
    sums = {norm: [0, torch.zeros_like(norm.bias), torch.zeros_like(norm.bias)] for norm in norms}

    def add(norm, inputs, _):
        total = sums[norm]
        flat = inputs[0].transpose(0, 1).flatten(1)
        total[0], total[1], total[2] = total[0] + flat.shape[1], total[1] + flat.sum(1), total[2] + flat.square().sum(1)

    hooks = [norm.register_forward_hook(add) for norm in norms]
    network.eval()
    for inputs in batches:
        network(*inputs)
    for hook in hooks:
        hook.remove()
    for norm, (count, total, squares) in sums.items():
        mean = total / count
        variance = squares / count - mean.square()
        scale = norm.weight / (norm.running_var + norm.eps).sqrt()
        norm.bias += scale * (mean - norm.running_mean)
        norm.weight.copy_(scale * (variance + norm.eps).sqrt())
        norm.running_mean.copy_(mean)
        norm.running_var.copy_(variance)
