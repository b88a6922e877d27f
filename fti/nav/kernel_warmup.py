"""Compiles all kernels that a configuration needs, before live operation."""

from __future__ import annotations

from fti.config import Config
from fti.geodesy.kernel_warmup import warm_up as warm_up_geodesy
from fti.nav.altimetry import expected_range
from fti.nav.filter.navigator import warm_up as warm_up_filter
from fti.nav.integrity import statistics, window
from fti.nav.terrain_reference import Ground


def warm_up(config: Config, ground: Ground | None) -> None:
    """Compile the kernels, or load them from the cache (seconds on the first start)."""
    warm_up_geodesy()
    if config.nav.approach:
        statistics.warm_up()
        window.warm_up()
    if config.nav.filter:
        warm_up_filter()
    for name in config.nav.altimeters:
        device = config.find_device(name)
        if device and ground:
            expected_range.warm_up(device, ground)
