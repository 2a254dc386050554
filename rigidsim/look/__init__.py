"""Pictures of a recorded run: rerun timeline, figures, viewer.

Importing this package loads nothing heavy.

| module | holds |
| --- | --- |
| `timeline` | `write_timeline`: dataset to `timeline.rrd` |
| `blueprint` | the page that the viewer opens with |
| `stage` | the three-dimensional scene as numbers: body, arrows, tracks |
| `drawing` | that scene and the plots as rerun entities |
| `roles` | residuals, drifts and what was put back, by the variables' attributes |
| `plots` | which variable goes into which plot |
| `clock` | seconds to the viewer's integer timelines |
| `readable_time` | spans in the unit that suits them, instants as dates, the axis of time |
| `page` | the summary page |
| `figures` | figures of a run by name, dataset to matplotlib, PNG or SVG: a package of its own |
| `figure_names` | their names, without any import |
| `work_precision` | the figure of `rigidsim tradeoff`: error against cost |
| `viewer` | `open_viewer`, `screenshot` |
| `solids` | triangle meshes of bodies, from the outlines of their shapes |
| `rows` | what pictures need of a dataset, as arrays |
| `thinning` | reading a bounded number of rows of a dataset of any length |
"""
