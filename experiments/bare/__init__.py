"""What somebody would write with heyoka and h5py alone: whole scripts, none of which knows of rigidsim.

Each prints a line of JSON: CPU and wall seconds of its work, imports apart, and the memory that it took.
``experiments.benchmark`` runs them beside rigidsim; they run by hand as well, for instance ``python
experiments/bare/free_body_dense.py out.h5 1e5 1000001``.

``moon`` and ``earth`` are larger: the Moon of JPL's packages with everything that turns it, and a rigid
Earth under Moon, Sun and planets, independent truths for rigidsim's own (``blocks`` reads the packages,
``mechanics`` has the torques, for numbers and expressions alike). They are run as modules: ``python -m
experiments.bare.moon``.
"""
