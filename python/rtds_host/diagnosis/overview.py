"""Many diagnoses in one place: a row a case for a Parquet table, and a page to sort and open reports from."""

from __future__ import annotations

import io
from html import escape
from importlib import resources
from urllib.parse import quote

import pyarrow as pa
import pyarrow.parquet as pq

from rtds_host.diagnosis.report.words import effect_name, number, parameter_name, percent, unit_of, value_words

_PARAMETER = pa.struct(
    [
        ("effect", pa.string()),
        ("side", pa.string()),
        ("name", pa.string()),
        ("value", pa.float64()),
        ("low", pa.float64()),
        ("high", pa.float64()),
    ]
)
SCHEMA = pa.schema(
    [
        pa.field("case", pa.string(), nullable=False),
        pa.field("verdict", pa.string()),
        pa.field("effects", pa.list_(pa.string())),
        pa.field("sides", pa.list_(pa.string())),
        pa.field("subsystems", pa.list_(pa.string())),
        pa.field("probabilities", pa.list_(pa.float64())),
        pa.field("parameters", pa.list_(_PARAMETER)),
        pa.field("probability", pa.float64()),
        pa.field("gap_before", pa.float64()),
        pa.field("gap_refit", pa.float64()),
        pa.field("gap_after", pa.float64()),
        pa.field("closed", pa.float64()),
        pa.field("effect_closed", pa.float64()),
        pa.field("seconds", pa.float64()),
        pa.field("error", pa.string()),
    ]
)


def row_of(name: str, diagnosis: dict | None, seconds: float | None, error: str | None = None) -> dict:
    """A case's row: null in every column but `case` and `error` where the case failed.

    `probability` is the first alternative's, the explanation that was chosen as a whole; `probabilities` are the
    effects', in the order of `effects`. `low` and `high` of a parameter bound its 90 % interval.
    """
    row = dict.fromkeys(SCHEMA.names)
    row.update(case=name, error=error, seconds=None if seconds is None else round(seconds, 2))
    if diagnosis is None:
        return row
    effects, gap = diagnosis["effects"], diagnosis["gap"]
    parameters = []
    for effect in effects:
        for parameter, entry in effect["parameters"].items():
            low, high = entry["ci90"] or (None, None)
            parameters.append(
                {
                    "effect": effect["id"],
                    "side": effect["side"],
                    "name": parameter,
                    "value": entry["value"],
                    "low": low,
                    "high": high,
                }
            )
    row.update(
        verdict=diagnosis["verdict"],
        effects=[e["id"] for e in effects],
        sides=[e["side"] for e in effects],
        subsystems=[e["subsystem"] for e in effects],
        probabilities=[e["probability"] for e in effects],
        parameters=parameters,
        probability=(diagnosis["alternatives"] or [{}])[0].get("probability"),
        gap_before=gap["before"],
        gap_refit=gap["refit"],
        gap_after=gap["after"],
        closed=gap["closed"],
        effect_closed=gap["effect_closed"],
    )
    return row


def table_bytes(rows: list[dict]) -> bytes:
    """The rows as a Parquet file."""
    stream = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(rows, schema=SCHEMA), stream, compression="zstd")
    return stream.getvalue()


