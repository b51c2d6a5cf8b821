"""Table of a merged campaign as CSV and Parquet files; the same rows give the same bytes."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

TABLE = "results"
Value = str | int | float | bool | None


class ResultTable(Struct, frozen=True):
    """Columns by name, all of one length; a value that does not exist is None."""

    columns: dict[str, list[Value]]

    @property
    def rows(self) -> int:
        return len(next(iter(self.columns.values()), []))


def write_table(folder: Path, table: ResultTable) -> tuple[str, str]:
    """Write the table into `folder` as CSV and Parquet; return the names of the files. Raises OSError."""
    import pyarrow
    from pyarrow import parquet

    arrays = {name: pyarrow.array(values, type=_arrow_type(values)) for name, values in table.columns.items()}
    buffer = io.BytesIO()
    parquet.write_table(pyarrow.table(arrays), buffer, compression="zstd")
    csv, parquet_name = f"{TABLE}.csv", f"{TABLE}.parquet"
    (folder / csv).write_bytes(csv_text(table).encode())
    (folder / parquet_name).write_bytes(buffer.getvalue())
    return csv, parquet_name


def csv_text(table: ResultTable) -> str:
    """Return the table as CSV (RFC 4180) with a line of names; None is an empty field."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(table.columns)
    writer.writerows(zip(*(map(_text, values) for values in table.columns.values()), strict=True))
    return out.getvalue()


def _text(value: Value) -> str:
    if value is None:
        return ""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _arrow_type(values: Sequence[Value]) -> Any:
    """Return the type of a column: of its first value, so that a column without values is text."""
    import pyarrow

    kinds = {bool: pyarrow.bool_(), int: pyarrow.int64(), float: pyarrow.float64()}
    first = next((value for value in values if value is not None), None)
    return kinds.get(type(first), pyarrow.string())
