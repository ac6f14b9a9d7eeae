"""Help and explanations follow the style guide as far as a program can check this."""

import re
from collections.abc import Iterator

import click
import pytest

from d2rpick.cli import COMMANDS, d2rpick
from d2rpick.report.warning_texts import EXPLANATIONS

LONGEST_SENTENCE = 35  # [words]
LONGEST_MEAN = 18  # [words]
# Words and phrases that the style guide replaces by plain ones.
BANNED = re.compile(
    r"\b(?:put off|puts off|taken? for granted|held against|hold (?:each|it|them) against|hangs? together|by the deck|"
    r"gets? told|(?:is|are) told|tells?|believed|beside|behind|counts? as|goes on|"
    r"legs?|inner period|half swing|imposed motion|objection|"
    r"a (?:tenth|twentieth|fiftieth|hundredth|thousandth|two-hundredth))\b",
    re.IGNORECASE,
)
OPENINGS = (
    *("Of ", "Where ", "Refused ", "Left ", "Named ", "Without ", "From ", "Instead "),
    *("Nothing ", "The ", "A ", "It "),
)


def make_commands() -> Iterator[click.Command]:
    context = click.Context(d2rpick)
    for name in COMMANDS:
        command = d2rpick.get_command(context, name)
        assert command is not None
        yield command


def list_options() -> list[tuple[str, str]]:
    """Name each option with its help."""
    return [
        (f"{command.name} {option.opts[-1]}", option.help or "")
        for command in make_commands()
        for option in command.params
        if isinstance(option, click.Option)
    ]


def split_sentences(text: str) -> list[str]:
    """Split a text into sentences, each on one line, without defaults in brackets and code."""
    plain = re.sub(r"\[default:[^]]*\]", "", re.sub(r"`[^`]*`", "code", text))
    paragraphs = re.split(r"\n\s*\n", plain)
    return [
        " ".join(sentence.split())
        for paragraph in paragraphs
        for sentence in re.split(
            r"(?<=[.!?])\s+(?=[A-Z`-]|code|d2rpick|glstat)", paragraph
        )
        if len(sentence.split()) > 1
    ]


def count_words(sentence: str) -> int:
    return len(re.findall(r"[A-Za-z0-9][\w'.,/%-]*", sentence))


TEXTS = {
    **{command.name or "": command.help or "" for command in make_commands()},
    **dict(list_options()),
    **{f"rule {code}": " ".join(text) for code, text in EXPLANATIONS.items()},
}


@pytest.mark.parametrize("name", TEXTS)
def test_a_text_has_no_banned_word_and_no_long_sentence(name: str) -> None:
    text = TEXTS[name]
    assert text
    assert not BANNED.findall(" ".join(text.split()))
    assert [s for s in split_sentences(text) if count_words(s) > LONGEST_SENTENCE] == []


def test_sentences_are_short_on_the_whole() -> None:
    for texts in (
        [command.help or "" for command in make_commands()],
        [help_ for _, help_ in list_options()],
    ):
        lengths = [count_words(s) for text in texts for s in split_sentences(text)]
        assert sum(lengths) / len(lengths) <= LONGEST_MEAN


@pytest.mark.parametrize(("name", "help_"), list_options())
def test_the_help_of_an_option_begins_with_its_verb_or_noun(
    name: str, help_: str
) -> None:
    assert name
    assert help_[:1].isupper()
    assert not help_.startswith(OPENINGS)


@pytest.mark.parametrize(("name", "help_"), list_options())
def test_a_default_is_a_value_in_brackets(name: str, help_: str) -> None:
    assert name
    for default in re.findall(r"\[([^]|]*)\]", help_):
        assert default.startswith("default: ")
        assert not re.search(r"\b(?:that of|those of|where|if that is more)\b", default)


def test_the_measures_find_what_they_are_for() -> None:
    assert count_words("One two, three-four 0.5 %.") == 4
    assert BANNED.search("which the deck tells")
    assert not BANNED.search("which the deck defines")
    assert split_sentences("Time of td.  [default: 0]") == ["Time of td."]


def test_no_help_shows_an_expression_of_python() -> None:
    """Commands of a user may contain {deck} and {threads}; anything else in braces is a text that was not filled in."""
    for name, text in list_options():
        assert re.search(r"\{(?!(?:deck|threads)\})", text) is None, name
    helps = dict(list_options())
    assert (
        "either reference_m, published_m and better_m, or z_m"
        in helps["reproduce --solver"]
    )


def test_part_names_the_recommended_set_where_it_is_accepted() -> None:
    naming = {name for name, help_ in list_options() if '"recommended"' in help_}
    commands = ("suggest", "verify", "explore", "plan", "card")
    assert naming == {f"{command} --part" for command in commands}
