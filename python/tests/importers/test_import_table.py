"""Csv files with names and units of their own."""

from __future__ import annotations

import math

import numpy as np
import pytest

from rtds_host.contract import builtin_robot_path, read_case
from rtds_host.errors import InputError
from rtds_host.importers import import_case

MAPPING = """schema = "rtds-mapping/1"
robot = "burger"
[time]
column = "ms"
unit = "ms"
[signal]
v_cmd_l = { column = "duty_l", unit = "%" }
v_cmd_r = { column = "duty_r", unit = "%" }
w_l = { column = "rpm_l", unit = "rpm" }
w_r = { column = "deg_s_r", unit = "deg/s" }
i_l = { column = "mA_l", unit = "mA" }
yaw = { column = "heading", unit = "deg", wraps_at = 360 }
"""
HEADER = "ms,duty_l,duty_r,rpm_l,deg_s_r,mA_l,heading,remark"


def rows(n=60):
    """Time in ms, two duties, two speeds, a current at every third row, a heading that wraps."""
    return [[20 * k, 10, -20, 6.0, -60.0, 150.0 if k % 3 == 0 else "", (355 + k) % 360, "ok"] for k in range(n)]


def table(tmp_path, lines, header=HEADER, text=None):
    path = tmp_path / "log.csv"
    path.write_text(text if text is not None else "\n".join([header, *(",".join(map(str, r)) for r in lines)]) + "\n")
    return path


def bring(tmp_path, path, mapping=MAPPING, **options):
    file = tmp_path / "map.toml"
    file.write_text(mapping)
    import_case([path], tmp_path / "case", mapping=file, **options)
    return read_case(tmp_path / "case").runs[0]


def test_units_become_si_and_empty_cells_stay_empty(tmp_path):
    run = bring(tmp_path, table(tmp_path, rows()))
    assert run.t == pytest.approx(0.02 * np.arange(60))
    assert run.columns["v_cmd_l"] == pytest.approx(1.2)
    assert run.columns["v_cmd_r"] == pytest.approx(-2.4)
    assert run.columns["w_l"] == pytest.approx(0.2 * math.pi)
    assert run.columns["w_r"] == pytest.approx(-math.pi / 3)
    assert np.isfinite(run.columns["i_l"]).sum() == 20 and np.nanmax(run.columns["i_l"]) == pytest.approx(0.15)
    assert run.columns["yaw"] == pytest.approx(np.radians(355 + np.arange(60)))
    assert run.name == "log"


def test_a_commanded_twist_and_odometry_in_columns(tmp_path):
    mapping = """schema = "rtds-mapping/1"
robot = "burger.toml"
[time]
column = "s"
[twist]
linear = "v_mm"
angular = "turn"
linear_unit = "mm/s"
angular_unit = "deg/s"
[servo]
kp_v_s_per_rad = 1.0
ki_v_per_rad = 10.0
period_s = 0.01
[signal]
w_l = { pair = ["v", "omega"] }
w_r = { pair = ["v", "omega"] }
"""
    (tmp_path / "burger.toml").write_text(builtin_robot_path("burger").read_text())  # next to the mapping
    lines = [f"{0.05 * k},66,{math.degrees(0.5):.9f},0.066,0.5" for k in range(30)]
    run = bring(tmp_path, table(tmp_path, None, text="\n".join(["s,v_mm,turn,v,omega", *lines])), mapping)
    for side, sign in (("l", -1), ("r", 1)):
        assert run.columns[f"w_cmd_{side}"] == pytest.approx((0.066 + sign * 0.04) / 0.033)
        assert run.columns[f"w_{side}"] == pytest.approx((0.066 + sign * 0.04) / 0.033)


def test_words_for_no_sample(tmp_path):
    lines = rows()
    for k, word in enumerate(("nan", "NaN", "null", "-", "NA")):
        lines[k + 1][3] = word
    run = bring(tmp_path, table(tmp_path, lines))
    assert np.isnan(run.columns["w_l"][1:6]).all() and np.isfinite(run.columns["w_l"][6:]).all()


def test_semicolons_decimal_commas_and_lines_before_the_header(tmp_path):
    lines = [";".join(str(cell).replace(".", ",") for cell in row) for row in rows()]
    path = table(
        tmp_path, None, text="\ufeffLogger 2.1\nserial 77\n" + HEADER.replace(",", ";") + "\n" + "\n".join(lines)
    )
    run = bring(tmp_path, path, MAPPING + '[table]\ndecimal = ","\nskip_rows = 2\n')
    assert run.columns["w_l"] == pytest.approx(0.2 * math.pi)


def test_an_epoch_in_nanoseconds_keeps_its_digits(tmp_path):
    lines = rows()
    for k, row in enumerate(lines):
        row[0] = 1_700_000_000_000_000_000 + 20_000_000 * k
    run = bring(tmp_path, table(tmp_path, lines), MAPPING.replace('unit = "ms"', 'unit = "ns"'))
    assert run.t == pytest.approx(0.02 * np.arange(60), abs=1e-6)


