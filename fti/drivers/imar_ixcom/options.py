"""Options of the driver, and the names of all messages."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.drivers.imar_ixcom.data_selection import DEFAULT_SELECTION

NAMES = {
    0x00: "IMURAW", 0x01: "IMUCORR", 0x02: "IMUCOMP", 0x03: "INSSOL", 0x04: "INSRPY", 0x05: "INSDCM", 0x06: "INSQUAT",
    0x07: "INSVELNED", 0x08: "INSVELECEF", 0x09: "INSVELBODY", 0x0A: "INSPOSLLH", 0x0B: "INSPOSECEF", 0x0C: "INSPOSUTM",
    0x0E: "INSTRACKACC", 0x0F: "EKFSTDDEV", 0x10: "EKFERROR", 0x12: "GNSSSOL", 0x13: "INSGNDSPEED", 0x14: "GNSSTIME",
    0x16: "WHEELDATA", 0x17: "AIRDATA", 0x18: "MAGDATA", 0x19: "SYSSTAT", 0x1A: "INSMAGHDG", 0x1B: "GNSSLEVERARM",
    0x1C: "GNSSVOTER", 0x1D: "ARINC429STAT", 0x1E: "GNSSHWMON", 0x1F: "HEAVE", 0x21: "POWER", 0x22: "TEMPERATURE",
    0x23: "INSVELENU", 0x24: "CANSTAT", 0x25: "GNSSSATINFO", 0x26: "TIME", 0x27: "EKFERROR2", 0x28: "EKFSTDDEV2",
    0x29: "EKFPOSCOVAR", 0x33: "GNSSHDG", 0x34: "EVENTTIME", 0x35: "OMGINT", 0x40: "POSTPROC", 0x42: "CSACDATA",
    0x43: "PORTSTATS", 0x45: "NTRIPSTATUS", 0x46: "INSMGRS", 0x47: "INSSOLECEF", 0x48: "EKFSTDDEVECEF",
    0x49: "LOADFACTOR", 0x50: "OMGDOT", 0x51: "GNSSSATINF", 0x56: "IMUFILTERED", 0x58: "GNSSSTREAM",
    0x59: "GNSSOBSSTREAM", 0x60: "GNSSDOP", 0x61: "GNSSPOSECEF", 0x62: "GNSSVELECEF", 0x64: "PLUGIN", 0x65: "MAGDATA2",
    0x67: "RAWDATA", 0x85: "EKFSTATEXT", 0x91: "CANGATEWAY", 0x92: "CANSTATUS2", 0x93: "EXTPOSLLH", 0x94: "EXTVELNED",
    0x95: "EXTVELBODY", 0x96: "ODOLEVERARM", 0x97: "EXTSTREAM", 0x98: "EXTHEIGHT", 0x99: "SYNCCOUNTER",
    0x9A: "EKFSTDDEV3", 0x9B: "EXTHEADING", 0x9C: "EXTMAGNETOMETER", 0xA0: "INSRPYRATE", 0xA1: "ACCNED",
    0xA2: "UNIXTIME", 0xA3: "INSWANDERAZIMUTH", 0xA4: "JERKNED", 0xA5: "INSRPYACCEL", 0xA6: "DISCRETE_STATE",
    0xD2: "IPVAS", 0xFD: "COMMAND", 0xFE: "RESPONSE", 0xFF: "PARAMETER",
}  # fmt: skip
NUMBERS = {name: number for number, name in NAMES.items()}
#: Commands and responses; all other messages can be requested.
RESERVED = frozenset({0xFD, 0xFE, 0xFF})
REQUESTABLE = {name: number for name, number in NUMBERS.items() if number not in RESERVED}
TESLA = {"nT": 1e-9, "uT": 1e-6, "mG": 1e-7, "G": 1e-4}
CHANNELS = 32


def check_name(name: str) -> str:
    """Check the name of a requestable message.  Raises ValueError."""
    if name not in REQUESTABLE:
        raise ValueError(f"message {name!r}; there are {', '.join(sorted(REQUESTABLE))}")
    return name


MessageName = Annotated[str, AfterValidator(check_name)]
Divider = Annotated[int, Field(ge=0, le=0xFFFF)]


class Options(StrictModel):
    """Options of an inertial navigation system."""

    data_selection: Annotated[
        int,
        Field(ge=0, le=0xFFFF),
        key("contents of INSSOL, bit by bit; used where the message states 0", NO_UNIT),
    ] = DEFAULT_SELECTION
    magnetometer_unit: Annotated[
        Literal["nT", "uT", "mG", "G"],
        key("unit of the field in MAGDATA: nT by the document; the maker's ROS driver uses mG", NO_UNIT),
    ] = "nT"
    only: Annotated[
        tuple[MessageName, ...],
        key(
            "messages that become measurements; empty: all; it allows two devices on a link, the system and its "
            "receiver; "
            "the emulated device with this option sends nothing",
            NO_UNIT,
            ["GNSSSOL"],
        ),
    ] = ()
    logs: Annotated[
        dict[MessageName, Divider],
        key(
            "messages that ask requests, and that the emulated device sends, each with its divider of the navigation "
            "rate; 0: at every change",
            ONE,
        ),
    ] = Field(default_factory=lambda: {"INSSOL": 1})
    ask: Annotated[
        bool,
        key(
            "true: open the channel and request logs after every connect; false: the device sends what it is "
            "configured "
            "to send",
            NO_UNIT,
        ),
    ] = False
    channel: Annotated[int, Field(ge=0, lt=CHANNELS), key("logical channel to open", NO_UNIT)] = 0
