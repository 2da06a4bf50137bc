"""The statements and expressions of a C++ source, as far as the core is written: a reader by operator precedence.

What is fixed when it is compiled (arguments of templates, constexpr numbers that are no double, conditions of
`if constexpr`, default arguments, texts of the preprocessor) has no nodes: nothing can be switched there.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Final

from mutation.cpp_tokens import NotRead, Token, tokens

_BINARY: Final = {
    "||": 3, "&&": 4, "|": 5, "^": 6, "&": 7, "==": 8, "!=": 8, "<": 9, ">": 9, "<=": 9, ">=": 9, "<<": 10, ">>": 10,
    "+": 11, "-": 11, "*": 12, "/": 12, "%": 12,
}  # fmt: skip
_ASSIGN: Final = {"=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>="}
_UNARY: Final = {"-", "+", "!", "~", "*", "&", "++", "--"}
_CLOSES: Final = {"(": ")", "[": "]", "{": "}"}
_NO_NAMES: Final = {
    "return", "if", "else", "for", "while", "do", "switch", "case", "default", "break", "continue", "throw", "goto",
    "new", "delete", "using", "typedef", "static_assert", "sizeof", "try", "catch",
}  # fmt: skip
_BEFORE_TYPES: Final = {
    "const", "static", "constexpr", "inline", "thread_local", "unsigned", "signed", "typename", "volatile", "mutable",
    "explicit", "extern", "virtual",
}  # fmt: skip


@dataclass(slots=True)
class Node:
    """A piece of the program.

    Attributes:
        kind: of expressions name, number, text, unary, postfix, binary, assign, ternary, call, index, member, braces,
            paren, lambda; of statements expression, declaration, return, jump, if, loop, block, function.
        start, end: characters of the source.
        children: in their order.
        sign: the operator, or the name of a function that is called or defined.
        condition: of if, loop and ternary.
        loosen: of a declaration where `constexpr` stands that must become `const` for its number to be switched.
    """

    kind: str
    start: int
    end: int
    children: list[Node] = field(default_factory=list)
    sign: str = ""
    condition: Node | None = None
    loosen: tuple[int, int] | None = None

    def walk(self) -> Iterator[Node]:
        """This node and all below it."""
        yield self
        for child in self.children:
            yield from child.walk()


def read(source: str) -> Node:
    """The tree of one source.

    Raises:
        NotRead: a statement that this reader does not understand, with its line.
    """
    words = tokens(source)
    reader = _Reader(source, words)
    try:
        reader.scope(len(words), "")
    except (NotRead, IndexError) as why:
        at = words[min(reader.i, len(words) - 1)].start
        raise NotRead(f"line {source[:at].count(chr(10)) + 1}: {why}") from why
    return Node("file", 0, len(source), reader.found)


class _Reader:
    """The words of a source, where it is among them, and what stands at the level of namespaces and classes."""

    def __init__(self, source: str, words: Sequence[Token]) -> None:
        self.source, self.words = source, words
        self.i = 0
        self.found: list[Node] = []

    # --- words -------------------------------------------------------------------------------------------------------
    def text(self, ahead: int = 0) -> str:
        return self.words[self.i + ahead].text

    def kind(self, ahead: int = 0) -> str:
        return self.words[self.i + ahead].kind

    def start(self) -> int:
        return self.words[self.i].start

    def last_end(self) -> int:
        return self.words[self.i - 1].end

    def take(self, text: str) -> None:
        if self.text() != text:
            raise NotRead(f"{text} is expected before {self.source[self.start() : self.start() + 30]!r}")
        self.i += 1

    def skip_group(self) -> None:
        """From a bracket to behind the one that closes it."""
        open_, close = self.text(), _CLOSES.get(self.text(), ">")
        depth = 0
        while True:
            if self.kind() in {"sign", "angle"}:
                if self.text() == open_ and (open_ != "<" or self.kind() == "angle"):
                    depth += 1
                elif self.text() == close and (close != ">" or self.kind() == "angle"):
                    depth -= 1
                elif open_ == "<" and self.text() == "(":
                    self.skip_group()
                    continue
            self.i += 1
            if depth == 0:
                return

    def skip_statement(self) -> None:
        """Behind the next semicolon outside brackets."""
        while self.text() != ";":
            if self.text() in _CLOSES:
                self.skip_group()
            else:
                self.i += 1
        self.i += 1

    def at_angle(self) -> bool:
        return self.kind() == "angle" and self.text() == "<"

    # --- namespaces and classes --------------------------------------------------------------------------------------
    def scope(self, end: int, around: str) -> None:
        while self.i < end:
            text = self.text()
            if text == ";":
                self.i += 1
            elif text == "namespace" or (text == "inline" and self.text(1) == "namespace"):
                self.find("{", ";")
                self.inside(around)
            elif text == "extern" and self.kind(1) == "text":
                self.i += 2
                self.inside(around)
            elif text == "template":
                self.i += 1
                self.skip_group()
            elif text in {"using", "typedef", "static_assert", "friend", "enum"}:
                self.skip_statement()
            elif text in {"public", "private", "protected"}:
                self.i += 2
            elif text in {"struct", "class"}:
                name = self.text(1)
                self.find("{", ";")
                self.inside(f"{around}.{name}".lstrip("."))
            elif text.isupper() and self.text(1) == "(" and "_" in text:
                self.i += 1
                self.skip_group()  # a macro that is used, and ends with its bracket
            else:
                self.member(around)

    def find(self, *signs: str) -> None:
        while self.text() not in signs:
            self.i += 1

    def inside(self, around: str) -> None:
        if self.text() != "{":
            return
        begin = self.i
        self.skip_group()
        end, self.i = self.i - 1, begin + 1
        self.scope(end, around)
        self.i = end + 1

    def member(self, around: str) -> None:
        """A function or a variable."""
        begin = self.i
        before: list[str] = []
        while True:
            text = self.text()
            if text == "__attribute__":
                self.i += 1
                self.skip_group()
            elif self.at_angle():
                self.skip_group()
            elif text == "operator":
                name = "operator"
                self.i += 1
                while self.text() != "(" or name == "operator":
                    name += self.text()
                    self.i += 1
                return self.function(begin, f"{around}.{name}".lstrip("."), before)
            elif text == "(":
                return self.function(begin, f"{around}.{self.words[self.i - 1].text}".lstrip("."), before)
            elif text in {"=", "{", ";", "["}:
                self.i = begin
                found = self.declaration()
                if found:
                    found.sign = f"{around}.{found.sign}".lstrip(".")
                    self.found.append(found)
                return None
            else:
                before.append(text)
                self.i += 1

    def function(self, begin: int, name: str, before: Sequence[str]) -> None:
        self.skip_group()
        while self.text() not in {"{", ";", ":", "="}:
            if self.text() in _CLOSES:
                self.skip_group()
            else:
                self.i += 1
        if self.text() in {";", "="}:
            return self.skip_statement()
        children: list[Node] = []
        if self.text() == ":":
            while self.text() != "{":
                self.i += 2
                if self.at_angle():
                    self.skip_group()
                children += self.arguments(_CLOSES[self.text()])
        if "constexpr" in before:
            return self.skip_group()
        children.append(self.block())
        self.found.append(Node("function", self.words[begin].start, self.last_end(), children, name))
        return None

    # --- statements --------------------------------------------------------------------------------------------------
    def block(self) -> Node:
        start = self.start()
        self.take("{")
        children = []
        while self.text() != "}":
            found = self.statement()
            if found:
                children.append(found)
        self.i += 1
        return Node("block", start, self.last_end(), children)

    def statement(self) -> Node | None:
        text, start = self.text(), self.start()
        if text == "{":
            return self.block()
        if text == ";":
            self.i += 1
            return None
        if text in {"using", "typedef", "static_assert"}:
            self.skip_statement()
            return None
        if text.isupper() and "_" in text and self.text(1) == "(":
            self.i += 1
            self.skip_group()
            if self.text() == ";":
                self.i += 1
            return None
        if text in {"if", "while", "for"}:
            return self.branch()
        if text in {"break", "continue"} or (text == "return" and self.text(1) == ";"):
            self.skip_statement()
            return Node("jump", start, self.last_end(), sign=text)
        if text in {"return", "throw"}:
            self.i += 1
            value = self.expression()
            self.take(";")
            return Node("return", start, self.last_end(), [value], text)
        if self.is_declaration():
            return self.declaration()
        value = self.expression()
        self.take(";")
        return Node("expression", start, self.last_end(), [value])

    def branch(self) -> Node:
        text, start = self.text(), self.start()
        self.i += 1
        fixed = self.text() == "constexpr"
        if fixed:
            self.i += 1
        children: list[Node] = []
        condition = None
        if fixed:
            self.skip_group()
        elif text == "for":
            condition = self.head_of_for(children)
        else:
            self.take("(")
            if self.is_declaration():
                children += self.declared(start).children
            else:
                condition = self.expression()
                children.append(condition)
            self.take(")")
        self.branches(children)
        if text == "if" and self.text() == "else":
            self.i += 1
            self.branches(children)
        return Node("if" if text == "if" else "loop", start, self.last_end(), children, text, condition)

    def branches(self, children: list[Node]) -> None:
        found = self.statement()
        if found:
            children.append(found)

    def head_of_for(self, children: list[Node]) -> Node | None:
        self.take("(")
        condition = None
        if self.text() != ";":
            if self.is_declaration():
                head = self.declared(self.start())
                children += head.children
                if self.text() == ":":
                    self.i += 1
                    children.append(self.expression())
                    self.take(")")
                    return None
            else:
                children.append(self.expression())
        self.take(";")
        if self.text() != ";":
            condition = self.expression()
            children.append(condition)
        self.take(";")
        if self.text() != ")":
            children.append(self.expression())
        self.take(")")
        return condition

    # --- declarations ------------------------------------------------------------------------------------------------
    def is_declaration(self) -> bool:
        begin = self.i
        try:
            if not self.type_():
                return False
            if self.text() == "[":
                return self.words[self.i - 1].text in {"auto", "&"}
            return self.kind() == "name" and self.text(1) in {"=", "(", "{", ";", ",", "[", ":"}
        finally:
            self.i = begin

    def type_(self) -> bool:
        """Passes a type, "long" and "long long" among them; false where there is none."""
        begin = self.i
        while self.text() in _BEFORE_TYPES:
            self.i += 1
        if self.kind() != "name" or self.text() in _NO_NAMES:
            return self.i > begin
        self.i += 1
        while self.text() == "::" or self.at_angle() or self.text() in {"const", "long"}:
            if self.at_angle():
                self.skip_group()
            else:
                self.i += 2 if self.text() == "::" else 1
        while self.text() in {"&", "*", "&&", "const"}:
            self.i += 1
        return True

    def declaration(self) -> Node | None:
        found = self.declared(self.start())
        self.take(";")
        return found

    def declared(self, start: int) -> Node:
        """Type and declarators, as far as what follows them; constexpr numbers that are no double have no nodes."""
        begin = self.i
        self.type_()
        words = self.words[begin : self.i]
        fixed = next((word for word in words if word.text == "constexpr"), None)
        name, children = self.text(), []
        while True:
            if self.text() != "[":
                self.i += 1
            if self.at_angle():
                self.skip_group()
            while self.text() == "[":
                self.skip_group()
            if self.text() == "=":
                self.i += 1
                children.append(self.expression())
            elif self.text() in {"(", "{"}:
                children += self.arguments(_CLOSES[self.text()])
            if self.text() != ",":
                break
            self.i += 1
            while self.text() in {"*", "&"}:
                self.i += 1
        loosen = None
        if fixed is not None:
            if any(word.text == "double" for word in words) and len(children) == 1:
                loosen = fixed.start, fixed.end
            else:
                children = []
        return Node("declaration", start, self.last_end(), children, name, loosen=loosen)

    # --- expressions -------------------------------------------------------------------------------------------------
    def expression(self) -> Node:
        left = self.ternary()
        if self.text() in _ASSIGN:
            sign = self.text()
            self.i += 1
            right = self.expression()
            return Node("assign", left.start, right.end, [left, right], sign)
        return left

    def ternary(self) -> Node:
        condition = self.binary(3)
        if self.text() != "?":
            return condition
        self.i += 1
        yes = self.expression()
        self.take(":")
        no = self.expression()
        return Node("ternary", condition.start, no.end, [condition, yes, no], "?", condition)

    def binary(self, least: int) -> Node:
        left = self.unary()
        while self.kind() == "sign" and _BINARY.get(self.text(), 0) >= least:
            sign = self.text()
            self.i += 1
            right = self.binary(_BINARY[sign] + 1)
            left = Node("binary", left.start, right.end, [left, right], sign)
        return left

    def unary(self) -> Node:
        start, text = self.start(), self.text()
        if (self.kind() == "sign" and text in _UNARY) or text == "sizeof":
            self.i += 1
            operand = self.unary()
            return Node("unary", start, operand.end, [operand], text)
        return self.postfix(self.primary())

    def primary(self) -> Node:
        start, kind, text = self.start(), self.kind(), self.text()
        if kind in {"number", "text"}:
            self.i += 1
            return Node(kind, start, self.last_end(), sign=text)
        if text == "(":
            self.i += 1
            inner = self.expression()
            self.take(")")
            return Node("paren", start, self.last_end(), [inner])
        if text == "{":
            given = self.arguments("}")
            return Node("braces", start, self.last_end(), given)
        if text == "[":
            return self.lambda_()
        if text == "::" or text in _BEFORE_TYPES:
            self.i += 1
        if self.kind() != "name" or self.text() in _NO_NAMES:
            raise NotRead(f"{self.text()!r} begins no expression")
        while True:
            name = self.text()
            self.i += 1
            if self.at_angle():
                self.skip_group()
            if self.text() != "::":
                return Node("name", start, self.last_end(), sign=name)
            self.i += 1

    def postfix(self, node: Node) -> Node:
        while True:
            text = self.text()
            if text == "(" or (text == "{" and node.kind == "name"):
                given = self.arguments(_CLOSES[text])
                node = Node("call", node.start, self.last_end(), [node, *given], node.sign)
            elif text == "[":
                self.i += 1
                index = self.expression()
                self.take("]")
                node = Node("index", node.start, self.last_end(), [node, index])
            elif text in {".", "->"}:
                self.i += 1
                name = self.text()
                self.i += 1
                if self.at_angle():
                    self.skip_group()
                node = Node("member", node.start, self.last_end(), [node], name)
            elif text in {"++", "--"}:
                self.i += 1
                node = Node("postfix", node.start, self.last_end(), [node], text)
            else:
                return node

    def arguments(self, close: str) -> list[Node]:
        self.i += 1
        found = []
        while self.text() != close:
            found.append(self.expression())
            if self.text() == ",":
                self.i += 1
        self.i += 1
        return found

    def lambda_(self) -> Node:
        start = self.start()
        self.skip_group()
        while self.text() != "{":
            if self.text() == "(":
                self.skip_group()
            else:
                self.i += 1
        body = self.block()
        return Node("lambda", start, body.end, [body])
