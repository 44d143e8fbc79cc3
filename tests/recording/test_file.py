"""Recordings as files, whatever they hold; run as a program, this prints one's digest."""

import hashlib
import os
import subprocess
import sys
from pathlib import Path

import pytest
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from jumping_ant.base.files import PROJECT_ROOT
from jumping_ant.recording import envelope
from jumping_ant.recording.file import write

ENTITIES = ["b", "a", "c"]


def content(title: str = "Title") -> bytes:
    """A recording in a layout of nested views, whose entities are logged in turns."""

    def log(stream: rr.RecordingStream) -> None:
        for step in range(9):
            stream.set_time("step", sequence=step)
            stream.log(ENTITIES[step % 3], rr.Scalars(step))
        stream.log("a", rr.SeriesLines(colors=(1, 2, 3)), static=True)

    plots = rrb.Tabs(*(rrb.TimeSeriesView(origin=name) for name in ENTITIES), active_tab=1)
    layout = rrb.Blueprint(rrb.Vertical(plots, rrb.TextDocumentView(origin="about")))
    return write("name", title, layout, log)


def test_equal_recordings_have_equal_bytes_in_every_process() -> None:
    environment = os.environ | {"PYTHONPATH": str(PROJECT_ROOT), "RERUN_LOG_TICK": "1"}
    printed = subprocess.check_output([sys.executable, __file__], env=environment, text=True)
    assert printed.strip() == hashlib.sha256(content()).hexdigest()
    assert content() != content("Another")


def test_rows_keep_the_order_in_which_they_were_logged(tmp_path: Path) -> None:
    path = tmp_path / "recording.rrd"
    path.write_bytes(content())
    rows = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        if "Scalars:scalars" in batch.schema.names:
            ids, values = (batch.column(index).to_pylist() for index in (0, -1))
            rows |= dict(zip(ids, values, strict=True))
    assert [rows[row] for row in sorted(rows)] == [[step] for step in range(9)]


def test_recordings_share_no_id(tmp_path: Path) -> None:
    """A viewer with both open could take one's for the other's."""
    drawn = []
    for title in ("Title", "Another"):
        path = tmp_path / f"{title}.rrd"
        path.write_bytes(content(title))
        reader = RrdReader(path)
        (layout,) = reader.blueprints()
        chunks = [*reader.stream(), *reader.stream(store=layout)]
        ids = {row for chunk in chunks for row in chunk.to_record_batch().column(0).to_pylist()}
        drawn.append({layout.recording_id, *(chunk.id for chunk in chunks), *ids})
    assert drawn[0].isdisjoint(drawn[1])


def test_a_file_does_not_say_which_python_wrote_it() -> None:
    known = content()
    name = "rec_" + known.partition(b"rec_")[2][:32].decode()
    settled = envelope.settle(known, name, bytes(16))
    for version in (b"\x03\x10\x0b\x18\x02", b"\x03\x10\x0d\x18\x09"):  # 3.11.2, 3.13.9
        source = b"*\x0c\x08\x02\x12\x08\n\x06\x08" + version  # as Rerun states it
        written = known.replace(b"*\x0c\x08\x06\x12\x08\n\x06Python", source)
        assert written != known
        assert envelope.settle(written, name, bytes(16)) == settled


def test_a_file_of_another_rerun_is_refused() -> None:
    known = content()
    name = "rec_" + known.partition(b"rec_")[2][:32].decode()
    assert envelope.settle(known, name, bytes(16)) != known
    for changed in (
        b"RRF2\x00\x2a" + known[6:],
        known[:-1] + b"\x02",
        known[:-40] + b"?" + known[-39:],
    ):
        with pytest.raises(RuntimeError, match="format of Rerun 0.41"):
            envelope.settle(changed, name, bytes(16))


if __name__ == "__main__":
    print(hashlib.sha256(content()).hexdigest())
