"""Text from files and users, where it is written into something else."""

import re

import pytest

from kinqp.robots.text import in_c, in_cmake, in_markdown, one_line
from tests.hostile import HOSTILE

names = pytest.mark.parametrize("name", HOSTILE.values(), ids=HOSTILE.keys())


@names
def test_one_line_is_one_that_can_be_seen_and_encoded(name: str) -> None:
    text = one_line(name)
    assert len(text.splitlines()) <= 1
    assert text.isprintable()
    text.encode()


@names
def test_a_comment_of_c_goes_on_behind_it(name: str) -> None:
    text = in_c(name)
    assert not re.search(r"\*/|/\*|\?\?|\\|\n", text)
    assert in_c(text) == text


@names
def test_markdown_holds_no_element_no_link_and_no_new_cell(name: str) -> None:
    text = in_markdown(name)
    assert not re.search(r"[<>`\n]", text)
    assert not re.search(r"(?<!\\)[|\[\]*!$]", text.replace("\\\\", ""))


@names
def test_a_word_of_cmake_is_one(name: str) -> None:
    assert re.fullmatch(r"[\w.+-]*", in_cmake(name), flags=re.ASCII)


@pytest.mark.parametrize("name", ["lbr_med7", "UR5e (2019)", "Größe 3, links", "joint-space + remote-centre", "a/b"])
@pytest.mark.parametrize("function", [one_line, in_c, in_markdown])
def test_ordinary_names_come_through(name: str, function) -> None:
    assert function(name) == name
