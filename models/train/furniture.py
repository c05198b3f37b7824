"""Makes meshes of furniture for `viola surfaces --furniture` from libraries of Sweet Home 3D.

    apt-get download sweethome3d-furniture && dpkg -x sweethome3d-furniture_*.deb library
    python furniture.py --libraries library/usr/share/sweethome3d/furniture --out furniture

A mesh is a PLY file CLASS-LIBRARY-NUMBER.ply in metres: x along the width, the back at +y, z up, the floor at z = 0. Each fifth model
of a class is written to `held-out`, the others to `train`.
"""
import argparse
import re
import zipfile
from pathlib import Path

import fast_simplification
import numpy as np
import trimesh

# Triangles of a mesh; voxels of 5 cm do not show more.
TRIANGLES = 2000
# Classes by the library's category and name, the first that matches. Models of several things at once are left out.
CLASSES = [
    ("bed", "Bedroom", r"(baby |bunk |captain's |child |hospital |iron |mezzanine |day |corner bunk |loft )?bed.*|crib|opened convertible sofa.*"),
    ("sofa", "Living room|Bedroom", r".*(sofa|couch).*"),
    ("chair", "Living room|Office|Kitchen|Exterior", r".*(chair|armchair|stool|seat|puff)\b.*|bench|piano bench|armchair ottoman"),
    ("desk", "Office|Bedroom", r"(wooden )?desk.*|dressing table"),
    ("table", "Living room|Office|Exterior", r".*table( .*)?"),
    ("cabinet", "Bedroom", r"wardrobe|cupboard|chest|bedside table|changing table"),
    ("cabinet", "Living room", r"dresser.*|glass door cabinet|television cabinet|tv (stand|unit)"),
    ("cabinet", "Office|Miscellaneous", r"filing cabinet|locked locker|safe"),
    ("cabinet", "Kitchen", r"(drawers|high|lower|small lower|kitchen|glass door) cabinet|island"),
    ("shelf", "Living room|Bedroom|Office", r"(full |filled )?bookcase|(vertical )?shelves"),
    ("refrigerator", "Kitchen", r".*(fridge|refrigerator).*"),
    ("stove", "Kitchen", r"cooker|large stove|double oven"),
    ("washing_machine", "Kitchen", r".*(wash|dryer).*"),
    ("television", "Living room", r"(flat |wall flat )?tv( 16:9)?"),
    ("lamp", "Lights", r"lamp|floor uplight|little lamp"),
    ("radiator", "Miscellaneous|Bathroom", r".*radiator"),
    ("toilet", "Bathroom", r"toilets? unit"),
    ("sink", "Bathroom", r"washbasin.*|vanity"),
    ("bathtub", "Bathroom", r"(fitted |island |corner )?bath(tub)?"),
    ("shower", "Bathroom", r"shower( stall)?"),
    ("curtain", "Miscellaneous|Bathroom", r".*curtains?"),
    ("plant", "Living room", r".*(plant|ficus|yucca|tree|lily|spathiphyllum|tulips|flowers|orchids|bamboo).*"),
    ("clothes", "Bedroom", r"clothes rack|hanging clothes"),
    ("box", "Miscellaneous|Kitchen|Bathroom", r"(open )?(cardboard )?box|crate|trunck|clothes basket|shopping basket"),
    ("other", "Miscellaneous|Kitchen|Office|Living room|Bedroom|Vehicles",
     r"suitcase|backpack|.*speaker|.*fan|dustbin|trash can|bullet trash can|recycling bin|water cooler|step ladder|clothes horse|.*piano|.*guitar"
     r"|broom|doll house|rocking horse|teddy bear|stroller|vase|aquarium|barrel|gift|basketball|bicycle|bike|indoor bike|punching ball|scooter"),
    ("person", "Characters", r".*(male|female|boy|girl)"),
    ("animal", "Characters", r".*(dog|cat)"),
]
# Smallest and largest height of a class in metres, where the names are ambiguous.
HEIGHTS = {"chair": (0.35, 1.35), "table": (0.3, 1.1), "lamp": (1.2, 2.2), "bed": (0.25, 2.1), "box": (0.1, 0.8), "plant": (0.3, 2.2),
           "cabinet": (0.3, 2.5), "curtain": (1.0, 2.6), "bathtub": (0.4, 1.2)}


