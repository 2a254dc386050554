"""Running an experiment: integrate, save segments, complete the dataset, draw the timeline, summarise."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import rigidsim.summary as summaries
from rigidsim.archive import Run
from rigidsim.crossings import event_counts, event_variables
from rigidsim.guards import Guards, Interruption, Observer
from rigidsim.prepare import Prepared, double_twin, motion_growth, prepare
from rigidsim.scene.reading import Experiment, load
from rigidsim.solve.advance import Advance, Progress
from rigidsim.solve.evaluate import Evaluator
from rigidsim.solve.events import EventLog
from rigidsim.solve.lyapunov import LyapunovSpectrum, lyapunov_spectrum
from rigidsim.solve.status import Status
from rigidsim.solve.stepper import Stepper
from rigidsim.solve.winding import Winding
from rigidsim.store import netcdf, provenance, segments
from rigidsim.store.folder import RunFolder
from rigidsim.store.variables import SCHEMA_VERSION, Extra

if TYPE_CHECKING:
    from rigidsim.model.loads import LoadModel


def run(
    experiment: Experiment | str | Path,
    *,
    out: str | Path = "runs",
    force: bool = False,
    observer: Observer | None = None,
    loads: Sequence[LoadModel] = (),
) -> Run:
    """Run an experiment and save it in ``out/<name>/``.

    Args:
        experiment: from ``load``, or the path of a config.
        out: folder of the run folders.
        force: replace a run of the same name.
        observer: is told how it goes.
        loads: loads of one's own, beside those of the config, which alone can't reproduce the run then.

    Returns:
        The run; its ``status`` tells how it ended, which need not be "finished".

    Raises:
        ConfigError: the config can't be run; nothing was written.
        RunFolderError: the run folder is in use or can't be written.
    """
    if not isinstance(experiment, Experiment):
        experiment = load(experiment)
    observer = observer or Observer()
    clock = _Phases()
    cpu = time.process_time()
    prepared = prepare(experiment, loads=loads)
    folder = RunFolder(Path(out) / prepared.scene.name)
    folder.create(force=force)
    netcdf.write_bytes(folder.config, experiment.text.encode())

    winding = Winding(prepared.system.angle_states, prepared.precision, prepared.scene.context)
    log = EventLog([c.stop for c in prepared.system.crossings], winding.turns)
    stepper = Stepper(prepared.system, prepared.precision, prepared.tolerance, prepared.clock.at(0), log)
    evaluator = Evaluator(prepared.system, prepared.precision, winding)
    growth = motion_growth(prepared)
    attributes = _attributes(prepared, stepper)
    writer = segments.SegmentWriter(folder.segments, prepared.variables(), attributes)
    watch = summaries.Watch()
    interruption = Interruption()

    def sink(_: int, times: np.ndarray, states: np.ndarray, turns: np.ndarray) -> None:
        recorded: dict[str, list[np.ndarray]] = evaluator.evaluate(states, turns)
        exponent = prepared.clock.exponent
        recorded["time"] = [np.ldexp(part, exponent) for part in prepared.precision.parts(times)]
        for invariant in prepared.system.invariants:
            watch.see(invariant.name, recorded[f"{invariant.name}_drift"][0][:, 0])
        factors = evaluator.singular_factors(states)
        if factors is not None:
            watch.see_singular(factors, recorded["time"][0])
        writer.add(recorded)

    clock.next("build")
    observer.started(prepared, folder.path)
    observer.phase("integrate")
    guards = Guards(prepared, watch, interruption, observer, writer)
    advance = Advance(stepper, prepared.clock, winding, prepared.precision, sink, guards)
    with interruption.watching():
        progress = advance.run()
        if not progress.status.final:
            writer.flush()
        clock.next("integrate_and_record")
        observer.progressed(progress)
        spectrum = None
        if prepared.scene.config.output.lyapunov and progress.status is Status.FINISHED:
            observer.phase("lyapunov")
            spectrum = _lyapunov(prepared, interruption)
            clock.next("lyapunov")
            if interruption.requested:
                progress.status = Status.INTERRUPTED
                writer.flush()
    message = _message(prepared, progress, evaluator)
    summary = summaries.summarise(
        prepared,
        progress,
        watch,
        growth,
        spectrum,
        message=message,
        initial=evaluator.initial_invariants(),
        seconds=clock.seconds,
        cpu_seconds=time.process_time() - cpu,
        provenance=_plain(attributes),
    )
    last = float(prepared.clock.at(prepared.clock.count - 1))
    extras = event_variables(prepared, log, evaluator, last) + _extras(spectrum)
    summary["events"] = event_counts(prepared, log, last)
    summary["cost"]["seconds"]["engine"] = progress.integration_seconds
    try:
        if progress.status.final:
            _complete(prepared, folder, writer, attributes, summary, extras, clock, observer)
    except KeyboardInterrupt:
        kept = "the dataset is complete, the timeline is missing"
        if not folder.dataset.exists():
            writer.flush()
            kept = "all samples are saved as segments"
        summary |= {"status": Status.INTERRUPTED.value, "exit_code": Status.INTERRUPTED.exit_code}
        summary["message"] = f"interrupted after the integration; {kept}"
    summary["cost"]["cpu_seconds"] = time.process_time() - cpu
    folder.write_summary(summary)
    return Run(folder, json.loads(json.dumps(summary, default=str)))


def _complete(
    prepared: Prepared,
    folder: RunFolder,
    writer: segments.SegmentWriter,
    attributes: dict[str, Any],
    summary: dict[str, Any],
    extras: list[Extra],
    clock: _Phases,
    observer: Observer,
) -> None:
    """Segments to dataset, dataset to timeline."""
    observer.phase("dataset")
    cost = summary["cost"]
    final = {
        **attributes,
        "status": summary["status"],
        "status_message": summary["message"],
        "warnings": "\n".join(summary["warnings"]),
        "steps": cost["steps"],
        "wall_seconds": sum(clock.seconds.values()),
        "cpu_seconds": cost["cpu_seconds"],
        "finished_at": provenance.now(),
    }
    writer.complete(folder.dataset, final, extras)
    summary["dataset_sha256"] = provenance.file_sha256(folder.dataset)
    clock.next("dataset")
    output = prepared.scene.config.output
    if output.timeline and summary["samples"]:
        observer.phase("timeline")
        from rigidsim.look.timeline import write_timeline

        with Run(folder, summary).dataset as dataset:
            write_timeline(dataset, folder.timeline, rows=output.timeline_rows)
        clock.next("timeline")


def _lyapunov(prepared: Prepared, interruption: Interruption) -> LyapunovSpectrum | None:
    clock, last = prepared.clock, prepared.clock.count - 1
    system = double_twin(prepared)
    start, end = float(clock.at(0)), float(clock.at(last))
    return lyapunov_spectrum(system, start, end, lambda _: not interruption.requested)


def _extras(spectrum: LyapunovSpectrum | None) -> list[Extra]:
    """The convergence of the exponents, as variables of the dataset."""
    if spectrum is None:
        return []
    along = {"units": "s", "long_name": "time since the run's start, of the estimates"}
    what = {"units": "s-1", "long_name": "Lyapunov exponents of the scaled states so far, largest first"}
    return [
        Extra("lyapunov_time", ("lyapunov_time",), spectrum.times, along),
        Extra("lyapunov_exponents", ("lyapunov_time", "lyapunov_index"), spectrum.exponents, what),
    ]


class _Phases:
    """Wall seconds of each phase."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self._since = time.perf_counter()

    def next(self, finished: str) -> None:
        """Close the phase that was under way."""
        now = time.perf_counter()
        self.seconds[finished] = now - self._since
        self._since = now


