"""Many cases: one bad case costs no other, an interrupted run goes on, a cluster's worker may die, nothing is
half-written.
"""

import errno
import gc
import io
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import dask
import pyarrow.parquet as pq
import pytest
from batch_work import by_number, fake, in_trouble
from diagnosis_cases import example_diagnosis, make_case
from distributed import LocalCluster
from distributed.security import Security

from rtds_host.blind import seal
from rtds_host.contract import builtin_robot_path, write_run
from rtds_host.diagnosis import batch
from rtds_host.diagnosis.overview import SCHEMA, overview_page, row_of, table_bytes
from rtds_host.diagnosis.report.html import unplaced
from rtds_host.errors import InputError, LinkError, OutputError
from rtds_host.errors import visible as said_name
from rtds_host.workers import on_cluster, on_cores

NAMES = ("one", "two", "three")


def write_case(folder: Path, case) -> Path:
    """A case in the contract's format."""
    folder.mkdir(parents=True)
    shutil.copy(builtin_robot_path("burger"), folder / "robot.toml")
    for run in case.runs:
        write_run(folder / run.name, run.meta, {"t": run.t, **run.columns})
    return folder


@pytest.fixture(scope="module")
def tiny():
    return make_case(lambda m: m.add("coulomb", 0.05), seconds=3)


@pytest.fixture
def cases(tmp_path, tiny):
    return [write_case(tmp_path / "in" / name, tiny) for name in NAMES]


def tell(case: Path, **order) -> None:
    for path in case.glob("*/run.json"):
        meta = json.loads(path.read_text())
        path.write_text(json.dumps({**meta, "notes": json.dumps(order)}))


def started(log: Path) -> list[str]:
    return [line.split()[0] for line in log.read_text().splitlines()] if log.exists() else []


def visible(out: Path) -> set[str]:
    return {str(p.relative_to(out)) for p in out.rglob("*") if p.is_file() and batch.STATE not in p.parts}


def complete(*names: str) -> set[str]:
    return {f"{name}/{file}" for name in names for file in batch.FILES} | {"cases.parquet", "index.html"}


# ---- a bad case ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda case: shutil.rmtree(case), "is not a case folder"),
        (lambda case: tell(case, do="raise"), "internal error at batch_work.py:"),
        (lambda case: tell(case, do="die"), "its process died"),
    ],
    ids=["unreadable", "exception", "dying process"],
)
def test_one_bad_case_is_named_and_the_others_are_complete(cases, tmp_path, capsys, spoil, said):
    spoil(cases[1])
    out = tmp_path / "out"
    assert batch.run_many(cases, out, jobs=2, work=fake) == ["two"]
    assert visible(out) == complete("one", "three")
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2 and said in told[0] and "two" in told[0]
    assert told[1] == "rtds: 1 of 3 cases failed: two"
    rows = pq.read_table(out / "cases.parquet").to_pylist()
    assert [row["case"] for row in rows] == list(NAMES)
    assert [row["error"] is None for row in rows] == [True, False, True]
    assert said in rows[1]["error"] and rows[1]["verdict"] is None


def test_each_job_comes_back_once_though_one_kills_its_process():
    found = [(o.name, o.value, o.error is None) for o in on_cores(by_number, {str(k): (k,) for k in range(7)}, 2)]
    assert sorted(found) == [(str(k), None if k == 3 else k * k, k != 3) for k in range(7)]


def test_two_cases_of_one_name_are_refused_before_anything_is_written(cases, tmp_path, tiny):
    other = write_case(tmp_path / "other" / "one", tiny)
    with pytest.raises(InputError, match="one: two cases have this name"):
        batch.run_many([*cases, other], tmp_path / "out", work=fake)
    assert not (tmp_path / "out").exists()


def test_results_never_fall_into_a_case(cases):
    with pytest.raises(OutputError, match=f"{cases[0].name}: is an input of this very command"):
        batch.run_many(cases, cases[0].parent, work=fake)
    assert not list(cases[0].parent.glob("*/*.html"))


# ---- again ---------------------------------------------------------------------------------------------------------


