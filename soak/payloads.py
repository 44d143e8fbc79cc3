"""Code in every kind of file that the project reads, none of which may run."""

import io
import itertools
import pickle
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch

from jumping_ant.base.archive import Archive, pack
from jumping_ant.training.checkpoints import Saved, owner_of
from soak.project import Count


class Payload:
    """An object that creates a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def __reduce__(self) -> tuple[Callable[[Path], None], tuple[Path]]:
        return Path.touch, (self._path,)


def plant(path: Path, read: Callable[[], object], mark: Path, count: Count) -> None:
    """Read versions of a file with a payload in it, which creates the mark; put the file back."""
    content = path.read_bytes()
    try:
        for changed in _versions(path, content, Payload(mark)):
            path.unlink()  # DVC may have linked it
            path.write_bytes(changed)
            count["planted"] += 1
            with suppress(Exception):  # refusing it is one way of not running it
                read()
            count["executed"] += mark.exists()
            mark.unlink(missing_ok=True)
    finally:
        path.write_bytes(content)


def _versions(path: Path, content: bytes, payload: Payload) -> Iterator[bytes]:
    """Yield the payload itself, and the archive with it as each of its entries, and one more."""
    tensors, array = io.BytesIO(), io.BytesIO()
    torch.save(payload, tensors)
    np.save(array, np.array([payload], dtype=object), allow_pickle=True)
    codes = (pickle.dumps(payload), tensors.getvalue(), array.getvalue())
    yield from codes
    if path.suffix == ".finished":  # with the right digest, as an attacker can compute it
        owner = owner_of(path)
        saved = Saved.from_bytes(content, owner)
        for code in codes:
            candidates = tuple(replace(one, policy=code) for one in saved.candidates)
            yield replace(saved, content=code, candidates=candidates).to_bytes(owner)
    elif zipfile.is_zipfile(io.BytesIO(content)):
        entries = dict(Archive(content))
        for name, code in itertools.product([*entries, "extra.pkl"], codes):
            yield pack(entries | {name: code})
