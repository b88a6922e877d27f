"""``fti hil`` on a real SocketCAN bus: pickups and air data share it, a node takes a command and answers."""

from __future__ import annotations

from typing import Any

import pytest

from fti.drivers import Decoder, canaerospace, deflection_pickups
from fti.messages.measurements import Ack, Calibration, Measurement, StaticPressure, SurfaceDeflection
from tests.vcan.probe_pickups import FLIGHT_S

pytestmark = [pytest.mark.e2e, pytest.mark.alone, pytest.mark.socketcan]


@pytest.fixture(scope="module")
def received(vm_results: dict[str, Any]) -> dict[str, Any]:
    """What the link heard."""
    frames: dict[str, Any] = vm_results["pickups"]
    return frames


def decoded(decoder: Decoder, received: dict[str, Any]) -> list[Measurement]:
    pairs = zip(received["frames"], received["times"], strict=True)
    return [m for frame, t in pairs for m in decoder.feed(bytes.fromhex(frame), t)]


def test_pickups_and_air_data_share_a_socketcan_bus(received: dict[str, Any]) -> None:
    pickups = deflection_pickups.make_decoder(deflection_pickups.Options())
    measurements = [m for m in decoded(pickups, received) if isinstance(m, SurfaceDeflection)]
    assert len({m.surface for m in measurements}) == 10
    assert len(measurements) == pytest.approx(10 * 10 * FLIGHT_S, abs=10)
    assert all(m.valid and m.raw is not None for m in measurements)
    assert not pickups.counters.lost
    air_data = canaerospace.make_decoder(canaerospace.Options(node=1))
    pressures = [m for m in decoded(air_data, received) if isinstance(m, StaticPressure)]
    assert len(pressures) == pytest.approx(10 * FLIGHT_S, abs=1)


def test_the_node_has_answered_the_command(received: dict[str, Any]) -> None:
    calibration = "surface,raw,deg\nflaps,256,-1\nflaps,3840,43\n"
    measurements = decoded(
        deflection_pickups.make_decoder(deflection_pickups.Options(calibration=calibration)), received
    )
    (ack,) = [m for m in measurements if isinstance(m, Ack)]
    assert (ack.command, ack.accepted, ack.detail) == ("insert_point", True, "flaps: raw 900 = 8.00 deg")
    (answer,) = [m for m in measurements if isinstance(m, Calibration)]
    assert [p.raw for p in answer.points] == [256, 900, 3840]
