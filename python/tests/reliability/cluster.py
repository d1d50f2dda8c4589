"""A Dask cluster over TLS on named hosts, and what becomes of its parts: `python cluster.py`.

Four hosts, each with a network of its own (Linux namespaces, which go with this program): `head` has the scheduler,
`node1` and `node2` a worker each, `desk` calls `rtds diagnose`. Started by the lines of docs/many-cases.md, with
certificates that openssl makes. It looks at what a call gives, at how long one waits for a refusal, and at which ports
it listens. Needs Linux with iproute2, util-linux and openssl, and either root or user namespaces.
"""

from __future__ import annotations

import argparse
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from kills import make_inputs, starved_s

from rtds_host.diagnosis.report.html import unplaced

DOMAIN = "example.net"
HOSTS = ("head", "node1", "node2", "desk")
ADDRESS = f"tls://head.{DOMAIN}:8786"
INSIDE = "RTDS_CLUSTER_INSIDE"
# A refusal, once the program is loaded, and the end of a call whose scheduler has died.
PATIENCE_S = 5.0
FILES = ("diagnosis.json", "report.html")
LISTENS = "0A"  # state of a socket in /proc/net/tcp


def inside() -> None:
    """Begin this program again with networks, mounts and processes of its own: nothing of it stays."""
    user = [] if os.geteuid() == 0 else ["--user", "--map-root-user"]
    os.environ[INSIDE] = "1"
    os.execvp(
        "unshare",
        [
            "unshare",
            *user,
            "--net",
            "--mount",
            "--pid",
            "--mount-proc",
            "--fork",
            "--kill-child",
            sys.executable,
            *sys.argv,
        ],
    )


def call(*command: str, **options) -> None:
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, **options)


def make_network() -> None:
    """A bridge with the hosts at it, and their names."""
    call("mount", "-t", "tmpfs", "tmpfs", "/run")
    names = "127.0.0.1 localhost\n" + "".join(
        f"10.77.0.{k} {h}.{DOMAIN}\n" for k, h in enumerate((*HOSTS, "nobody"), 1)
    )
    Path("/run/hosts").write_text(names)
    call("mount", "--bind", "/run/hosts", "/etc/hosts")
    call("ip", "link", "add", "br0", "type", "bridge")
    call("ip", "link", "set", "br0", "up")
    for k, host in enumerate(HOSTS, 1):
        call("ip", "netns", "add", host)
        call("ip", "link", "add", f"to-{host}", "type", "veth", "peer", "name", "eth0", "netns", host)
        call("ip", "link", "set", f"to-{host}", "master", "br0", "up")
        call("ip", "-n", host, "addr", "add", f"10.77.0.{k}/24", "dev", "eth0")
        call("ip", "-n", host, "link", "set", "eth0", "up")
        call("ip", "-n", host, "link", "set", "lo", "up")


def make_certificates(place: Path, authority: str, *hosts: str) -> None:
    """A CA, and a key with a certificate for each host."""
    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes")
    quiet = {"cwd": place, "stderr": subprocess.DEVNULL}
    call(
        "openssl",
        "req",
        "-x509",
        *key,
        "-days",
        "30",
        "-subj",
        f"/CN={authority}",
        "-keyout",
        f"{authority}.key",
        "-out",
        f"{authority}.pem",
        **quiet,
    )
    for host in hosts:
        call(
            "openssl",
            "req",
            *key,
            "-subj",
            f"/CN={host}.{DOMAIN}",
            "-keyout",
            f"{host}.key",
            "-out",
            f"{host}.csr",
            **quiet,
        )
        call(
            "openssl",
            "x509",
            "-req",
            "-in",
            f"{host}.csr",
            "-CA",
            f"{authority}.pem",
            "-CAkey",
            f"{authority}.key",
            "-CAcreateserial",
            "-days",
            "30",
            "-out",
            f"{host}.pem",
            **quiet,
        )


def security(place: Path, host: str, authority: str = "ca") -> dict[str, str]:
    """The environment that docs/many-cases.md asks for, of one machine."""
    pairs = {
        f"{role}__{kind}": str(place / f"{host}.{end}")
        for role in ("SCHEDULER", "WORKER", "CLIENT")
        for kind, end in (("CERT", "pem"), ("KEY", "key"))
    }
    return {
        "DASK_DISTRIBUTED__COMM__REQUIRE_ENCRYPTION": "true",
        "DASK_DISTRIBUTED__COMM__TLS__CA_FILE": str(place / f"{authority}.pem"),
        **{f"DASK_DISTRIBUTED__COMM__TLS__{name}": value for name, value in pairs.items()},
    }


