"""The drawings of the documentation, as SVG.

    python examples/draw.py [--out docs/images]
    python examples/draw.py --path RUN… [--gap CASE DIAGNOSIS]

Without further options: the chain from command to motion, the chip, the workflow, the folders of the code, and the
board's wiring. They need nothing but this file. `--path` draws the paths of run folders, `--gap` a wheel's residual,
nominal and corrected.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from html import escape
from pathlib import Path

FONT = "font-family='Helvetica, Arial, sans-serif'"
# Fills by what a box is: file, program, hardware, physics, result.
FILLS = {"file": "#fff4d6", "program": "#dcebfb", "hardware": "#e3f3e1", "physics": "#f6e3ef", "result": "#ececec"}


@dataclass(frozen=True)
class Box:
    """A box with its centre and size in pixels; the first line of its text is bold."""

    x: float
    y: float
    text: str
    kind: str = "program"
    width: float = 130.0
    height: float = 54.0

    def svg(self) -> str:
        lines = self.text.split("\n")
        rows = [
            f"<text x='{self.x:g}' y='{self.y + 16 * (k - (len(lines) - 1) / 2) + 4:g}' text-anchor='middle' "
            f"font-size='{13 if k == 0 else 11}' {'font-weight=' + chr(39) + 'bold' + chr(39) if k == 0 else ''}>"
            f"{escape(line)}</text>"
            for k, line in enumerate(lines)
        ]
        return (
            f"<rect x='{self.x - self.width / 2:g}' y='{self.y - self.height / 2:g}' width='{self.width:g}' "
            f"height='{self.height:g}' rx='6' fill='{FILLS[self.kind]}' stroke='#444'/>" + "".join(rows)
        )


def arrow(points: list[tuple[float, float]], label: str = "", dashed: bool = False, above: float = 6.0) -> str:
    """A line with a head at its end, along straight pieces, its label over the middle of the first one."""
    path = " ".join(f"{'L' if k else 'M'}{x:g},{y:g}" for k, (x, y) in enumerate(points))
    dash = " stroke-dasharray='5 4'" if dashed else ""
    found = f"<path d='{path}' fill='none' stroke='#444' stroke-width='1.4'{dash} marker-end='url(#head)'/>"
    if label:
        (x0, y0), (x1, y1) = points[:2]
        beside = x0 == x1
        found += (
            f"<text x='{(x0 + x1) / 2 + (6 if beside else 0):g}' y='{(y0 + y1) / 2 + (4 if beside else -above):g}' "
            f"font-size='11' text-anchor='{'start' if beside else 'middle'}' fill='#333'>{escape(label)}</text>"
        )
    return found


def right(a: Box, b: Box, label: str = "") -> str:
    """An arrow from a box to the one on its right."""
    return arrow([(a.x + a.width / 2, a.y), (b.x - b.width / 2, b.y)], label)


def down(a: Box, b: Box, label: str = "") -> str:
    """An arrow from a box to the one below it."""
    return arrow([(a.x, a.y + a.height / 2), (b.x, b.y - b.height / 2)], label)


def note(x: float, y: float, text: str, size: int = 11, anchor: str = "middle") -> str:
    """Text of its own."""
    return "".join(
        f"<text x='{x:g}' y='{y + 14 * k:g}' font-size='{size}' text-anchor='{anchor}' fill='#333'>"
        f"{escape(line)}</text>"
        for k, line in enumerate(text.split("\n"))
    )


def page(width: int, height: int, title: str, parts: list[str]) -> str:
    """A whole drawing, on white, so that it reads on dark pages too."""
    head = (
        "<defs><marker id='head' viewBox='0 0 10 10' refX='9' refY='5' markerWidth='8' markerHeight='8' "
        "orient='auto-start-reverse'><path d='M0,0 L10,5 L0,10 z' fill='#444'/></marker></defs>"
    )
    body = "\n".join(parts)
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width} {height}' width='{width}' height='{height}' "
        f"role='img' {FONT}>\n<title>{escape(title)}</title>\n{head}\n"
        f"<rect width='{width}' height='{height}' fill='white'/>\n{body}\n</svg>\n"
    )


def chain() -> str:
    """From the command to the motion, with the effects that act in each part."""
    names = [
        ("driver\nduty, bridge, bus", "hardware", "supply sag, dead zone,\ngain, limit, bridge drop"),
        ("winding\nL di/dt = V − R i − Kb Ω", "physics", "resistance,\nheating"),
        ("drivetrain\nrotor, gear, friction", "physics", "friction, backlash,\nspring, ripple"),
        ("wheel and ground\nrolling, slip", "physics", "radius, slip,\nscrub, rolling"),
        ("chassis\nmass, yaw inertia", "physics", "payload, track,\nslope, centre of mass"),
        ("sensing\nencoder, current, gyro", "hardware", "gains, offsets,\nfilter, delay"),
    ]
    boxes = [Box(95 + 168 * k, 90, text, kind, 142) for k, (text, kind, _) in enumerate(names)]
    parts = [b.svg() for b in boxes]
    parts += [
        right(a, b, label)
        for (a, b), label in zip(zip(boxes, boxes[1:], strict=False), ("V", "i", "T", "F", "v, ω"), strict=True)
    ]
    parts += [note(b.x, 146, effects) for b, (_, _, effects) in zip(boxes, names, strict=True)]
    parts += [
        arrow([(2, 90), (24, 90)]),
        note(4, 36, "command\nv_cmd", anchor="start"),
        note(1002, 56, "log.csv", anchor="end"),
    ]
    parts += [arrow([(431, 63), (431, 40), (263, 40), (263, 63)]), note(347, 34, "back-EMF, Kb Ω")]
    return page(1020, 184, "From the command to the motion, and the effects that act in each part", parts)


def workflow() -> str:
    """From logs of a robot to a corrected simulator."""
    top = [
        Box(90, 60, "bags, csv\nof a real robot", "file"),
        Box(270, 60, "rtds import\nnames, units, clocks"),
        Box(450, 60, "case\nrobot.toml, runs", "file"),
        Box(630, 60, "rtds diagnose\nreplay, search, judge"),
        Box(810, 60, "report.html\ndiagnosis.json", "result"),
    ]
    low = [
        Box(450, 180, "rtds predict\none run, corrected"),
        Box(630, 180, "rtds close, run\nreal-time simulator"),
        Box(810, 180, "rtds export\nMuJoCo, Gazebo, USD"),
        Box(270, 180, "rtds plan\nnext manoeuvre"),
    ]
    parts = [b.svg() for b in (*top, *low)]
    parts += [right(a, b) for a, b in zip(top, top[1:], strict=False)]
    parts += [arrow([(810, 87), (810, 120), (b.x, 120), (b.x, 153)]) for b in low if b.x != 810]
    parts += [down(top[4], low[2])]
    parts += [arrow([(205, 180), (90, 180), (90, 87)]), note(148, 172, "drive and record")]
    return page(900, 230, "The workflow: logs, case, diagnosis, report, corrected simulator", parts)


def chip() -> str:
    """The chip with its two clock domains."""
    way = [
        Box(70, 110, "LTC2308\nADC, 12 bit", "result", 100),
        Box(195, 110, "ltc2308_spi\nadc_sequencer", "hardware", 118),
        Box(330, 110, "cdc_handshake\ncrossing", "hardware", 118),
        Box(460, 110, "adc_scale\ncode to binary32", "hardware", 118),
        Box(620, 110, "rtds_core\ntwo motor units", "hardware", 128, 70),
        Box(775, 110, "dac_scale\nbinary32 to code", "hardware", 118),
        Box(905, 110, "dac_parallel", "hardware", 104),
        Box(1020, 110, "DAC7624\n4 outputs", "result", 90),
    ]
    extra = [
        Box(560, 215, "parameter unit\n8 coefficients", "hardware", 124),
        Box(700, 215, "effect unit\ntables, friction, delay", "hardware", 140),
        Box(330, 215, "rtds_regs\nregisters", "hardware", 112),
        Box(195, 215, "serial bridge\n1 Mbaud", "hardware", 118),
        Box(70, 215, "PC\nserial", "result", 100),
    ]
    parts = [
        "<rect x='130' y='44' width='143' height='110' fill='none' stroke='#999' stroke-dasharray='4 4'/>",
        "<path d='M386,44 H964 V264 H130 V178 H386 z' fill='none' stroke='#999' stroke-dasharray='4 4'/>",
        note(200, 36, "40 MHz"),
        note(675, 36, "50 MHz, one step every 10 µs"),
    ]
    parts += [b.svg() for b in (*way, *extra)]
    parts += [right(a, b) for a, b in zip(way, way[1:], strict=False)]
    parts += [
        arrow([(560, 188), (590, 146)]),
        arrow([(690, 188), (655, 146)]),
        arrow([(120, 215), (136, 215)]),
        arrow([(254, 215), (274, 215)]),
        arrow([(386, 215), (498, 215)]),
    ]
    return page(1080, 275, "The chip: ADC, scaling, motor units with parameter and effect unit, DAC, registers", parts)


def rooms() -> str:
    """The folders of the code, the path of a log and the path of a voltage."""
    parts = [
        "<rect x='10' y='30' width='960' height='190' fill='none' stroke='#999' stroke-dasharray='4 4'/>",
        "<rect x='10' y='262' width='960' height='196' fill='none' stroke='#999' stroke-dasharray='4 4'/>",
        note(20, 22, "simulator: the path of a voltage", 13, "start"),
        note(20, 254, "diagnosis: the path of a log", 13, "start"),
    ]
    a = [
        Box(90, 90, "scenario/\nwhat is driven"),
        Box(250, 90, "control/\nchooses volts"),
        Box(410, 90, "run/\nthe loop"),
        Box(580, 90, "link/\nmodel, RTL, board"),
        Box(760, 60, "rtl/ + sim/\nmotor units in Verilog", "hardware", 150),
        Box(760, 120, "motor/\nbit-exact model", "program", 150),
        Box(410, 180, "robot/\nPyBullet, MuJoCo", "physics"),
        Box(580, 180, "correction/\neffects in the loop"),
        Box(250, 180, "run folder\nrun.json, log.csv", "file"),
        Box(90, 180, "studies/\nmeasure both halves"),
    ]
    b = [
        Box(90, 320, "importers/\nbags, csv"),
        Box(250, 320, "contract/\ncase: robot, runs", "file"),
        Box(410, 320, "gate/\nsound samples"),
        Box(580, 320, "replay/\nrobot with effects"),
        Box(760, 320, "search, attribution\nwhich effects, how sure", "program", 150),
        Box(760, 410, "report/\nreport, diagnosis.json", "result", 150),
        Box(580, 410, "plant/\neach equation once", "physics"),
        Box(410, 410, "export/\nother simulators"),
        Box(90, 410, "blind/\nsealed cases, score"),
        Box(250, 410, "plan/\nnext manoeuvre"),
    ]
    parts += [x.svg() for x in (*a, *b)]
    parts += [right(a[0], a[1]), right(a[1], a[2], "V"), right(a[2], a[3], "V, T")]
    parts += [arrow([(645, 84), (685, 62)]), arrow([(645, 96), (685, 118)])]
    parts += [down(a[2], a[6], "ω"), arrow([(515, 180), (475, 180)]), arrow([(345, 108), (300, 153)])]
    parts += [right(b[0], b[1]), right(b[1], b[2]), right(b[2], b[3]), right(b[3], b[4]), down(b[4], b[5])]
    parts += [arrow([(580, 383), (580, 347)])]
    parts += [arrow([(760, 437), (760, 446), (410, 446), (410, 437)]), arrow([(410, 446), (250, 446), (250, 437)])]
    parts += [arrow([(90, 383), (185, 345)]), arrow([(250, 207), (250, 293)])]
    parts += [arrow([(835, 410), (930, 410), (930, 236), (580, 236), (580, 207)])]
    parts += [note(755, 250, "diagnosis.json into the simulator")]
    return page(980, 465, "The folders of the code, the path of a voltage and the path of a log", parts)


def wiring() -> str:
    """The board between its converters and the PC."""
    pc = Box(80, 130, "PC\nrtds run --link ad2", "program", 130)
    first = Box(290, 70, "Analog Discovery 2\nfirst", "file", 150)
    second = Box(290, 160, "Analog Discovery 2\nsecond", "file", 150)
    serial = Box(290, 250, "serial adapter\n3.3 V, 1 Mbaud", "file", 150)
    board = Box(720, 150, "DE10-Nano\nmotor units in the FPGA", "hardware", 170, 90)
    dac = Box(720, 260, "DAC7624 board\non GPIO_0", "hardware", 150)
    parts = [b.svg() for b in (pc, first, second, serial, board, dac)]
    parts += [arrow([(145, 130), (180, 130), (180, y), (215, y)]) for y in (70, 160, 250)]
    parts += [note(178, 118, "USB", anchor="end")]
    parts += [
        arrow([(365, 60), (690, 60), (690, 105)]),
        note(545, 54, "W1, W2: voltages of the left and the right motor, to the ADC"),
        arrow([(365, 150), (635, 150)]),
        note(527, 144, "W1, W2: load torques, to the ADC"),
        arrow([(365, 250), (480, 250), (480, 180), (635, 180)]),
        note(484, 236, "UART, GPIO_1", anchor="start"),
        arrow([(720, 195), (720, 233)]),
        arrow([(720, 287), (720, 310), (420, 310), (420, 172), (365, 172)]),
        arrow([(420, 172), (420, 82), (365, 82)]),
        note(570, 304, "current and speed to inputs 1+, 2+: left first, right second"),
    ]
    return page(830, 325, "The bench: PC, two Analog Discovery 2, DE10-Nano, DAC board", parts)


DRAWINGS = {"chain": chain, "workflow": workflow, "chip": chip, "rooms": rooms, "wiring": wiring}


def axes(width: float, height: float):  # type: ignore[no-untyped-def]
    """A figure of matplotlib with one plot, whose SVG is the same at each call."""
    import matplotlib

    matplotlib.use("svg")
    matplotlib.rcParams.update({"svg.hashsalt": "rtds", "svg.fonttype": "none", "font.size": 9})
    import matplotlib.pyplot as plt

    return plt.subplots(figsize=(width, height), layout="constrained")


def save(figure, path: Path) -> None:  # type: ignore[no-untyped-def]
    figure.savefig(path, metadata={"Date": None})


def paths(runs: list[Path], out: Path) -> None:
    """x over y of run folders, start marked."""
    from rtds_host.contract.runlog import read_run

    figure, plot = axes(5.0, 3.6)
    for folder in runs:
        log = read_run(folder)
        x, y = (log.columns[c] for c in ("x", "y"))
        plot.plot(x, y, label=folder.name)
        plot.plot(x[0], y[0], "k.", markersize=4)
    plot.set(xlabel="x, m", ylabel="y, m", aspect="equal")
    plot.grid(alpha=0.3)
    plot.legend()
    save(figure, out / "path.svg")


def gap(case: Path, diagnosis: Path, out: Path) -> None:
    """Residual of the left wheel's speed in a case's first run, by the nominal and the corrected replay."""
    from rtds_host import predict, read_case

    read = read_case(case)
    run = read.runs[0]
    nominal, corrected = predict(run, read.robot), predict(run, read.robot, diagnosis)
    figure, plot = axes(7.0, 3.0)
    for replayed, colour, label in (
        (nominal, "tab:red", "nominal model"),
        (corrected, "tab:blue", "with the named effect"),
    ):
        residual = run.columns["w_l"] - replayed["w_l"]
        plot.plot(run.t, residual, ".", markersize=2, color=colour, label=label)
    plot.set(xlabel="t, s", ylabel="measured minus replayed, rad/s", title=f"left wheel's speed, run {run.name}")
    plot.grid(alpha=0.3)
    plot.legend(loc="upper left", markerscale=4)
    save(figure, out / "gap.svg")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parents[1] / "docs" / "images")
    parser.add_argument("--path", nargs="+", type=Path, metavar="RUN")
    parser.add_argument("--gap", nargs=2, type=Path, metavar=("CASE", "DIAGNOSIS"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if not (options.path or options.gap):
        for name, drawing in DRAWINGS.items():
            (options.out / f"{name}.svg").write_text(drawing())
    if options.path:
        paths(options.path, options.out)
    if options.gap:
        gap(*options.gap, options.out)


if __name__ == "__main__":
    main()
