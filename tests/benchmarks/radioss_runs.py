"""Compare `check` with the listings of OpenRadioss for random Radioss runs: when each part is rigid.

``OPENRADIOSS_PATH=... python -m tests.benchmarks.radioss_runs 20 1`` writes 20 runs with seeds from 1 on, lets the
solver compute them, and compares the windows of `check` with the listings.  Bodies have groups of parts or of nodes,
are merged, and are switched by engine files and by sensors that are reset.  Decks have included files, and files
without a final line end.
"""

import random
import sys
import tempfile
from math import inf
from pathlib import Path

from tests.deck.test_openradioss import run_solver
from tests.deck.test_solver_listings import (
    OFF,
    ON,
    RESET,
    STEP,
    Listed,
    find_spans_by_check,
    find_spans_by_listing,
    write_body,
    write_clock,
    write_logic,
    write_merge,
    write_run,
)
from tests.decks import pad

PARTS = (1, 2, 3)


def write_group(chance: random.Random, part: int) -> tuple[int, str]:
    """Return the card and number of a group with all nodes of a part: a group of parts, of nodes, or of groups."""
    number = 10 * part
    nodes = [number + corner for corner in range(1, 5)]
    kind = chance.choice(["PART", "NODE", "NODENS", "GRNOD", "GENE"])
    if kind == "PART":
        return part, ""
    if kind in ("NODE", "NODENS"):
        return number, f"/GRNOD/{kind}/{number}\nnodes\n{pad(*nodes)}"
    if kind == "GENE":
        return (
            number,
            f"/GRNOD/GENE/{number}\nnodes\n{pad(nodes[0], nodes[-1])}",
        )
    inner = f"/GRNOD/NODE/{number + 1}\ninner\n{pad(*nodes[:3])}"
    outer = f"/GRNOD/NODE/{number + 2}\nrest\n{pad(nodes[3])}"
    return (
        number,
        f"{inner}{outer}/GRNOD/GRNOD/{number}\nboth\n{pad(number + 1, number + 2)}",
    )


def write_sensors(chance: random.Random) -> str:
    """Write two time sensors and a sensor that combines both, number 7."""
    times = [chance.randint(0, 6) / 1000 for _ in range(4)]
    clocks = write_clock(5, times[0], chance.choice([None, times[1]])) + write_clock(
        6, times[2], chance.choice([None, times[3]])
    )
    kind = chance.choice(["OR", "AND", "NOT"])
    operand_count = (5,) if kind == "NOT" else (5, 6)
    return clocks + write_logic(kind, 7, *operand_count)


def write_leg(
    chance: random.Random, nodes: list[int], bodies_off: set[int], *, first: bool
) -> str:
    """Write the switches of a leg: main nodes in any order, over several lines or cards; possibly a reset.

    ``off`` are the nodes whose bodies are off by now.  The listing of one that is switched on while it is on would say
    that it begins to be rigid there.
    """
    lines = []
    on = chance.sample(sorted(bodies_off), chance.randint(0, len(bodies_off)))
    other_nodes = [node for node in nodes if node not in on]
    put_off = chance.sample(other_nodes, chance.randint(0, len(other_nodes)))
    cards = [
        (keyword, chosen) for keyword, chosen in ((ON, on), (OFF, put_off)) if chosen
    ]
    chance.shuffle(cards)
    for keyword, chosen in cards:
        lines.append(keyword + chance.choice([" ", "\n"]).join(map(str, chosen)))
    bodies_off -= {*on}
    bodies_off |= {*put_off}
    if not first and chance.random() < 0.2:
        lines.append(RESET + "5 6")
    if chance.random() < 0.3:
        lines.insert(0, "# a comment")
    return "\n".join(lines)


