"""The tensors of a file that PyTorch wrote, read without PyTorch, whose import takes seconds.

`torch.save` writes a zip archive: a pickle, which says how tensors lie in storages, and the numbers
of each storage. Whatever else the pickle names is refused, so that reading it runs no code.
"""

import io
import pickle
from collections import OrderedDict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.archive import Archive

_NAMES: dict[tuple[str, str], Any] = {  # all that the pickle may name
    ("torch", "FloatStorage"): "<f4",
    ("torch", "DoubleStorage"): "<f8",
    ("torch", "LongStorage"): "<i8",
    ("collections", "OrderedDict"): OrderedDict,
    ("torch._utils", "_rebuild_tensor_v2"): lambda *tensor: tensor[:4],
}


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
    tensors = _Unpickler(io.BytesIO(archive[index])).load()
    return {name: _array(archive, folder, *tensor) for name, tensor in tensors.items()}


class _Unpickler(pickle._Unpickler):  # the one in C allots as much memory as a file tells it to
    """Reads tensors as tuples: (kind, entry) of their storage, first number, shape, strides."""

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _NAMES:
            raise pickle.UnpicklingError(f"{module}.{name} in a file of tensors")
        return _NAMES[module, name]

    def persistent_load(self, pid: Any) -> Any:
        return pid[1:3]


def _array(
    archive: Archive, folder: str, storage: tuple[str, str], first: int, shape: Any, strides: Any
) -> NDArray[Any]:
    size = 1
    for length, stride in zip(reversed(shape), reversed(strides), strict=True):
        if length > 1 and stride != size:
            raise ValueError(f"a tensor of shape {shape} with strides {strides}")
        size *= length
    kind, entry = storage
    numbers = np.frombuffer(archive[f"{folder}data/{entry}"], kind)
    return numbers[first : first + size].reshape(shape).copy()
