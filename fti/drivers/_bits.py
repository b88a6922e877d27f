"""Bytes with reversed bit order."""

#: REVERSED[byte] has bit 0 of the byte in bit 7.
REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
