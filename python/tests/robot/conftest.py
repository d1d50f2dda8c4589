"""A robot of the contract on a plane, in every physics engine there is."""

import pytest

from rtds_host.contract import builtin_robot


@pytest.fixture(scope="session")
def burger():
    return builtin_robot("burger")