def test_only_what_changed_is_done_again(cases, tmp_path):
    out, log = tmp_path / "out", tmp_path / "log"
    for case in cases:
        tell(case, log=str(log))

    def done(**options):
        log.unlink(missing_ok=True)
        assert batch.run_many(cases, out, jobs=1, work=fake, **options) == []
        assert visible(out) == complete(*NAMES)
        return sorted(started(log))

    assert done() == sorted(NAMES)
    assert done() == []
    # An input, an age without a change, a result by hand, a result that is gone, each option.
    tell(cases[0], log=str(log), wait=0.0)
    os.utime(cases[1] / "robot.toml")
    assert done() == ["one"]
    (out / "two" / "diagnosis.json").write_text("{}")
    assert done() == ["two"]
    (out / "three" / "report.html").unlink()
    assert done() == ["three"]
    assert done(quick=True) == sorted(NAMES)
    assert "one True" in (out / "one" / "report.html").read_text()


def test_an_earlier_result_of_a_case_that_now_fails_is_taken_away(cases, tmp_path):
    out = tmp_path / "out"
    batch.run_many(cases, out, jobs=1, work=fake)
    (cases[0] / "robot.toml").write_text("schema = 1")
    assert batch.run_many(cases, out, jobs=1, work=fake) == ["one"]
    assert visible(out) == complete("two", "three")


RUN = """
import sys
sys.path.insert(0, {tests!r})
from pathlib import Path
from batch_work import fake
from rtds_host.diagnosis.batch import run_many
if __name__ == "__main__":
    run_many([Path(p) for p in sys.argv[2:]], Path(sys.argv[1]), jobs=1, work=fake)
"""


def test_a_killed_run_leaves_nothing_half_written_and_the_next_goes_on(cases, tmp_path):
    out, log, script = tmp_path / "out", tmp_path / "log", tmp_path / "run.py"
    script.write_text(RUN.format(tests=str(Path(__file__).parent)))
    tell(cases[0], log=str(log))
    tell(cases[1], log=str(log), wait=60)
    tell(cases[2], log=str(log))
    process = subprocess.Popen([sys.executable, str(script), str(out), *map(str, cases)], stderr=subprocess.DEVNULL)
    while started(log) != ["one", "two"]:
        assert process.poll() is None
        time.sleep(0.02)
    worker = int(log.read_text().split()[-1])
    process.kill()
    process.wait()
    assert visible(out) == {"one/diagnosis.json", "one/report.html"}
    # Its worker goes, too, and does not work on for nobody.
    while Path(f"/proc/{worker}/stat").exists() and Path(f"/proc/{worker}/stat").read_text().split()[2] != "Z":
        time.sleep(0.02)
    # What a kill in the middle of writing leaves.
    (out / ".two-abcd1234.rtds").mkdir()
    (out / ".two-abcd1234.rtds" / "diagnosis.json").write_text("{")
    tell(cases[1], log=str(log))
    log.unlink()
    assert batch.run_many(cases, out, jobs=1, work=fake) == []
    assert started(log) == ["two", "three"]
    assert visible(out) == complete(*NAMES)


def test_a_second_run_into_the_same_folder_is_refused(cases, tmp_path):
    results = batch.Results(tmp_path / "out")
    with results.locked(), pytest.raises(OutputError, match="another rtds diagnose"):
        batch.run_many(cases, tmp_path / "out", work=fake)


def fill_the_disk(monkeypatch, when):
    """Writing of files that `when` names ends half way as on a full disk."""
    write = Path.write_text

    def full(path, text, **options):
        if when(path):
            write(path, text[:5], **options)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        return write(path, text, **options)

    monkeypatch.setattr(Path, "write_text", full)


def test_a_disk_that_is_full_for_a_while_costs_that_case_alone(cases, tmp_path, monkeypatch, capsys):
    out = tmp_path / "out"
    fill_the_disk(monkeypatch, lambda path: path.name == "report.html" and "two" in str(path))
    assert batch.run_many(cases, out, jobs=1, work=fake) == ["two"]
    assert visible(out) == complete("one", "three")
    assert not list(out.glob(".two*"))
    said = capsys.readouterr().err.splitlines()
    assert said[0].startswith("rtds: ") and said[0].endswith("(No space left on device)") and "two" in said[0]
    monkeypatch.undo()
    assert batch.run_many(cases, out, jobs=1, work=fake) == []
    assert visible(out) == complete(*NAMES)


