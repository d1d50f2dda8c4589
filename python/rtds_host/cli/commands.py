"""The commands of `rtds`: one module a sub-command, imported only when it is called."""

from __future__ import annotations

import importlib
import io
import itertools
import os
import sys
from typing import cast

import click
import typer
import typer.main
from typer.exceptions import TyperException

from rtds_host import __version__
from rtds_host.errors import InputError, RtdsError, brief, did_you_mean, said_of_file, visible

# Sub-command -> what it does. Each is in the module rtds_host.cli.<name> as the Typer app `app`.
COMMANDS = {
    "demo": "Diagnose example bags that come with the package.",
    "run": "Drive a scenario with the motors in RTL (or the bit-exact model) and write a run folder.",
    "calibrate": "Measure gain and offset of the wires between PC and chip.",
    "diagnose": "Say where the gap between simulator and reality lies, and which effect causes it.",
    "view": "Show runs in a browser: path and signals, measured, nominal and corrected.",
    "diff": "Say how two diagnoses differ: two days, or two robots.",
    "close": "Put a diagnosis into the real-time simulator and see the gap close there.",
    "predict": "Replay a run from its commands, with or without a diagnosis.",
    "export": "Write the robot with a diagnosis in it for MuJoCo, Gazebo, Isaac Sim, URDF, Python, FMI or C.",
    "serve": "Let another program step a robot's two motors, through a socket.",
    "webots": "Write worlds and a controller for Webots, in which the motor units turn the wheels.",
    "plan": "Plan the most informative manoeuvre, within a floor, with a ROS 2 script.",
    "effects": "List the effects that a diagnosis can name, or describe one in full.",
    "init": "Write a robot's file from a data sheet, and a draft mapping for its recordings.",
    "doctor": "Say what is installed, what is missing and how to get it.",
    "import": "Turn ROS bags or csv files of a real robot into a case.",
    "completion": "Print a completion script for bash, zsh or fish.",
    "blind": "Check the diagnosis on sealed cases: make, answer, score.",
}
MODULES = {"import": "import_"}
# Options whose value may be empty.
FREE_TEXT = ("--notes", "--scenario")


def _refuse_empty(arguments: list[str]) -> None:
    """An empty path would stand for the folder one happens to be in; only free text may be empty."""
    for before, word in itertools.pairwise(["", *arguments]):
        option, sign, value = word.partition("=")
        if sign and not value and option.startswith("--") and option not in FREE_TEXT:
            raise InputError(f"{option}: is empty")
        if not word and before not in FREE_TEXT:
            raise InputError(f"{before}: is empty" if before.startswith("-") else "an argument is empty")


class _Commands(click.Group):
    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        if name not in COMMANDS:
            raise click.UsageError(
                f"no such command: {name!r} (known: {', '.join(COMMANDS)}){did_you_mean(name, COMMANDS)}"
            )
        module = importlib.import_module(f"rtds_host.cli.{MODULES.get(name, name)}")
        # Typer's own copy of click makes it, with the interface of click's.
        command = cast(click.Command, typer.main.get_command(module.app))
        command.name = name
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(cls=_Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="rtds")
def root() -> None:
    """Simulate a mobile robot's motors in real time, and find out why the real one differs."""


def main() -> None:
    """Do what the arguments ask and leave by SystemExit: 0 done, 1 some of several cases failed, 2 unusable input.

    Raises
    ------
    KeyboardInterrupt : Ctrl-C; `rtds_host.cli.main` ends the process then.
    """
    for stream in (sys.stdout, sys.stderr):
        # A terminal that cannot show a character gets its code, not the end of the program.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        _refuse_empty(sys.argv[1:])
        status = root.main(standalone_mode=False)
        sys.stdout.flush()
    except RtdsError as error:
        print("rtds: " + visible(" ".join(str(error).split())), file=sys.stderr)
        status = 2
    # The group is Click's, the sub-commands are Typer's, which carries a Click of its own with its own errors.
    except (click.exceptions.Exit, typer.Exit) as error:
        status = error.exit_code
    except (click.ClickException, TyperException) as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            # Asked nothing, the help is the answer; Typer has printed its own.
            print(error.format_message())
        else:
            print("rtds: " + visible(brief(" ".join(error.format_message().split()))), file=sys.stderr)
        status = 2
    except (click.Abort, typer.Abort) as error:
        # What Click and Typer make of Ctrl-C.
        raise KeyboardInterrupt from error
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 1
    except OSError as error:
        # A file or folder somewhere in the way; who writes what the command prints gives no name.
        print("rtds: " + visible(said_of_file(error)), file=sys.stderr)
        if error.filename is None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 2
    except MemoryError:
        print("rtds: out of memory", file=sys.stderr)
        status = 2
    except Exception as error:
        # Nobody foresaw it. Python's own status 1 would say that other cases are complete.
        if os.environ.get("RTDS_TRACEBACK"):
            raise
        from rtds_host.workers import one_line

        print(f"rtds: {visible(one_line(error))} (RTDS_TRACEBACK=1 shows more)", file=sys.stderr)
        status = 2
    sys.exit(status if isinstance(status, int) else 0)
