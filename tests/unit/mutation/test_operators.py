"""Which places of a source are changed, and into what: the same of Python and of the core in C++."""

from __future__ import annotations

from typing import Any, NamedTuple

import pytest

pytestmark = pytest.mark.usefixtures("mutation_tool")


class Law(NamedTuple):
    """A small source, and by line what becomes of which part of it ("": of the whole line)."""

    file: str
    source: bytes
    above: bytes
    changes: dict[str, list[tuple[str, str]]]


LAW_PY = Law(
    "src/gantryctl/program/power/law.py",
    b'''"""A docstring with 5 < 6."""
LIMIT: int = 3
__all__ = ["law"]


class Law:
    def scan(self, speed, limit=2.0):
        """Also 1 and 2."""
        # the sign: speed < limit is not meant here
        if not (abs(speed) < limit and self.ready):
            raise ValueError(f"speed {speed} above {limit + 1}")
        self.count = min(self.count + 1, LIMIT)
        return -speed
''',
    b'"""More."""\n\nX = "a"\n',
    {
        "LIMIT: int = 3": [("3", "4")],
        "def scan(self, speed, limit=2.0):": [("2.0", "3.0")],
        "if not (abs(speed) < limit and self.ready):": [
            ("not ", ""), ("<", "<="), ("<", ">"), ("and", "or"), ("abs(speed) < limit", "True"),
            ("self.ready", "True"), ("abs(speed)", "(speed)"),
        ],
        'raise ValueError(f"speed {speed} above {limit + 1}")': [("", "pass")],
        "self.count = min(self.count + 1, LIMIT)": [("", "pass"), ("min", "max"), ("+", "-"), ("1", "2")],
        "return -speed": [("-speed", "None"), ("-speed", "(speed)")],
    },
)  # fmt: skip

LAW_HPP = Law(
    "core/control/law.hpp",
    b"""// speed < limit is not meant here
#define LIMIT(x) ((x) < 3 ? (x) : 3)
template <class T, int N = 2>
struct Law {
  static constexpr int kWidth = 4;
  static constexpr double kGain = 2.5;
  T last = T(0.0);

  T scan(const std::array<T, N>& seen, T limit) {
    const T speed = clamp(seen[0], -limit, limit);
    if (ready && speed < limit) return speed;
    last = select(vabs(speed) > limit, speed, T(kGain) * last);
    return last;
  }
};
""",
    b"// More.\n\nusing X = int;\n",
    {
        "static constexpr double kGain = 2.5;": [("2.5", "(2.5 * 1.5)")],
        "T last = T(0.0);": [("0.0", "1.0")],
        "const T speed = clamp(seen[0], -limit, limit);": [
            ("-limit, limit", "lowest(-limit), limit"), ("-limit, limit", "-limit, highest(limit)"),
            ("-limit", "(limit)"),
        ],
        "if (ready && speed < limit) return speed;": [
            ("ready && speed < limit", "!(ready && speed < limit)"),
            ("ready && speed < limit", "(ready || speed < limit)"), ("ready", "true"), ("speed < limit", "true"),
            ("speed < limit", "(speed <= limit)"), ("speed < limit", "(speed > limit)"),
        ],
        "last = select(vabs(speed) > limit, speed, T(kGain) * last);": [
            ("", ";"), ("speed, T(kGain) * last", "T(kGain) * last, speed"),
            ("select(vabs(speed) > limit, speed, T(kGain) * last)", "(speed)"),
            ("select(vabs(speed) > limit, speed, T(kGain) * last)", "(T(kGain) * last)"),
            ("vabs(speed) > limit", "(vabs(speed) >= limit)"), ("vabs(speed) > limit", "(vabs(speed) < limit)"),
            ("vabs(speed)", "(speed)"), ("T(kGain) * last", "(T(kGain) / last)"),
        ],
    },
)  # fmt: skip

EACH_LAW = pytest.mark.parametrize("law", [LAW_PY, LAW_HPP], ids=["Python", "C++"])


def mutants(law: Law, source: bytes) -> list[Any]:
    from mutation import cpp_operators, operators

    found = cpp_operators.cpp_mutants if law is LAW_HPP else operators.mutants
    return found(law.file, source)


@EACH_LAW
def test_the_mutants_of_a_small_law_are_these_and_no_others(law: Law) -> None:
    before = law.source.decode().split("\n")
    found = []
    for change in mutants(law, law.source):
        after = change.applied(law.source).decode().split("\n")
        (line,) = [new.strip() for old, new in zip(before, after, strict=True) if old != new]
        found.append(line.replace("::gantry_mutation::", ""))
    wanted = [
        line.replace(old, new) if old else new
        for line, changes in law.changes.items()
        for old, new in changes
    ]
    assert sorted(found) == sorted(wanted)


@EACH_LAW
def test_names_of_mutants_do_not_depend_on_the_lines_above(law: Law) -> None:
    names = [change.name for change in mutants(law, law.source)]
    assert names == [change.name for change in mutants(law, law.above + law.source)]
    assert len(set(names)) == len(names)
    assert f"{law.file.removeprefix('src/gantryctl/')}:Law.scan:compare:0" in names
