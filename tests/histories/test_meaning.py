"""Quantities by name: spellings of solvers, postprocessors and users, in tables and in HDF5."""

from collections.abc import Callable

import h5py
import numpy as np
import pytest

from d2rpick.choice.overview import describe_run
from d2rpick.histories.formats import csv_table, hdf5_file
from d2rpick.histories.history import Samples
from d2rpick.histories.meaning import (
    find_internal_energies,
    find_meaning,
    find_quantities,
    is_time,
)
from d2rpick.histories.names import Selection
from tests.hdf5_files import write_hdf5
from tests.reading import open_contents

# Internal and kinetic energy of the whole model, as one program or person writes them.
SPELLINGS = [
    ("Internal energy: ALLIE for Whole Model", "Kinetic energy: ALLKE for Whole Model"),
    ("Global Internal Energy", "Global Kinetic Energy"),
    ("Total Internal Energy", "Total Kinetic Energy"),
    ("glstat: internal energy", "glstat: kinetic energy"),
    ("glstat/internal_energy", "glstat/kinetic_energy"),
    ("T01/INTERNAL ENERGY", "T01/KINETIC ENERGY"),
    ("ENERGY_INTERNAL", "ENERGY_KINETIC"),
    ("Innere Energie", "Kinetische Energie"),
    ("Interne Energie [mJ]", "Kinetische Energie [mJ]"),
    ("Int. Energie", "Kin. Energie"),
    ("E_int [J]", "E_kin [J]"),
    ("Eint/J", "Ekin/J"),
    ("IE (kJ)", "KE (kJ)"),
    ("IE_total", "KE_total"),
    ("internal_energy_J", "kinetic_energy_J"),
    ("Internal energy in mJ", "Kinetic energy in mJ"),
    ("INTERNAL ENERGY (N mm)", "KINETIC ENERGY (N mm)"),
    ("Internal Energy N mm", "Kinetic Energy N mm"),
    ("Internal Energy [kg mm^2/ms^2]", "Kinetic Energy [kg mm^2/ms^2]"),
    ("Internal Energy\N{NO-BREAK SPACE}(J)", "Kinetic Energy\N{NO-BREAK SPACE}(J)"),
    ("énergie interne (J)", "énergie cinétique (J)"),
    ("Energía interna", "Energía cinética"),
    ("energia interna", "energia cinetica"),
    ("Energia wewnętrzna", "Energia kinetyczna"),
    ("Intern energi", "Kinetisk energi"),
    ("Inwendige energie", "Kinetische energie"),
    ("Внутренняя энергия", "Кинетическая энергия"),
    ("内能", "动能"),
    ("内部エネルギー", "運動エネルギー"),
    ("내부에너지", "운동에너지"),
    ("Internal Energy - IE", "Kinetic Energy - KE"),
    ("InternalEnergy", "KineticEnergy"),
    ("totalInternalEnergy", "totalKineticEnergy"),
    ("Whole Model: Internal Energy", "Whole Model: Kinetic Energy"),
    ("ALLIE_Global", "ALLKE_Global"),
    ("wholeModel_ALLIE", "wholeModel_ALLKE"),
    ("XY-History ALLIE(Scalar)/ALLIE", "XY-History ALLKE(Scalar)/ALLKE"),
    ("Internal Energy of whole model", "Kinetic Energy of whole model"),
    ("SYSTEM INTERNAL ENERGY", "SYSTEM KINETIC ENERGY"),
    ("Global - Internal Energy", "Global - Kinetic Energy"),
    ("global.internal_energy", "global.kinetic_energy"),
    ("Internal Energy (Global)", "Kinetic Energy (Global)"),
    ("Energy (internal)", "Energy (kinetic)"),
    ("Energy: internal [J]", "Energy: kinetic [J]"),
    ("Energy(J): ALLIE", "Energy(J): ALLKE"),
    ("1. Internal Energy", "2. Kinetic Energy"),
    ("Curve 1: Internal Energy", "Curve 2: Kinetic Energy"),
    ("1 - Internal Energy", "2 - Kinetic Energy"),
    ("run1: Internal Energy", "run1: Kinetic Energy"),
    ("Element internal energy", "Element kinetic energy"),
    ("Internal Energy All Parts", "Kinetic Energy All Parts"),
    ("GlobalIE", "GlobalKE"),
    ("Int_E", "Kin_E"),
    ("internal", "kinetic"),
    ("e_internal", "e_kinetic"),
    ("observables/internal_energy/value", "observables/kinetic_energy/value"),
    ("results/energies/internal", "results/energies/kinetic"),
]

