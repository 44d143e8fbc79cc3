"""Recordings as files: the content of an `.rrd`, with the layout it opens in."""

import tempfile
from collections.abc import Callable
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

APPLICATION_ID = "jumping-ant"

# No batching by time: it would cut equal data into different chunks.
_BATCHING = rr.ChunkBatcherConfig(flush_tick=3600.0)


def write(
    name: str, title: str, layout: rrb.Blueprint, log: Callable[[rr.RecordingStream], None]
) -> bytes:
    """Return a recording as the content of an `.rrd` file.

    Recordings of equal input hold equal data (`rerun rrd compare`), though not equal bytes: Rerun
    numbers its chunks by the clock.
    """
    was_strict = rr.strict_mode()
    rr.set_strict_mode(True)  # otherwise Rerun skips invalid data with a warning
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "recording.rrd"
            with rr.RecordingStream(
                APPLICATION_ID, recording_id=name, send_properties=False, batcher_config=_BATCHING
            ) as stream:
                stream.set_log_time_enabled(False)
                stream.save(path, default_blueprint=layout)
                stream.send_recording_name(title)
                log(stream)
            return path.read_bytes()
    finally:
        rr.set_strict_mode(was_strict)
