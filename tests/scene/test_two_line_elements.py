"""Two-line elements: what is read, and what is refused with which words."""

import pytest

from rigidsim.scene.two_line_elements import parse_elements

ONE = "1 00005U 58002B   00179.78495062  .00000023  00000-0  28098-4 0  4753"
TWO = "2 00005  34.2682 348.7242 1859667 331.7664  19.3264 10.82419157413667"


def test_the_date_is_exact() -> None:
    assert str(parse_elements([ONE, TWO]).epoch) == "2000-06-27T18:50:19.733568 UTC"


def test_blanks_at_the_ends_of_lines_do_not_matter() -> None:
    assert parse_elements([f"{ONE}\n", f"{TWO}  "]).lines == (ONE, TWO)


@pytest.mark.parametrize(
    ("lines", "what"),
    [
        ([ONE[:-1] + "4", TWO], "line 1 ends with the checksum 4, but its digits add up to 3"),
        ([TWO, ONE], "line 1 (of 69 characters) isn't in its columns"),
        ([ONE[:-2], TWO], "line 1 (of 67 characters) isn't in its columns; 69 characters"),
        ([ONE, TWO.replace("00005", "00014")], "two objects, 00005 and 00014"),
        ([ONE.replace("00179", "00400")[:-1] + "0", TWO], "days from 1 to 366"),
    ],
)
def test_what_is_wrong_is_told_with_both_lines(lines: list[str], what: str) -> None:
    with pytest.raises(ValueError, match="given") as refused:
        parse_elements(lines)
    assert what in str(refused.value)
    assert all(line in str(refused.value) for line in lines)


@pytest.mark.parametrize("value", [ONE, [1, 2]])
def test_anything_but_two_texts_is_refused(value: object) -> None:
    with pytest.raises(ValueError, match="a list of two texts"):
        parse_elements(value)
