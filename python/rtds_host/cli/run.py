"""`rtds run`: drive a scenario and write a run folder."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from rtds_host.cli.answer import AsJson, Quiet, answer
from rtds_host.cli.calibrate import link_options
from rtds_host.contract import builtin_robots, check_writable, load_robot, read_run, staged_folder
from rtds_host.errors import InputError, did_you_mean, visible
from rtds_host.faults import Injection, read_faults, read_stimulus
from rtds_host.link.waves import DEFAULT_BYTES, LEAST_BYTES, PRESETS, Waves
from rtds_host.robot import check_engine, default_engine
from rtds_host.robot.window import check_display, window
from rtds_host.run import Effects, LinkChoice, Options, Outcome, Plan, make_plan, perform, write_outcome
from rtds_host.run.loop import default_path
from rtds_host.run.summary import Summary, lines
from rtds_host.scenario import Scenario, own_scenario, scenarios
from rtds_host.vectors import given

if TYPE_CHECKING:
    from rtds_host.view.live import Feed, LivePath

app = typer.Typer(add_completion=False)

# Options that stand for a parameter of a scenario.
SHORT_CUTS = {"duration": "duration_s", "radius": "radius_m", "length": "length_m"}
FAMILY_ALL = "paper"
# A hundred times slower than Verilator: on a busy machine a healthy one may take this long over an exchange.
ICARUS_TIMEOUT_S = 120.0
BOARD_CLOCKS = "500"  # 10 us at 50 MHz: with these a waveform's time is the robot's


def parse_settings(texts: Sequence[str]) -> dict[str, float]:
    """Texts `name=number` as parameters of a scenario.

    Raises
    ------
    InputError : a text that is none.
    """
    values = {}
    for text in texts:
        name, sign, number = text.partition("=")
        try:
            values[name.strip()] = float(number)
        except ValueError:
            sign = ""
        if not sign:
            raise InputError(f"--set {text}: name=number is needed, as in --set peak_v=8")
    return values


def _wanted(scenario: str, given: dict[str, float]) -> list[tuple[Scenario, dict[str, float]]]:
    """Scenarios to run, and the parameters for each. With `all` a parameter goes to those that have it."""
    if scenario != "all":
        return [(own_scenario(scenario), given)]
    chosen = [one for one in scenarios().values() if one.family == FAMILY_ALL]
    known = {name for one in chosen for name in one.parameters}
    for name in given:
        if name not in known:
            raise InputError(
                f"scenario 'all': none of {', '.join(one.name for one in chosen)} has a parameter "
                f"{name!r} (known: {', '.join(sorted(known))}){did_you_mean(name, known)}"
            )
    return [(one, {name: value for name, value in given.items() if name in one.parameters}) for one in chosen]


@contextmanager
def _bars(plans: list[Plan], quiet: bool) -> Iterator[Callable[[str, float], None]]:
    """A progress bar a run on standard error, where that is a terminal."""
    console = Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.1f} s of {task.total:.1f} s"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    lengths = {plan.scenario.name: plan.duration_s for plan in plans}
    tasks: dict[str, TaskID] = {}
    with Progress(*columns, console=console, transient=True, disable=quiet or not console.is_terminal) as progress:

        def report(label: str, t_s: float) -> None:
            if label not in tasks:
                tasks[label] = progress.add_task(label, total=lengths[label.split(" ")[0]])
            progress.update(tasks[label], completed=t_s)

        yield report


def _show(console: Console, summary: Summary, place: Path) -> None:
    table = Table(
        title=escape(visible(f"{summary.scenario}  ->  {place}")), title_justify="left", show_header=False, box=None
    )
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    for label, text in lines(summary):
        table.add_row(label, escape(visible(text)))
    console.print(table)
    console.print()


@app.command()
def run(
    scenario: Annotated[
        str,
        typer.Argument(
            help="linear, circle, eight, a manoeuvre, or all (the first three); --list shows every one. Or a file: "
            "my_scenario.py, or commands.csv as `rtds plan` writes it."
        ),
    ] = "",
    show_list: Annotated[bool, typer.Option("--list", help="List the scenarios with their parameters.")] = False,
    link: Annotated[
        str,
        typer.Option(
            help="What computes the motors: rtl or model; chip (the whole chip in simulation, "
            "through its pins), ad2 (a board with converters) or hps (on a board's own processor)."
        ),
    ] = "rtl",
    sim: Annotated[str, typer.Option(help="Simulator of the RTL: verilator or icarus.")] = "verilator",
    calibration: Annotated[Path | None, typer.Option(help="chip, ad2: file of `rtds calibrate`.")] = None,
    wires: Annotated[
        Path | None, typer.Option(help="chip: gain and offset that the simulated wires have, a file of the same form.")
    ] = None,
    ad2: Annotated[
        list[str] | None,
        typer.Option(
            help="ad2: serial numbers of both Analog Discovery 2, the one with the voltages first; give it twice."
        ),
    ] = None,
    serial: Annotated[str, typer.Option(help="ad2: serial port of the chip's registers.")] = "",
    step_clocks: Annotated[
        str | None,
        typer.Option(
            help="Clocks of the RTL from step to step: a number (500 as on the board), or min. Default: min, or 500 "
            "with --waves."
        ),
    ] = None,
    robot: Annotated[str, typer.Option(help=f"{', '.join(builtin_robots())}, or the path of a robot.toml.")] = "burger",
    scaled: Annotated[
        bool,
        typer.Option(
            "--scaled",
            help="Scale lengths, payload and, where the motors are slow, the duration to this robot's size.",
        ),
    ] = False,
    controller: Annotated[str, typer.Option(help="exact or paper.")] = "exact",
    coupling: Annotated[
        str, typer.Option(help="closed: the robot's wheels follow the motor units; paper: they follow the reference.")
    ] = "closed",
    engine: Annotated[
        str | None,
        typer.Option(
            help="Physics engine: pybullet or mujoco. Default: pybullet, or mujoco where PyBullet has no wheel."
        ),
    ] = None,
    against: Annotated[
        str | None, typer.Option(help="Drive once more in this engine too and print how far apart both end.")
    ] = None,
    support: Annotated[
        str, typer.Option(help="What supports the robot next to its wheels: skids or caster.")
    ] = "skids",
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder of the run; for `all`, of the case with a folder each run. Default: out/SCENARIO, or out."
        ),
    ] = None,
    payload: Annotated[float | None, typer.Option(help="Payload, kg.")] = None,
    slope: Annotated[float | None, typer.Option(help="Slope, rad.")] = None,
    uphill_yaw: Annotated[float | None, typer.Option(help="Heading that climbs, rad.")] = None,
    duration: Annotated[float | None, typer.Option(help="Length of the run, s.")] = None,
    radius: Annotated[float | None, typer.Option(help="Radius of the circle, m.")] = None,
    length: Annotated[float | None, typer.Option(help="Length of the path, m.")] = None,
    setting: Annotated[
        list[str] | None, typer.Option("--set", help="Any parameter of the scenario, name=number; may be repeated.")
    ] = None,
    exchange: Annotated[float | None, typer.Option(help="Exchange interval, s.")] = None,
    log_interval: Annotated[float | None, typer.Option(help="Time between two rows of the log, s.")] = None,
    effects: Annotated[Path | None, typer.Option(help="A diagnosis.json: drive the robot it describes.")] = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            help="An effect of the catalogue, as ID.KEY=VALUE or, of one side, with ,side=left behind it "
            "(`rtds effects` lists them); may be repeated."
        ),
    ] = None,
    faults: Annotated[Path | None, typer.Option(help="A script of timed faults (faults.toml, docs/faults.md).")] = None,
    stimulus: Annotated[
        Path | None,
        typer.Option(
            help="A csv with t and some of v_l, v_r (V), t_l, t_r (N m): played into the motor units' inputs."
        ),
    ] = None,
    step: Annotated[float, typer.Option(help="Step of the motor units, s.")] = 1e-5,
    method: Annotated[str, typer.Option(help="backward_euler or trapezoidal.")] = "backward_euler",
    compare: Annotated[
        bool, typer.Option(help="Drive once more with the other controller and print both errors.")
    ] = True,
    figure: Annotated[bool, typer.Option(help="Draw the six-panel figure.")] = True,
    form: Annotated[str, typer.Option("--format", help="Format of the log: csv or parquet.")] = "csv",
    as_json: AsJson = False,
    quiet: Quiet = False,
    mcap: Annotated[
        bool, typer.Option("--mcap", help="Write run.mcap too, for Foxglove, PlotJuggler or ros2 bag.")
    ] = False,
    live: Annotated[
        bool, typer.Option("--live", help="Show the run in a browser while it goes on; Ctrl-C ends the page.")
    ] = False,
    port: Annotated[int, typer.Option(help="live: port on 127.0.0.1; 0 takes one that is free.", min=0, max=65535)] = 0,
    browser: Annotated[bool, typer.Option(help="live: open the page in the browser.")] = True,
    gui: Annotated[bool, typer.Option("--gui", help="Open the physics engine's own window.")] = False,
    waves: Annotated[
        Path | None,
        typer.Option(
            help="Write waveforms of the RTL into this .fst file, and views for GTKWave and Surfer next to it."
        ),
    ] = None,
    wave_signals: Annotated[
        list[str] | None,
        typer.Option(
            help=f"waves: a set of signals ({', '.join(PRESETS)}) or a name with * in it; may be repeated. "
            "Default: motors."
        ),
    ] = None,
    wave_window: Annotated[str, typer.Option(help="waves: from when to when, START:END in s of the run.")] = "",
    wave_size: Annotated[
        float, typer.Option(help="waves: size in MB at which the file ends.", min=1e-6 * LEAST_BYTES)
    ] = 1e-6 * DEFAULT_BYTES,
) -> None:
    """Drive SCENARIO with the motors in RTL (or the bit-exact model) and write a run folder."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=120)
    if show_list:
        _list(console, as_json)
        return
    if not scenario:
        raise InputError(f"no scenario given (known: {', '.join(scenarios())}, all)")
    if form not in ("csv", "parquet"):
        raise InputError(f"--format {form}: unknown (known: csv, parquet){did_you_mean(form, ('csv', 'parquet'))}")
    figures = parse_settings(setting or [])
    for name, value in (("duration", duration), ("radius", radius), ("length", length)):
        if value is not None:
            figures[SHORT_CUTS[name]] = value
    engine = engine or default_engine(lambda line: print(line, file=sys.stderr))
    options = Options(
        robot=robot,
        controller=controller,
        coupling=coupling,
        engine=engine,
        support=support,
        payload_kg=payload,
        slope_rad=slope,
        uphill_yaw_rad=uphill_yaw,
        exchange_s=exchange,
        log_s=log_interval,
        simulator_step_s=step,
        method=method,
        scaled=scaled,
    )
    if against is not None:
        check_engine(against, "--against")
    if gui:
        check_display("--gui")
    plans = [make_plan(one, values, options) for one, values in _wanted(scenario, figures)]
    changes = [chosen_effects(plan, effects, effect) for plan in plans]
    injections = _injections(plans, faults, stimulus)
    more = link_options(link, calibration, wires, ad2, serial)
    if quiet and link in ("rtl", "chip"):
        more["progress"] = lambda line: None
    if waves is not None:
        more["waves"] = _waves(waves, wave_signals, wave_window, wave_size, scenario, link, sim)
    choice = link_choice(link, sim, step_clocks or ("min" if waves is None else BOARD_CLOCKS), more)
    target = out if out is not None else (Path("out") if scenario == "all" else Path("out") / plans[0].scenario.name)
    check_writable(target)
    with _page(live, port, browser, as_json) as page:
        with _bars(plans, quiet) as report, window(gui):

            def driven(plan: Plan, change: Effects | None, injection: Injection | None) -> Outcome:
                path = page.path(plan, change, injection) if page is not None else None
                outcome = perform(plan, choice, compare, path, report, against, change, injection=injection)
                if path is not None:
                    path.end()
                return outcome

            if scenario != "all":
                outcome = driven(plans[0], changes[0], injections[0])
                write_outcome(outcome, target, figure, form)
                summaries = [(outcome.summary, target)]
            else:
                # A case whole or not at all: robot.toml next to the runs.
                summaries = []
                with staged_folder(target) as scratch:
                    (scratch / "robot.toml").write_bytes(plans[0].robot_path.read_bytes())
                    for plan, change, injection in zip(plans, changes, injections, strict=True):
                        outcome = driven(plan, change, injection)
                        write_outcome(outcome, scratch / plan.scenario.name, figure, form)
                        summaries.append((outcome.summary, target / plan.scenario.name))
        # All is written: Ctrl-C ends the page from here on, not the run.
        with suppress(KeyboardInterrupt) if page is not None else nullcontext():
            _tell(console, summaries, mcap, as_json)
            if page is not None:
                page.wait()


