"""Surface meshes, by the readers of 3D programs and of phones."""

import io
import re
import zipfile

import numpy as np
import pygltflib
import trimesh
from PIL import Image
from pxr import Usd, UsdGeom, UsdShade, UsdValidation

from truth import same_points, z_up

# Fraction of the surface that may face against the normals of its corners: folds of objects thinner than the grid.
MAX_AGAINST = 0.01


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
    faces_its_normals(scene.geometry.values())
    return f"{triangles} triangles in {len(names)} parts"


def lies_on_the_floor(truth, parts):
    """The floor's triangles face up, at the height 0."""
    floor = next(mesh for name, mesh in parts.items() if name.startswith("floor"))
    assert abs(np.median(floor.vertices[:, 1])) < 0.05
    up = (floor.face_normals[:, 1] * floor.area_faces).sum() / floor.area_faces.sum()
    assert up > 0.9, up


def faces_its_normals(parts):
    """Programs with lights show a surface that faces against its normals black, or leave it out."""
    area_m2 = against_m2 = 0.0
    for mesh in parts:
        normals = mesh.vertex_normals[mesh.faces].sum(axis=1)
        opposes = (normals * mesh.face_normals).sum(axis=1) < 0
        area_m2 += mesh.area_faces.sum()
        against_m2 += mesh.area_faces[opposes].sum()
    assert against_m2 < MAX_AGAINST * area_m2, (against_m2, area_m2)


def obj(truth):
    text = (truth.folder / "mesh.obj").read_text()
    # Blender divides a file by `o`, other programs by `g`.
    names, groups = ([line.split()[1] for line in text.splitlines() if line.startswith(word)] for word in ("o ", "g "))
    assert names == groups, (names, groups)
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
    assert names == sorted(re.sub(r"\W", "_", name, flags=re.ASCII) for name in scene.geometry), names
    xyz = np.concatenate([np.array(mesh.GetPointsAttr().Get()) for mesh in meshes])
    corners = sum(sum(mesh.GetFaceVertexCountsAttr().Get()) for mesh in meshes)
    assert corners == 3 * sum(len(part.faces) for part in scene.geometry.values())
    same_points([xyz.min(axis=0), xyz.max(axis=0)], scene.bounds, 0.001)
    truth.is_the_room(z_up(xyz))
    colors = np.concatenate([np.array(mesh.GetDisplayColorAttr().Get()) for mesh in meshes])
    # Both have them linear; GLB in 65535ths.
    of_glb = np.concatenate([part.visual.vertex_attributes["color"][:, :3] for part in scene.geometry.values()]) / 65535
    same_points(colors.mean(axis=0), of_glb.mean(axis=0), 0.001)
    for mesh in meshes:
        shines_by_a_picture(path, mesh)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    problems = UsdValidation.ValidationContext(validators).Validate(stage)
    assert not problems, [problem.GetMessage() for problem in problems]
    return f"{corners // 3} triangles in {len(meshes)} parts"


def shines_by_a_picture(path, mesh):
    """Phones take colours from a picture only. It must hold those of the vertices, and no light may be added."""
    material, _ = UsdShade.MaterialBindingAPI(mesh).ComputeBoundMaterial()
    surface, _, _ = material.ComputeSurfaceSource()
    assert surface.GetInput("diffuseColor").Get() == (0, 0, 0)
    [source], _ = surface.GetInput("emissiveColor").GetConnectedSources()
    texture = UsdShade.Shader(source.source.GetPrim())
    assert texture.GetIdAttr().Get() == "UsdUVTexture"
    assert texture.GetInput("sourceColorSpace").Get() == "sRGB"
    file = texture.GetInput("file").Get()
    assert file.resolvedPath.endswith(f"mesh.usdz[{file.path}]"), file.resolvedPath
    picture = Image.open(io.BytesIO(zipfile.ZipFile(path).read(file.path)))
    places = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("st")
    assert places.GetInterpolation() == UsdGeom.Tokens.faceVarying
    s, t = np.array(places.Get()).T
    value = np.asarray(picture)[((1 - t) * picture.height).astype(int), (s * picture.width).astype(int)] / 255
    light = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    colors = np.array(mesh.GetDisplayColorAttr().Get())[np.array(mesh.GetFaceVertexIndicesAttr().Get())]
    same_points(light, colors, 0.001)
