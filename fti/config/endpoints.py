"""Addresses with a port, ``1.2.3.4:5`` or ``[::1]:5``."""

from __future__ import annotations

import ipaddress
from typing import Annotated

from pydantic import AfterValidator, Field

from fti.errors import ConfigError

ENDPOINT_PATTERN = r"^(\d{1,3}(\.\d{1,3}){3}|\[[0-9a-fA-F:]+\]):\d{1,5}$"
BROADCAST = "255.255.255.255"

Endpoint = Annotated[str, Field(pattern=ENDPOINT_PATTERN)]
Address = tuple[str, int]


def split_endpoint(text: str) -> Address:
    """Address and port of ``1.2.3.4:5`` or ``[::1]:5``.  Raises ConfigError when one is invalid."""
    address, _, port = text.rpartition(":")
    try:
        host = str(ipaddress.ip_address(address.strip("[]")))
    except ValueError:
        raise ConfigError(f"{text}: {address} is not an IP address") from None
    if int(port) > 65535:
        raise ConfigError(f"{text}: port {port}; allowed is 0 to 65535")
    return host, int(port)


def _check_receiver(text: str) -> str:
    """Raises ValueError unless it is the address of one receiver."""
    try:
        host, port = split_endpoint(text)
    except ConfigError as error:
        raise ValueError(str(error)) from None
    address = ipaddress.ip_address(host)
    if address.is_multicast or address.is_unspecified or host == BROADCAST:
        raise ValueError("must be the address of one receiver; multicast and broadcast are not allowed")
    if not port:
        raise ValueError("port 0; allowed is 1 to 65535")
    return text


#: Address and port of one receiver.
ReceiverEndpoint = Annotated[Endpoint, AfterValidator(_check_receiver)]
