"""Closed-form solutions, whose cost doesn't depend on the time requested."""

from rigidsim.solve.closed_form.arithmetic import NoClosedForm
from rigidsim.solve.closed_form.solution import ClosedForm, closed_form_of, find_closed_form

__all__ = ["ClosedForm", "NoClosedForm", "closed_form_of", "find_closed_form"]
