# SPDX-License-Identifier: Apache-2.0
"""Where the command begins: nobody else's packages are imported before it is known whose they
are."""

from slambed.isolation import isolate


def main() -> None:
    """The `slambed` command, with the packages of its own environment."""
    isolate()
    from slambed.commands.main import main as slambed

    slambed()
