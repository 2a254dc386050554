"""`timeline.rrd`: runs for the rerun viewer.

Importing this package loads rerun, so import it only where a timeline is written.

| module | holds |
| --- | --- |
| `writing` | `write_timeline`: dataset to `timeline.rrd`; `LiveRecording`: of a run that goes on; the file |
| `comparison` | `write_comparison`: several runs side by side |
| `drawn` | everything that is drawn of one run |
| `drawing`, `plotting` | stages, and plots, planes, legend and clock, as rerun entities |
| `blueprint` | the page that the viewer opens with, for one run and for several |
"""

from rigidsim.look.timeline.writing import write_timeline

__all__ = ["write_timeline"]
