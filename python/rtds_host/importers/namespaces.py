"""Topics that a recording has under a robot's namespace, as /tb3_0/odom for /odom."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from rtds_host.errors import InputError
from rtds_host.importers.mapping import Mapping


def mapped_topics(mapping: Mapping) -> set[str]:
    """All topics that a mapping names."""
    found = {source.topic for sources in mapping.signals.values() for source in sources}
    if mapping.twist is not None:
        found.add(mapping.twist.topic)
    return {topic for topic in found if topic}


def within(mapping: Mapping, namespace: str) -> Mapping:
    """The mapping with all its topics under a namespace."""
    signals = {
        channel: tuple(replace(s, topic=namespace + s.topic) if s.topic else s for s in sources)
        for channel, sources in mapping.signals.items()
    }
    twist = mapping.twist
    if twist is not None and twist.topic:
        twist = replace(twist, topic=namespace + twist.topic)
    return replace(mapping, signals=signals, twist=twist)


def find_namespace(path: Path, topics: Iterable[str], mapping: Mapping, asked: str | None = None) -> str:
    """The namespace ("" for none, else "/tb3_0") under which a bag has a mapping's topics.

    Raises
    ------
    InputError : the one asked for is not there; several robots are in the bag, and none was asked for.
    """
    topics, names = set(topics), mapped_topics(mapping)
    counts: dict[str, int] = {}
    for topic in topics:
        for name in names:
            if topic.endswith(name):
                space = topic[: len(topic) - len(name)]
                counts[space] = counts.get(space, 0) + 1
    if asked is not None:
        space = "" if asked in ("", "/") else "/" + asked.strip("/")
        if space not in counts:
            there = ", ".join(sorted(counts) or ["none"])
            raise InputError(
                f"{path}: --namespace {asked}: no topic of the mapping {mapping.name} is there (namespaces: {there})"
            )
        return space
    if not counts or "" in counts:
        return ""
    if len(counts) > 1:
        raise InputError(
            f"{path}: holds the topics of several robots ({', '.join(sorted(counts))}): say which with --namespace"
        )
    return next(iter(counts))
