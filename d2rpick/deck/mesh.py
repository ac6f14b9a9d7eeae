"""Meshes: fixed columns of many lines at once, ids and reals as arrays, and the elements and nodes that these are.

A mesh of millions of lines is read in pieces.  Lines between commas and fields with parameters are rare there; they are
taken one by one.  Columns of Radioss: Altair's public help for the elements, and the solver's published source.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import name_units
from d2rpick.deck.expression import ExpressionError, real
from d2rpick.deck.radioss_deck import Starter, number_of

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.deck.card import Card, Scope
    from d2rpick.deck.source import Block

    Layout = Sequence[tuple[int, int]]  # first column and width of each field
    Integers = NDArray[np.int64]
    Places = NDArray[np.int64]
    Reals = NDArray[np.float64]


_WIDEST: Final = 240  # columns that any line of a mesh uses
_BLANK, _ZERO = (np.uint8(ord(letter)) for letter in " 0")
_ONE_BY_ONE: Final = (b",", b"&", b"<", b"\t")  # in lines that do not stand in columns
_ID_ENDS: Final = (
    7  # last column of most ids: a line that has something there is not blank
)
_HIGHEST: Final = 10**17  # no id comes near: a longer number would overflow
NO_NODE: Final = -1  # in place of a node that there is not
_DENSE: Final = 50_000_000  # up to this id a table of all ids is small enough
NOTHING: Final = -1  # in place of what is not an id
_FEW: Final = 1000  # lines whose fields are read together: a deck may have a card for each of its elements


def layout(*widths: int) -> Layout:
    """Place fields one behind the other.

    Examples
    --------
    >>> layout(8, 16, 16)
    [(0, 8), (8, 16), (24, 16)]
    """
    ends = np.cumsum(widths).tolist()
    return [(end - width, width) for end, width in zip(ends, widths, strict=True)]


class Lines:
    """Data lines of a piece of a mesh: no comments, no blank ones; ``in_columns``: each stands in fixed columns."""

    def __init__(self, data: bytes, scope: Scope, comments: bytes) -> None:
        self._scope = scope
        data = data.replace(b"\r\n", b"\n")
        self.in_columns = not any(letter in data for letter in _ONE_BY_ONE)
        cells = _table(np.frombuffer(data, np.uint8))
        keep = ~np.isin(cells[:, 0], list(comments))
        unsure = np.flatnonzero(cells[:, min(_ID_ENDS, cells.shape[1] - 1)] == _BLANK)
        keep[unsure] &= (cells[unsure] != _BLANK).any(axis=1)
        self.cells = cells if keep.all() else cells[keep]

    def __len__(self) -> int:
        """Give the number of lines."""
        return len(self.cells)

    def integers(self, fields: Layout) -> Integers:
        """Ids in these fields, shape (lines, fields): 0 for a blank, `NOTHING` for what is not an id."""
        columns = [self._field(*place) for place in fields]
        if len(self) < _FEW and len({width for _, width in fields}) == 1:
            found = _integers(np.concatenate(columns)).reshape(len(fields), len(self)).T
        else:
            found = np.stack([*map(_integers, columns)], axis=1)
        for row, texts in self._texts.items():
            found[row] = [
                _id(self._value(text)) for text in self._pieces(texts, fields)
            ]
        return found

    def reals(self, fields: Layout, wanted: slice) -> Reals:
        """Give the numbers in ``wanted`` of the fields, shape (lines, wanted): 0 for a blank, NaN for what is none."""
        found = np.stack(
            [_reals(self._field(*place)) for place in fields[wanted]], axis=1
        )
        for row, texts in self._texts.items():
            found[row] = [
                self._value(text) for text in self._pieces(texts, fields)[wanted]
            ]
        return found

    def _field(self, start: int, width: int) -> NDArray[np.uint8]:
        found = self.cells[:, start : start + width]
        missing = width - found.shape[1]
        return (
            np.pad(found, ((0, 0), (0, missing)), constant_values=_BLANK)
            if missing
            else found
        )

    @cached_property
    def _texts(self) -> dict[int, str]:
        """Lines that do not stand in columns, or refer to parameters."""
        if self.in_columns:
            return {}
        special = np.isin(self.cells, [ord(letter) for letter in _ONE_BY_ONE]).any(
            axis=1
        )
        return {
            row: self.cells[row].tobytes().decode("latin-1")
            for row in np.flatnonzero(special).tolist()
        }

    def _pieces(self, text: str, fields: Layout) -> list[str]:
        if "," in text:
            cells = text.split(",")
            return [
                cells[place] if place < len(cells) else ""
                for place in range(len(fields))
            ]
        return [text.expandtabs(8)[start : start + width] for start, width in fields]

    def _value(self, text: str) -> float:
        """Value of a field; 0 for a blank, NaN for what is no number."""
        if not text.strip():
            return 0.0
        try:
            return float(self._scope.value(text))
        except (ExpressionError, OverflowError):
            return math.nan


def lines_of(card: Card, comments: bytes = b"$") -> Iterator[Lines]:
    """Read the data lines of a card, piece by piece."""
    for data in _pieces_of(card.block):
        if data:
            yield Lines(data, card.scope, comments)


def _pieces_of(block: Block) -> Iterator[bytes]:
    """Bytes below the keyword line, in pieces that end with a line."""
    pieces = block.source.pieces(block.start, block.end)
    yield next(pieces).partition(b"\n")[2]
    yield from pieces


def _table(raw: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Lines as rows of equal width, blanks behind those that are shorter; without line ends."""
    ends = np.flatnonzero(raw == ord("\n"))
    if not raw.size or raw[-1] != ord("\n"):
        ends = np.append(ends, raw.size)
    starts = np.concatenate([[0], ends[:-1] + 1])
    lengths = ends - starts
    longest = int(lengths.max(initial=0))
    if (lengths == longest).all() and raw.size == lengths.size * (longest + 1):
        return raw.reshape(lengths.size, longest + 1)[:, : max(1, longest)]
    columns = np.arange(max(1, min(longest, _WIDEST)))
    places = np.minimum(np.add.outer(starts, columns), raw.size - 1)
    return np.where(columns < lengths[:, np.newaxis], raw[places], _BLANK)


