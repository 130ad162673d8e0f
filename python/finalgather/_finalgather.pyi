"""Types of the compiled part. `finalgather` gives all of these names."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, Literal, TypedDict, Union, final

import numpy as np
from numpy.typing import ArrayLike, NDArray
from typing_extensions import Unpack

__version__: str

Path = Union[str, PathLike[str]]
# A lat-long picture (.hdr, .exr), its texels [height, width, 3], a colour, or a grey: radiance in W/(m² sr).
EnvironmentLike = Union[Path, ArrayLike]
Color = Union[float, Sequence[float], NDArray[np.floating[Any]]]
Vector = Union[Sequence[float], NDArray[np.floating[Any]]]
# Directions done, directions in all, seconds left once they can be told.
Progress = Union[bool, Callable[[int, int, Union[float, None]], object], None]
Quantity = Literal["irradiance", "ao", "bent_normal", "sky", "sh", "prt", "prt_unshadowed"]

class BakeSettings(TypedDict, total=False):
    """Settings by their keys in scene files. Those of the scene hold where none is given."""

    seed: int
    size: Union[int, Sequence[int]]
    directions: int
    sequence: Literal["random", "r2", "sobol"]
    pipeline: Literal["auto", "kill", "early-kill", "fused", "raycast", "raycast-gl"]
    layer_size: Union[Literal["auto"], int]
    stop_fraction: float
    photons: int
    photon_depth: int
    photon_map: Literal["surface", "grid"]
    grid_cells: int
    light_samples: int
    exposure: Union[Literal["auto"], float]
    background: Union[str, Sequence[float]]

class Settings(BakeSettings, total=False):
    """Those of pictures too."""

    points: Literal["auto", "camera", "traced"]
    interleave: Union[Literal["auto"], int]
    ground: bool
    estimator: Literal["self-normalised", "plain"]
    target_error: float

@final
class Scene:
    """Surfaces and lights. It never changes, so threads may share it."""

    @staticmethod
    def load(
        path: Path,
        *,
        env: Union[EnvironmentLike, None] = None,
        sun: Union[Vector, None] = None,
        sky: bool = False,
        camera: Union[str, None] = None,
        gltf_scene: Union[str, None] = None,
        smooth_angle: Union[float, None] = None,
        flip: bool = False,
        clay: bool = False,
        strict: bool = False,
        allow_outside: bool = False,
        default_light: bool = True,
    ) -> Scene: ...
    @staticmethod
    def from_arrays(
        vertices: ArrayLike,
        faces: ArrayLike,
        *,
        normals: Union[ArrayLike, None] = None,
        uv: Union[ArrayLike, None] = None,
        albedo: Union[Color, ArrayLike, None] = None,
        texture: Union[ArrayLike, None] = None,
        emission: Union[Color, ArrayLike, None] = None,
        env: Union[EnvironmentLike, None] = None,
        sun: Union[Vector, None] = None,
        sky: bool = False,
        smooth_angle: Union[float, None] = None,
        flip: bool = False,
        clay: bool = False,
        strict: bool = False,
        default_light: bool = True,
        name: str = ...,
    ) -> Scene: ...
    @staticmethod
    def from_trimesh(
        mesh: Any,
        *,
        smooth: bool = False,
        env: Union[EnvironmentLike, None] = None,
        sun: Union[Vector, None] = None,
        sky: bool = False,
        strict: bool = False,
        default_light: bool = True,
    ) -> Scene: ...
    @property
    def vertex_count(self) -> int: ...
    @property
    def face_count(self) -> int: ...
    @property
    def bounds(self) -> NDArray[np.float64]: ...
    @property
    def warnings(self) -> list[str]: ...
    @property
    def files(self) -> list[str]: ...
    def __repr__(self) -> str: ...
    def _repr_html_(self) -> str: ...

@final
class Film:
    """A picture: named channels of 32 bits, linear."""

    @staticmethod
    def read(path: Path) -> Film: ...
    @property
    def rgb(self) -> NDArray[np.float32]: ...
    @property
    def alpha(self) -> Union[NDArray[np.float32], None]: ...
    @property
    def size(self) -> tuple[int, int]: ...
    @property
    def channels(self) -> list[str]: ...
    @property
    def layers(self) -> list[str]: ...
    def __getitem__(self, name: str) -> NDArray[np.float32]: ...
    def __contains__(self, name: object, /) -> bool: ...
    def __array__(self, dtype: Any = None, copy: Union[bool, None] = None) -> NDArray[Any]: ...
    @property
    def error(self) -> Union[float, None]: ...
    @property
    def report(self) -> dict[str, Any]: ...
    @property
    def warnings(self) -> list[str]: ...
    def to_srgb(
        self, *, exposure: Union[float, Literal["auto"], None] = None, background: Union[str, Sequence[float], None] = None
    ) -> NDArray[np.uint8]: ...
    def write(
        self,
        path: Path,
        *,
        exposure: Union[float, Literal["auto"], None] = None,
        background: Union[str, Sequence[float], None] = None,
    ) -> None: ...
    def __repr__(self) -> str: ...
    def _repr_png_(self) -> bytes: ...
    def _repr_html_(self) -> str: ...

@final
class Baked(Mapping[str, NDArray[np.float32]]):
    """Values at points: an array of each quantity by its name, new each time."""

    def __getitem__(self, name: str) -> NDArray[np.float32]: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[str]: ...
    @property
    def units(self) -> dict[str, str]: ...
    @property
    def positions(self) -> NDArray[np.float64]: ...
    @property
    def normals(self) -> NDArray[np.float32]: ...
    @property
    def faces(self) -> Union[NDArray[np.uint32], None]: ...
    @property
    def sources(self) -> Union[NDArray[np.uint32], None]: ...
    @property
    def uv(self) -> Union[NDArray[np.float32], None]: ...
    @property
    def mask(self) -> Union[NDArray[np.bool_], None]: ...
    @property
    def report(self) -> dict[str, Any]: ...
    @property
    def warnings(self) -> list[str]: ...
    def write(self, path: Path, *, exposure: Union[float, Literal["auto"], None] = None) -> None: ...
    def __repr__(self) -> str: ...
    def _repr_html_(self) -> str: ...

@final
class Comparison:
    """How far a picture is from its reference."""

    def as_dict(self) -> dict[str, float]: ...
    def __getitem__(self, name: str) -> float: ...
    @property
    def map(self) -> Film: ...
    def __repr__(self) -> str: ...
    def _repr_png_(self) -> bytes: ...
    def _repr_html_(self) -> str: ...

def _end() -> None: ...
def render(
    scene: Scene,
    *,
    eye: Union[Vector, None] = None,
    target: Union[Vector, None] = None,
    up: Union[Vector, None] = None,
    fov: Union[float, None] = None,
    time: Union[float, None] = None,
    memory: Union[int, None] = None,
    checkpoint: Union[Path, None] = None,
    resume: bool = False,
    progress: Progress = None,
    backend: str = "auto",
    device: Union[str, int, None] = None,
    **settings: Unpack[Settings],
) -> Film: ...
def bake(
    scene: Scene,
    *,
    vertices: bool = False,
    points: Union[Sequence[ArrayLike], None] = None,
    lightmap: Union[int, None] = None,
    camera: bool = False,
    what: Union[Quantity, Sequence[Quantity], None] = None,
    order: int = 3,
    gather_bounces: int = 2,
    ao_distance: Union[float, None] = None,
    radiance_cache: Literal["photons", "gathered"] = "photons",
    per: Literal["source", "row"] = "source",
    texels_per_unit: Union[float, None] = None,
    uvs: Literal["auto", "own", "atlas"] = "auto",
    padding: int = 2,
    samples_per_texel: int = 4,
    eye: Union[Vector, None] = None,
    target: Union[Vector, None] = None,
    up: Union[Vector, None] = None,
    fov: Union[float, None] = None,
    memory: Union[int, None] = None,
    checkpoint: Union[Path, None] = None,
    resume: bool = False,
    progress: Progress = None,
    backend: str = "auto",
    device: Union[str, int, None] = None,
    **settings: Unpack[BakeSettings],
) -> Baked: ...
def prt(
    scene: Scene,
    *,
    order: int = 3,
    gather_bounces: int = 2,
    unshadowed: bool = False,
    memory: Union[int, None] = None,
    checkpoint: Union[Path, None] = None,
    resume: bool = False,
    progress: Progress = None,
    backend: str = "auto",
    device: Union[str, int, None] = None,
    **settings: Unpack[BakeSettings],
) -> NDArray[np.float32]: ...
def relight(transfer: ArrayLike, env: EnvironmentLike) -> NDArray[np.float32]: ...
def relight_picture(
    scene: Scene,
    transfer: ArrayLike,
    env: EnvironmentLike,
    *,
    size: Union[int, Sequence[int], None] = None,
    eye: Union[Vector, None] = None,
    target: Union[Vector, None] = None,
    up: Union[Vector, None] = None,
    fov: Union[float, None] = None,
) -> Film: ...
def compare(
    picture: Union[Film, ArrayLike],
    reference: Union[Film, ArrayLike],
    *,
    mask: Union[ArrayLike, None] = None,
    trim: float = 0.0,
    exposure: float = 0.0,
) -> Comparison: ...