def test_a_disk_that_stays_full_ends_it_with_nothing_half_written(cases, tmp_path, monkeypatch):
    out = tmp_path / "out"
    assert batch.run_many(cases[:1], out, jobs=1, work=fake) == []

    def full(path, data):
        raise OutputError(f"{path}: cannot write (No space left on device)")

    monkeypatch.setattr(batch, "write_atomic", full)
    with pytest.raises(OutputError, match="cases.parquet: cannot write"):
        batch.run_many(cases, out, jobs=1, work=fake)
    assert "one/diagnosis.json" in visible(out) and not list(out.glob(".*-*"))
    monkeypatch.undo()
    assert batch.run_many(cases, out, jobs=1, work=fake) == []
    assert visible(out) == complete(*NAMES)


# ---- names and memory ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["latin-\udce9", "n" * 250, "index.html", batch.STATE], ids=["no text", "long", "page", "state"]
)
def test_a_name_that_cannot_be_written_is_refused_first_and_costs_that_case_alone(cases, tmp_path, tiny, capsys, name):
    bad = write_case(tmp_path / "in" / name, tiny)
    out = tmp_path / "out"
    shown = said_name(name)
    assert batch.run_many([*cases, bad], out, jobs=1, work=fake) == [shown]
    assert visible(out) == complete(*NAMES)
    told = capsys.readouterr()
    assert shown in told.err.splitlines()[0] and told.err.splitlines()[0].endswith("rename the folder")
    rows = {row["case"]: row["error"] for row in pq.read_table(out / "cases.parquet").to_pylist()}
    assert rows[shown].endswith("rename the folder") and [rows[n] for n in NAMES] == [None] * 3


def test_a_run_whose_name_is_no_text_costs_its_case_alone(cases, tmp_path, capsys):
    (cases[1] / "spin").rename(cases[1] / "spin\udce9")
    out = tmp_path / "out"
    assert batch.run_many(cases, out, jobs=1, work=fake) == ["two"]
    assert visible(out) == complete("one", "three")
    assert r"spin\udce9 is not a name in UTF-8" in capsys.readouterr().err
    with pytest.raises(InputError, match="is not a name in UTF-8"):
        batch.run_one(cases[1], tmp_path / "single")
    assert not (tmp_path / "single").exists()


def test_names_that_would_steer_a_terminal_are_spelled_out(tmp_path, tiny, capsys):
    cases = [write_case(tmp_path / "in" / name, tiny) for name in ("a\x1b[31m", "b\nc")]
    tell(cases[1], do="raise")
    assert batch.run_many(cases, tmp_path / "out", jobs=1, work=fake) == ["b\nc"]
    said = capsys.readouterr()
    assert r"a\x1b[31m: known" in said.out and r"b\nc: internal error" in said.err
    assert "\x1b" not in said.out + said.err


@pytest.mark.parametrize(
    ("job", "why"), [("memory", "out of memory"), ("die", "its process died"), ("no file", "No such file")]
)
def test_a_job_without_memory_and_a_lost_worker_cost_themselves_alone(job, why):
    found = {o.name: o for o in on_cores(in_trouble, {"a": ("fine",), "b": (job,), "c": ("fine",), "d": ("fine",)}, 2)}
    assert {name: o.value for name, o in found.items()} == {"a": "fine", "b": None, "c": "fine", "d": "fine"}
    assert why in found["b"].error and "internal error" not in found["b"].error


# ---- table and page ------------------------------------------------------------------------------------------------