def _integers(field: NDArray[np.uint8]) -> Integers:
    value = np.zeros(len(field), np.int64)
    known, groups = np.ones(len(field), bool), np.zeros(len(field), np.uint8)
    before = np.zeros(len(field), bool)
    for letters in np.ascontiguousarray(field.T):
        digits = letters - _ZERO
        is_digit = digits <= 9
        value = np.where(is_digit, 10 * value + digits, value)
        known &= (is_digit | (letters == _BLANK)) & (value < _HIGHEST)
        groups += is_digit & ~before
        before = is_digit
    return np.where(known & (groups <= 1), value, NOTHING)


def _reals(field: NDArray[np.uint8]) -> Reals:
    blank = (field == _BLANK).all(axis=1)
    texts = np.ascontiguousarray(field).view(f"S{field.shape[1]}").ravel()
    texts = np.where(blank, b"0", texts)
    try:
        return texts.astype(np.float64)
    except ValueError:  # 1.5-3 is a number for a solver
        return np.array([real(text.decode("latin-1")) for text in texts.tolist()])


def _id(value: float) -> int:
    return int(value) if value >= 0 and value == int(value) else NOTHING


def distinct(values: Places) -> Places:
    """Give the distinct values, ascending; by sorting, which is quicker here than by a table of hashes."""
    ordered = np.sort(values, axis=None)
    return (
        ordered[np.append(True, ordered[1:] != ordered[:-1])]
        if ordered.size
        else ordered
    )


def _used(wanted: Sequence[Places]) -> Places:
    """Node ids that elements have, ascending."""
    highest = max((int(one.max(initial=0)) for one in wanted), default=0)
    if highest > _DENSE:
        used = distinct(np.concatenate([distinct(one) for one in wanted]))
        return used[used > 0]
    mask = np.zeros(highest + 1, bool)
    for one in wanted:
        mask[one] = True
    mask[0] = False
    return np.flatnonzero(mask)


