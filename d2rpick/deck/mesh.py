"""Read meshes: arrays of numbers from many lines at a time, and the elements and nodes that they define.

A mesh of millions of lines is read in pieces. Lines with commas and fields with parameters are rare in a mesh and are
read one by one. The Radioss columns come from Altair's public help for the elements, and from the solver's published
source.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from d2rpick.base.caching import cached_property
from d2rpick.base.errors import name_units
from d2rpick.deck.expression import ExpressionError, parse_real
from d2rpick.deck.radioss_columns import NODE, make_radioss_element_line
from d2rpick.deck.radioss_deck import Starter, get_number

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from d2rpick.deck.card import Card, Scope
    from d2rpick.deck.source import Block

    # First column and width of each field [characters].
    Layout = Sequence[tuple[int, int]]
    Integers = NDArray[np.int64]
    Places = NDArray[np.int64]
    Reals = NDArray[np.float64]


_WIDEST: Final = 240  # Longest line of a mesh [characters].
_BLANK, _ZERO = (np.uint8(ord(letter)) for letter in " 0")
# Characters that occur only in lines without fixed columns, which are parsed separately.
_ONE_BY_ONE: Final = (b",", b"&", b"<", b"\t")
# Index of the last character of most ids; a line with a character at this index is not blank.
_ID_ENDS: Final = 7
_HIGHEST: Final = 10**17  # Ids must be smaller than this number to avoid an overflow.
NO_NODE: Final = -1  # Index that stands for a missing node.
_DENSE: Final = 50_000_000  # Largest id for which an id table fits into memory.
NOTHING: Final = -1  # Placeholder for a field that contains no id.
# Up to this number of lines, the fields of all lines are parsed together; a deck may have a card for each element.
_FEW: Final = 1000

_COMMENTS: Final = b"$#"
NOT_COUNTED: Final = {"SPHCEL", "XELEM"}


class Lines:
    """The data lines in a block of mesh lines, without comments and blank lines.

    ``in_columns`` is True if all lines have fixed columns.
    """

    def __init__(self, data: bytes, scope: Scope, comments: bytes) -> None:
        self._scope = scope
        data = data.replace(b"\r\n", b"\n")
        self.in_columns = not any(letter in data for letter in _ONE_BY_ONE)
        cells = _make_table(np.frombuffer(data, np.uint8))
        keep = ~np.isin(cells[:, 0], list(comments))
        unsure = np.flatnonzero(cells[:, min(_ID_ENDS, cells.shape[1] - 1)] == _BLANK)
        keep[unsure] &= (cells[unsure] != _BLANK).any(axis=1)
        self.cells = cells if keep.all() else cells[keep]

    def __len__(self) -> int:
        """Return the number of lines."""
        return len(self.cells)

    def integers(self, fields: Layout) -> Integers:
        """Return the ids in these fields of all lines, shape (lines, fields).

        A blank field gives 0, and text that is not an id gives `NOTHING`.
        """
        columns = [self._field(*field) for field in fields]
        if len(self) < _FEW and len({width for _, width in fields}) == 1:
            ids = (
                _parse_integers(np.concatenate(columns))
                .reshape(len(fields), len(self))
                .T
            )
        else:
            ids = np.stack([*map(_parse_integers, columns)], axis=1)
        for row, texts in self._texts.items():
            ids[row] = [
                _make_id(self._value(text)) for text in self._pieces(texts, fields)
            ]
        return ids

    def reals(self, fields: Layout, wanted: slice) -> Reals:
        """Return the numbers in the fields ``wanted`` of all lines, shape (lines, wanted).

        A blank field gives 0, and text that is not a number gives NaN.
        """
        numbers = np.stack(
            [_parse_reals(self._field(*field)) for field in fields[wanted]], axis=1
        )
        for row, texts in self._texts.items():
            numbers[row] = [
                self._value(text) for text in self._pieces(texts, fields)[wanted]
            ]
        return numbers

    def _field(self, start: int, width: int) -> NDArray[np.uint8]:
        """Return the characters of a field in all lines, shape (lines, width), padded with spaces."""
        cells = self.cells[:, start : start + width]
        missing = width - cells.shape[1]
        if missing:
            return np.pad(cells, ((0, 0), (0, missing)), constant_values=_BLANK)
        return cells

    @cached_property
    def _texts(self) -> dict[int, str]:
        """Return the lines that have no fixed columns or that contain parameters, keyed by row."""
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
        """Return the text in each of the given fields of a line."""
        if "," in text:
            cells = text.split(",")
            return [
                cells[position] if position < len(cells) else ""
                for position in range(len(fields))
            ]
        return [text.expandtabs(8)[start : start + width] for start, width in fields]

    def _value(self, text: str) -> float:
        """Return the value of a field: 0 if it is blank, NaN if it is not a number."""
        if not text.strip():
            return 0.0
        try:
            return float(self._scope.value(text))
        except (ExpressionError, OverflowError):
            return math.nan


def read_lines(card: Card, comments: bytes = b"$") -> Iterator[Lines]:
    """Yield the data lines of a card, block by block."""
    for data in _read_pieces(card.block):
        if data:
            yield Lines(data, card.scope, comments)


def _read_pieces(block: Block) -> Iterator[bytes]:
    """Yield the bytes below the keyword line in blocks that end at a line ending."""
    pieces = block.source.pieces(block.start, block.end)
    yield next(pieces).partition(b"\n")[2]
    yield from pieces


def _make_table(raw: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return lines as rows of equal length, with spaces in place of line endings."""
    ends = np.flatnonzero(raw == ord("\n"))
    if not raw.size or raw[-1] != ord("\n"):
        ends = np.append(ends, raw.size)
    starts = np.concatenate([[0], ends[:-1] + 1])
    lengths = ends - starts
    longest = int(lengths.max(initial=0))
    if (lengths == longest).all() and raw.size == lengths.size * (longest + 1):
        return raw.reshape(lengths.size, longest + 1)[:, : max(1, longest)]
    columns = np.arange(max(1, min(longest, _WIDEST)))
    offsets = np.minimum(np.add.outer(starts, columns), raw.size - 1)
    return np.where(columns < lengths[:, np.newaxis], raw[offsets], _BLANK)


