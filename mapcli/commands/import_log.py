"""`mapcli import`: convert a log to MCAP."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator

import click

from mapcli.commands._log_options import LogInput, log_input_options, say_notes
from mapcli.commands._options import FILE, common_options, no_clobber_option
from mapcli.commands._output import check_outputs, progress
from mapcli.commands._say import say
from mapcli.errors import DataError
from mapcli.model.counting import counted
from mapcli.model.range_reading import RangeReading
from mapcli.model.scan import Odometry, RangeScan, Record


class Tally:
    """Counts the records that pass through, and keeps the first and the last stamp (stateful)."""

    def __init__(self) -> None:
        self.counts: Counter[type[Record]] = Counter()
        self.sensors: set[str] = set()
        self.first_ns = self.last_ns = 0

    def passing(self, records: Iterable[Record], log: str) -> Iterator[Record]:
        """The records, counted.

        Raises:
            DataError: there was no scan.
        """
        for record in records:
            if not self.counts:
                self.first_ns = record.stamp_ns
            self.counts[RangeScan if isinstance(record, RangeScan) else type(record)] += 1
            if isinstance(record, RangeReading):
                self.sensors.add(record.sensor)
            self.last_ns = record.stamp_ns
            yield record
        if not self.counts[RangeScan]:
            raise DataError("no scan in the part asked for", file=log)

    def text(self) -> str:
        scans, odometry = self.counts[RangeScan], self.counts[Odometry]
        seen = counted(scans, "scans")
        if self.sensors:
            sensors = counted(len(self.sensors), "sensors")
            seen = f"{counted(scans, 'readings')} of {sensors}"
        return (
            f"{seen} and {counted(odometry, 'odometry records')} of "
            f"{(self.last_ns - self.first_ns) * 1e-9:,.1f} s"
        )


@click.command(short_help="Convert a log to MCAP with ROS 2 messages.")
@click.argument("logs", metavar="LOG...", type=FILE, nargs=-1, required=True)
@click.argument("out", metavar="OUT.mcap", type=FILE)
@log_input_options
@no_clobber_option
@common_options
def command(
    logs: tuple[str, ...],
    out: str,
    log_input: LogInput,
    no_clobber: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Convert a log to MCAP with ROS 2 messages: /scan, /odom, /tf and /tf_static; range sensors
    with one beam go to topics of their own.

    LOG is a log of any kind that slam-replay reads: MCAP, a ROS 1 or ROS 2 bag (a file, or a
    folder), a CARMEN log, the CSV of a robot, packed or not, or - for standard input; several are
    one recording in parts. The result gives the same map and poses as the log itself. Of a damaged
    log, what can be read is converted; what is lost is said.

    \b
    Examples:
      mapcli import intel.log.gz intel.mcap
      mapcli import fixtures/five-sensors.csv sensors.mcap
      mapcli import --start 10 --end 60 robot.mcap part.mcap
    """
    from mapcli.formats.logs.mcap.writer import save_log

    if out != "-" and not out.lower().endswith(".mcap"):
        raise click.UsageError(f"{out!r} does not end in .mcap.")
    check_outputs([out], log_input.inputs(logs), "logs", no_clobber=no_clobber)
    log, tally = log_input.open(logs), Tally()
    records = tally.passing(log_input.records(log), log.name)
    save_log(progress(records, log.name, log.record_count, quiet=quiet), out, no_clobber=no_clobber)
    if not quiet:
        say_notes(log, verbose=verbose)
        say(f"{out}: {tally.text()}")
