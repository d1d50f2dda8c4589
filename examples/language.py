"""How long the sentences of the documentation are, and which words of it are private.

    python examples/language.py [PAGE …] [--long] [--help-texts] [--since COMMIT]

prints a row a page: words, sentences, median and largest length of a sentence, private words. Without a page: README,
CONTRIBUTING and all of docs/. `--long` prints each sentence that is too long, `--help-texts` measures what
the program's commands and options say of themselves. `--since` prints each figure at that commit and now.

Counted is what a reader reads as sentences: paragraphs and items of lists. Code, comments and pictures are left out, a
span of code or a figure is one word, a link counts by its text. Cells of tables count for the largest length only: they
are short by themselves, and would make any median small.
"""

from __future__ import annotations

import argparse
import re
import statistics
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MEDIAN, LARGEST = 18, 40
# Everyday words that this project once gave a meaning of its own. A term of the glossary may be used.
PRIVATE = {
    "stands": r"\b(?<!as it )stands?\b(?!-| still\b| out\b| on\b| up\b| upright\b| alone\b)",
    "rest": r"\b(?:the|a|this|that|no|such|large|structured|whose) rest\b(?! of\b)",
    "told apart": r"\b(?:tells?|told|telling) [^.;]{0,40}\bapart\b",
    "twin": r"\btwins?\b",
    "stand-in": r"\bstand-ins?\b",
    "carried": r"\bcarr(?:y|ies|ied) over\b",
    "lanes": r"\blanes?\b",
    "abreast": r"\babreast\b",
    "anew": r"\banew\b",
    "beside": r"\bbesides?\b",
    "slot": r"\bslots?\b",
    "measured machine": r"\bmeasured machines?\b",
    "foretell": r"\bforet(?:ells?|old)\b",
    "blamed": r"\bblam(?:e|es|ed|ing)\b",
    "nameless": r"\bnameless\b",
    "look-alike": r"\blook-alikes?\b",
}
FENCE = re.compile(r"^\s*```")
ITEM = re.compile(r"^\s*(?:[-*]|\d+\.)\s+")
# Points that end no sentence.
SHORT = re.compile(r"\b(?:e\.g|i\.e|cf|vs|approx|Fig|Eq|No|al|St|pp|vol)\.(?=\s)")
END = re.compile(r"(?<=[.!?])[)\"”]?\s+(?=[A-Z`\"“(\[0-9*~→])")
WORD = re.compile(r"[A-Za-zÀ-žΑ-ω0-9]")


@dataclass(frozen=True)
class Sentence:
    """A sentence, where it begins, and whether it is of a table."""

    text: str
    line: int
    table: bool = False

    @property
    def length(self) -> int:
        """Words: what holds a letter or a digit."""
        return sum(bool(WORD.search(word)) for word in self.text.split())


def plain(text: str) -> str:
    """Markdown as read: spans of code one word, links by their text, no marks of emphasis."""
    text = re.sub(r"!\[[^\]]*\]\([^)]*\)", "", text)
    text = re.sub(r"`+[^`]+`+", "`code`", text)
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"<[^>]+>", "", text)
    return SHORT.sub(lambda m: m[0][:-1], text.replace("**", "").replace("*", ""))


def sentences_of(text: str, line: int, table: bool = False) -> list[Sentence]:
    """A paragraph's sentences, without those that hold no word."""
    found = [Sentence(s.strip(), line, table) for s in END.split(" ".join(plain(text).split()))]
    return [s for s in found if s.length]


def sentences(page: str) -> list[Sentence]:
    """All sentences of a page in Markdown, headings and code left out."""
    page = re.sub(r"<!--.*?-->", lambda m: "\n" * m[0].count("\n"), page, flags=re.DOTALL)
    found: list[Sentence] = []
    block: list[str] = []
    start, fenced = 1, False

    def close() -> None:
        found.extend(sentences_of(" ".join(block), start))
        block.clear()

    for number, line in enumerate(page.splitlines(), 1):
        if FENCE.match(line):
            close()
            fenced = not fenced
        elif fenced or not line.strip() or line.startswith(("#", "    ")) and not block:
            close()
        elif line.lstrip().startswith("|"):
            close()
            cells = re.split(r"(?<!\\)\|", line.strip().strip("|"))
            found.extend(s for cell in cells for s in sentences_of(cell, number, table=True))
        else:
            if ITEM.match(line):
                close()
            if not block:
                start = number
            block.append(ITEM.sub("", line))
    close()
    return found


def glossary() -> set[str]:
    """Terms of the glossary page, in small letters."""
    page = ROOT / "docs" / "glossary.md"
    return (
        {m.lower() for m in re.findall(r"^\| \*\*(.+?)\*\*", page.read_text(), re.MULTILINE)}
        if page.exists()
        else set()
    )


def private_words(found: list[Sentence]) -> list[tuple[int, str]]:
    """(line, word) of each private word that the glossary does not hold."""
    known = glossary()
    return [
        (s.line, name)
        for s in found
        for name, pattern in PRIVATE.items()
        if name not in known and re.search(pattern, s.text, re.IGNORECASE)
    ]