def catalogue(library: zipfile.ZipFile) -> dict:
    text = re.sub(r"\\\r?\n\s*", "", library.read("PluginFurnitureCatalog.properties").decode("latin-1"))
    pairs = (line.split("=", 1) for line in text.splitlines() if "=" in line and line[0] not in "#!")
    entries = {}
    for key, value in pairs:
        name, _, number = key.strip().partition("#")
        entries.setdefault(number, {})[name] = value.strip()
    return {number: entry for number, entry in entries.items() if {"name", "category", "model"} <= entry.keys()}


def class_of(entry: dict) -> str | None:
    name = entry["name"].lower()
    for label, categories, pattern in CLASSES:
        if re.fullmatch(categories, entry["category"]) and re.fullmatch(pattern, name):
            low, high = HEIGHTS.get(label, (0.1, 2.6))
            return label if low <= float(entry["height"]) / 100 <= high else None
    return None


def read_obj(text: str) -> tuple[np.ndarray, np.ndarray]:
    """Returns vertices and triangles; polygons become fans."""
    vertices, faces = [], []
    for line in re.sub(r"\\\r?\n", " ", text).splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            vertices.append([float(word) for word in words[1:4]])
        elif words[:1] == ["f"]:
            corners = [int(word.split("/")[0]) for word in words[1:]]
            corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
            faces.extend([corners[0], b, c] for b, c in zip(corners[1:], corners[2:]))
    return np.array(vertices, float), np.array(faces, int)


def mesh_of(library: zipfile.ZipFile, entry: dict) -> trimesh.Trimesh | None:
    path = entry["model"].lstrip("/")
    if path not in library.namelist():
        return None
    vertices, faces = read_obj(library.read(path).decode("latin-1"))
    if len(faces) == 0:
        return None
    used, places = np.unique(faces, return_inverse=True)
    vertices = vertices[used]
    faces = places.reshape(-1, 3)
    if "modelRotation" in entry:
        vertices = vertices @ np.array(entry["modelRotation"].split(), float).reshape(3, 3).T
    # The library's y is up, and its z points to the front.
    vertices = np.stack([vertices[:, 0], -vertices[:, 2], vertices[:, 1]], axis=1)
    low, high = vertices.min(0), vertices.max(0)
    size = np.array([float(entry[key]) / 100 for key in ("width", "depth", "height")])
    vertices = (vertices - (low + high) / 2) / np.maximum(high - low, 1e-9) * size + [0, 0, size[2] / 2]
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    mesh.merge_vertices(digits_vertex=4)
    mesh.update_faces(mesh.nondegenerate_faces() & mesh.unique_faces())
    if len(mesh.faces) > TRIANGLES:
        points, triangles = fast_simplification.simplify(
            np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.int32), target_count=TRIANGLES, agg=5)
        mesh = trimesh.Trimesh(points, triangles, process=False)
    return mesh if len(mesh.faces) else None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--libraries", type=Path, required=True, help="folder of .sh3f files")
    parser.add_argument("--out", type=Path, required=True)
    arguments = parser.parse_args()
    for part in ("train", "held-out"):
        (arguments.out / part).mkdir(parents=True, exist_ok=True)
    counts: dict[str, int] = {}
    for path in sorted(arguments.libraries.glob("*.sh3f")):
        library = zipfile.ZipFile(path)
        entries = catalogue(library)
        for number, entry in sorted(entries.items(), key=lambda item: int(item[0])):
            label = class_of(entry)
            mesh = label and mesh_of(library, entry)
            if not mesh:
                continue
            counts[label] = counts.get(label, 0) + 1
            part = "held-out" if counts[label] % 5 == 0 else "train"
            mesh.export(arguments.out / part / f"{label}-{path.stem}-{number}.ply", vertex_normal=False)
    print(", ".join(f"{label} {count}" for label, count in sorted(counts.items())))


if __name__ == "__main__":
    main()