def test_a_row_holds_what_the_diagnosis_says():
    row = pq.read_table(io.BytesIO(table_bytes([row_of("a", example_diagnosis(), 2.5)]))).to_pylist()[0]
    assert row == {
        "case": "a",
        "verdict": "known",
        "effects": ["coulomb_friction"],
        "sides": ["both"],
        "subsystems": ["drivetrain"],
        "probabilities": [0.96],
        "probability": 0.95,
        "parameters": [
            {
                "effect": "coulomb_friction",
                "side": "both",
                "name": "torque_nm",
                "value": 0.048,
                "low": 0.046,
                "high": 0.050,
            }
        ],
        "gap_before": 14.2,
        "gap_refit": 13.9,
        "gap_after": 1.08,
        "closed": 0.994,
        "effect_closed": 0.994,
        "seconds": 2.5,
        "error": None,
    }
    assert list(row) == SCHEMA.names


def test_the_page_links_the_reports_and_carries_everything_itself():
    page = overview_page(
        [row_of("a <b>", example_diagnosis(), 2.5), row_of("c", None, None, "c: robot.toml <missing>")]
    )
    assert 'href="a%20%3Cb%3E/report.html"' in page and "a &lt;b&gt;" in page and "<b>" not in page.split("<tbody>")[1]
    assert "robot.toml &lt;missing&gt;" in page and 'href="c/' not in page
    assert "http" not in page and "src=" not in page


@pytest.mark.browser
def test_a_click_on_a_head_sorts_by_its_column(tmp_path):
    from selenium import webdriver

    rows = []
    for name, before in (("a", 9.5), ("b", 10.0), ("c", 2.0)):
        diagnosis = example_diagnosis()
        diagnosis["gap"]["before"] = before
        rows.append(row_of(name, diagnosis, 1.0))
    rows.insert(0, row_of("d", None, None, "no good"))
    (tmp_path / "index.html").write_text(overview_page(rows), encoding="utf-8")
    options = webdriver.ChromeOptions()
    for flag in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
        options.add_argument(flag)
    options.binary_location = shutil.which("chromium")
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
    try:
        driver.get((tmp_path / "index.html").as_uri())

        def order():
            return "".join(r.text.split()[0] for r in driver.find_elements("css selector", "#cases tbody tr"))

        head = next(h for h in driver.find_elements("css selector", "#cases th") if h.text.startswith("gap"))
        assert order() == "dabc"
        head.click()
        assert order() == "cabd"
        head.click()
        assert order() == "bacd"
        assert [e for e in driver.get_log("browser") if e["level"] == "SEVERE"] == []
    finally:
        driver.quit()


# ---- a cluster -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def cluster():
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        yield cluster


def test_a_worker_that_is_killed_at_work_loses_nothing_and_nothing_comes_twice(cluster, tmp_path, tiny, capsys):
    names = [f"case-{k}" for k in range(8)]
    cases = [write_case(tmp_path / "in" / name, tiny) for name in names]
    log, out, killed = tmp_path / "log", tmp_path / "out", []
    for case in cases:
        tell(case, log=str(log), wait=0.4)

    def kill():
        while not started(log):
            time.sleep(0.01)
        name, pid = log.read_text().splitlines()[0].split()
        os.kill(int(pid), signal.SIGKILL)
        killed.append(name)

    thread = threading.Thread(target=kill)
    thread.start()
    assert batch.run_many(cases, out, scheduler=cluster.scheduler_address, work=fake) == []
    thread.join()
    assert started(log).count(killed[0]) == 2
    said = [line.split(":")[0] for line in capsys.readouterr().out.splitlines() if line.startswith("case-")]
    assert sorted(said) == names
    assert visible(out) == complete(*names)
    assert [row["case"] for row in pq.read_table(out / "cases.parquet").to_pylist()] == names
    before = len(started(log))
    assert batch.run_many(cases, out, scheduler=cluster.scheduler_address, work=fake) == []
    assert len(started(log)) == before


def test_on_a_cluster_too_bad_cases_are_named_and_the_others_are_complete(cluster, cases, tmp_path, capsys):
    tell(cases[0], do="raise")
    (cases[2] / "robot.toml").unlink()
    assert batch.run_many(cases, tmp_path / "out", scheduler=cluster.scheduler_address, work=fake) == ["one", "three"]
    assert visible(tmp_path / "out") == complete("two")
    said = capsys.readouterr().err
    assert "one: internal error at batch_work.py" in said and "robot.toml" in said


