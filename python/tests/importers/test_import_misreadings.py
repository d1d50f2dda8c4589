"""Slips of a mapping that would give numbers and no error: each is refused or said in one line."""

from __future__ import annotations

import gzip
import math
import zipfile

import pytest
from test_import_table import HEADER, MAPPING, bring, rows, table

from rtds_host.errors import InputError
from rtds_host.importers import import_case

SECONDS = [[0.02 * k, *row[1:]] for k, row in enumerate(rows())]


def said(tmp_path, path, mapping):
    """Notices of an import."""
    file = tmp_path / "map.toml"
    file.write_text(mapping)
    (run,) = import_case([path], tmp_path / "case", mapping=file)
    return run.imported.notices


def test_seconds_declared_as_milliseconds_are_refused_with_the_unit(tmp_path):
    with pytest.raises(InputError, match=r"ms in ms is a row every 2e-05 s: is it in s\?"):
        bring(tmp_path, table(tmp_path, SECONDS))


@pytest.mark.parametrize(("unit", "step"), [("s", "20"), ("us", "2e-05")])
def test_milliseconds_declared_as_something_else_are_refused_with_the_unit(tmp_path, unit, step):
    with pytest.raises(InputError, match=rf"ms in {unit} is a row every {step} s: is it in ms\?"):
        bring(tmp_path, table(tmp_path, rows()), MAPPING.replace('unit = "ms"', f'unit = "{unit}"'))


def test_whoever_insists_on_a_unit_gets_it_with_a_note(tmp_path):
    run = bring(tmp_path, table(tmp_path, SECONDS), trust_units=True)
    assert run.t[-1] == pytest.approx(59 * 2e-5, abs=1e-6)


@pytest.mark.parametrize(
    ("line", "channels"),
    [
        ('w_r = { column = "rpm_l", unit = "rpm" }', "[signal.w_r]: is the same column 'rpm_l' as [signal.w_l]"),
        (
            'th_l = { column = "duty_l", unit = "deg" }',
            "[signal.th_l]: is the same column 'duty_l' as [signal.v_cmd_l]",
        ),
        (
            'i_r = { column = "mA_l", unit = "mA", reverse = true }',
            "[signal.i_r]: is the same column 'mA_l' as [signal.i_l]",
        ),
    ],
)
def test_one_column_cannot_be_two_channels(tmp_path, line, channels):
    text = MAPPING.replace('w_r = { column = "deg_s_r", unit = "deg/s" }\n', "") + line + "\n"
    with pytest.raises(InputError) as error:
        bring(tmp_path, table(tmp_path, rows()), text)
    assert channels in str(error.value)


def test_one_command_for_both_wheels_is_read_and_said(tmp_path):
    assert "log.csv: v_cmd_l and v_cmd_r are the same column 'duty_l': both wheels are commanded alike" in said(
        tmp_path, table(tmp_path, rows()), MAPPING.replace('"duty_r"', '"duty_l"')
    )


@pytest.mark.parametrize("period", ["1e-300", "180", "-360", "0"])
def test_a_number_that_does_not_fit_into_one_round_is_refused(tmp_path, period):
    with pytest.raises(InputError, match=r"wraps_at is"):
        bring(tmp_path, table(tmp_path, rows()), MAPPING.replace("wraps_at = 360", f"wraps_at = {period}"))


def test_an_angle_that_starts_again_unsaid_is_noted(tmp_path):
    notices = said(tmp_path, table(tmp_path, rows()), MAPPING.replace(", wraps_at = 360", ""))
    assert any("jumps 1 time(s) by nearly its whole range (359)" in notice for notice in notices)


def test_a_declared_unit_that_leaves_nothing_of_a_channel_is_said(tmp_path):
    lines = [[*row[:5], 100 + k % 7, *row[6:]] for k, row in enumerate(rows())]
    assert "log.csv: i_l changes by 6e-06 in all, its sensor's noise is 0.004: unit or scale?" in said(
        tmp_path, table(tmp_path, lines), MAPPING.replace('unit = "mA"', 'unit = "uA"')
    )


@pytest.mark.parametrize(("key", "value"), [("delay_s", "1e300"), ("delay_s", "-61"), ("delay_samples", "1e9")])
def test_a_lateness_of_minutes_is_no_lateness(tmp_path, key, value):
    with pytest.raises(InputError, match=rf"{key} is .*, it must be at (least|most)"):
        bring(tmp_path, table(tmp_path, rows()), MAPPING.replace('unit = "mA"', f'unit = "mA", {key} = {value}'))


def test_a_compressed_table_is_named(tmp_path):
    text = (HEADER + "\n" + "\n".join(",".join(map(str, row)) for row in rows())).encode()
    path = tmp_path / "log.csv"
    path.write_bytes(gzip.compress(text))
    with pytest.raises(InputError, match=r"log\.csv: is compressed \(gzip\), unpack it first"):
        bring(tmp_path, path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("log.csv", text)
    with pytest.raises(InputError, match=r"is compressed \(zip\)"):
        bring(tmp_path, path)


def test_a_heading_may_lie_on_either_end_of_its_round(tmp_path):
    lines = [[*row[:6], (358 + 0.5 * k) % 360 or 360, row[7]] for k, row in enumerate(rows())]
    run = bring(tmp_path, table(tmp_path, lines))
    assert run.columns["yaw"][-1] - run.columns["yaw"][0] == pytest.approx(math.radians(29.5), abs=1e-6)
