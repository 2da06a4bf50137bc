"""The typed tags of the client are the tag table."""

import importlib.util
from pathlib import Path

import pytest

from gantryctl.client.tags import Tags
from gantryctl.errors import DeviceError

ROOT = Path(__file__).parents[3]


def test_the_module_is_up_to_date() -> None:
    spec = importlib.util.spec_from_file_location("client_tags", ROOT / "tools" / "client_tags.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    module = (ROOT / "src/gantryctl/client/tags.py").read_text(encoding="utf-8")
    assert module == tool.module(), "run: python tools/client_tags.py src/gantryctl/client/tags.py"


def test_a_service_of_another_version_is_named() -> None:
    with pytest.raises(DeviceError, match=r"no tag 'issued_ms': it is of version 9\.9"):
        Tags.of({"version": "9.9"})
