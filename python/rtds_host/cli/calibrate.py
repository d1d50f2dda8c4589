"""`rtds calibrate`: measure the wires between PC and chip."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, cast

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from rtds_host.cli.answer import AsJson, answer
from rtds_host.contract import builtin_robot, check_writable_file, refuse_inputs
from rtds_host.errors import InputError, visible
from rtds_host.link import open_link
from rtds_host.link.analog import FROM_CHIP, TO_CHIP, load_paths, save_paths
from rtds_host.link.calibrate import POINTS, READS, Rig, ideal_errors, measure

app = typer.Typer(add_completion=False)


@app.command()
def calibrate(
    out: Annotated[Path, typer.Option(help="File to write, TOML; runs use it with --calibration.")] = Path(
        "calibration.toml"
    ),
    link: Annotated[str, typer.Option(help="chip (simulated) or ad2 (a board).")] = "ad2",
    wires: Annotated[
        Path | None, typer.Option(help="chip only: what the simulated wires really are, a file of the same form.")
    ] = None,
    ad2: Annotated[
        list[str] | None, typer.Option(help="ad2 only: serial numbers, the device with the voltages first; twice.")
    ] = None,
    serial: Annotated[str, typer.Option(help="ad2 only: serial port of the chip's registers.")] = "",
    points: Annotated[int, typer.Option(help="Voltages per wire.")] = POINTS,
    reads: Annotated[int, typer.Option(help="Readings per point.")] = READS,
    as_json: AsJson = False,
) -> None:
    """Measure gain and offset of every analog path between PC and chip and store them."""
    if link not in ("chip", "ad2"):
        raise InputError(f"--link {link}: there are no wires to calibrate (known: chip, ad2)")
    check_writable_file(out)
    refuse_inputs([out], [wires])
    options = link_options(link, wires=wires, ad2=ad2, serial=serial)
    with open_link(link, **options) as rig:
        rig.set_parameters(*builtin_robot("burger").motor.constants, step_s=1e-5)
        # Both links that come this far have wires.
        measured = measure(cast(Rig, rig), link, points, reads)
    save_paths(out, measured.paths)
    lines = (*measured.paths.to_chip, *measured.paths.from_chip)
    rows = list(zip((*TO_CHIP, *FROM_CHIP), lines, ideal_errors(measured.paths), measured.residuals_v, strict=True))
    if as_json:
        wires_said = [
            {"wire": name, "gain": line.gain, "offset_v": line.offset_v, "error_without_v": before, "residual_v": after}
            for name, line, before, after in rows
        ]
        answer({"file": out, "link": link, "wires": wires_said})
        return
    table = Table(title=escape(visible(f"calibration  ->  {out}")), title_justify="left", box=None)
    for column in ("wire", "gain", "offset, mV", "error without it, mV", "left over, mV"):
        table.add_column(column, justify="left" if column == "wire" else "right")
    for name, line, before, after in rows:
        table.add_row(
            name, f"{line.gain:.5f}", f"{1e3 * line.offset_v:.2f}", f"{1e3 * before:.2f}", f"{1e3 * after:.2f}"
        )
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=120)
    console.print(table)


def link_options(
    link: str,
    calibration: Path | None = None,
    wires: Path | None = None,
    ad2: list[str] | None = None,
    serial: str = "",
) -> dict:
    """Options of `open_link` for a link with wires; also refuses those that the link does not have.

    Raises
    ------
    InputError : an option that belongs to another link, or a file that cannot be used.
    """
    given = {
        "--calibration": (calibration is not None, ("chip", "ad2")),
        "--wires": (wires is not None, ("chip",)),
        "--ad2": (bool(ad2), ("ad2",)),
        "--serial": (bool(serial), ("ad2",)),
    }
    for name, (is_given, links) in given.items():
        if is_given and link not in links:
            raise InputError(f"{name}: has no meaning with --link {link} (only {', '.join(links)})")
    options: dict = {}
    if calibration is not None:
        options["calibration"] = load_paths(calibration)
    if wires is not None:
        options["wires"] = load_paths(wires)
    if link == "ad2":
        options |= {"serial_numbers": tuple(ad2 or ()), "port": serial}
    return options
