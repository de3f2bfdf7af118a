"""`jacokin doctor`: is everything that is needed installed, and does it work?"""

from __future__ import annotations

from jacokin.cli.arguments import options
from jacokin.cli.display import json_output, tables
from jacokin.cli.exit_codes import NOT_SOLVED


def doctor(json: options.JsonOption = False) -> None:
    """Check the installation.

    Versions and places of the packages, QP solvers, shadowed packages, rendering, cache of the kernels.

    Exit code: 0 when everything needed works, 1 otherwise.

    Examples:
      jacokin doctor
    """
    from jacokin.cli.doctor import checks
    from jacokin.cli.doctor.finding import FAILED

    findings = checks.all_findings()
    well = not any(finding.state == FAILED for finding in findings)
    if json:
        json_output.print_json(
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
        tables.say(tables.table(None, ("area", "what", "state", "detail"), rows, text=4))
        tables.say("Everything needed works." if well else "Something that is needed does not work, see FAILED above.")
    if not well:
        raise SystemExit(NOT_SOLVED)
