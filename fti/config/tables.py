"""The tables of a configuration, as frozen models: what may stand in the file, with types, ranges and defaults."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$")]
#: Far above every quantity that is meant; what is larger is a mistake and ends in infinities.
Positive = Annotated[float, Field(gt=0, le=1e12)]
Metres = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector = tuple[Metres, Metres, Metres]


class StrictModel(BaseModel):
    """A frozen table in which unknown keys and wrong types are errors.  Driver options derive from it too."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


# ------------------------------------------------------------------------------------------------------- session


class Session(StrictModel):
    """``[session]``: where the recording goes and how it is cut.

    fallback  : on another medium; the recording goes on there while ``directory`` refuses
    file_mode : permissions of the files, octal; who may read them may enter their folder
    """

    name: Name
    directory: str = "data"
    fallback: str | None = None
    split_s: Annotated[float, Field(gt=0, le=86_400)] = 300.0
    split_mb: Annotated[float, Field(gt=0, le=1_048_576)] = 1024.0
    min_free_mb: Annotated[float, Field(ge=0, le=1e9)] = 500.0
    file_mode: Literal["0600", "0640", "0644", "0660", "0664"] = "0640"
    origin: Literal["flight", "hil", "replay"] = "flight"
    mode: Literal["continuous", "snapshot"] = "continuous"  # snapshot: frames are recorded around a trigger only


class Snapshot(StrictModel):
    """``[snapshot]``: the last ``before_s`` seconds are kept in memory, and on a trigger written into a file.

    max_mb : the memory is never larger [MiB]; the oldest frames go first
    """

    before_s: Annotated[float, Field(gt=0, le=86_400)] = 120.0
    after_s: Annotated[float, Field(ge=0, le=86_400)] = 10.0
    max_mb: Annotated[float, Field(ge=1, le=65_536)] = 256.0


class RecorderTuning(StrictModel):
    """``[recorder]``: how the machine treats the recorder's process.  All off by default.

    cpu         : it runs on these processors only; none : on all
    scheduler   : fifo : before every ordinary process; its reader with ``priority``, its other threads one below
    lock_memory : none of its memory is ever swapped out
    freeze_gc   : Python's collector of cycles stands still
    """

    cpu: tuple[Annotated[int, Field(ge=0, le=65_535)], ...] = ()
    scheduler: Literal["other", "fifo"] = "other"
    priority: Annotated[int, Field(ge=2, le=49)] = 20  # the kernel's own interrupt threads have 50
    lock_memory: bool = False
    freeze_gc: bool = False


# --------------------------------------------------------------------------------------------------------- links


class LinkTable(StrictModel):
    """What every link has: a name, permission to send, and the size of each of its three buffers."""

    name: Name
    transmit: bool = False
    buffer_bytes: Annotated[int, Field(ge=4096, le=2**30)] = 2**19


