"""Each mistake that a stranger made gets a message with its place, what was found, what was expected, and a cure."""

import shutil
from pathlib import Path

import pytest

from tests.command import ENERGY, MATSUM, ROOT, put, run, run_json

SAMPLES = ROOT / "sample_data"
DECK = str(SAMPLES / "rollover_box.k")
PLATE = SAMPLES / "falling_plate" / "plate_0000.rad"
OSCILLATOR = ("--stiffness", "660e3", "--mass", "31.4", "--beta", "2")
PROGRAMS = ("--starter", "true {deck}", "--engine", "true {deck}")


def refuse(*arguments: str) -> str:
    """Return the message on a refused command line, in one line."""
    answer = run(*arguments)
    assert answer.exit_code == 2, answer.output
    return " ".join(answer.stderr.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("suggest", "--TD", "0.064", ENERGY), "No such option '--TD'. Did you mean '--td'?"),
        (("suggest", "--tolerance", "20", ENERGY), "a number of at most 1 was expected; for 20% write 0.2"),
        (("suggest", "--cost-share", "75", ENERGY), "for 75% write 0.75"),
        (("suggest", "--tolerance", "1.5", ENERGY), "a number of at most 1 was expected (see"),
        (("plan", "--td", "0.37", MATSUM), "d2rpick plan chooses td itself; d2rpick suggest chooses tr for a given td"),
        (("--part", "1", "info", ENERGY), "No such option '--part' before the command; give the options of a command"),
        (("card", MATSUM), "takes options only; give a history as --history"),
        (("follow", MATSUM, ENERGY), "d2rpick follow takes one RUN; if these are files of one run, give their folder"),
        (
            ("drive", "a.rad", "b.rad", "-o", "new", *PROGRAMS),
            "b.rad: unexpected, because d2rpick drive takes one DECK; leave it out, or",
        ),
        (("follow", "--for", "5s", MATSUM), "'5s' is not a number: give the seconds as a number, 5"),
        (("drive", str(PLATE), "-o", "new", "--threads", "0"), "0 was found, but a whole number of at least 1"),
        (("drive", str(PLATE), "-o", "new", "--part", "all", *PROGRAMS), "give the ids of parts in the deck"),
        (
            ("drive", str(PLATE.parent), "-o", "new", *PROGRAMS),
            "this is a folder; give the main deck in it, ",
        ),
        (("card", "--part", "1", "--tr", "-1", "--td", "0.06"), "tr is -1, before the start of the run; give"),
        (("card", "--part", "10-5", "--tr", "0.1", "--td", "0.2"), "give the smaller number first, 5-10"),
        (
            ("card", "--solver", "radioss", "--node", "5", "--tr", "0.01", "--td", "0.06", "--end", "0.05"),
            "the run ends at 0.05, but a time after td = 0.06 was expected; give it as --end",
        ),
        (("rollover", "--tilt", "30"), "--tilt needs --drop: it is the tilt of a falling box"),
        (("rollover", "--t-end", "0.001", "--dt", "0.01"), "--dt 0.01 is longer than the run, --t-end 0.001"),
        (
            ("replay", *OSCILLATOR, "--v0", "6", "--t-end", "0.001", "--dt", "0.01"),
            "--dt 0.01 is longer than the run, --t-end 0.001",
        ),
        (
            ("suggest", *OSCILLATOR, "--frame-mass", "3", ENERGY),
            "--stiffness needs --alpha and --v0 too, and needs either --frame-mass or --beta, not both",
        ),
        (
            ("suggest", "--channel", "kinetic", ENERGY),
            "--channel kinetic: QUANTITY=NAME was expected, such as kinetic_energy=NAME, with the name of a column",
        ),
        (("plan", "--report", "page.txt", ENERGY), "page.txt: the report is an HTML page; name it page.html"),
        (
            ("suggest", "--time", "internal_energy", ENERGY),
            "(internal energy), and its values decrease; choose with --time: 1 'time'",
        ),
        (("plan", "--part", "1 2", MATSUM), "no part '1 2' (separate parts by commas: 1,2); there are"),
        (("info", "https://example.org/glstat"), "an address on the network cannot be read; download the file"),
        (("plan", "-F", "binout", ENERGY), "this is not a binout, because its header is missing; leave --input-format"),
        (("plan", "-F", "glstat", ENERGY), "leave --input-format out to have the format recognised"),
        (
            ("verify", "--tr", "13.5867", "--td", "68.7534", ENERGY),
            "were they meant in ms? Then give --tr 0.0135867 --td 0.0687534, in the unit of the record",
        ),
        (("parts", "--td", "370", "--deck", DECK, MATSUM), "was it meant in ms? Then give --td 0.37"),
        (("first", DECK, "-o", "new", "--part", "99", "--wait", "0.01"), "with --part: the deck has parts 1-3"),
        (
            ("first", str(PLATE), "-o", "new", "--part", "1", "--wait", "5"),
            "--wait 5 is not shorter than the run, which ends at 0.4",
        ),
        (("rule", "por-td"), "no warning 'por-td' (did you mean 'poor-td'?)"),
        (("study", "--from", ENERGY), "none of its 1502 lines names a file or folder, the first is 'time,z,"),
    ],
)  # fmt: skip
def test_a_message_names_the_cure(arguments: tuple[str, ...], message: str) -> None:
    assert message in refuse(*arguments)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("0.01,0.06", "separate them by a blank: 0.01 0.06"),
        ("0.06 0.01", "tr = 0.06 lies after td = 0.01; write the earlier time first"),
        (
            "tr td",
            "put # before headings and remarks, or give the journal of d2rpick drive, drive.ndjson",
        ),
    ],
)
def test_a_wrong_line_of_a_file_with_windows_is_corrected(
    tmp_path: Path, line: str, message: str
) -> None:
    file = str(put(tmp_path / "win.txt", f"{line}\n".encode()))
    for arguments in (
        ("card", "--part", "1", "--windows", file),
        ("plan", "--done", file, MATSUM),
    ):
        answer = refuse(*arguments)
        assert "win.txt:1: " in answer
        assert message in answer


