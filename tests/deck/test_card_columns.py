"""Printed switch sets are read by the columns of the vendor's keyword data, without the reader of the package.

Every field has its place, its type and, where the card says nothing of it, its default; counts and pairs agree.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings, strategies as st

from d2rpick.base.errors import DeckError
from d2rpick.deck.printed_card import Printing
from d2rpick.deck.printing import print_cards

WIDTH = 10  # columns of a field

GAPS = st.lists(st.floats(1e-3, 10.0), min_size=1, max_size=7).filter(
    lambda gaps: len(gaps) % 2 == 1
)
FIXED = ("CODE", "TIME2", "TIME3", "ENTNO", "RELSW", "PAIRED", "RWF", "OFFSET")


class Column(NamedTuple):
    """A field: its name, its place (counted from 0), its type, and the meaning of a blank."""

    name: str
    place: int
    kind: type
    default: float | str


FIRST = (
    Column("SWSET", 0, int, 0),
    Column("CODE", 1, int, 0),
    Column("TIME1", 2, float, 0.0),
    Column("TIME2", 3, float, 0.0),
    Column("TIME3", 4, float, 0.0),
    Column("ENTNO", 5, int, 0),
    Column("RELSW", 6, int, 0),
    Column("PAIRED", 7, int, 0),
)
SECOND = (
    Column("NRBF", 0, int, 0),
    Column("NCSF", 1, int, 0),
    Column("RWF", 2, int, 0),
    Column("DTMAX", 3, float, 0.0),
    Column("D2R", 4, int, 0),
    Column("R2D", 5, int, 0),
    Column("OFFSET", 6, float, 0.0),
)
TO_RIGID = (
    Column("PID", 0, int, 0),
    Column("LRB", 1, int, 0),
    Column("PTYPE", 2, str, "PART"),
)
TO_DEFORMABLE = (Column("PID", 0, int, 0), Column("PTYPE", 1, str, "PART"))


class SetRead(NamedTuple):
    """A switch set: its fields and those of its lines, by name."""

    fields: dict[str, Any]
    rigid: list[dict[str, Any]]
    deformable: list[dict[str, Any]]


def read_row(line: str, columns: tuple[Column, ...]) -> dict[str, Any]:
    """Read a line; no text follows its last column, and no field touches the next one."""
    assert not line[len(columns) * WIDTH :].strip()
    found: dict[str, Any] = {}
    for column in columns:
        text = line[column.place * WIDTH : (column.place + 1) * WIDTH]
        assert text.strip(), f"{column.name} is blank"
        assert text[0] in " -", f"{column.name} touches the field before it"
        assert text == text.rstrip(), f"{column.name} is not right-justified"
        found[column.name] = column.kind(text.strip())
    return found


def read_sets(text: str) -> Iterator[SetRead]:
    lines = [line for line in text.splitlines() if not line.startswith("$")]
    while lines:
        keyword = lines.pop(0)
        if keyword != "*DEFORMABLE_TO_RIGID_AUTOMATIC":
            assert keyword.startswith("*SET_PART")
            while lines and not lines[0].startswith("*"):
                lines.pop(0)
            continue
        fields = read_row(lines.pop(0), FIRST) | read_row(lines.pop(0), SECOND)
        rigid = [read_row(lines.pop(0), TO_RIGID) for _ in range(fields["D2R"])]
        back = [read_row(lines.pop(0), TO_DEFORMABLE) for _ in range(fields["R2D"])]
        assert not lines or lines[0].startswith("*")
        yield SetRead(fields, rigid, back)


@st.composite
def printings(draw: st.DrawFn) -> Printing:
    parts = draw(st.lists(st.integers(1, 10**8), min_size=1, max_size=8, unique=True))
    swset = draw(st.lists(st.integers(1, 10**6), min_size=2, max_size=2, unique=True))
    merge = draw(st.sampled_from([None, *parts]))
    return Printing(
        part=tuple(parts),
        merge=merge,
        swset=(swset[0], swset[1]),
        step_cap=draw(st.none() | st.floats(1e-9, 1.0)),
        delete_nodal_bodies=draw(st.booleans()),
        delete_node_sets=draw(st.booleans()),
    )


def starts_of(gaps: list[float]) -> list[float]:
    times = [0.001]
    for gap in gaps:
        times.append(times[-1] + gap)
    return times


@settings(max_examples=120)
@given(printing=printings(), gaps=GAPS)
def test_sets_by_time_have_every_field_in_its_columns(
    printing: Printing, gaps: list[float]
) -> None:
    times = starts_of(gaps)
    windows = list(zip(times[::2], times[1::2], strict=True))
    card = print_cards(windows, printing)
    sets = [*read_sets(card.text)]
    assert len(sets) == 2 * len(windows)
    names = [one.fields["SWSET"] for one in sets]
    assert len({*names}) == len(names)
    for window, there, back in zip(card.windows, sets[::2], sets[1::2], strict=True):
        assert (there.fields["TIME1"], back.fields["TIME1"]) == window
        for one in (there, back):
            fixed = {name: one.fields[name] for name in FIXED}
            assert fixed == dict.fromkeys(FIXED, 0)
        assert there.fields["DTMAX"] > 0 == back.fields["DTMAX"]
        assert not there.deformable
        assert not back.rigid
        check_lines(there, back, printing)


def check_lines(there: SetRead, back: SetRead, printing: Printing) -> None:
    """Compare the lines with the request if they name parts and no sets; compare NRBF and NCSF as well."""
    deletes = [printing.delete_nodal_bodies, printing.delete_node_sets]
    for one, flag in ((there, 1), (back, 2)):
        flags = [one.fields["NRBF"], one.fields["NCSF"]]
        assert flags == [flag * asked for asked in deletes]
    lines = (*there.rigid, *back.deformable)
    assert {line["PTYPE"] for line in lines} <= {"PART", "PSET"}
    if all(line["PTYPE"] == "PART" for line in lines):
        assert {line["PID"] for line in there.rigid} == {*printing.part}
        assert {line["PID"] for line in back.deformable} == {*printing.part}
        merge = printing.merge or 0
        assert all(
            line["LRB"] == (0 if line["PID"] == merge else merge)
            for line in there.rigid
        )


@settings(max_examples=80)
@given(
    printing=printings(),
    gaps=GAPS,
    entity=st.integers(1, 10**6),
    wall=st.booleans(),
    speed=st.none() | st.floats(0.1, 100.0),
)
def test_pairs_by_force_name_each_other(
    printing: Printing, gaps: list[float], entity: int, wall: bool, speed: float | None
) -> None:
    times = starts_of(gaps)
    windows = list(zip(times[::2], times[1::2], strict=True))
    ends = [0.0, *(time for pair in windows for time in pair), times[-1] + 0.5]
    pushes = tuple(zip(ends[::2], ends[1::2], strict=True))
    asked = printing._replace(
        wall=entity if wall else None,
        contact=None if wall else entity,
        pushed=pushes,
        speed=speed,
    )
    try:
        card = print_cards(windows, asked._replace(solver="ls-dyna-contact"))
    except DeckError as refused:
        assert "no force-free time lets a pair" in str(refused)  # noqa: PT017  most have one
        return
    there, back = read_sets(card.text)
    names = [one.fields["SWSET"] for one in (there, back)]
    assert [one.fields["RELSW"] for one in (there, back)] == names[::-1]
    assert [one.fields["PAIRED"] for one in (there, back)] == [1, -1]
    codes = [one.fields["CODE"] for one in (there, back)]
    assert codes == ([1, 3] if wall else [2, 4])
    assert [one.fields["ENTNO"] for one in (there, back)] == [entity, entity]
    assert there.fields["TIME1"] == pytest.approx(windows[0][0], rel=1e-6)
    assert there.fields["TIME2"] > there.fields["TIME1"]
    assert there.fields["TIME3"] == 0.0 <= back.fields["TIME3"]
    assert there.fields["OFFSET"] == 0.0 <= back.fields["OFFSET"]
    check_lines(there, back, printing)
