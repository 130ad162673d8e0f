"""Progress, Ctrl-C, checkpoints, threads and processes. Whatever happens, the bits of a finished job are the same."""

from __future__ import annotations

import concurrent.futures
import logging
import multiprocessing
import signal
import subprocess
import sys
import textwrap
import threading
import time
import warnings
from pathlib import Path
from typing import Any, Optional

import numpy as np
import pytest
from conftest import SCENES, Array, room, same_bits, sphere

import finalgather as fg

DIRECTIONS = 256


def bumpy() -> fg.Scene:
    vertices, faces = sphere(6)
    return fg.Scene.from_arrays(vertices * (1 + 0.2 * np.sin(7 * vertices[:, :1])), faces)


def openness(scene: fg.Scene, **more: Any) -> Array:
    return fg.bake(scene, vertices=True, what="ao", **{"directions": DIRECTIONS, **more})["ao"]


# Progress

Call = tuple[int, int, Optional[float]]


def check_calls(calls: list[Call], total: int) -> None:
    done = [call[0] for call in calls]
    assert len(calls) > 1 and done == sorted(done) and done[-1] == total
    assert {call[1] for call in calls} == {total}
    assert all(left is None or left >= 0 for _, _, left in calls)


def test_progress_of_a_bake() -> None:
    calls: list[Call] = []
    values = openness(bumpy(), progress=lambda *call: calls.append(call))
    check_calls(calls, DIRECTIONS)
    assert same_bits(values, openness(bumpy()))


def test_progress_of_a_picture() -> None:
    vertices, faces, _ = room()
    calls: list[Call] = []
    fg.render(
        fg.Scene.from_arrays(vertices, faces, env=1.0),
        size=16,
        directions=64,
        photons=500,
        progress=lambda *call: calls.append(call),
    )
    check_calls(calls, 64)


def test_progress_counts_the_directions_of_all_bounces() -> None:
    calls: list[Call] = []
    fg.prt(bumpy(), gather_bounces=1, directions=64, progress=lambda *call: calls.append(call))
    check_calls(calls, 128)


def test_progress_is_called_in_the_thread_of_the_caller() -> None:
    threads: list[int] = []
    openness(bumpy(), progress=lambda *_: threads.append(threading.get_ident()))
    assert set(threads) == {threading.get_ident()}


def test_progress_on_stderr(capfd: pytest.CaptureFixture[str]) -> None:
    openness(bumpy(), progress=True)
    assert str(DIRECTIONS) in capfd.readouterr().err
    for silent in (False, None):
        openness(bumpy(), progress=silent)
    assert capfd.readouterr() == ("", "")


class Enough(Exception):
    """Of a caller."""


def test_an_exception_in_progress_ends_the_job(tmp_path: Path) -> None:
    scene, checkpoint, directions = bumpy(), tmp_path / "job.part", 1 << 14
    enough = Enough("for now")
    calls: list[int] = []

    def stop(done: int, total: int, left: Optional[float]) -> None:
        calls.append(done)
        if done:
            raise enough

    with pytest.raises(Enough) as caught:
        openness(scene, directions=directions, progress=stop, checkpoint=checkpoint)
    assert caught.value is enough and 0 < calls[-1] < directions
    # Once is enough.
    assert sum(done > 0 for done in calls) == 1
    # The scene and the device still work, and what was done is kept.
    values = openness(scene, directions=directions, checkpoint=checkpoint, resume=True)
    assert same_bits(values, openness(scene, directions=directions))


# Ctrl-C

STOPPED = """
import sys, threading
import numpy as np
sys.path.insert(0, {tests!r})
from test_jobs import bumpy
import finalgather as fg

def tell(done, total, left):
    if done:
        print("going", flush=True)

try:
    fg.bake(bumpy(), vertices=True, what="ao", directions={directions}, progress=tell, checkpoint={checkpoint!r})
except fg.Interrupted as stopped:
    assert isinstance(stopped, KeyboardInterrupt)
    values = stopped.result["ao"]
    # Python is as it was: another job works, and so does the next Ctrl-C.
    again = fg.bake(bumpy(), vertices=True, what="ao", directions=8)["ao"]
    report = stopped.result.report
    print("stopped", len(values), bool(np.isfinite(values).all()), report["interrupted"], len(again), flush=True)
    try:
        import signal
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt as plain:
        print(type(plain).__name__)
"""