_SCRIPT = """
const table = document.getElementById("cases");
table.querySelectorAll("th").forEach((head, column) => {
  head.tabIndex = 0;
  const sort = () => {
    const up = head.getAttribute("aria-sort") !== "ascending";
    table.querySelectorAll("th").forEach(h => h.removeAttribute("aria-sort"));
    head.setAttribute("aria-sort", up ? "ascending" : "descending");
    const key = row => row.cells[column].dataset.v;
    const rows = [...table.tBodies[0].rows].sort((a, b) => {
      const x = key(a), y = key(b);
      if (x === "" || y === "") return (x === "") - (y === "");
      const order = head.classList.contains("n") ? x - y : x.localeCompare(y, "en", {numeric: true});
      return up ? order : -order;
    });
    table.tBodies[0].append(...rows);
  };
  head.addEventListener("click", sort);
  head.addEventListener("keydown", event => { if (event.key === "Enter") sort(); });
});
"""
# Layout: cases that make a trend.
TREND = 3
_STYLE = """
.trends { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 360px), 1fr)); gap: 8px 20px; }
main { max-width: 1400px; }
th { cursor: pointer; user-select: none; } th[aria-sort]::after { content: " \\25B4"; }
th[aria-sort="descending"]::after { content: " \\25BE"; }
"""
_COLUMNS = (
    ("case", False),
    ("verdict", False),
    ("named", False),
    ("probable", True),
    ("gap, nominal", True),
    ("refitted", True),
    ("with effects", True),
    ("closed", True),
    ("seconds", True),
    ("error", False),
)


def _cells(row: dict) -> list[tuple[str, str]]:
    """(what is shown, what is sorted by) a column; "" sorts last."""

    def figure(value: float | None, show) -> tuple[str, str]:
        return ("", "") if value is None else (escape(show(value)), repr(value))

    if row["error"] is not None:
        name = escape(row["case"])
        return [
            (name, name),
            ('<span class="fatal">failed</span>', "~failed"),
            ("", ""),
            *[("", "")] * 6,
            (escape(row["error"]), escape(row["error"])),
        ]
    included = []
    for effect, side in zip(row["effects"], row["sides"]):
        values = ", ".join(
            f"{p['name']} = "
            + value_words(
                effect, p["name"], {"value": p["value"], "ci90": None if p["low"] is None else [p["low"], p["high"]]}
            )
            for p in row["parameters"]
            if (p["effect"], p["side"]) == (effect, side)
        )
        included.append(
            f'{escape(effect_name({"id": effect, "side": side}))} <span class="soft small">{escape(values)}</span>'
        )
    name, verdict = row["case"], row["verdict"]
    return [
        (f'<a href="{quote(name)}/report.html">{escape(name)}</a>', escape(name)),
        (f'<span class="badge {verdict}">{verdict}</span>', verdict),
        ("<br>".join(included), escape(" ".join(row["effects"]))),
        figure(row["probability"], percent),
        figure(row["gap_before"], number),
        figure(row["gap_refit"], number),
        *(
            figure(row[name], show) if included else ("", "")
            for name, show in (("gap_after", number), ("closed", percent))
        ),
        figure(row["seconds"], lambda s: f"{s:.1f}"),
        ("", ""),
    ]


def _trend(title: str, unit: str, points: list[tuple[int, str, float, float | None, float | None]], count: int) -> str:
    """Values over the cases in their order as SVG; points: place, case, value and the ends of its interval."""
    wide, tall, left, edge = 440.0, 150.0, 66.0, 14.0
    ends = [v for _, _, value, low, high in points for v in (value, low, high) if v is not None]
    bottom, top = min(ends), max(ends)
    pad = 0.1 * (top - bottom) or 0.5 * abs(top) or 1.0
    bottom, top = bottom - pad, top + pad

    def px(k: int) -> float:
        return left + (k + 0.5) / count * (wide - left - edge)

    def py(v: float) -> float:
        return edge + (top - v) / (top - bottom) * (tall - 2 * edge)

    parts = [
        f'<line class="grid" x1="{left}" x2="{wide - edge}" y1="{py(v):.1f}" y2="{py(v):.1f}"/>'
        f'<text x="{left - 6}" y="{py(v) + 4:.1f}" text-anchor="end">{number(v)}</text>'
        for v in (min(ends), max(ends))
    ]
    for k, case, value, low, high in points:
        if low is not None and high is not None:
            parts.append(
                f'<line x1="{px(k):.1f}" x2="{px(k):.1f}" y1="{py(low):.1f}" y2="{py(high):.1f}" '
                'stroke="var(--after)"/>'
            )
        parts.append(
            f'<circle class="curve" cx="{px(k):.1f}" cy="{py(value):.1f}" r="4"><title>{escape(case)}: {number(value)} '
            f"{escape(unit)}</title></circle>"
        )
    said = f"{title}: " + "; ".join(f"{case} {number(value)}" for _, case, value, _, _ in points)
    return (
        f'<figure class="trend"><h3>{escape(title)}{escape(f" [{unit}]" if unit else "")}</h3><svg class="form" '
        f'viewBox="0 0 {wide:g} {tall:g}" role="img" aria-label="{escape(said)}">{"".join(parts)}</svg></figure>'
    )


