"""Final gathering by rasterised ray bundles: pictures, openness, radiance transfer and light maps, from numpy and back.

>>> import finalgather as fg
>>> scene = fg.Scene.from_arrays(vertices, faces)
>>> openness = fg.bake(scene, what="ao", directions=256)["ao"]

Vectors are in the units and axes of the scene, +y up where nothing else is said. Light is linear, RGB.
"""

from collections.abc import Mapping as _Mapping

from ._finalgather import (
    Baked,
    Comparison,
    Film,
    Scene,
    __version__,
    bake,
    compare,
    prt,
    relight,
    relight_picture,
    render,
)
from .errors import DeviceError, Error, InputError, Interrupted, OutputError, UsageError
from .errors import Warning as Warning  # Not in __all__: the builtin keeps its name after `import *`.

_Mapping.register(Baked)

__all__ = [
    "Baked",
    "Comparison",
    "DeviceError",
    "Error",
    "Film",
    "InputError",
    "Interrupted",
    "OutputError",
    "Scene",
    "UsageError",
    "__version__",
    "bake",
    "compare",
    "prt",
    "relight",
    "relight_picture",
    "render",
]
