"""What the gate says of a case: findings, each one line, and the case as it may be used."""

from __future__ import annotations

from dataclasses import dataclass

from rtds_host.contract import Case

SEVERITIES = ("note", "warning", "fatal")
# Layout: runs that are each told the same; of more one is told for all.
LISTED = 4


@dataclass(frozen=True)
class Finding:
    """One thing about the data: `run` and `channel` may be empty (all of them); `text` is a whole sentence.

    `share` is the share of the rows (of a channel: of its samples) that it concerns, 0 where it concerns no rows.
    """

    run: str
    channel: str
    kind: str
    severity: str
    text: str
    share: float = 0.0


@dataclass(frozen=True)
class Timing:
    """What was measured of a case's clock.

    step_s : median time between samples of the wheels, s.
    jitter_s : one standard deviation of the stamps about an even clock, s; 0 where rows are uneven but not back and
        forth, as those of an event-driven logger.
    stamps_s : one standard deviation of how far the stamps are off by what the angles say, s.
    lag_s : channel -> how much later than the nominal robot it answers the command, s (negative: earlier); only
        channels for which it is certain. Effects, sensors and clocks together; a lag of 0 is reported as 0.
    command_step_s : median time between changes of a command, s; NaN where none changes twice.
    commands_enough : whether commands are rare enough changes, or logged often enough, to be replayed.
    """

    step_s: float
    jitter_s: float
    stamps_s: float
    lag_s: dict[str, float]
    command_step_s: float
    commands_enough: bool


@dataclass(frozen=True)
class Gate:
    """Findings of a case, worst first, and what follows from them.

    case : the case to diagnose: samples set aside are NaN, runs are cut at holes, and its robot's noise has what
    rounding adds. noise_ratio : the noise that samples show, less rounding, over the declared one, see `sample_noise`.
    """

    findings: tuple[Finding, ...]
    case: Case
    noise_ratio: float = 1.0
    timing: Timing | None = None

    def of(self, kind: str) -> tuple[Finding, ...]:
        """Findings of one kind."""
        return tuple(f for f in self.findings if f.kind == kind)

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """Findings that may spoil the result."""
        return tuple(f for f in self.findings if f.severity != "note")


def merged(found: list[Finding], runs: int) -> list[Finding]:
    """One finding in place of the same in every run (of `runs`), or in more than `LISTED`."""
    groups: dict[tuple[str, str, str], list[Finding]] = {}
    for f in found:
        groups.setdefault((f.channel, f.kind, f.severity), []).append(f)
    result = []
    for group in groups.values():
        names = list(dict.fromkeys(f.run for f in group))
        if runs > 1 and len(names) == runs or len(names) > LISTED:
            worst = max(group, key=lambda f: f.share)
            where = "every run" if len(names) == runs else f"{len(names)} of {runs} runs"
            result.append(
                Finding(
                    "",
                    worst.channel,
                    worst.kind,
                    worst.severity,
                    f"In {where}, as in {worst.run}: {worst.text}",
                    worst.share,
                )
            )
        else:
            result += group
    return result


def percent(share: float) -> str:
    """A share as text, with two digits and never 0 for what is there."""
    return f"{100 * share:.0f} %" if share >= 0.0995 else f"{100 * share:.2g} %"
