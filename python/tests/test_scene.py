"""Scenes of arrays are those of files, arrays of any kind are taken, and wrong ones are refused with a cure."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any, Callable

import numpy as np
import pytest
from conftest import DIRECTIONS, SCENES, Array, box, join, quad, room, same_bits, sphere, write_ply

import finalgather as fg


def openness(scene: fg.Scene, **more: Any) -> Array:
    return fg.bake(scene, vertices=True, what="ao", directions=DIRECTIONS, **more)["ao"]


def light(scene: fg.Scene) -> Array:
    """Light of an environment, with what colours and textures reflect of it."""
    return fg.bake(scene, vertices=True, directions=DIRECTIONS, photons=2000)["irradiance"]


# A scene of arrays is the scene of the file


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_positions(tmp_path: Path, precision: type) -> None:
    vertices, faces = sphere(3)
    # Thirds need 64 bits.
    vertices = vertices.astype(precision) / 3
    of_file = fg.Scene.load(write_ply(tmp_path / "mesh.ply", vertices, faces))
    of_arrays = fg.Scene.from_arrays(vertices, faces)
    assert (of_arrays.vertex_count, of_arrays.face_count) == (len(vertices), len(faces))
    assert np.array_equal(of_arrays.bounds, of_file.bounds)
    assert np.allclose(of_arrays.bounds, [vertices.min(axis=0), vertices.max(axis=0)], rtol=1e-6)
    assert same_bits(openness(of_arrays), openness(of_file))


def test_far_from_the_origin(tmp_path: Path) -> None:
    vertices, faces, _ = room()
    near = openness(fg.Scene.from_arrays(vertices, faces))
    far = vertices.astype(np.float64) + [4e6, 5e5, 300]
    of_arrays = openness(fg.Scene.from_arrays(far, faces))
    assert same_bits(of_arrays, openness(fg.Scene.load(write_ply(tmp_path / "far.ply", far, faces))))
    # 64 bits hold places there to 1e-9. In 32 bits, points would move by a quarter of the room.
    assert np.abs(of_arrays - near).max() < 0.05


def test_normals(tmp_path: Path) -> None:
    vertices, faces = box()
    # Those of a ball, so that a face is not flat.
    normals = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    file = write_ply(tmp_path / "mesh.ply", vertices, faces, normals=normals)

    def bent(scene: fg.Scene) -> Array:
        return fg.bake(scene, vertices=True, what="bent_normal", directions=DIRECTIONS)["bent_normal"]

    of_arrays = bent(fg.Scene.from_arrays(vertices, faces, normals=normals))
    assert same_bits(of_arrays, bent(fg.Scene.load(file)))
    assert not same_bits(of_arrays, bent(fg.Scene.from_arrays(vertices, faces)))


def test_smooth_angle(tmp_path: Path) -> None:
    vertices, faces = sphere(3)
    file = write_ply(tmp_path / "mesh.ply", vertices, faces)
    smooth = fg.bake(
        fg.Scene.from_arrays(vertices, faces, smooth_angle=60.0), points=None, vertices=True, what="ao", directions=8
    )
    of_file = fg.bake(fg.Scene.load(file, smooth_angle=60.0), vertices=True, what="ao", directions=8)
    assert same_bits(smooth.normals, of_file.normals)
    # All corners of a regular ball's vertex are alike enough for its normal to point from the middle.
    assert np.abs(smooth.normals - vertices).max() < 0.1


def test_colors_of_vertices(tmp_path: Path) -> None:
    vertices, faces, colors = room()
    file = write_ply(tmp_path / "mesh.ply", vertices, faces, colors=colors)
    of_arrays = light(fg.Scene.from_arrays(vertices, faces, albedo=colors, sky=False))
    assert same_bits(of_arrays, light(fg.Scene.load(file)))
    assert not same_bits(of_arrays, light(fg.Scene.from_arrays(vertices, faces)))


def test_albedo_of_all() -> None:
    vertices, faces, _ = room()
    grey = light(fg.Scene.from_arrays(vertices, faces, albedo=0.25))
    assert same_bits(grey, light(fg.Scene.from_arrays(vertices, faces, albedo=[0.25, 0.25, 0.25])))
    assert same_bits(
        light(fg.Scene.from_arrays(vertices, faces)), light(fg.Scene.from_arrays(vertices, faces, albedo=0.5))
    )
    # Each channel goes its own way.
    coloured = light(fg.Scene.from_arrays(vertices, faces, albedo=[0.25, 0.5, 0.0]))
    assert coloured[:, 1].sum() > coloured[:, 0].sum() > coloured[:, 2].sum()


def test_texture() -> None:
    """The albedo that a camera sees: bytes of sRGB, and row 0 is where v is 1."""
    wall = quad([0, 0, 0], [1, 0, 0], [0, 1, 0])
    texels = np.array([[[188, 0, 0], [0, 188, 0]], [[0, 0, 188], [255, 255, 255]]], np.uint8)
    # Wide fields, so that a pixel in the middle of one meets no other by interpolation.
    texture = texels.repeat(4, axis=0).repeat(4, axis=1)
    scene = fg.Scene.from_arrays(*wall, uv=wall[0][:, :2], texture=texture, env=1.0)
    film = fg.render(scene, eye=[0.5, 0.5, 1], target=[0.5, 0.5, 0], fov=53.0, size=16, directions=8, photons=100)
    # The sRGB curve of IEC 61966-2-1.
    linear = ((188 / 255 + 0.055) / 1.055) ** 2.4
    seen = film["Albedo"][[3, 3, 12, 12], [3, 12, 3, 12]]
    # Drivers may decode by an approximation: Mesa's software driver by one that is off by 0.0007 here.
    assert np.allclose(seen, [[linear, 0, 0], [0, linear, 0], [0, 0, linear], [1, 1, 1]], atol=2e-3)


def test_colours_of_bytes_are_srgb() -> None:
    vertices, faces, _ = room()
    coloured = np.tile(np.array([188, 0, 255], np.uint8), (len(vertices), 1))
    linear = [((188 / 255 + 0.055) / 1.055) ** 2.4, 0.0, 1.0]
    by_bytes = light(fg.Scene.from_arrays(vertices, faces, albedo=coloured))
    assert np.allclose(by_bytes, light(fg.Scene.from_arrays(vertices, faces, albedo=linear)), rtol=1e-4)


def test_emission_of_faces() -> None:
    """Radiance of the front, one for all or one a face."""
    vertices, faces, _ = room()
    lamp = quad([0.35, 0.9, 0.35], [0.3, 0, 0], [0, 0, 0.3])
    vertices, faces = join((vertices, faces), lamp)
    emission = np.zeros((len(faces), 3), np.float32)
    emission[-2:] = [8.0, 4.0, 0.0]
    lit = light(fg.Scene.from_arrays(vertices, faces, emission=emission))
    assert lit[:, 0].sum() > 0 and np.allclose(lit[:, 0], 2 * lit[:, 1], rtol=1e-3)
    assert not lit[:, 2].any()
    same = [fg.Scene.from_arrays(*sphere(2), emission=emission) for emission in (1.5, [1.5, 1.5, 1.5])]
    assert same_bits(light(same[0]), light(same[1]))


def test_a_scene_without_light() -> None:
    vertices, faces = box()
    with pytest.warns(fg.Warning, match="sky"):
        lit = light(fg.Scene.from_arrays(vertices, faces))
    assert lit.min() > 0
    with pytest.raises(fg.Error):
        light(fg.Scene.from_arrays(vertices, faces, default_light=False))
    # Openness needs none. Rays along a face may meet it by rounding, and weigh next to nothing.
    assert openness(fg.Scene.from_arrays(vertices, faces, default_light=False)).min() > 1 - 1e-4


def test_flip() -> None:
    vertices, faces = quad([0, 0, 0], [1, 0, 0], [0, 1, 0])
    normals = [
        fg.bake(fg.Scene.from_arrays(vertices, faces, flip=flip), vertices=True, what="ao", directions=8).normals
        for flip in (False, True)
    ]
    assert np.array_equal(normals[0], [[0, 0, 1]] * 4) and np.array_equal(normals[1], [[0, 0, -1]] * 4)


def test_quads() -> None:
    vertices, faces = box()
    corners = np.arange(24).reshape(6, 4)[:, [0, 1, 3, 2]]
    quads = fg.Scene.from_arrays(vertices, corners)
    assert quads.face_count == 12
    assert same_bits(openness(quads), openness(fg.Scene.from_arrays(vertices, faces)))


# Kinds of arrays


VERTICES, FACES = sphere(2)
AS: dict[str, Callable[[Array, Array], tuple[Any, Any]]] = {
    "float64, int64": lambda v, f: (v.astype(np.float64), f.astype(np.int64)),
    "float32, int32": lambda v, f: (v, f.astype(np.int32)),
    "float32, uint8": lambda v, f: (v, f.astype(np.uint8)),
    "float32, uint16": lambda v, f: (v, f.astype(np.uint16)),
    "float32, uint64": lambda v, f: (v, f.astype(np.uint64)),
    "order of Fortran": lambda v, f: (np.asfortranarray(v), np.asfortranarray(f)),
    "every second row": lambda v, f: (np.repeat(v, 2, axis=0)[::2], np.repeat(f, 2, axis=0)[::2]),
    "backwards": lambda v, f: (v[::-1].copy()[::-1], f[::-1].copy()[::-1]),
    "columns of a table": lambda v, f: (np.hstack([v, v])[:, :3], np.hstack([f, f])[:, :3]),
    "other byte order": lambda v, f: (v.astype(">f4"), f.astype(">i4")),
    "read only": lambda v, f: (np.frombuffer(v.tobytes(), np.float32).reshape(-1, 3), f),
    "lists": lambda v, f: (v.tolist(), f.tolist()),
}


@pytest.mark.parametrize("kind", AS)
def test_arrays_of(kind: str) -> None:
    vertices, faces = AS[kind](VERTICES, FACES)
    expected = fg.Scene.from_arrays(VERTICES, FACES)
    scene = fg.Scene.from_arrays(vertices, faces)
    assert np.array_equal(scene.bounds, expected.bounds) and scene.face_count == expected.face_count
    assert same_bits(openness(scene), openness(expected))


def test_whole_numbers_as_positions() -> None:
    vertices, faces = box(side=2.0)
    assert same_bits(
        openness(fg.Scene.from_arrays(vertices.astype(np.int64), faces)),
        openness(fg.Scene.from_arrays(vertices, faces)),
    )


def test_arrays_are_copied() -> None:
    vertices, faces = VERTICES.copy(), FACES.copy()
    scene = fg.Scene.from_arrays(vertices, faces)
    expected = openness(scene)
    vertices[:], faces[:] = 0, 0
    assert same_bits(openness(scene), expected)


# Wrong arrays

QUAD = quad([0, 0, 0], [1, 0, 0], [0, 1, 0])
NAN = QUAD[0].copy()
NAN[1, 1] = np.nan
WRONG: dict[str, tuple[Any, Any, dict[str, Any]]] = {
    "vertices of two numbers": (QUAD[0][:, :2], QUAD[1], {}),
    "vertices in a row": (QUAD[0].ravel(), QUAD[1], {}),
    "faces of four corners in all": (QUAD[0], [0, 1, 2, 3], {}),
    "faces of two corners": (QUAD[0], QUAD[1][:, :2], {}),
    "faces of floats": (QUAD[0], QUAD[1].astype(np.float32), {}),
    "text as vertices": (np.full((4, 3), "a"), QUAD[1], {}),
    "complex vertices": (QUAD[0].astype(np.complex64), QUAD[1], {}),
    "objects as faces": (QUAD[0], np.array([[0, 1, None]]), {}),
    "no vertices": (np.zeros((0, 3)), np.zeros((0, 3), int), {}),
    "no faces": (QUAD[0], np.zeros((0, 3), int), {}),
    "normals of other vertices": (*QUAD, {"normals": np.ones((3, 3))}),
    "uv of other vertices": (*QUAD, {"uv": np.ones((3, 2))}),
    "uv of three numbers": (*QUAD, {"uv": np.ones((4, 3))}),
    "colours of other vertices": (*QUAD, {"albedo": np.ones((5, 3))}),
    "a colour of two numbers": (*QUAD, {"albedo": [0.5, 0.5]}),
    "emission of other faces": (*QUAD, {"emission": np.ones((3, 3))}),
    "negative emission": (*QUAD, {"emission": -1.0}),
    "a texture without uv": (*QUAD, {"texture": np.zeros((2, 2, 3), np.uint8)}),
    "a texture of floats": (*QUAD, {"uv": np.zeros((4, 2)), "texture": np.zeros((2, 2, 3), np.float32)}),
    "a grey texture": (*QUAD, {"uv": np.zeros((4, 2)), "texture": np.zeros((2, 2), np.uint8)}),
    "a texture without texels": (*QUAD, {"uv": np.zeros((4, 2)), "texture": np.zeros((0, 2, 3), np.uint8)}),
    "an environment of two numbers": (*QUAD, {"env": [1.0, 2.0]}),
    "albedo of nothing": (*QUAD, {"albedo": np.ones((0, 3))}),
    "normals of nothing": (*QUAD, {"normals": np.ones((0, 3))}),
    "emission that no sum holds": (*QUAD, {"emission": 3e38}),
    "two skies": (*QUAD, {"env": 1.0, "sun": (120, 35), "sky": True}),
    "a sun beyond the zenith": (*QUAD, {"sun": (120, 95)}),
    "a sun of one number": (*QUAD, {"sun": [120]}),
    "an environment that is not a number": (*QUAD, {"env": np.full((2, 4, 3), np.nan)}),
}


@pytest.mark.parametrize("what", WRONG)
def test_refused(what: str) -> None:
    vertices, faces, more = WRONG[what]
    with pytest.raises((fg.InputError, fg.UsageError)) as caught:
        fg.Scene.from_arrays(vertices, faces, **more)
    assert isinstance(caught.value, ValueError)
    assert caught.value.problem and caught.value.cure
    assert caught.value.problem in str(caught.value) and caught.value.cure in str(caught.value)


def test_the_name_is_no_kind_of_file() -> None:
    """A scene file of this name would say how its sun is."""
    suns = [fg.Scene.from_arrays(*QUAD, sun=[120.0, 35.0], name=name) for name in ("a", "a.toml")]
    plain, toml = (fg.bake(scene, directions=16, photons=100)["irradiance"] for scene in suns)
    assert same_bits(plain, toml) and plain.max() > 1000


def test_arrays_may_lie_anywhere() -> None:
    """Also at addresses that are no multiples of their numbers' size."""
    raw = np.zeros(1 + QUAD[0].size * 8, np.uint8)
    vertices = raw[1:].view(np.float64).reshape(QUAD[0].shape)
    vertices[:] = QUAD[0]
    assert not vertices.flags.aligned
    assert fg.Scene.from_arrays(vertices, QUAD[1]).face_count == fg.Scene.from_arrays(*QUAD).face_count


