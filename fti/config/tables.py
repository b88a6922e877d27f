"""The tables of a configuration as frozen models: keys, types, ranges and defaults."""

from __future__ import annotations

import datetime
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeVar

from pydantic import Field, field_validator, model_validator
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import PydanticCustomError

from fti.config.endpoints import Endpoint
from fti.config.keys import NO_UNIT, ONE, key
from fti.config.publish_tables import Publish
from fti.config.strict_model import StrictModel

if TYPE_CHECKING:
    from fti.arrays import Array

FloatOrArray = TypeVar("FloatOrArray", float, "Array")

NAME_PATTERN = r"^[a-z][a-z0-9_]*$"
DATE_PATTERN = r"^\d{4}(-(0[1-9]|1[0-2])(-(0[1-9]|[12]\d|3[01]))?)?$"
Name = Annotated[str, Field(pattern=NAME_PATTERN)]
#: Upper limit far above every sensible value; larger values would lead to infinities.
Positive = Annotated[float, Field(gt=0, le=1e12)]
Metres = Annotated[float, Field(ge=-1e6, le=1e6)]
Vector = tuple[Metres, Metres, Metres]


# ------------------------------------------------------------------------------------------------------- session


class Session(StrictModel):
    """``[session]``: storage of the recording."""

    name: Annotated[Name, key("first part of the names of all sessions and of their files", NO_UNIT, "aircraft")]
    directory: Annotated[str, key("folder of the sessions; a relative path begins at the file", NO_UNIT)] = "data"
    fallback: Annotated[
        str | None,
        key(
            "folder on another medium; the recording continues there while directory cannot be written; none: no "
            "fallback",
            NO_UNIT,
            "/mnt/second/data",
        ),
    ] = None
    split_s: Annotated[
        float, Field(gt=0, le=86_400), key("maximum duration of a file; then the next one begins", "s")
    ] = 300.0
    split_mb: Annotated[
        float,
        Field(gt=0, le=1_048_576),
        key("maximum size of a file; less where the user's limit of the file size is lower", "MiB"),
    ] = 1024.0
    min_free_mb: Annotated[
        float, Field(ge=0, le=1e9), key("free space to keep on a medium; below it the medium counts as full", "MiB")
    ] = 500.0
    file_mode: Annotated[
        Literal["0600", "0640", "0644", "0660", "0664"],
        key("permissions of the files, octal; those of the folder follow: 0750 for 0640", NO_UNIT),
    ] = "0640"
    origin: Annotated[
        Literal["flight", "hil", "replay"],
        key("origin of the bytes: aircraft, emulator or replay; shown on all products", NO_UNIT),
    ] = "flight"
    mode: Annotated[
        Literal["continuous", "snapshot"],
        key("continuous: every frame is recorded; snapshot: only the frames around a trigger, see [snapshot]", NO_UNIT),
    ] = "continuous"


class Snapshot(StrictModel):
    """``[snapshot]``: triggered captures.  Without this table triggers are not available.

    The newest frames are kept in memory.  A trigger (``fti mark --trigger``, the button of the page) writes them to a
    file of their own.
    """

    before_s: Annotated[float, Field(gt=0, le=86_400), key("time before the trigger that the file contains", "s")] = (
        120.0
    )
    after_s: Annotated[float, Field(ge=0, le=86_400), key("time after the trigger that the file contains", "s")] = 10.0
    max_mb: Annotated[
        float, Field(ge=1, le=65_536), key("maximum memory of the kept frames; the oldest are discarded first", "MiB")
    ] = 256.0


class RecorderTuning(StrictModel):
    """``[recorder]``: real-time settings of the recorder process, all off by default.

    A setting without permission is refused at the start with an error.
    """

    cpu: Annotated[
        tuple[Annotated[int, Field(ge=0, le=65_535)], ...],
        key("numbers of the processors that the recorder may use; empty: all", NO_UNIT),
    ] = ()
    scheduler: Annotated[
        Literal["other", "fifo"],
        key("fifo: real-time scheduling with priority, before all ordinary processes; other: the usual one", NO_UNIT),
    ] = "other"
    priority: Annotated[  # the kernel's interrupt threads have 50
        int,
        Field(ge=2, le=49),
        key("real-time priority of its reader thread under fifo; its other threads have one less", ONE),
    ] = 20
    lock_memory: Annotated[bool, key("lock all memory of the recorder against swapping", NO_UNIT)] = False
    freeze_gc: Annotated[bool, key("switch off Python's cyclic garbage collector in the recorder", NO_UNIT)] = False


# --------------------------------------------------------------------------------------------------------- links