def python(script: str, folder: Optional[Path] = None) -> subprocess.Popen[str]:
    """Python of its own. Shells start jobs in the background without SIGINT, so it is given back."""
    return subprocess.Popen(
        ["env", "--default-signal=INT", sys.executable, "-c", textwrap.dedent(script)],
        # Not a folder with the sources of the package.
        cwd=folder or Path(__file__).parent,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def test_interrupted_and_resumed(tmp_path: Path) -> None:
    directions, checkpoint = 1 << 14, tmp_path / "job.part"
    tests = str(Path(__file__).parent)
    child = python(STOPPED.format(tests=tests, directions=directions, checkpoint=str(checkpoint)))
    assert child.stdout is not None
    assert child.stdout.readline() == "going\n"
    child.send_signal(signal.SIGINT)
    out, err = child.communicate(timeout=60)
    lines = [line for line in out.splitlines() if line != "going"]
    scene = bumpy()
    count = scene.vertex_count
    assert lines == [f"stopped {count} True True {count}", "KeyboardInterrupt"], out + err
    assert child.returncode == 0, err
    # The same call goes on from there, to the same bits.
    calls: list[Call] = []
    values = openness(
        scene, directions=directions, checkpoint=checkpoint, resume=True, progress=lambda *call: calls.append(call)
    )
    assert calls[0][0] > 0
    assert same_bits(values, openness(scene, directions=directions))


def test_interrupted_before_the_first_values() -> None:
    """Ctrl-C within the first block gives what that block has, or None. It never hangs."""
    child = python("""
        import os, signal, threading
        import numpy as np
        import finalgather as fg
        scene = fg.Scene.from_arrays(np.eye(3), [[0, 1, 2]])
        threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()
        try:
            while True:
                fg.bake(scene, vertices=True, what="ao", directions=1_000_000)
        except KeyboardInterrupt as stopped:
            print(type(stopped).__name__, type(getattr(stopped, "result", None)).__name__)
    """)
    out, err = child.communicate(timeout=60)
    assert out.split() in (["Interrupted", "Baked"], ["Interrupted", "NoneType"], ["KeyboardInterrupt", "NoneType"]), (
        out + err
    )


def test_interrupted_within_progress(tmp_path: Path) -> None:
    """A signal often finds Python in the callback, for that is Python code. It is Ctrl-C all the same."""
    child = python("""
        import signal
        import numpy as np
        import finalgather as fg

        def tell(done, total, left):
            if done >= total / 2:
                signal.raise_signal(signal.SIGINT)

        try:
            fg.bake(fg.Scene.from_arrays(np.eye(3), [[0, 1, 2]]), what="ao", directions=256, progress=tell)
        except KeyboardInterrupt as stopped:
            print(type(stopped).__name__, len(getattr(stopped, "result", None) or []))
    """)
    out, err = child.communicate(timeout=60)
    assert out.split() == ["Interrupted", "1"], out + err


# Checkpoints


def test_resume_begins_where_there_is_nothing(tmp_path: Path) -> None:
    """So one call serves the first run and all later ones."""
    checkpoint = tmp_path / "job.part"
    values = openness(bumpy(), checkpoint=checkpoint, resume=True)
    assert checkpoint.exists() and same_bits(values, openness(bumpy()))


def test_a_finished_checkpoint_gives_its_values_again(tmp_path: Path) -> None:
    scene, checkpoint = bumpy(), tmp_path / "job.part"
    first = openness(scene, checkpoint=checkpoint)
    calls: list[Call] = []
    again = openness(scene, checkpoint=str(checkpoint), resume=True, progress=lambda *call: calls.append(call))
    assert same_bits(first, again) and same_bits(first, openness(scene))
    assert all(done == total for done, total, _ in calls)


# Threads and processes


def baked_with(scene: fg.Scene, seed: int) -> Array:
    return openness(scene, seed=seed)


def test_threads_share_a_scene() -> None:
    scene = bumpy()
    expected = [baked_with(scene, seed) for seed in range(4)]
    assert not same_bits(expected[0], expected[1])
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        found = list(pool.map(baked_with, [scene] * 4, range(4)))
    assert all(same_bits(a, b) for a, b in zip(found, expected))


def test_threads_take_turns_on_the_device() -> None:
    """Drivers may crash where several threads draw. So pipelines that draw wait for each other, and give the same bits."""
    scene = bumpy()
    kinds = ["fused", "kill", "raycast-gl", "fused", "kill", "fused"]
    alone = {kind: openness(scene, directions=32, pipeline=kind) for kind in set(kinds)}
    told: list[int] = []

    def work(number: int) -> Array:
        return openness(scene, directions=32, pipeline=kinds[number], progress=lambda *call: told.append(number))

    with concurrent.futures.ThreadPoolExecutor(len(kinds)) as pool:
        together = list(pool.map(work, range(len(kinds))))
    assert all(same_bits(values, alone[kind]) for kind, values in zip(kinds, together))
    # Each job tells its begin and its end, and no other tells anything between them.
    turns = [number for i, number in enumerate(told) if i == 0 or told[i - 1] != number]
    assert sorted(turns) == list(range(len(kinds))), told


def test_a_job_within_a_job_is_refused() -> None:
    """It would wait for itself."""

    def again(done: int, total: int, left: Optional[float]) -> None:
        openness(bumpy(), directions=8)

    with pytest.raises(fg.UsageError, match="within the progress of another"):
        openness(bumpy(), progress=again)
    assert openness(bumpy(), directions=8).shape == (146,), "the turn is not given back"


def test_the_end_of_the_interpreter_waits_for_jobs(tmp_path: Path) -> None:
    """A job would use a driver that is no longer there."""
    child = python(
        """
        import threading, time
        import numpy as np
        import finalgather as fg

        begun = threading.Event()
        scene = fg.Scene.from_arrays(np.eye(3), [[0, 1, 2]])
        job = dict(what="ao", directions=1_000_000, pipeline="kill", progress=lambda *call: begun.set(), checkpoint="a.part")
        threading.Thread(target=fg.bake, args=(scene,), kwargs=job, daemon=True).start()
        assert begun.wait(20)
    """,
        tmp_path,
    )
    out, err = child.communicate(timeout=60)
    assert child.returncode == 0, (child.returncode, out, err)
    # A job that is ended keeps its sums. One that dies with its thread does not.
    assert (tmp_path / "a.part").exists()


def test_time_and_what_it_does_not_go_with(tmp_path: Path) -> None:
    vertices, faces, _ = room()
    scene = fg.Scene.from_arrays(vertices, faces, env=1.0)
    film = fg.render(scene, size=16, photons=100, time=0.2)
    assert film.report["settings"]["directions"] >= 1
    with pytest.raises(fg.UsageError, match="directions are given too"):
        fg.render(scene, size=16, photons=100, time=1.0, directions=64)
    with pytest.raises(fg.UsageError, match="nothing can be resumed"):
        fg.render(scene, size=16, photons=100, time=1.0, checkpoint=tmp_path / "a.part", resume=True)


def test_python_goes_on_while_a_job_works() -> None:
    """The GIL is free: this thread counts while another bakes."""
    scene, counted = bumpy(), []
    worker = threading.Thread(target=openness, args=(scene,), kwargs={"directions": 1 << 14})
    worker.start()
    while worker.is_alive():
        counted.append(time.monotonic())
        time.sleep(0.001)
    gaps = np.diff(counted)
    # With the GIL held, all of the job would be one gap.
    assert len(counted) > 20 and gaps.max() < 0.5 * (counted[-1] - counted[0])


def job_of_process(seed: int) -> Array:
    return baked_with(bumpy(), seed)


@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_processes(method: str) -> None:
    with multiprocessing.get_context(method).Pool(2) as pool:
        found = pool.map_async(job_of_process, range(2)).get(timeout=60)
    assert all(same_bits(values, job_of_process(seed)) for seed, values in enumerate(found))


def test_a_fork_after_a_scene_with_a_sky_is_told(tmp_path: Path) -> None:
    """Several threads make its light as it is loaded."""
    child = python(
        f"""
        import multiprocessing, warnings
        import finalgather as fg
        warnings.simplefilter("ignore", DeprecationWarning)

        path = {str(SCENES / "open.toml")!r}
        fg.Scene.load(path)

        def load():
            try:
                fg.Scene.load(path)
                sender.send("worked")
            except fg.UsageError as error:
                sender.send("told" if "fork" in error.problem else str(error))

        context = multiprocessing.get_context("fork")
        receiver, sender = context.Pipe(duplex=False)
        process = context.Process(target=load)
        process.start()
        print(receiver.recv() if receiver.poll(20) else "hangs", flush=True)
        process.kill()
    """,
        tmp_path,
    )
    out, err = child.communicate(timeout=60)
    assert out.split() == ["told"], out + err


def test_a_fork_after_a_job_is_told(tmp_path: Path) -> None:
    """Threads and the device do not survive a fork. What needs them must say so, not hang."""
    child = python(
        """
        import multiprocessing, warnings
        import numpy as np
        import finalgather as fg
        warnings.simplefilter("ignore", DeprecationWarning)

        scene = fg.Scene.from_arrays(np.eye(3), [[0, 1, 2]], env=1.0)
        film = fg.render(scene, size=64, directions=8, photons=100)
        film.write("film.exr")
        jobs = {
            "bake": lambda: fg.bake(scene, what="ao", directions=8),
            "relight": lambda: fg.relight(np.ones((3, 9, 3)), 1.0),
            "compare": lambda: fg.compare(film, film),
            "sky": lambda: fg.Scene.from_arrays(np.eye(3), [[0, 1, 2]], sun=(120, 30), sky=True),
            "arrays": lambda: fg.Scene.from_arrays(np.eye(3), [[0, 1, 2]]),
            "read": lambda: fg.Film.read("film.exr"),
            "bytes": film.to_srgb,
            "png": film._repr_png_,
            "write": lambda: film.write("film.png"),
            "exr": lambda: film.write("film.exr"),
        }

        def outcome(job):
            try:
                job()
                return "worked"
            except fg.UsageError as error:
                return "told" if "fork" in error.problem and "spawn" in error.cure else str(error)

        context = multiprocessing.get_context("fork")
        for name, job in jobs.items():
            receiver, sender = context.Pipe(duplex=False)
            process = context.Process(target=lambda: sender.send(outcome(job)))
            process.start()
            print(name, receiver.recv() if receiver.poll(5) else "hangs", flush=True)
            process.kill()
    """,
        tmp_path,
    )
    out, err = child.communicate(timeout=60)
    found = dict(line.split(" ", 1) for line in out.splitlines())
    assert found["bake"] == "told", out + err
    # What needs no threads may work.
    assert len(found) == 10 and set(found.values()) <= {"told", "worked"}, out + err


# What is said


def test_warnings_can_be_errors() -> None:
    vertices, faces, _ = room()
    with warnings.catch_warnings():
        warnings.simplefilter("error", fg.Warning)
        with pytest.raises(fg.Warning, match="sky"):
            fg.bake(fg.Scene.from_arrays(vertices, faces), vertices=True, directions=8, photons=100)


def test_notes_go_to_the_log(capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture) -> None:
    """A job prints nothing of its own."""
    vertices, faces, _ = room()
    with caplog.at_level(logging.DEBUG, logger="finalgather"):
        fg.render(fg.Scene.from_arrays(vertices, faces, env=1.0), size=16, directions=16, photons=500)
    assert capfd.readouterr() == ("", "")
    assert {record.name.split(".")[0] for record in caplog.records} <= {"finalgather"}