def test_windows_of_a_file_in_another_unit_are_named_with_the_file(
    tmp_path: Path,
) -> None:
    file = str(put(tmp_path / "win.txt", b"13.5 68.7\n"))
    answer = refuse("card", "--part", "1", "--windows", file, "--history", ENERGY)
    assert "win.txt: tr = 13.5 and td = 68.7 lie outside the record" in answer
    assert "Then give 0.0135 0.0687, in the unit of the record" in answer


def test_a_lead_part_that_no_card_makes_rigid_is_named() -> None:
    """Before, part 7 was printed as the lead of a rigid body without a word."""
    times = ("--tr", "0.01", "--td", "0.06")
    answer = run("card", "--part", "1,2", "--merge", "7", *times)
    assert "note: the lead part 7 of --merge is not among the switched parts 1, 2" in (
        answer.stderr
    )
    assert (
        "lead part" not in run("card", "--part", "1,2", "--merge", "2", *times).stderr
    )


def test_a_column_without_the_name_of_an_energy_gets_a_note() -> None:
    """Before, a displacement was judged as the internal energy without a word."""
    note = "'z' is not an energy by its name, but it was used; if 'internal_energy' was meant, give it as --energy"
    assert note in run("suggest", "--energy", "2", ENERGY).stderr
    assert (
        "by its name"
        not in run("suggest", "--energy", "internal_energy", ENERGY).stderr
    )


def test_a_time_column_with_another_name_gets_a_note(tmp_path: Path) -> None:
    table = Path(ENERGY).read_text().replace("time,", "mass,", 1)
    file = str(put(tmp_path / "odd.csv", table.encode()))
    note = "'mass' is by its name not a time (mass); it was used as it is"
    assert note in run("suggest", "--time", "mass", file).stderr


def test_a_table_without_headings_or_rows_is_described(tmp_path: Path) -> None:
    head, *rows = Path(ENERGY).read_text().splitlines(keepends=True)
    file = str(put(tmp_path / "no_head.csv", "".join(rows).encode()))
    assert "the table has no line of headings, so no column is named like" in (
        refuse("plan", file)
    )
    file = str(put(tmp_path / "no_rows.csv", head.encode()))
    assert (
        "a table of time and energy was expected; write rows of numbers below the headings, or give another file"
    ) in refuse("plan", file)


def test_the_only_energy_of_a_table_is_kinetic(tmp_path: Path) -> None:
    rows = "".join(f"{step / 100},{step % 7}\n" for step in range(50))
    file = str(put(tmp_path / "kinetic.csv", f"time,kinetic_energy\n{rows}".encode()))
    assert (
        "write the internal energy too, or give this name as --energy if it is one"
        in refuse("plan", file)
    )


def test_a_link_that_leads_nowhere_names_its_target(tmp_path: Path) -> None:
    link = tmp_path / "link.csv"
    link.symlink_to("nowhere.csv")
    assert (
        "link.csv: this link leads to nowhere.csv, which does not exist; give the file"
        in refuse("plan", str(link))
    )