def _tell(console: Console, summaries: list[tuple[Summary, Path]], mcap: bool, as_json: bool) -> None:
    """Print what became of the runs, with recordings next to them where they are asked for."""
    for summary, place in summaries:
        if mcap:
            from rtds_host.export.mcap import write_mcap

            nominal = load_robot(place / "robot.toml")
            write_mcap(place / "run.mcap", read_run(place, nominal), nominal)
        if not as_json:
            _show(console, summary, place)
    if as_json:
        answer({"runs": [{"folder": place, **summary.to_json()} for summary, place in summaries]})


class _Page:
    """The page of `--live`: gives each run the path that it is watched on."""

    def __init__(self, feed: Feed, wait: Callable[[], None]):
        self.feed, self.wait = feed, wait

    def path(self, plan: Plan, change: Effects | None, injection: Injection | None) -> LivePath:
        """The signal path that a plan would have without it, watched."""
        from rtds_host.view.live import LivePath

        path = default_path(plan, change.correction if change else None, injection)
        return LivePath(path, plan, self.feed)


@contextmanager
def _page(live: bool, port: int, browser: bool, as_json: bool) -> Iterator[_Page | None]:
    """The page of `--live` while it is served, None without it. With `as_json` its address goes to standard error."""
    if not live:
        yield None
        return
    from rtds_host.view.command import serve
    from rtds_host.view.live import Feed

    feed = Feed()
    say = (lambda address: print(address, file=sys.stderr, flush=True)) if as_json else None
    with serve(feed, port, browser, say) as wait:
        yield _Page(feed, wait)


