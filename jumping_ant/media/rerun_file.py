"""Recordings as `.rrd` files, equal by content: Rerun draws their ids from the clock."""

import hashlib
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

APPLICATION_ID = "jumping-ant"
_BATCHING = rr.ChunkBatcherConfig(flush_tick=3600.0)  # not by time, which splits chunks anywhere


@dataclass(frozen=True)
class Recording:
    """The content of an `.rrd` file, and the SHA-256 of what is recorded in it."""

    content: bytes
    digest: str


def write(
    name: str, title: str, layout: rrb.Blueprint, log: Callable[[rr.RecordingStream], None]
) -> Recording:
    """Record what `log` logs, to be opened in a layout.

    A viewer merges recordings that share a `name`; `title` is what it calls them.
    """
    rr.set_strict_mode(True)  # otherwise Rerun skips invalid data with a warning
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.rrd"
        with rr.RecordingStream(
            APPLICATION_ID, recording_id=name, send_properties=False, batcher_config=_BATCHING
        ) as stream:
            stream.set_log_time_enabled(False)
            stream.save(path, default_blueprint=layout)
            stream.send_recording_name(title)
            log(stream)
        return Recording(path.read_bytes(), digest(path))


def digest(path: Path) -> str:
    """Return the SHA-256 of a recording's entities and values, without ids, order and layout."""
    parts = []
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch().drop_columns(["rerun.controls.RowId"])
        names = [chunk.entity_path, *batch.schema.names]
        parts.append(hashlib.sha256(repr(names).encode() + batch.serialize()).digest())
    return hashlib.sha256(b"".join(sorted(parts))).hexdigest()
