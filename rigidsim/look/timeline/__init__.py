"""`timeline.rrd`: runs for the rerun viewer.

Importing this package loads rerun, so import it only where a timeline is written.

| module | holds |
| --- | --- |
| `writing` | `write_timeline`, `write_comparison`: datasets to files; `LiveRecording`: of a running one |
| `drawn` | everything that is drawn of one run: stages, plots, planes, lanes of states, legend and clock |
| `blueprint` | the page that the viewer opens with, for one run and for several |
"""

from rigidsim.look.timeline.writing import write_comparison, write_timeline

__all__ = ["write_comparison", "write_timeline"]
