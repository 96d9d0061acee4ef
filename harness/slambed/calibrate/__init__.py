# SPDX-License-Identifier: Apache-2.0
"""Cost models of devices: fitted to measured stages, or scaled to a paper's times."""
