"""What cannot be run has one line that says where, what and what to do; what has no answer is an objection."""

import gzip
import json
import math
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.command import BOX, DECK, ENERGY, GLSTAT, MATSUM, OSCILLATOR, ROLLOVER, answer, codes, put, refused, run
from tests.computed import stored
from tests.json_schemas import checked
from tests.sample_deck import DECK as SAMPLE

HEAD = "time,internal_energy\n"
CAR = stored("carT01.gz")


def table(energy: Callable[[float], float], states: int = 101) -> bytes:
    """Give a CSV file with an energy at every hundredth of a second."""
    return (HEAD + "".join(f"{i / 100!r},{energy(i / 100)!r}\n" for i in range(states))).encode()


def with_line(number: int, line: str) -> bytes:
    """Give a good CSV file but for its ``number``-th line."""
    lines = table(lambda t: t * t).decode().split("\n")
    lines[number - 1] = line
    return "\n".join(lines).encode()


# Files that are no history: content, further arguments, and what the message has to say.
FILES = {
    "empty": (b"", (), ["input: the file is empty", "has the run been started?"]),
    "binary": (bytes(range(256)) * 20, (), ["input: binary data", "csv", "glstat", "export"]),
    "prose": (b"Dear all,\nplease find enclosed\n", (), ["input:1: 'Dear all,'", "a table of time and energy"]),
    "header only": (HEAD.encode(), (), ["input:1: ", "no rows"]),
    "one state": (table(lambda _: 1.0, 1), (), ["input: 1 state", "at least 3"]),
    "two states": (table(lambda t: 1 + t, 2), (), ["input: 2 states", "at least 3"]),
    "nan": (with_line(7, "0.05,nan"), (), ["input:7: 'internal_energy' is 'nan'", "a number was expected", "line"]),
    "infinite": (with_line(7, "0.05,inf"), (), ["input:7: 'internal_energy' is 'inf'", "a number was expected"]),
    "a word": (with_line(7, "0.05,stop"), (), ["input:7: 'internal_energy' is 'stop'", "a number was expected"]),
    "an empty cell": (with_line(7, "0.05,"), (), ["input:7: 'internal_energy' is ''", "a number was expected"]),
    "a cell too few": (with_line(7, "0.05"), (), ["input:7: 1 value", "2 were expected"]),
    "a time that is none": (with_line(7, "later,1"), (), ["input:7: 'time' is 'later'", "a number was expected"]),
    "damaged gzip": (gzip.compress(table(math.cos))[:10] + b"\xff" * 99, (), ["input: damaged gzip data", "again"]),
    "not glstat": (table(math.cos), ("-F", "glstat"), ["input:1: ", "this is not a glstat"]),
    "no state of glstat": (
        b" title\n                         ls-dyna smp.1 d\n\n\n", (), ["input: no states", "first output"]
    ),
    "several energies": (
        b"time,IE_a,IE_b\n0,1,2\n1,2,3\n2,3,4\n", (), ["input: 2 columns", "--energy", "2 'IE_a', 3 'IE_b'"]
    ),
    "no energy": (b"time,vx,vy\n0,1,2\n1,2,3\n2,3,4\n", (), ["input: no column", "--energy", "2 'vx', 3 'vy'"]),
    "unknown column": (table(math.cos), ("--energy", "heat"), ["input: no column 'heat'", "2 'internal_energy'"]),
    "column misspelt": (
        table(math.cos), ("--energy", "internal_enrg"), ["no column 'internal_enrg'", "did you mean 'internal_energy'"]
    ),
    "column zero": (table(math.cos), ("--energy", "0"), ["no column '0'", "1 'time'"]),
    "energy is the time": (table(math.cos), ("--energy", "time"), ["input: ", "choose another one as energy"]),
    "td after the record": (table(math.cos), ("--td", "7"), ["input: ", "--td 7 lies outside the record, 0 to 1"]),
    "after outside": (table(math.cos), ("--after", "7"), ["input: --after 7 lies outside the record, 0 to 1"]),
    "window outside": (table(math.cos), ("--fit-window", "0", "7"), ["--fit-window 0 7 reaches outside the record"]),
}  # fmt: skip


