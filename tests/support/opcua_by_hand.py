"""What tests of OPC UA without a server share: a reader, and the status of a refusal."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from asyncua import ua
from asyncua.common.utils import ServiceError

from gantryctl.service.protocol.roles import Role
from gantryctl.service.supervisor.users import User

S = ua.StatusCodes
ANNA = User("anna", Role.VIEWER, "Anna", "", "", 1, 1, 1, "")


def status_of(work: Callable[[], object]) -> int:
    """The status with which this is refused."""
    with pytest.raises(ServiceError) as refused:
        work()
    return int(refused.value.code)
