#!/usr/bin/env python3
"""Ambient occlusion and radiance transfer at the vertices of a mesh: finalgather beside rays of trimesh by Embree.

    compare_trimesh_embree.py --vertices 30000 --rays 256

It needs trimesh and embreex. Both ways take the same number of rays a vertex. Errors are root mean squares over all
vertices, against a reference of finalgather along many other directions. Random rays check the reference: their RMSE
against it should be their standard error, √(p (1 - p) / N).
"""

from __future__ import annotations

import argparse
import time
from typing import Any, Callable, TypeVar

import numpy as np
import trimesh
from numpy.typing import NDArray

import finalgather as fg

Array = NDArray[Any]
T = TypeVar("T")


def scan(vertices: int) -> trimesh.Trimesh:
    """A bumpy ball of about so many vertices, with hollows."""
    rows = max(4, round((vertices / 2) ** 0.5))
    columns = 2 * rows
    latitude = np.pi * np.arange(1, rows) / rows
    azimuth = 2 * np.pi * np.arange(columns) / columns
    ring = np.stack(np.broadcast_arrays(np.sin(latitude)[:, None] * np.cos(azimuth), np.cos(latitude)[:, None],
                                        np.sin(latitude)[:, None] * np.sin(azimuth)), axis=-1)  # fmt: skip
    points = np.vstack([[[0, 1, 0]], ring.reshape(-1, 3), [[0, -1, 0]]])
    centers = np.random.default_rng(1).normal(size=(60, 3))
    centers /= np.linalg.norm(centers, axis=1, keepdims=True)
    points *= 1 - 0.3 * np.exp(-40 * (1 - points @ centers.T)).sum(axis=1, keepdims=True).clip(max=2)
    here, right = np.arange(columns), np.roll(np.arange(columns), -1)
    below = 1 + columns * np.arange(rows - 2)[:, None] + columns
    above = below - columns
    faces = np.concatenate(
        [
            np.stack([0 * here, 1 + right, 1 + here], axis=1),
            np.stack([above + here, above + right, below + right], axis=-1).reshape(-1, 3),
            np.stack([above + here, below + right, below + here], axis=-1).reshape(-1, 3),
            np.stack(
                [len(points) - 1 + 0 * here, len(points) - 1 - columns + here, len(points) - 1 - columns + right],
                axis=1,
            ),
        ]
    )
    return trimesh.Trimesh(points, faces, process=False)


def timed(work: Callable[[], T]) -> tuple[T, float]:
    began = time.perf_counter()
    return work(), time.perf_counter() - began


def rms(difference: Array) -> float:
    return float(np.sqrt(np.mean(difference**2)))


def origins(mesh: trimesh.Trimesh) -> Array:
    """A little above the vertices, so that no ray meets its own faces."""
    return np.asarray(mesh.vertices + 1e-4 * mesh.scale * mesh.vertex_normals)


def occlusion_by_embree(mesh: trimesh.Trimesh, rays: int) -> Array:
    """The share of open rays, in directions that are random and as dense as the cosine."""
    rng = np.random.default_rng(2)
    normals, start = np.asarray(mesh.vertex_normals), origins(mesh)
    opened = np.zeros(len(normals))
    for _ in range(rays):
        # A point of the sphere about the tip of the normal (Lambert's law).
        directions = rng.normal(size=normals.shape)
        directions = normals + directions / np.linalg.norm(directions, axis=1, keepdims=True)
        opened += ~mesh.ray.intersects_any(start, directions)
    return opened / rays


def harmonics(directions: Array) -> Array:
    """Real spherical harmonics of three bands, [N, 9], as finalgather has them."""
    x, y, z = directions.T
    band1 = np.sqrt(3 / (4 * np.pi)) * np.array([y, z, x])
    band2 = np.sqrt(15 / (4 * np.pi)) * np.array(
        [x * y, y * z, (3 * z * z - 1) / np.sqrt(12), x * z, (x * x - y * y) / 2]
    )
    return np.vstack([np.full((1, len(x)), np.sqrt(1 / (4 * np.pi))), band1, band2]).T


