#!/usr/bin/env python3
"""Bakes all meshes of a folder: one .npz for each, over processes, Dask or Ray.

    bake_folder.py scans/ baked/ --what ao,prt --directions 1000 --workers 4
    bake_folder.py scans/ baked/ --dask tcp://scheduler:8786
    bake_folder.py scans/ baked/ --ray

Run it again to go on: finished meshes are left alone, and an interrupted one continues from its checkpoint. A mesh that
fails does not stop the others. Failures are listed at the end, with exit code 1. Dask and Ray on other machines need
the folders at the same paths.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import multiprocessing
import os
import sys
from collections.abc import Iterator
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Optional

ENDINGS = {".obj", ".glb", ".gltf", ".ply", ".stl"}


@dataclass(frozen=True)
class Options:
    """What shapes the values."""

    what: tuple[str, ...]
    directions: int
    order: int


@dataclass(frozen=True)
class Task:
    mesh: str
    out: str
    options: Options
    threads: int


@dataclass(frozen=True)
class Outcome:
    mesh: str
    # "baked", "there already", "stopped" or "failed".
    state: str
    message: str = ""


def sha256(path: str) -> str:
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def is_finished(task: Task, record: Path, version: str) -> bool:
    """Whether a record names the same options, version and bytes of the files that the mesh was read from."""
    try:
        known = json.loads(record.read_text())
        same = known["options"] == json.loads(json.dumps(asdict(task.options))) and known["version"] == version
        return same and Path(task.out).exists() and all(sha256(file) == sha for file, sha in known["files"].items())
    except (OSError, ValueError, KeyError):
        return False


# Of a worker, that Ctrl-C has reached it: a pool hands it one task more than it works on.
stopped = False


def bake_one(task: Task) -> Outcome:
    """Runs in a worker. Returns all failures, so that a pool need not know their classes."""
    global stopped
    if stopped:
        return Outcome(task.mesh, "stopped")
    # Read when the first job starts. Workers of Dask and Ray do not inherit it.
    os.environ.setdefault("RAYON_NUM_THREADS", str(task.threads))
    os.environ.setdefault("LP_NUM_THREADS", str(task.threads))
    import finalgather as fg

    try:
        record = Path(task.out + ".json")
        if is_finished(task, record, fg.__version__):
            return Outcome(task.mesh, "there already")
        scene = fg.Scene.load(task.mesh)
        files = {file: sha256(file) for file in scene.files}
        known = {"options": asdict(task.options), "version": fg.__version__, "files": files}
        # A checkpoint refuses another job, so each job has a name of its own.
        name = hashlib.sha256(json.dumps(known, sort_keys=True).encode()).hexdigest()[:16]
        checkpoint = Path(f"{task.out}.{name}.part")
        baked = fg.bake(
            scene,
            vertices=True,
            what=list(task.options.what),  # type: ignore[arg-type]
            order=task.options.order,
            directions=task.options.directions,
            checkpoint=checkpoint,
            resume=True,
        )
        # A half-made result never has a record.
        record.unlink(missing_ok=True)
        baked.write(task.out)
        record.write_text(json.dumps(known))
        for old in checkpoint.parent.glob(f"{Path(task.out).name}.*.part*"):
            old.unlink(missing_ok=True)
        return Outcome(task.mesh, "baked")
    except KeyboardInterrupt:
        stopped = True
        return Outcome(task.mesh, "stopped")
    except Exception as error:
        return Outcome(task.mesh, "failed", f"{type(error).__name__}: {error}")


def by_processes(tasks: list[Task], workers: int) -> Iterator[Outcome]:
    """Processes are spawned: threads and devices do not survive a fork."""

    def pool(size: int) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(size, mp_context=multiprocessing.get_context("spawn"))

    broken: list[Task] = []
    with pool(workers) as executor:
        futures: dict[Future[Outcome], Task] = {executor.submit(bake_one, task): task for task in tasks}
        try:
            for future in as_completed(futures):
                try:
                    yield future.result()
                except BrokenProcessPool:
                    broken.append(futures[future])
        except BaseException:
            executor.shutdown(wait=False, cancel_futures=True)
            raise
    # A worker that dies, by a driver or for want of memory, takes the tasks of the others with it. Alone, each shows
    # whether it was its own fault.
    for task in broken:
        with pool(1) as executor:
            try:
                yield executor.submit(bake_one, task).result()
            except BrokenProcessPool:
                yield Outcome(task.mesh, "failed", "its process died; it may need more memory")


def by_dask(tasks: list[Task], workers: int, address: str) -> Iterator[Outcome]:
    from dask.distributed import Client, LocalCluster
    from dask.distributed import as_completed as dask_as_completed

    def outcomes(client: Any) -> Iterator[Outcome]:
        # Outcomes are no function of the arguments: files change.
        futures = {client.submit(bake_one, task, pure=False, retries=0): task for task in tasks}
        for future in dask_as_completed(futures):
            if future.status == "finished":
                yield future.result()
            else:
                yield Outcome(futures[future].mesh, "failed", str(future.exception()))

    if address == "local":
        with (
            LocalCluster(n_workers=workers, threads_per_worker=1, dashboard_address=None) as cluster,
            Client(cluster) as client,
        ):
            yield from outcomes(client)
    else:
        with Client(address) as client:
            yield from outcomes(client)


def by_ray(tasks: list[Task], workers: int, address: str) -> Iterator[Outcome]:
    import ray

    if address == "local":
        # One task for each of so many processors.
        ray.init(address="local", num_cpus=workers, include_dashboard=False, log_to_driver=False)
    else:
        ray.init(address=address)
    try:
        remote = ray.remote(num_cpus=1 if address == "local" else tasks[0].threads, max_retries=0)(bake_one)
        waiting = {remote.remote(task): task for task in tasks}
        while waiting:
            (done,), _ = ray.wait(list(waiting), num_returns=1)
            task = waiting.pop(done)
            try:
                yield ray.get(done)
            except ray.exceptions.RayError as error:
                yield Outcome(task.mesh, "failed", str(error))
    finally:
        ray.shutdown()


def positive(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError("give 1 or more")
    return number


def arguments(given: Optional[list[str]]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description="Bakes all meshes of a folder at their vertices: one .npz for each.")
    parser.add_argument("folder", type=Path, help="folder of meshes: " + " ".join(sorted(ENDINGS)))
    parser.add_argument("out", type=Path, help="folder for the .npz files; made if it is missing")
    parser.add_argument("--what", default="ao", help="quantities, with commas between them (default: %(default)s)")
    parser.add_argument("--directions", type=positive, default=1000, help="(default: %(default)s)")
    parser.add_argument("--order", type=int, default=3, help="bands of spherical harmonics (default: %(default)s)")
    parser.add_argument(
        "--workers", type=positive, default=1, metavar="N", help="meshes at a time on this machine (default: %(default)s)"
    )
    parser.add_argument("--threads", type=positive, metavar="N", help="threads of a worker (default: cores / workers)")
    engine = parser.add_mutually_exclusive_group()
    engine.add_argument("--dask", metavar="ADDRESS", help="scheduler, or local for a cluster of --workers processes")
    engine.add_argument(
        "--ray", nargs="?", const="local", metavar="ADDRESS", help="cluster, or local (default) for --workers processes"
    )
    return parser.parse_args(given)


def main(given: Optional[list[str]] = None) -> int:
    options = arguments(given)
    if not options.folder.is_dir():
        print(f"{options.folder}: there is no such folder", file=sys.stderr)
        return 2
    meshes = sorted(path for path in options.folder.iterdir() if path.suffix.lower() in ENDINGS)
    if not meshes:
        print(f"{options.folder}: no mesh ({' '.join(sorted(ENDINGS))})", file=sys.stderr)
        return 2
    options.out.mkdir(parents=True, exist_ok=True)
    shape = Options(tuple(options.what.split(",")), options.directions, options.order)
    threads = options.threads or max(1, (os.cpu_count() or 1) // options.workers)
    # Spawned processes inherit these.
    os.environ.setdefault("RAYON_NUM_THREADS", str(threads))
    os.environ.setdefault("LP_NUM_THREADS", str(threads))
    # a.obj and a.ply have results of their own.
    tasks = [Task(str(mesh), str(options.out / f"{mesh.name}.npz"), shape, threads) for mesh in meshes]
    if options.dask:
        outcomes = by_dask(tasks, options.workers, options.dask)
    elif options.ray:
        outcomes = by_ray(tasks, options.workers, options.ray)
    else:
        outcomes = by_processes(tasks, options.workers)
    unfinished: list[Outcome] = []
    try:
        for number, outcome in enumerate(outcomes, start=1):
            print(f"{number}/{len(tasks)} {outcome.mesh}: {outcome.state}", flush=True)
            if outcome.state in ("failed", "stopped"):
                unfinished.append(outcome)
    except KeyboardInterrupt:
        print("stopped; the same command goes on", file=sys.stderr)
        return 130
    for outcome in unfinished:
        print(f"{outcome.mesh}: {outcome.state} {outcome.message}".rstrip(), file=sys.stderr)
    return 1 if unfinished else 0


if __name__ == "__main__":
    sys.exit(main())
