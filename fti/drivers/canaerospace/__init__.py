"""CANaerospace 1.7: air data, surface positions, radio height, DME; a protocol whose messages describe themselves.

Document: CANaerospace interface specification 1.7 (Stock Flight Systems, 2006), sections 2 to 5.

    11-bit identifier | byte 0 node | 1 data type | 2 service | 3 message code | 4-7 data, big-endian

    0-127     emergency event      node with the error, type 1: location u8, operation u8, error i16
    128-199   node service         addressed node; even identifiers: requests, odd ones: responses; also 2000-2031
    300-1799  normal operation     sending node; the message code counts the messages of an identifier
    others    user-defined         decoded only if the DBC has them

    data type 2 FLOAT, 3-5 LONG ULONG BLONG, 6-8 SHORT .., 9-11 CHAR .., 12 SHORT2 (value, full scale of 32767), 13-20,
    26-28 two to four integers, 23-25, 29 characters, 30 and 31 the halves of a double

    306-310 rudder, stabilizer, elevator, left and right aileron [deg]   311 pitch, 312 roll, 313 sideslip [deg]
    315 IAS, 316 TAS, 317 CAS [m/s]   320 baro-corrected, 322 standard altitude [m]   323 TAT, 324 SAT [K]
    325 differential, 326 static pressure [hPa]   328 angle of attack [deg]   1070 radio height, 1071-1074 DME [m]

A DBC defines the identifiers (``parameters.dbc``, or that of option ``dbc_file``): a name of a quantity
(``fti.formats.quantities``) becomes its measurement, any other a Reading, and normal operation data that are not in the
DBC a Reading ``nod_<identifier>``.  For a layout without this header use the driver ``dbc``.

Message codes and silent nodes: ``_node_supervision``; lost messages are counted and reported as a DeviceStatus.  A node
counts as alive while it sends any message, and identifies itself on request (command ``identify``).

Open: the notes on 313 state "yaw right +", the text refers to the signs of ISO 1151; this driver uses ISO (wind from
the right is positive); a negative factor in the DBC inverts it.  The protocol has no standard flag for validity:
invalid values of the emulator's sensors are not sent.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from pydantic import Field

from fti.config import StrictModel
from fti.config.keys import NO_UNIT, ONE, key
from fti.drivers import Command
from fti.drivers._no_commands import on_connect, poll  # noqa: F401 - the rest of the contract
from fti.drivers.canaerospace.decoder import Decoder
from fti.drivers.canaerospace.encoder import Encoder, identification_request
from fti.drivers.canaerospace.parameters import read_parameters
from fti.formats.quantities import QUANTITIES

DOCUMENT = "CANaerospace interface specification 1.7 (Stock Flight Systems, 2006); identifiers by DBC"
MESSAGES = {
    **dict.fromkeys(QUANTITIES, "a parameter of this name in the DBC"),
    "emergency_event": "error report of a unit",
    "ids_response": "identification of a node",
    "(other)": "other normal operation data, by name or as nod_<identifier>; node services by name",
}
CARRIERS = frozenset({"can"})
COMMANDS = {
    "identify": Command(
        "request the identification of a node: revisions, identifier distribution, header",
        {"node": "number of the node, 1 to 255; 0: all; default: that of the device, or all"},
    )
}


class Options(StrictModel):
    """Options of the nodes of a CANaerospace bus."""

    dbc_file: Annotated[
        str | None, key("file of a DBC with the parameters; none: the text in dbc", NO_UNIT, "dbc/air_data_unit.dbc")
    ] = None
    dbc: Annotated[str, key("text of the DBC, filled in from dbc_file; empty: the built-in one", NO_UNIT)] = ""
    node: Annotated[
        Annotated[int, Field(ge=0, le=255)] | None,
        key(
            "only frames of this node number (byte 0); none: every node, and the emulated device is node 1", NO_UNIT, 7
        ),
    ] = None
    silent_after: Annotated[
        float, Field(ge=2, le=1000), key("message periods without a message until a node is reported as silent", ONE)
    ] = 5.0


def make_decoder(options: Options) -> Decoder:
    """A fresh decoder.  Raises ValueError for a wrong DBC."""
    return Decoder(read_parameters(options.dbc), options.node, options.silent_after)


def make_encoder(options: Options) -> Encoder:
    """A fresh encoder.  Raises ValueError for a wrong DBC."""
    return Encoder(read_parameters(options.dbc), 1 if options.node is None else options.node)


def command(name: str, args: Mapping[str, str], options: Options | None = None) -> bytes:
    """The frame of a command.  Raises ValueError when it or an argument is unknown or out of range."""
    if name != "identify":
        raise ValueError(f"no command {name!r}; there are identify")
    if set(args) - {"node"}:
        raise ValueError(f"identify: no argument {min(set(args) - {'node'})!r}; there is node")
    own = options.node if options and options.node is not None else 0
    text = args.get("node", str(own))
    if not text.isdecimal() or int(text) > 255:
        raise ValueError(f"identify: node = {text!r}; allowed is 0 to 255")
    return identification_request(int(text))
