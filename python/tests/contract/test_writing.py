"""Writing whole or not at all: what is in the way, and what must not be replaced."""

import errno
import os
import threading

import pytest

from rtds_host.cli.commands import main
from rtds_host.contract import RunMeta, output, read_run, staged_folder, write_atomic, write_run
from rtds_host.errors import OutputError

COLUMNS = {"t": [0.0, 0.1], "v_cmd_l": [1.0, 1.0], "v_cmd_r": [1.0, 1.0]}


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()))
    reader.start()
    write_atomic(pipe, "whole")
    reader.join()
    assert read == ["whole"] and pipe.is_fifo()


def test_a_link_is_followed(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "target")
    write_atomic(tmp_path / "link", "text")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "target").read_text() == "text"


def test_a_folder_where_a_file_is_needed_leaves_what_was_there(tmp_path):
    (tmp_path / "out" / "report.html").mkdir(parents=True)
    (tmp_path / "out" / "diagnosis.json").write_text("old")
    with pytest.raises(OutputError, match=r"report\.html: is a folder"), staged_folder(tmp_path / "out") as scratch:
        (scratch / "diagnosis.json").write_text("new")
        (scratch / "report.html").write_text("new")
    assert (tmp_path / "out" / "diagnosis.json").read_text() == "old"
    assert os.listdir(tmp_path) == ["out"]


def test_a_file_on_the_way_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="file: is a file, a folder is needed"):
        write_atomic(tmp_path / "file" / "pred.csv", "")
    with pytest.raises(OutputError, match="is a folder, a file is needed"):
        write_atomic(tmp_path, "")


def test_a_place_that_takes_no_folder_is_named_and_not_the_scratch_folder():
    with pytest.raises(OutputError) as error, staged_folder("/proc/out"):
        pass
    assert str(error.value).startswith("/proc/out: cannot write (")


def test_what_cannot_be_written_is_named_by_its_place_and_not_by_the_scratch_folder(tmp_path):
    def full(path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    with pytest.raises(OutputError) as outer, staged_folder(tmp_path / "out") as scratch:
        full(scratch / "run" / "log.csv")
    with (
        pytest.raises(OutputError) as inner,
        staged_folder(tmp_path / "out") as scratch,
        staged_folder(scratch / "run") as deeper,
    ):
        full(deeper / "log.csv")
    wanted = f"{tmp_path / 'out' / 'run' / 'log.csv'}: cannot write (No space left on device)"
    assert [str(e.value) for e in (outer, inner)] == [wanted, wanted]


def test_files_are_on_the_disk_before_they_have_their_names(tmp_path, monkeypatch):
    done = []
    sync, move = os.fsync, os.replace
    monkeypatch.setattr(
        output.os, "fsync", lambda handle: (sync(handle), done.append(os.readlink(f"/proc/self/fd/{handle}")))
    )
    monkeypatch.setattr(output.os, "replace", lambda a, b: (move(a, b), done.append("named")))
    with staged_folder(tmp_path / "out") as scratch:
        (scratch / "run").mkdir()
        (scratch / "run" / "log.csv").write_text("t")
        written = {str(scratch), str(scratch / "run"), str(scratch / "run" / "log.csv")}
    assert set(done[:-1]) == written and done[-1] == "named"


def test_a_mounted_folder_is_filled_from_a_scratch_folder_inside(tmp_path, monkeypatch):
    # A file cannot be moved from one file system to another; here the parent refuses instead.
    target = tmp_path / "volume"
    target.mkdir()
    monkeypatch.setattr(output.os, "access", lambda place, mode: place != tmp_path)
    with staged_folder(target) as scratch:
        assert scratch.parent == target
        (scratch / "a").write_text("1")
    assert os.listdir(target) == ["a"]


def test_a_run_written_over_another_in_the_other_format_can_be_read(tmp_path):
    for form in ("csv", "parquet", "csv"):
        write_run(tmp_path / "run", RunMeta("x"), COLUMNS, form)
        assert read_run(tmp_path / "run").path.suffix == f".{form}"


def _call(monkeypatch, capsys, *arguments):
    monkeypatch.setattr("sys.argv", ["rtds", *map(str, arguments)])
    with pytest.raises(SystemExit) as end:
        main()
    return end.value.code, capsys.readouterr()


@pytest.mark.parametrize("arguments", [[], ["blind"]])
def test_a_command_without_arguments_answers_with_its_help_alone(monkeypatch, capsys, arguments):
    status, said = _call(monkeypatch, capsys, *arguments)
    assert status == 2 and "Usage" in said.out and said.err == ""


def test_a_prediction_does_not_overwrite_its_own_log(tmp_path, monkeypatch, capsys):
    from rtds_host.contract import builtin_robot_path

    write_run(tmp_path / "run", RunMeta("x"), COLUMNS)
    log = tmp_path / "run" / "log.csv"
    before = log.read_text()
    status, said = _call(
        monkeypatch, capsys, "predict", tmp_path / "run", "--robot", builtin_robot_path("burger"), "--out", log
    )
    assert status == 2 and "input" in said.err and log.read_text() == before


def test_an_error_that_nobody_foresaw_is_one_line_and_no_status_of_its_own(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr("rtds_host.contract.load_robot", lambda path: 1 / 0)
    status, said = _call(monkeypatch, capsys, "predict", tmp_path, "--robot", tmp_path, "--out", tmp_path / "p.csv")
    assert status == 2 and said.err.count("\n") == 1 and "ZeroDivisionError" in said.err