@pytest.mark.parametrize(
    "change, complaint",
    [
        (lambda r: r[7].__setitem__(0, 20), r"row 9: time goes back \(ms is 120, then 20\)"),
        (lambda r: r[7].__setitem__(0, ""), "row 9: ms is empty"),
        (lambda r: r[7].__setitem__(3, "six"), "row 9: rpm_l is 'six', not a number"),
        (lambda r: r[7].__setitem__(3, "1_0"), "row 9: rpm_l is '1_0', not a number"),
        (lambda r: r[7].__setitem__(3, "\u0663"), "row 9: rpm_l is '\u0663', not a number"),
        (lambda r: r[7].__setitem__(3, "inf"), "row 9: rpm_l is infinite"),
        (lambda r: r[7].pop(), "row 9: has 7 cells, the header names 8"),
        (lambda r: r[-1].__delitem__(slice(3, None)), "row 61: has 3 cells, the header names 8, the file is truncated"),
        (lambda r: r.__delitem__(slice(1, None)), "has 1 rows of numbers"),
        (lambda r: [row.__setitem__(0, 5) for row in r], "one and the same time"),
        (lambda r: [row.__setitem__(3, 900.0) for row in r], "w_l reaches 94.2 rad/s, 13.3 times the nominal no-load"),
        (lambda r: [row.__setitem__(5, 150e3) for row in r], "i_l reaches 150 A"),
        (lambda r: [row.__setitem__(1, 1000) for row in r], "v_cmd_l reaches 120 V at a supply of 12 V"),
        (
            lambda r: [row.__setitem__(1, 0.05) for row in r],
            "v_cmd_l never exceeds 0.006 V, too little .* is it a duty",
        ),
    ],
)
def test_a_bad_table_is_named_with_its_row(tmp_path, change, complaint):
    lines = rows()
    change(lines)
    with pytest.raises(InputError, match=complaint) as caught:
        bring(tmp_path, table(tmp_path, lines))
    assert "log.csv" in str(caught.value) and "\n" not in str(caught.value)
    assert not (tmp_path / "case").exists()


@pytest.mark.parametrize(
    "text, complaint",
    [
        ("", "header line"),
        (
            HEADER.replace("rpm_l", "rpm") + "\n" + "1,2,3,4,5,6,7,8\n2,2,3,4,5,6,7,8\n",
            r"column 'rpm_l' \(.*signal.w_l.*\): missing, columns are ms, duty_l",
        ),
        (HEADER.replace("rpm_l", "duty_l") + "\n1,2,3,4,5,6,7,8\n", "column 'duty_l' appears twice"),
    ],
)
def test_a_table_without_what_is_mapped(tmp_path, text, complaint):
    with pytest.raises(InputError, match=complaint):
        bring(tmp_path, table(tmp_path, None, text=text))


def test_a_file_that_is_no_text(tmp_path):
    path = tmp_path / "log.csv"
    path.write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(InputError, match="is not text"):
        bring(tmp_path, path)


def test_missing_commands_are_named(tmp_path):
    mapping = "\n".join(line for line in MAPPING.splitlines() if "v_cmd" not in line)
    with pytest.raises(InputError, match=r"no command signal: neither voltages \(v_cmd_l, v_cmd_r\) nor wheel speeds"):
        bring(tmp_path, table(tmp_path, rows()), mapping)
    mapping = "\n".join(line for line in MAPPING.splitlines() if "v_cmd_r" not in line)
    with pytest.raises(InputError, match="v_cmd_r is missing while v_cmd_l is there"):
        bring(tmp_path, table(tmp_path, rows()), mapping)
    mapping = "\n".join(line for line in MAPPING.splitlines() if not line.startswith("w_"))
    with pytest.raises(InputError, match="no measured wheel speed or angle"):
        bring(tmp_path, table(tmp_path, rows()), mapping)


def test_a_table_needs_a_mapping_and_a_time(tmp_path):
    path = table(tmp_path, rows())
    with pytest.raises(InputError, match="log.csv: a table needs --mapping"):
        import_case([path], tmp_path / "case")
    with pytest.raises(InputError, match=r"\[time\] column: missing"):
        bring(tmp_path, path, MAPPING.replace('column = "ms"', ""))


@pytest.mark.parametrize(
    "options, complaint",
    [
        ({"start_s": math.nan}, "--start-s nan"),
        ({"start_s": math.inf}, "--start-s inf"),
        ({"end_s": -1.0}, "--end-s -1"),
        ({"start_s": 5.0, "end_s": 1.0}, "lies not before"),
    ],
)
def test_a_part_that_is_none_is_refused(tmp_path, options, complaint):
    with pytest.raises(InputError, match=complaint):
        bring(tmp_path, table(tmp_path, rows()), **options)
    assert not (tmp_path / "case").exists()


def test_a_robot_saved_with_a_byte_order_mark_can_be_imported(tmp_path):
    robot = tmp_path / "robot.toml"
    robot.write_bytes(b"\xef\xbb\xbf" + builtin_robot_path("burger").read_bytes())
    assert len(bring(tmp_path, table(tmp_path, rows()), robot=str(robot)).t) == 60


def test_a_case_that_cannot_be_is_refused_by_the_name_it_would_have_had(tmp_path):
    with pytest.raises(InputError, match=r"case/robot\.toml: \[sensors\] w_rad_s"):
        bring(tmp_path, table(tmp_path, rows()), MAPPING + "[sensors]\nw_rad_s = 0\n")
    assert not (tmp_path / "case").exists()
