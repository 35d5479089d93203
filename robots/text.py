"""
Text from files and users, made harmless where it is written into something else.

A robot's name is whatever its file says. Every function here returns text that stays what it is in its place: it ends
no comment, no table cell and no command. Ordinary names come through as they are.
"""

from __future__ import annotations

import re
import unicodedata

#: Unicode's control, format (also those that reverse the direction of text), private, unassigned and separator
#: characters: what a reader of a file would not see.
_INVISIBLE = frozenset(("Cc", "Cf", "Cs", "Co", "Cn", "Zl", "Zp"))
#: With a meaning of its own in the running text of Markdown, or in the HTML that it may hold.
_MARKDOWN = re.compile(r"[\\*\[\]|!~$]")


def one_line(text: str) -> str:
    """
    Return text without line breaks or characters that can't be seen; each becomes a space.

    Parameters
    ----------
    text
        Anything; also with surrogates that no encoding takes.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(" " if unicodedata.category(letter) in _INVISIBLE else letter for letter in text)


def in_c(text: str) -> str:
    """
    Return text that may stand in a comment of C.

    It holds no comment's begin or end, no backslash (which would join lines) and no trigraph. What is C already, one
    line of it without a comment or a string, is the same C afterwards.

    Parameters
    ----------
    text
        Anything.
    """
    text = one_line(text).replace("\\", "/")
    text = re.sub(r"\?(?=\?)", "? ", text)
    return re.sub(r"\*(?=/)|/(?=\*)", lambda match: match[0] + " ", text)


def in_markdown(text: str) -> str:
    """
    Return text that may stand in Markdown: in a paragraph, a table's cell, or between backticks.

    Parameters
    ----------
    text
        Anything.
    """
    # Between backticks a backslash escapes nothing, so a backtick itself has to go.
    text = one_line(text).replace("`", "'")
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return _MARKDOWN.sub(lambda match: "\\" + match[0], text)


def in_cmake(text: str) -> str:
    """
    Return text that is one word of CMake, without a variable, a bracket or a quotation mark.

    Parameters
    ----------
    text
        Anything.
    """
    return re.sub(r"[^A-Za-z0-9_.+-]", "_", text)
