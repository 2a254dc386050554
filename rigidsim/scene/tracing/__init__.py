"""Tracing: numbers of a scene that is worked out once for all members of a sweep."""