class LinkTable(StrictModel):
    """Keys of every link: name, permission to send, and the size of each of its three buffers."""

    name: Annotated[Name, key("name of the link, and of its topic /raw/NAME", NO_UNIT, "radalt_line")]
    transmit: Annotated[
        bool, key("allow transmission on the link: requests of drivers, and commands of fti send", NO_UNIT)
    ] = False
    buffer_bytes: Annotated[
        int,
        Field(ge=4096, le=2**30),
        key("size of each of its three buffers; fti check prints how long a storage stall they bridge", "byte"),
    ] = 2**19


class SerialLink(LinkTable):
    """A tty or pty: RS-232, RS-422 or RS-485 behind an adapter."""

    kind: Literal["serial"]
    port: Annotated[str, key("device file of the port; fti ports lists them", NO_UNIT, "/dev/ttyUSB0")]
    baud: Annotated[int, Field(gt=0, le=100_000_000), key("baud rate", "bit/s")] = 115200
    data_bits: Annotated[Literal[5, 6, 7, 8], key("data bits of a character", "bit")] = 8
    parity: Annotated[Literal["none", "even", "odd", "mark", "space"], key("parity bit of a character", NO_UNIT)] = (
        "none"
    )
    stop_bits: Annotated[Literal[1, 2], key("stop bits of a character", "bit")] = 1
    flow: Annotated[
        Literal["none", "rtscts", "xonxoff"],
        key("flow control: rtscts by the RTS and CTS lines, xonxoff by characters", NO_UNIT),
    ] = "none"
    half_duplex: Annotated[
        bool, key("two-wire RS-485: only one station sends at a time, and requests wait for each other", NO_UNIT)
    ] = False
    quiet_ms: Annotated[
        Annotated[float, Field(ge=0, le=10_000)] | None,
        key(
            "with half_duplex: silence of the line that must precede a transmission; none: the time of 3.5 characters "
            "and 20 ms, because USB adapters deliver received bytes late",
            "ms",
            25.0,
        ),
    ] = None
    answer_ms: Annotated[
        float,
        Field(ge=0, le=60_000),
        key("with half_duplex: time for the start of an answer; then the next request is sent", "ms"),
    ] = 250.0
    echo: Annotated[
        bool,
        key("the transceiver receives its own transmissions; they are recorded as sent, not as received", NO_UNIT),
    ] = False
    rs485: Annotated[
        Literal["none", "rts_high", "rts_low"],
        key(
            "the kernel's driver switches the direction, with RTS high or low while it sends; an event reports a "
            "driver "
            "without this function",
            NO_UNIT,
        ),
    ] = "none"


class UdpLink(LinkTable):
    """Datagrams to an address of this computer."""

    kind: Literal["udp"]
    bind: Annotated[
        Endpoint, key("address and port of this computer on which datagrams are received", NO_UNIT, "192.168.10.1:4000")
    ]
    source: Annotated[
        str | None,
        key("IP address of the only sender whose datagrams are accepted; none: every sender", NO_UNIT, "192.168.10.7"),
    ] = None
    group: Annotated[
        str | None,
        key(
            "multicast group to join on the interface of bind; only its datagrams are received; none: no group",
            NO_UNIT,
            "239.1.2.3",
        ),
    ] = None
    peer: Annotated[
        Endpoint | None,
        key(
            "address and port to which datagrams are sent; none: the sender of the last datagram",
            NO_UNIT,
            "192.168.10.7:4001",
        ),
    ] = None


class CanLink(LinkTable):
    """A CAN bus: any interface of python-can; slcan on a serial port is parsed directly."""

    kind: Literal["can"]
    interface: Annotated[
        str,
        key("socketcan, slcan (an adapter on a serial port), or another interface of python-can", NO_UNIT, "socketcan"),
    ]
    channel: Annotated[str, key("channel of the interface: can0, the device file of an adapter, ...", NO_UNIT, "can0")]
    bitrate: Annotated[
        Annotated[int, Field(gt=0, le=100_000_000)] | None,
        key("bit rate of the bus; none: that with which the interface is configured", "bit/s", 500_000),
    ] = None
    fd: Annotated[bool, key("CAN FD: frames of up to 64 bytes", NO_UNIT)] = False
    settings: Annotated[
        dict[str, Any], key("further arguments of the python-can interface, passed on unchanged", NO_UNIT)
    ] = Field(default_factory=dict)


Link = Annotated[SerialLink | UdpLink | CanLink, Field(discriminator="kind")]


# ------------------------------------------------------------------------------------------------------- devices


