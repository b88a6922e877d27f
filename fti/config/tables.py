"""The tables of a configuration as frozen models: keys, types, ranges and defaults."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

NAME_PATTERN = r"^[a-z][a-z0-9_]*$"
Name = Annotated[str, Field(pattern=NAME_PATTERN)]
#: Upper limit far above every sensible value; larger values would lead to infinities.
Positive = Annotated[float, Field(gt=0, le=1e12)]
Metres = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector = tuple[Metres, Metres, Metres]


class StrictModel(BaseModel):
    """A frozen table in which unknown keys and wrong types are errors.  Driver options derive from it too."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


# ------------------------------------------------------------------------------------------------------- session


class Session(StrictModel):
    """``[session]``: storage targets, file splitting and mode of the recording.

    fallback  : folder on another disk; the recording continues there while ``directory`` fails
    file_mode : permissions of the files, octal; the folder gets the matching permissions to enter it
    """

    name: Name
    directory: str = "data"
    fallback: str | None = None
    split_s: Annotated[float, Field(gt=0, le=86_400)] = 300.0
    split_mb: Annotated[float, Field(gt=0, le=1_048_576)] = 1024.0
    min_free_mb: Annotated[float, Field(ge=0, le=1e9)] = 500.0
    file_mode: Literal["0600", "0640", "0644", "0660", "0664"] = "0640"
    origin: Literal["flight", "hil", "replay"] = "flight"
    mode: Literal["continuous", "snapshot"] = "continuous"  # snapshot: only frames around a trigger are recorded


class Snapshot(StrictModel):
    """``[snapshot]``: the last ``before_s`` seconds are kept in memory and written to a file on a trigger.

    max_mb : limit of the memory [MiB]; the oldest frames are dropped first
    """

    before_s: Annotated[float, Field(gt=0, le=86_400)] = 120.0
    after_s: Annotated[float, Field(ge=0, le=86_400)] = 10.0
    max_mb: Annotated[float, Field(ge=1, le=65_536)] = 256.0


class RecorderTuning(StrictModel):
    """``[recorder]``: real-time settings of the recorder process.  All off by default.

    cpu         : processors of its affinity; empty : all
    scheduler   : fifo : real-time scheduling; its reader thread has ``priority``, its other threads one less
    lock_memory : lock all of its memory against swapping
    freeze_gc   : switch off Python's cyclic garbage collector
    """

    cpu: tuple[Annotated[int, Field(ge=0, le=65_535)], ...] = ()
    scheduler: Literal["other", "fifo"] = "other"
    priority: Annotated[int, Field(ge=2, le=49)] = 20  # the kernel's interrupt threads have 50
    lock_memory: bool = False
    freeze_gc: bool = False


# --------------------------------------------------------------------------------------------------------- links


class LinkTable(StrictModel):
    """Keys of every link: name, permission to send, and the size of each of its three buffers."""

    name: Name
    transmit: bool = False
    buffer_bytes: Annotated[int, Field(ge=4096, le=2**30)] = 2**19


class SerialLink(LinkTable):
    """A tty or pty; RS-232, RS-422 or RS-485 behind an adapter.

    half_duplex : only one station sends at a time: we send after the line was quiet for quiet_ms (none : 3.5 characters
                  + 20 ms), and after a request not before its answer has begun or answer_ms have passed
    echo        : we receive our own transmissions; they are not counted as received
    rs485       : the kernel driver switches the direction, with this level of RTS during transmission
    """

    kind: Literal["serial"]
    port: str
    baud: Annotated[int, Field(gt=0, le=100_000_000)] = 115200
    data_bits: Literal[5, 6, 7, 8] = 8
    parity: Literal["none", "even", "odd", "mark", "space"] = "none"
    stop_bits: Literal[1, 2] = 1
    flow: Literal["none", "rtscts", "xonxoff"] = "none"
    half_duplex: bool = False
    quiet_ms: Annotated[float, Field(ge=0, le=10_000)] | None = None
    answer_ms: Annotated[float, Field(ge=0, le=60_000)] = 250.0
    echo: bool = False
    rs485: Literal["none", "rts_high", "rts_low"] = "none"


