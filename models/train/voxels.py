"""Voxels of surfaces and the columns that hold them, as the network reads them; in batches, on any device."""
import numpy as np
import torch

from surfaces import AROUND, CELL_M, LOW_M, PLANES, SLICES, STRIDE, UNKNOWN, WINDOW, boxes

# What a sample has of each point.
POINTS = ("xyz", "normal", "label", "box")
# More than there are classes.
LABELS = 64


def points_of(surface: dict) -> dict:
    """What the network learns from a surface: its points with normals, labels and the boxes of their objects."""
    box = boxes(surface, surface["instance"], surface["xyz"])
    parts = {"xyz": surface["xyz"], "normal": surface["normal"], "label": surface["label"], "box": box}
    kinds = {"xyz": np.float32, "normal": np.float32, "label": np.uint8, "box": np.float32}
    return {name: torch.from_numpy(np.ascontiguousarray(part, kinds[name])) for name, part in parts.items()}


def cropped(surface: dict, crop: int, random: np.random.Generator) -> dict:
    """The points in a square of `crop` voxels that holds some of the surface; positions are from its corner."""
    xyz = surface["xyz"]
    corner = xyz[random.integers(len(xyz)), :2] - random.integers(0, crop, 2).astype(np.float32) * np.float32(CELL_M)
    at = xyz[:, :2] - corner
    kept = ((at >= 0) & (at < crop * CELL_M)).all(axis=1)
    kept &= (xyz[:, 2] >= LOW_M) & (xyz[:, 2] < LOW_M + SLICES * CELL_M)
    part = {name: surface[name][kept] for name in ("normal", "label", "instance")}
    objects = surface["objects"].copy()
    objects["centre"][:, :2] -= corner
    return points_of({**part, "xyz": np.concatenate([at[kept], xyz[kept, 2:]], axis=1), "objects": objects})


