"""One run of rigidsim in this process, timed as the scripts in ``experiments/bare`` time theirs.

python -m experiments.benchmarking.ours CONFIG OUT             a run folder, imports apart
python -m experiments.benchmarking.ours CONFIG --again TIMES   in memory, in a warm process, the median
"""

import json
import resource
import statistics
import sys
import time
from pathlib import Path


def in_a_folder(config: Path, out: Path) -> dict[str, float]:
    """From the text of a config to the files of the run."""
    import rigidsim
    import rigidsim.workflows.run

    text = config.read_text()
    if "timeline = true" in text:  # imports apart
        import h5netcdf.legacyapi  # noqa: F401
        import xarray

        import rigidsim.look.timeline

        xarray.Variable((), 0.0)  # imports dask where it is installed
    run, parse = rigidsim.run, rigidsim.parse
    began, cpu = time.perf_counter(), time.process_time()
    done = run(parse(text), out=out)
    found = {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - began}
    if done.status != "finished":
        raise SystemExit(done.summary["message"])
    return found | {"peak": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}


def again(config: Path, times: int) -> dict[str, float]:
    """Median CPU seconds of a run in memory."""
    import rigidsim

    text = config.read_text()
    experiment = rigidsim.parse(text)
    rigidsim.run(experiment, out=None)

    def seconds() -> float:
        started = time.process_time()
        rigidsim.run(experiment, out=None)
        return time.process_time() - started

    return {"cpu": statistics.median(seconds() for _ in range(times))}


def main() -> None:
    """Print a line of JSON."""
    config, *rest = sys.argv[1:]
    if rest[0] == "--again":
        print(json.dumps(again(Path(config), int(rest[1]))))
    else:
        print(json.dumps(in_a_folder(Path(config), Path(rest[0]))))


if __name__ == "__main__":
    main()
