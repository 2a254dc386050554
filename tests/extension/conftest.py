"""What a module of this folder registers, by its ``register``, is there for its own tests alone."""

from collections.abc import Iterator

import pytest

from rigidsim.scene import registry
from rigidsim.scene.expressions import names


@pytest.fixture(autouse=True)
def registries(request: pytest.FixtureRequest) -> Iterator[None]:
    providers = list(names.PROVIDERS)
    kept = {id(known): dict(known) for known in (registry.LOADS["kind"], registry.OBSERVABLES)}
    getattr(request.module, "register", lambda: None)()
    yield
    names.PROVIDERS[:] = providers
    for known in (registry.LOADS["kind"], registry.OBSERVABLES):
        known.clear()
        known.update(kept[id(known)])
