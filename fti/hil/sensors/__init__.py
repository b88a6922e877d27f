"""Models of sensors, one per driver, and the table that says which."""

from __future__ import annotations

from collections.abc import Callable

from fti.config import Config
from fti.errors import ConfigError
from fti.hil.sensors.air_data import AirSettings
from fti.hil.sensors.altimeters import LaserAltimeter, RadarAltimeter, RadarSettings
from fti.hil.sensors.arinc_units import ArincUnit
from fti.hil.sensors.autopilot import Autopilot
from fti.hil.sensors.base import Sensor
from fti.hil.sensors.can_units import AirDataUnit, DbcUnits
from fti.hil.sensors.deflections import DeflectionPickups, PickupSettings
from fti.hil.sensors.described import DescribedDevice
from fti.hil.sensors.gnss import RawReceiver, Receiver
from fti.hil.sensors.imagers import ImagerSettings
from fti.hil.sensors.imu_grades import ImuSettings
from fti.hil.sensors.inertial import InertialNavigation
from fti.hil.sensors.inertial_solution import InertialSettings
from fti.hil.sensors.magnetometer import Magnetometer, MagnetometerSettings
from fti.hil.sensors.model import ModelType
from fti.hil.sensors.novatel import SurveyReceiver
from fti.hil.sensors.power_unit import PowerPanel
from fti.hil.sensors.settings import DeviceSettings, check_settings
from fti.hil.world import World
from fti.service.binding import bind_devices

#: Driver name -> what stands at the other end of its line.
MODELS: dict[str, ModelType] = {
    "arinc429": ArincUnit,
    "ascii_line": DescribedDevice,
    "binary_struct": DescribedDevice,
    "canaerospace": AirDataUnit,
    "dbc": DbcUnits,
    "deflection_pickups": DeflectionPickups,
    "freeflight_ra4500": RadarAltimeter,
    "honeywell_hmr2300": Magnetometer,
    "imar_ixcom": InertialNavigation,
    "lightware_ascii": LaserAltimeter,
    "lightware_binary": LaserAltimeter,
    "mavlink": Autopilot,
    "nmea0183": Receiver,
    "novatel_oem6": SurveyReceiver,
    "power_unit": PowerPanel,
    "ublox_ubx": RawReceiver,
}


class UnitSettings(AirSettings, ImuSettings):
    """Of a unit that has air data and inertial sensors."""


class AvionicsSettings(UnitSettings, RadarSettings):
    """The same with a radar altimeter."""


class CanSettings(AirSettings, RadarSettings):
    """Of a unit that has air data and may have a radar altimeter."""


class DescribedSettings(CanSettings, ImagerSettings):
    """Of a device whose fields the configuration describes: all that these can carry."""


#: Driver name -> what its model takes in ``[sensor.NAME]``; the others take the timing alone.
SETTINGS: dict[str, type[DeviceSettings]] = {
    "arinc429": AvionicsSettings,
    "ascii_line": DescribedSettings,
    "binary_struct": DescribedSettings,
    "canaerospace": CanSettings,
    "dbc": CanSettings,
    "deflection_pickups": PickupSettings,
    "freeflight_ra4500": RadarSettings,
    "honeywell_hmr2300": MagnetometerSettings,
    "imar_ixcom": InertialSettings,
    "mavlink": UnitSettings,
}


def make_sensors(config: Config, world: World, seed: int, progress: Callable[[str], None]) -> list[Sensor]:
    """A sensor for every device of the configuration.

    Raises ConfigError where no model speaks a driver, or where one does not take a setting of the scenario.
    """
    for device in config.device:
        check_settings(SETTINGS.get(device.driver, DeviceSettings), world.scenario, device.name)
    found = []
    for bound in bind_devices(config):
        device = bound.device
        if device.driver not in MODELS:
            known = ", ".join(sorted(MODELS))
            raise ConfigError(
                f"{config.path}: device {device.name!r}: the emulator has no model for driver {device.driver!r}; "
                f"it has {known}"
            )
        progress(f"sensor {device.name}")
        found.append(Sensor(bound, MODELS[device.driver], world, seed))
    return found


__all__ = ["MODELS", "Sensor", "make_sensors"]
