"""Names that a file may hold and that must stay names: each tries to be something else somewhere."""

from __future__ import annotations

#: What they are for, and the name.
HOSTILE = {
    "end of a comment": "*/ int injected; /*",
    "end of a comment, twice": "**//**/ int injected;",
    "begin of a comment": "/* still open",
    "trigraph": "??/\nint injected;",
    "trigraphs for braces": "??< ???/ ??>",
    "joined lines": "*\\\n/ int injected;",
    "lines": "one\n#error injected\r\n#include </dev/null>\x0bthree\x85four\u2028five",
    "quotes": '"\'`" int injected;',
    "script": "</script><script>injected()</script><img src=x onerror=injected()>",
    "table": "a | b | c [link](javascript:injected()) ![x](y) ``` $x$",
    "path": "../../../injected",
    "absolute path": "/etc/injected\x00.c",
    "right to left": "x\u202e/* }\u2066 int injected;\u200f",
    "cmake": 'a) file(REMOVE injected) # ${HOME} ";" $<1:x>',
    "control characters": "\x1b[31mred\x9b0m\x07\ud800",
    "long": "n" * 5000,
    "nothing": "",
}