class SerialLink(LinkTable):
    """A tty or pty; RS-232, RS-422 or RS-485 behind an adapter.

    half_duplex : one talks at a time: nothing is sent before the line was quiet for quiet_ms (none : 3.5 characters and
                  20 ms), nor for answer_ms after a question whose answer has not begun
    echo        : what we send comes back to us, and is no reception
    rs485       : the kernel's driver switches the direction, with this level of RTS while it sends
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


Endpoint = Annotated[str, Field(pattern=r"^(\d{1,3}(\.\d{1,3}){3}|\[[0-9a-fA-F:]+\]):\d{1,5}$")]


class UdpLink(LinkTable):
    """Datagrams to ``bind`` (address:port), only from ``source`` when given; ``group`` joins a multicast group."""

    kind: Literal["udp"]
    bind: Endpoint
    source: str | None = None
    group: str | None = None
    peer: Endpoint | None = None  # where transmitted datagrams go


class CanLink(LinkTable):
    """A CAN bus: any python-can interface; ``slcan`` on a serial port is parsed directly."""

    kind: Literal["can"]
    interface: str
    channel: str
    bitrate: Annotated[int, Field(gt=0, le=100_000_000)] | None = None
    fd: bool = False
    settings: dict[str, Any] = Field(default_factory=dict)  # further python-can arguments, as they are


Link = Annotated[SerialLink | UdpLink | CanLink, Field(discriminator="kind")]


# ------------------------------------------------------------------------------------------------------- devices


class Altimeter(StrictModel):
    """``[device.altimeter]``: the limits inside which an altimeter is believed.

    Of what it measures over known terrain, with the defaults of Spiegel 2018, table 3.2 (incidence: a quarter of the
    power is left there):
    max_deviation_m       : from what the terrain predicts; none : 5 of a laser, 10 of a radar
    max_nadir_deviation_m : of a height that is used as it is, from the navigated one; none : not asked
    max_dispersion        : of the ranges across the predicted beam, over the height above ground
    max_incidence_deg     : of the predicted ray on the ground; none : 75 of a laser, 60 of a radar

    relief_m : one sigma of unknown ground straight below against that which the beam sees; none : from the profile of
               the last 20 s

    The altimeter states scale x range + bias_m.  threshold_db is the leading edge against the peak, for the model
    "beam" (none : a quarter of the peak's power).  ``fti reference fit`` finds all of them and beam_deg.
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
    model: Literal["nearest", "beam"] = "nearest"  # of a radar, for what it should measure over known terrain
    sd_m: Positive | None = None  # one sigma, when the device does not say
    relief_m: Positive | None = None
    bias_m: Annotated[float, Field(ge=-100, le=100)] = 0.0
    scale: Annotated[float, Field(ge=0.8, le=1.25)] = 1.0
    threshold_db: Annotated[float, Field(ge=-26, le=-2)] | None = None

    def corrected_range_m(self, value: float) -> float:
        """The range [m] of which the instrument says ``value`` [m]: bias and scale, as configured, taken off."""
        return (value - self.bias_m) / self.scale


class Device(StrictModel):
    """``[[device]]``: what is understood; any number on one link."""

    name: Name
    link: Name
    driver: str
    rate_hz: Positive | None = None
    max_age_ms: Annotated[float, Field(gt=0, le=3_600_000)] = 1000.0
    latency_ms: Annotated[float, Field(ge=0, le=3_600_000)] = 0.0
    use_device_time: bool = True  # once its clock is known against FTI time; false: validity from the arrival alone
    lever_arm_b: Vector = (0.0, 0.0, 0.0)  # reference point P to sensor, body frame [m]
    rpy_bs_deg: Vector = (0.0, 0.0, 0.0)  # mounting: roll, pitch, yaw that turn the sensor frame into the body frame
    depends_on: tuple[Literal["satellites", "inertial", "map", "pressure"], ...] | None = None  # of a position
    altimeter: Altimeter | None = None
    options: dict[str, Any] = Field(default_factory=dict)


# --------------------------------------------------------------------------------------------- navigation, display


class TerrainFiles(StrictModel):
    """``[nav.terrain]``: elevation files and the datum of their heights, or a scene of the emulator.

    centre_deg, radius_m : the square that is needed of them; none : all that they cover
    cell_m               : between the posts of the finest layer; none : as in the finest file
    scene                : the ground that the emulator flies over, in place of files: the demonstration's strip, or it
                           with the country around
    sd_m                 : one sigma of its heights; the error of resampling files is measured and added
    """

    files: tuple[str, ...] = ()
    vertical: Literal["ellipsoid", "egm96", "egm2008"] | None = None
    centre_deg: tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]] | None = None
    radius_m: Positive | None = None
    cell_m: Positive | None = None
    scene: Literal["demo", "demo_country"] | None = None
    sd_m: Positive = 1.5


