"""Lyapunov exponents: zero for what is integrable, in pairs, and the same in other units of time."""

import math
from pathlib import Path

import numpy as np
import pytest
from support import config, run_text, same_bits

import rigidsim
from rigidsim.solve import lyapunov

BODY = ["wx", "wy", "wz", "qw", "qx", "qy", "qz"]
SATELLITE = config(
    "principal_moments = [0.59555, 0.85945, 1]",
    "angular_velocity = {rates}\neuler_angles = [{angle}, 0, 0]",
    'kind = "gravity_gradient"\ngravitational_parameter = {strength}\n'
    "orbit = {{semi_major_axis = 1, eccentricity = 0.1}}",
    "end = {end}\nsamples = 501",
    output='lyapunov = true\nrecord = ["angular_velocity", "quaternion"]',
)
FREE = config("principal_moments = [1, 2, 3]", "angular_velocity = [0.5, 0.25, 1]", output="lyapunov = true")


def chaotic(out: Path, unit: float = 1.0, end: float = 4000.0) -> rigidsim.Run:
    """Wisdom, Peale & Mignard 1984: start at 90 degrees with w = n; a tiny tilt of w lets it tumble."""
    rates = f"[{1e-3 / unit!r}, {1e-3 / unit!r}, {1 / unit!r}]"
    text = SATELLITE.format(rates=rates, angle=math.pi / 2, strength=repr(unit**-2.0), end=repr(end * unit))
    return run_text(text, estimate=True)


def test_convergence_is_in_the_dataset(runs: Path) -> None:
    run = chaotic(runs, end=200.0)
    estimates = run.dataset["lyapunov_exponents"]
    assert estimates.dims == ("lyapunov_time", "lyapunov_index")
    assert estimates.attrs["units"] == "s-1"
    # the orbit's states drive the motion and don't feel it, as an explicit dependence on time would
    assert run.summary["lyapunov"]["states"] == BODY
    assert estimates.attrs["states"] == "wx wy wz qw qx qy qz"
    assert estimates.sizes["lyapunov_index"] == 7 < len(run.summary["states"])
    assert float(run.dataset["lyapunov_time"][-1]) == pytest.approx(200.0, rel=1e-12)
    assert (np.diff(estimates.values, axis=1) <= 0).all()
    assert float(estimates[-1, 0]) == run.summary["lyapunov"]["largest_exponent"]
    assert run.summary["lyapunov"]["chaotic"]
    assert run.summary["lyapunov"]["e_folding_seconds"] == 1 / run.summary["lyapunov"]["largest_exponent"]


def test_a_free_body_is_regular() -> None:
    run = run_text(FREE, "time.end=1000", "time.samples=11", 'output.record=["quaternion"]')
    chaos = run.summary["lyapunov"]
    assert not chaos["chaotic"]
    assert chaos["predictable_seconds"] is None
    # integrable: offsets grow linearly, so that the estimate falls like log(t)/t
    assert 0 <= chaos["largest_exponent"] < 2 * math.log(1000) / 1000
    assert len(chaos["exponents"]) == len(run.summary["states"]) == 7


@pytest.mark.slow
@pytest.mark.unoptimised
def test_a_spectrum_that_was_interrupted_goes_on_with_the_same_bits(
    runs: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from rigidsim.session import lyapunov as spectra

    text = FREE.replace("end = 3\n", "end = 300\n")
    whole = run_text(text, 'name="whole"', out=runs)
    seen = []

    def impatient(prepared, folder, run_id, interruption, save_seconds):
        plain = lyapunov.lyapunov_spectrum

        def interrupted(system, start, end, go_on, done=None):
            def some(progress):
                seen.append(int(progress["number"][0]))
                interruption.requested = interruption.requested or len(seen) in (5, 11)
                return go_on(progress)

            return plain(system, start, end, some, done)

        monkeypatch.setattr(spectra, "lyapunov_spectrum", interrupted)
        return spectrum_of(prepared, folder, run_id, interruption, save_seconds)

    spectrum_of = spectra.spectrum_of
    monkeypatch.setattr("rigidsim.session.lyapunov.spectrum_of", impatient)
    run = run_text(text, out=runs)
    assert run.status == "interrupted"
    for _ in range(2):
        run = rigidsim.resume(run.folder.path)
    assert run.status == "finished"
    assert seen == list(range(1, len(seen) + 1))  # nothing was done twice
    same_bits(run, whole)
