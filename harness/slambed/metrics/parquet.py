# SPDX-License-Identifier: Apache-2.0
"""Writes the Parquet files of a result (docs/reference/parquet.md lists every column)."""

from dataclasses import dataclass, field
from pathlib import Path

import pyarrow.parquet as pq

from slambed.errors import SlambedError
from slambed.files.atomic import replacing
from slambed.metrics.event_columns import (
    EVENT_COLUMNS,
    LINK_COLUMNS,
    SAMPLE_COLUMNS,
    table_of,
    table_of_frame,
)
from slambed.metrics.run_data import RunData


@dataclass
class Collected:
    """The written files, and problems of the raw files (one line each)."""

    written: list[Path] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)


def to_parquet(run: RunData, out_dir: Path) -> Collected:
    """Writes events.parquet, samples.parquet and, if there was a link, link.parquet.

    It uses the data already read for the metrics, so raw files are parsed once. Truncated and
    malformed lines are dropped and reported. Raises SlambedError if `out_dir` cannot be written.
    """
    result = Collected()
    events, samples, link = run.log.events, run.samples, run.link
    result.problems += run.problems
    tables = {
        "events.parquet": table_of(events, EVENT_COLUMNS, result.problems, extra=True),
        "samples.parquet": table_of_frame(samples, SAMPLE_COLUMNS, result.problems),
    }
    if link is not None:
        tables["link.parquet"] = table_of_frame(link, LINK_COLUMNS, result.problems)
    try:
        out_dir.mkdir(parents=True, exist_ok=True)
        for name, table in tables.items():
            with replacing(out_dir / name) as out:
                pq.write_table(table, out, compression="zstd")
            result.written.append(out_dir / name)
    except OSError as error:
        raise SlambedError(
            f"cannot write results, {out_dir}, {error.strerror}: check space and permissions"
        ) from error
    return result
