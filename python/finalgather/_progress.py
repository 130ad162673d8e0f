"""What `progress=True` shows."""

from __future__ import annotations

import sys
from typing import Any, Optional


class Bar:
    """A bar of tqdm, or a line on stderr where there is none."""

    def __init__(self) -> None:
        self._bar: Optional[Any] = None
        try:
            from tqdm.auto import tqdm
        except ImportError:
            return
        self._bar = tqdm(unit="direction", leave=False)

    def __call__(self, done: int, total: int, seconds_left: Optional[float]) -> None:
        if self._bar is not None:
            self._bar.total = total
            self._bar.update(done - self._bar.n)
            return
        left = "" if seconds_left is None else f", {seconds_left:.0f} s left"
        print(f"\r{done} of {total} directions{left} ", end="", file=sys.stderr, flush=True)

    def close(self) -> None:
        if self._bar is not None:
            self._bar.close()
        else:
            print(file=sys.stderr)
