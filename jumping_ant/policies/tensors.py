"""The tensors of a file that PyTorch wrote, read without PyTorch, whose import takes seconds.

`torch.save` writes a zip archive: a pickle, which says how tensors lie in storages, and the numbers
of each storage. Whatever else the pickle names is refused, so that reading it runs no code.
"""

import io
import pickle
from collections import OrderedDict
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.archive import Archive

_KINDS = {"FloatStorage": "<f4", "DoubleStorage": "<f8", "LongStorage": "<i8"}


class _Storage(NamedTuple):
    kind: str
    entry: str


class _Tensor(NamedTuple):
    storage: _Storage
    first: int  # of its numbers in the storage
    shape: tuple[int, ...]
    strides: tuple[int, ...]


def read(content: bytes) -> dict[str, NDArray[Any]]:
    """Return the tensors of a `state_dict` by name.

    Raises:
        ValueError: They do not lie in their storage number by number, as learners' do.
        Exception: The file is none that `torch.save` wrote, or a damaged one.
    """
    archive = Archive(content)
    (index,) = (name for name in archive if name.endswith("/data.pkl"))
    folder = index.removesuffix("data.pkl")
    if archive[f"{folder}byteorder"] != b"little":
        raise ValueError("tensors of another byte order")
    found = _Index(io.BytesIO(archive[index])).load()
    return {name: _array(archive, folder, *found[name]) for name in found}


class _Index(pickle._Unpickler):  # the one in C allots as much memory as a file tells it to
    """The pickle of a file: what it may name gives tuples."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) == ("collections", "OrderedDict"):
            return OrderedDict
        if (module, name) == ("torch._utils", "_rebuild_tensor_v2"):
            return self._tensor
        if module == "torch" and name in _KINDS:
            return _KINDS[name]
        raise pickle.UnpicklingError(f"{module}.{name} in a file of tensors")

    def persistent_load(self, pid: Any) -> Any:
        _, kind, entry, *_ = pid
        return _Storage(kind, entry)

    def _tensor(self, storage: Any, first: Any, shape: Any, strides: Any, *_: Any) -> _Tensor:
        return _Tensor(_Storage(*storage), first, shape, strides)


def _array(
    archive: Archive,
    folder: str,
    storage: _Storage,
    first: int,
    shape: tuple[int, ...],
    strides: tuple[int, ...],
) -> NDArray[Any]:
    size = 1
    for length, stride in zip(reversed(shape), reversed(strides), strict=True):
        if length > 1 and stride != size:
            raise ValueError(f"a tensor of shape {shape} with strides {strides}")
        size *= length
    numbers = np.frombuffer(archive[f"{folder}data/{storage.entry}"], storage.kind)
    return numbers[first : first + size].reshape(shape).copy()