def _attributes(prepared: Prepared, stepper: Stepper) -> dict[str, Any]:
    """Root attributes of segments and dataset."""
    scene, system = prepared.scene, prepared.system
    found = {f"version_{k}": v for k, v in provenance.versions().items()}
    found |= {f"code_{k}": v for k, v in provenance.code_target(stepper.integrator).items()}
    return {
        "Conventions": "CF-1.11",
        "title": scene.name,
        "comment": scene.description,
        "source": "rigidsim",
        "schema_version": SCHEMA_VERSION,
        "status": Status.RUNNING.value,
        "config": prepared.experiment.text,
        "config_sha256": prepared.experiment.sha256,
        "formulation": system.requirements.formulation,
        "euler_sequence": system.sequence,
        "states": " ".join(system.states),
        "precision": prepared.precision.name,
        "precision_bits": prepared.precision.bits,
        "tolerance": prepared.effective_tolerance,
        "integrator": "heyoka Taylor, natural steps, dense output",
        "taylor_order": int(stepper.integrator.order),
        "compact_mode": int(prepared.precision.compact or system.wide),
        "high_accuracy": 0,
        "batch_size": 1,
        "unit_exponents": json.dumps(
            {"time": system.scaling.time, "inertia": system.scaling.inertia,
             "states": system.state_exponents}
        ),
        "principal_moments": json.dumps([float(m) for m in scene.body.principal_moments]),
        "principal_axes": json.dumps([[float(x) for x in a] for a in scene.body.principal_axes]),
        "inertia_tensor": json.dumps([[float(x) for x in row] for row in scene.body.inertia]),
        "body_source": scene.body.source,
        "drawing": json.dumps(scene.body.drawing),
        "python_loads": " ".join(type(load).__name__ for load in prepared.python_loads),
        "cpu_model": provenance.cpu_model(),
        "started_at": provenance.now(),
        **found,
    }  # fmt: skip


def _plain(attributes: dict[str, Any]) -> dict[str, Any]:
    """The attributes that the summary repeats."""
    kept = ("config_sha256", "cpu_model", "started_at", "taylor_order", "compact_mode", "unit_exponents")
    return {k: v for k, v in attributes.items() if k in kept or k.startswith(("version_", "code_"))}


def _message(prepared: Prepared, progress: Progress, evaluator: Evaluator) -> str:
    """The status in words, with where and why for a run that broke down."""
    text = progress.status.message
    if progress.status not in (Status.NON_FINITE, Status.COLLAPSED):
        return text
    text += f"; last good state at {progress.time:.9g} s after {progress.steps} steps"
    if progress.last_good is None:
        return text
    state = np.array([progress.last_good.state], dtype=prepared.precision.scalar)
    factors = evaluator.singular_factors(state)
    if factors is not None and abs(float(factors[0])) < summaries.NEAR_SINGULAR:
        middle = float(state[0][prepared.system.states.index("theta")])
        text += (
            f"; the middle Euler angle theta = {middle:.9g} rad came within {abs(float(factors[0])):.2g} of "
            f'the singularity of {prepared.system.sequence}: choose formulation = "quaternion"'
        )
    else:
        largest = int(np.argmax(np.abs(state[0].astype(np.float64))))
        text += f"; the largest state there was {prepared.system.states[largest]}"
    return text
