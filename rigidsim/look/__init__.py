"""Pictures of a recorded run, from its dataset alone: rerun timeline, figures, viewer.

Three folders load what draws, and are imported only where a picture is drawn: `timeline` and `stages` load
rerun, `figures` matplotlib. All else is numbers and texts, for both.

| module | holds |
| --- | --- |
| `timeline` | `write_timeline`, `write_comparison`: datasets to a recording of rerun; a package |
| `figures` | figures by name, dataset to matplotlib, PNG or SVG; a package |
| `figure_names` | their names, without any import |
| `record`, `signals` | the recorded scene of a dataset; its quantities and times |
| `curves`, `paths` | what is drawn over time, and in planes, in one form for both |
| `pages` | what a scene shows first, its numbers in words, pages of text |
| `stages` | stages by kind of scene, as entities of rerun; a separate package |
| `sources`, `gyrostats` | what pulls at a body, and librations; bodies with rotors |
| `fits` | secular parts, periods and ellipses, by ``analysis`` |
| `thinning` | a bounded number of a dataset's rows |
| `solids` | meshes of bodies, toy tops, globes and maps, edges |
| `viewer`, `film` | the viewer, also of a run that goes on; pictures and films of a timeline |
"""
