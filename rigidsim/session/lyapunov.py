"""The Lyapunov spectrum of a run, saved on the way because it costs tens of times as much as the run."""

import io
import time
from pathlib import Path

from rigidsim.errors import RESUME, RunFolderError, StoppedWritingError, once_mended
from rigidsim.session.dataset import LYAPUNOV_NAMES
from rigidsim.session.session import Interruption
from rigidsim.solve.lyapunov import Convergence, LyapunovSpectrum, lyapunov_spectrum
from rigidsim.solve.problem import InitialValueProblem, double_twin
from rigidsim.store import atomic, netcdf
from rigidsim.store.folder import RunFolder
from rigidsim.store.seal import check_seal, sealed
from rigidsim.store.variables import SCHEMA_VERSION, Extra


def spectrum_of(
    prepared: InitialValueProblem,
    folder: RunFolder | None,
    run_id: str,
    interruption: Interruption,
    save_seconds: float,
) -> LyapunovSpectrum | None:
    """Integrate the variational equations, or what remains of them; None if interrupted or not finite."""
    clock = prepared.clock
    system = double_twin(prepared)
    path = None if folder is None else folder.segments / "lyapunov.h5"
    saved = time.monotonic()

    def go_on(done: Convergence) -> bool:
        nonlocal saved
        stop = interruption.requested
        if path is not None and (stop or time.monotonic() - saved >= save_seconds):
            _save(path, done, run_id)
            saved = time.monotonic()
        return not stop

    start, end = float(clock.start), float(clock.at(clock.count - 1))
    return lyapunov_spectrum(system, start, end, go_on, None if path is None else _saved(path, run_id))


def _save(path: Path, done: Convergence, run_id: str) -> None:
    labels = {"run_id": run_id, "schema_version": SCHEMA_VERSION}
    buffer = io.BytesIO()
    with netcdf.writing(buffer) as file:
        file.attributes(labels)
        file.group("lyapunov", done)
    content = sealed(buffer)
    try:
        atomic.write_bytes(path, content)
    except OSError as error:
        raise StoppedWritingError(
            f"{path}: can't be written: {error.strerror or error}; all samples are saved as segments, and "
            f"{once_mended(error)}, {RESUME} continues with the exponents"
        ) from None


def _saved(path: Path, run_id: str) -> Convergence | None:
    """State saved by an earlier session; None, so that it is computed anew, if it is damaged or not this
    run's.
    """
    if not path.exists():
        return None
    try:
        check_seal(path)
        with netcdf.reading(path) as file:
            if str(file.attrs.get("run_id", "")) != run_id:
                return None
        return netcdf.read_group(path, "lyapunov")
    except (RunFolderError, KeyError):
        return None


def lyapunov_variables(spectrum: LyapunovSpectrum) -> list[Extra]:
    """Convergence of the exponents, as variables of the dataset."""
    along = {"units": "s", "long_name": "time since the run's start, of the estimates"}
    what = {
        "units": "s-1",
        "long_name": "Lyapunov exponents of the scaled states so far, largest first",
        "states": " ".join(spectrum.states),
    }
    time, index, exponents = LYAPUNOV_NAMES
    return [
        Extra(time, (time,), spectrum.times, along),
        Extra(exponents, (time, index), spectrum.exponents, what),
    ]