def draw_run(seed: int) -> Listed:
    """Draw a random run of one to three bodies."""
    chance = random.Random(seed)
    starter, nodes = "", []
    parts = chance.sample(PARTS, chance.randint(1, 3))
    sensed = chance.random() < 0.4
    group_count = 0
    for number, part in sorted(
        (chance.randint(1, 9) * 10 + part, part) for part in parts
    ):
        is_named = chance.random() < 0.75
        group_count += not is_named
        node = 100 + part if is_named else 0
        nodes.append(node or 103 + group_count)
        group, text = write_group(chance, part)
        sensor = chance.choice([5, 7]) if sensed and part == parts[0] else 0
        starter += text + write_body(number, node, part, sensor).replace(
            pad(part, 0, 0, 0), pad(group, 0, 0, 0), 1
        )
    if sensed:
        starter += write_sensors(chance)
    elif len(parts) > 1 and chance.random() < 0.5:
        ids = sorted(
            int(line.rsplit("/", 1)[1])
            for line in starter.splitlines()
            if line.startswith("/RBODY/")
        )
        first, second_part = chance.sample(ids, 2)
        starter += write_merge((first, 1, second_part, 1))
    count = chance.choice([1, 2, 3])
    bodies_off: set[int] = set()
    legs = tuple(
        write_leg(chance, nodes, bodies_off, first=window_index == 0)
        for window_index in range(count)
    )
    return Listed(starter, legs, {}, chance.choice([2018, 2023]))


def spread_over_files(folder: Path, chance: random.Random, starter: str) -> None:
    """Move the bodies of a run to an included file, or to a file included by it; drop final line endings."""
    main = folder / "X_0000.rad"
    text = main.read_text()
    if starter and chance.random() < 0.5:
        inner = chance.random() < 0.5
        (folder / "bodies.inc").write_text(starter.rstrip("\n"))
        if inner:
            (folder / "outer.inc").write_text("# bodies\n#include bodies.inc\n")
        name = "outer.inc" if inner else "bodies.inc"
        text = text.replace(starter, f"#include {name}\n")
    if chance.random() < 0.5:
        text = text.rstrip("\n") + chance.choice(["", "\n# end"])
    main.write_text(text)
    for engine in folder.glob("X_000[1-9].rad"):
        if chance.random() < 0.5:
            engine.write_text(
                engine.read_text().rstrip("\n") + chance.choice(["", "\n/END/ENGINE"])
            )


def compare(folder: Path, seed: int) -> str:
    """Compare `check` with the listing of a run; return an empty text if both agree."""
    run = draw_run(seed)
    main = write_run(folder, run)
    spread_over_files(folder, random.Random(seed), run.starter)
    run_solver(folder, "X")
    listed, checked = find_spans_by_listing(folder), find_spans_by_check(main)
    closed = {
        part: [(tr, inf if td is None else td) for tr, td in spans]
        for part, spans in checked.items()
    }
    spans_to_compare = {
        part: [span for span in spans if span[1] - span[0] > 4 * STEP]
        for part, spans in closed.items()
    }
    spans_to_compare = {
        part: spans for part, spans in spans_to_compare.items() if spans
    }
    agree = listed.keys() == spans_to_compare.keys() and all(
        len(listed[part]) == len(spans)
        and all(
            abs(time - listed_time) <= 4 * STEP or time == listed_time
            for span, listed_span in zip(spans, listed[part], strict=True)
            for time, listed_time in zip(span, listed_span, strict=True)
        )
        for part, spans in spans_to_compare.items()
    )
    return "" if agree else f"listing {listed}, check {spans_to_compare}"


def main(count: int, seed: int) -> None:
    """Compute some runs, and print in how many `check` agrees with the listing."""
    wrong_count = 0
    for number in range(seed, seed + count):
        with tempfile.TemporaryDirectory() as folder:
            try:
                difference = compare(Path(folder), number)
            except AssertionError as error:
                difference = f"not compared: {str(error)[-300:]}"
        if difference:
            wrong_count += 1
            print(f"seed {number}: {difference}", flush=True)
    print(f"{count - wrong_count} of {count} agree")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
