"""Ranging sensors: closed forms, receivers, beam, and a level run over forest and buildings.

Source 003, chapter 2.  Elevation and records of the source are not public: results of geometry and physics are
exact here, and results that depend on the terrain are ratios over synthetic terrains.

    T3   minimum range of a pulse (eq. 2.5) and maximum rate of measurements of 1000 m (eq. 2.36)
    T4   beats of 2.6 and 4 MHz through two receivers at radio frequency, mixer by mixer, compared with the baseband
    T5   a level surface: d = h / cos (eq. 2.67), for every ray within 75 deg of the boresight
    T6   triangles, corners and rays of the geodesic dome (eq. 2.65, 2.66)
    F    fig. 2.50: roll of 0 to 75 deg at 100, 400 and 800 m, narrow and wide beam; exact, no random numbers
    T1   level run 100 m over forest and buildings: RMS of model minus measured over nadir minus measured, N = runs, the
         unit is the terrain; the upper end of the 95 % bootstrap interval is at most 0.5 for the wide antenna.  The
         antenna of the campaign is not published; the narrow one, approach and ramp are reported
"""

from __future__ import annotations

import numpy as np

from fti.constants import SPEED_OF_LIGHT
from fti.parallel_runs import Progress
from fti.ranging.radar.dome import half_dome, sphere
from fti.study import DrawFigure, StudyResult, _level_run
from fti.study._signals import receivers
from fti.study._sweep import attitude
from fti.terrain.terrain import Terrain

RUNS = 20
SEED = 3

#: Pulses of a radar and of a laser altimeter (2.1.1.3, 2.1.2) [s], and the range of eq. 2.36 [m].
PULSES_S = (100e-9, 10e-9)
FARTHEST_M = 1000.0
#: Order of the dome of fig. 2.30, and maximum angle off the boresight for the comparison with eq. 2.67.
ORDER = 12
MAX_OFF_BORESIGHT = np.radians(75.0)
LEVEL_HEIGHT_M = 100.0
#: Share of the exact parts in the progress.
EXACT_SHARE = 0.3


def study(runs: int, seed: int, progress: Progress) -> list[StudyResult]:
    """Closed forms, the beam, the receivers; then ``runs`` terrains."""
    exact = [*pulses(), *receivers(seed), *beam(), *attitude()]
    progress(EXACT_SHARE)
    level_runs = []
    for run in range(runs):
        level_runs.append(_level_run.fly_paths(seed + run))
        progress(EXACT_SHARE + (1.0 - EXACT_SHARE) * (run + 1) / runs)
    return [*exact, *_level_run.judge(level_runs, seed)]


def drawings(seed: int) -> dict[str, DrawFigure]:
    """Pictures like those of the source."""
    from fti.study import _antenna_plots, _beam_plots, _level_run_plots, _signal_plots  # noqa: PLC0415 - matplotlib

    return {
        "dome": _antenna_plots.dome,
        "antennas": _antenna_plots.antennas,
        "doppler": _signal_plots.doppler,
        "receiver-loat": _signal_plots.loat,
        "receiver-ssb": _signal_plots.ssb,
        "baseband": _signal_plots.baseband,
        "roll-sweep": _beam_plots.roll_sweep,
        "leading-edge": lambda: _beam_plots.response(seed),
        "level-run": lambda: _level_run_plots.level_run(seed),
    }


def pulses() -> list[StudyResult]:
    """T3."""
    radar, laser = (0.5 * SPEED_OF_LIGHT * pulse for pulse in PULSES_S)
    rate = 1e-3 * SPEED_OF_LIGHT / (2.0 * FARTHEST_M)
    near = "nearest range of a pulse of"
    return [
        StudyResult("T3.radar", f"{near} 100 ns [m] (eq. 2.5)", radar, "14.990", f"{radar:.3f}" == "14.990"),
        StudyResult("T3.laser", f"{near} 10 ns [m] (eq. 2.5)", laser, "1.499", f"{laser:.3f}" == "1.499"),
        StudyResult("T3.rate", "pulses to 1000 m and back [kHz] (eq. 2.36)", rate, "150", round(rate) == 150),
    ]


def level_ranges() -> tuple[np.ndarray, np.ndarray]:
    """Angle off boresight [rad] and range [m] of the rays of a beam that points straight down on a level surface."""
    rays_s = half_dome(ORDER).within(MAX_OFF_BORESIGHT).rays_s
    ground = Terrain.from_array(np.zeros((51, 51)), 20.0, lat0=0.8, lon0=0.2, east0=-500.0, north0=-500.0)
    rays_l = rays_s * [1.0, 1.0, -1.0]
    found = ground.cast(np.array([3.0, 4.0, LEVEL_HEIGHT_M]), rays_l, 1000.0)
    return np.arccos(rays_s[:, 2]), found


def beam() -> list[StudyResult]:
    """T5 and T6."""
    angle, found = level_ranges()
    error = float(np.max(np.abs(found * np.cos(angle) / LEVEL_HEIGHT_M - 1.0)))
    whole, half = sphere(ORDER), half_dome(ORDER)
    triangles, corners, rays = len(whole.triangles), len(whole.rays), len(half)
    return [
        StudyResult("T5", f"worst of {len(found)} ranges to a level surface, relative", error, "< 1e-9", error < 1e-9),
        StudyResult(
            "T6.triangles", "triangles of the dome of order 12 (eq. 2.65)", triangles, "2880", triangles == 2880
        ),
        StudyResult("T6.corners", "its corners (eq. 2.66)", corners, "1442", corners == 1442),
        StudyResult("T6.rays", "rays of its half with the equator", rays, "751", rays == 751),
    ]
