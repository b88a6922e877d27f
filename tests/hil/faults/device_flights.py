"""Every driver's emulated device in a short flight, without ports and without waiting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from fti import config, drivers
from fti.config import Device
from fti.devices import BoundDevice
from fti.hil.device_pipeline import DevicePipeline
from fti.hil.environment import Environment
from fti.hil.sensors import MODELS, SimulatedSensor
from fti.hil.tables.fault_types import Fault
from fti.messages.measurements import Measurement, Stamp
from tests.helpers import ROOT
from tests.hil.worlds import scenario, world

START_NS = 1_767_225_600 * 10**9
DURATION_S, RATE_HZ = 6.0, 10.0
#: Distance from the threshold at which the flight begins, low enough for a laser scanner that reaches 100 m.
START_M = 1200.0
RADAR = {"kind": "radar", "range_m": (0.5, 762.0)}
LASER = {"kind": "laser", "range_m": (0.2, 500.0)}
DBC = (ROOT / "configs" / "dbc" / "air_data_unit.dbc").read_text()
LINE = {"line": "$WI,{slant_range:.2f}*{checksum:02X}", "checksum": {"kind": "xor8", "after": "$", "before": "*"}}


@dataclass(frozen=True)
class DeviceKind:
    """A device: its driver, one of its numbers that a fault can be of, its options and its altimeter.

    name : of the reading, surface or station; size : of an error that its line shows; forced : a value that it can say
    rpy_bs_deg : mounting; the scanner turns ten times a second and sends ten packets, all of the azimuth that is down
    """

    driver: str
    quantity: str
    options: Mapping[str, Any] = field(default_factory=dict)
    altimeter: Mapping[str, Any] | None = None
    name: str | None = None
    size: float = 0.03
    forced: float = 0.03
    rpy_bs_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)


DEVICES = {
    "arinc429": DeviceKind("arinc429", "radio_height.height_agl", altimeter=RADAR, size=9.0),
    "arinc429_little": DeviceKind(
        "arinc429", "attitude.roll", {"set": "ahrs", "byte_order": "little", "parity": "even"}
    ),
    "arinc429_apmp": DeviceKind("arinc429", "attitude.roll", {"set": "ahrs", "packets": "apmp"}),
    "arinc429_chapter10": DeviceKind("arinc429", "attitude.roll", {"set": "ahrs", "packets": "chapter10"}),
    "ascii_line": DeviceKind("ascii_line", "range.slant_range", {"first_line": "take"}, LASER),
    "ascii_line_checked": DeviceKind("ascii_line", "range.slant_range", {**LINE, "first_line": "take"}, LASER),
    "binary_struct": DeviceKind("binary_struct", "range.slant_range", altimeter=LASER),
    "canaerospace": DeviceKind("canaerospace", "static_pressure.p_static"),
    "dbc": DeviceKind("dbc", "static_pressure.p_static", {"dbc": DBC}, size=9.0, forced=90_000.0),
    "deflection_pickups": DeviceKind(
        "deflection_pickups", "surface_deflection.raw", name="elevator", size=40.0, forced=2500.0
    ),
    "freeflight_ra4500": DeviceKind("freeflight_ra4500", "radio_height.height_agl", altimeter=RADAR, size=9.0),
    "freeflight_ra4500_checked": DeviceKind(
        "freeflight_ra4500", "radio_height.height_agl", {"checksum": "sum", "dle_stuffing": True}, RADAR, size=9.0
    ),
    "honeywell_hmr2300": DeviceKind("honeywell_hmr2300", "magnetic_field.field_b_1", {"mode": "continuous"}),
    "imar_ixcom": DeviceKind("imar_ixcom", "velocity.down"),
    "lightware_ascii": DeviceKind("lightware_ascii", "range.slant_range", {"first_line": "take"}, LASER),
    "lightware_ascii_polled": DeviceKind("lightware_ascii", "range.slant_range", {"query": "ldf"}, LASER),
    "lightware_binary": DeviceKind("lightware_binary", "range.slant_range", altimeter=LASER),
    "mavlink": DeviceKind("mavlink", "attitude.pitch"),
    "multibeam_altimeter": DeviceKind("multibeam_altimeter", "beam_range.slant_range", name="beam_5"),
    "nmea0183": DeviceKind("nmea0183", "position.alt_msl"),
    "novatel_oem6": DeviceKind("novatel_oem6", "position.lat", {"unasked": True}),
    "power_unit": DeviceKind("power_unit", "reading.value", name="supply_voltage"),
    "ublox_ubx": DeviceKind("ublox_ubx", "position.lon"),
    "velodyne_vlp16": DeviceKind("velodyne_vlp16", "range_scan.median", rpy_bs_deg=(-90.0, -108.0, 90.0)),
}
TIMING = {"device": {"shift_ms": 20.0, "drift_ppm": 0.0}}
#: They say nothing unless they are asked.
POLLED = ("lightware_ascii_polled",)
LINK = "line"


class RecordedModel:
    """A model that repeats what was measured once, so that flights differ by their faults alone."""

    def __init__(self, sensor: SimulatedSensor) -> None:
        self.cycles = [sensor.measure(k, START_NS) for k in range(len(sensor.t))]

    def measure(self, k: int, stamp: Stamp) -> list[Measurement]:
        return self.cycles[k]


@cache
def make_environment() -> Environment:
    return world(DURATION_S, START_M, sensor=TIMING)


@cache
def bind_device(name: str) -> BoundDevice:
    """A device of ``DEVICES`` in the configuration."""
    kind, module = DEVICES[name], drivers.load(DEVICES[name].driver)
    keys: dict[str, Any] = {"name": "device", "link": LINK, "driver": kind.driver, "rate_hz": RATE_HZ}
    keys["rpy_bs_deg"] = kind.rpy_bs_deg
    device = Device.model_validate({**keys, "altimeter": kind.altimeter})
    return BoundDevice(device, module, config.bind(module.Options, kind.options, "test"))


def make_sensor(name: str, environment: Environment) -> SimulatedSensor:
    """A device of ``DEVICES`` in another world."""
    bound = bind_device(name)
    return SimulatedSensor(bound, MODELS[bound.device.driver], environment, seed=1)


@cache
def _sensor(name: str) -> SimulatedSensor:
    sensor = make_sensor(name, make_environment())
    sensor.model = RecordedModel(sensor)
    return sensor


def device(name: str) -> SimulatedSensor:
    """A device of ``DEVICES`` as it is when it is switched on."""
    sensor = _sensor(name)
    sensor.encoder = sensor.bound.driver.make_encoder(sensor.bound.options)
    return sensor


def recorded_cycles(name: str) -> list[list[Measurement]]:
    """What the device measures in each cycle."""
    model = device(name).model
    assert isinstance(model, RecordedModel)
    return model.cycles


Flight = list[tuple[float, list[bytes]]]


def fly(
    name: str, *faults: Fault, seed: int = 7, until_s: float = float("inf"), sensor: SimulatedSensor | None = None
) -> Flight:
    """What leaves, and when [s]; instants at which nothing does are not in it."""
    line = DevicePipeline(sensor or device(name), scenario(fault=faults, seed=seed), until_s)
    flight: Flight = []
    while (t := line.due_s()) is not None:
        if messages := line.step(START_NS):
            flight.append((t, messages))
    return flight


@cache
def nominal(name: str) -> Flight:
    """The flight without a fault."""
    return fly(name)
