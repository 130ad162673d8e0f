"""Every failure has a class by its kind, and says its problem and a cure."""

from __future__ import annotations

import pickle
import warnings
from pathlib import Path
from typing import Any, Callable

import numpy as np
import pytest
from conftest import box, quad, sphere

import finalgather as fg

SCENE = fg.Scene.from_arrays(*box(), env=1.0)
TRANSFER = np.ones((24, 9, 3), np.float32)
POINT = (np.zeros((1, 3)), np.array([[0.0, 1.0, 0.0]]))
QUICK: dict[str, Any] = {"directions": 8, "photons": 100}


def test_classes() -> None:
    assert issubclass(fg.InputError, fg.Error) and issubclass(fg.InputError, ValueError)
    assert issubclass(fg.UsageError, fg.Error) and issubclass(fg.UsageError, ValueError)
    assert issubclass(fg.DeviceError, fg.Error) and issubclass(fg.DeviceError, RuntimeError)
    assert issubclass(fg.OutputError, fg.Error) and issubclass(fg.OutputError, OSError)
    assert issubclass(fg.Warning, UserWarning)
    # `except Exception` must not swallow Ctrl-C.
    assert issubclass(fg.Interrupted, KeyboardInterrupt) and not issubclass(fg.Interrupted, Exception)


IMPOSSIBLE: dict[str, Callable[[], object]] = {
    "two places at once": lambda: fg.bake(SCENE, vertices=True, camera=True, what="ao", **QUICK),
    "no quantity": lambda: fg.bake(SCENE, vertices=True, what=[]),
    "an unknown quantity": lambda: fg.bake(SCENE, vertices=True, what="openness"),  # type: ignore[arg-type]
    "too many bands": lambda: fg.prt(SCENE, order=6),
    "no bands": lambda: fg.prt(SCENE, order=0),
    "samples that are no square": lambda: fg.bake(SCENE, lightmap=16, samples_per_texel=3, what="ao", **QUICK),
    "a setting of the wrong type": lambda: fg.render(SCENE, directions="many"),  # type: ignore[arg-type]
    "no directions": lambda: fg.render(SCENE, directions=0),
    "an unknown pipeline": lambda: fg.render(SCENE, pipeline="fast"),  # type: ignore[arg-type]
    "a picture without pixels": lambda: fg.render(SCENE, size=0),
    "points of other normals": lambda: fg.bake(SCENE, points=(np.zeros((2, 3)), np.ones((3, 3))), what="ao", **QUICK),
    "points without normals": lambda: fg.bake(SCENE, points=(np.zeros((2, 3)), np.zeros((2, 3))), what="ao", **QUICK),
    "points that are not numbers": lambda: fg.bake(
        SCENE, points=(np.full((1, 3), np.nan), POINT[1]), what="ao", **QUICK
    ),
    "no points": lambda: fg.bake(SCENE, points=(np.zeros((0, 3)), np.zeros((0, 3))), what="ao", **QUICK),
    "a camera that looks nowhere": lambda: fg.render(SCENE, eye=[0, 0, 0], target=[0, 0, 0], **QUICK),
    "a vector of two numbers": lambda: fg.render(SCENE, eye=[0, 0], **QUICK),
    "rows of an unknown kind": lambda: fg.bake(SCENE, vertices=True, per="face", what="ao", **QUICK),  # type: ignore[arg-type]
    "resume without a checkpoint": lambda: fg.render(SCENE, resume=True, **QUICK),
    "too little memory": lambda: fg.render(SCENE, memory=1, **QUICK),
    "an unknown device": lambda: fg.render(SCENE, backend="vulkan", **QUICK),
}


@pytest.mark.parametrize("what", IMPOSSIBLE)
def test_impossible_requests(what: str) -> None:
    with pytest.raises((fg.UsageError, fg.InputError)) as caught:
        IMPOSSIBLE[what]()
    assert caught.value.problem and caught.value.cure
    assert caught.value.cure in str(caught.value)


