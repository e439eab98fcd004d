"""The SQLite files of ROS 2 bags (`.db3`, rosbag2_storage_sqlite3) as a `MessageFile`.

A recorder that was killed leaves its last messages in a write-ahead log (`-wal`), or half a
transaction and the way back (`-journal`), beside the file. They count, also where the file was
packed afterwards; but to read them SQLite writes, so it works on a copy then, and nothing in the
folder changes. Of a broken file the rows are read that can be reached.
"""

from __future__ import annotations

import shutil
import sqlite3
import struct
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
from mapcli.formats.logs.message_file import NOTHING, Message, Stream, most_of
from mapcli.model.log import Damage

JOURNALS = "-wal", "-journal"
"""What may lie beside a database, by the ends of the names."""

MOST_SKIPPED = 1 << 40
"""Rows behind a broken place that are skipped at most, in search of the next one that is there."""

MOST_FAULTS = 100
"""Broken places over which reading goes on; each costs some searches."""

BROKEN, NO_MESSAGES = "databases with broken pages", "rows that are no messages of a topic"

HEADER = struct.Struct(">16xH10xI")
"""Of a database: bytes of a page, where 1 stands for 65,536; number of pages.
<https://www.sqlite.org/fileformat.html>"""


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
        self.counts: dict[int, int] = {}
        self.spans: dict[int, tuple[int, int]] = {}
        self._is_sound = self._count(damage)
        told = {} if self._is_sound else told_counts(_own_path(source), self.streams)
        self.complete = self._is_sound or bool(told)
        self.counts = most_of(told, self.counts)

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
            if _journals(self.source) or not _is_cut(self.source.path):
                for number, count, first, last in self._database.execute(query).fetchall():
                    self.counts[number], self.spans[number] = count, (first, last)
                (rows,) = self._database.execute("SELECT COUNT(*) FROM messages").fetchone()
                strange = rows - sum(self.counts.get(number, 0) for number in self.streams)
                damage.add(NO_MESSAGES, strange, file=self.source.name)
                return True
            damage.add("files cut short", file=self.source.name)
        found: Counter[int] = Counter()
        for number, time in self._rows("topic_id, timestamp", damage):
            found[number] += 1
            first, last = self.spans.get(number, (time, time))
            self.spans[number] = min(first, time), max(last, time)
        self.counts = dict(found)
        return False

    def messages(
        self, wanted: set[int], damage: Damage, scans: Container[int] = ()
    ) -> Iterator[Message]:
        """The messages of these topics, in the order in which they were written."""
        ledger, given, time = LossLedger(self.source.name, damage, scans), Counter[int](), 0
        numbers = ",".join(str(number) for number in sorted(wanted))
        for number, time, data in self._rows(
            "topic_id, timestamp, data",
            damage if self._is_sound else Damage(),  # else it was told when they were counted
            f"AND topic_id IN ({numbers})",
        ):
            content = data if isinstance(data, bytes) else str(data).encode()
            given[number] += 1
            yield Message(time, number, memoryview(content))
        lost = Counter({number: self.counts.get(number, 0) for number in sorted(wanted)}) - given
        yield from ledger.told(Message(time, number, NOTHING, n) for number, n in lost.items())

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


def _own_path(source: Source) -> Path:
    """Where a database was when it was written to, and so where the files beside it belong: those
    of one that was packed afterwards do not change their names."""
    path = Path(source.name)
    is_packed = path != source.path and source.name != "-"
    return path.with_suffix("") if is_packed else source.path


def _opened(source: Source) -> tuple[sqlite3.Connection, object]:
    """A database, never written to, and what keeps its copy if one had to be made."""
    path, journals = source.path, _journals(source)
    # A file without a name cannot be found again by its link, as SQLite wants to.
    if not journals and path.parent != OPEN_FILES:
        return _connected(path, "mode=ro&immutable=1"), None
    folder = temporary_folder()
    copy = folder.path / "bag.db3"
    shutil.copyfile(path, copy)
    for end, file in journals.items():
        shutil.copyfile(file, f"{copy}{end}")
    return _connected(copy, "mode=rw"), folder.keeps


def _is_cut(path: Path) -> bool:
    """Whether a file has less than its pages, as its header tells. SQLite takes what is missing of
    the last one for zeros."""
    with path.open("rb") as file:
        page_bytes, pages = HEADER.unpack(file.read(HEADER.size).ljust(HEADER.size, b"\0"))
        told: int = pages * (page_bytes if page_bytes > 1 else 1 << 16)
        return told > file.seek(0, 2)


def _journals(source: Source) -> dict[str, Path]:
    """What lies beside a database, by the ends of the names."""
    files = {end: Path(f"{_own_path(source)}{end}") for end in JOURNALS}
    return {end: file for end, file in files.items() if file.is_file() and file.stat().st_size}


def _connected(path: Path, how: str) -> sqlite3.Connection:
    database = sqlite3.connect(f"file:{quote(str(path.absolute()))}?{how}", uri=True)
    database.text_factory = lambda text: text.decode(errors="replace")
    database.execute("PRAGMA writable_schema=1")  # else a file that is cut is refused as a whole
    return database
