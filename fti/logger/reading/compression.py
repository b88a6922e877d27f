"""Compressed chunks, with bounds: a length in a damaged or hostile file asks for no more memory than stated here."""

from __future__ import annotations

import lz4.frame
import zstandard

#: Greatest chunk, attachment or other record that is read, compressed or not [B].
MAX_RECORD = 2**30
#: Level of zstd of ``fti pack``: level 6 gains a tenth at a third of the speed, level 19 a sixth at a hundredth.
LEVEL = 3


def compress(data: bytes) -> bytes:
    """The content of a chunk as one zstd frame."""
    return zstandard.ZstdCompressor(level=LEVEL).compress(data)


def decompress(compression: str, data: bytes, size: int) -> bytes:
    """The ``size`` bytes of a chunk's records; compression : "", "zstd" or "lz4".

    Raises ValueError when the content is not exactly that, or larger than MAX_RECORD.
    """
    if size > MAX_RECORD:
        raise ValueError(f"a chunk of {size} bytes is larger than {MAX_RECORD}")
    content = _expand(compression, data, size)
    if len(content) != size:
        raise ValueError(f"a chunk holds {len(content)} bytes where its head tells of {size}")
    return content


def _expand(compression: str, data: bytes, size: int) -> bytes:
    """At most one byte more than ``size``."""
    try:
        if compression == "zstd":
            return _expand_zstd(data, size)
        if compression == "lz4":
            return _expand_lz4(data, size)
    except (zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise ValueError(f"a chunk cannot be decompressed: {error}") from None
    if compression:
        raise ValueError(f"a chunk is compressed with {compression!r}, which is not known")
    return data


def _expand_zstd(data: bytes, size: int) -> bytes:
    told = zstandard.get_frame_parameters(data).content_size
    if told not in (size, zstandard.CONTENTSIZE_UNKNOWN):
        raise ValueError(f"a chunk holds {told} bytes where its head tells of {size}")
    return zstandard.ZstdDecompressor(max_window_size=MAX_RECORD).decompress(data, max_output_size=size or 1)


def _expand_lz4(data: bytes, size: int) -> bytes:
    frame = lz4.frame.LZ4FrameDecompressor()
    content = bytes(frame.decompress(data, max_length=size + 1))
    if not frame.eof and len(content) == size:
        content += frame.decompress(b"", max_length=1)  # the end of the frame
    if not frame.eof:
        raise EOFError("its end is missing, or it is longer than its head tells")
    return content