def _trends(rows: list[dict]) -> str:
    """The gap and each size over the cases in the order of the command line: cases named by day show what drifts."""
    found: dict[tuple[str, str, str], list[tuple[int, str, float, float | None, float | None]]] = {}
    done = [(k, row) for k, row in enumerate(rows) if row["error"] is None]
    for k, row in done:
        for p in row["parameters"]:
            key = (p["effect"], p["side"], p["name"])
            found.setdefault(key, []).append((k, row["case"], p["value"], p["low"], p["high"]))
    drawn = [
        _trend(
            f"{effect_name({'id': effect, 'side': side})}: {parameter_name(name)}",
            unit_of(effect, name),
            points,
            len(rows),
        )
        for (effect, side, name), points in found.items()
        if len(points) >= TREND
    ]
    gaps: list[tuple[int, str, float, float | None, float | None]] = [
        (k, row["case"], row["gap_refit"], None, None) for k, row in done if row["gap_refit"] is not None
    ]
    if len(gaps) >= TREND:
        drawn.insert(0, _trend("gap with motor values refitted", "", gaps, len(rows)))
    if not drawn:
        return ""
    return (
        '<section id="trends"><h2>Over the cases, in their order</h2><p class="soft small">A dot a case, from '
        "left to right; "
        f'lines are 90 % intervals.</p><div class="trends">{"".join(drawn)}</div></section>'
    )


def overview_page(rows: list[dict]) -> str:
    """`index.html`: all cases in one self-contained page; a click on a column's head sorts by it."""
    style = resources.files("rtds_host.diagnosis.report").joinpath("style.css").read_text(encoding="utf-8")
    verdicts = {v: sum(r["verdict"] == v for r in rows) for v in ("known", "partial", "unknown", "none")}
    failed = sum(r["error"] is not None for r in rows)
    figures = [(len(rows), "cases"), *[(n, v) for v, n in verdicts.items()], (failed, "failed")]
    head = "".join(f"<th{' class=n' if n else ''}>{escape(title)}</th>" for title, n in _COLUMNS)
    body = "\n".join(
        "<tr>"
        + "".join(
            f'<td{" class=n" if n else ""} data-h="{escape(title)}" data-v="{key}">{shown}</td>'
            for (shown, key), (title, n) in zip(_cells(row), _COLUMNS, strict=True)
        )
        + "</tr>"
        for row in rows
    )
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="viewport" '
        'content="width=device-width, initial-scale=1"><title>Diagnoses</title><link rel="icon" href="data:,">\n'
        f"<style>{style}{_STYLE}</style></head><body><main><section><h1>Diagnoses</h1>"
        '<div class="figures">'
        + "".join(f"<div><b>{n}</b><span>{escape(word)}</span></div>" for n, word in figures)
        + f'</div></section>\n<section style="overflow-x:auto"><table id="cases"><thead><tr>{head}</tr></thead>'
        f"<tbody>\n{body}\n</tbody></table></section>\n{_trends(rows)}"
        '<p class="soft small">The same rows, with every parameter, '
        "are in cases.parquet.</p></main>\n"
        f"<script>{_SCRIPT}</script></body></html>\n"
    )
