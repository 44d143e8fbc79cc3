"""Zip archives of numbers: equal contents give equal bytes, and reading one runs no code."""

import io
import json
import zipfile
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]

_EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest time a zip entry can carry
_VALUES = "values.json"
_ARRAY_SUFFIX = ".npy"


def pack(entries: Mapping[str, bytes]) -> bytes:
    """Return a zip archive whose bytes are the same for the same entries."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in entries.items():
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), content)
    return buffer.getvalue()


def unpack(content: bytes) -> dict[str, bytes]:
    """Return the entries of a zip archive.

    Raises:
        zipfile.BadZipFile: The content is not a zip archive, or an entry is damaged.
    """
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def from_array(array: Array) -> bytes:
    """Return an array as the content of an `.npy` file.

    Raises:
        ValueError: The array holds objects, which only pickle could write.
    """
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()


def to_array(content: bytes) -> Array:
    """Return the array that an `.npy` file holds.

    Raises:
        ValueError: The file holds objects, which only pickle could read, or is damaged.
    """
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
    entries = unpack(content)
    state: dict[str, Any] = json.loads(entries.pop(_VALUES))
    for path, array in entries.items():
        _, *parents, name = path.removesuffix(_ARRAY_SUFFIX).split("/")
        node = state
        for parent in parents:
            node = node[parent]
        node[name] = to_array(array)
    return state