def test_a_misspelt_name_is_told() -> None:
    # As Python says it of any function.
    functions: list[Callable[..., object]] = [fg.render, fg.bake, fg.prt]
    for function in functions:
        with pytest.raises(TypeError, match="directions"):
            function(SCENE, direction=8)
    with pytest.raises(fg.UsageError, match="bent_normal"):
        fg.bake(SCENE, vertices=True, what="bent_normals")  # type: ignore[arg-type]


def test_damaged_files(tmp_path: Path) -> None:
    for name in ("mesh.ply", "mesh.obj", "mesh.stl", "mesh.glb", "scene.toml"):
        (tmp_path / name).write_bytes(b"ply\nformat nonsense\n")
        with pytest.raises(fg.InputError, match=name) as caught:
            fg.Scene.load(tmp_path / name)
        assert caught.value.cure
    (tmp_path / "picture.exr").write_bytes(b"nothing")
    with pytest.raises(fg.InputError):
        fg.Film.read(tmp_path / "picture.exr")


def test_outputs(tmp_path: Path) -> None:
    baked = fg.bake(SCENE, vertices=True, what="ao", directions=8)
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "nowhere" / "ao.npy", tmp_path / "file" / "ao.npy", tmp_path):
        with pytest.raises((fg.OutputError, fg.UsageError)) as caught:
            baked.write(path)
        assert caught.value.cure


def test_errors_can_be_sent_between_processes() -> None:
    """A pool pickles what a worker raises."""
    with pytest.raises(fg.UsageError) as caught:
        fg.prt(SCENE, order=6)
    error = pickle.loads(pickle.dumps(caught.value))
    assert type(error) is fg.UsageError and str(error) == str(caught.value)
    assert (error.problem, error.cure) == (caught.value.problem, caught.value.cure)


def test_an_interruption_can_be_sent_too() -> None:
    """Without its values, which a pool may not be able to send."""
    assert isinstance(pickle.loads(pickle.dumps(fg.Interrupted())), fg.Interrupted)
    baked = fg.bake(SCENE, what="ao", directions=8)
    assert isinstance(pickle.loads(pickle.dumps(fg.Interrupted(baked))), fg.Interrupted)


def test_a_scene_is_of_its_own_type() -> None:
    for wrong in (None, "scene.obj", QUICK):
        with pytest.raises(TypeError):
            fg.bake(wrong, vertices=True, what="ao")  # type: ignore[arg-type]


def test_checkpoint_of_another_job(tmp_path: Path) -> None:
    checkpoint = tmp_path / "job.part"
    scene = fg.Scene.from_arrays(*quad([0, 0, 0], [1, 0, 0], [0, 1, 0]))
    fg.bake(scene, vertices=True, what="ao", directions=8, checkpoint=checkpoint)
    assert checkpoint.exists()
    with pytest.raises((fg.InputError, fg.UsageError)) as caught:
        fg.bake(scene, vertices=True, what="ao", directions=16, checkpoint=checkpoint, resume=True)
    assert caught.value.cure
    # One that is there already is never replaced by mistake.
    before = checkpoint.read_bytes()
    with pytest.raises(fg.Error):
        fg.bake(scene, vertices=True, what="ao", directions=16, checkpoint=checkpoint)
    assert checkpoint.read_bytes() == before


def test_options_of_the_tool_are_arguments_here() -> None:
    scene = fg.Scene.from_arrays(*sphere(1))
    with pytest.raises(fg.UsageError, match="ao_distance") as caught:
        fg.bake(scene, what="ao", ao_distance=-1.0)
    assert "--" not in str(caught.value)
    # Names of files are those of the user.
    with pytest.raises(fg.InputError, match="/tmp/--env-of/a --x.ply"):
        fg.Scene.load("/tmp/--env-of/a --x.ply")


def test_a_scene_tells_its_warnings_once() -> None:
    vertices, faces = sphere(1)
    with pytest.warns(fg.Warning, match="is at"):
        scene = fg.Scene.from_arrays(np.vstack([vertices, [[np.nan] * 3]]), np.vstack([faces, [[0, 1, len(vertices)]]]))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        baked = fg.bake(scene, what="ao", directions=8)
    # The report of the job has them too.
    assert baked.warnings == scene.warnings == baked.report["warnings"] and len(scene.warnings) == 1
