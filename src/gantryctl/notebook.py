"""How an object shows itself in a notebook: a small table, everything escaped, no script and no style of its own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape


def facts_html(title: str, facts: Mapping[str, object]) -> str:
    """Write a title and a row of name and value for each fact."""
    rows = "".join(f"<tr><th>{_text(name)}</th><td>{_text(value)}</td></tr>" for name, value in facts.items())
    return f"<div><b>{_text(title)}</b><table><tbody>{rows}</tbody></table></div>"


def table_html(title: str, head: Sequence[str], rows: Iterable[Sequence[object]], note: str = "") -> str:
    """Write a title, a table with a head, and a line below it."""
    top = "".join(f"<th>{_text(name)}</th>" for name in head)
    body = "".join(f"<tr>{''.join(f'<td>{_text(cell)}</td>' for cell in row)}</tr>" for row in rows)
    below = f"<div>{_text(note)}</div>" if note else ""
    return f"<div><b>{_text(title)}</b><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table>{below}</div>"


def _text(value: object) -> str:
    return "-" if value is None else escape(f"{value:.6g}" if isinstance(value, float) else str(value))
