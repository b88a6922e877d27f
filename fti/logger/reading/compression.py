"""Decompression of chunks within limits: a damaged or hostile file cannot allocate more memory than these."""

from __future__ import annotations

import lz4.frame
import zstandard

from fti.logger.reading.limits import MAX_RECORD, LimitError, check_unpacked

#: zstd level of ``fti pack``: level 6 saves a tenth at a third of the speed, level 19 a sixth at a hundredth.
LEVEL = 3


def compress(data: bytes) -> bytes:
    """Compress the content of a chunk to one zstd frame."""
    return zstandard.ZstdCompressor(level=LEVEL).compress(data)


def decompress(compression: str, data: bytes, size: int) -> bytes:
    """Decompress the records of a chunk, ``size`` bytes; compression : "", "zstd" or "lz4".

    Raises ValueError when the content has another size, LimitError beyond the limits.
    """
    check_sizes(compression, data, size)
    content = _expand(compression, data, size)
    if len(content) != size:
        raise ValueError(f"a chunk holds {len(content)} bytes, its head states {size}")
    return content


def check_sizes(compression: str, data: bytes, size: int) -> None:
    """Check the sizes in the heads of chunk and frame before decompression.  Raises as ``decompress``."""
    if not compression:
        if size > MAX_RECORD:
            raise LimitError(f"a chunk of {size} bytes; at most {MAX_RECORD} are read")
        return
    check_unpacked(size, len(data))
    if compression == "zstd":
        try:
            stated = zstandard.get_frame_parameters(data).content_size
        except zstandard.ZstdError as error:
            raise ValueError(f"a chunk cannot be decompressed: {error}") from None
        if stated not in (size, zstandard.CONTENTSIZE_UNKNOWN):
            raise ValueError(f"a chunk holds {stated} bytes, its head states {size}")


def _expand(compression: str, data: bytes, size: int) -> bytes:
    """Decompress at most ``size`` + 1 bytes."""
    try:
        if compression == "zstd":
            return zstandard.ZstdDecompressor(max_window_size=MAX_RECORD).decompress(data, max_output_size=size or 1)
        if compression == "lz4":
            return _expand_lz4(data, size)
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise ValueError(f"a chunk cannot be decompressed: {error}") from None
    if compression:
        raise ValueError(f"a chunk is compressed with {compression!r}, which is not supported")
    return data


def _expand_lz4(data: bytes, size: int) -> bytes:
    frame = lz4.frame.LZ4FrameDecompressor()
    content = bytes(frame.decompress(data, max_length=size + 1))
    if not frame.eof and len(content) == size:
        content += frame.decompress(b"", max_length=1)  # the end of the frame
    if not frame.eof:
        raise EOFError("its end is missing, or it is longer than its head states")
    return content
