"""The kept corpus of the fuzzed doors, input by input: only the promised error leaves a door, in time and memory.

`make fuzz` looks for more; what it finds is put beside the others, with a name that says what it is.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from pathlib import Path

import pytest

import gantryctl
from support.coverage_fuzz.packages import PACKAGES
from support.coverage_fuzz.plain_loaders import PlainLoaders
from support.coverage_fuzz.run import CORPUS, TooMuch, TooSlow, judge
from support.coverage_fuzz.targets import TARGETS, Target, frames_of, patched

CORPUS_MAX_KB = 1024


def inputs(name: str) -> Iterator[Path]:
    folder = CORPUS / name
    yield from sorted(folder.iterdir()) if folder.is_dir() else ()


@pytest.mark.parametrize("name", TARGETS)
def test_only_its_own_error_leaves_a_door(name: str) -> None:
    target = TARGETS[name]
    taken = [judge(target, data) for data in target.seeds()]
    assert any(taken), "no seed gets through the door"
    for path in inputs(name):
        try:
            judge(target, path.read_bytes())
        except Exception as fault:
            raise AssertionError(f"{name}/{path.name}: {type(fault).__name__}: {fault}") from fault


def loader_of(name: str) -> type:
    """What would load a module of gantryctl now, were it not loaded yet."""
    specs = (finder.find_spec(f"gantryctl.{name}", gantryctl.__path__) for finder in sys.meta_path)
    return type(next(spec for spec in specs if spec is not None).loader)


def test_what_counts_branches_can_load_the_packages_of_a_door_itself() -> None:
    """atheris counts nothing behind the loaders of an editable install."""
    as_installed = loader_of("trace")
    with PlainLoaders(["gantryctl.runtime"]):
        assert loader_of("runtime") is SourceFileLoader
        assert loader_of("trace") is as_installed
    assert loader_of("runtime") is as_installed


def test_each_target_has_packages_and_the_corpus_stays_small() -> None:
    assert set(PACKAGES) == set(TARGETS)
    found = {path.name for path in CORPUS.iterdir()} - {"base"}
    assert found <= set(TARGETS)
    size_kb = sum(path.stat().st_size for path in CORPUS.rglob("*") if path.is_file()) / 1024
    assert size_kb < CORPUS_MAX_KB


def test_another_error_a_slow_input_and_a_large_one_are_found() -> None:
    """The judge can fail: each of its three measures, by a door that breaks it."""

    def wrong(_: bytes) -> None:
        raise KeyError("machine")

    def slow(_: bytes) -> None:
        sum(range(10_000_000))

    def large(_: bytes) -> None:
        bytearray(b"x") * (300 * 2**20)

    none: tuple[type[Exception], ...] = ()
    with pytest.raises(KeyError):
        judge(Target(wrong, (ValueError,), list), b"")
    assert not judge(Target(wrong, (KeyError,), list), b"")
    with pytest.raises(TooSlow, match=r"allowed 0\.01 s"):
        judge(Target(slow, none, list), b"", cpu_max_s=0.01, tries=1)
    with pytest.raises(TooMuch, match="allowed 200 MB"):
        judge(Target(large, none, list), b"", cpu_max_s=10.0, tries=1)


def test_a_patch_writes_and_cuts() -> None:
    assert patched(b"abcdef", b"\x01\x00\x00\x02XY") == b"aXYdef"
    assert patched(b"abcdef", b"\x03\x00\x00\x00") == b"abc"
    assert [frame.can_id for frame in frames_of(b"\x82\x11\x05\x06\x80\x00")] == [0x182, 0x080]
