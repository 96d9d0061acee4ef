# SPDX-License-Identifier: Apache-2.0
"""Published numbers compared with ours: what papers print, the runs behind them, verdicts, plans,
pages."""