def _parse_integers(field: NDArray[np.uint8]) -> Integers:
    """Parse a field of digits: 0 for a blank field, `NOTHING` for other text."""
    value = np.zeros(len(field), np.int64)
    is_valid = np.ones(len(field), bool)
    groups = np.zeros(len(field), np.uint8)
    was_digit = np.zeros(len(field), bool)
    for letters in np.ascontiguousarray(field.T):
        digits = letters - _ZERO
        is_digit = digits <= 9
        value = np.where(is_digit, 10 * value + digits, value)
        is_valid &= (is_digit | (letters == _BLANK)) & (value < _HIGHEST)
        groups += is_digit & ~was_digit
        was_digit = is_digit
    return np.where(is_valid & (groups <= 1), value, NOTHING)


def _parse_reals(field: NDArray[np.uint8]) -> Reals:
    """Parse a field of real numbers: 0 for a blank field, NaN for other text."""
    blank = (field == _BLANK).all(axis=1)
    texts = np.ascontiguousarray(field).view(f"S{field.shape[1]}").ravel()
    texts = np.where(blank, b"0", texts)
    try:
        return texts.astype(np.float64)
    except ValueError:  # Solvers also accept numbers such as 1.5-3.
        return np.array([parse_real(text.decode("latin-1")) for text in texts.tolist()])


def _make_id(value: float) -> int:
    """Return a value as an id, or `NOTHING` if it is not a valid id."""
    return int(value) if value >= 0 and value == int(value) else NOTHING


def find_distinct(values: Places) -> Places:
    """Return the distinct values in ascending order by sorting, which is faster than hashing here."""
    ordered = np.sort(values, axis=None)
    if ordered.size:
        is_first: NDArray[np.bool_] = np.append(True, ordered[1:] != ordered[:-1])
        ordered = ordered[is_first]
    return ordered


def _find_used_ids(wanted: Sequence[Places]) -> Places:
    """Return the node ids of elements in ascending order."""
    highest = max((int(node_ids.max(initial=0)) for node_ids in wanted), default=0)
    if highest > _DENSE:
        used = find_distinct(
            np.concatenate([find_distinct(node_ids) for node_ids in wanted])
        )
        return used[used > 0]
    mask = np.zeros(highest + 1, bool)
    for node_ids in wanted:
        mask[node_ids] = True
    mask[0] = False
    return np.flatnonzero(mask)


