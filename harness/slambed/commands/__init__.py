# SPDX-License-Identifier: Apache-2.0
"""Every command line: what it takes, what it prints, how it ends. Nothing else imports it."""
