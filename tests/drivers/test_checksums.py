"""Checksums by name: the check values of the catalogue of parametrised CRC algorithms over "123456789"."""

from __future__ import annotations

import pytest

from fti.drivers._checksums import CHECKSUMS

CHECK = {
    "crc16_arc": 0xBB3D,
    "crc16_modbus": 0x4B37,
    "crc16_xmodem": 0x31C3,
    "crc16_ibm_3740": 0x29B1,
    "crc16_kermit": 0x2189,
    "crc16_ibm_sdlc": 0x906E,
    "crc32": 0xCBF43926,
    "xor8": 0x31,  # 0x30 ^ ... : the digits 1 to 9 leave the 1
    "sum8": 0xDD,  # 9 * 0x30 + 45 = 477
    "sum16": 477,
}


def test_every_rule_has_its_check_value() -> None:
    assert set(CHECK) == set(CHECKSUMS)


@pytest.mark.parametrize("kind", sorted(CHECKSUMS))
def test_rule(kind: str) -> None:
    rule = CHECKSUMS[kind]
    assert rule.compute(b"123456789") == CHECK[kind]
    assert all(rule.compute(bytes([b]) * 300) < 256**rule.size for b in range(256))