class NodeTable:
    """The nodes of a mesh by index: first the nodes with coordinates, then the nodes that occur only in elements.

    ``ids`` (nodes,) contains the node id at each index.

    Examples
    --------
    >>> table = NodeTable(np.array([3, 7, 5]), [np.array([[7, 9, 0]])])
    >>> table.ids.tolist(), table.places(np.array([[7, 9, 0]])).tolist(), table.known(np.array([4, 7])).tolist()
    ([3, 7, 5, 9], [[1, 3, -1]], [1])
    """

    def __init__(self, ids: Places, elements: Sequence[Places]) -> None:
        used = _find_used_ids(elements)
        self.ids = np.concatenate([ids, used[~np.isin(used, ids)]])
        self._order = np.argsort(self.ids, kind="stable")
        self._sorted = self.ids[self._order]

    def places(self, ids: Places) -> Places:
        """Return the index of each node id; `NO_NODE` for a node that is not in the table."""
        if not self.ids.size:
            return np.full_like(ids, NO_NODE)
        if self._sorted[-1] <= _DENSE:
            if ids.min(initial=0) < 0 or ids.max(initial=0) >= self._lookup.size:
                ids = np.where((ids > 0) & (ids < self._lookup.size), ids, 0)
            return np.asarray(self._lookup[ids])
        at = np.minimum(np.searchsorted(self._sorted, ids), self.ids.size - 1)
        return np.where(self._sorted[at] == ids, self._order[at], NO_NODE)

    def known(self, ids: Places) -> Places:
        """Return the indices of the nodes that are in the table."""
        places_or_none = self.places(ids)
        return np.asarray(places_or_none[places_or_none != NO_NODE])

    @cached_property
    def _lookup(self) -> Places:
        """Return an array of indices by id if all ids are small, because it is faster than a search."""
        lookup = np.full(int(self._sorted[-1]) + 1, NO_NODE, np.int64)
        lookup[self._sorted[::-1]] = self._order[::-1]
        return lookup


class Elements(NamedTuple):
    """Elements of one kind: part ids, shape (n,), and indices of their nodes in the table, shape (n, nodes)."""

    kind: str
    part: Places
    nodes: Places


