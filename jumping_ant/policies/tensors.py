"""The tensors of a file that PyTorch wrote, read without PyTorch, whose import takes seconds.

`torch.save` writes a zip archive: a pickle, which says how tensors lie in storages, and the numbers
of each storage. Of pickle only those operations are understood that `torch.save` uses, so that
reading a file runs no code, and takes no more time and memory than its size explains.
"""

import pickletools
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jumping_ant.base.archive import Archive

MOST_INDEX = 2**18  # [bytes] of a pickle; learners' have some 10,000


class _Tensor(NamedTuple):
    storage: tuple[str, str]  # the kind of its numbers, and its entry in the archive
    first: int  # number in the storage
    shape: tuple[int, ...]
    strides: tuple[int, ...]


_NAMES: dict[str, Any] = {  # all that the pickle may name
    "torch FloatStorage": "<f4",
    "torch DoubleStorage": "<f8",
    "torch LongStorage": "<i8",
    "collections OrderedDict": dict,
    "torch._utils _rebuild_tensor_v2": _Tensor,
}


def read(content: bytes) -> dict[str, NDArray[Any]]:
    """Return the tensors of a `state_dict` by name.

    Raises:
        ValueError: They do not lie in their storage number by number, as learners' do, or are
            larger than the file.
        Exception: The file is none that `torch.save` wrote, or a damaged one.
    """
    archive = Archive(content)
    (index,) = (name for name in archive if name.endswith("/data.pkl"))
    folder = index.removesuffix("data.pkl")
    if archive[f"{folder}byteorder"] != b"little":
        raise ValueError("tensors of another byte order")
    if archive.size(index) > MOST_INDEX:
        raise ValueError(f"an index of more than {MOST_INDEX} bytes")
    arrays, room, storages = {}, len(content), dict[Any, NDArray[Any]]()
    for name, tensor in _unpickled(archive[index]).items():
        size = _size(tensor)
        room -= size * np.dtype(tensor.storage[0]).itemsize
        if room < 0:
            raise ValueError("tensors that are larger than their file")
        if tensor.storage not in storages:
            kind, entry = tensor.storage
            storages[tensor.storage] = np.frombuffer(archive[f"{folder}data/{entry}"], kind)
        if tensor.first < 0:
            raise ValueError(f"a tensor from number {tensor.first} of its storage")
        part = storages[tensor.storage][tensor.first : tensor.first + size]
        arrays[name] = part.reshape(tensor.shape).copy()
    return arrays


def _size(tensor: _Tensor) -> int:
    """Return how many numbers a tensor has, which must lie one after the other."""
    size = 1
    for length, stride in zip(reversed(tensor.shape), reversed(tensor.strides), strict=True):
        if length < 0 or (length > 1 and stride != size):
            raise ValueError(f"a tensor of shape {tensor.shape} with strides {tensor.strides}")
        size *= length
    return size


def _unpickled(content: bytes) -> dict[str, _Tensor]:
    stack: list[Any] = []
    marks: list[int] = []
    memory: dict[Any, Any] = {}

    def popped(count: int) -> tuple[Any, ...]:
        items = tuple(stack[len(stack) - count :])
        del stack[len(stack) - count :]
        return items

    for operation, argument, _ in pickletools.genops(content):
        match operation.name:
            case "PROTO":
                pass
            case "GLOBAL" if argument in _NAMES:
                stack.append(_NAMES[argument])
            case "BINUNICODE" | "BININT" | "BININT1" | "BININT2":
                stack.append(argument)
            case "NEWFALSE":
                stack.append(False)
            case "EMPTY_DICT":
                stack.append({})
            case "MARK":
                marks.append(len(stack))
            case "EMPTY_TUPLE":
                stack.append(())
            case "TUPLE1" | "TUPLE2" | "TUPLE3":
                stack.append(popped(int(operation.name[-1])))
            case "TUPLE":
                stack.append(popped(len(stack) - marks.pop()))
            case "SETITEM" | "SETITEMS":
                items = popped(2 if operation.name == "SETITEM" else len(stack) - marks.pop())
                if not all(isinstance(key, str) for key in items[::2]):
                    raise ValueError("a name that is no text")  # and may take ages to hash
                stack[-1].update(zip(items[::2], items[1::2], strict=True))
            case "BINPERSID":
                _, kind, entry, *_ = stack.pop()
                if kind not in _NAMES.values():
                    raise ValueError(f"a storage of {kind}")
                stack.append((kind, entry))
            case "REDUCE":
                name, arguments = popped(2)
                stack.append(_Tensor(*arguments[:4]) if name is _Tensor else dict())
            case "BUILD":
                stack.pop()  # attributes of a dictionary
            case "BINPUT" | "LONG_BINPUT":
                memory[argument] = stack[-1]
            case "BINGET" | "LONG_BINGET":
                if isinstance(memory[argument], tuple | dict):
                    raise ValueError("a part that repeats")  # in each other they may double
                stack.append(memory[argument])
            case "STOP":
                tensors: dict[str, _Tensor] = stack.pop()
                return tensors
            case unknown:
                raise ValueError(f"{unknown} {argument} in a file of tensors")
    raise ValueError("a file of tensors without an end")
