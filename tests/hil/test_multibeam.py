"""The emulated multi-beam altimeter: every beam measures the range of its direction, and faults reach it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from fti import config
from fti.config import Device
from fti.devices import BoundDevice
from fti.drivers import multibeam_altimeter
from fti.errors import ConfigError
from fti.geodesy.rotations import mat_from_rpy
from fti.hil.environment import Environment
from fti.hil.faults.values import DeviceFaults
from fti.hil.sensors import MODELS, SimulatedSensor, make_sensors
from fti.hil.tables.fault_types import Bias, Fog
from fti.hil.tables.schema import SensorSettings
from fti.messages.measurements import BeamRange, DeviceStatus, Measurement
from fti.ranging.multibeam import BEAMS_ACROSS_DEG, beam_directions
from tests.helpers import ROOT
from tests.hil.worlds import world

START_NS = 1_700_000_000_000_000_000


@cache
def environment(**settings: float) -> Environment:
    return world(duration_s=10.0, sensor={"altimeter": SensorSettings.model_validate(settings)})


def sensor(**settings: float) -> SimulatedSensor:
    device = Device.model_validate({"name": "altimeter", "link": "eth", "driver": "multibeam_altimeter"})
    bound = BoundDevice(device, multibeam_altimeter, multibeam_altimeter.Options())  # type: ignore[arg-type]
    return SimulatedSensor(bound, MODELS["multibeam_altimeter"], environment(**settings), seed=1)


def decoded(result: SimulatedSensor) -> list[list[Measurement]]:
    """What the driver makes of the datagram of each sample."""
    decoder, found = multibeam_altimeter.make_decoder(multibeam_altimeter.Options()), []
    for k in range(len(result.t)):
        (datagram,) = [data for m in result.measure(k, START_NS) for data in result.encoder.encode(m)]
        found.append(decoder.feed(datagram, k))
    assert not decoder.counters.lost
    return found


@pytest.mark.parametrize("count", [3, 9])
def test_every_beam_has_the_range_of_its_direction_over_level_ground(count: int) -> None:
    """Table 7.6; 25 Hz; noise of 5 cm.  The range is the height over the share of the direction that looks down."""
    result = sensor(beams=count)
    assert len(result.t) == pytest.approx(250, abs=1)
    samples = decoded(result)
    beams = [[m for m in sample if isinstance(m, BeamRange)] for sample in samples]
    assert all(isinstance(sample[-1], DeviceStatus) and len(sample) == count + 1 for sample in samples)
    across = np.degrees([m.across for m in beams[0]])
    assert across == pytest.approx(BEAMS_ACROSS_DEG[count]) and all(m.along == 0.0 for m in beams[0])
    state = environment().state(result.t)
    rays = beam_directions(np.zeros(count), np.radians(BEAMS_ACROSS_DEG[count]))
    down = np.einsum("ni,ki->nk", mat_from_rpy(state.roll, state.pitch, state.heading)[:, 2], rays)
    expected = (state.alt - environment().ground(state))[:, None] / down
    error = np.array([[m.slant_range for m in sample] for sample in beams]) - expected
    assert np.std(error) == pytest.approx(0.05, abs=0.01) and np.abs(error).max() < 0.3


def test_a_beam_beyond_the_reach_is_not_valid() -> None:
    """The outer beams are 1.3 times as long as the vertical one."""
    longest = max(m.slant_range or 0.0 for m in decoded(sensor())[0] if isinstance(m, BeamRange))
    near = [m for m in decoded(sensor(reach_m=0.9 * longest))[0] if isinstance(m, BeamRange)]
    assert {m.beam for m in near if not m.valid} >= {"beam_1"} and near[4].valid
    assert all(m.slant_range is None for m in near if not m.valid)


def test_a_number_of_beams_that_the_source_does_not_have_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"sensor\.altimeter\.beams"):
        sensor(beams=4)


def test_faults_of_one_beam_and_of_all_beams() -> None:
    sample = sensor().measure(0, START_NS)
    bias = Bias(kind="bias", from_s=0.0, to_s=9.0, quantity="beam_range.slant_range", name="beam_2", value=7.0)
    ranges = [m.slant_range or 0.0 for m in sample if isinstance(m, BeamRange)]
    changed = DeviceFaults("altimeter", [bias]).apply(1.0, sample)
    moved = [m.slant_range or 0.0 for m in changed if isinstance(m, BeamRange)]
    assert np.subtract(moved, ranges) == pytest.approx([0.0, 7.0] + [0.0] * 7)
    fog = Fog(kind="fog", from_s=0.0, to_s=9.0, visibility_m=min(ranges) + 1.0)
    lost = [m for m in DeviceFaults("altimeter", [fog]).apply(1.0, sample) if isinstance(m, BeamRange)]
    assert [m.valid for m in lost] == [m <= min(ranges) + 1.0 for m in ranges] and not lost[0].valid


def test_the_example_has_a_sensor() -> None:
    """The shipped configuration is flown: nine beams on a datagram of 116 bytes."""
    shipped = config.load(ROOT / "configs/multibeam_altimeter.toml")
    result = next(s for s in make_sensors(shipped, environment(), 1, lambda _: None) if s.name == "altimeter")
    (datagram,) = [data for m in result.measure(0, START_NS) for data in result.encoder.encode(m)]
    assert len(datagram) == 26 + 10 * 9
