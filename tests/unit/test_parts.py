"""Licences, NOTICE and bill of materials say what the lock files say."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from cyclonedx.schema import SchemaVersion
from cyclonedx.validation.json import JsonStrictValidator

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("parts", ROOT / "tools" / "parts.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def released(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    (folder / "gantryctl-0.1.0.tar.gz").write_bytes(b"sources")
    (folder / "gantryctl-0.1.0-cp311-cp311-linux_x86_64.whl").write_bytes(b"wheel")
    return folder


@pytest.fixture(scope="module")
def bill(tool: ModuleType, released: Path) -> dict[str, Any]:
    assert tool.main(["bill", str(released)]) == 0
    made: dict[str, Any] = json.loads((released / "gantryctl-0.1.0.cdx.json").read_text(encoding="utf-8"))
    return made


@pytest.mark.skipif(
    sys.version_info[:2] != (3, 11), reason="written on the oldest Python, which installs all"
)
def test_the_page_and_the_notice_are_up_to_date(tool: ModuleType) -> None:
    found = tool.parts()
    assert tool.PAGE.read_text(encoding="utf-8") == tool.page(found), "run: make licences"
    if not (ROOT / "hmi" / "node_modules" / "svelte").is_dir():
        pytest.skip("the packages of the page are not installed: the texts of their licences are there")
    assert tool.NOTICE.read_text(encoding="utf-8") == tool.notice(found), "run: make licences"


def test_what_the_page_imports_stands_in_the_notice(tool: ModuleType) -> None:
    text = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "hmi" / "src").rglob("*.*"))
    imported = set(re.findall(r"""from ['"]((?:@[^/'"]+/)?[^./'"][^/'"]*)""", text))
    assert {"svelte", "uplot"} <= imported <= set(tool.INSIDE)


def test_a_licence_that_nobody_names_is_asked_for(tool: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(tool.READ, "scipy")
    with pytest.raises(LookupError, match="scipy: names no licence"):
        tool.licence("scipy")


def test_the_bill_is_valid_cyclonedx(bill: dict[str, Any]) -> None:
    validator = JsonStrictValidator(SchemaVersion.V1_6)
    assert validator.validate_str(json.dumps(bill)) is None
    bill["components"][0]["scope"] = "somewhat"
    wrong = validator.validate_str(json.dumps(bill))
    bill["components"][0]["scope"] = "required"
    assert wrong is not None


def test_the_bill_has_every_locked_package_with_every_hash(bill: dict[str, Any]) -> None:
    locked: dict[str, set[str]] = {}
    for name in ("run", "build", "dev"):
        text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
        for block in re.split(r"\n(?=\S)", text):
            package, version = block.split(maxsplit=1)[0].split("==")
            locked[f"pkg:pypi/{package}@{version}"] = set(re.findall(r"sha256:(\w{64})", block))
    hashes = {each["purl"]: {one["content"] for one in each["hashes"]} for each in bill["components"]}
    assert {ref: sums for ref, sums in hashes.items() if ref.startswith("pkg:pypi/")} == locked
    assert all(locked.values())
    page = json.loads((ROOT / "hmi" / "package-lock.json").read_text(encoding="utf-8"))["packages"]
    assert sum(ref.startswith("pkg:npm/") for ref in hashes) == len(
        {(path.rpartition("node_modules/")[2], about["version"]) for path, about in page.items() if path}
    )


def test_the_bill_tells_what_runs_from_what_builds(bill: dict[str, Any]) -> None:
    scope = {each["name"]: each["scope"] for each in bill["components"]}
    assert {scope[name] for name in ("numpy", "python-can", "uvicorn", "svelte", "nanobind")} == {"required"}
    assert {scope[name] for name in ("asyncua", "matplotlib", "distributed", "tornado")} == {"optional"}
    assert {scope[name] for name in ("pytest", "ruff", "vite", "typescript")} == {"excluded"}


def test_what_depends_on_what_leads_to_every_package_that_runs(bill: dict[str, Any]) -> None:
    ways = {row["ref"]: row["dependsOn"] for row in bill["dependencies"]}
    reached: set[str] = set()
    ahead = {bill["metadata"]["component"]["bom-ref"]}
    while ahead:
        reached |= ahead
        ahead = {ref for each in ahead for ref in ways[each]} - reached
    wanted = {each["bom-ref"] for each in bill["components"] if each["scope"] == "required"}
    assert wanted <= reached


def test_the_bill_names_the_files_of_the_release(bill: dict[str, Any], released: Path) -> None:
    named = {
        each["name"]: each["hashes"][0]["content"] for each in bill["metadata"]["component"]["components"]
    }
    files = [path for path in released.iterdir() if path.suffix != ".json"]
    assert named == {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}
