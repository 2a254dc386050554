"""An option that doesn't apply is refused with its name and exit code 2, not ignored.

Truth: which options a command has a use for there, by hand.
"""

import random
from pathlib import Path

import pytest
from made_by_commands import called
from support import seeds

IGNORED = {
    # a command that would do without them, and options that have no meaning there
    "verify runs/free": ("--members 3",),
    "verify fits/watched": ("--members 3",),
    "resume runs/free": ("--workers 2",),
    "resume runs/free --json": ("--verbose", "-v"),
    "resume runs/swept": ("--verbose", "--until 5", "--set limits.max_steps=9"),
    "resume fits/watched": ("--verbose", "--until 5", "--set limits.max_steps=9", "--workers 2"),
    "run free.toml": ("--member 0",),
    "run free.toml --json": ("--verbose",),
    "run free.toml --sweep body.mass=[1,2]": ("--verbose",),
    "sweep swept.toml --scheduler nowhere:1": ("--workers 1", "--workers 2"),
    "plan free.toml": ("--force", "--write other.toml"),
    "fit watched.toml": ("--member 1",),
    "view runs/free": ("--part scene", "--part page", "--at 1", "--seconds 1", "--member 0"),
    "view runs/free --png x.png": ("--seconds 1", "--web", "--member 0"),
    "view runs/free --gif x.gif": ("--at 1", "--web"),
    "view runs/free fits/watched --png x.png": ("--at 1", "--part scene", "--member 0"),
    "plot runs/swept": ("--for-slides dark",),
    "plot runs/free --what spectrum": ("--for-slides light",),
    "export runs/free --format csv": ("--axes ICRF", "--frame ICRF", "--object-name A", "--object-id 3"),
    "export runs/free --format aem --epoch J2000 --axes ICRF": ("--angle-unit deg", "--variable energy"),
    "export runs/swept --format csv": ("--axes ICRF", "--epoch J2000", "--object-name A", "--object-id 3"),
}
OTHER_NAMES = {"-v": "--verbose", "--frame": "--axes"}
CASES = [(line, option) for line, options in IGNORED.items() for option in options]


@pytest.mark.parametrize("seed", seeds(1, 20))
def test_an_option_without_effect_is_refused(seed: int, made: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(made)
    before = sorted(Path().rglob("*"))
    for line, option in random.Random(seed).sample(CASES, 7):
        result = called([*line.split(), *option.split()])
        name = option.split()[0]
        assert result.exit_code == 2, f"{line} {option}: {result.output}"
        said = result.stderr.replace("[sweep]", "--member")  # which the config lacks, says the message
        assert OTHER_NAMES.get(name, name) in said, f"{line} {option}: {result.stderr}"
    assert sorted(Path().rglob("*")) == before
