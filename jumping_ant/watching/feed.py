"""The bytes of a recording while it grows, for readers that come and go."""

import threading
from collections import deque
from collections.abc import Iterator

import rerun as rr

MEMORY = 256 * 2**20  # bytes kept for readers that come late: minutes of an episode


class Feed:
    """What is logged to a stream, as the content of an `.rrd` file that grows.

    Each batch is a recording by itself; Rerun reads those that follow each other as one. Nothing
    else may read the stream. `memory` is the bytes to keep of all batches but the first.
    """

    def __init__(self, stream: rr.RecordingStream, memory: int = MEMORY) -> None:
        self._source, self._memory = rr.binary_stream(stream), memory
        self._first: bytes | None = None
        self._later: deque[bytes] = deque()
        self._size = self._num_dropped = 0
        self._has_ended = False
        self._changed = threading.Condition()

    def publish(self) -> None:
        """Hand out what was logged since the last call, as a batch.

        Every reader gets the first batch, so it must have all that is logged only once. Of the
        others, those that come late miss the oldest.
        """
        batch = self._source.read() or b""
        with self._changed:
            if self._first is None:
                self._first = batch
            else:
                self._later.append(batch)
                self._size += len(batch)
            while self._size > self._memory:
                self._size -= len(self._later.popleft())
                self._num_dropped += 1
            self._changed.notify_all()

    def end(self) -> None:
        """Let readers finish."""
        with self._changed:
            self._has_ended = True
            self._changed.notify_all()

    def follow(self) -> Iterator[bytes]:
        """Yield the batches that there are, then others as they come, until the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._first is not None or self._has_ended)
        yield self._first or b""
        number = 0
        while (found := self._await(number)) is not None:
            number, batch = found
            yield batch
            number += 1

    def _await(self, number: int) -> tuple[int, bytes] | None:
        """Return the batch of a number, counted after the first, or of the next that is kept."""
        with self._changed:
            self._changed.wait_for(lambda: self._has_ended or self._has(number))
            if not self._has(number):
                return None
            number = max(number, self._num_dropped)
            return number, self._later[number - self._num_dropped]

    def _has(self, number: int) -> bool:
        return max(0, number - self._num_dropped) < len(self._later)
