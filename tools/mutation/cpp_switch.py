"""All changes of a C++ source in one text: each behind a switch that is set when the program runs.

One build then serves all mutants ("mutant schemata", Untch 1993), where a build for each would take minutes. An
expression becomes `(on(7) ? (changed) : (sound))`, a statement `{ if (on(7)) { changed } else { sound } }`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

from mutation.cpp_operators import SWITCH
from mutation.cpp_tokens import NotRead
from mutation.cpp_tree import Node, read
from mutation.mutant import Change

_EXPRESSIONS: Final = {
    "name", "number", "unary", "postfix", "binary", "ternary", "call", "index", "member", "paren",
}  # fmt: skip
_STATEMENTS: Final = {"expression", "return", "jump", "if", "loop", "block"}

HEADER: Final = """#pragma once
#ifdef __cplusplus
extern "C" {
extern int gantry_mutant;
extern unsigned char gantry_seen[];
}
namespace gantry_mutation {
inline bool on(int number) {
  gantry_seen[number] = 1;
  return gantry_mutant == number;
}
template <class T>
inline T highest(T) { return T(1e300); }
template <class T>
inline T lowest(T) { return T(-1e300); }
}  // namespace gantry_mutation
#endif
"""
"""Included before everything else."""

SOURCE: Final = """#include <cstdio>
#include <cstdlib>
#define GANTRY_SHOWN __attribute__((visibility("default"), used))
extern "C" {
GANTRY_SHOWN int gantry_mutant = 0;
GANTRY_SHOWN unsigned char gantry_seen[%(count)d];
__attribute__((constructor)) static void gantry_chosen() {
  if (const char* number = std::getenv("GANTRY_MUTANT")) gantry_mutant = std::atoi(number);
}
__attribute__((destructor)) static void gantry_told() {
  const char* path = std::getenv("GANTRY_SEEN");
  std::FILE* file = path ? std::fopen(path, "wb") : nullptr;
  if (file == nullptr) return;
  std::fwrite(gantry_seen, 1, sizeof gantry_seen, file);
  std::fclose(file);
}
}
"""
"""One of it in every program: which change is in force, and which were passed by, written to a file at the end."""


class Switched:
    """The changes of one source behind their switches.

    Args:
        source: the text without any change.
        changes: by number, from 1.

    Attributes:
        alone: numbers of changes that fit behind no switch.
    """

    def __init__(self, source: bytes, changes: dict[int, Change]) -> None:
        self._text = source.decode("latin-1")
        self._tree = read(self._text)
        self._expressions: dict[int, list[tuple[int, str]]] = defaultdict(list)
        self._single: dict[int, list[tuple[int, str]]] = defaultdict(list)
        self._rows: dict[int, list[tuple[int, int, int, Change]]] = defaultdict(list)
        self._loose: set[int] = set()
        self.alone: list[int] = []
        self._shape_of: dict[str, object] = {}
        for number, change in changes.items():
            if not self._placed(number, _least(source, change)):
                self.alone.append(number)

    def text(self, leave_out: Iterable[int] = ()) -> str:
        """The source with all switches but these."""
        return self._pieces(self._tree, set(leave_out))

    # --- where a change goes ------------------------------------------------------------------------------------------
    def _placed(self, number: int, change: Change) -> bool:
        path = list(self._path(change.start, change.end))
        new = change.new.decode("latin-1")
        for above, node in reversed(list(zip([None, *path], path, strict=False))):
            if node.kind in _EXPRESSIONS and not self._is_changed_in_place(above, node):
                text = self._of(node, change)
                exact = (node.start, node.end) == (change.start, change.end)
                if exact or self._same(change, node, f"({text})"):
                    self._expressions[id(node)].append((number, text))
                    self._loose.update(id(each) for each in path if each.loosen)
                    return True
            if node.kind == "block" and self._in_block(number, change, node, new):
                return True
            if node.kind in _STATEMENTS and above is not None and above.kind in {"if", "loop"}:
                text = self._of(node, change)
                if node is not above.condition and _is_statement(text):
                    self._single[id(node)].append((number, text))
                    return True
        return False

    @staticmethod
    def _is_changed_in_place(above: Node | None, node: Node) -> bool:
        """A name that is written to, called or pointed at is no value."""
        if above is None:
            return False
        if above.kind in {"assign", "call", "member", "index"}:
            return node is above.children[0]
        return above.kind == "postfix" or (
            above.kind == "unary" and above.sign in {"&", "++", "--", "sizeof"}
        )

    def _path(self, start: int, end: int) -> Iterator[Node]:
        node: Node | None = self._tree
        while node is not None:
            yield node
            node = next((each for each in node.children if each.start <= start and end <= each.end), None)

    def _of(self, node: Node, change: Change) -> str:
        return (
            self._text[node.start : change.start]
            + change.new.decode("latin-1")
            + self._text[change.end : node.end]
        )

    def _same(self, change: Change, node: Node, other: str) -> bool:
        """Whether the change means the same as this node in brackets changed: a change may tear an expression apart."""
        new = change.new.decode("latin-1")
        plain = self._text[: change.start] + new + self._text[change.end :]
        inside = self._text[: node.start] + other + self._text[node.end :]
        try:
            return self._shape(plain) == self._shape(inside)
        except NotRead:
            return False

    def _shape(self, text: str) -> object:
        if text not in self._shape_of:
            self._shape_of = {text: _shape(read(text)), **dict(list(self._shape_of.items())[:4])}
        return self._shape_of[text]

    def _in_block(self, number: int, change: Change, block: Node, new: str) -> bool:
        if not (block.start < change.start and change.end < block.end):
            return False
        inside = [
            place
            for place, each in enumerate(block.children)
            if each.start < max(change.end, change.start + 1) and each.end > change.start
        ]
        if not inside:
            return False
        first, last = inside[0], inside[-1]
        old = block.children[first : last + 1]
        start, end = min(old[0].start, change.start), max(old[-1].end, change.end)
        text = self._text[start : change.start] + new + self._text[change.end : end]
        if any(each.kind not in _STATEMENTS for each in old) or not _is_statement(text):
            return False
        self._rows[id(block)].append((number, first, last, change))
        return True

    # --- the text -----------------------------------------------------------------------------------------------------
    def _pieces(self, node: Node, left_out: set[int]) -> str:
        text, at, found = self._text, node.start, []
        groups = self._groups(node, left_out) if node.kind == "block" else {}
        closes: set[int] = set()
        for place, child in enumerate(node.children):
            found.append(text[at : child.start])
            if place in groups:
                last, head = groups[place]
                found.append(head)
                closes.add(last)
            found.append(self._pieces(child, left_out))
            if place in closes:
                found.append(" } }")
            at = child.end
        found.append(text[at : node.end])
        written = "".join(found)
        single = [each for each in self._single.get(id(node), []) if each[0] not in left_out]
        if single:
            written = f"{_if_chain(single)}{written} }} }}"
        switched = [each for each in self._expressions.get(id(node), []) if each[0] not in left_out]
        if switched:
            chain = "".join(f"\n{SWITCH}on({number}) ? ({new}) : " for number, new in switched)
            written = f"({chain}\n({written}))"
        if node.loosen and id(node) in self._loose:
            written = self._loosened(node, written)
        return written

    def _groups(self, block: Node, left_out: set[int]) -> dict[int, tuple[int, str]]:
        """By the first statement of a row: its last, and what stands before it. Rows that overlap are one."""
        rows: list[tuple[int, int, list[tuple[int, Change]]]] = []
        for number, first, last, change in sorted(
            self._rows.get(id(block), []), key=lambda row: (row[1], row[2], row[0])
        ):
            if number in left_out:
                continue
            if rows and first <= rows[-1][1]:
                begun, ended, group = rows.pop()
                rows.append((begun, max(ended, last), [*group, (number, change)]))
            else:
                rows.append((first, last, [(number, change)]))
        found = {}
        for first, last, group in rows:
            whole = Node("row", block.children[first].start, block.children[last].end)
            found[first] = last, _if_chain([(number, self._of(whole, change)) for number, change in group])
        return found

    def _loosened(self, node: Node, written: str) -> str:
        """A constant that is computed when it is read, so that the switch acts whenever it is set."""
        name = node.sign.rpartition(".")[2]
        begin = written.index("=") + 1
        end = len(written) if written[-1] != ";" else len(written) - 1
        tail = written[end:]
        number = f"struct {name}_number {{ operator double() const {{ return {written[begin:end]}; }} }}; "
        return f"{number}static const {name}_number {name}{{}}{tail}"


def _least(source: bytes, change: Change) -> Change:
    """The same change without what its old and its new text have in common at both ends."""
    old, new = source[change.start : change.end], change.new
    if change.function:  # a mutant is a whole node already
        return change
    most = min(len(old), len(new))
    ahead = next((k for k in range(most) if old[k] != new[k]), most)
    most -= ahead
    behind = next((k for k in range(most) if old[-1 - k] != new[-1 - k]), most)
    return replace(
        change, start=change.start + ahead, end=change.end - behind, new=new[ahead : len(new) - behind]
    )


def _if_chain(changes: list[tuple[int, str]]) -> str:
    chain = "".join(f"if ({SWITCH}on({number})) {{ {new} }}\nelse " for number, new in changes)
    return f"{{\n{chain}{{ "


def _is_statement(text: str) -> bool:
    """Whether this is a row of whole statements that declare nothing."""
    try:
        tree = read(f"void f() {{ {text} }}")
    except NotRead:
        return False
    if len(tree.children) != 1 or tree.children[0].kind != "function":
        return False
    block = tree.children[0].children[-1]
    return block.end == tree.end and all(each.kind in _STATEMENTS for each in block.children)


def _shape(node: Node) -> object:
    if node.kind == "paren":
        return _shape(node.children[0])
    return node.kind, node.sign, *map(_shape, node.children)


def numbered(changes: Iterable[Change]) -> dict[Path, dict[int, Change]]:
    """Changes by source, each with its number from 1."""
    found: dict[Path, dict[int, Change]] = defaultdict(dict)
    for number, change in enumerate(changes, 1):
        found[Path(change.file)][number] = change
    return found