@dataclass(frozen=True)
class Measure:
    """What a page's language measures."""

    name: str
    found: list[Sentence]

    @property
    def prose(self) -> list[int]:
        return [s.length for s in self.found if not s.table]

    @property
    def words(self) -> int:
        return sum(s.length for s in self.found)

    @property
    def median(self) -> float:
        return statistics.median(self.prose or [0])

    @property
    def largest(self) -> int:
        return max((s.length for s in self.found), default=0)

    def complaints(self) -> list[str]:
        """What of the page breaks a rule, one line each."""
        lines = [f"{self.name}:{s.line}: {s.length} words: {s.text[:70]}…" for s in self.found if s.length > LARGEST]
        lines += [f"{self.name}:{line}: private word {word!r}" for line, word in private_words(self.found)]
        if self.median > MEDIAN:
            lines.append(f"{self.name}: sentences of {self.median:g} words in the median, at most {MEDIAN}")
        return lines


def measure(path: Path) -> Measure:
    """A page's measure, named as seen from the root."""
    return Measure(str(path.relative_to(ROOT)) if path.is_relative_to(ROOT) else path.name, sentences(path.read_text()))


def pages() -> list[Path]:
    """README, CONTRIBUTING and the documentation's pages."""
    return [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]


def at_commit(path: Path, commit: str) -> Measure | None:
    """A page's measure at a commit of the repository, None where it had no such page."""
    import subprocess

    name = str(path.relative_to(ROOT))
    done = subprocess.run(["git", "show", f"{commit}:{name}"], cwd=ROOT, capture_output=True, text=True, check=False)
    return Measure(name, sentences(done.stdout)) if done.returncode == 0 else None


def compared(then: Measure | None, now: Measure) -> str:
    """A row of a table: each figure before and now."""
    old = ["–"] * 4
    if then is not None:
        old = [f"{then.words}", f"{then.median:g}", f"{then.largest}", f"{len(private_words(then.found))}"]
    new = [f"{now.words}", f"{now.median:g}", f"{now.largest}", f"{len(private_words(now.found))}"]
    return f"| {now.name} | " + " | ".join(f"{a} → {b}" for a, b in zip(old, new, strict=True)) + " |"


def help_texts() -> list[tuple[str, str]]:
    """(command, text) of what each command and each of its options and arguments says of itself."""
    import importlib

    import typer.main

    from rtds_host.cli.commands import COMMANDS, MODULES

    found: list[tuple[str, str]] = []

    def visit(name: str, command: object) -> None:
        texts = [getattr(command, "help", None), *(getattr(p, "help", None) for p in command.params)]  # type: ignore[attr-defined]
        found.extend((name, text) for text in texts if text)
        for child, sub in (getattr(command, "commands", None) or {}).items():
            visit(f"{name} {child}", sub)

    for name in COMMANDS:
        module = importlib.import_module(f"rtds_host.cli.{MODULES.get(name, name)}")
        visit(f"rtds {name}", typer.main.get_command(module.app))
    return found


def message_texts(path: Path) -> list[tuple[int, str]]:
    """(line, text) of the string literals of a Python file that are not documentation; what a text has of variables
    is one word.
    """
    import ast

    tree = ast.parse(path.read_text(encoding="utf-8"))
    holders = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    # A docstring, and what belongs to a text with variables, are no texts of their own.
    skipped = {id(n.value) for h in ast.walk(tree) if isinstance(h, holders) for n in h.body if isinstance(n, ast.Expr)}
    found: list[tuple[int, str]] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            skipped |= {id(value) for value in node.values}
            found.append(
                (
                    node.lineno,
                    "".join(getattr(v, "value", "x") if isinstance(v, ast.Constant) else "x" for v in node.values),
                )
            )
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in skipped:
            found.append((node.lineno, node.value))
    return found


def measure_messages(folder: Path | None = None) -> list[Measure]:
    """Private words in what the package says: messages, reports, notes. Texts of less than three words are names."""
    measures = []
    for path in sorted((folder or ROOT / "python" / "rtds_host").rglob("*.py")):
        texts = [(line, text) for line, text in message_texts(path) if text.count(" ") >= 2]
        measures.append(Measure(path.name, [s for line, text in texts for s in sentences_of(text, line, table=True)]))
    return measures


def measure_help() -> list[Measure]:
    """The measure of each command's help."""
    of: dict[str, list[Sentence]] = {}
    for name, text in help_texts():
        for paragraph in re.split(r"\n\s*\n", text):
            of.setdefault(name, []).extend(sentences_of(paragraph, 0))
    return [Measure(name, found) for name, found in of.items()]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("page", nargs="*", type=Path)
    parser.add_argument("--long", action="store_true", help="print what breaks a rule, by place")
    parser.add_argument("--help-texts", action="store_true", help="measure the help of the commands instead")
    parser.add_argument("--since", metavar="COMMIT", help="print each page's figures at that commit and now")
    options = parser.parse_args()
    if options.since:
        print("| page | words | median | longest | private words |\n|---|---:|---:|---:|---:|")
        for path in (p.resolve() for p in options.page or pages()):
            print(compared(at_commit(path, options.since), measure(path)))
        return 0
    if options.help_texts:
        measures = measure_help()
    else:
        measures = [measure(path.resolve()) for path in options.page or pages()]
    print("| page | words | sentences | median | longest | private words |\n|---|---:|---:|---:|---:|---:|")
    for m in measures:
        print(f"| {m.name} | {m.words} | {len(m.prose)} | {m.median:g} | {m.largest} | {len(private_words(m.found))} |")
    complaints = [line for m in measures for line in m.complaints()]
    if options.long:
        print("\n".join(complaints))
    return int(bool(complaints))


if __name__ == "__main__":
    sys.exit(main())
