"""Methods, formulations and models that a config can name, and what each can do.

Whoever has to treat them differently asks for an ability here, or in ``rigidsim.solve.solvers`` and
``rigidsim.model.formulations``, which say how they solve a scene: never for a name.
"""

from __future__ import annotations

from dataclasses import dataclass

AUTO = "auto"
MEAN = "mean"
"""``[model] start`` of an averaged motion that begins where it is given."""
FULL, SPIN_AVERAGED, ORBIT_AVERAGED = "full", "spin_averaged", "orbit_averaged"
REDUCED = (SPIN_AVERAGED, ORBIT_AVERAGED)
"""Levels that carry only the momentum's direction; later ones average more."""


@dataclass(frozen=True)
class Method:
    """A method by which a motion is found.

    Attributes:
        name: as in configs, summaries and datasets.
        title: name in sentences and tables.
        described: what it is, for the description of the key.
        has_steps: whether it integrates any equations step by step. One without steps gives the states at
            any time from a solution that is known, and has no tolerance.
    """

    name: str
    title: str
    described: str
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


DEFAULT_FORMULATION = "quaternion"
"""Regular everywhere: in it settings are tried, and questions about a motion itself are asked."""


@dataclass(frozen=True)
class Variables:
    """Variables in which a rotation is integrated.

    Attributes:
        name: as in configs, summaries and datasets.
        described: what they are, for the description of the key; empty if the name says it.
        keeps_attitude: whether the attitude follows from them.
        general: whether they describe any motion's attitude, so that settings can be compared in them.
        regular: whether they have no singularity that a motion may come near. Neighbours of a motion in
            others, and what happens between its samples, are followed in quaternions.
        in_closed_form: whether closed forms give them.
        checked_by: variables that round otherwise, with which their errors are checked.
        caveat: what a motion in them can't show, reported with the results.
    """

    name: str
    described: str = ""
    keeps_attitude: bool = True
    general: bool = True
    regular: bool = True
    in_closed_form: bool = False
    checked_by: str = DEFAULT_FORMULATION
    caveat: str = ""


FORMULATIONS: dict[str, Variables] = {
    variables.name: variables
    for variables in (
        Variables("rates", keeps_attitude=False, general=False, in_closed_form=True),
        Variables(DEFAULT_FORMULATION, in_closed_form=True, checked_by="rotation_matrix"),
        Variables("rotation_matrix"),
        Variables("euler_angles", regular=False),
        Variables("canonical", "Euler angles and their momenta", regular=False),
        Variables(
            "planar",
            "an angle and its rate, for a body that turns about one axis",
            general=False,
            caveat="in its plane alone: whether a small push out of the plane would grow isn't examined",
        ),
    )
}


def variables_named(name: str) -> Variables:
    """Variables by name; unknown ones (averaged, of a later version) give an attitude."""
    return FORMULATIONS.get(DEFAULT_FORMULATION if name == AUTO else name) or Variables(name, general=False)


def attitude_variables(asked: str) -> str:
    """The formulation in which the attitude of a config is integrated that asks for another."""
    variables = variables_named(asked)
    return variables.name if variables.keeps_attitude else DEFAULT_FORMULATION