@pytest.mark.parametrize("case", FILES)
@pytest.mark.parametrize("command", ["suggest", "verify"])
@pytest.mark.usefixtures("here")
def test_a_file_that_cannot_be_used_is_named_with_what_is_wrong(command: str, case: str) -> None:
    content, args, parts = FILES[case]
    Path("input").write_bytes(content)
    first = ("suggest",) if command == "suggest" else ("verify", "--tr", "0")
    message = refused(*first, "--td", "0.5", *args, "input")
    assert message.startswith("input:")
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    ("args", "parts"),
    [
        (("absent.csv",), ["absent.csv: no such file", "check the name"]),
        (
            (str(Path(__file__).parent),),
            [f"{Path(__file__).parent}: no glstat, matsum, binout or T01", "give the file"],
        ),
        ((GLSTAT, "-F", "csv"), [f"{GLSTAT}:1: ", "a table of time and energy"]),
        ((GLSTAT, "--energy", "internal enrgy"), ["did you mean 'internal energy'", "kinetic energy"]),
        ((GLSTAT, "--time", "cycle"), ["no time 'cycle'", "leave --time out"]),
        ((ROLLOVER,), [f"{ROLLOVER}: 3 columns", "--energy", "'boxIE_J'"]),
    ],
)
def test_an_input_that_is_not_there_or_not_so_is_named(args: tuple[str, ...], parts: list[str]) -> None:
    message = refused("suggest", "--td", "0.064", *args)
    for part in parts:
        assert part in message


GIVEN = shlex.join(OSCILLATOR)
ONE_COMMAND = f"replay {GIVEN} --t-end 0.01 --dt 1e-3"