ENDPOINT_PATTERN = r"^(\d{1,3}(\.\d{1,3}){3}|\[[0-9a-fA-F:]+\]):\d{1,5}$"
Endpoint = Annotated[str, Field(pattern=ENDPOINT_PATTERN)]


class UdpLink(LinkTable):
    """Datagrams to ``bind`` (address:port), only from ``source`` when given; ``group`` joins a multicast group."""

    kind: Literal["udp"]
    bind: Endpoint
    source: str | None = None
    group: str | None = None
    peer: Endpoint | None = None  # destination of transmitted datagrams


class CanLink(LinkTable):
    """A CAN bus: any python-can interface; ``slcan`` on a serial port is parsed directly."""

    kind: Literal["can"]
    interface: str
    channel: str
    bitrate: Annotated[int, Field(gt=0, le=100_000_000)] | None = None
    fd: bool = False
    settings: dict[str, Any] = Field(default_factory=dict)  # further arguments of python-can, passed on unchanged


Link = Annotated[SerialLink | UdpLink | CanLink, Field(discriminator="kind")]


# ------------------------------------------------------------------------------------------------------- devices


class Altimeter(StrictModel):
    """``[device.altimeter]``: limits and error model of an altimeter.

    Limits over known terrain; defaults of Spiegel 2018, table 3.2 (incidence: a quarter of the power remains there):
    max_deviation_m       : |measured - predicted range|; none : 5 for a laser, 10 for a radar
    max_nadir_deviation_m : |measured - navigated height| of a height used without compensation; none : no check
    max_dispersion        : spread of the ranges in the predicted beam over the height above ground
    max_incidence_deg     : incidence angle of the predicted ray; none : 75 for a laser, 60 for a radar

    relief_m : one sigma of the height difference between unknown ground at the nadir and at the footprint; none : from
               the profile of the last 20 s

    The altimeter indicates scale x range + bias_m.  threshold_db is the leading edge relative to the peak, for the
    model "beam" (none : a quarter of the peak power).  ``fti reference fit`` estimates these and beam_deg.
    """

    kind: Literal["radar", "laser"]
    range_m: tuple[Metres, Metres]
    max_roll_deg: Positive = 30.0
    max_pitch_deg: Positive = 30.0
    max_deviation_m: Positive | None = None
    max_nadir_deviation_m: Positive | None = None
    max_dispersion: Positive = 0.3
    max_incidence_deg: Positive | None = None
    beam_deg: Positive = 40.0  # full width of the beam
    model: Literal["nearest", "beam"] = "nearest"  # range prediction of a radar over known terrain
    sd_m: Positive | None = None  # one sigma, if the device does not state it
    relief_m: Positive | None = None
    bias_m: Annotated[float, Field(ge=-100, le=100)] = 0.0
    scale: Annotated[float, Field(ge=0.8, le=1.25)] = 1.0
    threshold_db: Annotated[float, Field(ge=-26, le=-2)] | None = None

    def corrected_range_m(self, value: float) -> float:
        """Range [m] from the indicated ``value`` [m], corrected for the configured bias and scale."""
        return (value - self.bias_m) / self.scale


class Device(StrictModel):
    """``[[device]]``: a driver on a link; any number of devices on one link."""

    name: Name
    link: Name
    driver: str
    rate_hz: Positive | None = None
    max_age_ms: Annotated[float, Field(gt=0, le=3_600_000)] = 1000.0
    latency_ms: Annotated[float, Field(ge=0, le=3_600_000)] = 0.0
    use_device_time: bool = True  # once its clock is synchronised to FTI time; false: validity from the arrival
    lever_arm_b: Vector = (0.0, 0.0, 0.0)  # reference point P to sensor, body frame [m]
    rpy_bs_deg: Vector = (0.0, 0.0, 0.0)  # mounting: roll, pitch, yaw that turn the sensor frame into the body frame
    depends_on: tuple[Literal["satellites", "inertial", "map", "pressure"], ...] | None = None  # of a position
    altimeter: Altimeter | None = None
    options: dict[str, Any] = Field(default_factory=dict)


