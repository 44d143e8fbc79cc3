import copy
import hashlib
import io
import pickle
import warnings
import zipfile

import numpy as np
import pytest

from jumping_ant.base import archive

STATE = {
    "weights": np.arange(6, dtype=np.float32).reshape(2, 3),
    "inner": {"mask": np.array([True, False]), "generator": {"state": 2**100, "gauss": None}},
    "returns": [0.1, float("nan")],
    "empty": {},
}


def test_an_archive_has_the_bytes_it_always_had() -> None:
    entries = {"values.json": b"{}", "state/é.npy": bytes(300)}
    packed = archive.pack(entries)
    expected = "5afeee7ad08f64fa795b9f3c6ad17a272428c197330773c73f6077633b6906ed"
    assert hashlib.sha256(packed).hexdigest() == expected
    assert dict(archive.Archive(packed)) == entries


def test_a_state_comes_back() -> None:
    content = archive.pack_state(STATE)
    assert content == archive.pack_state(STATE)
    state = archive.unpack_state(content)
    np.testing.assert_array_equal(state["weights"], STATE["weights"])
    assert state["weights"].dtype == np.float32
    np.testing.assert_array_equal(state["inner"]["mask"], [True, False])
    assert state["inner"]["generator"] == {"state": 2**100, "gauss": None}
    assert state["returns"][0] == 0.1 and np.isnan(state["returns"][1])
    assert state["empty"] == {}


def test_objects_are_neither_written_nor_read() -> None:
    with pytest.raises(ValueError, match="allow_pickle"):
        archive.pack_state({"a": np.array([object()], dtype=object)})
    objects = io.BytesIO()
    np.save(objects, np.array([[1]], dtype=object), allow_pickle=True)
    pickles = (pickle.dumps([1]), pickle.dumps(np.arange(3)), objects.getvalue())
    for content, said in zip(pickles, ("magic string", "magic string", "objects"), strict=True):
        with pytest.raises(ValueError, match=said):
            archive.to_array(content)
        with pytest.raises(ValueError, match=said):
            archive.unpack_state(archive.pack({"values.json": b"{}", "state/a.npy": content}))


def test_what_takes_more_than_it_holds_is_refused() -> None:
    """Entries at the same place, and numbers without a size."""
    buffer = io.BytesIO(archive.pack({"a": bytes(1000)}))
    with zipfile.ZipFile(buffer, "a") as zipped:
        again = copy.copy(zipped.infolist()[0])
        again.filename = "b"
        zipped.filelist.append(again)
        zipped.comment = b"written anew"
    assert len(zipfile.ZipFile(buffer).namelist()) == 2
    with pytest.raises(ValueError, match="larger than their archive"):
        archive.Archive(buffer.getvalue())
    with pytest.raises(ValueError, match="or two of a name"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        twice = io.BytesIO()
        with zipfile.ZipFile(twice, "w") as zipped:
            zipped.writestr("a", b"")
            zipped.writestr("a", b"1")
        archive.Archive(twice.getvalue())
    with pytest.raises(ValueError, match="bytes of JSON"):
        archive.Archive(archive.pack({"a": b" " * (archive.MOST_JSON + 1)})).json("a")
    nothing = archive.from_array(np.zeros(10**6, "V0"))
    with pytest.raises(ValueError, match="no number or text"):
        archive.to_array(nothing)


def test_a_damaged_entry_is_found() -> None:
    content = archive.pack_state(STATE)
    place = content.index(STATE["weights"].tobytes()) + 4
    damaged = content[:place] + b"\xff" + content[place + 1 :]
    with pytest.raises(zipfile.BadZipFile, match="CRC"):
        archive.unpack_state(damaged)