class Altimeter(StrictModel):
    """``[device.altimeter]``: the device is an altimeter; limits within which it is used, and its error model.

    The defaults of the limits over known terrain are those of Spiegel 2018, table 3.2.
    """

    kind: Annotated[
        Literal["radar", "laser", "multibeam"],
        key(
            "principle of measurement; multibeam: ranges along several laser beams, for [nav.terrain_position] only",
            NO_UNIT,
            "radar",
        ),
    ]
    range_m: Annotated[tuple[Metres, Metres], key("smallest and largest range that is used", "m", [0.0, 760.0])]
    max_roll_deg: Annotated[Positive, key("largest roll, to either side; beyond it samples are not used", "deg")] = 30.0
    max_pitch_deg: Annotated[Positive, key("largest pitch, up or down; beyond it samples are not used", "deg")] = 30.0
    max_deviation_m: Annotated[
        Positive | None,
        key(
            "over known terrain: largest deviation from the predicted range; none: 5 of a laser, 10 of a radar",
            "m",
            8.0,
        ),
    ] = None
    max_nadir_deviation_m: Annotated[
        Positive | None,
        key(
            "over known terrain: largest deviation of a height that is used without compensation from the navigated "
            "height; none: no test",
            "m",
            15.0,
        ),
    ] = None
    max_dispersion: Annotated[
        Positive,
        key("over known terrain: largest standard deviation of the ranges across the beam, over the height", ONE),
    ] = 0.3
    max_incidence_deg: Annotated[  # a quarter of the power remains there
        Positive | None,
        key(
            "over known terrain: largest angle between ray and normal of the ground; none: 75 of a laser, 60 of a "
            "radar",
            "deg",
            50.0,
        ),
    ] = None
    beam_deg: Annotated[Positive, key("full width of the beam", "deg")] = 40.0
    model: Annotated[
        Literal["nearest", "beam"],
        key(
            "prediction of a radar's range over known terrain; nearest: nearest return in the beam (217 rays); beam: "
            "antenna, radar equation and leading edge (2051 rays)",
            NO_UNIT,
        ),
    ] = "nearest"
    sd_m: Annotated[
        Positive | None,
        key("1-sigma of a range where the device states none; none: the device states it, or it is unknown", "m", 0.5),
    ] = None
    relief_m: Annotated[
        Positive | None,
        key(
            "over unknown terrain: 1-sigma of the height difference between the ground straight below and the ground "
            "in "
            "the beam; none: from the profile of the last 20 s, and 10 until that profile is 5 s long",
            "m",
            3.0,
        ),
    ] = None
    bias_m: Annotated[
        float,
        Field(ge=-100, le=100),
        key("the altimeter states scale x range + bias_m; both are removed from heights, not from raw values", "m"),
    ] = 0.0
    scale: Annotated[
        float,
        Field(ge=0.8, le=1.25),
        key("scale factor of the stated range, see bias_m; fti reference fit estimates both", ONE),
    ] = 1.0
    threshold_db: Annotated[
        Annotated[float, Field(ge=-26, le=-2)] | None,
        key(
            "of the model beam: leading edge relative to the peak; none: a quarter of the peak power, -6.02", "dB", -8.0
        ),
    ] = None

    def corrected_range_m(self, value: FloatOrArray) -> FloatOrArray:
        """Range [m] from the indicated ``value`` [m], corrected for the configured bias and scale."""
        return (value - self.bias_m) / self.scale