# --------------------------------------------------------------------------------------------- navigation, display


class TerrainFiles(StrictModel):
    """``[nav.terrain]``: elevation files and the datum of their heights, or a scene of the emulator.

    centre_deg, radius_m : square that is loaded from the files; none : everything
    cell_m               : post spacing of the finest layer; none : that of the finest file
    scene                : terrain of the emulator instead of files: the strip of the demonstration (demo), or the
                           strip with the region around it (demo_country)
    sd_m                 : one sigma of its heights; the error of resampling is measured and added
    """

    files: tuple[str, ...] = ()
    vertical: Literal["ellipsoid", "egm96", "egm2008"] | None = None
    centre_deg: tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]] | None = None
    radius_m: Positive | None = None
    cell_m: Positive | None = None
    scene: Literal["demo", "demo_country"] | None = None
    sd_m: Positive = 1.5


class Approach(StrictModel):
    """``[nav.approach]``: the published approach and the limits of the integrity monitor."""

    profile: str
    window_m: Positive = 400.0
    y_max_m: Positive = 150.0
    max_roll_deg: Positive = 10.0
    max_pitch_deg: Positive = 10.0
    alert_s_m: Positive = 50.0
    alert_y_m: Positive = 100.0
    alert_v_m: Positive = 5.0
    alert_v_deg: Positive = 0.35


class Filter(StrictModel):
    """``[nav.filter]``: aided inertial navigation, used while devices give no position, altitude or attitude.

    imu        : device whose inertial samples are integrated;  unit : its grade
    gnss       : devices for position and velocity aiding
    baro       : device for pressure altitude aiding, or several in order of preference
    altimeters : altimeters for height aiding over known terrain
    airspeed   : device for true airspeed aiding; the wind is estimated
    heading    : device whose magnetic field aids the heading;  declination_deg : of the area, east positive
    states     : 15 with, 9 without the biases of the inertial unit
    """

    imu: Name
    unit: Literal["navigation", "tactical", "mems"] = "tactical"
    gnss: tuple[Name, ...] = ()
    baro: tuple[Name, ...] = ()
    altimeters: tuple[Name, ...] = ()
    airspeed: Name | None = None
    heading: Name | None = None
    declination_deg: Annotated[float, Field(ge=-180, le=180)] | None = None
    states: Literal[9, 15] = 15

    @field_validator("baro", mode="before")
    @classmethod
    def _wrap_single_name(cls, value: object) -> object:
        if isinstance(value, str):
            return (value,)
        return tuple(value) if isinstance(value, list) else value


class Station(StrictModel):
    """``[nav.radio.station.NAME]``: position of a DME station; the altitude is above the ellipsoid."""

    lat_deg: Annotated[float, Field(ge=-90, le=90)]
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    alt_m: Metres


class Radio(StrictModel):
    """``[nav.radio]``: position from satellites and DME.

    receiver  : device whose satellites and fixes are used;  station : DME stations by the names that devices send
    altimeter : device whose heights over known terrain are used when few satellites are available
    dme_sd_m  : one sigma of a DME range
    """

    receiver: Name | None = None
    station: dict[str, Station] = Field(default_factory=dict)
    altimeter: Name | None = None
    dme_sd_m: Positive = 222.0


class UnstatedSd(StrictModel):
    """``[nav.unstated_sd]``: one sigma of a position, horizontal and vertical [m], for sources that state none.

    satellites : of a receiver      inertial : of a device that also gives attitude
    attitude_deg : of an attitude, tilt and heading; typical of a small MEMS unit in motion

    The defaults are the 95 % errors of the service, 8 m and 13 m (GPS Standard Positioning Service Performance
    Standard 2020, table 3.8-3: global average), over 2.45 and 1.96.  An inertial system is aided by satellites and
    coasts without them: 1.5 times as much.
    """

    satellites: tuple[Positive, Positive] = (3.3, 6.6)
    inertial: tuple[Positive, Positive] = (5.0, 10.0)
    attitude_deg: tuple[Positive, Positive] = (1.0, 2.0)


