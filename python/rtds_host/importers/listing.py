"""What a recording holds, for who writes a mapping: topics with their fields, columns with their first values."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

from rtds_host.errors import shown
from rtds_host.importers.bag import Bag, is_bag, refuse_other
from rtds_host.importers.mapping import Mapping
from rtds_host.start.draft import channel_of, header_of, unit_of

# How deep fields of a message are shown, how many of one type; characters of a first row that are looked at.
DEEPEST, MOST_FIELDS, LONGEST_ROW = 4, 60, 2**20


def contents(path: Path) -> Iterator[str]:
    """Lines that say what a bag or a csv file holds.

    Raises
    ------
    InputError : it cannot be read, or is neither.
    """
    refuse_other(path)
    yield from _topics(path) if is_bag(path) else _columns(path)


def _columns(path: Path) -> Iterator[str]:
    names, delimiter = header_of(path)
    with open(path, encoding="utf-8-sig", errors="replace") as stream:
        head = stream.read(LONGEST_ROW).splitlines()[:2]
    row = next(csv.reader(head[1:], delimiter=delimiter), [])
    for k, name in enumerate(names):
        channel = channel_of(name)
        guess = f"  (guess: {channel}, {unit_of(name, channel)})" if channel else ""
        yield f"{path.name}  {shown(name)}  first value {shown(row[k]) if k < len(row) else 'missing'}{guess}"


def _topics(path: Path) -> Iterator[str]:
    bag = Bag(path, Mapping(path, ""))
    known = bag.definitions()
    for one in sorted(bag.connections, key=lambda c: c.topic):
        yield f"{path.name}  {one.topic}  {one.msgtype}  {one.msgcount} messages"
        for name, kind in _fields(known, one.msgtype)[:MOST_FIELDS]:
            yield f"    {name}  {kind}"


def _fields(known: dict, msgtype: str, depth: int = 1) -> list[tuple[str, str]]:
    """Fields of a message by their paths, and their types; none where its definition is not known."""
    found: list[tuple[str, str]] = []
    for name, (node, inner) in known.get(msgtype, ((), ()))[1]:
        listed, kind = "", inner
        if node.name in ("ARRAY", "SEQUENCE"):
            listed, (node, kind) = "[]", inner[0]
        if node.name == "NAME" and not listed and depth < DEEPEST:
            found += [(f"{name}.{below}", of) for below, of in _fields(known, kind, depth + 1)]
        else:
            found.append((name, (kind if node.name == "NAME" else kind[0]) + listed))
        if len(found) > MOST_FIELDS:
            break
    return found
