"""The words of a C++ source: comments, preprocessor lines and strings are told apart from the program.

`<` and `>` are brackets or comparisons. clang-format, which `make lint` demands, writes a comparison with a space on
both sides and a bracket of a template without one inside: that decides, and anything else is refused.
"""

from __future__ import annotations

import re
from typing import Final, NamedTuple

_WORDS: Final = re.compile(
    r"""
    (?P<none>\s+|//[^\n]*|/\*.*?\*/)
  | (?P<line>^[ \t]*\#(?:[^\n\\]|\\.)*)
  | (?P<text>(?:u8|[uUL])?"(?:[^"\\\n]|\\.)*"|'(?:[^'\\\n]|\\.)+')
  | (?P<number>0[xX][0-9a-fA-F.]+(?:[pP][+-]?\d+)?[uUlLfF]*|(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?[uUlLfF]*)
  | (?P<name>[A-Za-z_]\w*)
  | (?P<sign><<=|>>=|\.\.\.|::|->|\+\+|--|[-+*/%&|^=!<>]=|&&|\|\||<<|>>|[-+*/%&|^=!<>~?:;,.(){}\[\]])
    """,
    re.VERBOSE | re.MULTILINE | re.DOTALL,
)


class NotRead(ValueError):
    """A place that this reader does not understand."""


class Token(NamedTuple):
    """One word; `kind` is text, number, name, sign, or angle for a bracket of a template."""

    kind: str
    text: str
    start: int
    end: int


def tokens(source: str) -> list[Token]:
    """The words of a source in their order; positions are those of its characters.

    Raises:
        NotRead: a character that begins no word, or a `<` that is neither bracket nor comparison.
    """
    found: list[Token] = []
    at = 0
    while at < len(source):
        word = _WORDS.match(source, at)
        if word is None:
            raise NotRead(f"{source[at : at + 20]!r} begins no word")
        kind, text, at = str(word.lastgroup), word[0], word.end()
        if kind in {"none", "line"}:
            continue
        if kind == "sign" and text[0] in "<>":
            kind, text = _angle(source, word.start(), text)
            at = word.start() + len(text)
        found.append(Token(kind, text, word.start(), at))
    return found


def _angle(source: str, start: int, text: str) -> tuple[str, str]:
    before, after = source[start - 1 : start].isspace(), source[start + len(text) : start + len(text) + 1]
    if before and after.isspace():
        return "sign", text
    if (text[0] == "<" and not after.isspace()) or (text[0] == ">" and not before):
        return "angle", text[0]
    raise NotRead(f"{source[start - 20 : start + 20]!r}: neither a comparison nor a bracket of a template")
