"""`bake_folder.py`: the same files by processes, Dask and Ray; what is done stays; one bad mesh stops no other."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY, box, same_bits, sphere, write_ply

import finalgather as fg

SCRIPT = REPOSITORY / "python" / "examples" / "bake_folder.py"
ENGINES = {
    "processes": ["--workers", "2"],
    "dask": ["--workers", "2", "--dask", "local"],
    "ray": ["--workers", "2", "--ray"],
}


@pytest.fixture
def meshes(tmp_path: Path) -> Path:
    folder = tmp_path / "meshes"
    folder.mkdir()
    write_ply(folder / "ball.ply", *sphere(3))
    write_ply(folder / "box.ply", *box(cells=2))
    vertices, faces = sphere(2)
    lines = [f"v {x} {y} {z}" for x, y, z in vertices.tolist()] + [
        f"f {a} {b} {c}" for a, b, c in (faces.astype(int) + 1).tolist()
    ]
    (folder / "ball.obj").write_text("\n".join(lines) + "\n")
    (folder / "notes.txt").write_text("no mesh")
    return folder


def command(meshes: Path, out: Path, *options: str) -> list[str]:
    return [sys.executable, str(SCRIPT), str(meshes), str(out), "--directions", "64", *options]


def run(meshes: Path, out: Path, *options: str) -> tuple[int, dict[str, str], str]:
    """The exit code, the state of each mesh by its name, and stderr."""
    # Elsewhere, a worker of Ray would look for the package in the folder that it is started in.
    done = subprocess.run(
        command(meshes, out, *options), capture_output=True, text=True, cwd=meshes.parent, timeout=180
    )
    lines = [line.rsplit(": ", 1) for line in done.stdout.splitlines() if ": " in line]
    return done.returncode, {Path(name.split(" ", 1)[1]).name: state for name, state in lines}, done.stderr


@pytest.mark.parametrize("engine", ENGINES)
def test_engine(engine: str, meshes: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    (meshes / "broken.ply").write_text("ply\nformat nonsense\n")
    code, states, err = run(meshes, out, *ENGINES[engine], "--what", "ao,prt", "--order", "2")
    assert states == {"ball.ply": "baked", "box.ply": "baked", "ball.obj": "baked", "broken.ply": "failed"}, err
    assert code == 1 and "broken.ply" in err and "InputError" in err
    with np.load(out / "ball.ply.npz") as baked:
        expected = fg.bake(
            fg.Scene.load(meshes / "ball.ply"), vertices=True, what=["ao", "prt"], order=2, directions=64
        )
        assert same_bits(baked["ao"], expected["ao"]) and same_bits(baked["prt"], expected["prt"])
    assert sorted(path.name for path in out.glob("*.npz")) == ["ball.obj.npz", "ball.ply.npz", "box.ply.npz"]
    # Checkpoints are gone, and the second run finds all done but the broken one.
    assert not list(out.glob("*.part*"))
    times = {path: path.stat().st_mtime_ns for path in out.glob("*.npz")}
    code, states, _ = run(meshes, out, *ENGINES[engine], "--what", "ao,prt", "--order", "2")
    assert code == 1
    assert states == {
        "ball.ply": "there already",
        "box.ply": "there already",
        "ball.obj": "there already",
        "broken.ply": "failed",
    }
    assert {path: path.stat().st_mtime_ns for path in out.glob("*.npz")} == times


def test_what_has_changed_is_baked_again(meshes: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert run(meshes, out)[0] == 0
    write_ply(meshes / "ball.ply", *sphere(4))
    (out / "box.ply.npz").unlink()
    assert run(meshes, out)[:2] == (0, {"ball.ply": "baked", "box.ply": "baked", "ball.obj": "there already"})
    with np.load(out / "ball.ply.npz") as baked:
        assert len(baked["ao"]) == len(sphere(4)[0])
    # Other options, other values.
    assert set(run(meshes, out, "--what", "sky")[1].values()) == {"baked"}
    with np.load(out / "box.ply.npz") as baked:
        assert "sky" in baked and "ao" not in baked


@pytest.mark.skipif(os.name != "posix", reason="signals")
def test_ctrl_c_and_on(tmp_path: Path) -> None:
    """Ctrl-C reaches all processes of a terminal's job. The second run goes on from the checkpoint."""
    meshes, out = tmp_path / "meshes", tmp_path / "out"
    meshes.mkdir()
    write_ply(meshes / "ball.ply", *sphere(20))
    # As many directions as take some seconds.
    long = ("--directions", "16384")
    # Shells start jobs in the background without SIGINT.
    arguments = ["env", "--default-signal=INT", *command(meshes, out, *long)]
    process = subprocess.Popen(arguments, start_new_session=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    ends = time.monotonic() + 60
    while not list(out.glob("*.lock")) and time.monotonic() < ends and process.poll() is None:
        time.sleep(0.05)
    time.sleep(1)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode in (1, 130), err.decode()
    assert not list(out.glob("*.npz")) and list(out.glob("*.part"))
    code, states, text = run(meshes, out, *long)
    assert (code, states) == (0, {"ball.ply": "baked"}), text
    assert not list(out.glob("*.part*"))
    record = json.loads((out / "ball.ply.npz.json").read_text())
    assert record["options"]["directions"] == 16384
    with np.load(out / "ball.ply.npz") as baked:
        expected = fg.bake(fg.Scene.load(meshes / "ball.ply"), vertices=True, what="ao", directions=16384)["ao"]
        assert same_bits(baked["ao"], expected)


def test_a_folder_without_meshes(tmp_path: Path) -> None:
    (tmp_path / "meshes").mkdir()
    code, _, err = run(tmp_path / "meshes", tmp_path / "out")
    assert code == 2 and "no mesh" in err
