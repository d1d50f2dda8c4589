"""The table of where a run's processor time goes has every part, and leaves PyBullet as it was."""

import pytest

pybullet = pytest.importorskip("pybullet", reason="PyBullet has no wheel for this Python")

from rtds_host.bench import share  # noqa: E402


def test_the_parts_of_a_run_add_up_and_the_engine_is_called_once_a_step():
    functions = [getattr(pybullet, name) for name in share.CALLS]
    simulated_s, parts = share.measure("linear", "model", pybullet)
    assert [getattr(pybullet, name) for name in share.CALLS] == functions
    calls = {part.what: part.calls for part in parts}
    settling = 500  # steps of 1 ms, before the run
    assert calls["stepSimulation"] == calls["setJointMotorControlArray"] == round(simulated_s / 1e-3) + settling
    assert 0 < calls["exchange"] < calls["stepSimulation"]
    assert all(part.cpu_s >= 0.0 for part in parts)


def test_the_table_is_sorted_and_its_shares_are_of_the_whole():
    text = share.table(2.0, [share.Share("one", 10, 0.1), share.Share("two", 0, 0.3)])
    lines = text.splitlines()
    assert lines[0] == "2 s simulated in 0.40 s of processor time, 5.0 times real time"
    assert lines[4].split("|")[1].strip() == "two" and "75.0%" in lines[4]
    assert "10000.0" in lines[5] and "25.0%" in lines[5]
