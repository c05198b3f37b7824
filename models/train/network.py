"""The network: a U-Net over columns of voxels, and a small head for each voxel."""
import torch
from torch import nn
from torch.nn import functional

from surfaces import PLANES, SLICES, VOXEL_NUMBERS

WIDTHS = [96, 128, 176, 192]
DEPTHS = [2, 2, 1, 1]


class Block(nn.Module):
    """A depthwise 5x5 convolution and two pointwise ones (Liu et al., ConvNeXt, 2022, with batch norm)."""

    def __init__(self, width: int):
        super().__init__()
        self.spread = nn.Conv2d(width, width, 5, padding=2, groups=width, bias=False)
        self.norm = nn.BatchNorm2d(width)
        self.mix = nn.Sequential(nn.Conv2d(width, 2 * width, 1), nn.ReLU(), nn.Conv2d(2 * width, width, 1))

    def forward(self, x):
        # On processors the gradient of this convolution takes six times as long with bf16.
        with torch.autocast(x.device.type, enabled=x.is_cuda and torch.is_autocast_enabled("cuda")):
            spread = self.spread(x if x.is_cuda else x.float())
        return x + self.mix(self.norm(spread))


class Columns(nn.Module):
    def __init__(self, classes: int, widths: list[int] = WIDTHS, depths: list[int] = DEPTHS, hidden: int = 96):
        super().__init__()
        # From 5 cm to 10 cm.
        self.stem = nn.Conv2d(PLANES, widths[0], 2, stride=2)
        self.down = nn.ModuleList(nn.Sequential(*(Block(width) for _ in range(depth)))
                                  for width, depth in zip(widths, depths))
        self.shrink = nn.ModuleList(nn.Sequential(nn.AvgPool2d(2), nn.Conv2d(a, b, 1))
                                    for a, b in zip(widths, widths[1:]))
        self.grow = nn.ModuleList(nn.Conv2d(b, a, 1) for a, b in zip(widths, widths[1:]))
        self.up = nn.ModuleList(Block(width) for width in widths[:-1])
        self.place = nn.Embedding(4 * SLICES, 16)
        inputs = widths[0] + 16 + VOXEL_NUMBERS
        self.head = nn.Sequential(nn.Linear(inputs, hidden), nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU())
        self.classes = nn.Linear(hidden, classes)
        self.box = nn.Linear(hidden, 6)
        # Divides the logits after the bias is added; both are fitted after training.
        self.register_buffer("temperature", torch.ones(()))
        self.register_buffer("bias", torch.zeros(classes))

    def forward(self, grid, column, place, own):
        """grid (B, PLANES, H, W); column indexes the B * H / 2 * W / 2 columns of 10 cm, and place is a voxel's
        slice and quarter in its column. Returns logits (N, classes) and boxes (N, 6): from the voxel to the centre of
        its object and the object's size, in metres along the grid's axes."""
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
        features = self.head(torch.cat([features, self.place(place), own], dim=1))
        return (self.classes(features) + self.bias) / self.temperature, self.box(features)
