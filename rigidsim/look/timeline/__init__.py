"""`timeline.rrd`: runs for the rerun viewer.

Importing this package loads rerun, so import it only where a timeline is written.

| module | holds |
| --- | --- |
| `writing` | `write_timeline`, `write_comparison`: datasets to files; `LiveRecording`; the viewer's page |
| `drawn` | all that is drawn of one run: stages, plots, planes, lanes of states, legend and clock |
"""

from rigidsim.look.timeline.writing import write_comparison, write_timeline

__all__ = ["write_comparison", "write_timeline"]