class NodeTable:
    """Nodes of a mesh, each with its place: those with coordinates, as given, then those that elements have beyond.

    ``ids`` are the ids by place, shape (nodes,).

    Examples
    --------
    >>> table = NodeTable(np.array([3, 7, 5]), [np.array([[7, 9, 0]])])
    >>> table.ids.tolist(), table.places(np.array([[7, 9, 0]])).tolist(), table.known(np.array([4, 7])).tolist()
    ([3, 7, 5, 9], [[1, 3, -1]], [1])
    """

    def __init__(self, ids: Places, elements: Sequence[Places]) -> None:
        used = _used(elements)
        self.ids = np.concatenate([ids, used[~np.isin(used, ids)]])
        self._order = np.argsort(self.ids, kind="stable")
        self._sorted = self.ids[self._order]

    def places(self, ids: Places) -> Places:
        """Place of each node, `NO_NODE` for one that the table has not."""
        if not self.ids.size:
            return np.full_like(ids, NO_NODE)
        if self._sorted[-1] <= _DENSE:
            if ids.min(initial=0) < 0 or ids.max(initial=0) >= self._lookup.size:
                ids = np.where((ids > 0) & (ids < self._lookup.size), ids, 0)
            return np.asarray(self._lookup[ids])
        at = np.minimum(np.searchsorted(self._sorted, ids), self.ids.size - 1)
        return np.where(self._sorted[at] == ids, self._order[at], NO_NODE)

    def known(self, ids: Places) -> Places:
        """Places of those nodes that the table has."""
        found = self.places(ids)
        return np.asarray(found[found != NO_NODE])

    @cached_property
    def _lookup(self) -> Places:
        """Place by id, where ids are small enough: quicker than a search."""
        lookup = np.full(int(self._sorted[-1]) + 1, NO_NODE, np.int64)
        lookup[self._sorted[::-1]] = self._order[::-1]
        return lookup


class Elements(NamedTuple):
    """Elements of one kind: the id of the part, shape (n,), and the places of the nodes, shape (n, nodes)."""

    kind: str
    part: Places
    nodes: Places

    def of(self, part: int) -> Places:
        """Nodes of the elements of a part."""
        return np.asarray(self.nodes[self.part == part])


class Mesh(NamedTuple):
    """Elements of a deck by kind, the table of their nodes, where these lie, and how many are not placed."""

    elements: tuple[Elements, ...]
    table: NodeTable
    coordinates: Reals
    lost: int

    @classmethod
    def of(
        cls,
        blocks: Sequence[tuple[str, Places, Places]],
        ids: Places,
        coordinates: Reals,
    ) -> Mesh:
        """Put together blocks of elements (kind, parts, node ids) and all nodes with coordinates."""
        blocks = [one for one in blocks if len(one[1])]
        kinds = sorted({(kind, nodes.shape[1]) for kind, _, nodes in blocks})
        alike = [
            [one for one in blocks if (one[0], one[2].shape[1]) == kind]
            for kind in kinds
        ]
        nodes = [np.concatenate([own for _, _, own in those]) for those in alike]
        table = NodeTable(ids, nodes)
        elements = tuple(
            Elements(
                those[0][0],
                np.concatenate([part for _, part, _ in those]),
                table.places(own),
            )
            for those, own in zip(alike, nodes, strict=True)
        )
        lost = table.ids.size - ids.size
        return cls(
            elements,
            table,
            np.concatenate([coordinates, np.full((lost, 3), np.nan)]),
            lost,
        )

    @property
    def kinds(self) -> Mapping[int, set[str]]:
        """Kinds of the elements of each part."""
        found: dict[int, set[str]] = {}
        for one in self.elements:
            for part in np.unique(one.part).tolist():
                found.setdefault(part, set()).add(one.kind)
        return found

    def doubts(self, parts: Collection[int], sign: str) -> Iterator[str]:
        """Say which parts of elements are not those of the deck, whose keywords begin with ``sign``, or which nodes."""
        if unknown := sorted(self.kinds.keys() - parts):
            yield f"elements of {name_units(unknown)}, which no {sign}PART of the deck defines"
        if self.lost:
            yield f"{self.lost} nodes of elements are not in any {sign}NODE of the deck"


_COMMENTS: Final = b"$#"
_WIDTH, _REAL = 10, 20


