"""Ids of a recording's chunks, rows and views that follow from its content.

Rerun draws them from the clock and at random, so that equal recordings would differ.
"""

import hashlib
import uuid
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.chunk import Chunk, RrdReader

_ROW_ID = "rerun.controls.RowId"


def read(path: Path) -> list[pa.RecordBatch]:
    """Return a recording's chunks as tables, in the order in which they were logged."""
    batches = [chunk.to_record_batch() for chunk in RrdReader(path).stream()]
    return sorted(batches, key=lambda batch: min(_row_ids(batch)))


def digest(name: str, batches: Iterable[pa.RecordBatch]) -> bytes:
    """Return the SHA-256 of the values that a recording of this name holds."""
    found = hashlib.sha256(name.encode())
    for batch in batches:
        found.update(batch.drop_columns([_ROW_ID]).serialize())
    return found.digest()


def number(batches: Sequence[pa.RecordBatch], high: int) -> list[Chunk]:
    """Return chunks with new ids, and rows with new ones in the order of the old.

    An id has two numbers: `high`, which Rerun takes for a time, and one that counts from 1.
    """
    old = np.concatenate([_row_ids(batch) for batch in batches])
    _, ranks = np.unique(old, return_inverse=True)
    ids = np.stack([np.full_like(ranks, high), ranks + 1], axis=1).astype(">u8")
    parts = np.split(ids, np.cumsum([batch.num_rows for batch in batches])[:-1])
    chunks = []
    for index, (batch, part) in enumerate(zip(batches, parts, strict=True), start=1):
        content = [None, pa.py_buffer(part.tobytes())]  # no row is missing
        rows = pa.FixedSizeBinaryArray.from_buffers(pa.binary(16), len(part), content)
        column = batch.schema.get_field_index(_ROW_ID)
        renumbered = batch.set_column(column, batch.schema.field(column), rows)
        metadata = batch.schema.metadata | {b"rerun:id": b"chunk_%016X%016x" % (high, index)}
        chunks += Chunk.from_record_batch(renumbered.replace_schema_metadata(metadata))
    return chunks


def name_views(part: rrb.View | rrb.Container, path: str) -> None:
    """Identify a view, or a container and all in it, by its place in the layout."""
    part.id = uuid.uuid5(uuid.NAMESPACE_URL, path)
    if isinstance(part, rrb.Container):
        for index, child in enumerate(part.contents):
            name_views(child, f"{path}/{index}")


def _row_ids(batch: pa.RecordBatch) -> NDArray[Any]:
    """Return the ids of a table's rows, each as 16 bytes, whose order is the ids'."""
    column = batch.column(_ROW_ID)
    ids = np.frombuffer(column.buffers()[1], "S16")
    return ids[column.offset : column.offset + len(column)]