TIME = np.linspace(0.0, 1.0, 21)
COLUMNS = {
    "Internal energy": TIME,
    "Kinetic energy": 2 - TIME,
    "Total energy": 2 + 0 * TIME,
}


@pytest.mark.parametrize(("internal", "kinetic"), SPELLINGS)
def test_internal_and_kinetic_energy_are_found_in_any_spelling(
    internal: str, kinetic: str
) -> None:
    names = ["z", kinetic, internal, "door 7"]
    assert find_internal_energies(names) == [2]
    assert find_quantities(names) == {"kinetic_energy": [kinetic]}


@pytest.mark.parametrize(
    ("name", "quantity"),
    [
        ("External work: ALLWK for Whole Model", "external_work"),
        ("ExternalEnergy", "external_work"),
        ("Contact Energy", "contact_energy"),
        ("Kontaktenergie [J]", "contact_energy"),
        ("sliding interface energy", "contact_energy"),
        ("Gesamtenergie", "total_energy"),
        ("Total energy: ETOTAL for Whole Model", "total_energy"),
        ("total energy / initial energy", "energy_ratio"),
        ("Hourglass Energy (mJ)", "hourglass_energy"),
        ("Artificial strain energy: ALLAE for Whole Model", "artificial_energy"),
        ("X-Momentum [N s]", "x_momentum"),
        ("Global momentum z", "z_momentum"),
        ("total mass", "mass"),
    ],
)
def test_other_quantities_are_found_too(name: str, quantity: str) -> None:
    assert find_quantities([name]) == {quantity: [name]}


@pytest.mark.parametrize(
    "name",
    [
        *(
            "boxKE_J",
            "Kinetic energy of the door",
            "KE_3",
            "eroded kinetic energy",
            "kinetic + internal energy",
        ),
        *(
            "elastic_contact_energy",
            "percentage_added_mass",
            "Kinetic energy: door",
            "unmoved",
            "part_id",
            "vx",
        ),
    ],
)
def test_what_is_of_something_else_is_no_quantity_of_the_model(name: str) -> None:
    assert find_quantities(["IE", name]) == {}


def test_a_name_without_addition_is_preferred() -> None:
    assert find_internal_energies(
        ["total internal energy", "internal energy", "door internal energy"]
    ) == [1]
    assert find_internal_energies(
        ["box IE", "IE_total", "dissipated internal energy"]
    ) == [0, 1]  # both are candidates, so the user has to choose
    assert find_quantities(["kinetic_energy", "total_kinetic_energy"]) == {
        "kinetic_energy": ["kinetic_energy"]
    }


def test_total_alone_is_the_total_energy_beside_a_kinetic_energy_only() -> None:
    assert find_quantities(["internal", "kinetic", "total"])["total_energy"] == [
        "total"
    ]
    assert find_quantities(["box", "door", "total"]) == {}


@pytest.mark.parametrize(
    "name",
    ["Time (ms)", "t in ms", "Zeit [s]", "Total time", "time_whole", "Время", "t/s"],
)
def test_times_are_found(name: str) -> None:
    assert is_time(name)


@pytest.mark.parametrize(
    "name", ["Time step", "wall time", "CPU time", "T box", "temperature", "X"]
)
def test_other_times_are_none_of_the_states(name: str) -> None:
    assert not is_time(name)


def write_header_and_rows(*names: str) -> str:
    values = zip(TIME, *[2 - TIME] * len(names), strict=True)
    rows = [",".join(f"{value:.4f}" for value in row) for row in values]
    return "\n".join([",".join(["time", *names]), *rows, ""])


def notes_of(text: str, *energy: str) -> str:
    selection = Selection(energy=energy)
    run = open_contents(csv_table, text, selection=selection)
    notes = run.history(selection).notes
    assert {*notes} == {*describe_run(run, selection).notes}
    return " ".join(notes)


def test_what_looks_like_an_energy_and_is_not_used_is_named() -> None:
    assert notes_of(write_header_and_rows("IE", "KE", "z")) == ""
    assert "'KE of the door' (kinetic_energy?) looks like an energy" in notes_of(
        write_header_and_rows("IE", "KE of the door")
    )
    assert "'ALLPD', 'ALLSE' look like energies" in notes_of(
        write_header_and_rows("ALLIE", "ALLPD", "ALLSE")
    )
    notes = notes_of(write_header_and_rows("IE", "KE", "Kinetic energy"))
    assert (
        "'KE' (kinetic_energy?), 'Kinetic energy' (kinetic_energy?) look like" in notes
    )