class Device(StrictModel):
    """``[[device]]``: an instrument on a link, decoded by a driver; a link may have several devices."""

    name: Annotated[Name, key("name of the device, and of its topics /NAME/MEASUREMENT", NO_UNIT, "radalt")]
    link: Annotated[Name, key("name of the link to which it is connected", NO_UNIT, "radalt_line")]
    driver: Annotated[str, key("driver that decodes its bytes; fti drivers lists them", NO_UNIT, "freeflight_ra4500")]
    rate_hz: Annotated[
        Positive | None, key("nominal rate of its messages; deviations are reported; none: no check", "Hz", 25.0)
    ] = None
    max_age_ms: Annotated[float, Field(gt=0, le=3_600_000), key("an older measurement is stale and not used", "ms")] = (
        1000.0
    )
    latency_ms: Annotated[
        float,
        Field(ge=0, le=3_600_000),
        key(
            "shortest time from the validity of a quantity to the arrival of its first byte; fti latency estimates "
            "that "
            "of an altimeter",
            "ms",
        ),
    ] = 0.0
    use_device_time: Annotated[
        bool,
        key(
            "true: a measurement is valid at the time that the device states, once its clock is synchronised to FTI "
            "time; false: always at the arrival less latency_ms",
            NO_UNIT,
        ),
    ] = True
    lever_arm_b: Annotated[
        Vector, key("position of the sensor from the reference point of the aircraft: forward, right, down", "m")
    ] = (0.0, 0.0, 0.0)
    rpy_bs_deg: Annotated[
        Vector,
        key(
            "mounting: roll, pitch and yaw that rotate the axes of the sensor into those of the aircraft; for beams, "
            "magnetic fields and inertial samples; an attitude is not rotated",
            "deg",
        ),
    ] = (0.0, 0.0, 0.0)
    depends_on: Annotated[
        tuple[Literal["satellites", "inertial", "map", "pressure"], ...] | None,
        key(
            "sources on which its position depends beside the device itself; a device of nav.position that shares none "
            "with a receiver can confirm it; none: it confirms nothing, and a receiver counts as satellites",
            NO_UNIT,
            ["satellites", "inertial"],
        ),
    ] = None
    altimeter: Annotated[
        Altimeter | None, key("[device.altimeter]: the device is an altimeter; none: it is not", NO_UNIT)
    ] = None
    options: Annotated[
        dict[str, Any], key("[device.options]: options of the driver; fti drivers NAME describes them", NO_UNIT)
    ] = Field(default_factory=dict)


# --------------------------------------------------------------------------------------------- navigation, display


class TerrainFileTable(StrictModel):
    """``[[nav.terrain.file]]``: datum, sigma and date of elevation files; they have precedence over those in a file.

    Where several tables match a file, the first one with the key counts.
    """

    path: Annotated[
        str,
        Field(min_length=1),
        key(
            "elevation files: one of nav.terrain.files, all in a folder, or a pattern (* any characters, ? one)",
            NO_UNIT,
            "tiles/*.tif",
        ),
    ]
    vertical: Annotated[
        Literal["ellipsoid", "egm96", "egm2008"] | None,
        key("height datum; none: as the file states it, otherwise nav.terrain.vertical", NO_UNIT, "egm2008"),
    ] = None
    sd_m: Annotated[
        Positive | None,
        key("1-sigma of the heights; none: as the file states it (DTED), otherwise nav.terrain.sd_m", "m", 0.3),
    ] = None
    date: Annotated[
        Annotated[str, Field(pattern=DATE_PATTERN)] | None,
        key("date of the survey: year, year-month or year-month-day; none: as in the file", NO_UNIT, "2019-05"),
    ] = None

    @field_validator("date", mode="before")
    @classmethod
    def _date_as_text(cls, value: object) -> object:
        return value.isoformat() if isinstance(value, datetime.date) else value

    @field_validator("date")
    @classmethod
    def _is_in_calendar(cls, value: str | None) -> str | None:
        if value is not None:
            try:
                datetime.date.fromisoformat(value + "0000-01-01"[len(value) :])
            except ValueError as error:
                raise PydanticCustomError("date", "there is no such day ({reason})", {"reason": str(error)}) from None
        return value


class LandCoverTable(StrictModel):
    """``[[nav.terrain.cover]]``: what a kind of altimeter measures over classes of land cover.

    For the profiles of ``[nav.terrain_position]``.  The numbers depend on the plants, the season and the altimeter:
    there is no default.
    """

    classes: Annotated[
        tuple[Annotated[int, Field(ge=1, le=255)], ...],
        Field(min_length=1),
        key("values of nav.terrain.land_cover; ESA WorldCover: 10 trees, 50 built-up, 80 water", NO_UNIT, [10]),
    ]
    altimeter: Annotated[
        Literal["radar", "laser", "multibeam"],
        key("kind of altimeter, as in device.altimeter.kind", NO_UNIT, "laser"),
    ]
    bias_m: Annotated[
        Annotated[float, Field(ge=-10, le=100)],
        key("height of the measured surface above the elevation, on average", "m", 17.0),
    ] = 0.0
    sd_m: Annotated[
        Annotated[float, Field(ge=0, le=100)],
        key("1-sigma of that height, in addition to that of the elevation", "m", 5.0),
    ] = 0.0
    excluded: Annotated[bool, key("the ground below it is unknown: no sample there is used", NO_UNIT)] = False


