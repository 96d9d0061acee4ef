# SPDX-License-Identifier: Apache-2.0
"""What the live link tests share: namespaces, the built relay, reasons to skip."""

import os
from pathlib import Path

import pytest

from slambed.errors import SlambedError
from slambed.native import find_program


def why_no_relay() -> str:
    """Why the relay cannot run here; empty when it can."""
    if os.geteuid() != 0:
        return "needs root for network namespaces"
    if not Path("/dev/net/tun").exists():
        return "needs /dev/net/tun"
    try:
        find_program("slambed-relay")
    except SlambedError as error:
        return str(error)
    return ""


needs_relay = pytest.mark.skipif(bool(why_no_relay()), reason=why_no_relay() or "-")
needs_root = pytest.mark.skipif(os.geteuid() != 0, reason="needs root for network namespaces")
