"""Pictures of a recorded run: rerun timeline, figures, viewer.

Importing this package loads nothing heavy.

| module | holds |
| --- | --- |
| `timeline` | `write_timeline`: dataset to `timeline.rrd` |
| `stages` | stages by kind of scene, as numbers: a package of its own |
| `surroundings` | what stands around the body, from the dataset's attributes |
| `signals` | what pictures show, recorded or worked out |
| `states` | events and the end of a run as lanes, sections |
| `drawn` | everything that is drawn of one run |
| `recording` | a recording of rerun written to a file |
| `blueprint`, `comparison_page` | the page that the viewer opens with, for one run and for several |
| `drawing`, `plotting` | stages, and plots, planes, legend and clock, as rerun entities |
| `comparison` | `write_comparison`: several runs side by side |
| `live` | `follow`: a run that goes on |
| `film` | `render`: pictures and films of a timeline |
| `roles` | residuals, drifts and what was put back, by the variables' attributes |
| `plots` | which variable goes into which plot |
| `clock` | seconds to the viewer's integer timelines |
| `page` | the summary page |
| `figures` | figures of a run by name, dataset to matplotlib, PNG or SVG: a package of its own |
| `figure_names` | their names, without any import |
| `work_precision` | the figure of `rigidsim tradeoff`: error against cost |
| `viewer` | `open_viewer`, `HeadlessViewer`, `screenshot` |
| `symbols` | toy tops, globes, edges and meridians |
| `coasts` | the Earth's continents |
| `solids` | triangle meshes of bodies, from the outlines of their shapes |
| `rows` | what pictures need of a dataset, as arrays |
| `thinning` | reading a bounded number of rows of a dataset of any length |
"""