class TerrainFiles(StrictModel):
    """``[nav.terrain]``: elevation files and the datum of their heights, or a scene of the emulator.

    Exactly one of ``files`` and ``scene`` is required; the other keys but sd_m need files.
    """

    files: Annotated[
        tuple[str, ...],
        key(
            "elevation files (GeoTIFF, DTED, SRTM and other formats of GDAL), and folders of such files",
            NO_UNIT,
            ["dsm_1m.tif", "srtm.hgt"],
        ),
    ] = ()
    vertical: Annotated[
        Literal["ellipsoid", "egm96", "egm2008"] | None,
        key(
            "height datum of files that do not state it; required with files; the geoids need a grid", NO_UNIT, "egm96"
        ),
    ] = None
    centre_deg: Annotated[
        tuple[Annotated[float, Field(ge=-90, le=90)], Annotated[float, Field(ge=-180, le=180)]] | None,
        key(
            "latitude and longitude of the centre of the square to load; none: all that the files cover",
            "deg",
            [47.9, 11.8],
        ),
    ] = None
    radius_m: Annotated[
        Positive | None, key("half the side of the square to load; given with centre_deg", "m", 20000.0)
    ] = None
    memory_mb: Annotated[
        Annotated[float, Field(ge=16, le=100_000)] | None,
        key(
            "memory for elevation: squares around the aircraft are loaded in succession, as large as half of it "
            "allows; not with centre_deg; none: everything is loaded at the start",
            "MiB",
            500.0,
        ),
    ] = None
    cell_m: Annotated[
        Positive | None, key("spacing of the posts of the finest layer; none: that of the finest file", "m", 5.0)
    ] = None
    scene: Annotated[
        Literal["demo", "demo_country", "demo_coast"] | None,
        key(
            "instead of files, the ground of the emulator; demo: the strip below the approach of the demonstration; "
            "demo_country: the strip and the region around it; demo_coast: the same with a level sea and dunes in its "
            "west; none: files",
            NO_UNIT,
            instead="demo",
        ),
    ] = None
    sd_m: Annotated[
        Positive,
        key("1-sigma of heights of files that do not state it (DTED does); the error of resampling is added", "m"),
    ] = 1.5
    land_cover: Annotated[
        str | None,
        key(
            "classes of land cover, one band of bytes, 0 unknown (GeoTIFF, such as ESA WorldCover); none: unknown "
            "everywhere",
            NO_UNIT,
            "worldcover.tif",
        ),
    ] = None
    cover: Annotated[
        tuple[LandCoverTable, ...],
        key("[[nav.terrain.cover]]: what altimeters measure over classes of nav.terrain.land_cover", NO_UNIT),
    ] = ()
    file: Annotated[
        tuple[TerrainFileTable, ...],
        key("[[nav.terrain.file]]: datum, sigma and date of single files, folders or patterns", NO_UNIT),
    ] = ()

    @property
    def square_mb(self) -> float | None:
        """The part of memory_mb for the elevation; the surface that a kind of altimeter measures needs as much."""
        kinds = {table.altimeter for table in self.cover}
        return None if self.memory_mb is None else self.memory_mb / (1 + len(kinds))


class Approach(StrictModel):
    """``[nav.approach]``: the published approach and the limits of its integrity monitor."""

    profile: Annotated[str, key("reference of the approach, a file of fti reference make", NO_UNIT, "profiles/27.csv")]
    window_m: Annotated[Positive, key("length of the comparison window along the track", "m")] = 400.0
    y_max_m: Annotated[Positive, key("largest deviation from the track; beyond it the monitor is inactive", "m")] = (
        150.0
    )
    max_roll_deg: Annotated[Positive, key("largest roll; beyond it the monitor is inactive", "deg")] = 10.0
    max_pitch_deg: Annotated[Positive, key("largest pitch; beyond it the monitor is inactive", "deg")] = 10.0
    alert_s_m: Annotated[Positive, key("alert limit along the track", "m")] = 50.0
    alert_y_m: Annotated[
        Positive,
        key(
            "alert limit across the track; where 3.1 sigma of the navigated position exceed it, integrity is "
            "unavailable",
            "m",
        ),
    ] = 100.0
    alert_v_m: Annotated[
        Positive,
        key(
            "vertical alert limit near the ground; where the protection level exceeds it, integrity is unavailable", "m"
        ),
    ] = 5.0
    alert_v_deg: Annotated[
        Positive, key("vertical alert limit farther away, as an angle seen from the intercept point", "deg")
    ] = 0.35


