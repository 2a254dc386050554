"""Methods that a config can name in ``[integrator] method``, and what each can do.

Whoever has to treat methods differently asks for an ability here, never for a name. How they solve a scene is
told by ``rigidsim.solve.solvers``.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Method:
    """A method by which a motion is found.

    Attributes:
        name: as in configs, summaries and datasets.
        title: name in sentences and tables.
        told: what it is, for the description of the key.
        has_steps: whether it integrates any equations step by step. One without steps gives the states at
            any time from a solution that is known, and has no tolerance.
    """

    name: str
    title: str
    told: str
    has_steps: bool = True


DEFAULT_METHOD = "taylor"
METHODS: dict[str, Method] = {
    method.name: method
    for method in (
        Method(DEFAULT_METHOD, "Taylor series", "Taylor series step by step"),
        Method(
            "closed_form",
            "closed form",
            "for a free body or a heavy symmetric top, theta functions at a cost independent of the time",
            has_steps=False,
        ),
    )
}


def method_named(name: str) -> Method:
    """The method of a summary or dataset; one of a later version is taken to have steps."""
    return METHODS.get(name) or Method(name, name.replace("_", " "), "")
