"""The network: a U-Net over columns of voxels, and a small head for each voxel."""
import torch
from torch import nn
from torch.nn import functional

from surfaces import SLICES, WINDOW

WIDTHS = [64, 96, 128, 176]


class Block(nn.Module):
    """A depthwise 5x5 convolution and two pointwise ones (Liu et al., ConvNeXt, 2022, with batch norm)."""

    def __init__(self, width: int):
        super().__init__()
        self.spread = nn.Conv2d(width, width, 5, padding=2, groups=width, bias=False)
        self.norm = nn.BatchNorm2d(width)
        self.mix = nn.Sequential(nn.Conv2d(width, 2 * width, 1), nn.ReLU(), nn.Conv2d(2 * width, width, 1))

    def forward(self, x):
        return x + self.mix(self.norm(self.spread(x)))


class Columns(nn.Module):
    def __init__(self, classes: int, widths: list[int] = WIDTHS, hidden: int = 128):
        super().__init__()
        self.stem = nn.Conv2d(2 * SLICES, widths[0], 1)
        self.down = nn.ModuleList(nn.Sequential(Block(width), Block(width)) for width in widths)
        self.shrink = nn.ModuleList(nn.Conv2d(a, b, 2, stride=2) for a, b in zip(widths, widths[1:]))
        self.grow = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in zip(widths, widths[1:]))
        self.up = nn.ModuleList(Block(width) for width in widths[:-1])
        self.slices = nn.Embedding(SLICES, 16)
        inputs = widths[0] + 16 + 2 * (2 * WINDOW + 1)
        self.head = nn.Sequential(nn.Linear(inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(),
                                  nn.Linear(hidden, classes))
        # Divides the logits; fitted after training.
        self.register_buffer("temperature", torch.ones(()))

    def forward(self, grid, column, slice_, window):
        """grid (B, 2 * SLICES, H, W); column indexes B * H * W; returns logits (N, classes)."""
        x, skipped = self.stem(grid), []
        for level, blocks in enumerate(self.down):
            x = blocks(x)
            if level < len(self.shrink):
                skipped.append(x)
                x = self.shrink[level](x)
        for level in reversed(range(len(self.grow))):
            x = functional.interpolate(self.grow[level](x), scale_factor=2.0, mode="nearest")
            x = self.up[level](x + skipped[level])
        features = x.permute(0, 2, 3, 1).reshape(-1, x.shape[1])[column]
        return self.head(torch.cat([features, self.slices(slice_), window], dim=1)) / self.temperature