class Filter(StrictModel):
    """``[nav.filter]``: aided inertial navigation, used while devices give no position, altitude or attitude."""

    imu: Annotated[Name, key("device whose specific force and turn rate are integrated", NO_UNIT, "ins")]
    unit: Annotated[Literal["navigation", "tactical", "mems"], key("grade of the inertial unit", NO_UNIT)] = "tactical"
    gnss: Annotated[tuple[Name, ...], key("devices whose positions and velocities aid", NO_UNIT, ["gnss"])] = ()
    baro: Annotated[
        tuple[Name, ...],
        key(
            "devices whose pressure altitudes aid, in order of preference: one at a time, the next one after 2 s "
            "without "
            "data; a single name needs no list",
            NO_UNIT,
            ["air_data"],
        ),
    ] = ()
    altimeters: Annotated[
        tuple[Name, ...],
        key("devices of nav.altimeters whose heights aid over known terrain, once a second", NO_UNIT, ["radalt"]),
    ] = ()
    airspeed: Annotated[
        Name | None,
        key(
            "device whose true airspeed aids, every 5 s above 15 m/s, with an estimated wind; none: no such aiding",
            NO_UNIT,
            "air_data",
        ),
    ] = None
    heading: Annotated[
        Name | None,
        key(
            "device whose magnetic field aids the heading, once a second; needs declination_deg; none: no such aiding",
            NO_UNIT,
            "magnetometer",
        ),
    ] = None
    declination_deg: Annotated[
        Annotated[float, Field(ge=-180, le=180)] | None,
        key("direction of magnetic north in the area, positive east of true north; given with heading", "deg", 3.5),
    ] = None
    states: Annotated[Literal[9, 15], key("15: with the biases of the inertial unit; 9: without", ONE)] = 15

    @field_validator("baro", mode="before")
    @classmethod
    def _wrap_single_name(cls, value: object) -> object:
        if isinstance(value, str):
            return (value,)
        return tuple(value) if isinstance(value, list) else value


class Station(StrictModel):
    """``[nav.radio.station.NAME]``: position of a DME station; NAME is the name that the devices send."""

    lat_deg: Annotated[float, Field(ge=-90, le=90), key("latitude, positive north", "deg", 36.7)]
    lon_deg: Annotated[float, Field(ge=-180, le=180), key("longitude, positive east", "deg", -84.1)]
    alt_m: Annotated[Metres, key("altitude above the WGS84 ellipsoid", "m", 420.0)]


class Radio(StrictModel):
    """``[nav.radio]``: position from satellites and DME, used if neither a device nor the filter provides one."""

    receiver: Annotated[
        Name | None, key("device whose satellites and fixes are used; none: DME alone", NO_UNIT, "gnss")
    ] = None
    station: Annotated[
        dict[str, Station], key("[nav.radio.station.NAME]: DME stations by the names in the messages", NO_UNIT)
    ] = Field(default_factory=dict)
    altimeter: Annotated[
        Name | None,
        key(
            "device of nav.altimeters whose heights over known terrain give the altitude where its predicted sigma is "
            "the "
            "smaller one; none: no altimeter",
            NO_UNIT,
            "radalt",
        ),
    ] = None
    dme_sd_m: Annotated[Positive, key("1-sigma of a DME range", "m")] = 222.0


class TerrainPositionTable(StrictModel):
    """``[nav.terrain_position]``: position by comparison of a height profile with known terrain; it aids the filter.

    Needs ``[nav.filter]`` and ``[nav.terrain]``.
    """

    altimeter: Annotated[
        Name,
        key(
            "device of nav.altimeters whose heights make the profile, or an altimeter of the kind multibeam",
            NO_UNIT,
            "radalt",
        ),
    ]
    window_s: Annotated[
        float,
        Field(ge=5.0, le=120.0),
        key("duration of a profile: a longer one is more certain over gentle ground, and rarer", "s"),
    ] = 20.0
    map_sd_m: Annotated[
        Positive,
        key(
            "1-sigma of the horizontal position of the elevation, each axis: datum and adjustment; it is part of every "
            "protection level",
            "m",
        ),
    ] = 5.0
    max_sd_m: Annotated[
        Positive, key("a fix whose 1-sigma is larger, along its weaker axis, is refused: flat ground", "m")
    ] = 30.0


