"""One change of one source: a mutant, or a planted bug."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Change:
    """Bytes of one file that are replaced.

    Attributes:
        name: stable while the function stays as it is: file, function, operator, number; of a planted bug its name.
        file: path from the root of the repository.
        start, end: the bytes that `new` replaces.
        line, end_line: where the test selection looks.
        function: qualified name of the outermost function around it, "" at module or class level.
        names: at module or class level: what it defines.
        severe: could move, drop or mislead people.
        tests: node ids or paths that are run instead of what coverage selects.
    """

    name: str
    file: str
    start: int
    end: int
    new: bytes
    line: int
    end_line: int
    function: str = ""
    names: tuple[str, ...] = ()
    severe: bool = False
    tests: tuple[str, ...] = ()

    def applied(self, source: bytes) -> bytes:
        """The text with the change."""
        return source[: self.start] + self.new + source[self.end :]

    def lines(self, source: bytes) -> tuple[str, str]:
        """The lines that change, before and after, without layout."""
        begin = source.rfind(b"\n", 0, self.start) + 1
        end = source.find(b"\n", self.end)
        after = source[self.end : end if end >= 0 else len(source)]
        old, new = (
            source[begin : self.start] + middle + after
            for middle in (source[self.start : self.end], self.new)
        )
        return " ".join(old.decode().split()), " ".join(new.decode().split())

    def shown(self, root: Path) -> str:
        """The change in one line for people."""
        source = (root / self.file).read_bytes()
        old, new = source[self.start : self.end].decode(), self.new.decode()
        return f"{self.file}:{self.line}: {' '.join(old.split())} -> {' '.join(new.split()) or '(nothing)'}"
