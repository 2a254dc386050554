"""The documentation's site: pages gathered with their links, the reference made from the code."""

import subprocess
import sys
from pathlib import Path

import pytest
import typer

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "docs" / "builder"))

import checking  # noqa: E402
import reference  # noqa: E402
import sections  # noqa: E402
import staging  # noqa: E402


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """All pages, as Sphinx gets them."""
    folder = tmp_path_factory.mktemp("pages")
    staging.gather(folder)
    reference.write(folder / "reference")
    staging.add_contents(folder)
    return folder


def test_every_page_is_in_the_table_of_contents(pages: Path) -> None:
    index = (pages / "index.md").read_text(encoding="utf-8")
    listed = {line for block in index.split("```{toctree}")[1:] for line in block.split("```")[0].split()}
    found = {str(page.relative_to(pages).with_suffix("")) for page in pages.rglob("*.md")} - {"index"}
    assert found <= listed
    assert {"choosing", "tutorial", "notebooks/mars_precession", "experiments/index"} <= found
    assert "`reference/" not in index.split("## And")[0].split("## Reference")[1].replace("python docs", "")


def test_links_lead_to_places_of_the_site(pages: Path) -> None:
    planar = (pages / "experiments" / "index.md").read_text(encoding="utf-8")
    assert "](../analysis.md)" in planar  # ../docs/analysis.md in the repository
    assert (pages / "experiments" / "figures" / "hyperion.png").exists()
    assert "](configs/heavy_top_nutating.toml)" in (pages / "gallery.md").read_text(encoding="utf-8")


def test_a_built_site_is_checked_as_a_reader_finds_it(tmp_path: Path) -> None:
    right = '<a href="two.html"><a href="two.html#there"><a href="https://example.org/x">'
    wrong = {
        '<a href="three.html">': "three.html leads nowhere",
        '<a href="two.html#where">': "two.html#where names a place that isn't there",
        '<script src="https://example.org/x.js">': "fetches https://example.org/x.js",
        '<button data-recording="x.rrd">': "x.rrd leads nowhere",
        '<script src="re_viewer.js"></script>': "lets the viewer fetch from elsewhere",
    }
    (tmp_path / "two.html").write_text('<h2 id="there">')
    (tmp_path / "re_viewer.js").write_text("")
    for page, fault in {right: "", **wrong}.items():
        (tmp_path / "one.html").write_text(page)
        assert checking.faults(tmp_path) == ([f"one.html: {fault}"] if fault else [])


def test_the_reference_has_every_key_command_and_variable(pages: Path) -> None:
    from rigidsim.cli.app import app
    from rigidsim.scene.registry import OBSERVABLES
    from rigidsim.scene.schema import editor_schema

    config, commands, dataset = (
        (pages / "reference" / f"{name}.md").read_text(encoding="utf-8")
        for name in ("config", "commands", "dataset")
    )
    schema = editor_schema()
    keys = {key for table in [schema, *schema["$defs"].values()] for key in table["properties"]}
    assert {key for key in keys if f"`{key}`" not in config} == set()
    names = typer.main.get_command(app).commands  # type: ignore[attr-defined]
    assert {name for name in names if f"## rigidsim {name}\n" not in commands} == set()
    assert {name for name in OBSERVABLES if f"| `{name}` |" not in dataset} == set()


@pytest.mark.slow
def test_every_warning_and_status_has_its_remedy() -> None:
    from rigidsim.scene.cautions import WarningCode
    from rigidsim.solve.status import Status

    text = (ROOT / "docs" / "troubleshooting.md").read_text(encoding="utf-8")
    codes = {code.value for code in WarningCode}
    assert {code for code in codes if f"\n### {code.replace('_', ' ')}\n" not in text} == set()
    unfinished = {status.value for status in Status if status.exit_code}
    assert {status for status in unfinished if f"`{status}`" not in text} == set()


def test_every_config_is_in_the_gallery(pages: Path) -> None:
    """Pictures by ``python -m docs.gallery NAME``; a missing one is a dead link, which is an error."""
    text = (pages / "gallery.md").read_text(encoding="utf-8")
    assert text.count("\n## ") == text.count("Its timeline]") + 1 == len(sections.CONFIGS) + 1  # sweeps
    sweeps = [config.stem for config in (ROOT / "configs" / "sweeps").glob("*.toml")]
    assert [name for name in sweeps if f"](figures/{name}.png)" not in text] == []


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path: Path) -> None:
    pytest.importorskip("sphinx", reason="pip install -e '.[docs]'")
    pytest.importorskip("furo", reason="pip install -e '.[docs]'")
    command = [sys.executable, str(ROOT / "docs" / "build.py"), str(tmp_path / "site"), "--code-only"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    search = (tmp_path / "site" / "searchindex.js").read_text(encoding="utf-8")
    assert "libration" in search
