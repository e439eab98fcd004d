"""The `mapcli` command: a table of lazily imported subcommands and the one error boundary.

`mapcli --help` must stay as fast as importing click, so a command's module is imported only when
that command is typed; its one-line help lives in the table below.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import click

from mapcli import startup
from mapcli.errors import DataError, FormatError, MapcliError, QualityError, printable
from mapcli.version import __version__

COMMANDS = {
    "slam-replay": "Turn a robot log into a map and a pose trace (Algorithm 9.2).",
    "frontier": "Explore a map with Algorithm 9.1.",
    "similarity-table": "Score the candidate poses of a perception (Table 9.1).",
    "perceive": "Write what a robot perceives at a pose, or at a moment of a log.",
    "simulate": "Drive a simulated robot through a world and write its log.",
    "evaluate": "Say how far a pose trace is from the truth, or from itself.",
    "import": "Convert a log to MCAP with ROS 2 messages.",
    "convert": "Convert a map or a trace from any format to any other.",
    "transform": "Crop, turn, mirror, move, resample, align, merge maps.",
    "compare": "Compare two maps: cells, overlap, walls.",
    "info": "Say what is in a map, a log, a trace or another file.",
    "render": "Draw a map as a picture.",
    "rasterize": "Turn polygons into a grid map (Sect. 9.1).",
    "vectorize": "Turn the obstacles of a grid map into polygons (Sect. 9.1).",
    "rectify": "Make walls straight and perpendicular (Sect. 9.4).",
    "schema": "Print the JSON Schema of a format.",
}
"""Subcommand -> its one-line help. `NAME` lives in `commands/NAME.py` (`-` becomes `_`)."""

MODULES = {"import": "import_log"}
"""Where the module cannot bear the command's name: `import` is a Python keyword."""

EXIT_DATA, EXIT_USAGE, EXIT_QUALITY, EXIT_INTERRUPTED, EXIT_TERMINATED = 1, 2, 3, 130, 143

EXIT_UNREAD = 0
"""The reader of our stdout has gone (`| head`); that is no fault of ours."""


class LazyGroup(click.Group):
    """A group that knows its subcommands' names and imports the one that runs."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        name = MODULES.get(cmd_name, cmd_name.replace("-", "_"))
        command = startup.import_module(f"mapcli.commands.{name}").command
        assert isinstance(command, click.Command)
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            from mapcli.commands._hints import hint_for_command

            raise click.UsageError(
                error.message + hint_for_command(args[0], COMMANDS), ctx
            ) from error

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        given = list(args)
        try:
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            name = next((word for word in given if word in COMMANDS), None)
            command = self.get_command(ctx, name) if name else None
            flag = error.option_name
            if command is None or not any(flag in option.opts for option in command.params):
                raise
            hint = f"Options come after the command: mapcli {name} {flag} ..."
            raise click.UsageError(f"No such option {flag!r}. {hint}", ctx) from error

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.group(
    cls=LazyGroup,
    context_settings={"help_option_names": ["-h", "--help"]},
    invoke_without_command=True,
    subcommand_metavar="COMMAND [ARGS]...",
)
@click.version_option(__version__, package_name="mapcli", message="%(prog)s %(version)s")
@click.pass_context
def cli(ctx: click.Context) -> None:
    """2D robot mapping without ROS, after chapter 9 of Elements of Robotics.

    \b
    Examples:
      mapcli slam-replay robot.mcap            # map.png, map.pgm + map.yaml, trace.json
      mapcli info robot.mcap                   # what is in a log or a map
      mapcli convert map.yaml map.txt          # any map format to any other
    """
    if ctx.invoked_subcommand is None:
        # As click does, but to stdout. Nothing was done, so a script must not take it for done.
        click.echo(ctx.get_help())
        ctx.exit(EXIT_USAGE)


def main(args: Sequence[str] | None = None) -> None:
    """Run the command line and leave with an exit code.

    0 done, 1 data or machine failed, 2 wrong usage (or no command, which prints the help),
    3 quality limit not met, 130 interrupted, 143 terminated.
    """
    arguments = list(sys.argv[1:] if args is None else args)
    debug, stdout = "--debug" in arguments, sys.stdout
    files_read(forget=True)
    try:
        status = cli.main(arguments, prog_name="mapcli", standalone_mode=False)
        if sys.stdout is not None:  # closed, as by `>&-`
            sys.stdout.flush()
        sys.exit(status if isinstance(status, int) else 0)
    except click.ClickException as error:
        message = "\n".join(map(printable, error.message.split("\n")))
        error.message = message  # type: ignore[misc]
        error.show()
        sys.exit(error.exit_code)
    except (click.Abort, KeyboardInterrupt) as stopped:
        # Click turns the one into the other.
        terminated = isinstance(stopped.__cause__ or stopped, startup.Terminated)
        click.echo("Terminated." if terminated else "Interrupted.", err=True)
        sys.exit(EXIT_TERMINATED if terminated else EXIT_INTERRUPTED)
    except BrokenPipeError:
        sys.exit(EXIT_UNREAD)
    except SystemExit as leaving:
        # Click, which has replaced the stream, takes a broken pipe for a failure.
        sys.exit(leaving.code if sys.stdout is stdout else EXIT_UNREAD)
    except (MapcliError, OSError, MemoryError) as error:
        if debug:
            print_traceback()
        if isinstance(error, DataError | FormatError) and error.file is None:
            error.file = files_read()
        click.echo(f"Error: {describe(error)}", err=True)
        sys.exit(EXIT_QUALITY if isinstance(error, QualityError) else EXIT_DATA)
    except Exception as error:
        if debug:
            print_traceback()
        place = f"{printable(files)}: " if (files := files_read()) else ""
        fault = f"{type(error).__name__}: {describe(error)}"
        click.echo(f"Error: {place}a fault in mapcli: {fault} (--debug says more)", err=True)
        sys.exit(EXIT_DATA)


def print_traceback() -> None:
    import traceback

    traceback.print_exc()


def files_read(*, forget: bool = False) -> str | None:
    """The files that the command has read: an error of which nobody said where it is, is there."""
    formats = sys.modules.get("mapcli.formats.input")  # nothing is read before it is imported
    if formats is None:
        return None
    names = ", ".join(formats.names_read())
    if forget:
        formats.forget_names()
    return names or None


def describe(error: BaseException) -> str:
    """One line for a person, without a traceback."""
    if isinstance(error, OSError) and error.strerror:
        place = f"{error.filename}: " if error.filename else ""
        return printable(f"{place}{error.strerror.lower()}")
    if isinstance(error, MemoryError):
        return f"out of memory{f': {error}' if str(error) else ''}"
    if isinstance(error, MapcliError):
        return str(error)
    return printable(" ".join(str(error).split()))
