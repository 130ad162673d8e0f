"""What `progress=True` shows."""

from __future__ import annotations

import sys
import warnings
from typing import Any, Optional


class Bar:
    """A bar of tqdm, or a line on stderr where there is none."""

    def __init__(self) -> None:
        self._bar: Optional[Any] = None
        self._new: Optional[Any] = None
        try:
            with warnings.catch_warnings():
                # It asks for widgets in a notebook that has none, and does without.
                warnings.simplefilter("ignore")
                from tqdm.auto import tqdm
        except ImportError:
            return
        self._new = tqdm

    def __call__(self, done: int, total: int, seconds_left: Optional[float]) -> None:
        if self._new is None:
            left = "" if seconds_left is None else f", {seconds_left:.0f} s left"
            print(f"\r{done} of {total} directions{left} ", end="", file=sys.stderr, flush=True)
            return
        if self._bar is None:
            self._bar = self._new(total=total, unit="direction")
        self._bar.update(done - self._bar.n)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
        elif self._new is None:
            print(file=sys.stderr)
