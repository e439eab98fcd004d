"""The SQLite files of ROS 2 bags (`.db3`, rosbag2_storage_sqlite3) as a `MessageFile`.

A recorder that was killed leaves its last messages in a write-ahead log (`-wal`), or half a
transaction and the way back (`-journal`), beside the file. They count, but to read them SQLite
writes; so it works on a copy then, and nothing in the folder changes. Of a broken file the rows are
read that can be reached.
"""

from __future__ import annotations

import shutil
import sqlite3
from collections import Counter
from collections.abc import Container, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

from mapcli.errors import FormatError
from mapcli.formats.input import OPEN_FILES, temporary_folder
from mapcli.formats.logs.bag_metadata import told_counts
from mapcli.formats.logs.log import Source
from mapcli.formats.logs.losses import LossLedger
from mapcli.formats.logs.message_file import NOTHING, Message, Stream
from mapcli.model.log import Damage

JOURNALS = "-wal", "-journal"
"""What may lie beside a database, by the ends of the names."""

MOST_SKIPPED = 1 << 40
"""Rows behind a broken place that are skipped at most, in search of the next one that is there."""

MOST_FAULTS = 100
"""Broken places over which reading goes on; each costs some searches."""

BROKEN = "databases with broken pages"


class SqliteFile:
    """One file of a ROS 2 bag, open for reading.

    Attributes:
        streams: the topics, by their numbers.
        counts, spans, complete: as of `MessageFile`.

    Raises:
        FormatError: no database, or no tables of a bag in it.
    """

    def __init__(self, source: Source, damage: Damage) -> None:
        self.source = source
        self._database, self._copy = _opened(source)
        try:
            self.streams = self._topics()
        except sqlite3.DatabaseError as error:
            raise FormatError(
                f"is an SQLite file without the tables of a bag ({error})", file=source.name,
                expected="topics and messages, as rosbag2 writes them",
            ) from error  # fmt: skip
        self._found: dict[int, int] = {}
        self.spans: dict[int, tuple[int, int]] = {}
        self.complete = self._count(damage)
        told = Counter(told_counts(source.path, self.streams))
        self._missing = Counter() if self.complete else told - Counter(self._found)
        self.complete = self.complete or bool(told)
        self.counts = dict(Counter(self._found) + self._missing)

    def _topics(self) -> dict[int, Stream]:
        rows = self._database.execute("SELECT id, name, type, serialization_format FROM topics")
        return {
            int(number): Stream(str(name), str(type_name), str(encoding))
            for number, name, type_name, encoding in rows
        }

    def _count(self, damage: Damage) -> bool:
        """Find counts and spans; False if the file is broken."""
        query = (
            "SELECT topic_id, COUNT(*), MIN(timestamp), MAX(timestamp) FROM messages "
            "WHERE typeof(topic_id) = 'integer' AND typeof(timestamp) = 'integer' GROUP BY 1"
        )
        with suppress(sqlite3.DatabaseError):
            for number, count, first, last in self._database.execute(query).fetchall():
                self._found[number], self.spans[number] = count, (first, last)
            return True
        found: Counter[int] = Counter()
        for number, time in self._rows("topic_id, timestamp", damage):
            found[number] += 1
            first, last = self.spans.get(number, (time, time))
            self.spans[number] = min(first, time), max(last, time)
        self._found = dict(found)
        return False

    def messages(
        self, wanted: set[int], damage: Damage, scans: Container[int] = ()
    ) -> Iterator[Message]:
        """The messages of these topics, in the order in which they were written."""
        ledger = LossLedger(self.source.name, damage, scans)
        time = 0
        numbers = ",".join(str(number) for number in sorted(wanted))
        for number, time, data in self._rows(
            "topic_id, timestamp, data", Damage(), f"AND topic_id IN ({numbers})"
        ):
            content = data if isinstance(data, bytes) else str(data).encode()
            yield Message(time, number, memoryview(content))
        lost = [Message(time, number, NOTHING, self._missing[number]) for number in sorted(wanted)
                if self._missing[number]]  # fmt: skip
        yield from ledger.told(lost)

    def _rows(self, columns: str, damage: Damage, condition: str = "") -> Iterator[list[Any]]:
        """Columns of the messages, row by row; over what is broken, to the next row there is."""
        query = f"SELECT rowid, {columns} FROM messages WHERE rowid > ? {condition} ORDER BY rowid"
        last, skipped, faults = -1, 0, 0
        while skipped < MOST_SKIPPED and faults < MOST_FAULTS:
            try:
                for row, *values in self._database.execute(query, (last,)):
                    if row > last and _is_row(values):  # a broken tree may lead anywhere
                        yield values
                    last, skipped = max(row, last), 0
                return
            except (sqlite3.DatabaseError, OverflowError):
                if not skipped:
                    damage.add(BROKEN, file=self.source.name, where=f"after row {last}")
                    faults += 1
                skipped = 2 * skipped + 1
                last += skipped


def _is_row(values: list[Any]) -> bool:
    """Whether numbers are numbers: a column of SQLite may hold anything."""
    return all(isinstance(value, int) for value in values[:2])


def _opened(source: Source) -> tuple[sqlite3.Connection, object]:
    """A database, never written to, and what keeps its copy if one had to be made."""
    path = source.path
    beside = [Path(f"{path}{end}") for end in JOURNALS]
    beside = [file for file in beside if file.is_file() and file.stat().st_size]
    # A file without a name cannot be found again by its link, as SQLite wants to.
    if not beside and path.parent != OPEN_FILES:
        return _connected(path, "mode=ro&immutable=1"), None
    folder = temporary_folder()
    copy = folder.path / "bag.db3"
    shutil.copyfile(path, copy)
    for file in beside:
        shutil.copyfile(file, f"{copy}{file.name.removeprefix(path.name)}")
    return _connected(copy, "mode=rw"), folder.keeps


def _connected(path: Path, how: str) -> sqlite3.Connection:
    database = sqlite3.connect(f"file:{quote(str(path.absolute()))}?{how}", uri=True)
    database.text_factory = lambda text: text.decode(errors="replace")
    database.execute("PRAGMA writable_schema=1")  # else a file that is cut is refused as a whole
    return database
