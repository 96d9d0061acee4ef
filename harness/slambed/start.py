# SPDX-License-Identifier: Apache-2.0
"""Entry point that isolates the environment before any third-party import."""

from slambed.isolation import isolate


def main() -> None:
    """Runs the `slambed` command with the packages of its own environment."""
    isolate()
    from slambed.commands.main import main as slambed

    slambed()