class Approach(StrictModel):
    """``[nav.approach]``: the published approach and the limits of its integrity monitor."""

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
    """``[nav.filter]``: inertial navigation of our own, when devices give no position, altitude or attitude.

    imu        : the device whose inertial samples are integrated;  unit : its grade
    gnss       : devices whose positions and velocities aid
    baro       : the device whose pressure altitude aids, or several in order of preference
    altimeters : those whose heights aid over known terrain
    airspeed   : the device whose true airspeed aids, with a wind that is estimated
    heading    : the device whose magnetic field aids the heading;  declination_deg : of the area, east positive
    states     : with or without the biases of the unit
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
    """``[nav.radio.station.NAME]``: where a DME station stands; the altitude is above the ellipsoid."""

    lat_deg: Annotated[float, Field(ge=-90, le=90)]
    lon_deg: Annotated[float, Field(ge=-180, le=180)]
    alt_m: Metres


class Radio(StrictModel):
    """``[nav.radio]``: position by satellites and DME.

    receiver  : the device whose satellites and fixes count;  station : DME stations by the names that devices tell
    altimeter : the device whose heights over known terrain count where satellites are few
    dme_sd_m  : one sigma of a DME range
    """

    receiver: Name | None = None
    station: dict[str, Station] = Field(default_factory=dict)
    altimeter: Name | None = None
    dme_sd_m: Positive = 222.0


class UnstatedSd(StrictModel):
    """``[nav.unstated_sd]``: sigma of a place, horizontal and vertical [m], that counts where its source states none.

    satellites : of a receiver      inertial : of a device that gives attitude as well
    attitude_deg : of an attitude, tilt and heading, as a small MEMS unit has them in motion

    The defaults are the 95 % errors of the service, 8 m and 13 m (GPS Standard Positioning Service Performance
    Standard 2020, table 3.8-3: global average), over 2.45 and 1.96; an inertial system is held by satellites, and
    coasts without them: 1.5 times as much.
    """

    satellites: tuple[Positive, Positive] = (3.3, 6.6)
    inertial: tuple[Positive, Positive] = (5.0, 10.0)
    attitude_deg: tuple[Positive, Positive] = (1.0, 2.0)


class AlertLimits(StrictModel):
    """``[nav.alert_limits]``: position, altitude and tilt are valid while their protection levels are below these.

    compared : and only while another source, or the filter, is there to compare position and attitude with
    """

    position_m: Positive = 200.0
    altitude_m: Positive = 30.0
    attitude_deg: Positive = 2.0
    compared: bool = False


class SourceLimits(StrictModel):
    """``[nav.limits]``: what the aircraft can do; a source of position that goes beyond is refused.

    speed_mps, climb_mps : largest speed over ground and vertical speed
    acceleration_mps2    : largest acceleration without gravity: 30 is a level turn of 3.2 g
    wind_mps             : strongest wind, which turns the heading from the track
    undulation_m         : largest difference between a stated undulation of the geoid and EGM96
    """

    speed_mps: Positive = 400.0
    climb_mps: Positive = 150.0
    acceleration_mps2: Positive = 30.0
    wind_mps: Positive = 40.0
    undulation_m: Positive = 5.0


class Nav(StrictModel):
    """``[nav]``: roles, each a list of devices in order of preference.

    wheels_b : reference point P to where the lowest wheel touches the ground, body frame [m]
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
    """Devices whose positions are used: for the role, by the filter, by the fix of satellites and DME."""
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

    Whoever names a port means to be found there; port 0 takes a free one.
    """

    enabled: bool = False
    port: Annotated[int, Field(ge=0, le=65535)] = 0

    @model_validator(mode="before")
    @classmethod
    def _enable_by_port(cls, table: Any) -> Any:
        return {"enabled": True, **table} if isinstance(table, dict) and "port" in table else table


class Config(StrictModel):
    """The whole configuration.  ``text`` is the file as it was read; ``path`` where from."""

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
        """The devices that listen to a link."""
        return tuple(d for d in self.device if d.link == link)

    def find_device(self, name: str) -> Device | None:
        """The device of that name."""
        return next((d for d in self.device if d.name == name), None)
