"""Parts by number, range and title."""

import pytest

from d2rpick.base.errors import FormatError
from d2rpick.histories.names import Part, select_parts

PARTS = [
    Part(12, "Roof"),
    Part(3, "seat, left"),
    Part(7, ""),
    Part(19, "door"),
    Part(20, "door"),
    Part(4, "12"),
]


@pytest.mark.parametrize(
    ("wanted", "ids"),
    [
        (["3"], [3]),
        (["3,7"], [3, 7]),
        (["7, 3"], [3, 7]),
        (["10-19"], [12, 19]),
        (["10 - 19"], [12, 19]),
        (["7", "3"], [3, 7]),
        (["3", "2-7"], [3, 7, 4]),
        (["roof"], [12]),
        (["ROOF,7"], [12, 7]),
        (["Seat, Left"], [3]),
        (["20"], [20]),
    ],
)
def test_parts_come_in_the_order_of_the_file_and_once(
    wanted: list[str], ids: list[int]
) -> None:
    assert [part.id for part in select_parts(wanted, PARTS, "run")] == ids


@pytest.mark.parametrize(
    ("wanted", "reason"),
    [
        (
            ["5"],
            r"run: no part 5 \(expected part ids, not set ids\); there are: 12 'Roof', 3 'seat, left', 7, 19 'door'",
        ),
        (["13-18"], "no part 13-18"),
        (["19-10"], "19-10 runs backwards; write 10-19"),
        (["rof"], r"no part 'rof' \(did you mean 'Roof'\?\)"),
        (
            ["door"],
            "'door' is the title of several parts, choose by number: 19 'door', 20 'door'",
        ),
        (["12"], "'12' is the title of part 4, as a number it means 12 'Roof'"),
        (["3,"], "the id or title of a part is missing"),
        (["-3"], "no part '-3'"),
        ([""], "the id or title of a part is missing"),
    ],
)
def test_what_names_no_part_or_several_is_refused(
    wanted: list[str], reason: str
) -> None:
    with pytest.raises(FormatError, match=reason):
        select_parts(wanted, PARTS, "run")
