"""Property tests here have no deadline: a shared machine pauses now and then."""

from hypothesis import settings

settings.register_profile("rigidsim", deadline=None, max_examples=25)
settings.load_profile("rigidsim")
