"""What a recording holds, for who writes a mapping: topics with their fields, columns with their first values."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rtds_host.errors import shown
from rtds_host.importers.bag import Bag, is_bag, refuse_other
from rtds_host.importers.mapping import Mapping
from rtds_host.importers.wpilog import is_wpilog, read_entries
from rtds_host.start.draft import channel_of, header_of, unit_of

# How deep fields of a message are shown, how many of one type; characters of a first row that are looked at.
DEEPEST, MOST_FIELDS, LONGEST_ROW = 4, 60, 2**20


def contents(path: Path) -> Iterator[str]:
    """Lines that say what a bag, a csv file or a data log holds.

    Raises
    ------
    InputError : it cannot be read, or is neither.
    """
    refuse_other(path)
    yield from _topics(path) if is_bag(path) else _columns(path)


def held(path: Path) -> dict[str, Any]:
    """The same for a program: `topics` with their fields, or `columns` with what each may be.

    Raises
    ------
    InputError : it cannot be read, or is neither.
    """
    refuse_other(path)
    if is_bag(path):
        return {"recording": str(path), "topics": _topics_held(path)}
    return {"recording": str(path), "columns": _columns_held(path)}


def _columns_held(path: Path) -> list[dict[str, Any]]:
    if is_wpilog(path):
        return [_held_column(name, f"{values[0]:g}") for name, (_, values) in read_entries(path).items()]
    names, delimiter = header_of(path)
    with open(path, encoding="utf-8-sig", errors="replace") as stream:
        head = stream.read(LONGEST_ROW).splitlines()[:2]
    row = next(csv.reader(head[1:], delimiter=delimiter), [])
    return [_held_column(name, row[k] if k < len(row) else None) for k, name in enumerate(names)]


def _held_column(name: str, first: str | None) -> dict[str, Any]:
    """A column's (or an entry's) name, its first value and what it may be."""
    channel = channel_of(name)
    guess = {"channel": channel, "unit": unit_of(name, channel)} if channel else None
    return {"name": name, "first": first, "guess": guess}


def _topics_held(path: Path) -> list[dict[str, Any]]:
    bag = Bag(path, Mapping(path, ""))
    known = bag.definitions()
    return [
        {
            "name": one.topic,
            "type": one.msgtype,
            "messages": one.msgcount,
            "fields": dict(_fields(known, one.msgtype)[:MOST_FIELDS]),
        }
        for one in sorted(bag.connections, key=lambda c: c.topic)
    ]


def _columns(path: Path) -> Iterator[str]:
    for one in _columns_held(path):
        guess = f"  (guess: {one['guess']['channel']}, {one['guess']['unit']})" if one["guess"] else ""
        first = "missing" if one["first"] is None else shown(one["first"])
        yield f"{path.name}  {shown(one['name'])}  first value {first}{guess}"


def _topics(path: Path) -> Iterator[str]:
    for one in _topics_held(path):
        yield f"{path.name}  {one['name']}  {one['type']}  {one['messages']} messages"
        for name, kind in one["fields"].items():
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
