"""What somebody would write with heyoka and h5py alone: whole scripts, none of which knows of rigidsim.

Each prints a line of JSON: CPU and wall seconds of its work, imports apart, and the memory that it took.
``experiments.benchmark`` runs them beside rigidsim; they run by hand as well, for instance
``python experiments/bare/free_body_dense.py out.h5 1e5 1000001``.

``moon`` is larger: the Moon of JPL's packages with everything that turns it (``blocks`` reads the packages,
``mechanics`` has the torques, for numbers and expressions alike), an independent truth for rigidsim's own.
"""
