"""Calibration: sigma factors, and small references."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy.special import gammaincinv

from fti.errors import ConfigError
from fti.hil.approach_reference import calibration
from fti.hil.approach_reference.approaches import RA4500, TerrainGround
from fti.hil.approach_reference.calibration import calibrate, make_reference, with_receivers
from fti.hil.approach_reference.options import ReferenceOptions
from fti.hil.approach_reference.profile import few_draws_factor, make_surface
from fti.hil.approach_reference.range_map import map_ground
from fti.messages.outputs import ClearanceIntegrity, IntegrityState
from fti.nav.integrity.approach import ApproachPath, load_airfield
from fti.nav.integrity.reference import ApproachReference, Limits
from fti.terrain.demo_scene import DEMO_AIRFIELD, demo_scene
from tests.helpers import ROOT

DEMO = ROOT / "configs" / "profiles" / "demo.csv"


@pytest.fixture(scope="module")
def ground() -> TerrainGround:
    airfield = load_airfield(DEMO_AIRFIELD.read_text(), str(DEMO_AIRFIELD))
    return TerrainGround(ApproachPath(airfield), RA4500, (demo_scene(),))


#: A map of ranges for each receiver is most of the time.
RECEIVERS = 8


def plan(s_max: float, runs: int, receivers: int = RECEIVERS) -> ReferenceOptions:
    return ReferenceOptions(
        surface="demo", date="2018-06-01", s_max=s_max, draws=5, runs=runs, offset_runs=2, obstacle_runs=2,
        receivers=receivers,
    )  # fmt: skip


@pytest.mark.parametrize("n", [5, 10, 30, 100])
def test_few_draws_widen_sigma_as_the_chi_square_asks(n: int) -> None:
    chi_square = 2 * gammaincinv((n - 1) / 2, 0.05)  # its 5 % quantile
    assert few_draws_factor(n) == pytest.approx(np.sqrt((n - 1) / chi_square), rel=0.016)


def test_a_small_reference_is_made_and_reads_back(ground: TerrainGround) -> None:
    done: list[tuple[str, float]] = []
    reference = make_reference(ground, plan(1200.0, 20), lambda *step: done.append(step))
    again = ApproachReference.parse(reference.to_text(), "x")
    assert (again.hash, again.header) == (reference.hash, reference.header)
    assert reference.s_ref.min() >= 0.5 * few_draws_factor(5) - 1e-3
    assert 5.0 <= reference.header.profile.correlation_m <= 50.0
    assumed = reference.header.assumptions
    assert assumed is not None
    assert (assumed.nav_vertical_sd_m, assumed.track_sd_m, assumed.elevation_short_sd_m) == (3.0, 15.0, 2.0)
    assert (assumed.receiver, assumed.receivers, assumed.beam_deg) == ("drawn", RECEIVERS, 40.0)
    limits = reference.header.limits
    assert all(1.0 < limit < 200.0 for limit in (limits.t1, limits.t3, limits.t4))
    assert (limits.runs, limits.verified_runs) == (20, 5)
    stages = [
        "range map",
        "profile",
        "correlation",
        "nominal approaches",
        "verification",
        "off the track",
        "obstacles",
    ]
    assert list(dict.fromkeys(what for what, _ in done)) == stages
    assert done[-1] == ("obstacles", 1.0)


def test_the_limit_of_t4_is_that_of_the_templates_which_the_file_names(
    ground: TerrainGround, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the same approaches: the greatest of several is no less than that of single bins; others are alike."""
    recorded_maxima, make_limits = list[np.ndarray](), calibration.make_limits

    def remembered(plan: ReferenceOptions, maxima: np.ndarray) -> Limits:
        recorded_maxima.append(maxima)
        return make_limits(plan, maxima)

    monkeypatch.setattr(calibration, "make_limits", remembered)
    options = plan(1200.0, 20)
    mapped = map_ground(with_receivers(ground, options), options.s_max, lambda _: None)
    surface = make_surface(mapped, options, lambda *step: None)
    for widths in ((15.0, 30.0, 50.0, 75.0, 100.0), ()):
        monkeypatch.setattr(calibration, "WIDTHS_M", widths)
        limits = calibrate(mapped, surface, options, lambda *step: None).header.limits
        assert limits.t4_widths_m == (5.0, *widths)
    templates, bins = recorded_maxima
    assert np.all(templates[:, 3] >= bins[:, 3])
    assert np.any(templates[:, 3] > bins[:, 3])
    np.testing.assert_array_equal(templates[:, :3], bins[:, :3])


def test_detection_beside_the_track_is_tabulated(ground: TerrainGround) -> None:
    options = replace(plan(1500.0, 20), obstacle_runs=0)
    found = make_reference(ground, options, lambda *step: None).header.detection
    assert found is not None
    assert (found.y_m, found.s_m, found.runs) == ((50.0, 100.0, 200.0), (2000.0, 1000.0), 2)
    assert np.shape(found.pd) == (3, 2)
    assert min(found.pd[2]) > 0.5  # 200 m beside: the ground is another one
    assert all(0.0 <= share <= 1.0 for row in found.pd for share in row)


def test_detection_counts_windows_over_a_limit_and_not_an_alert_that_lasts(
    ground: TerrainGround, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of four windows of the last kilometre one is over T1 and one over T2, and the ALERT lasts through all."""
    make_output = partial(
        ClearanceIntegrity, t_ns=1, t_valid_ns=1, state=IntegrityState.ALERT, reasons=(), valid=True,
        t2_ratio=None, t3_ratio=0.1, t4_ratio=0.9,
    )  # fmt: skip
    outputs = [make_output(s_end=900.0, t1_ratio=t1) for t1 in (1.1, 0.7, 0.7)]
    outputs.append(make_output(s_end=100.0, t1_ratio=0.7, t2_ratio=1.2))
    reference = ApproachReference.parse(DEMO.read_text(), str(DEMO))
    monkeypatch.setattr(calibration, "run_monitor", lambda *_: outputs)
    counts = calibration._off_track_detections(ground, plan(1500.0, 2), reference, (50.0, 0))
    np.testing.assert_array_equal(counts, [[0.0, 2.0], [0.0, 4.0]])


def test_the_same_seed_is_the_same_reference(ground: TerrainGround) -> None:
    first, second = (make_reference(ground, plan(700.0, 6), lambda *step: None).to_text() for _ in range(2))
    assert first == second


def test_a_profile_beyond_the_terrain_reports_where_it_ends(ground: TerrainGround) -> None:
    """The terrain ends 7790 m before the intercept point; a beam of 40 deg needs the last 100 m."""
    with pytest.raises(ConfigError, match=r"no return from 'demo' between 76\d\d and 9200 m"):
        make_reference(ground, plan(9000.0, 6, receivers=1), lambda *step: None)
