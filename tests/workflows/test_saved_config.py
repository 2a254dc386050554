"""What was run stands in a run's config; what was given is known beside it."""

import pytest
from support import config, loaded

import rigidsim
from rigidsim.workflows.read import embedded

TEXT = config(time="end = 10 # long\nevery = 0.5", more="# the end", name="cut")
SETTINGS = ["time.end=60", " integrator.tolerance=1.0000000000000000000000001e-15 "]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> rigidsim.Run:
    experiment = rigidsim.parse(TEXT, overrides=[*SETTINGS, "limits.max_steps=100000"])
    return rigidsim.run(experiment, out=tmp_path_factory.mktemp("whole"))


def test_the_folder_says_what_was_run_and_the_dataset_what_was_given(whole: rigidsim.Run) -> None:
    text = whole.folder.config.read_text()
    assert text == TEXT.replace("end = 10 #", "end = 60 #").replace(
        "[integrator]\n", "[integrator]\ntolerance = 1.0000000000000000000000001e-15\n"
    ).replace("# the end", "# the end\n\n[limits]\nmax_steps = 100000")
    attributes = loaded(whole).attrs
    assert attributes["config"] == text
    assert attributes["config_given"] == TEXT
    given = [line.strip() for line in SETTINGS]
    assert attributes["config_set"].splitlines() == [*given, "limits.max_steps=100000"]
    assert rigidsim.parse(TEXT, overrides=attributes["config_set"].splitlines()).text == text
    again = embedded(whole.folder.dataset, overrides=["time.end=3"])
    assert (again.given, again.settings[-1]) == (TEXT, "time.end=3")
