"""Every branch of a six-joint Jaco in closed form. Read `solver` first."""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.ik.closed_form.branch_table import BestBranches as BestBranches
    from jacokin.ik.closed_form.branch_table import BranchTable as BranchTable
    from jacokin.ik.closed_form.compilation import warmup as warmup
    from jacokin.ik.closed_form.solver import ClosedForm as ClosedForm

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.ik.closed_form.branch_table": ("BestBranches", "BranchTable"),
        "jacokin.ik.closed_form.compilation": ("warmup",),
        "jacokin.ik.closed_form.solver": ("ClosedForm",),
    },
)
