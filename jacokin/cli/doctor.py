"""`jacokin doctor`: is everything that is needed installed, and does it work?"""

from __future__ import annotations

import typer

from jacokin.cli import output
from jacokin.cli.arguments import JsonOption

NOT_WELL = 1  # exit code


def doctor(json: JsonOption = False) -> None:
    """Check the installation.

    Versions and places of the packages, QP solvers, shadowed packages, rendering, cache of the kernels.

    Exit code: 0 when everything needed works, 1 otherwise.

    Examples:
      jacokin doctor
    """
    from jacokin.cli import doctor_checks

    findings = doctor_checks.all_findings()
    well = not any(finding.state == doctor_checks.FAILED for finding in findings)
    if json:
        output.print_json(
            {
                "ok": well,
                "findings": [
                    {"area": finding.area, "name": finding.name, "state": finding.state, "detail": finding.detail}
                    for finding in findings
                ],
            }
        )
    else:
        rows = [(finding.area, finding.name, finding.state, finding.detail) for finding in findings]
        screen = output.console()
        screen.print(output.table(None, ("area", "what", "state", "detail"), rows, text=4))
        screen.print(
            "Everything needed works." if well else "Something that is needed does not work, see FAILED above."
        )
    if not well:
        raise typer.Exit(NOT_WELL)
