"""In place of a diagnosis: importable by other processes, and cheap."""

import json
import os
import signal
import time


def fake(case, quick, threads):
    """What a case does is said in the notes of its runs; each start is noted in a file, which all processes share."""
    # Not above: it takes a second, and not every job in here needs it.
    from diagnosis_cases import example_diagnosis

    order = json.loads(case.runs[0].meta.notes or "{}")
    if "log" in order:
        with open(order["log"], "a", encoding="ascii") as stream:
            stream.write(f"{case.name} {os.getpid()}\n")
    if "wait" in order:
        time.sleep(order["wait"])
    if order.get("do") == "raise":
        raise ZeroDivisionError("nothing to divide by")
    if order.get("do") == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    return example_diagnosis(), f"<p>{case.name} {quick}</p>", 1.0


def by_number(number):
    """The square; three kills its process."""
    if number == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def in_trouble(kind):
    """The kind itself, where it is no trouble."""
    if kind == "memory":
        raise MemoryError
    if kind == "die":
        os.kill(os.getpid(), signal.SIGKILL)
    if kind == "no file":
        open("/no/such/file").close()
    return kind
