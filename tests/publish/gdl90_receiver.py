"""A receiver of GDL 90, written from the tables of the ICD (560-1058-00 Rev A) and of ForeFlight's specification.

It shares nothing with the encoder, and raises AssertionError for everything that the documents do not allow.
"""

from __future__ import annotations

from dataclasses import dataclass


def crc_table() -> list[int]:
    """ICD 2.2.3: the table that its program makes."""
    table = []
    for i in range(256):
        crc = i << 8
        for _ in range(8):
            crc = ((crc << 1) ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
        table.append(crc)
    return table


TABLE = crc_table()


def crc_of(block: bytes) -> int:
    """ICD 2.2.3: crcCompute."""
    crc = 0
    for byte in block:
        crc = TABLE[crc >> 8] ^ ((crc << 8) & 0xFFFF) ^ byte
    return crc


def unframe(datagram: bytes) -> bytes:
    """ICD 2.2.1: the message between the flags, without stuffing and CRC, which must be right."""
    assert datagram[0] == datagram[-1] == 0x7E
    inner = datagram[1:-1]
    assert 0x7E not in inner
    message, at = bytearray(), 0
    while at < len(inner):
        if inner[at] == 0x7D:
            at += 1
            assert inner[at] in (0x5D, 0x5E)
            message.append(inner[at] ^ 0x20)
        else:
            message.append(inner[at])
        at += 1
    assert int.from_bytes(message[-2:], "little") == crc_of(bytes(message[:-2]))
    return bytes(message[:-2])


@dataclass(frozen=True)
class Heartbeat:
    position_valid: bool
    utc_ok: bool
    seconds: int


@dataclass(frozen=True)
class Ownship:
    """lat, lon [deg]; None as the ICD codes unknown values."""

    lat: float | None
    lon: float | None
    pressure_altitude_ft: int | None
    is_airborne: bool
    nic: int
    nacp: int
    speed_kt: int | None
    climb_fpm: int | None
    track_deg: float | None
    address: int
    emitter: int
    callsign: str


@dataclass(frozen=True)
class GeometricAltitude:
    altitude_ft: int
    has_warning: bool
    figure_of_merit_m: int | None


@dataclass(frozen=True)
class Identity:
    name: str
    long_name: str
    is_msl: bool


@dataclass(frozen=True)
class Ahrs:
    roll_deg: float | None
    pitch_deg: float | None
    heading_deg: float | None
    is_magnetic: bool
    airspeeds_kt: tuple[int | None, int | None]


Message = Heartbeat | Ownship | GeometricAltitude | Identity | Ahrs


def decode(datagram: bytes) -> Message:
    message = unframe(datagram)
    match message[0]:
        case 0:
            return heartbeat(message)
        case 10 | 20:
            return ownship(message)
        case 11:
            return geometric_altitude(message)
        case 0x65:
            return identity(message) if message[1] == 0 else ahrs(message)
    raise AssertionError(f"message {message[0]} is not of this interface")


def heartbeat(message: bytes) -> Heartbeat:
    assert len(message) == 7
    seconds = message[3] | message[4] << 8 | (message[2] >> 7) << 16
    assert seconds < 86_400
    assert message[1] & 0x01
    return Heartbeat(bool(message[1] & 0x80), bool(message[2] & 0x01), seconds)


def signed(data: bytes) -> int:
    return int.from_bytes(data, "big", signed=True)


def ownship(message: bytes) -> Ownship:
    assert len(message) == 28
    digits = message.hex()
    lat, lon = (signed(message[at : at + 3]) * 180 / 2**23 for at in (5, 8))
    nic, nacp = message[13] >> 4, message[13] & 15
    assert nic <= 11
    assert nacp <= 11
    assert abs(lat) <= 90
    has_position = bool(lat or lon or nic)
    altitude, miscellaneous = int(digits[22:25], 16), int(digits[25], 16)
    speed, climb = int(digits[28:31], 16), int(digits[31:34], 16)
    assert not 0x1FF <= climb <= 0x7FF
    assert not 0x801 <= climb <= 0xE01
    assert miscellaneous & 3 in (0, 1)
    callsign = message[19:27].decode("ascii")
    assert all(letter.isdigit() or letter.isupper() for letter in callsign.rstrip(" "))
    return Ownship(
        lat=lat if has_position else None,
        lon=lon if has_position else None,
        pressure_altitude_ft=None if altitude == 0xFFF else altitude * 25 - 1000,
        is_airborne=bool(miscellaneous & 8),
        nic=nic,
        nacp=nacp,
        speed_kt=None if speed == 0xFFF else speed,
        climb_fpm=None if climb == 0x800 else (climb - 0x1000 if climb & 0x800 else climb) * 64,
        track_deg=message[17] * 360 / 256 if miscellaneous & 3 else None,
        address=int.from_bytes(message[2:5], "big"),
        emitter=message[18],
        callsign=callsign.rstrip(" "),
    )


def geometric_altitude(message: bytes) -> GeometricAltitude:
    assert len(message) == 5
    metrics = int.from_bytes(message[3:5], "big")
    merit = metrics & 0x7FFF
    return GeometricAltitude(signed(message[1:3]) * 5, bool(metrics & 0x8000), None if merit == 0x7FFF else merit)


def identity(message: bytes) -> Identity:
    assert len(message) == 39
    assert message[2] == 1
    name, long_name = (part.rstrip(b"\0").decode() for part in (message[11:19], message[19:35]))
    return Identity(name, long_name, is_msl=bool(message[38] & 1))


def ahrs(message: bytes) -> Ahrs:
    assert len(message) == 12
    assert message[1] == 1
    roll, pitch = (signed(message[at : at + 2]) for at in (2, 4))
    heading, *airspeeds = (int.from_bytes(message[at : at + 2], "big") for at in (6, 8, 10))
    for angle in (roll, pitch):
        assert angle == 0x7FFF or abs(angle) <= 1800
    assert heading == 0xFFFF or heading & 0x7FFF <= 3600
    return Ahrs(
        None if roll == 0x7FFF else roll / 10,
        None if pitch == 0x7FFF else pitch / 10,
        None if heading == 0xFFFF else (heading & 0x7FFF) / 10,
        heading != 0xFFFF and bool(heading & 0x8000),
        (None if airspeeds[0] == 0xFFFF else airspeeds[0], None if airspeeds[1] == 0xFFFF else airspeeds[1]),
    )