@pytest.mark.parametrize(
    ("line", "parts"),
    [
        ("sugest --td 1 x", ["No such command 'sugest'", "Did you mean 'suggest'?", "d2rpick --help"]),
        ("dance", ["No such command 'dance'", "plan, suggest"]),
        ("suggest --tdd 1 x", ["--tdd", "Did you mean", "--td", "d2rpick suggest --help"]),
        ("verify --tolerence 1 x", ["--tolerence", "Did you mean", "--tolerance"]),
        ("suggest --td 1 --td-window 1 2 x", ["--td", "--td-window"]),
        ("verify --td 1 x", ["--tr"]),
        ("suggest --td 1", ["HISTORY"]),
        ("suggest --td 1 x y", ["x: no such file"]),
        ("suggest --td 1 --part 1 --energy 2 x", ["--energy and --part exclude each other"]),
        ("suggest --td 64ms x", ["--td", "'64ms' is not a number"]),
        ("suggest --td 0,064 x", ["--td", "'0,064' is not a number"]),
        ("suggest --td nan x", ["--td", "finite"]),
        ("suggest --td inf x", ["--td", "finite"]),
        ("suggest --td 1 -f jsno x", ["'jsno'", "'json'"]),
        ("verify --tr 1 --td 2 -f value x", ["'value'", "'markdown'"]),
        ("suggest --td 1 -F d3plot x", ["'d3plot'", "'hdf5'", "'glstat'"]),
        ("suggest --td 1 --limit 0 x", ["--limit", "1"]),
        ("suggest --td 1 --margin -1 x", ["--margin", "-1 was found", "at least 0 was expected"]),
        ("suggest --td 1 --tolerance -1 x", ["--tolerance", "at least 0 was expected"]),
        ("suggest --td 1 --stiffness 0 x", ["--stiffness", "above 0 was expected"]),
        ("suggest --td 1 --step-ratio 0.5 --cost-share 0.5 x", ["--step-ratio", "at least 1 was expected"]),
        ("parts --deck x --step-ratio 0.5 x", ["--step-ratio", "at least 1 was expected"]),
        # contradictions
        (f"verify --tr 0.07 --td 0.064 {ENERGY}", ["tr 0.07 is not before td 0.064"]),
        (f"verify --tr 0.064 --td 0.064 {ENERGY}", ["tr 0.064 is not before td 0.064"]),
        (f"suggest --td -1 {ENERGY}", [ENERGY, "--td -1 lies outside the record, 0 to 0.15"]),
        (f"verify --tr -1 --td 0.064 {ENERGY}", [ENERGY, "--tr -1 lies outside the record, 0 to 0.15"]),
        (f"suggest --td 0.064 {GIVEN} --no-verify {ENERGY}", ["an oscillator", "--no-verify", "exclude"]),
        (f"suggest --td 0.064 {GIVEN} --fit-window 0 0.1 {ENERGY}", ["an oscillator", "--fit-window", "exclude"]),
        (f"suggest --td 0.064 --no-verify --fit-window 0 0.1 {ENERGY}", ["--no-verify", "--fit-window", "exclude"]),
        (f"suggest --td 0.064 --fit-window 0.1 0.05 {ENERGY}", ["--fit-window 0.1 0.05 is empty"]),
        (f"suggest --td 0.064 --mass 31.4 {ENERGY}", ["--mass needs --stiffness"]),
        (f"suggest --td 0.064 {GIVEN} --frame-mass 2 {ENERGY}", ["either --frame-mass or --beta"]),
        (f"suggest --td 0.064 {GIVEN} --alpha 5000 {ENERGY}", ["alpha 5000", "less than 502.2"]),
        (f"suggest --td 0.064 {GIVEN} --mass 1e-308 {ENERGY}", ["mass is 1e-308", "from 1e-100 to 1e+100"]),
        (f"verify --tr 0.01 --td 0.064 {GIVEN} --beta 1e308 {ENERGY}", ["frame_mass is 3.1", "from 1e-100 to 1e+100"]),
        (f"explore --td-window 0.06 0.07 {GIVEN} --v0 -1e308 {ENERGY}", ["v0 is -1e+308", "energies above 1e+150"]),
        (f"suggest --td 0.064 {GIVEN} --v0 1e155 {ENERGY}", ["v0 is 1e+155", "energies above 1e+150"]),
        # no name of a file; no shell can pass it
        ("suggest --td 1 'a\0b'", ["'a\\x00b' holds a NUL byte"]),
        (f"suggest --td 0.064 -o 'a\0b' {ENERGY}", ["--output-file", "NUL byte"]),
        (f"plan --deck 'a\0b' {ENERGY}", ["--deck", "NUL byte"]),
        ("check 'a\0b'", ["NUL byte"]),
        # replay
        ("replay", ["--stiffness"]),
        ("replay --stiffness 1 --mass 1 --v0 1 --t-end 1 --dt 1", ["either --frame-mass or --beta"]),
        ("replay --stiffness 1 --mass 1 --beta 1 --t-end 1 --dt 1", ["needs a start", "--v0", "--vy0"]),
        (f"{ONE_COMMAND} --vz0 1", ["--v0 and --vz0 exclude each other"]),
        (f"{ONE_COMMAND} --dt 0", ["--dt", "above 0 was expected"]),
        (f"{ONE_COMMAND} --dt 1e-12", ["--dt 1e-12", "10000000"]),
        (f"{ONE_COMMAND} --tr 0.006", ["--tr and --td need each other"]),
        (f"{ONE_COMMAND} --td 0.006", ["--tr and --td need each other"]),
        (f"{ONE_COMMAND} --tr 0.006 --td 0.005", ["--tr 0.006 is not before --td 0.005"]),
        (f"{ONE_COMMAND} -o motion.txt", ["motion.txt", "--write-as: csv, hdf5, glstat, matsum"]),
        ("replay --stiffness 1 --mass 1 --beta 1 --v0 1 --t-end 1e-308 --dt 1e-308", ["exceeds the range of numbers"]),
        # files to be written; all of them are known to be wrong before anything is computed
        (f"suggest --td 0.064 -o absent/result.txt {ENERGY}", ["absent/result.txt: no such folder: 'absent'"]),
        (f"suggest --td 0.064 -o . {ENERGY}", [".: this is a folder"]),
        (f"suggest --td 0.064 -o '' {ENERGY}", ["this is a folder"]),
        (f"suggest --td 0.064 --plot absent/plot.png {ENERGY}", ["absent/plot.png: no such folder: 'absent'"]),
        (f"suggest --td 0.064 --plot plot.gif {ENERGY}", ["plot.gif", "png, svg, pdf"]),
        (f"suggest --td 0.064 --plot plot {ENERGY}", ["plot: ", "png, svg, pdf"]),
        (f"suggest --td 0.064 -o x.svg --plot ./x.svg {ENERGY}", ["--plot and --output-file are the same file"]),
        (f"{ONE_COMMAND} --plot plot.gif", ["plot.gif", "png, svg, pdf"]),
    ],
)  # fmt: skip
def test_a_usage_that_makes_no_sense_is_explained_in_one_line(line: str, parts: list[str], here: Path) -> None:
    message = refused(*shlex.split(line))
    for part in parts:
        assert part in message
    assert not list(here.iterdir())


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (f"explore --td-window 0.07 0.06 {ENERGY}", "the lower time first"),
        (f"explore --td-window 1 2 {ENERGY}", "outside the record"),
        (f"explore --td 9 {ENERGY}", "outside the record"),
        (f"explore --steps 0 {ENERGY}", "--steps"),
        (f"plan --all {ENERGY}", "--all belongs to -f value, -f card and --write-deck"),
        (f"plan --before {BOX} {BOX}", "name its windows with --done"),
        (f"plan -f card {ENERGY}", "needs --part"),
        (f"plan --node 3 {ENERGY}", "is about the card"),
        (f"plan --done nowhere.txt {BOX}", "nowhere.txt: no such file; check the name and the folder"),
        (f"plan --min-rigid -1 {BOX}", "at least 0"),
        (f"parts --tr 0.1 {MATSUM}", "--tr needs --td"),
        (f"parts --tr 0.3 --td 0.1 {MATSUM}", "tr must lie before td"),
        (f"parts --weights site.toml {MATSUM}", "--weights needs --deck"),
        (f"parts --deck absent.k {MATSUM}", "absent.k"),
        (f"parts --deck {MATSUM} {MATSUM}", "no keyword was found"),
        (f"parts --energy 1 {MATSUM}", "--energy names one energy"),
        (f"parts --part 77 --deck {SAMPLE} {MATSUM}", "no part 77"),
        (f"parts --part recommended --deck {SAMPLE} {MATSUM}", "name a set that it is compared with"),
        (f"parts --weights {SAMPLE} --deck {SAMPLE} {MATSUM}", "TOML file of weights was expected"),
        ("card --part 1 --tr 0.09 --td 0.02", "0 <= tr < td was expected"),
        ("card --tr 0.01 --td 0.02", "needs --part"),
        ("card --part 1 --td 0.02", "a card needs --tr"),
        ("card --part 1 --tr 0.02 --td 0.09 --tr 0.2", "2 --tr and 1 --td"),
        ("card --part 1 --tr 0.02 --td 0.09 --windows w.txt", "--windows excludes"),
        ("card --part 1 --windows absent.txt", "absent.txt"),
        ("card --part 1 --tr 0.02 --td 0.09 --tr 0.05 --td 0.2", "overlaps"),
        ("card --part 1 --tr 0.2 --td 0.3 --tr 0.05 --td 0.09", "lies before"),
        ("card --part door --tr 0.01 --td 0.02", "titles need a --history"),
        ("card --part 1-99999999 --tr 0.01 --td 0.02", "is not a range"),
        ("card --part 9-3 --tr 0.01 --td 0.02", "is not a range"),
        ("card --part 0 --tr 0.01 --td 0.02", "does not fit"),
        ("card --part 1 --node 3 --tr 0.01 --td 0.02", "--node is an option of --solver radioss"),
        ("card --solver radioss --part 1 --tr 0.01 --td 0.02", "needs --node"),
        ("card --solver radioss --node 1 --tr 0.01 --td 0.02", "needs --end"),
        ("card --solver radioss --node 1 --end 0.015 --tr 0.01 --td 0.02", "the run ends at 0.015"),
        (
            "card --solver radioss --node 1 --merge 1 --end 1 --tr 0.01 --td 0.02",
            "--merge is an option of --solver ls-dyna",
        ),
        ("card --solver radioss --part 7 --node 1 --end 1 --tr 0.01 --td 0.02", "give a --history with parts"),
        (
            f"card --solver radioss --part 7 --node 1 --tr 0.01 --td 0.02 --history {ENERGY}",
            "give a --history with parts",
        ),
        ("card --solver radioss --node 1 --end 1 --name a/b --tr 0.01 --td 0.02", "the name of the run is 'a/b'"),
        ("card --solver radioss --node 1 --end 1 --name '' --tr 0.01 --td 0.02", "the name of the run is ''"),
        ("card --part 1 --swset 5 5 --tr 0.01 --td 0.02", "both switch sets are 5"),
        ("card --part 1 --margin 0 --tr 0.01 --td 0.02", "--margin needs an energy history"),
        ("card --part 1 --tolerance 0.3 --tr 0.01 --td 0.02", "--tolerance needs an energy history"),
        ("card --part 1 -F csv --tr 0.01 --td 0.02", "--input-format needs an energy history"),
        ("card --part 1 --after 0.01 --tr 0.01 --td 0.02", "give one with --history"),
        (f"card --part 1 --tr 0.01 --td 7 --history {ENERGY}", "lies outside the record"),
        (f"check {DECK} --select D2R10l", "did you mean D2R1"),
        (f"check {DECK} --ignore D2R999", "no rule 'D2R999'"),
        (f"check {DECK} --after 0.03", "give one with --history"),
        (f"check {DECK} --energy boxIE_J", "give one with --history"),
        (f"check {DECK} --history absent.csv", "absent.csv"),
        (f"check {DECK} --history {ENERGY} --after 7", "--after 7 lies outside the record"),
        (f"check {DECK} --fail-on info", "info"),
        (f"check {DECK} -f toml", "toml"),
        (f"follow --once --wait 0.002 {CAR}", "--wait 0.002 is below"),
        (f"follow --once {GLSTAT}", "neither a momentum nor the energy of contacts"),
        (f"follow --once --for 3 {CAR}", "--once and --for exclude each other"),
        (f"follow --once --wait 0 {CAR}", "--wait"),
        (f"follow --once --part nobody {CAR}", "nobody"),
        (f"follow --once --deck /nowhere.rad {CAR}", "/nowhere.rad"),
        (f"suggest --td-window 0.07 0.06 {ENERGY}", "--td-window 0.07 0.06 is empty"),
        (f"suggest --td 0.06 --step-ratio 2 {ENERGY}", "--step-ratio needs --cost-share"),
        (f"suggest --td 0.06 --cost-share 2 {ENERGY}", "at most 1"),
    ],
)
@pytest.mark.usefixtures("here")
def test_what_a_command_cannot_do_is_told_in_one_line(line: str, told: str) -> None:
    assert told in refused(*shlex.split(line))


