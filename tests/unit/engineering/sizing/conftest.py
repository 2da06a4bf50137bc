"""The reference sheet and the paper's motor."""

import pytest

from gantryctl.engineering.sizing.loading import default_sheet_path, load_sheet
from gantryctl.engineering.sizing.motors import load_motors
from gantryctl.machine import configs_folder


@pytest.fixture(scope="session")
def sheet():
    return load_sheet(default_sheet_path())


@pytest.fixture(scope="session")
def paper_motor():
    (motor,) = load_motors([configs_folder() / "motors" / "im_31kw_1150.toml"])
    return motor


@pytest.fixture
def changed_sheet(tmp_path):
    """Write the reference sheet with other values; the answer is the path."""

    def write(changes, name="sheet.toml"):
        lines = default_sheet_path().read_text(encoding="utf-8").splitlines()
        table = ""
        for number, line in enumerate(lines):
            if line.startswith("["):
                table = line.split("]")[0][1:]
            path = f"{table}.{line.split('=')[0].strip()}"
            if path in changes:
                lines[number] = f"{line.split('=')[0]}= {changes.pop(path)}"
        assert not changes, f"not in the sheet: {changes}"
        target = tmp_path / name
        target.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return target

    return write
