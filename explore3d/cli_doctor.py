"""explore3d doctor: is everything there?"""

from __future__ import annotations

import typer

from explore3d.cli_options import Json


def doctor(json: Json = False) -> None:
    """Check the installation and the serial ports; say what is missing and what it is needed for.

    The exit status is 1 if something is missing that the program cannot do without.

    Example: explore3d doctor
    """
    from dataclasses import asdict
    from json import dumps

    from explore3d.doctor import Check, examine

    def line(check: Check) -> str:
        remedy = f" -> {check.remedy}" if check.remedy else ""
        return f"{check.state:<8}{check.subject:<16}{check.found} ({check.needed_for}){remedy}"

    checks = examine()
    print(dumps([asdict(check) for check in checks]) if json else "\n".join(line(check) for check in checks))
    if any(check.state == "missing" for check in checks):
        raise typer.Exit(1)
