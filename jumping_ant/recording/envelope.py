"""What surrounds the data in an `.rrd` file, made to follow from its content.

As Rerun 0.41 writes it, a file is a header and frames, each a kind, a size and a Protobuf message.
The last frame lists where the others are, and which columns there are, in random order; a trailer
holds its place, size and checksum. Frames that open the recording or its layout say when and by
which Python they were written, and every frame of the layout says a random name. Frames keep their
sizes here, so that the list holds.
"""

import re
import struct
from collections.abc import Iterable

import pyarrow as pa

_HEADER, _HEADER_SIZE = b"RRF2\x00\x29", 12  # of Rerun 0.41
_FRAME = struct.Struct("<QQ")  # kind, size
_LIST, _OPENING = 0, 1  # kinds
_TRAILER = struct.Struct("<QQI12s")
_END = b"RRF2FOOT\x01\x00\x00\x00"
_TIME = re.compile(rb"\n\x12\t.{8}\x11.{8}", re.DOTALL)
_PYTHON = re.compile(rb"\*\x0c\x08\x02\x12\x08\n\x06\x08.\x10.\x18.", re.DOTALL)  # its version
_NO_PYTHON = b"*\x0c\x08\x06\x12\x08\n\x06Python"  # of another kind, named `Python`
_SCHEMA = 0x12  # tag of a manifest's columns


def settle(content: bytes, layout: str, digest: bytes) -> bytes:
    """Return the content of a file without times, versions and chance.

    `layout` is the name that Rerun drew for the layout. It is replaced by one that follows from
    `digest`, of what is recorded, 16 bytes or more. Raise a RuntimeError if another Rerun wrote
    the file.
    """
    name = b"rec_" + digest[:16].hex().encode()
    _require(content.startswith(_HEADER) and len(layout) == len(name))
    file = bytearray(content.replace(layout.encode(), name))
    kind, start, end = _OPENING, 0, _HEADER_SIZE
    while kind != _LIST:
        kind, size = _FRAME.unpack_from(file, end)
        start = end + _FRAME.size
        end = start + size
        if kind == _OPENING:
            file[start:end] = _opening(bytes(file[start:end]))
    *_, checksum, mark = _TRAILER.unpack(file[end:])
    _require(mark == _END and checksum == xxh32(content[start:end]))
    listed = _list(bytes(file[start:end]))
    frame = _FRAME.pack(_LIST, len(listed)) + listed
    trailer = _TRAILER.pack(start, len(listed), xxh32(listed), _END)
    return bytes(file[: start - _FRAME.size]) + frame + trailer


def _opening(message: bytes) -> bytes:
    """Return the message that opens a recording or layout, at no time and by no Python.

    A Python whose last number is 0 stays: it is two bytes shorter.
    """
    timeless, times = _TIME.subn(b"\n\x12\t" + bytes(8) + b"\x11" + bytes(8), message, count=1)
    _require(times == 1)
    return _PYTHON.sub(_NO_PYTHON, timeless, count=1)


def _list(message: bytes) -> bytes:
    """Return the list of frames, a manifest for the recording and one for its layout, in order."""
    manifests = []
    for tag, manifest in _fields(message):
        parts = _fields(manifest)
        ordered = [(part, _columns(own) if part == _SCHEMA else own) for part, own in parts]
        manifests.append((tag, _message(ordered)))
    return _message(sorted(manifests))


def _columns(message: bytes) -> bytes:
    """Return a manifest's columns in the order of their names."""
    ((tag, content),) = _fields(message)
    schema = pa.ipc.read_schema(pa.py_buffer(content))
    ordered = pa.schema(sorted(schema, key=lambda column: column.name), schema.metadata)
    return _message([(tag, ordered.serialize().to_pybytes())])


def _fields(message: bytes) -> list[tuple[int, bytes]]:
    """Return the tags and contents of a Protobuf message that holds only texts and messages."""
    found, place = [], 0
    while place < len(message):
        tag, size, bits, more = message[place], 0, 0, True
        _require(tag & 7 == 2)
        while more:
            place += 1
            size |= (message[place] & 127) << bits
            bits, more = bits + 7, message[place] > 127
        found.append((tag, message[place + 1 : place + 1 + size]))
        place += 1 + size
    return found


def _message(fields: Iterable[tuple[int, bytes]]) -> bytes:
    """Return the Protobuf message of such fields."""
    message = bytearray()
    for tag, content in fields:
        message.append(tag)
        size = len(content)
        while size > 127:
            message.append(size & 127 | 128)
            size >>= 7
        message.append(size)
        message += content
    return bytes(message)


def _require(known: bool) -> None:
    if not known:
        raise RuntimeError("the recording is not in the format of Rerun 0.41, which is known here")


def xxh32(content: bytes, seed: int = 7850921) -> int:
    """Return the checksum XXH32 (https://github.com/Cyan4973/xxHash/blob/dev/doc/), seeded."""
    p1, p2, p3, p4, p5 = 2654435761, 2246822519, 3266489917, 668265263, 374761393

    def turn(value: int, bits: int) -> int:
        value &= 0xFFFFFFFF
        return value << bits | value >> (32 - bits)

    words = struct.unpack_from(f"<{len(content) // 4}I", content)
    sums = [seed + p1 + p2, seed + p2, seed, seed - p1]
    striped = len(words) // 4 * 4
    for index, word in enumerate(words[:striped]):
        sums[index % 4] = turn(sums[index % 4] + word * p2, 13) * p1
    total = sum(map(turn, sums, (1, 7, 12, 18))) if striped else seed + p5
    total += len(content)
    for word in words[striped:]:
        total = turn(total + word * p3, 17) * p4
    for byte in content[len(words) * 4 :]:
        total = turn(total + byte * p5, 11) * p1
    for bits, factor in ((15, p2), (13, p3), (16, 1)):
        total &= 0xFFFFFFFF
        total = (total ^ total >> bits) * factor
    return total