class ScanDriftTable(StrictModel):
    """``[nav.scan_drift]``: drift between two looks at the same ground, without a map; it aids the filter.

    A look is an image, or what a scanner measures in ``exposure_s``.  The next one is taken when the aircraft has flown
    half of the length of the last one on the ground; of two line scanners, when the rear one sees the ground that the
    front one has seen.  Needs ``[nav.filter]`` with receivers: the drift aids without satellites only after it has
    agreed with them.
    """

    device: Annotated[
        Name,
        key(
            "device that gives scans: a range imager, a scanner that turns, or the front line scanner",
            NO_UNIT,
            "imager",
        ),
    ]
    second_device: Annotated[
        Name | None,
        key(
            "rear one of two line scanners, which sees the same ground later; none: the device sees it twice",
            NO_UNIT,
            "rear",
        ),
    ] = None
    range_sd_m: Annotated[Positive, key("1-sigma of the noise of a range", "m")] = 0.1
    time_sd_ms: Annotated[
        Positive, key("1-sigma of the time of a look against the inertial samples, another one in each look", "ms")
    ] = 0.5
    exposure_s: Annotated[
        float,
        Field(ge=0.0, le=1.5),
        key(
            "duration of a look; 0: each scan of the device is a whole image; a turn of a scanner; a strip of lines, "
            "shorter than the time from the front scanner to the rear one",
            "s",
            0.1,
        ),
    ] = 0.0

    @property
    def devices(self) -> tuple[str, ...]:
        """The devices whose scans are looks, the front one first."""
        return (self.device,) if self.second_device is None else (self.device, self.second_device)


class UnstatedSd(StrictModel):
    """``[nav.unstated_sd]``: the sigma of a position or an attitude whose source states none.

    The defaults of a receiver are the 95 % errors of the service, 8 m and 13 m (GPS Standard Positioning Service
    Performance Standard 2020, table 3.8-3: global average), over 2.45 and 1.96.  An inertial system is aided by
    satellites and coasts without them: 1.5 times as much.
    """

    satellites: Annotated[
        tuple[Positive, Positive], key("1-sigma of the position of a receiver: horizontal, vertical", "m")
    ] = (3.3, 6.6)
    inertial: Annotated[
        tuple[Positive, Positive],
        key("1-sigma of the position of a device that is in nav.attitude as well: horizontal, vertical", "m"),
    ] = (5.0, 10.0)
    attitude_deg: Annotated[
        tuple[Positive, Positive],
        key("1-sigma of an attitude: tilt, heading; typical of a small MEMS unit in motion", "deg"),
    ] = (1.0, 2.0)


class AlertLimits(StrictModel):
    """``[nav.alert_limits]``: required quality of position, altitude and attitude."""

    position_m: Annotated[
        Positive, key("the position is invalid while its horizontal protection level is larger", "m")
    ] = 200.0
    altitude_m: Annotated[
        Positive, key("the altitude is invalid while its vertical protection level is larger", "m")
    ] = 30.0
    attitude_deg: Annotated[
        Positive, key("roll and pitch are invalid while the protection level of the tilt is larger", "deg")
    ] = 2.0
    compared: Annotated[
        bool,
        key(
            "true: position and attitude are also invalid while no other source, nor the filter, can be compared with "
            "theirs; needs [nav.filter] with gnss",
            NO_UNIT,
        ),
    ] = False


class SourceLimits(StrictModel):
    """``[nav.limits]``: flight limits of the aircraft; a position source that exceeds them is refused."""

    speed_mps: Annotated[Positive, key("largest speed over ground", "m/s")] = 400.0
    climb_mps: Annotated[Positive, key("largest vertical speed, up or down", "m/s")] = 150.0
    acceleration_mps2: Annotated[
        Positive, key("largest acceleration without gravity; 30 is a level turn of 3.2 g", "m/s2")
    ] = 30.0
    wind_mps: Annotated[Positive, key("strongest wind; it limits the angle between heading and track", "m/s")] = 40.0
    undulation_m: Annotated[
        Positive, key("largest difference between a stated undulation of the geoid and EGM96", "m")
    ] = 5.0