def chosen_effects(plan: Plan, diagnosis: Path | None, effects: list[str] | None) -> Effects | None:
    """What a plan's robot has beyond the nominal one.

    Raises
    ------
    InputError : an effect or a diagnosis that cannot be used; see `rtds_host.correction.choose.choose`.
    """
    if diagnosis is None and not effects:
        return None
    from rtds_host.correction.choose import choose
    from rtds_host.correction.translate import translate

    chosen = given(choose(plan.robot, diagnosis, effects), "what was chosen")
    return Effects(
        translate(chosen.model, plan.robot, plan.body.payload_kg, step_s=plan.simulator_step_s), chosen.names
    )


def _injections(plans: list[Plan], faults: Path | None, stimulus: Path | None) -> list[Injection | None]:
    """What is injected into each plan's run; None without a script and a stimulus."""
    if faults is None and stimulus is None:
        return [None] * len(plans)
    script = () if faults is None else read_faults(faults)
    played = None if stimulus is None else read_stimulus(stimulus)
    return [
        Injection.of(
            script,
            played,
            plan.simulator_step_s,
            plan.robot.supply_v,
            plan.duration_s,
            plan.method,
            plan.robot.motor.inductance_h,
        )
        for plan in plans
    ]


def link_choice(link: str, sim: str, step_clocks: str, more: dict) -> LinkChoice:
    """The link that the options of a run ask for; `more`: see `rtds_host.cli.calibrate.link_options`.

    Raises
    ------
    InputError : clocks that are no number, a simulator that the link does not have.
    """
    if link not in ("rtl", "chip"):
        return LinkChoice(link, more)
    try:
        clocks: int | str = step_clocks if step_clocks == "min" else int(step_clocks)
    except ValueError as error:
        raise InputError(f"--step-clocks {step_clocks}: a whole number or min is needed") from error
    if link == "chip":
        if sim != "verilator":
            raise InputError(f"--sim {sim}: the whole chip is simulated by verilator only")
        return LinkChoice("chip", {"step_clocks": clocks, **more}, "the whole chip (verilator, through its pins)")
    options: dict = {"sim": sim, "step_clocks": clocks, **more}
    if sim == "icarus":
        options["timeout_s"] = ICARUS_TIMEOUT_S
    return LinkChoice("rtl", options, f"rtl ({sim}, {step_clocks} clocks a step)")


