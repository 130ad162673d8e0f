"""`compare_trimesh_embree.py`: rays of another program find the same openness and transfer, within their error."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import trimesh
from conftest import REPOSITORY, join, quad, same_bits
from PIL import Image

import finalgather as fg

SCRIPT = REPOSITORY / "python" / "examples" / "compare_trimesh_embree.py"


def test_comparison(tmp_path: Path) -> None:
    options = ["--vertices", "2000", "--rays", "256", "--reference", "4096"]
    done = subprocess.run([sys.executable, SCRIPT, *options], capture_output=True, text=True, cwd=tmp_path, timeout=120)
    assert done.returncode == 0, done.stderr
    occlusion, transfer = done.stdout.split("radiance transfer")
    ours, theirs, between = (float(number) for number in re.findall(r"RMSE\D* (0\.\d+)", occlusion))
    (expected,) = (float(number) for number in re.findall(r"expected (0\.\d+)", occlusion))
    # Of so many independent rays, the error is known to a few percent. Near edges, origins differ a little.
    assert 0.9 * expected < theirs < 1.15 * expected
    assert ours < 0.5 * theirs and between < 1.3 * expected
    ours, theirs, between = (float(number) for number in re.findall(r"RMSE\D* (0\.\d+)", transfer))
    assert ours < theirs and between < 2 * theirs


def test_meshes_of_trimesh() -> None:
    """A mesh with colours of vertices, one with a texture, and a scene of several."""
    ball = trimesh.creation.icosphere(subdivisions=2)
    plain = fg.Scene.from_trimesh(ball, env=1.0)
    assert (plain.vertex_count, plain.face_count) == (len(ball.vertices), len(ball.faces))
    arrays = fg.Scene.from_arrays(ball.vertices, ball.faces)
    ao = [fg.bake(scene, vertices=True, what="ao", directions=64)["ao"] for scene in (plain, arrays)]
    assert same_bits(*ao)
    smooth = fg.bake(fg.Scene.from_trimesh(ball, smooth=True), vertices=True, what="ao", directions=8)
    assert np.allclose(smooth.normals, ball.vertex_normals, atol=1e-5)


def test_colours_of_trimesh() -> None:
    """They are bytes in sRGB, and light that a second surface reflects has them."""
    vertices, faces = join(quad([0, 0, 0], [0, 0, 1], [1, 0, 0]), quad([0, 0, 0], [1, 0, 0], [0, 1, 0]))
    both = trimesh.Trimesh(vertices, faces, process=False)
    both.visual = trimesh.visual.ColorVisuals(both, vertex_colors=np.array([[188, 0, 0, 255]] * 8, np.uint8))
    # IEC 61966-2-1.
    linear = ((188 / 255 + 0.055) / 1.055) ** 2.4
    scenes = (
        fg.Scene.from_trimesh(both, env=1.0),
        fg.Scene.from_arrays(vertices, faces, albedo=[linear, 0, 0], env=1.0),
    )
    found, expected = (
        fg.bake(scene, vertices=True, directions=64, photons=2000)["irradiance_indirect"] for scene in scenes
    )
    assert np.allclose(found, expected, rtol=1e-3, atol=1e-5)
    assert found[:, 0].max() > 0 and not found[:, 1:].any()


def test_texture_of_trimesh() -> None:
    floor = trimesh.Trimesh(*quad([0, 0, 0], [0, 0, 1], [1, 0, 0]), process=False)
    floor.visual = trimesh.visual.TextureVisuals(
        uv=floor.vertices[:, [0, 2]], image=Image.new("RGB", (4, 4), (188, 0, 0))
    )
    scene = fg.Scene.from_trimesh(floor, env=1.0)
    film = fg.render(scene, size=16, directions=16, photons=100, eye=[0.5, 2, 0.5], target=[0.5, 0, 0.5], up=[0, 0, -1])
    linear = ((188 / 255 + 0.055) / 1.055) ** 2.4
    # Drivers may decode by an approximation.
    assert np.allclose(film["Albedo"][8, 8], [linear, 0, 0], atol=2e-3)


def test_faces_have_colours_of_their_own() -> None:
    """Not those of vertices, which blur at edges."""
    floor = trimesh.Trimesh(*quad([0, 0, 0], [0, 0, 1], [1, 0, 0]), process=False)
    floor.visual = trimesh.visual.ColorVisuals(floor, face_colors=[[255, 0, 0, 255], [0, 0, 255, 255]])
    scene = fg.Scene.from_trimesh(floor, env=1.0)
    film = fg.render(scene, size=16, directions=16, photons=100, eye=[0.5, 2, 0.5], target=[0.5, 0, 0.5], up=[0, 0, -1])
    seen = film["Albedo"][[5, 10, 5, 10], [5, 10, 10, 5]]
    one, other = [1, 0, 0], [0, 0, 1]
    # The diagonal may run either way. It meets two of the four pixels, and each of the others is on one side.
    ends = [(a, b) for a, b in ((seen[0], seen[1]), (seen[2], seen[3]), (seen[1], seen[0]), (seen[3], seen[2]))]
    assert any(np.allclose(a, one) and np.allclose(b, other) for a, b in ends), seen


def test_a_mesh_that_names_no_colour_is_grey() -> None:
    """trimesh gives a material to a mesh with coordinates and no picture."""
    floor = trimesh.Trimesh(*quad([0, 0, 0], [0, 0, 1], [1, 0, 0]), process=False)
    floor.visual = trimesh.visual.TextureVisuals(uv=floor.vertices[:, [0, 2]])
    scene = fg.Scene.from_trimesh(floor, env=1.0)
    film = fg.render(scene, size=8, directions=16, photons=100, eye=[0.5, 2, 0.5], target=[0.5, 0, 0.5], up=[0, 0, -1])
    assert np.allclose(film["Albedo"][4, 4], 0.5, atol=1e-3)
