"""`rtds export`: a diagnosis in another simulator."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer

from rtds_host.cli.answer import AsJson, answer

app = typer.Typer(add_completion=False)


@dataclass
class _Said:
    """What an export says: lines for a person as they come, or one object for a program."""

    as_json: bool
    content: dict[str, Any] = field(default_factory=dict)

    def line(self, text: str) -> None:
        """Print a line for a person."""
        from rtds_host.errors import visible

        if not self.as_json:
            print(visible(text), flush=True)

    def parts(self, parts) -> None:
        """How each effect is in the target."""
        from rtds_host.export.table import LEFT_OUT

        for part in parts:
            word = "left out" if part.kind == LEFT_OUT else part.kind
            self.line(f"  {word:<9} {part.text}")
            self.line(f"            {part.where}")
        self.content["effects"] = [
            {
                "id": part.effect,
                "side": part.side,
                "parameters": part.values,
                "kind": "left out" if part.kind == LEFT_OUT else part.kind,
                "where": part.where,
            }
            for part in parts
        ]

    def end(self) -> None:
        """Print the object, where a program asked."""
        if self.as_json:
            answer(self.content)


@app.command()
def export(
    diagnosis: Annotated[
        Path,
        typer.Argument(
            help="The diagnosis.json to put into the robot; fmu, fmu-motors and c also take a robot.toml or a name."
        ),
    ],
    to: Annotated[
        str, typer.Option(help="mjcf (MuJoCo), urdf, sdf (Gazebo), usd-json (Isaac Sim), python, fmu, fmu-motors or c.")
    ],
    out: Annotated[Path, typer.Option(help="File to write; with --samples a folder.")],
    robot: Annotated[
        Path | None,
        typer.Option(help="The nominal robot.toml. Default: the one next to the diagnosis, or in the folder above."),
    ] = None,
    actuator: Annotated[
        str,
        typer.Option(
            help="mjcf: general (current at once) or dcmotor (MuJoCo's <dcmotor>, with a Python module along for what "
            "it cannot say)."
        ),
    ] = "general",
    check: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="RUN",
            help="mjcf: replay this run in MuJoCo from the file alone, and "
            "print the gap before and after; may be repeated.",
        ),
    ] = None,
    samples: Annotated[
        int, typer.Option(help="Write so many robots, their sizes drawn from the diagnosis' intervals.", min=0)
    ] = 0,
    seed: Annotated[int, typer.Option(help="Seed of --samples.", min=0)] = 1,
    as_json: AsJson = False,
) -> None:
    """Write the robot with what is diagnosed in it for another simulator."""
    from rtds_host.cli.first_use import say_if_first
    from rtds_host.contract import (
        check_writable,
        check_writable_file,
        load_robot,
        places_of_run,
        read_run,
        refuse_inputs,
        staged_folder,
        write_atomic,
    )
    from rtds_host.errors import InputError
    from rtds_host.export.export import COMPILED, check_target, default_robot, read_source, said_of_driver
    from rtds_host.export.export import export as write
    from rtds_host.export.mjcf import driver_source, forms_source

    if to in COMPILED:
        if check or samples or actuator != "general":
            raise InputError(f"--to {to}: goes without --actuator, --check and --samples")
        _compiled(diagnosis, to, out, robot, as_json)
        return
    check_target(to, actuator)
    if check and to != "mjcf":
        raise InputError(f"--check {check[0]}: only what is exported --to mjcf can be replayed here")
    if check and samples:
        raise InputError("--check: not with --samples; export the diagnosis itself")
    (check_writable if samples else check_writable_file)(out)
    robot = robot or default_robot(diagnosis)
    nominal = load_robot(robot)
    source = read_source(diagnosis, nominal)
    # What goes along with an MJCF file: its text, and what it is for.
    along: dict[Path, tuple[str, str]] = {}
    if actuator == "dcmotor" and not samples:
        place = out.with_name(f"{out.stem}_driver.py")
        along[place] = driver_source(), "what acts before its <dcmotor> and behind its sensors"
    elif to == "mjcf" and source.content.get("forms") and not samples:
        along[out.with_name(f"{out.stem}_forms.py")] = forms_source(), "applies the curves of its terms without a name"
    for place, (module, _) in along.items():
        check_writable_file(place)
        # Nobody named this file, so that one of another origin is not replaced.
        if place.exists() and not place.read_bytes().startswith(module.splitlines()[0].encode()):
            raise InputError(f"{place}: goes along with {out}, and is a file of another origin; choose another --out")
    refuse_inputs([out, *along], [diagnosis, robot, *(place for run in check or () for place in places_of_run(run))])
    runs = [read_run(folder, nominal, need_measured=True) for folder in check or []]
    text, parts = write(source, to, actuator)
    said = _Said(as_json, {"files": [out, *along], "to": to, "robot": nominal.name})
    if samples:
        _samples(said, source, to, out, samples, seed, staged_folder, actuator)
    else:
        write_atomic(out, text)
        said.line(f"{out}: {nominal.name} for {to}")
        for place, (module, what) in along.items():
            write_atomic(place, module)
            said.line(f"{place}: {what}")
    said.content["notices"] = list(said_of_driver(nominal, to))
    for line in said.content["notices"]:
        said.line(f"  {line[0].lower()}{line[1:]}")
    said.parts(parts)
    if not parts:
        said.line("  the diagnosis names no effect: this is the nominal robot, refitted")
    if runs:
        say_if_first()
        _check(said, out, nominal, source.model, runs, actuator)
    said.end()


def _compiled(name: Path, to: str, out: Path, robot: Path | None, as_json: bool) -> None:
    from rtds_host.contract import check_writable, check_writable_file, refuse_inputs
    from rtds_host.export.compiled import TARGETS, write
    from rtds_host.native.source import source_of

    (check_writable if to == "c" else check_writable_file)(out)
    refuse_inputs([out], [place for place in (name, robot) if place is not None])
    source = source_of(name, robot)
    parts = write(source, to, out)
    said = _Said(as_json, {"files": [out], "to": to, "robot": source.robot.name})
    said.line(f"{out}: {source.robot.name}: {TARGETS[to]}")
    said.parts(parts)
    said.end()


def _samples(said: _Said, source, to: str, out: Path, count: int, seed: int, staged_folder, actuator: str) -> None:
    import json

    from rtds_host.correction.close import model_of
    from rtds_host.export.export import ENDINGS, Source
    from rtds_host.export.export import export as write
    from rtds_host.export.mjcf import driver_source, forms_source
    from rtds_host.export.samples import draw

    drawn, fixed = draw(source.content, source.robot, count, seed)
    digits = len(str(count - 1))
    with staged_folder(out) as scratch:
        values: list[dict[str, Any]] = []
        for k, content in enumerate(drawn):
            name = f"sample-{k:0{digits}d}"
            text, parts = write(
                Source(content, model_of(content, source.robot), source.robot, f"{source.name}, {name} of seed {seed}"),
                to,
                actuator,
            )
            (scratch / (name + ENDINGS[to])).write_text(text, encoding="utf-8")
            values.append(
                {
                    "name": name + ENDINGS[to],
                    "effects": [{"id": part.effect, "side": part.side, "parameters": part.values} for part in parts],
                }
            )
        content = {"schema": "rtds-samples/1", "seed": seed, "to": to, "not_drawn": fixed, "samples": values}
        (scratch / "samples.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
        if actuator == "dcmotor":
            # It reads its numbers from each file.
            (scratch / "driver.py").write_text(driver_source(), encoding="utf-8")
        elif to == "mjcf" and source.content.get("forms"):
            (scratch / "forms.py").write_text(forms_source(), encoding="utf-8")
    said.line(f"{out}: {count} robots for {to}, seed {seed}")
    for label in fixed:
        said.line(f"  not drawn {label}: the diagnosis gives no interval")
    said.content |= {
        "files": [out / one["name"] for one in values],
        "seed": seed,
        "not_drawn": fixed,
        "samples": values,
    }


def _check(said: _Said, out: Path, nominal, model, runs, actuator: str) -> None:
    from rtds_host.export.check import check as check_runs
    from rtds_host.export.check import verdict

    checked = check_runs(out, nominal, model, runs, actuator)
    said.content["check"] = {
        name: {"before": one.before, "after": one.after, "closed": one.closed}
        for name, one in (("mujoco", checked.mujoco), ("replay", checked.replay))
    }
    said.content["check"] |= {"share": checked.share, "apart": [vars(one) for one in checked.apart]}
    said.line(f"{'gap':<28}{'nominal':>10}{'corrected':>11}{'closed':>9}")
    for name, closing in (("in MuJoCo, from the files", checked.mujoco), ("in the diagnosis' replay", checked.replay)):
        closed = "-" if closing.closed is None else f"{closing.closed:.3f}"
        said.line(f"{name:<28}{closing.before:>10.3g}{closing.after:>11.3g}{closed:>9}")
    if checked.share is not None:
        said.line(f"MuJoCo closes {checked.share:.2f} of what the replay closes")
    said.line("")
    said.line(f"{'MuJoCo against the replay, of full scale':<44}{'rms':>9}{'largest':>10}{'full scale':>12}")
    for one in checked.apart:
        unit = {"i": "A", "w": "rad/s", "p": "m"}[one.channel[0]]
        label = f"{one.run}  {one.channel}"
        said.line(f"{label:<44}{one.rms:>9.2%}{one.largest:>10.2%}{f'{one.full:.4g} {unit}':>12}")
    if checked.apart:
        said.line(verdict(checked.apart))