class Mesh(NamedTuple):
    """Elements of a deck by kind, with their node table and the coordinates of the nodes.

    ``lost`` is the number of element nodes without coordinates.
    """

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
        """Join blocks of elements (kind, part ids, node ids), and add all nodes that have coordinates."""
        blocks = [block for block in blocks if len(block[1])]
        kinds = sorted({(kind, nodes.shape[1]) for kind, _, nodes in blocks})
        blocks_by_kind = [
            [block for block in blocks if (block[0], block[2].shape[1]) == kind]
            for kind in kinds
        ]
        nodes = [
            np.concatenate([node_ids for _, _, node_ids in same_kind])
            for same_kind in blocks_by_kind
        ]
        table = NodeTable(ids, nodes)
        elements = tuple(
            Elements(
                same_kind[0][0],
                np.concatenate([part for _, part, _ in same_kind]),
                table.places(node_ids),
            )
            for same_kind, node_ids in zip(blocks_by_kind, nodes, strict=True)
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
        """Return the element kinds of each part, keyed by part id."""
        kinds_by_part: dict[int, set[str]] = {}
        for elements in self.elements:
            for part in np.unique(elements.part).tolist():
                kinds_by_part.setdefault(part, set()).add(elements.kind)
        return kinds_by_part

    def doubts(self, parts: Collection[int], sign: str) -> Iterator[str]:
        """Yield notes on elements of undefined parts, and on nodes without coordinates.

        ``sign`` is the character with which keywords begin.
        """
        if unknown := sorted(self.kinds.keys() - parts):
            yield f"elements of {name_units(unknown)}, which no {sign}PART of the deck defines"
        if self.lost:
            yield f"{self.lost} nodes of elements are not in any {sign}NODE of the deck"


class _RadiossElementKind(NamedTuple):
    """A Radioss element kind: its name, the nodes that define its size, and the number of ids per line."""

    name: str
    nodes: int
    lines: tuple[int, ...]


KINDS: Final = {
    "SHELL": _RadiossElementKind("shell", 4, (5,)),
    "SH3N": _RadiossElementKind("triangle", 3, (4,)),
    "BRICK": _RadiossElementKind("solid", 8, (9,)),
    "TETRA4": _RadiossElementKind("tetrahedron", 4, (5,)),
    "PENTA6": _RadiossElementKind("pentahedron", 6, (7,)),
    "QUAD": _RadiossElementKind("quad", 4, (5,)),
    "TRIA": _RadiossElementKind("tria", 3, (4,)),
    "BEAM": _RadiossElementKind("beam", 2, (3,)),
    "TRUSS": _RadiossElementKind("truss", 2, (3,)),
    "SPRING": _RadiossElementKind("spring", 2, (3,)),
    "TETRA10": _RadiossElementKind("tetrahedron", 10, (1, 10)),
    "BRIC20": _RadiossElementKind("solid", 20, (9, 8, 4)),
    "SHEL16": _RadiossElementKind("thick shell", 16, (9, 8)),
}


def read_elements(
    card: Card, *, damaged: bool = False
) -> Iterator[tuple[str, Integers, Integers]]:
    """Yield kind, part ids and node ids of the elements on a card; a missing node has the id 0.

    If ``damaged`` is True, elements with incomplete ids are yielded, too.
    """
    kind = KINDS[card.words[0]]
    fields = make_radioss_element_line(max(kind.lines)).layout
    line_ids = [
        lines.integers(fields) for lines in read_lines(card, _COMMENTS) if len(lines)
    ]
    if not line_ids:
        return
    values = np.concatenate(line_ids)
    lines_per_element = len(kind.lines)
    values = values[: len(values) // lines_per_element * lines_per_element].reshape(
        -1, lines_per_element, values.shape[1]
    )
    flat = np.concatenate(
        [values[:, line, :count] for line, count in enumerate(kind.lines)], axis=1
    )
    is_element = (flat[:, : 1 + min(kind.nodes, 3)] > 0).all(axis=1) | damaged
    nodes = np.maximum(flat[is_element, 1 : 1 + kind.nodes], 0)
    yield kind.name, np.full(len(nodes), get_number(card), np.int64), nodes


def find_parts_with_elements(starter: Starter) -> set[int]:
    """Return the parts that have any elements."""
    return {part for part, _ in _read_element_blocks(starter)}


def find_parts_within(
    starter: Starter, groups: Mapping[int, tuple[Collection[int], Collection[int]]]
) -> dict[int, set[int]]:
    """Return, for each group of nodes and parts, the parts whose nodes all belong to the group."""
    elements = [*_read_element_blocks(starter)]
    inside: dict[int, set[int]] = {}
    for key, (nodes, parts) in groups.items():
        of_parts = [members.ravel() for part, members in elements if part in parts]
        group_nodes = np.unique(np.concatenate([np.array([0, *nodes]), *of_parts]))
        inside[key] = {part for part, _ in elements}
        for part, members in elements:
            if part not in inside[key]:
                continue
            has_nodes = bool((members > 0).any(axis=1).all())
            if not has_nodes or not np.isin(members, group_nodes).all():
                inside[key].discard(part)
    return inside


def _read_element_blocks(starter: Starter) -> Iterator[tuple[int, Integers]]:
    """Yield part ids and node ids of elements, block by block; the node ids are 0 if the lines cannot be read."""
    for card in starter.named(*KINDS, *NOT_COUNTED):
        kind = KINDS.get(card.words[0])
        if kind and len(kind.lines) == 1 and card.words[1:]:
            yield from (
                (get_number(card), nodes)
                for _, _, nodes in read_elements(card, damaged=True)
            )
        elif card.words[1:]:
            yield get_number(card), np.zeros((1, 1), np.int64)


def read_nodes(cards: Iterable[Card]) -> tuple[Integers, Reals]:
    """Return ids (n,) and coordinates (n, 3) of nodes [length]."""
    ids = [np.empty(0, np.int64)]
    coordinates = [np.empty((0, 3))]
    fields = NODE.layout
    for card in cards:
        for lines in read_lines(card, _COMMENTS):
            if len(lines):
                numbers = lines.integers(fields[:1])[:, 0]
                ids.append(numbers[numbers > 0])
                coordinates.append(lines.reals(fields, slice(1, 4))[numbers > 0])
    return np.concatenate(ids), np.concatenate(coordinates)