def _waves(
    path: Path, signals: list[str] | None, window: str, size_mb: float, scenario: str, link: str, sim: str
) -> Waves:
    """What `--waves` and its options ask for."""
    if link != "rtl":
        raise InputError(f"--waves: shows the motor units in Verilog, --link rtl; --link {link} has none")
    if sim != "verilator":
        raise InputError(f"--waves: written by verilator only, not by --sim {sim}")
    if scenario == "all":
        raise InputError("--waves: one scenario at a time, not all")
    start, end = 0.0, None
    if window:
        first, colon, last = window.partition(":")
        try:
            start, end = float(first or 0), float(last) if last else None
        except ValueError:
            colon = ""
        if not colon:
            raise InputError(f"--wave-window {window}: START:END in s is needed, as in 0.5:0.6")
    return Waves(path, tuple(signals or ("motors",)), start, end, round(1e6 * size_mb))


def _list(console: Console, as_json: bool) -> None:
    if as_json:
        answer({"scenarios": [_described(one) for one in scenarios().values()]})
        return
    for one in scenarios().values():
        console.print(f"[bold]{one.name}[/bold]  {one.about}")
        console.print(
            f"    payload {one.payload_kg:g} kg, slope {one.slope_rad:g} rad, uphill at "
            f"{one.uphill_yaw_rad:.4g} rad; separates {one.separates}"
        )
        for name, parameter in one.parameters.items():
            console.print(f"    {name} = {parameter.default:g}: {parameter.about}")


def _described(one: Scenario) -> dict:
    """A scenario for a program to read."""
    return {
        "name": one.name,
        "about": one.about,
        "separates": one.separates,
        "payload_kg": one.payload_kg,
        "slope_rad": one.slope_rad,
        "uphill_yaw_rad": one.uphill_yaw_rad,
        "parameters": [{"name": name, **asdict(parameter)} for name, parameter in one.parameters.items()],
    }
