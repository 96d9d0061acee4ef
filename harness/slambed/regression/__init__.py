# SPDX-License-Identifier: Apache-2.0
"""Whether results got worse: gate over nights, trends, two folders compared, first bad commit."""
