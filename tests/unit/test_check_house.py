"""The checker of the house must be able to find something."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture(scope="module")
def checker() -> ModuleType:
    path = Path(__file__).parents[2] / "tools" / "check_house.py"
    spec = importlib.util.spec_from_file_location("check_house", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def write(src: Path, sources: dict[str, str]) -> Path:
    for name, text in sources.items():
        path = src / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return src


@pytest.mark.parametrize(
    "back",
    [
        "from house.room import a",
        "import house.room.a",
        "def f():\n    from house.room.a import x",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from house.room.a import x",
        "from house.room import x",
    ],
)
def test_a_circle_is_found_wherever_the_import_stands(checker: ModuleType, tmp_path: Path, back: str) -> None:
    sources = {
        "house/room/__init__.py": "from house.room.a import x",
        "house/room/a.py": "from house.room.b import y\nx = 1",
        "house/room/b.py": f"{back}\ny = 2",
        "house/free.py": "from house.room.b import y",
    }
    findings = list(checker.circles(checker.read_modules(write(tmp_path, sources))))
    assert len(findings) == 1
    assert "house.room.a" in findings[0]
    assert "house.room.b" in findings[0]
    assert "free" not in findings[0]


def test_imports_that_go_one_way_are_no_circle(checker: ModuleType, tmp_path: Path) -> None:
    sources = {
        "house/room/__init__.py": "from house.room.a import x",
        "house/room/a.py": "from house.room.b import y\nx = 1",
        "house/room/b.py": "from house import _core\ny = 2",
        "house/_core.pyi": "",
        "house/__init__.py": "from house.room import x",
    }
    assert not list(checker.circles(checker.read_modules(write(tmp_path, sources))))


LOWER = "class Lower:\n    pass\n"
UPPER = "from house.room.a import Lower\n\n\nclass Upper(Lower):\n    pass\n"


@pytest.mark.parametrize(
    ("lower", "upper"),
    [
        (LOWER, UPPER),
        (LOWER, UPPER.replace("house.room.a", "house.room")),  # by way of the package
        (LOWER, UPPER.replace("import Lower", "import Lower as L").replace("(Lower)", "(L)")),
        ("class Lower(Generic[T]):\n    pass\n", UPPER.replace("(Lower)", "(Lower[int])")),
        ("class Lower(Exception):\n    pass\n", UPPER),
    ],
)
def test_a_class_cut_in_two_is_found(checker: ModuleType, tmp_path: Path, lower: str, upper: str) -> None:
    sources = {
        "house/room/__init__.py": "from house.room.a import Lower",
        "house/room/a.py": lower,
        "house/room/b.py": upper,
    }
    findings = list(checker.cut_classes(checker.read_modules(write(tmp_path, sources))))
    assert findings == ["class cut by inheritance: house.room.a.Lower has one subclass, house.room.b.Upper"]


@pytest.mark.parametrize(
    ("lower", "upper"),
    [
        ("class Lower(Protocol):\n    pass\n", UPPER),
        ("class Lower(abc.ABC):\n    pass\n", UPPER),
        ("class Lower:\n    @abstractmethod\n    def f(self): ...\n", UPPER),
        ("class Lower(NamedTuple):\n    x: int\n", UPPER),
        ("class Lower(enum.StrEnum):\n    pass\n", UPPER),
        (LOWER, UPPER + "\n\nclass Other(Lower):\n    pass\n"),
        (LOWER.replace("Lower", "AxisProgram"), UPPER.replace("Lower", "AxisProgram")),
    ],
)
def test_what_is_made_to_be_derived_from_is_allowed(
    checker: ModuleType, tmp_path: Path, lower: str, upper: str
) -> None:
    write(tmp_path, {"house/room/a.py": lower, "house/room/b.py": upper})
    assert not list(checker.cut_classes(checker.read_modules(tmp_path)))


def test_a_base_in_another_wing_is_no_half(checker: ModuleType, tmp_path: Path) -> None:
    write(tmp_path, {"house/east/a.py": LOWER, "house/west/b.py": UPPER.replace("room", "east")})
    assert not list(checker.cut_classes(checker.read_modules(tmp_path)))


def test_a_full_folder_is_found(checker: ModuleType, tmp_path: Path) -> None:
    names = ["__init__", "__main__", *(f"file_{number}" for number in range(checker.MAX_FILES))]
    write(tmp_path, {f"house/{name}.py": "" for name in names})
    assert not list(checker.full_folders(tmp_path))
    write(tmp_path, {"house/one_more.py": ""})
    assert list(checker.full_folders(tmp_path)) == ["house: 15 files, at most 14"]


@pytest.mark.parametrize(
    ("line", "found"),
    [
        ("assert x.y is not None", False),
        ("assert isinstance(x, A | B)  # said above", False),
        ("assert x", True),
        ("assert x is not None and allowed(x)", True),
        ("assert isinstance(x, A), f()", False),  # the message of an assert refuses nothing
        ("assert isinstance(x, A) or refuse(x)", True),
    ],
)
def test_an_assert_that_refuses_something_is_found(
    checker: ModuleType, tmp_path: Path, line: str, found: bool
) -> None:
    modules = checker.read_modules(write(tmp_path, {"house/a.py": f"def f(x):\n    {line}\n"}))
    assert bool(list(checker.checking_asserts(modules))) is found
