"""``rigidsim analyse``: secular rates and labelled lines of a run, as a table, a dataset and a figure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import xarray

from rigidsim.analysis.analyse import analyse_dataset
from rigidsim.analysis.labels import Known
from rigidsim.analysis.result import Analysis
from rigidsim.errors import ConfigError, RigidsimError
from rigidsim.look.signals import is_averaged
from rigidsim.scene.arithmetic import norm
from rigidsim.scene.scene import Scene, build_scene
from rigidsim.store.outputs import refuse_loss
from rigidsim.store.run import Run
from rigidsim.workflows.compare.as_run import open_any
from rigidsim.workflows.known_frequencies import OF_ROTATION, known_frequencies
from rigidsim.workflows.read import parse

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FIGURES = (".png", ".svg")


class DrawnAnalysis(Analysis):
    """An analysis with its picture."""

    def figure(self) -> Figure:
        """Spectra with their lines marked and named, as a matplotlib figure."""
        from rigidsim.look.figures.spectrum import spectrum_figure

        return spectrum_figure(self.dataset)


def analyse(
    source: xarray.Dataset | Run | str | Path,
    variables: str | Sequence[str] = (),
    *,
    lines: int = 20,
    floor: float = 1e-12,
    known: Mapping[str, Any] | None = None,
    window: int | None = None,
) -> DrawnAnalysis:
    """Secular rates and spectral lines of a run, or of any dataset with equidistant ``time`` in s.

    Args:
        source: a dataset, a run, the path of one, or a trajectory of another tool (docs/compare.md). Lines
            are labelled with the frequencies of the scene that the dataset's attribute ``config`` describes.
        variables: names of variables, or of their signals (``obliquity.figure``, ``polar_motion.m1+im2``); by
            default the main signals of the scene.
        lines: largest number of lines per signal.
        floor: lines below this share of a signal's strongest are left out.
        known: frequencies (rad/s) by name, in place of the scene's or if there is no scene.
        window: order of the Hann window; by default as the distances of lines allow.

    Returns:
        Frequencies (rad/s), amplitudes (the variable's unit) and phases (rad, at time zero) with errors and
        labels; ``.dataset`` has them as arrays.

    Raises:
        RigidsimError: samples aren't equidistant, not finite or too few, or there is no such variable.
        RunFolderError: no run there, or a damaged one.
    """
    chosen = (variables,) if isinstance(variables, str) else tuple(variables)
    options: dict[str, Any] = {"lines": lines, "floor": floor, "order": window}
    if isinstance(source, (str, Path)):
        source = open_any(source)
    if isinstance(source, Run):
        with source.dataset as dataset:
            options["attitude_error"] = source.attitude_error
            return _analysed(dataset, chosen, known, options)
    return _analysed(source, chosen, known, options)


def _analysed(
    dataset: xarray.Dataset,
    chosen: Sequence[str],
    given: Mapping[str, Any] | None,
    options: Mapping[str, Any],
) -> DrawnAnalysis:
    scene, names = _scene(dataset), list[Known]()
    averaged = is_averaged(dataset.attrs)  # which leaves no rotation
    if given is not None:
        names = [Known(name, value, 0.0, "given") for name, value in given.items()]
    elif scene is not None:
        names = known_frequencies(scene, driven=bool(dataset.attrs.get("python_loads")))
        names = [k for k in names if not averaged or k.name not in OF_ROTATION]
    fastest = 0.0 if scene is None or averaged else float(norm(scene.context, scene.angular_velocity))
    found = analyse_dataset(dataset, chosen, known=names, fastest=fastest, **options)
    return DrawnAnalysis(**vars(found))


def _scene(dataset: xarray.Dataset) -> Scene | None:
    text = dataset.attrs.get("config")
    if not isinstance(text, str):
        return None
    try:
        return build_scene(parse(text, source="the dataset's config"))
    except ConfigError:  # the config is of another version: the numbers are valid all the same
        return None


@dataclass(frozen=True)
class Saved:
    """Paths to which an analysis was written."""

    dataset: Path
    figure: Path


def places_of(out: Path, inputs: Iterable[Path], *, force: bool = False) -> Saved:
    """Where an analysis of some files may be written: its dataset at ``out``, the figure with that name.

    Raises:
        RigidsimError: a file would be replaced (``store.outputs``), or ``out`` is a picture's name.
    """
    if out.suffix.lower() in FIGURES:
        raise RigidsimError(
            f"{out}: the dataset is no picture; give --out FILE.h5, the figure goes next to it"
        )
    places = Saved(out, out.with_suffix(".png"))
    refuse_loss([places.dataset, places.figure], inputs, force=force)
    return places