@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("suggest --td 0.064 --margin 1e308", 1),
        ("suggest --td-window 0.06 0.07 --margin 1e308", 1),
        ("explore --td-window 0.06 0.07 --steps 2 --margin 1e308", 1),
        ("plan --margin 1e308", 1),
        ("suggest --td 0.064 --margin 1e-308", 0),
        ("suggest --td 0.064 --margin -0.0", 0),
        ("suggest --td 0.064 --max-residual 1e308", 0),
        ("study --td 0.064 --jobs 1 --max-residual 1e155", 0),
        ("verify --tr 0.0128853 --td 0.064 --tolerance 5e-324", 1),
        ("suggest --td 0.064 --cost-share 1e-308 --step-ratio 1e308", 0),
    ],
)
def test_a_number_of_any_size_has_an_answer(line: str, code: int) -> None:
    result = run(*shlex.split(line), ENERGY)  # a warning of numpy would be raised here
    assert result.exit_code == code, result.stderr
    assert "error" not in result.stderr


# Records that can be read but hold no answer: content, arguments, and the warning that says why.
OBJECTIONS = {
    "constant": (table(lambda _: 5.0), (), "no-candidate"),
    "zero": (table(lambda _: 0.0), (), "no-energy"),
    "negative at td": (table(lambda t: math.cos(6 * t) - 0.5), (), "no-energy"),
    "only rising": (table(lambda t: t), (), "no-candidate"),
    "td at the start": (table(lambda t: 1 + math.cos(9 * t)), ("--td", "0"), "no-candidate"),
    "td in the load": (table(lambda t: 1 + math.cos(9 * t)), ("--after", "0.7"), "td-in-load"),
    "end of the load unknown": (table(lambda t: 1 + t + math.cos(30 * t)), ("--no-verify",), "no-flight"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", OBJECTIONS)
@pytest.mark.usefixtures("here")
def test_a_record_without_an_answer_is_an_objection_and_says_why(case: str) -> None:
    content, args, code = OBJECTIONS[case]
    Path("input").write_bytes(content)
    found = checked("suggest", "--td", "0.5", *args, "input")
    assert found["recommended"] is None
    assert not any(candidate["acceptable"] for candidate in found["candidates"])
    assert {code, "no-candidate"} <= codes(found)
    for form in ("table", "value"):
        result = run("suggest", "--td", "0.5", *args, "-f", form, "input")
        assert result.exit_code == 1
        told = [line.split(": ")[1] for line in result.stderr.splitlines() if line.startswith("warning")]
        in_table = {"no-candidate"} if form == "table" else {}  # the reason stands there
        assert told == [warning["code"] for warning in found["warnings"] if warning["code"] not in in_table]


@pytest.mark.slow
def test_where_nothing_flies_a_td_is_asked_for_and_a_plan_is_an_objection(tmp_path: Path) -> None:
    file = put(tmp_path / "input", table(lambda t: t * t))
    for command in ("suggest", "explore"):
        assert "shows a flight, in which td could be chosen; give --td, and the end of the load as --after" in refused(
            command, str(file)
        )
    assert run("plan", str(file)).exit_code == 1


def test_a_pair_in_the_load_is_an_objection_with_its_reason() -> None:
    found = answer("verify", "--tr", "0.0128853", "--td", "0.064", "--after", "0.1", ENERGY)
    assert (found["verified"], found["tr_ok"]) == (False, False)
    assert any("before the end of the load at 0.1" in reason for reason in found["reasons"])


def test_a_td_behind_the_next_contact_is_an_objection(tmp_path: Path) -> None:
    lines = Path(ENERGY).read_text().splitlines()
    rows = [line.split(",") for line in lines[1:]]
    hit = [f"{t},{float(e) + max(0.0, float(t) - 0.1) * 1e4!r}" for t, *_, e, _ in rows]
    file = put(tmp_path / "hit.csv", "\n".join([HEAD.strip(), *hit, ""]))
    found = answer("suggest", "--td", "0.09", "--margin", "0.02", str(file))
    assert found["flight"]["end"] == pytest.approx(0.1, abs=1e-3)
    assert found["recommended"] is None
    assert "td-after-contact" in codes(found)
    assert answer("verify", "--tr", "0.0135867", "--td", "0.09", "--margin", "0.02", str(file))["td_ok"] is False
    assert answer("suggest", "--td", "0.0687534", "--margin", "0.005", str(file))["recommended"] is not None


def test_of_a_time_behind_a_cut_the_cut_is_said_before_a_unit(tmp_path: Path) -> None:
    file = put(tmp_path / "glstat", Path(GLSTAT).read_bytes()[:100_000])
    said = run("suggest", "--td", "64", str(file)).stderr
    assert re.search(r"outside the record, 0 to [\d.]+, where the file is cut", said)
    assert "meant" not in said or said.index("cut") < said.index("meant")


@pytest.mark.slow
@pytest.mark.parametrize("source", [ENERGY, GLSTAT])
def test_a_history_cut_anywhere_is_refused_or_answered_from_what_is_left(source: str, tmp_path: Path) -> None:
    data, file = Path(source).read_bytes(), tmp_path / "cut"
    for size in [0, 1, 50, 200, 700, 5_000, len(data) // 2, len(data) - 1]:
        file.write_bytes(data[:size])
        result = run("suggest", "--td", "0.064", "-f", "json", str(file))
        assert result.exit_code in (0, 1, 2)
        assert "Traceback" not in result.stderr
        assert (result.exit_code == 2) == (result.stdout == "")
        if result.stdout:
            found = json.loads(result.stdout)
            assert found["history"]["time_end"] <= 0.15
            assert found["recommended"]["tr"] == pytest.approx(0.0128852793630525, rel=1e-5)