def test_cluster_processes_and_a_single_call_give_the_same_bytes(cluster, cases, tmp_path):
    """The real diagnosis, on two threads, in a pool of processes, and on a cluster."""
    batch.run_one(cases[0], tmp_path / "single", quick=True, jobs=2)
    assert batch.run_many(cases[:2], tmp_path / "many", quick=True, jobs=2) == []
    assert batch.run_many(cases[:1], tmp_path / "cluster", quick=True, scheduler=cluster.scheduler_address) == []
    places = [tmp_path / "single", tmp_path / "many" / "one", tmp_path / "cluster" / "one"]
    assert len({(place / "diagnosis.json").read_bytes() for place in places}) == 1
    # But for its date, and for the paths in its commands.
    pages = [(place / "report.html").read_text() for place in places]
    assert len({unplaced(page) for page in pages}) == 1
    assert all(f"--out {place}" in page for place, page in zip(places, pages, strict=True))


def test_a_blind_check_is_answered_on_a_cluster(cluster, tmp_path):
    out, script = tmp_path / "check", tmp_path / "silent.py"
    seal.make(out, 3, ["none"], ["planar"], seed=5, jobs=1)
    script.write_text(
        "import pathlib, sys\nout = pathlib.Path(sys.argv[3])\nout.mkdir()\n(out / 'diagnosis.json').write_text('{}')\n"
    )
    ledger = seal.answer(out, command=[sys.executable, str(script)], scheduler=cluster.scheduler_address)
    assert sorted(entry["case"] for entry in ledger) == ["case-001", "case-002", "case-003"]
    assert all(entry["status"] == 0 for entry in ledger)
    seal.open_truths(out)


@pytest.mark.parametrize(
    "address",
    [
        "",
        "host",
        "host:8786",
        "tcp://host",
        "tcp://:8786",
        "tcp://host:0",
        "tcp://host:99999",
        "udp://host:1",
        "inproc://1/2/3",
        "http://host:80",
        "tcp://a b:1",
        "tcp://h:1/x",
        "\x1b[31m",
    ],
)
def test_what_is_no_address_is_refused_before_anything_is_asked(cases, tmp_path, monkeypatch, address):
    monkeypatch.setattr("socket.create_connection", lambda *a, **k: pytest.fail("asked"))
    needed = r"is not an address of a scheduler, tcp://host:8786 or tls://host:8786 is needed"
    with pytest.raises(InputError, match=needed):
        batch.run_many(cases, tmp_path / "out", scheduler=address, work=fake)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "tls://127.0.0.1:1", "tcp://no-such-host.invalid:8786"])
def test_an_address_where_nobody_answers_is_said_in_one_line(cases, tmp_path, capfd, address):
    with pytest.raises(LinkError, match=f"^scheduler {address}: does not answer") as caught:
        batch.run_many(cases, tmp_path / "out", scheduler=address, work=fake)
    assert "\n" not in str(caught.value) and capfd.readouterr().err == ""
    assert not (tmp_path / "out").exists()


def test_where_all_is_done_no_cluster_is_asked(cases, tmp_path):
    assert batch.run_many(cases, tmp_path / "out", jobs=1, work=fake) == []
    assert batch.run_many(cases, tmp_path / "out", scheduler="tcp://127.0.0.1:1", work=fake) == []