def transfer_by_embree(mesh: trimesh.Trimesh, rays: int) -> Array:
    """As papers on digitised humans do (PIFu and others): directions of the whole sphere, shared by all vertices."""
    side = max(1, round(rays**0.5))
    rng = np.random.default_rng(3)
    # One random place in each cell of the unit square.
    u, v = (np.array(list(np.ndindex(side, side))) + rng.random((side * side, 2))).T / side
    z, azimuth = 1 - 2 * u, 2 * np.pi * v
    directions = np.stack([np.sqrt(1 - z * z) * np.cos(azimuth), np.sqrt(1 - z * z) * np.sin(azimuth), z], axis=1)
    normals, start = np.asarray(mesh.vertex_normals), origins(mesh)
    transfer = np.zeros((len(normals), 9))
    for direction, basis in zip(directions, harmonics(directions)):
        cosine = np.maximum(normals @ direction, 0)
        front = np.flatnonzero(cosine)
        seen = ~mesh.ray.intersects_any(start[front], np.tile(direction, (len(front), 1)))
        transfer[front] += (seen * cosine[front])[:, None] * basis
    return transfer * 4 * np.pi / len(directions) / np.pi


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Openness and transfer at vertices: finalgather beside rays of trimesh by Embree."
    )
    parser.add_argument("--vertices", type=int, default=30_000, help="(default: %(default)s)")
    parser.add_argument(
        "--rays", type=int, default=256, help="rays a vertex, over the hemisphere (default: %(default)s)"
    )
    parser.add_argument(
        "--reference", type=int, default=4096, help="directions of the reference (default: %(default)s)"
    )
    options = parser.parse_args()
    rays, many = options.rays, {"directions": options.reference, "sequence": "sobol", "seed": 1}
    mesh = scan(options.vertices)
    scene = fg.Scene.from_trimesh(mesh, smooth=True)
    print(f"{len(mesh.vertices)} vertices, {len(mesh.faces)} triangles, {rays} rays a vertex")
    # What is done once for each process is not a bake's own time.
    fg.bake(scene, vertices=True, what="ao", directions=8)
    mesh.ray.intersects_any(mesh.vertices[:1], mesh.vertex_normals[:1])

    truth = fg.bake(scene, vertices=True, what="ao", **many)["ao"]
    ours, our_seconds = timed(lambda: fg.bake(scene, vertices=True, what="ao", directions=rays)["ao"])
    theirs, their_seconds = timed(lambda: occlusion_by_embree(mesh, rays))
    expected = float(np.sqrt(np.mean(truth * (1 - truth)) / rays))
    print("ambient occlusion")
    print(f"  finalgather      {our_seconds:8.2f} s   RMSE {rms(ours - truth):.5f}")
    print(f"  trimesh, Embree  {their_seconds:8.2f} s   RMSE {rms(theirs - truth):.5f}   expected {expected:.5f}")
    print(f"  RMSE between them                 {rms(ours - theirs):.5f}")

    # Direct transfer only. The whole sphere takes twice as many directions as a hemisphere.
    direct: dict[str, Any] = {"order": 3, "gather_bounces": 0}
    truth = fg.prt(scene, **direct, **many)[..., 0]
    ours, our_seconds = timed(lambda: fg.prt(scene, **direct, directions=rays)[..., 0])
    theirs, their_seconds = timed(lambda: transfer_by_embree(mesh, 2 * rays))
    print("radiance transfer of order 3, without reflections")
    print(f"  finalgather      {our_seconds:8.2f} s   RMSE {rms(ours - truth):.5f}")
    print(f"  PIFu's way       {their_seconds:8.2f} s   RMSE {rms(theirs - truth):.5f}")
    print(f"  RMSE between them                 {rms(ours - theirs):.5f}")


if __name__ == "__main__":
    main()