def test_a_name_with_a_space_is_to_be_quoted(tmp_path: Path) -> None:
    put(tmp_path / "my energy.csv", b"")
    answer = refuse("plan", str(tmp_path / "my"), str(tmp_path / "energy.csv"))
    assert "did you mean 'my energy.csv'? Put quotes around a name with spaces" in (
        answer
    )


def test_a_short_record_is_to_be_continued(tmp_path: Path) -> None:
    lines = Path(ENERGY).read_text().splitlines(keepends=True)
    file = str(put(tmp_path / "short.csv", "".join(lines[:9]).encode()))
    answer = " ".join(run("plan", file).stdout.split())
    assert "next continue the run, or write the states more often, because 8" in answer
    assert "or write the states every" not in answer


def test_a_constant_energy_is_the_reason_why_no_flight_is_found(tmp_path: Path) -> None:
    rows = "".join(f"{step / 100},5\n" for step in range(100))
    file = str(put(tmp_path / "still.csv", f"time,internal_energy\n{rows}".encode()))
    answer = " ".join(run("plan", file).stdout.split())
    assert "because the energy is 5 in all states" in answer


def test_a_missing_restart_segment_is_the_next_step() -> None:
    folder = SAMPLES / "oscillator_switched"
    files = [str(folder / f"OSCT0{number}.gz") for number in (1, 3)]
    answer = " ".join(run("plan", *files).stdout.split())
    assert "next add the files of the restart segment that is missing between" in answer


def test_parts_that_never_fly_in_a_cut_record_are_not_asked_for_momenta(
    tmp_path: Path,
) -> None:
    content = Path(MATSUM).read_bytes()[:40000]
    file = str(put(tmp_path / "cut.matsum", content))
    assert "the momenta show no parts that fly together from 0 to 0.05" in refuse(
        "plan", "--part", "flying", file
    )


def test_the_start_of_the_record_cannot_be_td() -> None:
    answer = " ".join(run("suggest", "--td", "0", ENERGY).stdout.split())
    assert "td = 0 is the start of the record, so no time before it can be tr" in answer


def test_a_folder_with_several_decks_and_runs_is_refused_once(tmp_path: Path) -> None:
    for name in ("rollover_box.k", "rolloverT01.gz"):
        shutil.copy(SAMPLES / name, tmp_path)
    shutil.copy(SAMPLES / "rollover_box.k", tmp_path / "other.k")
    shutil.copy(SAMPLES / "rolloverT01.gz", tmp_path / "otherT01.gz")
    answer = refuse("suggest", str(tmp_path))
    assert "this folder contains 2 main decks (" in answer
    assert "and several runs (" in answer
    assert "; give the files of one run, and name the deck of the run with" in answer


def test_a_failed_comparison_does_not_blame_values_within_their_limits() -> None:
    switched = str(SAMPLES / "oscillator_switched")
    reference = str(SAMPLES / "oscillator")
    answer = run("verify", "--switched", switched, "--tr", "0.01", reference).stdout
    assert answer.startswith(
        "comparison  failed for the reason below, although these values are within"
    )


