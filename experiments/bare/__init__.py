"""What somebody would write with heyoka and h5py alone: whole scripts, none of which knows of rigidsim.

``free_body`` prints a line of JSON: CPU and wall seconds of its work, imports apart, and the memory that it
took. ``experiments.benchmark`` runs it beside rigidsim; it runs by hand as well, for instance ``python
experiments/bare/free_body.py dense out.h5 1e5 1000001``.

``moon`` and ``earth`` are larger: the Moon of JPL's packages with everything that turns it, and a rigid
Earth under Moon, Sun and planets, independent truths for rigidsim's own (``blocks`` reads the packages,
``mechanics`` has the torques, for numbers and expressions alike). ``experiments.real_moon`` and the tests run
them. ``deep_time`` follows a precession through 100 million years (docs/accuracy.md).
"""
