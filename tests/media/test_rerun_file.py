"""Recordings as files, whatever they hold."""

import os
import subprocess
import sys
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from jumping_ant.media.rerun_file import Recording, write


def recorded(title: str = "Title", steps: int = 9, last: str = "c") -> Recording:
    """A recording whose entities are logged in turns."""
    entities = ["b", "a", last]

    def log(stream: rr.RecordingStream) -> None:
        for step in range(steps):
            stream.set_time("step", sequence=step)
            stream.log(entities[step % 3], rr.Scalars(step))
        stream.log("a", rr.SeriesLines(colors=(1, 2, 3)), static=True)

    views = [rrb.TimeSeriesView(origin=name) for name in entities]
    return write("name", title, rrb.Blueprint(rrb.Tabs(*views, active_tab=1)), log)


def rerun_cli(*arguments: str | Path, home: Path) -> int:
    """Return the exit status of `rerun rrd`; that of `python -m rerun_cli` is always 0."""
    return subprocess.run(
        [Path(sys.executable).with_name("rerun"), "rrd", *arguments],
        env=os.environ | {"CI": "true", "HOME": str(home)},  # no usage statistics
        timeout=120,
    ).returncode


def test_equal_recordings_are_equal_by_content(tmp_path: Path) -> None:
    paths = [tmp_path / f"{number}.rrd" for number in range(3)]
    recordings = [recorded(), recorded(), recorded(steps=8)]
    for path, recording in zip(paths, recordings, strict=True):
        path.write_bytes(recording.content)
    digests = [recording.digest for recording in recordings]
    assert digests[0] == digests[1] != digests[2]
    assert rerun_cli("compare", paths[0], paths[1], home=tmp_path) == 0
    assert rerun_cli("compare", paths[0], paths[2], home=tmp_path) != 0
    for other in (recorded("Another"), recorded(last="d")):
        assert other.digest != digests[0]
    assert rerun_cli("verify", paths[0], home=tmp_path) == 0
    (entry,) = RrdReader(paths[0]).recordings()
    assert (entry.application_id, entry.recording_id) == ("jumping-ant", "name")
