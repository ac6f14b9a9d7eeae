"""The public keys: the schemas of the package agree with the fields of the results."""

import pytest

from d2rpick.report import keys
from d2rpick.vibration.measures import Measured
from tests.generated_schemas import list_documents, make_schema, read_shipped


def test_every_measure_of_the_vibration_is_shown_as_one() -> None:
    assert {*Measured._fields} <= {*keys.MEASURES} <= {*keys.CANDIDATE.keys}


@pytest.mark.parametrize("name", list_documents())
def test_the_schema_that_ships_is_made_from_the_fields(name: str) -> None:
    assert make_schema(list_documents()[name]) == read_shipped(name), (
        "run python -m tests.generated_schemas"
    )
