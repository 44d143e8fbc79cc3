"""Recordings as files: the content of an `.rrd`, with the layout it opens in."""

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import pyarrow as pa
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk, RrdReader

from jumping_ant.recording import envelope, numbering

APPLICATION_ID = "jumping-ant"

# No batching by time: it would cut equal data into different chunks.
_BATCHING = rr.ChunkBatcherConfig(flush_tick=3600.0)

Log = Callable[[rr.RecordingStream], None]


def write(name: str, title: str, layout: rrb.Blueprint, log: Log) -> bytes:
    """Return a recording as the content of an `.rrd` file; equal input gives equal bytes."""

    def log_data(stream: rr.RecordingStream) -> None:
        stream.send_recording_name(title)
        log(stream)

    def log_layout(stream: rr.RecordingStream) -> None:
        stream.set_time("blueprint", sequence=0)
        layout._log_to_stream(stream)

    was_strict = rr.strict_mode()
    rr.set_strict_mode(True)  # otherwise Rerun skips invalid data with a warning
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "recording.rrd"
            numbering.name_views(layout.root_container, name)
            views, data = (_collect(logged, name, path) for logged in (log_layout, log_data))
            digest = numbering.digest(name, [*views, *data])
            high = int.from_bytes(digest[:8]) >> 1
            with _stream(name) as stream:
                stream.save(path, default_blueprint=_Layout(numbering.number(views, high)))
                stream.send_chunks(numbering.number(data, high))
            (blueprint,) = RrdReader(path).blueprints()
            return envelope.settle(path.read_bytes(), blueprint.recording_id, digest)
    finally:
        rr.set_strict_mode(was_strict)


class _Layout(rrb.Blueprint):
    """A layout of chunks."""

    def __init__(self, chunks: Sequence[Chunk]) -> None:
        self._chunks = chunks

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        stream.send_chunks(self._chunks)


def _collect(log: Log, name: str, path: Path) -> list[pa.RecordBatch]:
    """Return what is logged, by way of a file."""
    with _stream(name) as stream:
        stream.save(path)
        log(stream)
    return numbering.read(path)


def _stream(name: str) -> rr.RecordingStream:
    stream = rr.RecordingStream(
        APPLICATION_ID, recording_id=name, send_properties=False, batcher_config=_BATCHING
    )
    stream.set_log_time_enabled(False)
    stream.set_log_tick_enabled(False)
    return stream
