"""Surface meshes, by the readers of 3D programs and of phones."""

import numpy as np
import pygltflib
import trimesh
from pxr import Usd, UsdGeom, UsdValidation

from truth import same_points, z_up


def expected_parts(truth, names):
    """Fails unless each part is an object or a class."""
    ids = {thing["id"] for thing in truth.objects}
    other = set(names) - ids - set(truth.classes.values())
    assert not other, other
    assert {"floor", "wall"} <= set(names), names


def glb(truth):
    file = pygltflib.GLTF2().load(truth.path("mesh.glb"))
    names = [node.name for node in file.nodes if node.mesh is not None]
    expected_parts(truth, names)
    known = set(truth.classes.values())
    assert all(node.extras["class"] in known for node in file.nodes if node.mesh is not None)
    assert "KHR_materials_unlit" in file.extensionsUsed
    scene = trimesh.load_scene(truth.path("mesh.glb"))
    assert len(scene.geometry) == len(names)
    triangles = sum(len(mesh.faces) for mesh in scene.geometry.values())
    xyz = np.concatenate([mesh.vertices for mesh in scene.geometry.values()])
    colors = [file.accessors[primitive.attributes.COLOR_0].count for mesh in file.meshes for primitive in mesh.primitives]
    assert sum(colors) == len(xyz)
    truth.is_the_room(z_up(xyz))
    lies_on_the_floor(truth, scene.geometry)
    return f"{triangles} triangles in {len(names)} parts"


def lies_on_the_floor(truth, parts):
    """The floor's triangles face up, at the height 0."""
    floor = next(mesh for name, mesh in parts.items() if name.startswith("floor"))
    assert abs(np.median(floor.vertices[:, 1])) < 0.05
    up = (floor.face_normals[:, 1] * floor.area_faces).sum() / floor.area_faces.sum()
    assert up > 0.9, up


def obj(truth):
    text = (truth.folder / "mesh.obj").read_text()
    names = [line.split()[1] for line in text.splitlines() if line.startswith("g ")]
    expected_parts(truth, names)
    mesh = trimesh.load(truth.path("mesh.obj"), force="mesh", process=False)
    assert mesh.visual.kind == "vertex"
    scene = trimesh.load_scene(truth.path("mesh.glb"))
    assert len(mesh.faces) == sum(len(part.faces) for part in scene.geometry.values())
    same_points(mesh.bounds, scene.bounds, 0.001)
    truth.is_the_room(z_up(mesh.vertices))
    return f"{len(mesh.faces)} triangles in {len(names)} parts"


def usdz(truth):
    path = truth.path("mesh.usdz")
    stage = Usd.Stage.Open(path)
    assert UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    classes = [mesh.GetPrim().GetAttribute("viola:class").Get() for mesh in meshes]
    assert set(classes) <= set(truth.classes.values()), classes
    scene = trimesh.load_scene(truth.path("mesh.glb"))
    # Names in USD have underscores for other characters.
    names = sorted(mesh.GetPrim().GetName() for mesh in meshes)
    assert names == sorted(name.replace("-", "_") for name in scene.geometry), names
    xyz = np.concatenate([np.array(mesh.GetPointsAttr().Get()) for mesh in meshes])
    corners = sum(sum(mesh.GetFaceVertexCountsAttr().Get()) for mesh in meshes)
    assert corners == 3 * sum(len(part.faces) for part in scene.geometry.values())
    same_points([xyz.min(axis=0), xyz.max(axis=0)], scene.bounds, 0.001)
    truth.is_the_room(z_up(xyz))
    assert all(mesh.GetDisplayColorPrimvar().HasValue() for mesh in meshes)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    problems = UsdValidation.ValidationContext(validators).Validate(stage)
    assert not problems, [problem.GetMessage() for problem in problems]
    return f"{corners // 3} triangles in {len(meshes)} parts"
