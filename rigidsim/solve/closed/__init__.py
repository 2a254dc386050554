"""Solutions in closed form, at a cost that doesn't depend on the time asked for."""

from rigidsim.solve.closed.form import ClosedForm, closed_form_of

__all__ = ["ClosedForm", "closed_form_of"]
