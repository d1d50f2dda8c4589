"""Checks of an MCAP file that its reader leaves out: the checksums outside of its chunks, and the summary within
itself.

The reader finds topics and chunks by the summary at the end of the file and believes it: a flipped bit there takes a
topic away without a word. Source: the MCAP format specification (mcap.dev/spec), records DataEnd, Footer and
Statistics.
"""

from __future__ import annotations

import struct
from binascii import crc32
from pathlib import Path

from rosbags.rosbag2 import ReaderError

MAGIC = b"\x89MCAP0\r\n"
CHANNEL, STATISTICS = 0x04, 0x0B
_STEP = 1 << 20
_FOOTER = struct.Struct("<BQQQI8s")  # opcode, length, start of the summary, of its offsets, its CRC, magic
_DATA_END = struct.Struct("<BQI")  # opcode, length, CRC of all before it
_COUNTS_AT = 46  # of a Statistics record: after the totals and the length of the map


def check_mcap(file: Path) -> None:
    """Refuse an MCAP file whose data or summary do not have the checksum they say, or whose summary contradicts itself.

    A checksum of 0 was not computed. What ends too early, or is no MCAP file, is left to the reader to name.

    Raises
    ------
    ReaderError : says which. OSError : it cannot be read.
    """
    with open(file, "rb") as stream:
        size = stream.seek(0, 2)
        if size < len(MAGIC) + _FOOTER.size:
            return
        stream.seek(size - _FOOTER.size)
        opcode, length, start, _, expected, magic = _FOOTER.unpack(stream.read(_FOOTER.size))
        if (opcode, length, magic) != (0x02, 20, MAGIC) or start > size - _FOOTER.size:
            return
        data_end = (start or size - _FOOTER.size) - _DATA_END.size
        if data_end < len(MAGIC):
            return
        stream.seek(data_end)
        opcode, length, data_crc = _DATA_END.unpack(stream.read(_DATA_END.size))
        if (opcode, length) == (0x0F, 4) and data_crc:
            stream.seek(0)
            found, left = 0, data_end
            while left > 0 and (piece := stream.read(min(_STEP, left))):
                found, left = crc32(piece, found), left - len(piece)
            if found != data_crc:
                raise ReaderError("the checksum of its data is another")
        if not start:
            return
        stream.seek(start)
        summary = stream.read(size - len(MAGIC) - 4 - start)
    if expected and crc32(summary) != expected:
        raise ReaderError("the checksum of its summary is another")
    _check_summary(summary[: -(_FOOTER.size - len(MAGIC) - 4)])


def _check_summary(summary: bytes) -> None:
    """Whether each channel that has messages, by the summary's own count, is in it."""
    channels, counted, at = set(), {}, 0
    while at + 9 <= len(summary):
        opcode, length = struct.unpack_from("<BQ", summary, at)
        record, at = summary[at + 9 : at + 9 + length], at + 9 + length
        if opcode == CHANNEL and len(record) >= 2:
            channels.add(struct.unpack_from("<H", record)[0])
        elif opcode == STATISTICS:
            whole = record[_COUNTS_AT:]
            counted = dict(struct.iter_unpack("<HQ", whole[: len(whole) // 10 * 10]))
    lost = [number for number, count in counted.items() if count and number not in channels]
    if channels and lost:
        raise ReaderError(f"its summary counts messages of channel {lost[0]}, of which it says nothing else")
