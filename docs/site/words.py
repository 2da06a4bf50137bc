"""The words of the search: English ones, and Chinese text by single characters and pairs, as no space parts it.

Sphinx takes a dictionary of 40 MB for Chinese; pairs find the same places in pages as few as these.
"""

from __future__ import annotations

import re

from sphinx.search.en import SearchEnglish

HAN = r"\u3400-\u9fff"


class SearchBoth(SearchEnglish):
    """Splits texts here and what is typed in the browser by one rule."""

    lang = "en-zh"
    language_name = "English"  # the name of the stemmer in the browser
    js_splitter_code = r"""
var splitQuery = (query) =>
  (query.match(/[HAN]+|(?:(?![HAN])[\p{L}\p{N}_])+/gu) || []).flatMap((word) =>
    /^[HAN]{2}/u.test(word) ? [...word].slice(1).map((_, at) => word.slice(at, at + 2)) : [word]
  );
""".replace("HAN", HAN)

    def split(self, input: str) -> list[str]:
        found = []
        for word in re.findall(rf"[{HAN}]+|(?:(?![{HAN}])\w)+", input):
            if not re.match(f"[{HAN}]", word):
                found.append(word)
                continue
            found.extend(word)
            found.extend(word[at : at + 2] for at in range(len(word) - 1))
        return found