def whole(surface: dict) -> tuple[dict, tuple[int, int]]:
    """All points of a surface from its corner, and the rows and columns of its grid."""
    low = np.floor(surface["xyz"][:, :2].min(axis=0) / CELL_M).astype(np.int64)
    side = np.floor(surface["xyz"][:, :2].max(axis=0) / CELL_M).astype(np.int64) - low
    points = points_of(surface)
    points["xyz"][:, :2] -= torch.from_numpy((low * CELL_M).astype(np.float32))
    size = [int(-(-(cells + 1) // STRIDE) * STRIDE) for cells in side[::-1]]
    return points, (size[0], size[1])


def joined(parts: list[dict], device: torch.device) -> dict:
    """The points of several surfaces; `of` is the surface of each."""
    of = torch.repeat_interleave(torch.arange(len(parts)), torch.tensor([len(part["label"]) for part in parts]))
    return {"of": of.to(device), **{name: torch.cat([part[name].to(device) for part in parts]) for name in POINTS}}


def varied(points: dict, count: int, crop: int, random: torch.Generator) -> dict:
    """Each of `count` crops mirrored, turned by right angles, moved within a voxel, and thinner."""
    device = points["xyz"].device
    draw = lambda *shape: torch.rand(shape, generator=random, device=device)
    angle = (draw(count) * 4).floor() * (torch.pi / 2)
    cos, sin = angle.cos().round(), angle.sin().round()
    mirror = torch.where(draw(count) < 0.5, -1.0, 1.0)
    turn = torch.stack([cos * mirror, -sin, sin * mirror, cos], 1).reshape(count, 2, 2)
    of = points["of"]
    kept = draw(len(of)) < (0.5 + 0.5 * draw(count))[of]
    of, turn = of[kept], turn[of[kept]]
    moved = {name: part[kept] for name, part in points.items()}
    turned = lambda xy: torch.einsum("nij,nj->ni", turn, xy)
    half = crop * CELL_M / 2
    shift = (torch.cat([draw(count, 2) - 0.5, torch.zeros(count, 1, device=device)], 1) * CELL_M)[of]
    xyz, box = moved["xyz"], moved["box"]
    moved["xyz"] = torch.cat([turned(xyz[:, :2] - half) + half, xyz[:, 2:]], 1) + shift
    moved["normal"] = torch.cat([turned(moved["normal"][:, :2]), moved["normal"][:, 2:]], 1)
    size = torch.einsum("nij,nj->ni", turn.abs(), box[:, 3:5])
    moved["box"] = torch.cat([turned(box[:, :2]), box[:, 2:3], size, box[:, 5:]], 1)
    return moved


def most_frequent(of: torch.Tensor, label: torch.Tensor, count: int) -> torch.Tensor:
    """The label with the most points in each voxel, the larger of two; `UNKNOWN` for voxels without any."""
    known = label != UNKNOWN
    pairs, votes = torch.unique(of[known] * LABELS + label[known], return_counts=True)
    best = torch.full((count,), -1, device=of.device)
    best.scatter_reduce_(0, pairs // LABELS, votes * LABELS + pairs % LABELS, "amax")
    return torch.where(best >= 0, best % LABELS, UNKNOWN)


def columns(points: dict, count: int, size: tuple[int, int]) -> tuple:
    """The network's inputs for `count` surfaces in grids of `size` rows and columns, then labels and boxes of the voxels.

    `own` has for each voxel the slices below and above in its column, occupied and the normal's z; those around it below,
    at and above it, occupied; its normal's x and y, and those of the columns beside it (VOXEL_NUMBERS).
    """
    height, width = size
    xyz, device = points["xyz"], points["xyz"].device
    x, y, z = torch.floor((xyz - xyz.new_tensor([0, 0, LOW_M])) / CELL_M).long().T
    kept = (z >= 0) & (z < SLICES) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
    key = (((points["of"] * SLICES + z) * height + y) * width + x)[kept]
    normal, label, box = (points[name][kept] for name in ("normal", "label", "box"))
    label = label.long()
    voxels, of = torch.unique(key, return_inverse=True)
    total = len(voxels)
    mean = normal.new_zeros(total, 3).index_add_(0, of, normal) / torch.bincount(of, minlength=total)[:, None]
    most = most_frequent(of, label, total)
    told = torch.nonzero((label == most[of]) & ~box.isnan().any(1))[:, 0]
    first = torch.full((total,), len(of), device=device).scatter_reduce_(0, of[told], told, "amin")
    box = torch.cat([box, box.new_full((1, 6), torch.nan)])[first]
    x, y, z = voxels % width, voxels // width % height, voxels // (height * width) % SLICES
    sample = voxels // (SLICES * height * width)

    # Channels last, as convolutions are fastest in.
    grid = xyz.new_zeros(count, height, width, PLANES)
    # With a border, so that every neighbour is in them.
    high = SLICES + 2 * WINDOW
    occupied, up = (xyz.new_zeros(count, high, height + 2, width + 2) for _ in range(2))
    level = xyz.new_zeros(count, SLICES, height + 2, width + 2)
    grid[sample, y, x, z] = 1
    occupied[sample, z + WINDOW, y + 1, x + 1] = 1
    grid[sample, y, x, SLICES + z] = mean[:, 2]
    up[sample, z + WINDOW, y + 1, x + 1] = mean[:, 2]
    for part in range(2):
        plane = part * SLICES // 2 + z // 2
        grid.index_put_((sample, y, x, 2 * SLICES + plane), mean[:, part] / 2, accumulate=True)
        level.index_put_((sample, plane, y + 1, x + 1), mean[:, part] / 2, accumulate=True)
    row, layer = width + 2, (width + 2) * (height + 2)
    here = (sample * high + z + WINDOW) * layer + (y + 1) * row + x + 1
    reach = (torch.arange(2 * WINDOW + 1, device=device) - WINDOW) * layer
    near = torch.tensor([z * layer + y * row + x for y, x in AROUND for z in (-1, 0, 1)], device=device)
    below = (sample * SLICES + z // 2) * layer + (y + 1) * row + x + 1
    parts = torch.tensor([part * (SLICES // 2) * layer + y * row + x for y, x in AROUND for part in range(2)], device=device)
    at = lambda volume, base, offsets: volume.reshape(-1)[base[:, None] + offsets]
    own = torch.cat([at(occupied, here, reach), at(up, here, reach), at(occupied, here, near), mean[:, :2],
                     at(level, below, parts)], 1)
    column = (sample * (height // 2) + y // 2) * (width // 2) + x // 2
    return grid.permute(0, 3, 1, 2), column, z * 4 + y % 2 * 2 + x % 2, own, most, box
