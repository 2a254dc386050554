"""What somebody would write with heyoka and h5py alone: whole scripts, none of which knows of rigidsim.

Each prints a line of JSON: CPU and wall seconds of its work, imports apart, and the memory that it took.
``experiments.benchmark`` runs them beside rigidsim; they run by hand as well, for instance
``python experiments/bare/free_body_dense.py out.h5 1e5 1000001``.
"""
