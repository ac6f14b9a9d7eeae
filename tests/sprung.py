"""Radioss deck of cubes on springs, whose masses and stiffnesses are known."""

from tests.decks import pad

REAL = 20
DENSITY, MODULUS = 1000.0, 1e9


def write_cubes(
    masses: tuple[float, ...],
    springs: list[tuple[int, int, float]],
    prop: str = "SPRING",
    extra_text: str = "",
) -> str:
    """Write cubes with these masses in a row along x, 10 apart, and springs between corners; cube 1 begins with corner
    10.
    """
    sides = [(mass / DENSITY) ** (1 / 3) for mass in masses]
    corners = [
        (0, 0, 0),
        (1, 0, 0),
        (1, 1, 0),
        (0, 1, 0),
        (0, 0, 1),
        (1, 0, 1),
        (1, 1, 1),
        (0, 1, 1),
    ]
    text = (
        "#RADIOSS STARTER\n/BEGIN\nbox\n"
        + pad(2022, 0)
        + 2 * pad("kg", "m", "s", width=REAL)
    )
    text += f"/MAT/ELAST/1\nm\n{pad(DENSITY, width=REAL)}{pad(MODULUS, 0.3, width=REAL)}/PROP/SOLID/1\ns\n{pad(24)}"
    for number, side in enumerate(sides, start=1):
        nodes = [
            (10 * number + i, *(side * first_block for first_block in corner))
            for i, corner in enumerate(corners)
        ]
        text += "/NODE\n" + "".join(
            pad(n)[:-1] + pad(x + 10 * number, y, z, width=REAL) for n, x, y, z in nodes
        )
        text += f"/PART/{number}\np\n{pad(1, 1)}/BRICK/{number}\n{pad(number, *(n for n, *_ in nodes))}"
    for number, (first_block, second_block, stiffness) in enumerate(springs, start=50):
        text += f"/PROP/{prop}/{number}\nk\n{pad(0.0, width=REAL)}{pad(stiffness, 10.0, width=REAL)}{extra_text}"
        text += f"/PART/{number}\nk\n{pad(number, 1)}/SPRING/{number}\n{pad(number, first_block, second_block)}"
    return text + "/END\n"
