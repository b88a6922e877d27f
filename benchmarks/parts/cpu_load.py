"""Loads a core without end: ``arrays`` as navigation does, in compiled code; ``python`` in the interpreter."""

from __future__ import annotations

import os
import sys

import numpy as np


def arrays() -> None:
    """Matrices and trigonometry."""
    rng = np.random.default_rng(1)
    points, turn = rng.random((100_000, 3)), rng.random((3, 3))
    while os.getppid() != 1:
        points = np.sin(points @ turn)


def python() -> None:
    """Numbers and tables."""
    table: dict[int, float] = {}
    n = 0
    while n % 1_000_000 or os.getppid() != 1:
        table[n % 1000] = n * 0.5
        n += 1


if __name__ == "__main__":
    {"arrays": arrays, "python": python}[sys.argv[1]]()
