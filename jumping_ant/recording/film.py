"""The episode's film, synchronized with everything else that is recorded."""

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from jumping_ant.base.errors import InputError
from jumping_ant.recording.states import TIMELINE

FRAMES = "film/frames"


class Film:
    """A film that begins with its episode; `times` are those of its frames [ns]."""

    def __init__(self, mp4: bytes) -> None:
        self._video = rr.AssetVideo(contents=mp4, media_type="video/mp4")
        try:
            self.times: NDArray[np.int64] = self._video.read_frame_timestamps_nanos()
        except RuntimeError as error:
            raise InputError(f"film: given {len(mp4)} bytes that are not MP4: {error}") from error

    def log(self, stream: rr.RecordingStream) -> None:
        """Log each frame at its time, and clear the picture after the last one."""
        stream.log(FRAMES, self._video, static=True)
        frames = rr.VideoFrameReference.columns_nanos(self.times)
        stream.send_columns(FRAMES, [_column(self.times)], frames)
        end = self.times[-1:] + np.diff(self.times[-2:], prepend=self.times[-1])[-1:]
        stream.send_columns("film", [_column(end)], rr.Clear.columns(is_recursive=[True]))


def _column(times: NDArray[np.int64]) -> rr.TimeColumn:
    return rr.TimeColumn(TIMELINE, duration=times.astype("timedelta64[ns]"))
