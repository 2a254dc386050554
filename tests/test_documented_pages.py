"""Every block of code on the documentation's pages runs, and prints what is shown."""

import sys
from pathlib import Path

import pytest
from documented_blocks import Story, blocks_of, is_slow, prepare
from support import cases
from test_documented_outputs import differences

ROOT = Path(__file__).parents[1]
PAGES = [*sorted((ROOT / "docs").rglob("*.md"))]
_PLAYED = [page for page in PAGES if any(block.run for block in blocks_of(page))]


@pytest.mark.parametrize(
    "page",
    cases(_PLAYED, [page for page in _PLAYED if not is_slow(page)], daily=8),
    ids=[str(page.relative_to(ROOT)) for page in _PLAYED],
)
def test_blocks_run_and_print_what_is_shown(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("MPLBACKEND", "agg")
    prepare(page, tmp_path)
    story = Story()
    for block in blocks_of(page):
        if not block.run:
            continue
        where = f"{page.relative_to(ROOT)}:{block.line}"
        if block.mark == "prints":
            found = differences(block.text.rstrip("\n"), _bare(story.printed))
            assert not found, "\n".join([f"{where} (to write it anew: python {__file__})", *found])
            continue
        try:
            story.play(block)
        except Exception as error:
            raise AssertionError(f"{where}: {type(error).__name__}: {error}") from error


def _bare(text: str) -> str:
    return "\n".join(line.rstrip() for line in text.rstrip("\n").splitlines())


def main(names: list[str]) -> None:
    """Write what blocks print into some pages, or all, anew."""
    import os
    import tempfile

    os.environ |= {"COLUMNS": "80", "MPLBACKEND": "agg"}
    for page in [Path(name).resolve() for name in names] or _PLAYED:
        found = blocks_of(page)
        made: dict[int, str] = {}
        with tempfile.TemporaryDirectory() as folder:
            prepare(page, Path(folder))
            before = Path.cwd()
            os.chdir(folder)
            story = Story()
            for number, block in enumerate(found):
                if block.run and block.mark == "prints":
                    made[number] = _bare(story.printed) + "\n"
                elif block.run:
                    print(f"{page.name}:{block.line}", file=sys.stderr, flush=True)
                    story.play(block)
            os.chdir(before)
        text = page.read_text(encoding="utf-8")
        for number in sorted(made, reverse=True):
            start, end = found[number].span
            text = text[:start] + made[number] + text[end:]
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    from rigidsim import parse  # noqa: F401  (every kind of load)

    main(sys.argv[1:])
