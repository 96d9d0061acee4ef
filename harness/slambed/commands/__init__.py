# SPDX-License-Identifier: Apache-2.0
"""The command line: arguments, output and exit codes of every command. Nothing else imports this
package."""
