"""Geoid grids that tests need: ``from tests.grids import needs_egm96``."""

from __future__ import annotations

import pytest

from fti.errors import MissingError
from fti.geodesy.geoid import find_grid, grid_directories


def _why_not(model: str) -> str:
    try:
        find_grid(model, grid_directories())
    except MissingError as error:
        return str(error)
    return ""


needs_egm96 = pytest.mark.skipif(bool(_why_not("egm96")), reason=_why_not("egm96") or "the grid is there")
