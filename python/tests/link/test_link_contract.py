"""What both links refuse, and how they say it."""

import ast
import graphlib
from pathlib import Path

import numpy as np
import pytest
from link_cases import BURGER, STEP_S

from rtds_host.errors import InputError, LinkError
from rtds_host.link import base, open_link


@pytest.fixture(scope="module", params=["model", "rtl"])
def link(request):
    """One link for all tests that leave it usable; they set its parameters themselves."""
    with open_link(request.param) as link:
        yield link


@pytest.fixture(params=["model", "rtl"])
def fresh_link(request):
    with open_link(request.param) as link:
        yield link


def refusal_of(call):
    with pytest.raises(InputError) as caught:
        call()
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_unknown_link_is_refused():
    refused = refusal_of(lambda: open_link("board"))
    assert refused == "link: 'board' is unknown, choose one of model, rtl, chip, ad2, hps"


def test_an_exchange_needs_parameters_first(fresh_link):
    assert "call set_parameters first" in refusal_of(lambda: fresh_link.exchange([0, 0], [0, 0], STEP_S))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"resistance_ohm": 0.0}, "resistance_ohm: 0 must be greater than zero"),
        ({"inductance_h": -1e-3}, "inductance_h: -0.001 must be greater than zero"),
        ({"rotor_inertia_kg_m2": float("nan")}, "rotor_inertia_kg_m2: nan is not a finite number"),
        ({"step_s": float("inf")}, "step_s: inf is not a finite number"),
        ({"torque_constant_nm_per_a": 1e39}, "torque_constant_nm_per_a: 1e+39 is outside"),
        ({"resistance_ohm": 3e38, "inductance_h": 3e38, "step_s": 1e38}, "together they give the coefficient"),
        ({"method": "runge_kutta"}, "method: 'runge_kutta' is unknown"),
    ],
)
def test_unusable_parameters_are_named_and_the_old_ones_stay(link, change, says):
    link.set_parameters(**BURGER)
    link.exchange([6.0, 6.0], [0.0, 0.0], 10 * STEP_S)
    assert says in refusal_of(lambda: link.set_parameters(**{**BURGER, **change}))
    assert link.step_s == STEP_S
    assert np.isfinite(link.exchange([6.0, 6.0], [0.0, 0.0], 10 * STEP_S).speeds).all()


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (([1.0], [0.0, 0.0], 1e-3), "voltages: two numbers [left, right] are needed"),
        (([1.0, float("nan")], [0.0, 0.0], 1e-3), "voltages: [1.0, nan] is not finite"),
        (([1.0, 1.0], [0.0, 1e39], 1e-3), "torques: [0.0, 1e+39] is not finite, or beyond single precision"),
        (([1.0, 1.0], [0.0, 0.0], 1.5e-5), "interval_s: 1.5e-05 s is not a whole number of simulation steps"),
        (([1.0, 1.0], [0.0, 0.0], 0.0), "interval_s: 0 s is not a whole number"),
        (([1.0, 1.0], [0.0, 0.0], -1e-3), "interval_s: -0.001 s is not a whole number"),
        (([1.0, 1.0], [0.0, 0.0], float("inf")), "interval_s: inf is not a finite time"),
        (([1.0, 1.0], [0.0, 0.0], 1e6), "interval_s: 1e+06 s is more than"),
        (([1.0, 1.0], [0.0, 0.0], 1e-3, 1e-6), "sample_s: 1e-06 s is not a whole number"),
    ],
)
def test_impossible_exchanges_are_refused_and_the_link_lives_on(link, call, says):
    link.set_parameters(**BURGER)
    assert says in refusal_of(lambda: link.exchange(*call))
    assert link.exchange([1.0, 1.0], [0.0, 0.0], 1e-3).t_s.tolist() == [1e-3]


def test_a_state_that_overflows_is_an_error_and_not_a_number(fresh_link):
    fresh_link.set_parameters(**BURGER)
    with pytest.raises(LinkError, match="no longer finite"):
        for _ in range(4):
            fresh_link.exchange([3e38, 3e38], [0.0, -3e38], 100 * STEP_S)


def test_samples_stand_at_multiples_and_at_the_end(fresh_link):
    fresh_link.set_parameters(**BURGER)
    got = fresh_link.exchange([6.0, 3.0], [0.0, 0.0], 10 * STEP_S, 4 * STEP_S)
    assert got.t_s == pytest.approx([4 * STEP_S, 8 * STEP_S, 10 * STEP_S])
    assert got.speeds.shape == got.currents.shape == (3, 2)
    assert (np.diff(got.speeds[:, 0]) > 0).all() and (got.speeds[:, 0] > got.speeds[:, 1]).all()


def test_a_closed_link_says_so(fresh_link):
    fresh_link.set_parameters(**BURGER)
    fresh_link.close()
    with pytest.raises(LinkError, match="the link is closed"):
        fresh_link.exchange([1.0, 1.0], [0.0, 0.0], STEP_S)
    with pytest.raises(LinkError, match="the link is closed"):
        fresh_link.set_parameters(**BURGER)


def test_the_modules_of_the_links_import_each_other_in_one_direction_only():
    """Imports within functions count, too: a late one hides a circle."""
    folder = Path(base.__file__).parent
    graph = {}
    for path in folder.glob("*.py"):
        if path.stem == "__init__":  # opens any link, and is imported by none of them for that
            continue
        wanted = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module == "rtds_host.link":
                wanted |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rtds_host.link."):
                wanted.add(node.module.split(".")[2])
        graph[path.stem] = {name for name in wanted if (folder / f"{name}.py").is_file()}
    assert "tops" in graph["build"] and "build" in graph["rtl"]
    list(graphlib.TopologicalSorter(graph).static_order())  # raises CycleError with the circle