@pytest.mark.parametrize(
    "arguments",
    [("first", "-o", "new"), ("plan", MATSUM, "--deck")],
)
def test_a_packed_starter_is_named(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    shutil.copy(PLATE.with_name("plate_0001.rad"), tmp_path)
    put(tmp_path / "plate_0000.rad.gz", b"")
    answer = refuse(*arguments, str(tmp_path / "plate_0001.rad"))
    assert "no parts were found, because no starter deck" in answer
    assert f"; unpack {tmp_path / 'plate_0000.rad.gz'}" in answer


@pytest.mark.parametrize("command", ["first", "drive"])
def test_a_folder_in_place_of_a_deck_is_named_with_what_is_missing(
    command: str,
) -> None:
    answer = refuse(command, str(PLATE.parent))
    assert answer.startswith("d2rpick: missing: -")
    assert "a readable DECK (" in answer
    assert f"this is a folder; give the main deck in it, {PLATE})" in answer


def test_a_file_is_no_folder_for_a_deck(tmp_path: Path) -> None:
    file = str(put(tmp_path / "file.txt", b""))
    answer = refuse(
        "plan", "--deck", DECK, "--write-deck", file, "--part", "1,2", MATSUM
    )
    assert "file.txt: this is a file, but a folder was expected; choose another" in (
        answer
    )
    answer = refuse("extract", ENERGY, "-o", str(tmp_path))
    assert "this is a folder; give a file in it" in answer


def test_a_decimal_comma_in_a_deck_is_named_once(tmp_path: Path) -> None:
    fields = f"{1:10}{0:10}{0:10}     0,012{0.06:10}"
    card = f"*KEYWORD\n*DEFORMABLE_TO_RIGID_AUTOMATIC\n{fields}\n{1:10}\n*END\n"
    deck = str(put(tmp_path / "main.k", card.encode()))
    answer = " ".join(run("check", "--select", "D2R002", deck).stdout.split())
    assert answer.count("error D2R002") == 1
    assert "because of a comma in this line, its fields are not read by columns" in (
        answer
    )


def test_the_code_of_a_warning_may_have_underscores() -> None:
    assert run("rule", "poor_td").stdout == run("rule", "poor-td").stdout


def test_a_missing_run_of_a_study_is_named_with_its_reason() -> None:
    answer = run("study", ENERGY, "no_such.csv")
    reason = "no_such.csv: no such file"
    assert f"1 of 2 runs could not be judged and is left out: {reason}" in answer.stderr
    assert f"left out  {reason}" in answer.stdout


def test_a_run_that_is_given_twice_counts_once() -> None:
    answer = " ".join(run("study", ENERGY, ENERGY).stdout.split())
    assert "for 1 of 1 run (repeated runs count once)" in answer
    assert answer.partition("next ")[2].count("energy.csv") <= 4


def test_runs_of_a_study_in_different_units_are_named(tmp_path: Path) -> None:
    """Before, the run in seconds was said to end early."""
    head, *rows = Path(ENERGY).read_text().splitlines()
    scaled = [
        f"{float(row.partition(',')[0]) * 1000:.10g},{row.partition(',')[2]}"
        for row in rows
    ]
    file = str(put(tmp_path / "ms.csv", "\n".join([head, *scaled]).encode() + b"\n"))
    answer = run("study", ENERGY, file)
    assert "mixed-units: the times of" in answer.stderr
    assert "are 1000 times those of" in answer.stderr
    assert "cut-runs" not in answer.stderr
    assert "next       convert the runs to one unit of time" in answer.stdout
    assert run_json("study", ENERGY, file)["common_tr"] is None


def test_a_missing_run_that_is_followed_is_named_at_once(tmp_path: Path) -> None:
    """Before, nothing was printed for as long as one waited."""
    answer = run("follow", "--for", "1.2", str(tmp_path / "nosuch"))
    assert "waiting" in answer.stdout.splitlines()[0]
    assert "no file of a run yet; check the name" in answer.stdout


def test_a_dry_run_refuses_the_folder_that_the_run_would_refuse(tmp_path: Path) -> None:
    put(tmp_path / "other.txt", b"")
    words = ("drive", str(PLATE), "--part", "1", *PROGRAMS, "-o")
    assert "the folder is not empty; choose another one" in (
        refuse(*words, str(tmp_path), "--dry-run")
    )
    new = tmp_path / "new"
    assert "there is no run to resume in this folder" in (
        refuse(*words, str(new), "--resume")
    )


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--verison",), "No such option '--verison'. Did you mean '--version'?"),
        (
            ("suggest", "--channel", "kinetic_energy", ENERGY),
            "--channel kinetic_energy: the name of its column is missing; write kinetic_energy=NAME, such as",
        ),
        (("suggest", "-f", "crad", ENERGY), "'card' (did you mean 'card'?)"),
        (("suggest", "--td", "nan", ENERGY), "'nan' was found, but a time in the unit of the run, such as 0.005,"),
        (("follow", "--for", "abc", MATSUM), "'abc' is not a number; give a number of seconds, such as 60"),
        (("follow", "--for", "nan", MATSUM), "'nan' was found, but a number of seconds, such as 60, was expected"),
        (("explore", "--td-window", "0.2", "0.3", ENERGY), "the record, 0 to 0.15; give times within it"),
        (("plan", "--part", "", MATSUM), "the id or title of a part is missing; there are: 1 'box', 2 'step'"),
        (
            ("suggest", ENERGY, MATSUM),
            f"do all files belong to the same run? If not, leave out {ENERGY}, which has the energies, or {MATSUM}",
        ),
        (
            ("parts", "--td", "0.3", "--tr", "0.4", "--deck", DECK, MATSUM),
            "tr must lie before td; give a smaller --tr or a larger --td",
        ),
        (("first", DECK, "-o", "new", "--part", "1"), "for example 0.02 for a period of 0.03)"),
        (
            ("card", "--part", "1-99", "--tr", "0.1", "--td", "0.2", "--deck", DECK),
            "parts 4-99: no elements in the deck; give others with --part: the deck has parts 1-3",
        ),
        (
            ("verify", "--switched", str(SAMPLES / "rollover.csv"), ENERGY),
            f"no column is named like the energy of the reference run {ENERGY}; if both are runs of one model, give",
        ),
    ],
)  # fmt: skip
def test_a_message_leads_out_of_the_mistake(
    arguments: tuple[str, ...], message: str
) -> None:
    assert message in refuse(*arguments)