def test_somebody_who_says_nothing_at_the_address_is_given_up(cases, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr("rtds_host.workers.CONNECT_S", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(LinkError, match=f"^scheduler {address}: does not answer"):
            batch.run_many(cases, tmp_path / "out", scheduler=address, work=fake)
    assert "Traceback" not in capfd.readouterr().err


def certificates(place: Path) -> dict[str, str]:
    """Dask's configuration with a CA and a certificate of its own."""
    key = "-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes"
    for command in (
        f"req -x509 {key} -days 2 -subj /CN=ca -keyout ca.key -out ca.pem",
        f"req {key} -subj /CN=localhost -keyout host.key -out host.csr",
        "x509 -req -in host.csr -CA ca.pem -CAkey ca.key -CAcreateserial -days 2 -out host.pem",
    ):
        subprocess.run(["openssl", *command.split()], cwd=place, check=True, capture_output=True)
    files = {"cert": str(place / "host.pem"), "key": str(place / "host.key")}
    return {
        "distributed.comm.require-encryption": True,
        "distributed.comm.tls.ca-file": str(place / "ca.pem"),
        **{
            f"distributed.comm.tls.{role}.{kind}": path
            for role in ("scheduler", "worker", "client")
            for kind, path in files.items()
        },
    }


@pytest.mark.skipif(shutil.which("openssl") is None, reason="makes certificates with openssl")
def test_over_tls_with_certificates_and_not_without(cases, tmp_path, capfd):
    configuration = certificates(tmp_path)
    with (
        dask.config.set(configuration),
        LocalCluster(
            n_workers=1, threads_per_worker=1, dashboard_address=None, protocol="tls://", security=Security()
        ) as cluster,
    ):
        address = cluster.scheduler_address
        assert address.startswith("tls://")
        assert batch.run_many(cases, tmp_path / "out", scheduler=address, work=fake) == []
        capfd.readouterr()
        with (
            dask.config.set({"distributed.comm.tls.client.cert": None, "distributed.comm.tls.client.key": None}),
            pytest.raises(InputError, match=f"^--scheduler {address}: no certificate of this machine is configured"),
        ):
            batch.run_many(cases, tmp_path / "no", scheduler=address, work=fake)
        with (
            dask.config.set({"distributed.comm.tls.client.key": str(tmp_path / "gone")}),
            pytest.raises(InputError, match=f"^--scheduler {address}: the certificate of this machine cannot be used"),
        ):
            batch.run_many(cases, tmp_path / "no", scheduler=address, work=fake)
        with pytest.raises(LinkError, match="^scheduler tcp://.*: does not answer"):
            batch.run_many(cases, tmp_path / "no", scheduler=address.replace("tls", "tcp"), work=fake)
    gc.collect()
    assert capfd.readouterr().err == ""
    assert visible(tmp_path / "out") == complete(*NAMES) and not visible(tmp_path / "no")


SCHEDULER = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    sys.path.insert(0, {tests!r})
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


def test_a_scheduler_that_is_killed_ends_it_in_one_line_and_the_next_call_goes_on(cases, tmp_path, capfd):
    """By the clock of the watch: two seconds without it, whatever Dask would still try."""
    script, log, out = tmp_path / "scheduler.py", tmp_path / "log", tmp_path / "out"
    tests = str(Path(__file__).parent)
    script.write_text(SCHEDULER.format(tests=tests))
    scheduler = subprocess.Popen(
        [sys.executable, str(script)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([tests, *sys.path])},
    )
    try:
        address = scheduler.stdout.readline().strip()
        tell(cases[0], log=str(log), wait=0.0)
        for case in cases[1:]:
            tell(case, log=str(log), wait=60)

        def kill():
            while not {"two", "three"} <= set(started(log)) or not (out / "one" / "report.html").exists():
                time.sleep(0.01)
            os.killpg(scheduler.pid, signal.SIGKILL)

        thread = threading.Thread(target=kill)
        thread.start()
        with pytest.raises(LinkError, match=f"^scheduler {address}: is gone") as caught:
            batch.run_many(cases, out, scheduler=address, work=fake)
        thread.join()
    finally:
        with suppress(ProcessLookupError):
            os.killpg(scheduler.pid, signal.SIGKILL)
        scheduler.wait()
    assert "\n" not in str(caught.value)
    assert "Traceback" not in capfd.readouterr().err
    assert visible(out) == {"one/diagnosis.json", "one/report.html"}
    for case in cases[1:]:
        tell(case, log=str(log))
    assert batch.run_many(cases, out, jobs=1, work=fake) == []
    assert visible(out) == complete(*NAMES)


def test_only_names_of_installed_functions_are_sent():
    def local():
        return 1

    for function in (local, lambda: 1):
        with pytest.raises(ValueError, match="is not to be found by its name on a worker"):
            next(on_cluster(function, {"a": tuple}, "tcp://127.0.0.1:1"))