class AlertLimits(StrictModel):
    """``[nav.alert_limits]``: position, altitude and tilt are valid while their protection levels are below these.

    compared : position and attitude are valid only while another source, or the filter, allows a comparison
    """

    position_m: Positive = 200.0
    altitude_m: Positive = 30.0
    attitude_deg: Positive = 2.0
    compared: bool = False


class SourceLimits(StrictModel):
    """``[nav.limits]``: performance limits of the aircraft; a position source that exceeds them is excluded.

    speed_mps, climb_mps : largest speed over ground and vertical speed
    acceleration_mps2    : largest acceleration without gravity: 30 is a level turn of 3.2 g
    wind_mps             : strongest wind; it limits the angle between heading and track
    undulation_m         : largest difference between the stated geoid undulation and EGM96
    """

    speed_mps: Positive = 400.0
    climb_mps: Positive = 150.0
    acceleration_mps2: Positive = 30.0
    wind_mps: Positive = 40.0
    undulation_m: Positive = 5.0


class Nav(StrictModel):
    """``[nav]``: roles, each a list of devices in order of preference.

    wheels_b : reference point P to the contact point of the lowest wheel, body frame [m]
    """

    attitude: tuple[Name, ...] = ()
    position: tuple[Name, ...] = ()
    altimeters: tuple[Name, ...] = ()
    wheels_b: Vector | None = None
    terrain: TerrainFiles | None = None
    filter: Filter | None = None
    radio: Radio | None = None
    approach: Approach | None = None
    unstated_sd: UnstatedSd = UnstatedSd()
    alert_limits: AlertLimits = AlertLimits()
    limits: SourceLimits = SourceLimits()


def position_sources(nav: Nav) -> tuple[str, ...]:
    """Devices whose positions are used: by the role, by the filter, by the fix from satellites and DME."""
    receiver = nav.radio.receiver if nav.radio else None
    aiding = (*(nav.filter.gnss if nav.filter else ()), *((receiver,) if receiver else ()))
    return tuple(dict.fromkeys((*nav.position, *aiding)))


def altimeter_links(devices: Sequence[Device], nav: Nav) -> frozenset[str]:
    """Links of the altimeters that navigation uses."""
    return frozenset(device.link for device in devices if device.name in nav.altimeters)


class Display(StrictModel):
    """``[display]``: the page; on loopback only."""

    enabled: bool = True
    address: Literal["127.0.0.1"] = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 8080


class Bus(StrictModel):
    """``[bus]``: outputs and health for foreign zenoh clients, at an explicit endpoint on loopback.

    A configured port enables it; port 0 selects a free one.
    """

    enabled: bool = False
    port: Annotated[int, Field(ge=0, le=65535)] = 0

    @model_validator(mode="before")
    @classmethod
    def _enable_by_port(cls, table: Any) -> Any:
        return {"enabled": True, **table} if isinstance(table, dict) and "port" in table else table


class Config(StrictModel):
    """The whole configuration.  ``text`` is the text of the file; ``path`` its path."""

    session: Session
    link: tuple[Link, ...] = ()
    device: tuple[Device, ...] = ()
    nav: Nav = Nav()
    display: Display = Display()
    bus: Bus = Bus()
    snapshot: Snapshot | None = None
    recorder: RecorderTuning = RecorderTuning()
    path: str = ""
    text: str = ""

    def devices_on(self, link: str) -> tuple[Device, ...]:
        """The devices on a link."""
        return tuple(d for d in self.device if d.link == link)

    def find_device(self, name: str) -> Device | None:
        """The device of that name."""
        return next((d for d in self.device if d.name == name), None)
