"""What may be shared by the objects of several instruction sets: code that is the same for each of them."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest

TOOL = Path(__file__).parents[2] / "tools" / "kernel_symbols.py"
LISTING = """
0000000000000000 <std::throw_length_error(char const*)>:
   0:	push   %rbp
   1:	call   14 <__cxa_throw>

0000000000000020 <shared(double*)>:
  20:	vmovupd 0x10(%rdi),%ymm0
  25:	ret

0000000000000030 <masked(double*)>:
  30:	kmovw  %eax,%k1
  34:	ret
"""


@pytest.fixture
def tool() -> ModuleType:
    spec = importlib.util.spec_from_file_location("kernel_symbols", TOOL)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_only_code_without_vector_registers_may_be_shared(tool: ModuleType) -> None:
    assert tool.scalar_functions(LISTING) == {"std::throw_length_error(char const*)"}


def test_a_weak_symbol_of_another_namespace_is_found(tool: ModuleType) -> None:
    names = "0000000000000000 W shared(double*)\n0000000000000000 W gantry::avx2::own(double)\n"
    assert list(tool.shared_symbols(names, "avx2")) == ["shared(double*)"]
