"""Zip archives of numbers: equal contents give equal bytes, and reading one runs no code."""

import io
import json
import math
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any, BinaryIO

import numpy as np
from numpy.lib import format as npy
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]

MOST_ENTRIES = 2000
MOST_JSON = 2**22  # [bytes]: in memory it is thirty times as large
_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time a zip entry can carry
_UNIX, _PRIVATE = 3, 0o600 << 16  # the system that packed an entry, and its permissions there
_VALUES = "values.json"
_ARRAY_SUFFIX = ".npy"
_NPY_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def pack(entries: Mapping[str, bytes]) -> bytes:
    """Return a zip archive whose bytes are the same for the same entries, below 2 GB each."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in entries.items():
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.create_system, entry.external_attr = _UNIX, _PRIVATE
            archive.writestr(entry, content)
    return buffer.getvalue()


class Archive(Mapping[str, bytes]):
    """The entries of a zip archive, each read when it is asked for.

    Entries must be stored without compression and beside each other, so that all of them take no
    more memory than the archive; others raise a ValueError. Damage raises a `zipfile.BadZipFile`.
    """

    def __init__(self, source: bytes | BinaryIO) -> None:
        file = io.BytesIO(source) if isinstance(source, bytes) else source
        self._size = file.seek(0, io.SEEK_END)
        self._archive = zipfile.ZipFile(file)
        entries = self._archive.infolist()
        if sum(entry.file_size for entry in entries) > self._size:
            raise ValueError("entries that are larger than their archive")  # as they overlap
        if len(entries) > MOST_ENTRIES or len(entries) > len({it.filename for it in entries}):
            raise ValueError(f"more than {MOST_ENTRIES} entries, or two of a name")

    def __getitem__(self, name: str) -> bytes:
        self.size(name)
        return self._archive.read(name)

    def size(self, name: str) -> int:
        """Return the size of an entry [bytes]."""
        entry = self._archive.getinfo(name)
        if entry.compress_type != zipfile.ZIP_STORED:
            raise ValueError(f"{name}: compressed")
        if entry.file_size != entry.compress_size:
            raise ValueError(f"{name}: not of its declared size")
        return entry.file_size

    def json(self, name: str) -> Any:
        """Return what an entry of JSON holds."""
        if self.size(name) > MOST_JSON:
            raise ValueError(f"{name}: more than {MOST_JSON:,} bytes of JSON")
        return json.loads(self[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._archive.namelist())

    def __len__(self) -> int:
        return len(self._archive.namelist())


def from_array(array: ArrayLike) -> bytes:
    """Return an array as the content of an `.npy` file; objects in it raise a ValueError."""
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()


def to_array(content: bytes) -> Array:
    """Return the array of an `.npy` file; damage or objects in it raise a ValueError."""
    file = io.BytesIO(content)
    read_header = _NPY_HEADERS.get(npy.read_magic(file))
    if read_header is None:
        raise ValueError("an .npy file of an unknown version")
    shape, _, kind = read_header(file)
    if kind.hasobject:
        raise ValueError("an .npy file of objects, which only pickle could read")
    if kind.kind not in "biufU" or not kind.itemsize:
        raise ValueError(f"an .npy file of {kind}, which is no number or text")
    size = math.prod(shape) * kind.itemsize
    if size != len(content) - file.tell():  # NumPy would first allocate what the header says
        raise ValueError(f"an .npy file of {len(content)} bytes, with {size} bytes of numbers")
    array: Array = np.load(io.BytesIO(content), allow_pickle=False)
    return array


def pack_state(state: Mapping[str, Any]) -> bytes:
    """Return an archive of nested dictionaries that hold arrays and JSON values."""
    arrays: dict[str, bytes] = {}

    def without_arrays(node: Any, path: str) -> Any:
        if isinstance(node, np.ndarray):
            arrays[path + _ARRAY_SUFFIX] = from_array(node)
            return None
        if isinstance(node, Mapping):
            return {key: without_arrays(value, f"{path}/{key}") for key, value in node.items()}
        return node

    values = without_arrays(state, "state")
    return pack({_VALUES: json.dumps(values).encode(), **arrays})


def unpack_state(content: bytes) -> dict[str, Any]:
    """Return the state that `pack_state` packed."""
    archive = Archive(content)
    state: dict[str, Any] = archive.json(_VALUES)
    for path in archive:
        if path == _VALUES:
            continue
        _, *parents, name = path.removesuffix(_ARRAY_SUFFIX).split("/")
        node = state
        for parent in parents:
            node = node[parent]
        node[name] = to_array(archive[path])
    return state
