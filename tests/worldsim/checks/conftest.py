from typing import Any

import pytest

from tests.worldsim.checks.judged import Result, Run
from tests.worldsim.conftest import Lab


@pytest.fixture
def run(lab: Lab, request: pytest.FixtureRequest) -> Run:
    """Run a patrol under faults; it takes 40 ticks, or a module's ``TICKS``, unless told otherwise."""

    def of(*faults: dict[str, Any], ticks: int = getattr(request.module, "TICKS", 40), **more: Any) -> Result:
        return lab.driven(ticks=ticks, faults=list(faults), **more)

    return of