@pytest.mark.parametrize(
    ("what", "vertices", "faces"),
    [
        ("position", NAN, np.vstack([QUAD[1], [[0, 2, 3]]])),
        ("index beyond the end", QUAD[0], np.vstack([QUAD[1], [[0, 1, 4]]])),
        ("negative index", QUAD[0], np.vstack([QUAD[1].astype(int), [[0, 1, -1]]])),
        ("huge index", QUAD[0], np.vstack([QUAD[1].astype(np.int64), [[0, 1, 2**32]]])),
    ],
)
def test_faults_are_mended_or_strictly_refused(what: str, vertices: Array, faces: Array) -> None:
    """As those of a file. An index out of range is never read."""
    with pytest.raises(fg.InputError) as caught:
        fg.Scene.from_arrays(vertices, faces, strict=True)
    assert caught.value.cure
    try:
        with pytest.warns(fg.Warning):
            scene = fg.Scene.from_arrays(vertices, faces)
    except fg.InputError as error:
        assert error.cure
    else:
        assert scene.face_count < len(faces) and scene.warnings
        assert np.nanmin(openness(scene)) == 1


# Files


def test_load() -> None:
    scene = fg.Scene.load(SCENES / "cornell.toml")
    assert scene.face_count > 0 and scene.vertex_count > 0
    assert {Path(file).name for file in scene.files} >= {"cornell.toml", "cornell.obj", "cornell.mtl"}
    assert str(scene.face_count) in repr(scene)
    assert scene._repr_html_().lstrip().startswith("<")
    # A path may be text.
    assert np.array_equal(fg.Scene.load(str(SCENES / "cornell.toml")).bounds, scene.bounds)


def test_a_missing_file() -> None:
    with pytest.raises(fg.InputError, match=r"nowhere\.ply") as caught:
        fg.Scene.load("nowhere.ply")
    assert caught.value.cure


class Trimesh:
    """What `from_trimesh` reads of a mesh of trimesh, for which it need not be installed."""

    def __init__(self, vertices: Array, faces: Array) -> None:
        self.vertices, self.faces = vertices.astype(np.float64), faces.astype(np.int64)
        self.vertex_normals = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
        self.visual = SimpleNamespace(kind=None)


def test_from_trimesh() -> None:
    vertices, faces = sphere(3)
    mesh = Trimesh(vertices, faces)
    assert same_bits(openness(fg.Scene.from_trimesh(mesh)), openness(fg.Scene.from_arrays(mesh.vertices, mesh.faces)))