def test_a_time_after_the_end_of_a_cut_record_asks_for_the_rest(tmp_path: Path) -> None:
    content = Path(MATSUM).read_bytes()[:40000]
    file = str(put(tmp_path / "cut.matsum", content))
    answer = refuse("suggest", "--td", "0.37", "--part", "box", file)
    assert "where the file is cut; copy the file again, or let the run finish" in answer


def test_a_single_column_is_named_by_its_heading(tmp_path: Path) -> None:
    file = str(put(tmp_path / "one.csv", b"internal_energy\n0.0\n1.0\n2.0\n"))
    assert "one.csv: only one column, 'internal_energy', was found" in (
        refuse("suggest", file)
    )


def test_one_output_interval_is_asked_for(tmp_path: Path) -> None:
    """Before, the warning and the next step named two intervals."""
    head, *rows = Path(ENERGY).read_text().splitlines()
    file = str(put(tmp_path / "c.csv", "\n".join([head, *rows[::125], ""]).encode()))
    answer = run("suggest", file)
    interval = answer.stderr.partition("write the energies every ")[2].split()[0]
    assert f"write the states every {interval} or more" in (
        " ".join(answer.stdout.split())
    )


def test_a_rigid_part_is_to_be_left_out_of_a_card() -> None:
    """Before, the card for a part with *MAT_RIGID was recommended, after two findings on the output interval."""
    times = ("--tr", "0.1", "--td", "0.2")
    answer = run("card", *times, "--part", "3", "--deck", DECK)
    assert answer.exit_code == 1
    first = answer.stderr.splitlines()[0]
    assert first.startswith("warning: card-error")
    assert "leave it out of the switched parts, or give it a deformable material" in (
        first
    )
    assert "add these cards" not in answer.stderr


def write_switching_deck(folder: Path, keyword: str, part: int, tr: float) -> str:
    """Write a deck with one rigid window of part 1; return its name."""
    back = "*DEFORMABLE_TO_RIGID_AUTOMATIC"
    model = (
        "*CONTROL_TERMINATION\n      0.15\n*PART\nbox\n         1         1         1\n"
    )
    to_rigid = (
        f"{keyword}\n{1:10}{0:10}{tr:10g}\n"
        f"{0:10}{0:10}{0:10}{0.0001:10}{1:10}{0:10}\n{part:10}\n"
    )
    to_deformable = f"{back}\n{2:10}{0:10}{0.06:10g}\n{0:10}{0:10}{0:10}{0:10}{0:10}{1:10}\n{1:10}\n"
    deck = f"*KEYWORD\n{model}{to_rigid}{to_deformable}*END\n"
    return str(put(folder / "main.k", deck.encode()))


@pytest.mark.parametrize(
    ("keyword", "part", "cause"),
    [
        ("*DEFORMABLE_TO_RIGID_AUTOMATICS", 1, "D2R002"),
        ("*DEFORMABLE_TO_RIGID_AUTOMATIC", 7, "D2R106"),
    ],
)
def test_a_consequence_of_a_typing_error_names_the_cause(
    tmp_path: Path, keyword: str, part: int, cause: str
) -> None:
    deck = write_switching_deck(tmp_path, keyword, part, 0.01)
    answer = " ".join(run("check", deck).stdout.split())
    assert f"error {cause}" in answer
    assert "first correct the errors of the D2R cards, which may be the cause" in answer
    assert "D2R104" not in answer


def test_a_time_in_milliseconds_is_named_in_a_deck(tmp_path: Path) -> None:
    deck = write_switching_deck(tmp_path, "*DEFORMABLE_TO_RIGID_AUTOMATIC", 1, 12.5)
    answer = " ".join(run("check", "--select", "D2R101", deck).stdout.split())
    assert "was it meant in ms? Then write 0.0125, in the unit of ENDTIM" in answer