def test_internal_energies_that_were_passed_over_by_name_are_not_named() -> None:
    assert notes_of(write_header_and_rows("door IE", "box IE", "KE"), "box IE") == ""


def h5md(file: h5py.File) -> None:
    for name, values in COLUMNS.items():
        group = file.create_group(f"observables/{name.lower().replace(' ', '_')}")
        group["step"], group["time"], group["value"] = (
            np.arange(TIME.size),
            TIME,
            values,
        )


def exodus(file: h5py.File) -> None:
    names = ["KineticEnergy", "InternalEnergy", "TotalEnergy"]
    letters = np.array([list(name.ljust(33, "\0")) for name in names], dtype="S1")
    file["time_whole"], file["name_glo_var"] = TIME, letters
    file["vals_glo_var"] = np.stack([2 - TIME, TIME, 2 + 0 * TIME], axis=1)


def group_of_energies(file: h5py.File) -> None:
    file["results/energies/t"] = TIME
    for name, values in COLUMNS.items():
        file[f"results/energies/{name.split()[0].lower()}"] = values


def erf(file: h5py.File) -> None:
    kinds = file.create_group("post/multistate/TIMESERIES1/multientityresults")
    for name, values in COLUMNS.items():
        add_block(
            kinds, f"MODEL/{name.upper().replace(' ', '_')}", values[:, np.newaxis], [0]
        )
    add_block(
        kinds, "PART/INTERNAL_ENERGY", np.stack([TIME / 2, TIME / 3], axis=1), [7, 9]
    )


def add_block(
    kinds: h5py.Group, name: str, values: Samples, entities: list[int]
) -> None:
    block = kinds.create_group(f"{name}/ZONE1_set1/erfblock")
    block["indexval"], block["entid"], block["res"] = (
        TIME[:, np.newaxis],
        entities,
        values[:, :, np.newaxis],
    )


@pytest.mark.parametrize("layout", [h5md, exodus, group_of_energies, erf])
def test_hdf5_files_are_read_by_their_own_names(
    layout: Callable[[h5py.File], None],
) -> None:
    run = open_contents(hdf5_file, write_hdf5(layout).getvalue())
    history = run.history(Selection())
    np.testing.assert_array_equal((history.time, history.energy), (TIME, TIME))
    quantities = run.quantities(history.time)
    np.testing.assert_array_equal(quantities["kinetic_energy"], 2 - TIME)
    np.testing.assert_array_equal(quantities["total_energy"], 2 + 0 * TIME)


def test_a_quantity_at_other_times_than_the_energy_is_not_taken() -> None:
    def shifted(file: h5py.File) -> None:
        h5md(file)
        file["observables/kinetic_energy/time"][...] = TIME + 0.5

    run = open_contents(hdf5_file, write_hdf5(shifted).getvalue())
    assert "kinetic_energy" not in run.quantities(run.history(Selection()).time)


def test_the_parts_of_an_erf_file_are_chosen_by_number() -> None:
    path = "post/multistate/TIMESERIES1/multientityresults/PART/INTERNAL_ENERGY/9/value"
    history = open_contents(hdf5_file, write_hdf5(erf).getvalue()).history(
        Selection(energy=(path,))
    )
    np.testing.assert_array_equal(history.energy, TIME / 3)


def abaqus(artificial: float | None) -> str:
    """ALLIE of a body that vibrates in flight, ALLKE and ALLWK; 5 % of ALLIE may be artificial."""
    times = np.linspace(0.0, 1.0, 201)
    internal = 50 + 20 * np.cos(40 * times)
    columns = {
        "X": times,
        "ALLIE": internal,
        "ALLKE": 1000 - internal,
        "ALLWK": 0 * times,
    }
    if artificial is not None:
        columns["ALLAE"] = artificial * internal
    rows = zip(*columns.values(), strict=True)
    return "\n".join(
        [
            ",".join(columns),
            *(",".join(f"{value:.9g}" for value in row) for row in rows),
            "",
        ]
    )


def test_the_artificial_energy_of_abaqus_is_a_part_of_its_internal_energy() -> None:
    flights, shares = [], []
    for artificial in (None, 0.05, 0.2):
        overview = describe_run(
            open_contents(csv_table, abaqus(artificial)), Selection()
        )
        flights.append(overview.flights)
        shares.append(overview.health.hourglass_share if overview.health else None)
    assert flights[0]
    assert flights[0] == flights[1] == flights[2]
    assert shares == [None, pytest.approx(0.05), pytest.approx(0.2)]


def test_a_meaning_says_for_what_else() -> None:
    meaning = find_meaning("Kinetic energy of the left door")
    assert meaning is not None
    assert meaning.others == ("left", "door")
