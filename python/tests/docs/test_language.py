"""Pages and help are plain English: short sentences, the glossary's words."""

from __future__ import annotations

import re

import language
import pytest
from language import ROOT, Measure, measure, measure_help, measure_messages, pages, private_words, sentences


@pytest.mark.parametrize("page", pages(), ids=lambda p: p.name)
def test_a_page_is_short_of_sentence_and_plain_of_word(page):
    complaints = measure(page).complaints()
    assert not complaints, "python examples/language.py --long shows them:\n" + "\n".join(complaints)


def test_what_the_commands_say_of_themselves_is_short_and_plain():
    measures = measure_help()
    assert len(measures) > 10
    complaints = [line for m in measures for line in m.complaints()]
    assert not complaints, "\n".join(complaints)


def test_what_the_program_prints_holds_no_private_word():
    measures = measure_messages()
    assert sum(len(m.found) for m in measures) > 1000
    found = [f"{m.name}:{line}: {word}" for m in measures for line, word in private_words(m.found)]
    assert not found, "\n".join(found)


def test_a_private_word_in_a_message_is_found_and_one_of_a_docstring_is_not(tmp_path):
    (tmp_path / "one.py").write_text(
        '"""The rest stands."""\n\nTEXT = f"what {x} leaves stands here"\nNAME = "the rest"\n'
    )
    assert [private_words(m.found) for m in measure_messages(tmp_path)] == [[(3, "stands")]]


def test_a_page_is_compared_with_what_it_was():
    then, now = (Measure("page", sentences(text)) for text in ("The rest stands here.", "The residual is here."))
    assert language.compared(then, now) == "| page | 4 → 4 | 4 → 4 | 4 → 4 | 2 → 0 |"
    assert language.compared(None, now).startswith("| page | – → 4 |")


def lengths(text: str) -> list[int]:
    return [s.length for s in sentences(text)]


def test_sentences_are_counted_as_a_reader_reads_them():
    assert lengths("One two three. Four five!\n\nSix\nseven.") == [3, 2, 2]
    assert lengths("- one two\n- three `a b c` [four five](there.md)\n") == [2, 4]
    assert lengths("# A title\n\n```sh\nrtds run linear\n```\n\nAfter, e.g. This.") == [3]
    assert lengths("| a b | c |\n|---|---|\n| one two three | 4 |\n") == [2, 1, 3, 1]
    assert lengths("It is 1.5 V. `x` is read.") == [4, 3]
    assert lengths("<!-- test: not counted\nat all -->\nOne — two = three.") == [3]


def test_long_sentences_and_private_words_are_found():
    long = Measure("page", sentences("word " * 41 + "."))
    assert [line.split(":")[-1] for line in long.complaints()][1] == " sentences of 41 words in the median, at most 18"
    assert ": 41 words: " in long.complaints()[0]
    private = Measure("page", sentences("The rest stands. It is told apart from its twin, beside it. At rest it is."))
    assert {re.search("'(.+)'", line)[1] for line in private.complaints()} == {
        "rest",
        "stands",
        "told apart",
        "twin",
        "beside",
    }


def test_a_word_of_the_glossary_is_no_private_word(monkeypatch):
    found = sentences("The rest is small.")
    assert language.private_words(found)
    monkeypatch.setattr(language, "glossary", lambda: {"rest"})
    assert not language.private_words(found)


def test_the_glossary_has_forty_terms_at_most_in_order_each_with_one_short_sentence():
    terms = re.findall(r"^\| \*\*(.+?)\*\* \| (.+?) \|$", (ROOT / "docs" / "glossary.md").read_text(), re.MULTILINE)
    assert 20 <= len(terms) <= 40
    assert [t.lower() for t, _ in terms] == sorted(t.lower() for t, _ in terms)
    assert all(len(meaning.split()) <= 20 for _, meaning in terms)