class Bench:
    """The hosts, with cases on the desk; `complaints` grows with what must not be."""

    def __init__(self, place: Path):
        self.place, self.complaints = place, []
        make_network()
        make_certificates(place, "ca", *HOSTS)
        make_certificates(place, "other", "stranger")
        make_inputs(place)
        self.cases = [place / name for name in ("one", "two")]
        for k in range(4):
            self.cases.append(place / f"more-{k}")
            shutil.copytree(place / "two", self.cases[-1])

    def start(self, host: str, *command: str, environment: dict[str, str] | None = None, **pipes) -> subprocess.Popen:
        plain = {name: value for name, value in os.environ.items() if not name.startswith("DASK_")}
        extra = security(self.place, host) if environment is None else environment
        return subprocess.Popen(
            ["ip", "netns", "exec", host, *command],
            env={**plain, **extra},
            cwd=self.place,
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            text=True,
            **pipes,
        )

    def dask(self, host: str, ready: str, *arguments: str) -> subprocess.Popen:
        """A scheduler or worker, once it has logged that it is ready: on a busy machine that takes its time."""
        path = self.place / f"{host}.log"
        with open(path, "a") as log:
            before = path.stat().st_size
            process = self.start(host, sys.executable, "-m", "dask", *arguments, stdout=log, stderr=log)
        while ready not in path.read_text()[before:]:
            if process.poll() is not None:
                raise SystemExit(f"{host}: dask {arguments[0]} has ended: {path.read_text()[-500:]}")
            time.sleep(0.1)
        return process

    def scheduler(self) -> subprocess.Popen:
        return self.dask(
            "head", "Scheduler at:", "scheduler", "--protocol", "tls", "--host", f"head.{DOMAIN}", "--no-dashboard"
        )

    def worker(self, node: str) -> subprocess.Popen:
        return self.dask(
            node,
            "Registered to:",
            "worker",
            ADDRESS,
            "--protocol",
            "tls",
            "--host",
            f"{node}.{DOMAIN}",
            "--nworkers",
            "1",
            "--nthreads",
            "1",
            "--no-dashboard",
        )

    def rtds(
        self,
        out: str,
        *more: str,
        environment: dict[str, str] | None = None,
        meanwhile: Callable[[subprocess.Popen], None] = lambda process: None,
    ) -> tuple[int, str, str, float]:
        """(status, standard output, standard error, seconds) of `rtds diagnose` on the desk.

        On a busy machine the seconds in which nobody lets it run do not count.
        """
        began = time.monotonic()
        process = self.start(
            "desk",
            sys.executable,
            "-m",
            "rtds_host.cli.main",
            "diagnose",
            *map(str, self.cases),
            "--quick",
            "--out",
            out,
            *more,
            environment=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        meanwhile(process)
        if process.returncode is None:  # else `meanwhile` has met its end
            os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
        seconds = time.monotonic() - began - starved_s([str(process.pid)])
        said, errors = process.communicate()
        return process.returncode, said, errors, seconds

    def expect(self, what: str, right: bool, why: object = "") -> None:
        print(f"{'right' if right else 'WRONG'}: {what}" + (f" ({why})" if why else ""), flush=True)
        if not right:
            self.complaints.append(what)

    def same(self, out: str) -> bool:
        """Whether the results are those of the call without a cluster, but for date and paths in the report."""

        def content(place: Path) -> str:
            return unplaced(place.read_text(encoding="utf-8"))

        return all(
            content(self.place / out / case.name / file) == content(self.place / "alone" / case.name / file)
            for case in self.cases
            for file in FILES
        )

    def done(self, out: str) -> int:
        return len(list((self.place / out).glob("*/report.html")))

    def until_done(self, out: str, count: int, process: subprocess.Popen) -> None:
        while self.done(out) < count and process.poll() is None:
            time.sleep(0.02)


def end(process: subprocess.Popen) -> None:
    """As a machine goes down: the process and all that it started, at once."""
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def listening(process: subprocess.Popen) -> set[str]:
    """Ports at which somebody listens in a process's network."""
    found = set()
    for table in ("tcp", "tcp6"):
        try:
            lines = Path(f"/proc/{process.pid}/net/{table}").read_text().splitlines()[1:]
        except OSError:
            continue  # it has just ended
        for line in lines:
            _, local, _, state = line.split()[:4]
            if state == LISTENS:
                found.add(local)
    return found


def refusals(bench: Bench) -> None:
    """What cannot be reached, or must not be, is one line in seconds."""
    *_, loaded = bench.rtds("refused", "--scheduler", "nonsense")
    stranger = {**security(bench.place, "stranger", "other")}
    for what, address, environment in (
        ("no such name", f"tls://no-such-host.{DOMAIN}:8786", None),
        ("a host that is down", f"tls://nobody.{DOMAIN}:8786", None),
        ("a port at which nobody listens", f"tls://node1.{DOMAIN}:1", None),
        ("a worker's host in place of the scheduler's", f"tls://node1.{DOMAIN}:8786", None),
        ("no certificate", ADDRESS, {}),
        ("plain tcp", ADDRESS.replace("tls", "tcp"), {}),
        ("a certificate of another CA", ADDRESS, stranger),
    ):
        status, _, said, seconds = bench.rtds("refused", "--scheduler", address, environment=environment)
        line = said.splitlines()
        bench.expect(
            f"{what}: one line, status 2, in {seconds - loaded:.1f} s",
            status == 2
            and len(line) == 1
            and line[0].startswith("rtds: ")
            and address in line[0]
            and "internal error" not in said
            and seconds - loaded < PATIENCE_S
            and not (bench.place / "refused" / "index.html").exists(),
            said.strip(),
        )


def main() -> int:
    """Run it; 1 if anything is not as it must be."""
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    if INSIDE not in os.environ:
        inside()
    with tempfile.TemporaryDirectory(prefix="cluster-") as folder:
        bench = Bench(Path(folder))
        status, *_ = bench.rtds("alone", "--jobs", "1", environment={})
        bench.expect("without a cluster", status == 0)

        scheduler = bench.scheduler()
        workers = {node: bench.worker(node) for node in ("node1", "node2")}
        ports: set[str] = set()

        def look(process: subprocess.Popen) -> None:
            while bench.done("cluster") < 2 and process.poll() is None:
                ports.update(listening(process))
                time.sleep(0.1)

        status, _, said, seconds = bench.rtds("cluster", "--scheduler", ADDRESS, meanwhile=look)
        bench.expect(
            f"over TLS on named hosts, {len(bench.cases)} cases in {seconds:.0f} s: the same bytes as without a"
            " cluster",
            status == 0 and said == "" and bench.same("cluster"),
            said,
        )
        bench.expect("the caller listens at no port", not ports, ports)
        refusals(bench)

        def lose_worker(process: subprocess.Popen) -> None:
            bench.until_done("lost worker", 1, process)
            end(workers["node1"])

        status, _, said, _ = bench.rtds("lost worker", "--scheduler", ADDRESS, meanwhile=lose_worker)
        bench.expect(
            "a host with a worker goes down in the middle: all cases complete, the same bytes",
            status == 0 and said == "" and bench.same("lost worker"),
            said,
        )

        workers["node1"] = bench.worker("node1")
        ended: list[float] = []

        def lose_scheduler(process: subprocess.Popen) -> None:
            bench.until_done("lost scheduler", 1, process)
            end(scheduler)
            ended.extend((time.monotonic(), starved_s([str(process.pid)])))
            os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)
            ended.append(time.monotonic() - starved_s([str(process.pid)]))

        status, _, said, _ = bench.rtds("lost scheduler", "--scheduler", ADDRESS, meanwhile=lose_scheduler)
        after = ended[2] - (ended[0] - ended[1])
        bench.expect(
            f"the scheduler goes down in the middle: one line, status 2, {after:.1f} s later",
            status == 2 and len(said.splitlines()) == 1 and "is gone" in said and after < PATIENCE_S,
            said.strip(),
        )
        kept = bench.done("lost scheduler")
        for process in workers.values():
            end(process)
        scheduler = bench.scheduler()
        workers = {node: bench.worker(node) for node in workers}
        status, said, errors, _ = bench.rtds("lost scheduler", "--scheduler", ADDRESS)
        bench.expect(
            "the same command goes on with a new scheduler",
            status == 0
            and errors == ""
            and bench.same("lost scheduler")
            and f"{kept} of {len(bench.cases)} cases are done already" in said,
            errors,
        )
        for process in (*workers.values(), scheduler):
            end(process)
        status, _, said, _ = bench.rtds("nobody", "--scheduler", ADDRESS)
        bench.expect("nobody there any more: one line", status == 2 and len(said.splitlines()) == 1, said.strip())
    print(f"{len(bench.complaints)} complaints")
    return 1 if bench.complaints else 0


if __name__ == "__main__":
    sys.exit(main())
