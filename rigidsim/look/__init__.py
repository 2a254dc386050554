"""Pictures of a recorded run, from its dataset alone: rerun timeline, figures, viewer.

Two folders load what draws, and are imported only where a picture is drawn: `timeline` loads rerun,
`figures` matplotlib. All else is numbers and texts, for both.

| module | holds |
| --- | --- |
| `timeline` | `write_timeline`, `write_comparison`: datasets to a recording of rerun; a package of its own |
| `figures` | figures by name, dataset to matplotlib, PNG or SVG; a package of its own |
| `figure_names` | their names, without any import |
| `stages` | stages by kind of scene, as numbers; a package of its own |
| `plots`, `page`, `states` | variables to plots; the summary page; lanes of events, and sections |
| `thinning`, `signals` | a bounded number of rows of a dataset; what they tell and show |
| `fits`, `librations` | secular parts, periods and ellipses; a body that turns one face to its source |
| `surroundings` | what stands around the body, from the dataset's attributes |
| `solids`, `symbols` | meshes of bodies; toy tops, globes with their continents, edges |
| `viewer`, `film` | the viewer, also of a run that goes on; pictures and films of a timeline |
"""
