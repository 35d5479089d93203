"""Write docs/modes.md from the modes themselves: ``python docs/make_modes.py``."""

from pathlib import Path

from kinqp.formulations import Mode

EXAMPLES = {
    "free": "All six rows are guided.",
    "position": "The translations are guided; the orientation is left to the redundancy.",
    "fix-orientation": "The thesis's positioning: move the tool, keep its orientation.",
    "fix-position": "The thesis's aligning: turn the tool about its tip.",
    "line:z": "The thesis's drilling: along the tool's z and nothing else.",
    "plane:0,1,0": "Slide in a plane, here the vertical one with normal y: row 1 is along z, row 2 along x.",
    "rcm:0.1": "Pivot about a point on the tool's z, here 0.1 m ahead of the tip, and insert along z.",
}
TITLE = """# Motion modes

A mode splits the six rows of the tool's twist, three translations v [m/s] and three rotations w [rad/s]. `[#]` rows are
**guided**: the hand's velocity `v` has one entry for each, in this order. `[x]` rows are **locked**: they are zero (or
`v_fixed`, where drift is corrected), exactly. `[ ]` rows are neither; the redundancy may use them.

Rows are counted along the axes of the mode's frame, at the tool centre point; for `rcm` the translations are those of
the pivot. The frame is the world unless the table says so; `@tool` or `@world` behind a mode changes it
(`fix-position@tool`). `plane` uses two axes 1 and 2 in the plane and its normal n.

```text
"""


def document() -> str:
    """The whole page."""
    width = max(len(text) for text in EXAMPLES)
    lines = [f"{text:<{width}}  {Mode.parse(text).frame:<5}  {Mode.parse(text).picture()}" for text in EXAMPLES]
    notes = [f"- `{text}`: {note}" for text, note in EXAMPLES.items()]
    return TITLE + "\n".join(lines) + "\n```\n\n" + "\n".join(notes) + "\n"


if __name__ == "__main__":
    Path(__file__).with_name("modes.md").write_text(document(), encoding="utf-8")
