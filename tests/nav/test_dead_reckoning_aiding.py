"""Airspeed and magnetic heading as measurements: signs and rows by hand, selection, and configuration errors."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fti.config import Config, parse
from fti.errors import ConfigError
from fti.geodesy.rotations import mat_from_rpy
from fti.messages.measurements import Airspeed, MagneticField, Stamp
from fti.nav.dead_reckoning_aids import DeadReckoningAids
from fti.nav.filter import kernels
from fti.nav.filter.dead_reckoning import MagneticHeading, TrueAirspeed
from fti.nav.filter.error_states import AIRSPEED_DRIFTS, HEADING_DRIFTS, Extra, FilterModel
from fti.nav.filter.estimate import Estimate, InitialState
from fti.nav.filter.innovation_gate import GateState
from fti.nav.filter.measurement_update import update_estimate
from fti.nav.inertial.ins_error_model import TURN

MODEL = FilterModel(extras={**AIRSPEED_DRIFTS, **HEADING_DRIFTS})
SECOND_NS = 1_000_000_000
DECLINATION, DIP = math.radians(4.0), math.radians(65.0)
FIELD_N = 48e-6 * np.array(
    [math.cos(DIP) * math.cos(DECLINATION), math.cos(DIP) * math.sin(DECLINATION), math.sin(DIP)]
)


def flying(heading_deg: float, vel_n: tuple[float, float, float], heading_sd_deg: float = 1.0) -> Estimate:
    turn_sd = (0.002, 0.002, math.radians(heading_sd_deg))
    angles = (math.radians(20.0), math.radians(5.0), math.radians(heading_deg))
    start = InitialState(0.8, 0.2, 700.0, vel_n, *angles, (3.0, 3.0, 5.0), (0.3,) * 3, turn_sd)
    return start.estimate(0, np.zeros(6), MODEL)


def with_extra(here: Estimate, extra: Extra, value: float) -> Estimate:
    y, column = here.y.copy(), MODEL.columns[extra]
    assert column is not None
    y[kernels.EXTRAS + column - MODEL.base] = value
    return dataclasses.replace(here, y=y)


def level(heading_deg: float, vel_n: tuple[float, float, float]) -> Estimate:
    start = InitialState(
        0.8, 0.2, 700.0, vel_n, 0.0, 0.0, math.radians(heading_deg), (3.0, 3.0, 5.0), (0.3,) * 3, (0.002,) * 3
    )
    return start.estimate(0, np.zeros(6), MODEL)


def test_airspeed_in_a_wind_is_that_of_the_triangle() -> None:
    """Nose to the east, 50 m/s over ground to the east, air that moves west with 10 m/s and north with 3."""
    here = with_extra(with_extra(level(90.0, (0.0, 50.0, 0.0)), Extra.WIND_EAST, -10.0), Extra.WIND_NORTH, 3.0)
    z, _, _ = TrueAirspeed(62.0, 1.0, 2.0).compute_matrices(here)
    assert z[0] == pytest.approx(62.0 - math.hypot(60.0, 3.0))
    assert z[1] == pytest.approx(-3.0), "through the air it moves south, to its right: 3 m/s that were not expected"


def test_with_an_unknown_heading_the_sideslip_is_not_observed() -> None:
    z, H, R = TrueAirspeed(62.0, 1.0, 2.0).compute_matrices(flying(90.0, (0.0, 50.0, 0.0), 15.0))
    assert z.shape == (1,)
    assert H.shape == (1, MODEL.size)
    assert R.tolist() == [[1.0]]


def test_a_heading_that_is_too_small_is_seen_as_such_in_any_attitude() -> None:
    """The field of an aircraft that is turned 3 deg farther to the right than the filter has it, in a bank."""
    here = flying(200.0, (50.0, 0.0, 0.0))
    true_nb = mat_from_rpy(math.radians(20.0), math.radians(5.0), math.radians(203.0))
    field_b = tuple((true_nb.T @ FIELD_N).tolist())
    z, H, R = MagneticHeading(field_b, DECLINATION, 0.01).compute_matrices(here)
    assert math.degrees(z[0]) == pytest.approx(3.0, abs=0.01)
    np.testing.assert_allclose(H[0, TURN : TURN + 3] @ here.mat_en, [0.0, 0.0, 1.0], atol=1e-12)
    assert R[0, 0] == pytest.approx(0.01**2 + (math.tan(DIP) * 0.002) ** 2, rel=0.05), "0.1 deg of tilt"
    shifted = with_extra(here, Extra.MAGNETIC_HEADING, math.radians(1.0))
    assert math.degrees(MagneticHeading(field_b, DECLINATION, 0.01).compute_matrices(shifted)[0][0]) == pytest.approx(
        2.0, abs=0.01
    )


def test_beside_satellites_an_airspeed_corrects_its_own_states_alone() -> None:
    here, aiding = flying(0.0, (50.0, 0.0, 0.0)), TrueAirspeed(58.0, 1.0, 2.0)
    gate_states = {"gnss.position": GateState(0, None, frozenset({"horizontal"}))}
    after = update_estimate(here, gate_states, aiding, SECOND_NS).estimate
    np.testing.assert_allclose(after.y[: kernels.EXTRAS], here.y[: kernels.EXTRAS], rtol=1e-15)
    np.testing.assert_allclose(after.P[:TURN, :TURN], here.P[:TURN, :TURN], atol=1e-12)
    assert after.drift(Extra.WIND_NORTH) < -5.0
    late = update_estimate(here, gate_states, aiding, 6 * SECOND_NS).estimate
    assert np.abs(late.y[3:6] - here.y[3:6]).max() > 1e-4, "satellites are gone for 6 s: all is corrected"


# ------------------------------------------------------------------------------------------------------- what counts


def config(**filter_keys: Any) -> Config:
    table: dict[str, Any] = {
        "session": {"name": "t"},
        "link": [{"name": "l", "kind": "serial", "port": "/dev/null"}],
        "device": [{"name": name, "link": "l", "driver": "d"} for name in ("imu", "air", "compass")],
        "nav": {"filter": {"imu": "imu", **filter_keys}},
    }
    return parse(table, "", Path("t.toml"))


def made(**filter_keys: Any) -> DeadReckoningAids:
    settings = config(**filter_keys).nav.filter
    assert settings is not None
    return DeadReckoningAids(settings)


def test_a_slow_or_invalid_airspeed_does_not_aid_and_a_good_one_every_5_s() -> None:
    aids, stamp = made(airspeed="air"), Stamp(0)
    assert aids.make("air", Airspeed(stamp=stamp, tas=14.0), 0) is None
    assert aids.make("air", Airspeed(stamp=stamp, ias=60.0), 0) is None
    assert aids.make("air", Airspeed(stamp=stamp, tas=60.0, valid=False), 0) is None
    assert aids.make("air", Airspeed(stamp=stamp, tas=math.nan), 0) is None
    assert aids.make("imu", Airspeed(stamp=stamp, tas=60.0), 0) is None
    times = [t for t in range(20) if aids.make("air", Airspeed(stamp=stamp, tas=60.0), t * SECOND_NS)]
    assert times == [0, 5, 10, 15]


def test_a_field_that_is_not_the_earths_does_not_aid() -> None:
    aids, stamp = made(heading="compass", declination_deg=4.0), Stamp(0)
    for field in ((5e-6, 5e-6, 5e-6), (60e-6, 60e-6, 0.0), (math.nan, 0.0, 40e-6)):
        assert aids.make("compass", MagneticField(stamp=stamp, field_b=field), 0) is None
    found = aids.make("compass", MagneticField(stamp=stamp, field_b=(20e-6, 0.0, 43e-6)), 0)
    assert isinstance(found, MagneticHeading)
    assert found.declination == pytest.approx(DECLINATION)


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        (
            {"airspeed": "pitot"},
            r"t\.toml: nav\.filter\.airspeed: unknown device 'pitot'; configured: imu, air, compass",
        ),
        ({"heading": "x", "declination_deg": 1.0}, r"nav\.filter\.heading: unknown device 'x'; configured: imu"),
        ({"heading": "compass"}, r"nav\.filter\.declination_deg: missing; nav\.filter\.heading needs it: -180 to 180"),
        ({"declination_deg": 1.0}, r"nav\.filter\.declination_deg: needs nav\.filter\.heading, which is missing"),
        ({"heading": "compass", "declination_deg": 200.0}, r"nav\.filter\.declination_deg"),
    ],
)
def test_a_configuration_that_cannot_work_names_file_key_and_what_is_allowed(keys: dict[str, Any], text: str) -> None:
    with pytest.raises(ConfigError, match=text):
        config(**keys)