class _Kind(NamedTuple):
    """Kind of elements: what to call it, nodes that hold the part, ids on each of its lines."""

    name: str
    nodes: int
    lines: tuple[int, ...]


KINDS: Final = {
    "SHELL": _Kind("shell", 4, (5,)), "SH3N": _Kind("triangle", 3, (4,)), "BRICK": _Kind("solid", 8, (9,)),
    "TETRA4": _Kind("tetrahedron", 4, (5,)), "PENTA6": _Kind("pentahedron", 6, (7,)), "QUAD": _Kind("quad", 4, (5,)),
    "TRIA": _Kind("tria", 3, (4,)), "BEAM": _Kind("beam", 2, (3,)), "TRUSS": _Kind("truss", 2, (3,)),
    "SPRING": _Kind("spring", 2, (3,)), "TETRA10": _Kind("tetrahedron", 10, (1, 10)),
    "BRIC20": _Kind("solid", 20, (9, 8, 4)), "SHEL16": _Kind("thick shell", 16, (9, 8)),
}  # fmt: skip
NOT_COUNTED: Final = {"SPHCEL", "XELEM"}


def elements_of(
    card: Card, *, damaged: bool = False
) -> Iterator[tuple[str, Integers, Integers]]:
    """Kind, parts and node ids of the elements of a card, ``damaged`` ones too, with 0 for what is no node."""
    kind = KINDS[card.words[0]]
    fields: Layout = layout(*[_WIDTH] * max(kind.lines))
    found = [
        lines.integers(fields) for lines in lines_of(card, _COMMENTS) if len(lines)
    ]
    if not found:
        return
    values = np.concatenate(found)
    per = len(kind.lines)
    values = values[: len(values) // per * per].reshape(-1, per, values.shape[1])
    flat = np.concatenate(
        [values[:, line, :count] for line, count in enumerate(kind.lines)], axis=1
    )
    good = (flat[:, : 1 + min(kind.nodes, 3)] > 0).all(axis=1) | damaged
    nodes = np.maximum(flat[good, 1 : 1 + kind.nodes], 0)
    yield kind.name, np.full(len(nodes), number_of(card), np.int64), nodes


def parts_with_elements(starter: Starter) -> set[int]:
    """Parts that have elements of any kind."""
    return {part for part, _ in _elements(starter)}


def parts_within(
    starter: Starter, groups: Mapping[int, tuple[Collection[int], Collection[int]]]
) -> dict[int, set[int]]:
    """Parts all of whose nodes are some of these, or nodes of some parts, by the keys of ``groups``."""
    elements = [*_elements(starter)]
    inside: dict[int, set[int]] = {}
    for key, (nodes, parts) in groups.items():
        of_parts = [members.ravel() for part, members in elements if part in parts]
        known = np.unique(np.concatenate([np.array([0, *nodes]), *of_parts]))
        inside[key] = {part for part, _ in elements}
        for part, members in elements:
            real = bool((members > 0).any(axis=1).all())
            if part in inside[key] and not (real and np.isin(members, known).all()):
                inside[key].discard(part)
    return inside


def _elements(starter: Starter) -> Iterator[tuple[int, Integers]]:
    """Part and node ids of elements, block by block; none where their lines are not followed."""
    for card in starter.named(*KINDS, *NOT_COUNTED):
        kind = KINDS.get(card.words[0])
        if kind and len(kind.lines) == 1 and card.words[1:]:
            yield from (
                (number_of(card), nodes)
                for _, _, nodes in elements_of(card, damaged=True)
            )
        elif card.words[1:]:
            yield number_of(card), np.zeros((1, 1), np.int64)


def nodes_of(cards: Iterable[Card]) -> tuple[Integers, Reals]:
    """Ids of nodes (n,) and where they lie (n, 3) [length]."""
    ids, places = [np.empty(0, np.int64)], [np.empty((0, 3))]
    fields: Layout = layout(_WIDTH, _REAL, _REAL, _REAL)
    for card in cards:
        for lines in lines_of(card, _COMMENTS):
            if len(lines):
                numbers = lines.integers(fields[:1])[:, 0]
                ids.append(numbers[numbers > 0])
                places.append(lines.reals(fields, slice(1, 4))[numbers > 0])
    return np.concatenate(ids), np.concatenate(places)
