"""The pages follow the style guide as far as a program can check this."""

import re
from collections.abc import Iterator

import pytest

from tests.examples import PAGES, read_page, strip_blocks
from tests.reference import PAGES as GENERATED

# Pages that follow from the code, quote what is to be avoided, or are for developers.
EXEMPT = {
    *(f"docs/reference/{name}.md" for name in GENERATED),
    "docs/developing/style-guide.md",
    "docs/developing/README.md",
}
READ = [page for page in PAGES if page not in EXEMPT]
REFERENCE = "docs/reference/"
LONGEST_SENTENCE = 35  # [words]
LONGEST_MEAN = 18  # [words]
LONGEST_PAGE = 1_500  # [words], except in the reference
# Words and phrases of the style guide, each of which has a plain alternative there.
BANNED = re.compile(
    r"\b(?:put off|puts off|taken for granted|held against|hangs? together|by the deck|gets? told|(?:is|are) told|"
    r"tells? (?:of|that|which|when|how)|beside|is believed|best of a bad|"
    r"a (?:tenth|twentieth|fiftieth|hundredth|thousandth|two-hundredth))\b",
    re.IGNORECASE,
)
# Other names for things that the glossary names.
SYNONYMS = {
    "reference run": r"unswitched run|run without switching|reference history",
    "engine run, restart segment": r"\blegs?\b",
    "prescribed motion": r"imposed motion",
    "oscillation cycle": r"half swing|inner period",
    "eroded elements": r"deleted elements",
    "frozen-deformation error": r"lock-in error",
    "force-free time": r"\bthe wait\b",
    "problem found": r"\bobjections?\b",
}
OPENINGS = ("Of ", "Where ", "Refused ", "Left ", "Beyond that ")


def paragraphs(page: str) -> Iterator[str]:
    """Paragraphs and items of lists, without headings, tables, pictures, code and targets of links."""
    text = re.sub(
        r"^(?:    .*|#.*|\|.*|!\[.*)$",
        "",
        strip_blocks(read_page(page)),
        flags=re.MULTILINE,
    )
    text = re.sub(r"\]\([^)]*\)", "]", text)
    text = re.sub(r"`[^`]*`", "code", text)
    for found in re.split(r"\n\s*\n|\n\s*(?:[*-]|\d+\.) ", text):
        if words := found.strip():
            yield " ".join(words.lstrip("*- ").split())


def sentences(page: str) -> Iterator[str]:
    """Sentences of the paragraphs; an item of a list, and what a colon introduces, stand by themselves."""
    for paragraph in paragraphs(page):
        for sentence in re.split(
            r"(?<=[.!?:])[*)\"]*\s+(?=[A-Z*\[(\"]|code|d2rpick)", paragraph
        ):
            if len(sentence.split()) > 1:
                yield sentence


def length(sentence: str) -> int:
    """Count the words of a sentence."""
    return len(re.findall(r"[A-Za-z0-9][\w'.,/%-]*", sentence))


@pytest.mark.parametrize("page", READ)
def test_sentences_are_short(page: str) -> None:
    found = [*sentences(page)]
    assert found
    assert not [sentence for sentence in found if length(sentence) > LONGEST_SENTENCE]
    assert sum(map(length, found)) / len(found) <= LONGEST_MEAN


@pytest.mark.parametrize("page", READ)
def test_sentences_begin_plainly(page: str) -> None:
    assert not [
        sentence for sentence in sentences(page) if sentence.startswith(OPENINGS)
    ]


@pytest.mark.parametrize("page", READ)
def test_no_page_has_a_word_of_the_list(page: str) -> None:
    assert not BANNED.findall(strip_blocks(read_page(page)))


@pytest.mark.parametrize("page", READ)
def test_one_thing_has_one_name(page: str) -> None:
    text = re.sub(
        r"`[^`]*`|^#.*$|\]\([^)]*\)",
        "",
        strip_blocks(read_page(page)),
        flags=re.MULTILINE,
    )
    assert not {
        name: found
        for name, others in SYNONYMS.items()
        if (found := re.findall(others, text, re.IGNORECASE))
    }


@pytest.mark.parametrize(
    "page", [page for page in READ if not page.startswith(REFERENCE)]
)
def test_a_page_is_read_in_ten_minutes(page: str) -> None:
    assert len(strip_blocks(read_page(page)).split()) <= LONGEST_PAGE


def test_the_measures_of_words_find_what_they_are_for() -> None:
    assert length("One two, three-four 0.5 %.") == 4
    assert BANNED.search("a twentieth of the record")
    assert not BANNED.search("1/20 of the record")