class Nav(StrictModel):
    """``[nav]``: roles of the devices."""

    attitude: Annotated[
        tuple[Name, ...],
        key(
            "devices for roll, pitch and heading, in order of preference; the names filter, radio and vertical are "
            "reserved",
            NO_UNIT,
            ["ins"],
        ),
    ] = ()
    position: Annotated[
        tuple[Name, ...],
        key(
            "devices for position, velocity and altitude, in order of preference; the names filter, radio and vertical "
            "are reserved",
            NO_UNIT,
            ["ins", "gnss"],
        ),
    ] = ()
    altimeters: Annotated[
        tuple[Name, ...], key("devices with a [device.altimeter] table; all of them are used", NO_UNIT, ["radalt"])
    ] = ()
    wheels_b: Annotated[
        Vector | None,
        key(
            "contact point of the lowest wheel from the reference point: forward, right, down; height outputs then "
            "contain the height of the wheels too; none: they do not",
            "m",
            [-0.4, 0.0, 1.6],
        ),
    ] = None
    terrain: Annotated[TerrainFiles | None, key("[nav.terrain]; none: no known terrain", NO_UNIT)] = None
    filter: Annotated[Filter | None, key("[nav.filter]; none: no inertial filter", NO_UNIT)] = None
    terrain_position: Annotated[
        TerrainPositionTable | None, key("[nav.terrain_position]; none: no position from the ground", NO_UNIT)
    ] = None
    scan_drift: Annotated[
        ScanDriftTable | None, key("[nav.scan_drift]; none: no drift between looks at the ground", NO_UNIT)
    ] = None
    radio: Annotated[Radio | None, key("[nav.radio]; none: no position from satellites and DME", NO_UNIT)] = None
    approach: Annotated[Approach | None, key("[nav.approach]; none: no integrity monitor", NO_UNIT)] = None
    unstated_sd: Annotated[UnstatedSd, key("[nav.unstated_sd]", NO_UNIT)] = UnstatedSd()
    alert_limits: Annotated[AlertLimits, key("[nav.alert_limits]", NO_UNIT)] = AlertLimits()
    limits: Annotated[SourceLimits, key("[nav.limits]", NO_UNIT)] = SourceLimits()


def is_multibeam(device: Device) -> bool:
    """Whether it is configured as an altimeter with several beams, which measures ranges along them and no height."""
    return device.altimeter is not None and device.altimeter.kind == "multibeam"


def position_sources(nav: Nav) -> tuple[str, ...]:
    """Devices whose positions are used: by the role, by the filter, by the fix from satellites and DME."""
    receiver = nav.radio.receiver if nav.radio else None
    aiding = (*(nav.filter.gnss if nav.filter else ()), *((receiver,) if receiver else ()))
    return tuple(dict.fromkeys((*nav.position, *aiding)))


def altimeter_links(devices: Sequence[Device], nav: Nav) -> frozenset[str]:
    """Links of the altimeters that navigation uses."""
    return frozenset(device.link for device in devices if device.name in nav.altimeters)


class Display(StrictModel):
    """``[display]``: the page in the browser, on loopback only."""

    enabled: Annotated[bool, key("serve the page; for marks and commands open it with fti page", NO_UNIT)] = True
    address: Annotated[Literal["127.0.0.1"], key("address of the page; no other one is allowed", NO_UNIT)] = "127.0.0.1"
    port: Annotated[
        int,
        Field(ge=0, le=65535),
        key("port of the page; 0: any free one; while another program uses it, the daemon retries", NO_UNIT),
    ] = 8080


class Bus(StrictModel):
    """``[bus]``: outputs, health and events for zenoh clients of this computer, on loopback only.

    The file ``fti.json`` in the run directory states the endpoint.
    """

    enabled: Annotated[
        bool, key("publish on the bus; a table with port and without this key counts as true", NO_UNIT)
    ] = False
    port: Annotated[int, Field(ge=0, le=65535), key("port of the endpoint; 0: any free one", NO_UNIT)] = 0

    @model_validator(mode="before")
    @classmethod
    def _enable_by_port(cls, table: Any) -> Any:
        return {"enabled": True, **table} if isinstance(table, dict) and "port" in table else table


class Config(StrictModel):
    """The tables of the file."""

    session: Annotated[Session, key("[session]: storage of the recording", NO_UNIT)]
    link: Annotated[tuple[Link, ...], key("[[link]]: ports", NO_UNIT)] = ()
    device: Annotated[tuple[Device, ...], key("[[device]]: instruments", NO_UNIT)] = ()
    nav: Annotated[Nav, key("[nav]: roles of the devices", NO_UNIT)] = Nav()
    display: Annotated[Display, key("[display]: the page in the browser", NO_UNIT)] = Display()
    bus: Annotated[Bus, key("[bus]: outputs for zenoh clients of this computer", NO_UNIT)] = Bus()
    publish: Annotated[Publish | None, key("[publish]: outputs for other programs; none: none", NO_UNIT)] = None
    snapshot: Annotated[Snapshot | None, key("[snapshot]: triggered captures; none: no triggers", NO_UNIT)] = None
    recorder: Annotated[RecorderTuning, key("[recorder]: real-time settings", NO_UNIT)] = RecorderTuning()
    path: SkipJsonSchema[str] = ""  # of the file
    text: SkipJsonSchema[str] = ""  # of the file

    def devices_on(self, link: str) -> tuple[Device, ...]:
        """The devices on a link."""
        return tuple(d for d in self.device if d.link == link)

    def find_device(self, name: str) -> Device | None:
        """The device of that name."""
        return next((d for d in self.device if d.name == name), None)
